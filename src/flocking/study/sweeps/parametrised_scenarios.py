"""Scenarios with options that a sweep file may vary, and scenarios in a sweep file with values at paths."""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

from flocking.model.drawn_during_runs import SEED_STEP
from flocking.model.law import Scenario
from flocking.model.parts.values import LARGEST_SEED, RefusedError, Value
from flocking.study.sweeps.measures import Measuring


@dataclass(frozen=True)
class ParametrisedScenario:
    """Scenarios that differ in a few named options and the seed.

    Parameters
    ----------
    make
        Makes the scenario from the options and ``seed``.
    options
        The options by name.
    measures
        Further measures that a sweep file may name.
    """

    make: Callable[..., Scenario]
    options: Mapping[str, Value]
    measures: Mapping[str, tuple[str, Measuring]] = field(default_factory=dict)


def number_between(low: float, high: float) -> Value:
    """A number within bounds."""

    def check(value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RefusedError("must be a number")
        if not low <= value <= high:
            raise RefusedError(f"must be from {low:g} to {high:g}")
        return float(value)

    return Value(check, {"type": "number", "minimum": low, "maximum": high})


def integer_between(low: int, high: int) -> Value:
    """An integer within bounds."""

    def check(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise RefusedError("must be an integer")
        if not low <= value <= high:
            raise RefusedError(f"must be from {low} to {high}")
        return value

    return Value(check, {"type": "integer", "minimum": low, "maximum": high})


@dataclass(frozen=True)
class FixedOptions:
    """A parametrised scenario with some of its options fixed.

    Parameters
    ----------
    scenario
        The parametrised scenario.
    fixed
        The fixed options.
    """

    scenario: ParametrisedScenario
    fixed: Mapping[str, object]

    def __call__(self, *, seed: int, **options: object) -> Scenario:
        """The scenario with the remaining options."""
        return self.scenario.make(seed=seed, **{**self.fixed, **options})


_PATH = re.compile(r"[A-Za-z_][\w-]*(?:\.[A-Za-z_][\w-]*|\[\d{1,6}\])*", re.ASCII)
_STEP = re.compile(r"([A-Za-z_][\w-]*)|(\d+)", re.ASCII)
MOST_STEPS, LONGEST_PATH = 20, 200
"""Steps and characters of a path, bounds on the work that a file of unknown origin may ask for."""


def path_steps(path: str) -> tuple[str | int, ...]:
    """Keys and positions of a path such as ``terms[1].gain``.

    Raises
    ------
    RefusedError
        When the text is not a path.
    """
    steps = _STEP.findall(path) if len(path) <= LONGEST_PATH and _PATH.fullmatch(path) else []
    if not 1 <= len(steps) <= MOST_STEPS:
        raise RefusedError("must be the path of a value, such as terms[1].gain")
    return tuple(name or int(number) for name, number in steps)


def with_value(data: object, steps: tuple[str | int, ...], value: object) -> object:
    """A copy of nested tables and lists with another ``value`` at the place given by ``steps``.

    Raises
    ------
    RefusedError
        When there is no such place.
    """
    step, rest = steps[0], steps[1:]
    if isinstance(step, int):
        if not isinstance(data, list) or step >= len(data):
            raise RefusedError("must be the path of a value in [scenario]")
        return [with_value(entry, rest, value) if rest and k == step else value if k == step else entry
                for k, entry in enumerate(data)]  # fmt: skip
    if not isinstance(data, dict) or (rest and step not in data):
        raise RefusedError("must be the path of a value in [scenario]")
    return {**data, step: with_value(data[step], rest, value) if rest else value}


@dataclass(frozen=True)
class FileScenario:
    """A scenario written in the sweep file, in which values at some paths vary.

    Parameters
    ----------
    tables
        The scenario as in a scenario file.
    most_agents
        Largest number of agents it may request.
    """

    tables: Mapping[str, object]
    most_agents: int

    def seeded(self, varied: Collection[str] = ()) -> list[str]:
        """Paths of the seeds that the seed of a run takes the place of, but for those that are ``varied``."""
        from flocking.study.scenario_files.scenario_reader import seeded_tables

        paths = [f"{path}.seed" for path, _ in seeded_tables(self.tables)]
        return [path for path in paths if path not in varied]

    @property
    def nested(self) -> dict[str, int]:
        """Paths of the seeds of parts inside others of their kind, with the number of these."""
        from flocking.study.scenario_files.scenario_reader import seeded_tables

        places = list(seeded_tables(self.tables))
        found = {f"{path}.seed": _number_around(path, table, places) for path, table in places}
        return {path: number for path, number in found.items() if number}

    @property
    def drawn(self) -> list[str]:
        """Paths of the seeds of drawn starts and graphs."""
        from flocking.study.scenario_files.scenario_reader import drawn_tables, seeded_tables

        drawn = list(drawn_tables(self.tables))
        return [f"{path}.seed" for path, table in seeded_tables(self.tables) if any(table is each for each in drawn)]

    def __call__(self, *, seed: int, **values: object) -> Scenario:
        """The scenario with values at their paths, and the seed in every part that has one, unless it is varied.

        A part inside another one of its kind, as gusts within gusts, has a seed that follows from it, as in
        `flocking.model.drawn_during_runs.with_seed_of_run`: with one seed both would draw the same numbers.
        """
        import tomli_w

        from flocking.study.scenario_files.scenario_file import parse_scenario
        from flocking.study.scenario_files.scenario_reader import seeded_tables

        data: dict[str, object] = copy.deepcopy(dict(self.tables))
        for path, value in values.items():
            changed = with_value(data, path_steps(path), value)
            if not isinstance(changed, dict):
                raise RefusedError("must be the path of a value in [scenario]")
            data = changed
        places = list(seeded_tables(data))
        seeded = [(path, table) for path, table in places if f"{path}.seed" not in values]
        for path, table in seeded:
            table["seed"] = (seed + SEED_STEP * _number_around(path, table, places)) % (LARGEST_SEED + 1)
        if seeded:
            data["seed"] = seed
        return parse_scenario(tomli_w.dumps(data), source="scenario", most_agents=self.most_agents)


def _number_around(path: str, table: Mapping[str, object], places: Sequence[tuple[str, dict[str, object]]]) -> int:
    """How many of the tables around one at a path are of its kind."""
    return sum(path.startswith(f"{around}.") and other.get("kind") == table.get("kind") for around, other in places)
