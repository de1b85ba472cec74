"""Messages within the native loop: samples are taken, sent and received as by `Knowledge`.

See `flocking.engine.imperfect.messages.knowledge`.
"""

from __future__ import annotations

import math

import numpy as np

from flocking.engine.imperfect.messages.samples import START
from flocking.engine.kernels.counter_draws import drawn
from flocking.engine.kernels.displacements import nearest_difference
from flocking.engine.sampled.blocks.arrays import (
    BERNOULLI,
    GILBERT_ELLIOTT,
    NONE,
    Acts,
    Memory,
    Schedules,
    Sending,
    Truth,
    Work,
)
from flocking.formula.native.functions import native_apart
from flocking.model.world.random_numbers import Purpose

OF_LOSS, OF_CHANNEL, OF_JITTER = int(Purpose.LOSS), int(Purpose.CHANNEL), int(Purpose.JITTER)
"""Purposes of draws."""

NO, YES, DOUBT = range(3)
"""Whether a message has arrived; or that rounding decides, so that NumPy's functions do."""

NEAR = 1e-12
"""Difference of a draw and a probability of exponentials within which two libraries may disagree: some thousand units
of rounding."""

INTEGERS_FROM = 4503599627370496.0
"""2**52: from there on numbers are integers, and adding it rounds smaller ones to the nearest even whole number."""


def round_half_even(x: float) -> float:
    """The nearest whole number, the even one of two, as NumPy's ``rint``; for native functions."""
    size = abs(x)
    return math.copysign((size + INTEGERS_FROM) - INTEGERS_FROM if size < INTEGERS_FROM else size, x)


def is_bad(sending: Sending, one: int, two: int, sample: int) -> bool:
    """Whether the channel of two agents is bad at a ``sample``, see `GilbertElliott.bad`; for native functions.

    Parameters
    ----------
    sending
        The losses.
    one, two
        The agents, in the order in which draws name them.
    """
    redraws, law, first, leave = sending.chances[2], sending.chances[3], sending.chances[4], sending.chances[5]
    at, flips = sample, False
    if leave == 2.0:
        flips, at = at % 2 == 1, 0
    while True:
        draw = drawn(sending.seed, OF_CHANNEL, one, two, at)
        begun = at <= 0
        chance = 1.0 if begun else redraws
        if draw < chance:
            share = first if begun else law
            return bool((draw < chance * share) != flips)
        at -= 1
        if leave > 1.0:
            flips = not flips


def arrives(
    schedules: Schedules, sending: Sending, memory: Memory, receiver: int, sender: int, k: int, instant: int
) -> int:
    """Whether the message about sample ``k`` is there, see `Knowledge.has_arrived`: `YES`, `NO` or `DOUBT`.

    Parameters
    ----------
    schedules, sending, memory
        When samples are taken, how they are sent, and the distances at which they were.
    receiver, sender
        The agents.
    instant
        Now, in nanoseconds.
    """
    when = schedules.offset[sender] + k * schedules.sampling[sender] + sending.delay
    if when > instant:
        return NO
    if sending.jitter > 0 and when + sending.jitter > instant:
        late = drawn(sending.seed, OF_JITTER, sender, receiver, k) * sending.jitter
        if when + int(round_half_even(late)) > instant:
            return NO
    if sending.loss == NONE:
        return YES
    one = min(sender, receiver) if sending.paired else sender
    two = max(sender, receiver) if sending.paired else receiver
    if sending.loss == BERNOULLI:
        chance = sending.chances[0]
    elif sending.loss == GILBERT_ELLIOTT:
        chance = sending.chances[1] if is_bad(sending, one, two, k) else sending.chances[0]
    else:
        distance = memory.distances[k % memory.distances.shape[0], sender, receiver]
        share = math.exp(-((distance / sending.chances[1]) ** sending.chances[2]))
        chance = 1.0 - (1.0 - sending.chances[0]) * share
        if abs(drawn(sending.seed, OF_LOSS, one, two, k) - chance) <= NEAR:
            return DOUBT
    return NO if drawn(sending.seed, OF_LOSS, one, two, k) < chance else YES


