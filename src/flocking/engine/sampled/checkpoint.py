"""A session of held control as plain numbers and named arrays, and back."""

from __future__ import annotations

import numpy as np

from flocking.engine.archives.archive import Arrays
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
    arrays: Arrays = {
        **memory.truth.arrays(), "ticked": memory.ticked, "applied": memory.applied,
        "begin": motion.begin, "coefficients": motion.coefficients, "force": motion.force,
        "waiting_time": np.concatenate([none, *times]),
        "waiting_agent": np.concatenate([none, *(agents for _, agents, _ in waiting)]),
        "waiting_force": np.concatenate([np.zeros((0, m)), *(force for *_, force in waiting)]),
        "known_links": knowledge.links, "newest": knowledge.newest, "taken": knowledge.taken,
        "sample_rows": knowledge.samples.rows, "sample_distances": knowledge.samples.distances,
    }  # fmt: skip
    if knowledge.errors is not None:
        arrays["noise"] = knowledge.errors
    if (found := memory.filter) is not None:
        arrays["filter_normals"] = found.normals
        arrays["filter_counts"] = np.array([found.changed, found.relaxed, found.first_relaxed], dtype=np.int64)
    return dict(memory.truth.numbers), arrays


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
    fresh.truth.recall(arrays, check_sampled(data, arrays, scenario, fresh))
    motion, knowledge = fresh.motion, fresh.knowledge
    fresh.ticked, fresh.applied = arrays["ticked"], arrays["applied"]
    motion.begin, motion.coefficients, motion.force = arrays["begin"], arrays["coefficients"], arrays["force"]
    times = arrays["waiting_time"]
    for time in np.unique(times):
        rows = times == time
        fresh.waiting.append((int(time), arrays["waiting_agent"][rows], arrays["waiting_force"][rows]))
    knowledge.links, knowledge.newest, knowledge.taken = arrays["known_links"], arrays["newest"], arrays["taken"]
    knowledge.samples.rows, knowledge.samples.distances = arrays["sample_rows"], arrays["sample_distances"]
    knowledge.errors = arrays.get("noise")
    if fresh.filter is not None:
        fresh.filter.normals = arrays["filter_normals"]
        fresh.filter.changed, fresh.filter.relaxed, fresh.filter.first_relaxed = arrays["filter_counts"].tolist()
