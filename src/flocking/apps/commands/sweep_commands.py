"""The sweep command: runs or continues a sweep file or a shipped study, writes and draws its results."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from flocking.apps.json_output import print_json

if TYPE_CHECKING:
    from flocking.study.sweeps.sweep_file import SweepFile
    from flocking.study.sweeps.table import SweepTable

SummaryRow = dict[str, Any]
"""A point of a sweep: parameters, and what is shown of each measure there."""

FINE, FAILED_RUNS, INTERRUPTED = 0, 1, 130
"""Exit codes: success, some runs failed, and, as shells have it, 128 + 2 after the interrupt signal."""
LONGEST_SUMMARY = 60
"""Rows printed at most, about a screen; the file has all of them."""
FEWEST_DIGITS = 3
"""Significant digits of a mean and its interval, by convention; more where the interval is narrow beside its ends."""
MOST_FAILURES = 100
"""Failures that the JSON output lists; their number is given, and the stored table has all."""


def sweep(
    sweep: str,
    /,
    *,
    out: Path | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    most_runs: int | None = None,
    most_agents: int | None = None,
    level: float = 0.95,
    as_json: Annotated[bool, Parameter(name="--json")] = False,
) -> int:
    """Run a sweep: many runs over parameters and seeds. The same command makes only missing runs.

    Parameters
    ----------
    sweep
        A TOML file, or a shipped study: tanner-connectivity, olfati-saber-density, shi-informed, zhou-bound.
    out
        Folder for the results; out/sweeps/NAME when absent. Tables and, for a study, its picture go beside the rows.
    workers
        Local processes; as many as cores when absent.
    cluster
        Address of a Dask scheduler to use instead, such as tcp://10.0.0.1:8786.
    most_runs
        Largest number of runs the file may ask for; 100,000 by default.
    most_agents
        Largest number of agents a scenario in the file may ask for; one million by default.
    level
        Level of confidence of the intervals in tables; pictures have 95 %.
    as_json
        Print JSON.
    """
    from flocking.engine.interruption import answered
    from flocking.model.checks import integer
    from flocking.papers.studies.running import run_file
    from flocking.study.confidence_intervals import check_level

    check_level(level, "sweep")
    if most_runs is not None:
        integer("sweep", "most_runs", most_runs, least=1)
    file = find_sweep(sweep, most_runs, most_agents)
    folder = out or Path("out") / "sweeps" / file.name
    begin = time.monotonic()
    try:
        table = run_file(file, folder / "results", workers=workers, cluster=cluster, progress=True)
        written = write_results(table, folder, sweep, level)
    except KeyboardInterrupt:
        answered()
        print(f"flocking: interrupted; {folder} is consistent, the same command continues.", file=sys.stderr)
        return INTERRUPTED
    _print(table, file, folder, written, level, time.monotonic() - begin, as_json)
    if table.status == "interrupted":
        stored = f"{len(table)} of {table.plan.size} runs are stored in {folder}; the same command continues."
        print(f"flocking: interrupted; {stored}", file=sys.stderr)
        return INTERRUPTED
    return FAILED_RUNS if table.failures else FINE


def find_sweep(name: str, most_runs: int | None, most_agents: int | None) -> SweepFile:
    """The sweep named by a user: a shipped study by its name, or a TOML file.

    Parameters
    ----------
    most_runs
        Largest number of runs it may ask for; 100,000 when absent.
    most_agents
        Largest number of agents a scenario in it may ask for; one million when absent.

    Raises
    ------
    InvalidInput
        When there is no such study or file, or the file has faults.
    """
    from flocking.errors import InvalidInput
    from flocking.model.parts.values import nearest
    from flocking.papers.studies.shipped import STUDIES
    from flocking.papers.sweep_scenarios import sweep_scenarios
    from flocking.study.scenario_files.scenario_file import MOST_AGENTS
    from flocking.study.sweeps.plan import MOST_RUNS
    from flocking.study.sweeps.sweep_file import read_sweep_file

    if name in STUDIES:
        return STUDIES[name].plan(most_runs)
    if not (name.endswith(".toml") or Path(name).exists()):
        raise InvalidInput("sweep", "sweep", "must be a TOML file or a shipped study", name, nearest(name, STUDIES))
    runs = MOST_RUNS if most_runs is None else most_runs
    return read_sweep_file(
        name, sweep_scenarios(), most_runs=runs, most_agents=MOST_AGENTS if most_agents is None else most_agents
    )


def write_results(table: SweepTable, folder: Path, name: str, level: float) -> list[Path]:
    """Write tables of the finished runs, and the picture of a shipped study once it is complete.

    Parameters
    ----------
    table
        Results of the sweep.
    level
        Level of confidence of the intervals, between 0 and 1.
    """
    from importlib.util import find_spec

    from flocking.papers.studies.shipped import STUDIES
    from flocking.study.sweeps.table_files import write_csv

    written = [table.to_csv(folder / "runs.csv")]
    if find_spec("pyarrow") is not None:
        written.append(table.to_parquet(folder / "runs.parquet"))
    written.append(write_csv(folder / "summary.csv", _summary_rows(table, level)))
    if name in STUDIES and table.status == "finished":
        from flocking.show.style import save

        written += save(STUDIES[name].draw(table), folder / name)
    return written


def _print(
    table: SweepTable, file: SweepFile, folder: Path, written: list[Path], level: float, seconds: float, as_json: bool
) -> None:
    from flocking.apps.tables import print_table
    from flocking.study.confidence_intervals import CAVEAT, UNKNOWN

    failures = table.failures
    rows = _summary_rows(table, level)
    if as_json:
        about = {
            "sweep": file.name, "runs": table.plan.size, "done": len(table), "failed": len(failures),
            "status": table.status, "out": str(folder), "files": [str(path) for path in written],
            "summary": rows, "versions": list(table.versions), "failures": failures[:MOST_FAILURES], "seconds": seconds,
            "caveats": dict.fromkeys(_with_intervals_of_means(rows, table.measures), f"intervals of means {CAVEAT}"),
        }  # fmt: skip
        print_json(about)
        return
    head = [*table.plan.grid, *(["sample"] if table.plan.sample else []), *table.measures]
    # Intervals of more measures do not fit on a line; all are in summary.csv.
    few = len(table.measures) <= 2
    cells = []
    for row in rows[:LONGEST_SUMMARY]:
        places = [str(row[name]) for name in head[: len(head) - len(table.measures)]]
        cells.append((*places, *(_cell(row, m, table.is_share(m), few) for m in table.measures)))
    print_table(head, cells, title=f"{file.name}: means" + (f" with {100 * level:g} % intervals" if few else ""))
    if len(rows) > LONGEST_SUMMARY:
        print(f"... and {len(rows) - LONGEST_SUMMARY} more points in {folder / 'summary.csv'}")
    for reason, measures in _reasons(rows, table.measures).items():
        print(f"no {100 * level:g} % interval of {', '.join(measures)}: {reason}")
    of_means = _with_intervals_of_means(rows, table.measures)
    if few and of_means:
        print(f"intervals of means of {', '.join(of_means)} {CAVEAT}")
    for measure in table.measures:
        if any(UNKNOWN in row[f"{measure}_interval"] for row in rows):
            print(f"no mean of {measure} where it is unknown in some runs; intervals count these as either")
        elif not table.is_share(measure) and (left := _left_out(rows, measure)):
            print(f"means of {measure} are of the runs that have a value: {left}")
    if (different := sum(row["different"] for row in rows)) < len(table):
        print(f"{len(table)} runs are {different} different ones: others repeat a scenario, and count once")
    if not table.complete:
        print("means and intervals are of the runs made so far; those that take long are more likely to be missing")
    if len(table.versions) > 1:
        named = "; ".join(", ".join(f"{k} {v}" for k, v in made.items()) for made in table.versions)
        print(f"runs were made by several versions: {named}")
    print(f"\n{len(table)} of {table.plan.size} runs, {len(failures)} failed, {seconds:.0f} s; results in {folder}")
    for failure in failures[:5]:
        print("  " + ", ".join(f"{name} = {value}" for name, value in failure.items()))


def _left_out(rows: Sequence[SummaryRow], measure: str) -> str:
    """How many different runs have no value of a measure, in words; empty where all have one."""
    missing = [row["different"] - row[f"{measure}_count"] for row in rows]
    if not any(missing):
        return ""
    most = max(range(len(rows)), key=missing.__getitem__)
    total = sum(row["different"] for row in rows)
    at_most = f", at one point {missing[most]} of {rows[most]['different']}" if len(rows) > 1 else ""
    return f"{sum(missing)} of {total} have none{at_most}"


def _cell(row: SummaryRow, measure: str, share: bool, with_interval: bool) -> str:
    """A mean with its interval: in so many digits that these differ, and with ends that are rounded outwards."""
    from flocking.apps.tables import short
    from flocking.formula.safe_digits import EXACT_DIGITS, compared_texts, nearest_text, rounded_down, rounded_up

    mean, low, high = (row[measure + ending] for ending in ("", "_low", "_high"))
    digits = FEWEST_DIGITS
    if low is not None and low < high:
        resolved = math.log10(max(abs(low), abs(high)) / (high - low))
        digits = min(EXACT_DIGITS, FEWEST_DIGITS + max(0, math.floor(resolved)))
    # What is less than all is not read as all.
    middle = compared_texts(mean, 1.0, digits)[0] if share and mean is not None else ""
    middle = middle or (short(mean) if mean is None else nearest_text(mean, digits))
    if not with_interval:
        return middle
    return f"{middle} ({'no interval' if low is None else f'{rounded_down(low, digits)}, {rounded_up(high, digits)}'})"


def _reasons(rows: Sequence[SummaryRow], measures: Sequence[str]) -> dict[str, list[str]]:
    """Why means have no interval, with the measures that have none for that reason at some point."""
    found: dict[str, list[str]] = {}
    for measure in measures:
        for method in dict.fromkeys(row[f"{measure}_interval"] for row in rows):
            if method.startswith("none: "):
                found.setdefault(method.removeprefix("none: "), []).append(measure)
    return found


def _with_intervals_of_means(rows: Sequence[SummaryRow], measures: Sequence[str]) -> list[str]:
    """Measures that have an interval of a mean at some point."""
    from flocking.study.confidence_intervals import MEAN

    return [measure for measure in measures if any(row[f"{measure}_interval"] == MEAN for row in rows)]


def _summary_rows(table: SweepTable, level: float) -> list[SummaryRow]:
    summary = table.summary(level)
    columns = {str(name): summary[name].values.ravel() for name in summary.data_vars}
    rows = []
    for point in range(table.plan.points):
        places = dict(table.plan.parameters(point))
        if table.plan.sample is not None:
            places["sample"] = point % table.plan.sample.count
        rows.append({**places, **{name: _plain(column[point]) for name, column in columns.items()}})
    return rows


def _plain(value: object) -> object:
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


__all__ = ["find_sweep", "sweep", "write_results"]
