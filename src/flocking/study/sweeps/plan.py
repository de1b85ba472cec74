"""The plan of a sweep: its runs with their parameters and seeds, independent of the order of execution."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, KeysView, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flocking.errors import InvalidInput, said
from flocking.model.checks import integer
from flocking.model.parts.values import LARGEST_SEED
from flocking.study.sweeps.recorded_content import content_of, digest_of, is_plain
from flocking.study.sweeps.sampling import Sample

MOST_RUNS = 100_000
"""Runs a sweep may have unless more are allowed."""

BITS = 63
"""Bits of an integer in a column, besides its sign."""

LARGEST_COUNT = 2**53
"""Largest integer of a row: a double holds each one below exactly, and tables of results have columns of doubles."""

MOST_NAMES = 100
"""Parameters a sweep may vary."""

RESERVED = ("seed", "replicate", "sample", "status", "message", "seconds", "tries", "run", "runs", "failed",
            "different")  # fmt: skip
"""Column names of the table of results."""


@dataclass(frozen=True)
class Task:
    """One run of a sweep.

    Parameters
    ----------
    index
        Its number in the plan.
    parameters
        Arguments of ``make``, without the seed.
    seed
        Seed of the run.
    """

    index: int
    parameters: Mapping[str, object]
    seed: int


@dataclass(frozen=True, eq=False)
class Plan:
    """Runs of a sweep: every combination of the grid with every drawn point and every seed.

    Parameters
    ----------
    grid
        Values of each parameter by name.
    sample
        Points drawn from ranges, where there are any.
    seeds
        The seeds that every point runs with; or how many runs every point gets, each with a seed of its own,
        made from ``root`` and the run's place in the plan alone.
    root
        Root of the seeds of the runs when ``seeds`` is a number.
    most_runs
        Largest number of runs.

    Raises
    ------
    InvalidInput
        When a name is taken twice or reserved, an axis is empty, or there are too many parameters or runs.
    """

    grid: Mapping[str, tuple[object, ...]]
    sample: Sample | None = None
    seeds: int | tuple[int, ...] = 1
    root: int = 0
    most_runs: int = MOST_RUNS

    def __post_init__(self) -> None:
        names = [*self.grid, *(self.sample.ranges if self.sample else ())]
        if len(names) > MOST_NAMES:
            raise InvalidInput("sweep", "grid", f"must vary at most {MOST_NAMES} parameters", len(names))
        for name in names:
            if not isinstance(name, str) or not name:
                raise InvalidInput("sweep", "grid", "must have names as its keys", name)
            if name in RESERVED:
                raise InvalidInput("sweep", "grid", f"must not use the name {name!r}, which the results use", name)
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise InvalidInput("sweep", "sample", "must not draw a parameter of the grid", twice)
        for name, values in self.grid.items():
            if not values:
                raise InvalidInput("sweep", f"grid[{name!r}]", "must hold at least one value", list(values))
            labels = [label(value) for value in values]
            if len(set(labels)) < len(labels):
                twice = Counter(labels).most_common(1)[0][0]
                raise InvalidInput("sweep", f"grid[{name!r}]", "must not hold a value twice", twice)
        if self.size > self.most_runs:
            raise InvalidInput(
                "sweep", "grid", f"must make at most {self.most_runs} runs", self.size,
                f"Pass most_runs={said(self.size)} (--most-runs {said(self.size)}) if you mean it.",
            )  # fmt: skip

    @property
    def lengths(self) -> dict[str, int]:
        """Dimensions of the table of results and their lengths, the runs of one point last."""
        found = {name: len(values) for name, values in self.grid.items()}
        if self.sample:
            found["sample"] = self.sample.count
        return {**found, self.run_dimension: self.runs_per_point}

    @property
    def run_dimension(self) -> str:
        """Name of the last dimension: seeds that were given, or numbered runs."""
        return "replicate" if isinstance(self.seeds, int) else "seed"

    @property
    def runs_per_point(self) -> int:
        """Runs of each point."""
        return self.seeds if isinstance(self.seeds, int) else len(self.seeds)

    @property
    def size(self) -> int:
        """Number of runs."""
        return math.prod(self.lengths.values())

    @property
    def points(self) -> int:
        """Number of points, each with all its runs."""
        return self.size // self.runs_per_point

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters."""
        return (*self.grid, *self.drawn)

    @cached_property
    def drawn(self) -> dict[str, tuple[float, ...]]:
        """Drawn values, one column per parameter."""
        return self.sample.points() if self.sample else {}

    def parameters(self, point: int) -> dict[str, object]:
        """Parameters of a point by its number."""
        lengths = [len(values) for values in self.grid.values()]
        shape = (*lengths, self.sample.count) if self.sample else tuple(lengths)
        places = np.unravel_index(point, shape) if shape else ()
        found = {name: values[int(k)] for (name, values), k in zip(self.grid.items(), places, strict=False)}
        return found | {name: column[int(places[-1])] for name, column in self.drawn.items()}

    def task(self, index: int) -> Task:
        """The run with the number ``index``."""
        point, replicate = divmod(index, self.runs_per_point)
        if isinstance(self.seeds, int):
            # Derived from the root and the place alone, whatever the order and the number of workers.
            child = np.random.SeedSequence(self.root, spawn_key=(point, replicate))
            seed = int(child.generate_state(1, np.uint64)[0] >> np.uint64(1))
        else:
            seed = self.seeds[replicate]
        return Task(index, self.parameters(point), seed)

    def as_data(self) -> dict[str, object]:
        """Plain data that fixes every run."""
        return {
            # The order of the names defines the numbers of the runs, and mappings compare without it.
            "dimensions": list(self.lengths),
            "grid": {name: [recorded(value) for value in values] for name, values in self.grid.items()},
            "sample": self.sample.as_data() if self.sample else None,
            "seeds": self.seeds if isinstance(self.seeds, int) else list(self.seeds),
            "seed": self.root,
        }


