"""Links and forces by what agents know, within the native loop."""

from __future__ import annotations

import numpy as np

from flocking.engine.imperfect.messages.samples import START
from flocking.engine.kernels.codegen import ARGUMENTS, CONTROL_RESULTS
from flocking.engine.kernels.displacements import nearest_difference
from flocking.engine.kernels.neighbours import KNOWN_ARGUMENTS
from flocking.engine.runs.message_log import OWN, PRESENT
from flocking.engine.sampled.blocks.arrays import (
    ACTS,
    USES,
    KnownLaw,
    Memory,
    Records,
    Schedules,
    Sending,
    Truth,
    Work,
)
from flocking.engine.sampled.blocks.hearing import sample_of
from flocking.formula.native.functions import by_address, native_apart
from flocking.model.world.times import NANOSECOND

_control = by_address(ARGUMENTS + KNOWN_ARGUMENTS + CONTROL_RESULTS)


def begun(schedules: Schedules, memory: Memory, i: int, j: int) -> int:
    """When the sample that agent ``i`` uses of ``j`` was taken, in nanoseconds; for native functions.

    Parameters
    ----------
    schedules, memory
        When samples are taken, and which are used.
    """
    k = memory.newest[i, j]
    return 0 if k == START else int(schedules.offset[j] + k * schedules.sampling[j])


def own_number(sending: Sending, memory: Memory, work: Work, i: int, c: int) -> float:
    """Coordinate, or component of the velocity, ``c`` of what agent ``i`` knows of itself; for native functions.

    Parameters
    ----------
    sending, memory, work
        How it knows itself, its samples, and its true state.
    """
    if sending.measured:
        return sample_of(memory, i, memory.taken[i] - 1, c)
    m = work.q.shape[1]
    return float(work.q[i, c] if c < m else work.p[i, c - m])


def place_known(
    schedules: Schedules, sending: Sending, memory: Memory, work: Work, i: int, j: int, axis: int, since: float
) -> float:
    """Where agent ``i`` takes ``j`` to be along an ``axis``; for native functions.

    Parameters
    ----------
    schedules, sending, memory, work
        What is known.
    since
        Age of the sample, in seconds.
    """
    if not schedules.messages:
        return float(work.q[j, axis])
    k = memory.newest[i, j]
    place = sample_of(memory, j, k, axis)
    return place + since * sample_of(memory, j, k, work.q.shape[1] + axis) if sending.predict else place


@native_apart
def relink_known(schedules: Schedules, sending: Sending, memory: Memory, truth: Truth, work: Work, instant: int) -> int:
    """Let links of agents that act follow what they know; how many neighbours they have, one for each graph.

    Parameters
    ----------
    schedules, sending, memory, truth
        What is known, the rules of links, and the space.
    work
        Who acts; takes of whom they know anything.
    instant
        Now, in nanoseconds.
    """
    n, m, rules, count = work.q.shape[0], work.q.shape[1], truth.known_rules, 0
    own = np.empty(m)
    for i in range(n):
        if not work.acting[i]:
            continue
        for k in range(m):
            own[k] = own_number(sending, memory, work, i, k)
        for j in range(n):
            age = instant - begun(schedules, memory, i, j) if schedules.messages else 0
            there = sending.expires < 0 or age < sending.expires
            work.there[i, j] = there
            square, since = 0.0, age * NANOSECOND
            for k in range(m):
                d = place_known(schedules, sending, memory, work, i, j, k, since) - own[k]
                if truth.lengths[k] < np.inf:
                    d = nearest_difference(d, truth.lengths[k])
                square += d * d
            distance = np.sqrt(square)
            for g in range(rules.ways.shape[0]):
                if rules.ways[g] > 0:
                    level = rules.break_[g, i] if memory.links[g, i, j] else rules.appear[g, i]
                    memory.links[g, i, j] = distance < level and there and i != j
                if memory.links[g, i, j] and there:
                    count += 1
    return count


@native_apart
def compute_forces(
    schedules: Schedules, sending: Sending, memory: Memory, truth: Truth, law: KnownLaw, work: Work, base: float,
    instant: int,
) -> bool:  # fmt: skip
    """Put the desired forces of the law on agents that act into ``work.u``; whether all are finite.

    Parameters
    ----------
    schedules, sending, memory, truth
        What is known, and the parameters of the law.
    law
        The law on it, with room for all neighbours.
    base, instant
        The scenario's time at the start, and nanoseconds since.
    """
    n, m, pairs, on, e = work.q.shape[0], work.q.shape[1], law.pairs, truth.law, 0
    q, p, rates, none = np.zeros((n, m)), np.zeros((n, m)), np.empty(3), np.empty(0)
    for i in range(n):
        if work.acting[i]:
            for k in range(m):
                q[i, k] = own_number(sending, memory, work, i, k)
                if on.order == 2:
                    p[i, k] = own_number(sending, memory, work, i, m + k)
    for g in range(memory.links.shape[0]):
        pairs.offsets[g] = e
        for i in range(n):
            if not work.acting[i]:
                continue
            for j in range(n):
                if not (memory.links[g, i, j] and work.there[i, j]):
                    continue
                pairs.senders[e], pairs.sensed[e] = i, j
                number = memory.newest[i, j]
                for c in range(2 * m):
                    if schedules.messages:
                        value = sample_of(memory, j, number, c)
                    else:
                        value = work.q[j, c] if c < m else work.p[j, c - m]
                    law.rows[e, 0, c] = 0.0 if on.order == 1 and c >= m else value
                if law.degree > 0:
                    for c in range(m):
                        law.rows[e, 1, c] = sample_of(memory, j, number, m + c)
                        law.rows[e, 1, m + c] = 0.0
                    law.times[e] = begun(schedules, memory, i, j) * NANOSECOND + base
                else:
                    law.times[e] = instant * NANOSECOND + base
                e += 1
    pairs.offsets[memory.links.shape[0]] = e
    _control(
        law.control, base + instant * NANOSECOND, q, p, pairs.senders, pairs.sensed, pairs.offsets, pairs.pieces,
        pairs.spans, on.slots.P, on.slots.A, on.slots.W, on.functionals, law.times, law.rows, work.u, rates, none,
    )  # fmt: skip
    finite = True
    for i in range(n):
        for k in range(m):
            finite = finite and (not work.acting[i] or np.isfinite(work.u[i, k]))
    return finite


def log_acts(
    schedules: Schedules, sending: Sending, memory: Memory, work: Work, records: Records, instant: int
) -> None:
    """Log what agents that act use; for native functions.

    Parameters
    ----------
    schedules, sending, memory, work
        What is known, and the forces.
    records
        Takes the rows; there is room for them.
    instant
        Now, in nanoseconds.
    """
    n, m, act, use = work.q.shape[0], work.q.shape[1], records.counts[ACTS], records.counts[USES]
    for i in range(n):
        if not work.acting[i]:
            continue
        first = use
        if sending.measured:
            records.uses[use, 0], records.uses[use, 1], records.uses[use, 2] = OWN, i, memory.taken[i] - 1
            use += 1
        for g in range(memory.links.shape[0]):
            for j in range(n):
                if memory.links[g, i, j] and work.there[i, j]:
                    number = memory.newest[i, j] if schedules.messages else PRESENT
                    records.uses[use, 0], records.uses[use, 1], records.uses[use, 2] = g, j, number
                    use += 1
        records.acts[act, 0], records.acts[act, 1], records.acts[act, 2] = instant, i, use - first
        for k in range(m):
            records.forces[act, k] = work.u[i, k]
        act += 1
    records.counts[ACTS], records.counts[USES] = act, use
