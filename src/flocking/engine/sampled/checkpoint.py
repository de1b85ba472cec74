"""A session of held control as plain numbers and named arrays, and back."""

from __future__ import annotations

from typing import Any

import numpy as np

from flocking.engine.archives.archive import Arrays
from flocking.engine.imperfect.messages.checkpoint_form import knowledge_arrays, recall_knowledge
from flocking.engine.imperfect.range_crossings import RangeCrossing
from flocking.engine.protocol.session import Packed
from flocking.engine.sampled.checkpoint_form import check_sampled
from flocking.engine.sampled.motion import SERIES_DEGREE, Motion
from flocking.engine.sampled.snapshot import SampledMemory
from flocking.model.law import Scenario

EARLIER_TERMS = 8
"""Coefficients of damped agents in checkpoints of earlier versions, whose velocities left out 2e-13 of their change."""

AXES = 3
"""Axes of coefficients: terms, agents and directions."""


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
        "known_links": knowledge.links, **knowledge_arrays(knowledge),
    }  # fmt: skip
    if memory.actuation.gusts:
        arrays["wanted"] = memory.desired
        arrays["gusts"] = np.array([g.number for g in memory.actuation.gusts], dtype=np.int64)
    if motion.lag is not None:
        arrays["lag"] = motion.lag
    if motion.heading is not None:
        arrays["heading"] = motion.heading
    if (obstacle_ranges := memory.obstacle_ranges).groups:
        due = sorted(obstacle_ranges.due)
        arrays["near_obstacles"] = np.concatenate(obstacle_ranges.near, axis=1)
        arrays["meeting_time"] = np.array([x.seconds for x in due], dtype=np.float64)
        arrays["meeting"] = np.array([x[1:] for x in due], dtype=np.int64).reshape(-1, 3)
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
    arrays = {**arrays, "coefficients": _with_further_terms(arrays.get("coefficients"), fresh.motion)}
    fresh.truth.recall(arrays, check_sampled(data, arrays, scenario, fresh))
    motion = fresh.motion
    motion.begin, motion.coefficients = arrays["begin"], arrays["coefficients"]
    motion.lag, motion.heading = arrays.get("lag"), arrays.get("heading")
    recall_forces_and_knowledge(fresh, arrays)


def recall_forces_and_knowledge(fresh: SampledMemory, arrays: Arrays) -> None:
    """Take from checked ``arrays`` all but the motion.

    Parameters
    ----------
    fresh
        Memory of a session of the same scenario at its start.
    """
    knowledge = fresh.knowledge
    fresh.ticked, fresh.applied, fresh.motion.force = arrays["ticked"], arrays["applied"], arrays["force"]
    fresh.desired = arrays.get("wanted", arrays["force"].copy())
    if (obstacle_ranges := fresh.obstacle_ranges).groups:
        ends = np.cumsum([there.shape[1] for there in obstacle_ranges.near])[:-1]
        obstacle_ranges.near = [x.copy() for x in np.split(arrays["near_obstacles"], ends, axis=1)]
        rows = zip(arrays["meeting_time"].tolist(), arrays["meeting"].tolist(), strict=True)
        obstacle_ranges.due = [RangeCrossing(time, *row) for time, row in rows]
    times = arrays["waiting_time"]
    for time in np.unique(times):
        rows = times == time
        fresh.waiting.append((int(time), arrays["waiting_agent"][rows], arrays["waiting_force"][rows]))
    knowledge.links = arrays["known_links"]
    recall_knowledge(knowledge, arrays)
    if fresh.filter is not None:
        fresh.filter.normals = arrays["filter_normals"]
        fresh.filter.changed, fresh.filter.relaxed, fresh.filter.first_relaxed = arrays["filter_counts"].tolist()


def _with_further_terms(C: object, motion: Motion) -> Any:
    """Coefficients with the terms that earlier versions left out of the motion of damped agents."""
    if not (isinstance(C, np.ndarray) and C.dtype == np.float64 and C.ndim == AXES and len(C) == EARLIER_TERMS):
        return C
    if motion.degree != SERIES_DEGREE or C.shape[1:] != motion.coefficients.shape[1:] or motion.order == 1:
        return C
    terms = list(C)
    for k in range(EARLIER_TERMS, SERIES_DEGREE + 1):
        terms.append(-motion.rate / k * terms[-1])
    return np.array(terms)