def lost_until(schedules: Schedules, sending: Sending, acts: Acts, i: int, j: int) -> int:
    """Number of the last sample of agent ``j`` that is lost to ``i`` unless it was there when ``i`` last acted.

    Parameters
    ----------
    schedules, sending, acts
        When they measure and act, how messages are sent, and how often ``i`` has acted; for native functions.
    """
    if acts.ticked[i] == 0:
        return START
    acted = schedules.phase[i] + (acts.ticked[i] - 1) * schedules.period[i]
    since = acted - sending.delay - sending.jitter - schedules.offset[j]
    return int(START if since < 0 else since // schedules.sampling[j])


@native_apart
def hear(schedules: Schedules, sending: Sending, acts: Acts, memory: Memory, work: Work, instant: int) -> bool:
    """Let agents that act have the newest sample of each other one that is there; whether none was in doubt.

    Parameters
    ----------
    schedules, sending, memory, instant
        As for `arrives`.
    acts
        How often they have acted.
    work
        States who acts.
    """
    n = memory.taken.shape[0]
    for j in range(n):
        since = instant - sending.delay - schedules.offset[j]
        count = 0 if since < 0 else since // schedules.sampling[j] + 1
        last = min(count, memory.taken[j]) - 1
        for i in range(n):
            if not work.acting[i] or i == j:
                continue
            k, lost = last, lost_until(schedules, sending, acts, i, j)
            while k > memory.newest[i, j] and k > lost:
                there = arrives(schedules, sending, memory, i, j, k, instant)
                if there == DOUBT:
                    return False
                if there == YES:
                    memory.newest[i, j] = k
                k -= 1
    return True


@native_apart
def measure(
    schedules: Schedules, sending: Sending, memory: Memory, truth: Truth, work: Work, instant: int
) -> tuple[bool, bool]:
    """Let agents take the samples that fall on an ``instant``: whether they could, and whether there were any.

    They cannot where there is no room for the samples, or where their errors have not been drawn.

    Parameters
    ----------
    schedules, sending, memory
        When samples are taken, with which errors, and those that are kept.
    truth
        The space.
    work
        True positions and velocities.
    """
    n, m, room, some = work.q.shape[0], work.q.shape[1], memory.rows.shape[0], False
    for j in range(n):
        measures = schedules.offset[j] + memory.taken[j] * schedules.sampling[j] == instant
        some = some or measures
        last = memory.taken[j] if measures else memory.taken[j] - 1
        least = last
        for i in range(n):
            if i != j:
                least = min(least, memory.newest[i, j])
        if last - max(least, 0) >= room:
            return False, some
        if measures and sending.noisy and memory.taken[j] - sending.first[j] >= sending.normals.shape[0]:
            return False, some
    for j in range(n):
        k = memory.taken[j]
        if schedules.offset[j] + k * schedules.sampling[j] != instant:
            continue
        place = k % room
        for c in range(2 * m):
            value = work.q[j, c] if c < m else work.p[j, c - m]
            if sending.noisy:
                correlation = 0.0 if k == 0 else sending.memory[j]
                normal = sending.normals[k - sending.first[j], j, c]
                memory.errors[j, c] = (
                    correlation * memory.errors[j, c] + np.sqrt(1.0 - correlation * correlation) * normal
                )
                value += sending.deviations[0 if c < m else 1] * memory.errors[j, c]
            step = sending.resolution if c < m else sending.velocity_resolution
            if step != 0.0:
                value = round_half_even(value / step) * step
            memory.rows[place, j, c] = value
        if memory.distances.shape[1] > 0:
            for i in range(n):
                square = 0.0
                for c in range(m):
                    d = work.q[i, c] - work.q[j, c]
                    if truth.lengths[c] < np.inf:
                        d = nearest_difference(d, truth.lengths[c])
                    square += d * d
                memory.distances[place, j, i] = np.sqrt(square)
        memory.taken[j] = k + 1
    return True, some


def sample_of(memory: Memory, j: int, k: int, c: int) -> float:
    """Number ``c`` of sample ``k`` of agent ``j``, or of its start; for native functions.

    Parameters
    ----------
    memory
        The samples.
    """
    return float(memory.start[j, c] if k == START else memory.rows[k % memory.rows.shape[0], j, c])
