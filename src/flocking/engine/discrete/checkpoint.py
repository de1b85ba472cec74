"""A session in discrete time as plain numbers and named arrays, and back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, cast

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import Integer, Names, Real, Table
from flocking.engine.fixed_step.law_gaps import LawGaps
from flocking.engine.imperfect.checkpoint_form import LARGEST, MOST_COUNT, must
from flocking.engine.protocol.session import Packed
from flocking.model.law import Scenario
from flocking.model.world.control import Held
from flocking.model.world.times import NANOSECOND, Instants

ROUNDED = 1e-12
"""Relative error of a time in nanoseconds that a few roundings explain, each of 1.1e-16, with room."""

SAME = 1e-6
"""Difference of the time from the nanoseconds of the last instant that rounding explains, in nanoseconds."""


OPTIONAL = ("ahead", "heard", "errors")
"""Arrays that only some sessions have."""


@dataclass
class DiscreteMemory:
    """What a session goes on from, but links, records and counts.

    Parameters
    ----------
    q, p
        Positions at the last instant, and velocities since, shape (N, m).
    waiting
        Velocities that agents have set and take at their next tick, shape (N, m).
    ticked
        How often each agent has ticked, shape (N,).
    instant
        The last instant, in nanoseconds from the start.
    ahead
        Positions at the next tick, of bodies that state how they move, whose velocities there are those waiting.
    heard
        The last fixes of all agents, the newest first, shape (delay + 1, N, 2 m); None where agents know the present.
    errors
        Errors of the newest fix, shape (N, 2 m).
    """

    q: Array
    p: Array
    waiting: Array
    ticked: Instants
    instant: int = 0
    ahead: Array | None = None
    heard: Array | None = None
    errors: Array | None = None


class Read(NamedTuple):
    """What else a checkpoint states.

    Parameters
    ----------
    time, steps
        Time reached, and number of instants at which agents ticked.
    pairs
        Linked pairs of each graph.
    gaps
        How forces compared with the declared law.
    """

    time: float
    steps: int
    pairs: list[tuple[Indices, Indices]]
    gaps: LawGaps


def packed_memory(
    memory: DiscreteMemory, time: float, steps: int, pairs: list[tuple[Indices, Indices]], gaps: LawGaps
) -> Packed:
    """A session as numbers and arrays.

    Parameters
    ----------
    memory
        What it goes on from.
    time, steps, pairs, gaps
        As for `Read`.
    """
    arrays: Arrays = {"q": memory.q, "p": memory.p, "waiting": memory.waiting, "ticked": memory.ticked}
    arrays |= {name: value for name in OPTIONAL if (value := getattr(memory, name)) is not None}
    for k, found in enumerate(pairs):
        table = np.array(found, dtype=np.int64).reshape(2, -1)
        arrays[f"pairs{k}"] = np.ascontiguousarray(table[:, np.argsort(table[0] * len(memory.q) + table[1])])
    numbers: dict[str, object] = {
        "time": time, "steps": steps, "instant": memory.instant,
        "checks": gaps.checks, "gap": gaps.gap, "allowed": gaps.allowed, "worst": gaps.worst,
    }  # fmt: skip
    return numbers, arrays


def unpacked_memory(fresh: DiscreteMemory, packed: Packed, scenario: Scenario) -> Read:
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
    start, graphs = scenario.start, scenario.law.graphs
    n, m = start.q.shape
    free, count = Real(0.0), Integer(0, MOST_COUNT)
    Names({
        "time": Real(start.t, max(scenario.t_end, start.t)), "steps": count, "instant": count,
        "checks": count, "gap": free, "allowed": free, "worst": free,
    }).check(data, "")  # fmt: skip
    motion = Table("f8", (n, m), -LARGEST, LARGEST)
    Names({
        "q": motion, "p": motion, "waiting": motion, "ticked": Table("i8", (n,), 0, MOST_COUNT),
        **{f"pairs{k}": Table("i8", (2, None), 0, n - 1) for k in range(len(graphs))},
        **{name: Table("f8", value.shape, -LARGEST, LARGEST) for name in OPTIONAL
           if (value := getattr(fresh, name)) is not None},
    }).check(arrays, "")  # fmt: skip
    numbers = cast(dict[str, float], data)
    instant, time = int(numbers["instant"]), float(numbers["time"])
    assert isinstance(scenario.control, Held)
    ticks = scenario.control.schedule(n)
    done, ticked = ticks.count_until(instant), arrays["ticked"]
    last = ticks.at(np.arange(n), ticked)
    must((ticked <= done).all() and (last >= instant).all(), "ticked", "agree with the schedule of the ticks")
    passed = (time - start.t) / NANOSECOND
    must(instant <= passed * (1.0 + ROUNDED) + SAME and passed <= float(last.min()) + 1.0, "time", "fit the clocks")
    found = []
    for k, graph in enumerate(graphs):
        i, j = arrays[f"pairs{k}"]
        codes = i * n + j
        must((np.diff(codes) > 0).all() and (i != j).all(), f"pairs{k}", "be sorted pairs of different agents")
        both = np.array_equal(np.sort(j * n + i), codes)
        must(graph.directed or both, f"pairs{k}", f"be links of a {type(graph).__name__} graph")
        found.append((i.copy(), j.copy()))
    fresh.q, fresh.p, fresh.waiting = arrays["q"], arrays["p"], arrays["waiting"]
    fresh.ticked, fresh.instant = ticked, instant
    for name in OPTIONAL:
        if getattr(fresh, name) is not None:
            setattr(fresh, name, arrays[name])
    gaps = LawGaps(int(numbers["checks"]), float(numbers["gap"]), float(numbers["allowed"]), float(numbers["worst"]))
    return Read(time, int(numbers["steps"]), found, gaps)
