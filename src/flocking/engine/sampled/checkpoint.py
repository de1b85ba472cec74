"""A session of held control as plain numbers and named arrays, and back."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import MalformedError, Names, Real, Table
from flocking.engine.protocol.session import Packed, Stored
from flocking.engine.runs.recorder import Recorder
from flocking.model.law import Scenario

if TYPE_CHECKING:
    from flocking.engine.sampled.session import SampledSession

MOST_COUNT = 2**61
"""Largest count or nanosecond in a checkpoint, so that sums of two stay within 64 bits."""


def packed_session(session: SampledSession) -> Packed:
    """All that another session needs to go on bit for bit, but its scenario and its records.

    Parameters
    ----------
    session
        The session.
    """
    motion, knowledge = session.motion, session.knowledge
    waiting = session.waiting
    times = [np.full(len(agents), time, dtype=np.int64) for time, agents, _ in waiting]
    none, m = np.zeros(0, dtype=np.int64), session.m
    heap = sorted(session.crossings)
    arrays: Arrays = {
        "ticked": session.ticked, "applied": session.applied, "links": session.links,
        "begin": motion.begin, "coefficients": motion.coefficients, "force": motion.force,
        "waiting_time": np.concatenate([none, *times]),
        "waiting_agent": np.concatenate([none, *(agents for _, agents, _ in waiting)]),
        "waiting_force": np.concatenate([np.zeros((0, m)), *(force for *_, force in waiting)]),
        "crossing_time": np.array([row[0] for row in heap], dtype=np.float64),
        "crossing": np.array([row[1:] for row in heap], dtype=np.int64).reshape(-1, 3),
        "closest": session.closest, "sums": session.sums, "errors": session.errors,
        "known_links": knowledge.links, "newest": knowledge.newest, "taken": knowledge.taken,
        "sample_rows": knowledge.samples.rows, "sample_distances": knowledge.samples.distances,
    }  # fmt: skip
    if knowledge.errors is not None:
        arrays["noise"] = knowledge.errors
    numbers: dict[str, object] = {
        "time": session.time, "steps": session.steps, "jumped": session.jumped, "accounted": session.accounted,
        "energy": session.energy, "kinetic": session.kinetic, "ledger_ends": session.ledger_ends,
    }  # fmt: skip
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
    names = ("time", "jumped", "accounted", "energy", "kinetic", "ledger_ends", "steps")
    found = Names(dict.fromkeys(names, any_number)).check(numbers, "")
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


def unpacked_session(fresh: SampledSession, packed: Packed, stored: Stored) -> SampledSession:
    """The session that was packed.

    Parameters
    ----------
    fresh
        A session of the same scenario at its start.
    packed
        What `packed_session` gave, read back.
    stored
        The scenario and its records.

    Raises
    ------
    MalformedError
        When the data are no session of this scenario.
    """
    data, arrays = packed
    numbers = _check(data, arrays, stored.scenario, fresh.motion.degree)
    motion, knowledge = fresh.motion, fresh.knowledge
    fresh.ticked, fresh.applied, fresh.links = arrays["ticked"], arrays["applied"], arrays["links"]
    motion.begin, motion.coefficients, motion.force = arrays["begin"], arrays["coefficients"], arrays["force"]
    times = arrays["waiting_time"]
    for time in np.unique(times):
        rows = times == time
        fresh.waiting.append((int(time), arrays["waiting_agent"][rows], arrays["waiting_force"][rows]))
    rows = zip(arrays["crossing_time"].tolist(), arrays["crossing"].tolist(), strict=True)
    fresh.crossings = [(time, i, j, graph) for time, (i, j, graph) in rows]
    fresh.closest, fresh.sums, fresh.errors = arrays["closest"], arrays["sums"], arrays["errors"]
    knowledge.links, knowledge.newest, knowledge.taken = arrays["known_links"], arrays["newest"], arrays["taken"]
    knowledge.samples.rows, knowledge.samples.distances = arrays["sample_rows"], arrays["sample_distances"]
    knowledge.errors = arrays.get("noise")
    for name in ("time", "jumped", "accounted", "energy", "kinetic", "ledger_ends"):
        setattr(fresh, name, float(numbers[name]))
    fresh.steps = int(numbers["steps"])
    fresh.relink()
    fresh.records = Recorder(stored.scenario)
    fresh.records.recall(stored.counts, stored.read)
    return fresh
