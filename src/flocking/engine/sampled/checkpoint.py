"""A session of held control as plain numbers and named arrays, and back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import MalformedError, Names, Real, Table
from flocking.engine.protocol.session import Packed
from flocking.engine.sampled.knowledge import Knowledge
from flocking.engine.sampled.motion import Motion
from flocking.model.law import Scenario
from flocking.model.world.times import Instants

MOST_COUNT = 2**61
"""Largest count or nanosecond in a checkpoint, so that sums of two stay within 64 bits."""


@dataclass
class SampledMemory:
    """What a session of held control goes on from, but its scenario and its records.

    Parameters
    ----------
    motion, knowledge
        The polynomials of all agents, and what they know.
    ticked, applied
        How often each agent has acted, and how often its force has changed, shape (N,).
    waiting
        Forces that do not act yet: when they will, in nanoseconds, whose they are, and the forces.
    links
        True links of each graph, shape (graphs, N, N).
    crossings
        Times, in seconds from the start, and pairs and graphs of true links that will switch.
    closest
        Rows (squared distance, time, i, j) of the closest linked and unlinked pair.
    sums, errors
        Integrals of the powers of the ledger, and what they may be off by.
    numbers
        Time and steps, and the state of the ledger, by name.
    """

    motion: Motion
    knowledge: Knowledge
    ticked: Instants
    applied: Instants
    waiting: list[tuple[int, Indices, Array]]
    links: Links
    crossings: list[tuple[float, int, int, int]]
    closest: Array
    sums: Array
    errors: Array
    numbers: dict[str, float]


NUMBERS = ("time", "steps", "jumped", "accounted", "energy", "kinetic", "largest_power", "ledger_ends")
"""Names of `SampledMemory.numbers`."""


def packed_memory(memory: SampledMemory) -> Packed:
    """The memory of a session as numbers and arrays.

    Parameters
    ----------
    memory
        What the session goes on from.
    """
    motion, knowledge, waiting = memory.motion, memory.knowledge, memory.waiting
    times = [np.full(len(agents), time, dtype=np.int64) for time, agents, _ in waiting]
    none, m = np.zeros(0, dtype=np.int64), knowledge.m
    heap = sorted(memory.crossings)
    arrays: Arrays = {
        "ticked": memory.ticked, "applied": memory.applied, "links": memory.links,
        "begin": motion.begin, "coefficients": motion.coefficients, "force": motion.force,
        "waiting_time": np.concatenate([none, *times]),
        "waiting_agent": np.concatenate([none, *(agents for _, agents, _ in waiting)]),
        "waiting_force": np.concatenate([np.zeros((0, m)), *(force for *_, force in waiting)]),
        "crossing_time": np.array([row[0] for row in heap], dtype=np.float64),
        "crossing": np.array([row[1:] for row in heap], dtype=np.int64).reshape(-1, 3),
        "closest": memory.closest, "sums": memory.sums, "errors": memory.errors,
        "known_links": knowledge.links, "newest": knowledge.newest, "taken": knowledge.taken,
        "sample_rows": knowledge.samples.rows, "sample_distances": knowledge.samples.distances,
    }  # fmt: skip
    if knowledge.errors is not None:
        arrays["noise"] = knowledge.errors
    numbers: dict[str, object] = {name: memory.numbers[name] for name in NUMBERS}
    return numbers, arrays


def _check(numbers: object, arrays: Arrays, scenario: Scenario, degree: int) -> dict[str, float]:
    """The numbers of a checkpoint, when it is one of the scenario.

    Raises
    ------
    MalformedError
        When it is not.
    """
    n, m = scenario.start.q.shape
    graphs = len(scenario.law.graphs)
    any_number = Real(finite=False)
    found = Names(dict.fromkeys(NUMBERS, any_number)).check(numbers, "")
    count = Table("i8", (n,), least=0, most=MOST_COUNT)
    agent = Table("i8", (None,), least=0, most=n - 1)
    free = Table("f8", (2, 4), finite=False)
    forms = {
        "ticked": count, "applied": count, "links": Table("?", (graphs, n, n)), "begin": count,
        "coefficients": Table("f8", (degree + 1, n, m)), "force": Table("f8", (n, m)),
        "waiting_time": Table("i8", (None,), least=0, most=MOST_COUNT), "waiting_agent": agent,
        "waiting_force": Table("f8", (None, m)), "crossing_time": Table("f8", (None,)),
        "crossing": Table("i8", (None, 3), least=0, most=max(n, graphs) - 1), "closest": free,
        "sums": Table("f8", (4,), finite=False), "errors": Table("f8", (4,), finite=False),
        "known_links": Table("?", (graphs, n, n)), "newest": Table("i8", (n, n), least=-1, most=MOST_COUNT),
        "taken": count, "sample_rows": Table("f8", (None, n, 2 * m)),
        "sample_distances": Table("f8", (None, None, None)),
    }  # fmt: skip
    Names(forms, optional={"noise": Table("f8", (n, 2 * m))}).check(arrays, "")
    room, waiting = len(arrays["sample_rows"]), len(arrays["waiting_time"])
    distances = arrays["sample_distances"].shape
    fits = room > 0 and distances in ((room, n, n), (room, 0, 0))
    fits = fits and len(arrays["waiting_agent"]) == len(arrays["waiting_force"]) == waiting
    fits = fits and len(arrays["crossing"]) == len(arrays["crossing_time"])
    fits = fits and bool((arrays["crossing"][:, 2] < graphs).all())
    fits = fits and bool((arrays["newest"] < np.maximum(arrays["taken"], 0)[None]).all())
    if not fits:
        raise MalformedError("its arrays do not belong together")
    return cast(dict[str, float], found)


def unpacked_memory(fresh: SampledMemory, packed: Packed, scenario: Scenario) -> None:
    """Put what was packed in place of the memory of a session at its start.

    Parameters
    ----------
    fresh
        Memory of a session of the same scenario at its start.
    packed
        What `packed_memory` gave, read back.
    scenario
        The scenario.

    Raises
    ------
    MalformedError
        When the data are no session of this scenario.
    """
    data, arrays = packed
    fresh.numbers = _check(data, arrays, scenario, fresh.motion.degree)
    motion, knowledge = fresh.motion, fresh.knowledge
    fresh.ticked, fresh.applied, fresh.links = arrays["ticked"], arrays["applied"], arrays["links"]
    motion.begin, motion.coefficients, motion.force = arrays["begin"], arrays["coefficients"], arrays["force"]
    times = arrays["waiting_time"]
    for time in np.unique(times):
        rows = times == time
        fresh.waiting.append((int(time), arrays["waiting_agent"][rows], arrays["waiting_force"][rows]))
    heap = zip(arrays["crossing_time"].tolist(), arrays["crossing"].tolist(), strict=True)
    fresh.crossings = [(time, i, j, graph) for time, (i, j, graph) in heap]
    fresh.closest, fresh.sums, fresh.errors = arrays["closest"], arrays["sums"], arrays["errors"]
    knowledge.links, knowledge.newest, knowledge.taken = arrays["known_links"], arrays["newest"], arrays["taken"]
    knowledge.samples.rows, knowledge.samples.distances = arrays["sample_rows"], arrays["sample_distances"]
    knowledge.errors = arrays.get("noise")
