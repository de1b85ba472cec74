"""A session of held control as plain numbers and named arrays, and back."""

from __future__ import annotations

import numpy as np

from flocking.engine.archives.archive import Arrays
from flocking.engine.imperfect.session import NUMBERS
from flocking.engine.protocol.session import Packed
from flocking.engine.sampled.checkpoint_form import check_sampled
from flocking.engine.sampled.snapshot import SampledMemory
from flocking.model.law import Scenario


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
    numbers: dict[str, object] = {name: memory.numbers[name] for name in (*NUMBERS, "gains_changed")}
    return numbers, arrays


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
    fresh.numbers = check_sampled(data, arrays, scenario, fresh)
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
