"""Results of a sweep: one row per run, as an xarray Dataset, Parquet or CSV, and a summary with intervals."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.storage.export_formats import missing_package
from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.study.confidence_intervals import check_level, mean_interval, share_interval
from flocking.study.sweeps.measures import VERDICT
from flocking.study.sweeps.plan import Plan, label, stand_for_themselves
from flocking.study.sweeps.table_files import alike, put, write_csv
from flocking.study.sweeps.worker_tasks import Row

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class SweepTable:
    """Results of the runs of a sweep.

    Parameters
    ----------
    plan
        The planned runs.
    rows
        Outcomes by the number of the run; fewer than planned when the sweep was interrupted.
    measures
        Names of the measures.
    record
        Record of the sweep.
    status
        ``"finished"`` or ``"interrupted"``.
    """

    plan: Plan
    rows: Mapping[int, Row]
    measures: tuple[str, ...]
    record: Mapping[str, object] = field(default_factory=dict)
    status: str = "finished"

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        """In one line."""
        failed = f", {len(self.failures)} failed" if self.failures else ""
        return (
            f"<SweepTable {len(self.rows)} of {self.plan.size} runs, {self.status}{failed}: {', '.join(self.measures)}>"
        )

    @property
    def versions(self) -> tuple[dict[str, object], ...]:
        """Versions of this library, NumPy and Python that made the rows; several where a sweep went on with others."""
        named = self.record.get("provenance")
        return tuple(
            dict(made) for made in (named if isinstance(named, list) else [named]) if isinstance(made, Mapping)
        )

    def _repr_html_(self) -> str:
        """In a notebook: one line, and folded the rows."""
        from html import escape

        from flocking.formula.markup.cells import folded, rows_table

        names = [name for name in self.columns if name not in ("message", "tries")]
        rows = zip(*(self.columns[name] for name in names), strict=True)
        measured = [name in (*self.measures, "seconds") for name in names]
        # Values of parameters are shown in full: two of one axis may differ in a late digit.
        shown = [
            [
                escape(f"{x:.4g}" if short and isinstance(x, float) else str(x))
                for x, short in zip(row, measured, strict=True)
            ]
            for row in rows
        ]
        return folded(repr(self).strip("<>"), rows_table(names, shown))

    def plot(
        self, x: str, y: str, hue: str | None = None, *, save_as: str | Path | None = None, theme: str = "light"
    ) -> Figure:
        """Draw the results; the arguments are those of `flocking.plot_sweep`.

        Parameters
        ----------
        x, y
            A parameter and a measure, two measures, or two parameters.
        hue
            A parameter for curves or colours of dots, the measure of a map of two parameters.
        save_as
            Where files are written; nowhere by default.
        theme
            ``"light"`` or ``"dark"``.

        Returns
        -------
        matplotlib.figure.Figure
            The figure.

        Raises
        ------
        InvalidInput
            If the names are unknown, or do not go together.
        """
        # By its public name: pictures are drawn on a floor above.
        import flocking

        return flocking.plot_sweep(self, x, y, hue, save_as=save_as, theme=theme)

    @property
    def complete(self) -> bool:
        """Whether every planned run has a row."""
        return len(self.rows) == self.plan.size

    @property
    def failures(self) -> list[dict[str, object]]:
        """Parameters, seed and message of every run that failed."""
        found = []
        for index in sorted(self.rows):
            if (row := self.rows[index])["status"] == "failed":
                task = self.plan.task(index)
                found.append({**task.parameters, "seed": task.seed, "message": row["message"], "tries": row["tries"]})
        return found

    @cached_property
    def claims(self) -> tuple[str, ...]:
        """Keys of the claims that were audited."""
        return tuple(dict.fromkeys(key for index in sorted(self.rows) for key in self.rows[index]["verdicts"]))

    @cached_property
    def columns(self) -> dict[str, Sequence[object]]:
        """One list per column, one entry per run that has a row, in the order of the plan."""
        order = sorted(self.rows)
        tasks = [self.plan.task(index) for index in order]
        found: dict[str, Sequence[object]] = {"run": order}
        for name in self.plan.names:
            values = [task.parameters[name] for task in tasks]
            plain = name not in self.plan.grid or stand_for_themselves(self.plan.grid[name])
            found[name] = values if plain else [label(v) for v in values]
        found["seed"] = [task.seed for task in tasks]
        rows = [self.rows[index] for index in order]
        found["status"] = [row["status"] for row in rows]
        found["message"] = [row["message"] for row in rows]
        found["seconds"] = [row["seconds"] for row in rows]
        found["tries"] = [row["tries"] for row in rows]
        for name in self.measures:
            found[name] = [row["values"].get(name) for row in rows]
        for key in self.claims:
            found[VERDICT + key] = [row["verdicts"].get(key) for row in rows]
        return found

    def is_share(self, measure: str) -> bool:
        """Whether a measure is a truth value in every run in which it exists, so that its mean is a share."""
        values = [row["values"][measure] for row in self.rows.values() if measure in row["values"]]
        exist = [value for value in values if value == value]
        return bool(exist) and all(isinstance(value, bool) for value in exist)

    def values(self, measure: str) -> Array:
        """A measure of every run, shape (points, runs per point); nan where a run failed or is missing.

        Raises
        ------
        InvalidInput
            When there is no such measure.
        """
        if measure not in self.measures:
            raise InvalidInput("SweepTable", "measure", f"must be one of {', '.join(self.measures)}", measure)
        found = np.full(self.plan.size, np.nan)
        for index, row in self.rows.items():
            if measure in row["values"]:
                found[index] = float(row["values"][measure])
        return found.reshape(self.plan.points, self.plan.runs_per_point)

    @cached_property
    def different(self) -> list[list[Row]]:
        """Rows of each point, without those whose scenario and results are those of another: they are one run."""
        found: list[list[Row]] = [[] for _ in range(self.plan.points)]
        keys = {k: (k // self.plan.runs_per_point, self.rows[k].get("scenario", "")) for k in sorted(self.rows)}
        often, seen = Counter(keys.values()), set()
        for index, (point, scenario) in keys.items():
            row = self.rows[index]
            if scenario and often[point, scenario] > 1:
                if (key := (point, scenario, _results(row))) in seen:
                    continue
                seen.add(key)
            found[point].append(row)
        return found

    @cached_property
    def without_effect(self) -> tuple[str, ...]:
        """Parameters of the grid that change no scenario, as far as runs with equal seeds show it.

        Scenarios with parts that are not registered are not compared, nor are those of other seeds, which every run
        has where ``seeds`` is a number.
        """
        known = [(k, row["scenario"]) for k, row in sorted(self.rows.items()) if row.get("scenario")]
        if isinstance(self.plan.seeds, int) or not known:
            return ()
        shape, found = tuple(self.plan.lengths.values()), []
        for axis, (name, values) in enumerate(self.plan.grid.items()):
            # The number of the run with the same seed and other parameters at the first value.
            places = np.array(np.unravel_index([k for k, _ in known], shape))
            places[axis] = 0
            groups: dict[int, list[str]] = {}
            for first, (_, digest) in zip(np.ravel_multi_index(tuple(places), shape).tolist(), known, strict=True):
                groups.setdefault(first, []).append(digest)
            several = [digests for digests in groups.values() if len(digests) == len(values) > 1]
            if several and all(len(set(digests)) == 1 for digests in several):
                found.append(name)
        return tuple(found)

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """All results with labelled dimensions: the parameters of the grid, drawn points, and runs of each point."""
        import xarray

        lengths = self.plan.lengths
        names, shape = tuple(lengths), tuple(lengths.values())
        variables: dict[str, object] = {}
        for measure in self.measures:
            variables[measure] = (names, self.values(measure).reshape(shape))
        size = self.plan.size
        states = np.full(size, "missing", dtype=object)
        messages, seconds, tries = np.full(size, "", dtype=object), np.full(size, np.nan), np.zeros(size, dtype=int)
        for index, row in self.rows.items():
            states[index], messages[index] = row["status"], row["message"]
            seconds[index], tries[index] = row["seconds"], row["tries"]
        for name, column in (("status", states), ("message", messages)):
            variables[name] = (names, column.astype(str).reshape(shape))
        variables["seconds"] = (names, seconds.reshape(shape), {"units": "s"})
        variables["tries"] = (names, tries.reshape(shape))
        for key in self.claims:
            verdicts = np.array([self.rows[k]["verdicts"].get(key, "") if k in self.rows else "" for k in range(size)])
            variables[VERDICT + key] = (names, verdicts.reshape(shape))
        return xarray.Dataset(variables, self._coordinates(with_runs=True), {"provenance": json.dumps(self.record)})

    def _coordinates(self, *, with_runs: bool) -> dict[str, object]:
        found: dict[str, object] = {}
        for name, values in self.plan.grid.items():
            found[name] = list(values) if stand_for_themselves(values) else [label(v) for v in values]
        for name, column in self.plan.drawn.items():
            found[name] = ("sample", list(column))
        if with_runs and isinstance(self.plan.seeds, int):
            seeds = np.array([self.plan.task(k).seed for k in range(self.plan.size)])
            found["seed"] = (tuple(self.plan.lengths), seeds.reshape(tuple(self.plan.lengths.values())))
        elif with_runs:
            found["seed"] = list(self.plan.seeds)  # type: ignore[arg-type]
        return found

    def summary(self, level: float = 0.95) -> xarray.Dataset:
        """Mean of each measure at each point, with its interval: ``NAME``, ``NAME_low`` and ``NAME_high``.

        The interval is Clopper and Pearson's for truth values, whose mean is a share, else that of `mean_interval`,
        which needs a number of values (8 at 95 %). ``NAME_interval`` is the method, or why there is no interval; its
        ends are then nan. Numbers that are nan or of runs that failed are left out; ``NAME_count`` counts the others.
        Where a truth value is unknown in some runs (nan, or the run failed), which may be those in which it is true,
        there is no mean, and the interval covers the share whatever it is in them. ``runs`` and ``failed`` count the
        runs. Those of a point whose scenarios are equal, as where the seed changes nothing, are one run and count once:
        ``different`` is their number without repetitions. Runs that an interrupted sweep did not make are not
        counted: those that take long are more likely to be among them, so that the others are no random choice.

        Parameters
        ----------
        level
            Level of confidence.

        Raises
        ------
        InvalidInput
            When the level is not between 0 and 1.
        """
        import xarray

        check_level(level)
        lengths = {name: length for name, length in self.plan.lengths.items() if name != self.plan.run_dimension}
        names, shape = tuple(lengths), tuple(lengths.values())
        variables: dict[str, object] = {}
        for measure in self.measures:
            share = self.is_share(measure)
            # Of a truth value a run that failed is as unknown as one that leaves it open.
            made = [len(rows) for rows in self.different]
            each = [
                np.array([float(x) for row in rows if (x := row["values"].get(measure, np.nan)) == x], dtype=np.float64)
                for rows in self.different
            ]
            found = [
                share_interval(int(known.sum()), total, level, unknown=total - len(known))
                if share
                else mean_interval(known, level)
                for known, total in zip(each, made, strict=True)
            ]
            columns: dict[str, Sequence[object]] = {
                "": [
                    _mean(known) if len(known) and (len(known) == total or not share) else np.nan
                    for known, total in zip(each, made, strict=True)
                ],
                "_low": [interval.low for interval in found],
                "_high": [interval.high for interval in found],
                "_interval": [interval.method for interval in found],
                "_count": [len(known) for known in each],
            }
            for ending, column in columns.items():
                about = {} if ending else {"level": level}
                variables[measure + ending] = (names, np.array(column).reshape(shape), about)
        done, failed = np.zeros(self.plan.points, dtype=int), np.zeros(self.plan.points, dtype=int)
        for index, row in self.rows.items():
            done[index // self.plan.runs_per_point] += 1
            failed[index // self.plan.runs_per_point] += row["status"] == "failed"
        different = np.array([len(rows) for rows in self.different])
        for name, counts in (("runs", done), ("failed", failed), ("different", different)):
            variables[name] = names, counts.reshape(shape)
        return xarray.Dataset(variables, self._coordinates(with_runs=False))

    def to_csv(self, path: str | Path) -> Path:
        """Write one line per run.

        Raises
        ------
        StorageError
            When it cannot be written.
        """
        rows = [dict(zip(self.columns, cells, strict=True)) for cells in zip(*self.columns.values(), strict=True)]
        return write_csv(Path(path), rows, tuple(self.columns))

    def to_parquet(self, path: str | Path) -> Path:
        """Write one row per run, with the record of the sweep as metadata.

        Raises
        ------
        StorageError
            When it cannot be written, or pyarrow is not installed.
        """
        try:
            import pyarrow
            from pyarrow import parquet
        except ImportError:
            raise missing_package("pyarrow", "Parquet") from None
        arrays = {name: pyarrow.array(alike(column)) for name, column in self.columns.items()}
        table = pyarrow.table(arrays).replace_schema_metadata({"flocking": json.dumps(self.record)})
        sink = pyarrow.BufferOutputStream()
        parquet.write_table(table, sink)
        return put(Path(path), sink.getvalue().to_pybytes())


def _mean(values: Array) -> float:
    """The mean of numbers, whose sum may exceed the largest double."""
    with np.errstate(over="ignore"):
        mean = float(values.mean())
    if np.isfinite(mean) or not np.isfinite(values).all():
        return mean
    return float((values / len(values)).sum())


def _results(row: Row) -> str:
    """What a run gave, as text: of equal values two that are nan are equal too."""
    return json.dumps([row["status"], row["values"], row["verdicts"]], sort_keys=True)
