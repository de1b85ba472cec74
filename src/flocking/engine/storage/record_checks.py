"""Checks that the records of a run fit its scenario."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from flocking.arrays import AnyArray
from flocking.engine.archives.data_checks import MalformedError, Table
from flocking.engine.runs.columns import COLUMN, KINDS, SWITCHES, component_names
from flocking.engine.runs.message_log import DELAYED, LEADER, LEADER_SENDER, PRESENT, TICK_PARTS, MessageLog
from flocking.engine.storage.new_folders import law_sum
from flocking.engine.storage.scenario_sums import ScenarioSums, scenario_sums, unlike
from flocking.errors import StorageError
from flocking.model.law import Scenario
from flocking.model.terms.avoidance import ObstacleTerm
from flocking.model.world.information import Delayed
from flocking.model.world.times import PER_SECOND

SAME_PLACE = 1e-5
"""Share of the largest coordinate by which a place at the start may differ: rounding to single precision is 6e-8."""
MOST_SAMPLES = 2**56
"""Largest number of a sample: the random numbers are functions of 56 bits of it."""


def check_records(
    folder: Path, scenario: Scenario, record: dict[str, object], parts: dict[str, AnyArray],
    tables: dict[str, AnyArray], end: float,
) -> None:  # fmt: skip
    """Check that frames and tables belong to a run of this scenario.

    Parameters
    ----------
    record
        The record of the run.
    parts, tables
        Arrays of frames, and other arrays, by name.
    end
        The end of the scenario, or a later time until which the run went on.

    Raises
    ------
    StorageError
        If they do not; the message names the ``folder``.
    """
    shape = scenario.start.q.shape
    if shape != (record["n"], record["dimension"]):
        raise StorageError(
            f"{folder}: holds {record['n']} agents in {record['dimension']} dimensions, "
            f"its scenario {shape[0]} in {shape[1]}."
        )
    about = record["scenario"]
    if isinstance(about, dict) and about["left_out"] and not _begins_with(scenario, parts):
        raise StorageError(
            f"{folder}: the agents of the given scenario begin elsewhere than those of the run. Give the scenario that "
            "was simulated."
        )
    if isinstance(about, dict) and about["left_out"] and about.get("law") not in (None, law_sum(scenario.law)):
        raise StorageError(
            f"{folder}: the law of the given scenario is not that of the run: it has other parts or numbers. Give the "
            "scenario that was simulated."
        )
    if isinstance(about, dict) and about["left_out"]:
        check_sums(folder, about, "sums", scenario_sums(scenario), code=False)
    try:
        _check(scenario, parts, tables, end)
    except MalformedError as error:
        raise StorageError(f"{folder}: the data do not fit the scenario: {error}; the file was damaged.") from None


def check_sums(folder: Path, about: Mapping[str, object], name: str, found: ScenarioSums | None, *, code: bool) -> None:
    """Check that parts from outside this library are those with which a run was begun; an earlier version kept no sums.

    Parameters
    ----------
    about
        What the record of the run states of its scenario.
    name
        Which sums: ``"sums"`` or ``"plant_sums"``.
    found
        Sums of what is to go on, or to be read.
    code
        Whether the code of these parts must be the same too: a run that goes on acts by it, also where it states no
        formulas, as rules of graphs.

    Raises
    ------
    StorageError
        If they are not.
    """
    stored = about.get(name)
    if not isinstance(stored, dict) or not (others := unlike(found, stored, code=code)):
        return
    whose = "the scenario" if name == "sums" else "the plant"
    raise StorageError(
        f"{folder}: {whose} is not that of the run: {others} differ, and would count as if they had been so from its "
        "start. Give the one that was simulated, with its classes as they were."
    )


def _begins_with(scenario: Scenario, parts: dict[str, AnyArray]) -> bool:
    """Whether a frame of the start of a scenario, if there is one, has its agents where they begin."""
    times, start = parts["time"], scenario.start
    if not len(times) or times[0] != start.t:
        return True
    found = parts["position"][0]
    return not bool((np.abs(found - start.q) > SAME_PLACE * np.abs(start.q).max(initial=0.0)).any())


def _check(scenario: Scenario, parts: dict[str, AnyArray], tables: dict[str, AnyArray], end: float) -> None:
    n = scenario.start.n
    times = parts["time"]
    Table("f8", (None,)).check(times, "time")
    if (np.diff(times) < 0).any():
        raise MalformedError("times must not decrease")
    for name in ("position", "velocity"):
        Table(parts[name].dtype, parts[name].shape, ordered=False).check(parts[name], name)
    columns, n_components = tables.get(COLUMN), len(component_names(scenario))
    if (columns is None) != (n_components == 0):
        raise MalformedError(f"further columns must be {n_components} numbers for each agent")
    if columns is not None:
        Table("f8", (len(times), n, n_components)).check(columns, COLUMN)
    obstacles = [max(g.numbers, default=0) for t in scenario.law.body_terms if isinstance(t, ObstacleTerm)
                 for g in t.groups]  # fmt: skip
    most = {
        "switch_agent": n - 1, "switch_neighbour": max(n - 1, *obstacles, 0), "switch_kind": len(KINDS) - 1,
        "switch_graph": len(scenario.law.graphs) + len(obstacles),
    }  # fmt: skip
    for name, highest in most.items():
        if name in tables:
            Table(SWITCHES[name], (None,), least=0, most=highest).check(tables[name], name)
    if "tick" in tables:
        _check_log(scenario, tables, end)
    for name, values in {**parts, **tables}.items():
        if values.dtype.kind == "b" and np.ascontiguousarray(values).view(np.uint8).max(initial=0) > 1:
            raise MalformedError(f"{name} must contain boolean values")


def _check_log(scenario: Scenario, tables: dict[str, AnyArray], last: float) -> None:
    """Check that a log names agents, graphs and samples that there may be until a time."""
    n, graphs = scenario.start.n, len(scenario.law.graphs)
    ticks, uses = tables["tick"], tables["use"]
    oldest = DELAYED if isinstance(scenario.information, Delayed) else PRESENT
    Table("f8", (len(ticks), scenario.start.dimension)).check(tables["tick_force"], "tick_force")
    Table("i8", (None, len(TICK_PARTS)), least=0).check(ticks, "tick")
    # A log that names a later time, or more entries than there are, would ask the second computation for their samples.
    end = math.ceil((last - scenario.start.t) * PER_SECOND)
    for column, most in ((0, end), (1, n - 1), (2, len(uses))):
        Table("i8", (None,), least=0, most=most).check(ticks[:, column].copy(), "tick")
    for column, least, most in ((0, LEADER, graphs - 1), (1, LEADER_SENDER, n - 1), (2, oldest, MOST_SAMPLES)):
        Table("i8", (None,), least=least, most=most).check(uses[:, column].copy(), "use")
    if ((uses[:, 0] == LEADER) != (uses[:, 1] == LEADER_SENDER)).any():
        raise MalformedError("use must name the sender -1 for samples of leaders alone")
    MessageLog(ticks, tables["tick_force"], uses)