def make_plan(
    grid: Mapping[str, Iterable[object]] | None,
    sample: Sample | None,
    seeds: int | Iterable[int],
    root: int,
    most_runs: int,
) -> Plan:
    """A plan from a ``grid`` or ``sample``, a ``root`` seed and a limit ``most_runs``, checked.

    Raises
    ------
    InvalidInput
        When a part of it breaks a rule.
    """
    if grid is not None and not isinstance(grid, Mapping):
        raise InvalidInput("sweep", "grid", "must be a mapping of names to values", grid)
    if sample is not None and not isinstance(sample, Sample):
        raise InvalidInput("sweep", "sample", "must be a Sample", sample)
    axes: dict[str, tuple[object, ...]] = {}
    for name, values in (grid or {}).items():
        if isinstance(values, str | bytes) or not isinstance(values, Iterable):
            raise InvalidInput(
                "sweep", f"grid[{name!r}]", "must be a list of values", values, f"Write [{said(values)}]."
            )
        _check_order(f"grid[{name!r}]", values)
        axes[name] = tuple(_bounded(values, most_runs, f"grid[{name!r}]"))
    if isinstance(seeds, int | np.integer) and not isinstance(seeds, bool):
        checked_seeds: int | tuple[int, ...] = integer("sweep", "seeds", seeds, least=1)
    elif isinstance(seeds, Iterable) and not isinstance(seeds, str | bytes):
        _check_order("seeds", seeds)
        checked_seeds = tuple(integer("sweep", "seeds", seed, least=0) for seed in _bounded(seeds, most_runs, "seeds"))
        if not checked_seeds:
            raise InvalidInput("sweep", "seeds", "must hold at least one seed", list(checked_seeds))
        if max(checked_seeds) > LARGEST_SEED:
            raise InvalidInput("sweep", "seeds", f"must be at most {LARGEST_SEED}", max(checked_seeds))
        if len(set(checked_seeds)) < len(checked_seeds):
            raise InvalidInput("sweep", "seeds", "must not hold a seed twice", list(checked_seeds)[:8])
    else:
        raise InvalidInput("sweep", "seeds", "must be a number of runs or a list of seeds", seeds)
    return Plan(
        axes,
        sample,
        checked_seeds,
        integer("sweep", "seed", root, least=0),
        integer("sweep", "most_runs", most_runs, least=1),
    )


def _check_order(place: str, values: object) -> None:
    """Refuse sets: the numbers of the runs, and with them their seeds, follow from the order of values."""
    if isinstance(values, Set) and not isinstance(values, KeysView):
        raise InvalidInput("sweep", place, "must be in an order, which a set has not", values, "Pass a sorted list.")


def _bounded(values: Iterable[object], most: int, place: str) -> list[object]:
    """The values, at most as many as a sweep may have runs, so that infinite iterators end."""
    found = []
    for value in values:
        found.append(value.item() if isinstance(value, np.generic) else value)
        if len(found) > most:
            raise InvalidInput("sweep", place, f"must hold at most {most} values", "more", "Pass most_runs for more.")
    return found


def recorded(value: object) -> object:
    """A value as the record of a sweep holds it: itself where JSON can represent it, else its repr."""
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [recorded(entry) for entry in value]
    try:
        json.dumps(value)
    except (TypeError, ValueError):
        # Python prints no integer of thousands of decimal digits.
        shown = hex(value) if isinstance(value, int) else repr(value)
        # The repr of a long array or of a scenario does not state all its numbers.
        return {"repr": shown} if is_plain(value) else {"repr": shown, "digest": digest_of(content_of(value))[:12]}
    return value


def stand_for_themselves(values: Sequence[object]) -> bool:
    """Whether a column of a table holds the values of an axis as they are; of others it holds labels.

    Parameters
    ----------
    values
        All texts, all truth values, or numbers. Of integers beside floats each must be one in double precision, and no
        two may be equal there.
    """
    if any(all(isinstance(v, kind) for v in values) for kind in (str, bool)):
        return True
    numbers = [v for v in values if isinstance(v, int | float) and not isinstance(v, bool)]
    integers = [v for v in numbers if isinstance(v, int)]
    if len(numbers) < len(values):
        return False
    if len(integers) == len(values):
        return all(-(2**BITS) <= v < 2**BITS for v in integers)
    return all(abs(v) <= LARGEST_COUNT for v in integers) and len(set(map(float, numbers))) == len(numbers)


def label(value: object) -> str:
    """A value as one line of text, for coordinates and messages."""
    return value if isinstance(value, str) else json.dumps(recorded(value))
