"""Sweeps as TOML files: all faults are reported at once; nothing in a file is executed, and no other file is read."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.law import Scenario
from flocking.model.parts.values import RefusedError, nearest
from flocking.study.scenario_files.scenario_file import MOST_AGENTS, ScenarioFileError
from flocking.study.scenario_files.text_files import read_text_file
from flocking.study.sweeps.measures import MEASURES, Measuring
from flocking.study.sweeps.parametrised_scenarios import (
    FileScenario,
    FixedOptions,
    ParametrisedScenario,
    path_steps,
    with_value,
)
from flocking.study.sweeps.plan import MOST_RUNS, Plan, make_plan
from flocking.study.sweeps.sampling import Sample

if TYPE_CHECKING:
    from flocking.study.sweeps.sweep_schema import Sections

LARGEST_FILE = 2**20
"""Bytes of a sweep file, a bound on memory: 1 MiB."""
MOST_TRIED = 200
"""Scenarios that are built before a sweep starts, to find faults early; a bound on time."""
TRYING_SECONDS = 5.0
"""Time for building scenarios before a sweep starts; faults of the others appear when their run is made."""

MOST_POINTS = 100 * MOST_RUNS
"""Drawn points that a file may request, a bound on memory; the number of runs is checked against its own limit."""


class SweepFileError(ScenarioFileError):
    """A sweep file with faults.

    Parameters
    ----------
    source
        Name of the file.
    problems
        Every fault, as one line of text each.
    """

    content = "sweep"


@dataclass(frozen=True)
class SweepFile:
    """A sweep as a file describes it.

    Parameters
    ----------
    name
        Its name.
    make
        Makes the scenarios.
    plan
        The runs.
    measures
        Names of the measures.
    more_measures
        Further measures of the family.
    audit
        Whether claims about the runs are judged.
    engine
        Name of the engine.
    record
        The scenarios as in the file, for the record of the sweep.
    """

    name: str
    make: Callable[..., Scenario]
    plan: Plan
    measures: tuple[str, ...]
    more_measures: Mapping[str, tuple[str, Measuring]] = field(default_factory=dict)
    audit: bool = False
    engine: str = "auto"
    record: Mapping[str, object] = field(default_factory=dict)


def read_sweep_file(
    path: str | Path,
    scenarios: Mapping[str, ParametrisedScenario],
    *,
    most_runs: int = MOST_RUNS,
    most_agents: int = MOST_AGENTS,
) -> SweepFile:
    """Read a sweep from a TOML file.

    Parameters
    ----------
    path
        The file.
    scenarios
        Families of scenarios it may name.
    most_runs
        Runs it may request.
    most_agents
        Agents a scenario written in it may request.

    Raises
    ------
    SweepFileError
        When the file has faults; the message lists every one with its place.
    InvalidInput
        When the file cannot be read.
    """
    file = Path(path)
    try:
        text = read_text_file("sweep", path, LARGEST_FILE)
    except UnicodeDecodeError as error:
        raise SweepFileError(str(path), [f"file: must be UTF-8 text; byte {error.start} is not"]) from None
    return parse_sweep(
        text, scenarios, source=str(path), name=file.stem, most_runs=most_runs, most_agents=most_agents
    )  # fmt: skip


def parse_sweep(
    text: str,
    scenarios: Mapping[str, ParametrisedScenario],
    *,
    source: str = "sweep",
    name: str = "sweep",
    most_runs: int = MOST_RUNS,
    most_agents: int = MOST_AGENTS,
) -> SweepFile:
    """Read a sweep from TOML text.

    Parameters
    ----------
    text
        The text.
    scenarios
        Families of scenarios it may name.
    source
        Its name in error messages.
    name
        Name of the sweep when the text has none.
    most_runs
        Runs it may request.
    most_agents
        Agents a scenario written in it may request.

    Raises
    ------
    SweepFileError
        When the text has faults; the message lists every one with its place.
    """
    from flocking.study.scenario_files.scenario_file import _toml
    from flocking.study.sweeps.sweep_schema import read_sections

    try:
        data = _toml(text, source)
    except ScenarioFileError as error:
        raise SweepFileError(source, list(error.problems)) from None
    found, problems = read_sections(data)
    lines = [str(problem) for problem in problems]
    reader = _Reader(found, scenarios, most_agents, lines)
    grid, sample = reader.grid(), reader.sample()
    plan: Plan | None = None
    try:
        plan = make_plan(grid, sample, found.get("seeds", 1), found.get("seed", 0), most_runs)
    except InvalidInput as error:
        reader.report(_place(error.parameter), error.rule, error.value, error.fix)
    make = reader.make(grid, sample)
    measures = reader.measures()
    if lines or plan is None or make is None:
        raise SweepFileError(source, list(dict.fromkeys(lines)))
    record: dict[str, object] = {"scenario": found["scenario"], "options": found.get("options", {})}
    if isinstance(make, FileScenario) and (seeded := make.seeded(plan.names)) != make.drawn:
        # Not of draws alone, of which earlier versions made the same runs and stored no such record.
        record["seeded"] = seeded
        if made := make.nested:
            # Earlier versions gave these the same seed as what is around them.
            record["nested"] = made
    return SweepFile(
        found.get("name", name), make, plan, measures, reader.more, found.get("audit", False),
        found.get("engine", "auto"), record,
    )  # fmt: skip


def _place(parameter: str) -> str:
    return parameter.replace("['", ".").replace("']", "")


class _Reader:
    """Checks sections against each other; every fault becomes a line.

    Parameters
    ----------
    found
        The valid sections.
    scenarios
        Families that may be named.
    most_agents
        Agents a scenario in the file may request.
    lines
        Faults; more are appended.
    """

    def __init__(
        self, found: Sections, scenarios: Mapping[str, ParametrisedScenario], most_agents: int, lines: list[str]
    ) -> None:
        self._found, self._lines, self._most_agents = found, lines, most_agents
        self._reported: set[str] = set()
        self._scenario = found.get("scenario")
        self._parametrised: ParametrisedScenario | None = None
        if isinstance(self._scenario, str):
            self._parametrised = scenarios.get(self._scenario)
            if self._parametrised is None:
                self.report(
                    "scenario", "must be a family of scenarios", self._scenario, nearest(self._scenario, scenarios)
                )
        self.more = self._parametrised.measures if self._parametrised else {}

    def report(self, place: str, rule: str, value: object = None, fix: str = "") -> None:
        """Add a fault."""
        from flocking.study.scenario_files.problems import Problem, shown

        self._lines.append(str(Problem(place, rule, "" if value is None else shown(value), fix)))

    def grid(self) -> dict[str, list[object]]:
        """Values of every axis."""
        axes: dict[str, list[object]] = {}
        for name, axis in self._found.get("grid", {}).items():
            if not self._is_option(f"grid.{name}", name):
                continue
            if isinstance(axis, list):
                axes[name] = [self._checked(f"grid.{name}[{k}]", name, value) for k, value in enumerate(axis)]
            elif axis.high <= axis.low or (axis.log and axis.low <= 0):
                self.report(f"grid.{name}", "must have low below high, and above 0 where log is true")
            else:
                # Options accept intervals: checking both ends checks all values.
                for end in ("low", "high"):
                    self._checked(f"grid.{name}.{end}", name, getattr(axis, end))
                space = np.geomspace if axis.log else np.linspace
                axes[name] = [float(v) for v in space(axis.low, axis.high, axis.count)]
        return axes

    def sample(self) -> Sample | None:
        """The drawn points."""
        section = self._found.get("sample")
        if section is None:
            return None
        for name, ends in section.ranges.items():
            for end in ("low", "high") if self._is_option(f"sample.ranges.{name}", name) else ():
                self._checked(f"sample.ranges.{name}.{end}", name, getattr(ends, end))
        ranges = {name: (ends.low, ends.high) for name, ends in section.ranges.items()}
        log = tuple(name for name, ends in section.ranges.items() if ends.log)
        if section.count > MOST_POINTS:
            self.report("sample.count", f"must be at most {MOST_POINTS}", section.count)
            return None
        try:
            return Sample(section.method, section.count, ranges, log, section.seed)
        except InvalidInput as error:
            self.report(f"sample.{_place(error.parameter)}", error.rule, error.value, error.fix)
            return None

    def _is_option(self, place: str, name: str) -> bool:
        """Whether the family has this option; reports a fault where it has not."""
        if self._parametrised is None or name in self._parametrised.options:
            return True
        known = self._parametrised.options
        self.report(place, "is no option of this family", None, nearest(name, known) if known else "")
        return False

    def _checked(self, place: str, name: str, value: object) -> object:
        """A value checked by the option of the family; for a scenario in the file only finite."""
        if self._parametrised is not None:
            try:
                return self._parametrised.options[name].check(value)
            except RefusedError as refused:
                self.report(place, refused.rule, value, refused.fix)
        elif isinstance(value, float) and not math.isfinite(value):
            self.report(place, "must be finite", value)
        return value

    def make(self, grid: Mapping[str, list[object]], sample: Sample | None) -> Callable[..., Scenario] | None:
        """The function that makes the scenarios."""
        options = self._found.get("options", {})
        if self._parametrised is not None:
            chosen_options = {
                name: self._checked(f"options.{name}", name, value)
                for name, value in options.items()
                if self._is_option(f"options.{name}", name)
            }
            for name in chosen_options:
                if name in grid or (sample is not None and name in sample.ranges):
                    self.report(f"options.{name}", "must not be fixed and vary at once")
            return FixedOptions(self._parametrised, chosen_options)
        if isinstance(self._scenario, dict):
            if options:
                self.report("options", "is for families of scenarios; write the values into [scenario]")
            made = FileScenario(self._scenario, self._most_agents)
            varied = (*grid, *(sample.ranges if sample is not None else ()))
            if not made.seeded(varied) and self._found.get("seeds", 1) not in (1, [0]):
                why = (
                    "every seed in [scenario] is varied"
                    if made.seeded()
                    else "nothing in [scenario] is drawn at random"
                )
                self.report("seeds", f"must be left out: {why}")
            self._separate(varied)
            self._try(made, grid, sample)
            return made
        return None

    def _separate(self, varied: Sequence[str]) -> None:
        """Report paths that replace what an earlier one has set: of the same place, or of one around it."""
        places: dict[str, tuple[str | int, ...]] = {}
        for path in varied:
            try:
                steps = path_steps(path)
            except RefusedError:  # It is reported where the scenario is tried.
                continue
            for other, its in places.items():
                # One that is drawn and in the grid is reported with the plan.
                if its[: len(steps)] == steps and other != path:
                    self.report(
                        path, f"must not replace {other}, which would change nothing", None, f"Put it before {other}."
                    )
            places[path] = steps

    def _try(self, make: FileScenario, grid: Mapping[str, list[object]], sample: Sample | None) -> None:
        """Build the scenario of the file with every value of every axis once, the others at their first."""
        if self._lines:
            self._attempt(make, {}, "")
            return
        first = {name: values[0] for name, values in grid.items() if values}
        if sample is not None:
            first |= {name: ends[0] for name, ends in sample.ranges.items()}
        begin = time.monotonic()
        for count, (place, changes) in enumerate(_changes(grid, sample)):
            if count < MOST_TRIED and (count == 0 or time.monotonic() - begin < TRYING_SECONDS):
                self._attempt(make, {**first, **changes}, place)
        if not grid and sample is None:
            self._attempt(make, first, "")

    def _attempt(self, make: FileScenario, values: Mapping[str, object], place: str) -> None:
        try:
            for name, value in values.items():
                try:
                    with_value(dict(make.tables), path_steps(name), value)
                except RefusedError as refused:
                    self.report(f"grid.{name}", refused.rule)
                    return
            make(seed=0, **values)
        except ScenarioFileError as error:
            # Faults that do not depend on the varied value are reported once.
            fresh = [line for line in error.problems if line not in self._reported]
            self._reported.update(fresh)
            self._lines.extend(f"{place + ': ' if place else ''}scenario.{line}" for line in fresh)
        except InvalidInput as error:
            self.report(place or "scenario", f"{error.parameter} {error.rule}", None, error.fix)

    def measures(self) -> tuple[str, ...]:
        """Names of the measures."""
        requested = self._found.get("measures", ["flocks", "velocity_spread"])
        known = {**MEASURES, **self.more}
        for k, name in enumerate(requested):
            if name not in known:
                fix = nearest(name, known)
                self.report(f"measures[{k}]", "is not known", name, "" if fix in self._reported else fix)
                self._reported.add(fix)
            elif name in requested[:k]:
                self.report(f"measures[{k}]", "must not be named twice", name)
        return tuple(requested)


def _changes(grid: Mapping[str, list[object]], sample: Sample | None) -> Iterator[tuple[str, dict[str, object]]]:
    for name, values in grid.items():
        for k, value in enumerate(values):
            yield f"grid.{name}[{k}]", {name: value}
    if sample is not None:
        for name, ends in sample.ranges.items():
            for end, value in zip(("low", "high"), ends, strict=True):
                yield f"sample.ranges.{name}.{end}", {name: value}
