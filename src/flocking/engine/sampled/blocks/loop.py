"""The native loop over the events of a session of held control.

It does what `flocking.engine.sampled.session.SampledSession` does with an event, by the same formulas in the same
order, so that both give the same bits. It stops before an event, or within one where that can be taken up again, if
Python must go on: where rounding decides whether a message is lost, where a force is not finite, where room is short.
"""

from __future__ import annotations

import numpy as np

from flocking.engine.sampled.blocks.arrays import (
    ACTS,
    CROSSINGS,
    ROWS,
    STEPS,
    SWITCHES,
    TIME,
    USES,
    WAITING,
    Acts,
    Bounds,
    KnownLaw,
    Memory,
    Movement,
    Records,
    Schedules,
    Sending,
    Truth,
    Work,
)
from flocking.engine.sampled.blocks.hearing import hear, measure
from flocking.engine.sampled.blocks.knowing import compute_forces, log_acts, relink_known
from flocking.engine.sampled.blocks.ledger import (
    account,
    first_crossing,
    make_frames,
    record_row,
    relink,
    switch,
    watch,
)
from flocking.engine.sampled.blocks.pieces import NEVER, exert, hold, lengths, move, next_change, renew, wait
from flocking.formula.native.functions import native_announced, native_apart
from flocking.model.world.times import NANOSECOND

BOUND, STOPPED, UNWATCHED = range(3)
"""Outcomes: the end or the most events are reached; the next event is left to Python; the switches after the last one
are."""


@native_apart
def act(
    schedules: Schedules, sending: Sending, acts: Acts, memory: Memory, law: KnownLaw, truth: Truth, records: Records,
    bounds: Bounds, work: Work, instant: int,
) -> bool:  # fmt: skip
    """Let agents act whose ticks fall on an ``instant``; whether they could, and have.

    Parameters
    ----------
    schedules, sending, acts, memory, law, truth, records, bounds
        As for `event_block`.
    work
        True positions and velocities; takes who acts.
    """
    n, count = work.q.shape[0], 0
    for i in range(n):
        work.acting[i] = schedules.phase[i] + acts.ticked[i] * schedules.period[i] == instant
        count += 1 if work.acting[i] else 0
    if count == 0:
        return True
    if schedules.messages and not hear(schedules, sending, acts, memory, work, instant):
        return False
    uses = relink_known(schedules, sending, memory, truth, work, instant)
    waiting, logged = truth.counts[WAITING], records.counts[USES]
    if (
        uses > law.pairs.senders.shape[0] or logged + uses + count > records.uses.shape[0]
        or records.counts[ACTS] + count > records.acts.shape[0] or waiting + count > acts.when.shape[0]
    ):  # fmt: skip
        return False
    if not compute_forces(schedules, sending, memory, truth, law, work, bounds.base, instant):
        return False
    log_acts(schedules, sending, memory, work, records, instant)
    truth.counts[STEPS] += 1
    for i in range(n):
        if work.acting[i]:
            acts.ticked[i] += 1
            wait(acts, waiting, instant + schedules.latency[i], i, work.u)
            waiting += 1
    truth.counts[WAITING] = waiting
    return True


@native_apart
def change(
    schedules: Schedules, sending: Sending, motion: Movement, acts: Acts, memory: Memory, law: KnownLaw, truth: Truth,
    records: Records, bounds: Bounds, work: Work, instant: int,
) -> int:  # fmt: skip
    """What falls on an ``instant``: samples, what arrives, links, controls, and forces that begin to act.

    Parameters
    ----------
    schedules, sending, motion, acts, memory, law, truth, records, bounds, work
        As for `event_block`.

    Returns
    -------
    int
        One of the outcomes; `BOUND` where all is done.
    """
    seconds = instant * NANOSECOND
    move(motion, seconds, work.q, work.p)
    if schedules.messages:
        could, _ = measure(schedules, sending, memory, truth, work, instant)
        if not could:
            return STOPPED
    if not act(schedules, sending, acts, memory, law, truth, records, bounds, work, instant):
        return STOPPED
    renewed = renew(motion, instant, work.changed)
    if not renewed and not (truth.counts[WAITING] > 0 and acts.when[0] == instant):
        return BOUND
    if not account(motion, truth, bounds, work, seconds):
        return STOPPED
    if renewed:
        for i in range(work.changed.shape[0]):
            if work.changed[i]:
                exert(motion, i, instant, motion.force, False)
    truth.counts[WAITING] = hold(motion, acts, work, instant, truth.counts[WAITING])
    record_row(truth, bounds, records, seconds)
    lengths(schedules, motion, acts, instant, work.length)
    return BOUND if watch(motion, truth, bounds, work, seconds) else UNWATCHED


@native_announced("the loop of held control")
def event_block(
    schedules: Schedules, sending: Sending, motion: Movement, acts: Acts, memory: Memory, law: KnownLaw, truth: Truth,
    records: Records, bounds: Bounds, work: Work,
) -> tuple[int, int, int]:  # fmt: skip
    """Let events take place, in the order of their times, switches of true links first.

    Parameters
    ----------
    schedules, sending
        When agents act and measure, and how messages are sent.
    motion, acts, memory, truth
        The state, which is changed.
    law
        The law on what agents know.
    records
        Takes what is recorded.
    bounds
        How far to go.
    work
        Arrays to work with.

    Returns
    -------
    tuple
        Number of events, the outcome, see `BOUND`, and the nanosecond of an event whose switches are not watched.
    """
    events, counts = 0, records.counts
    relink(truth)
    while events < bounds.most:
        if counts[ROWS] + 2 > records.trace.shape[0] or counts[SWITCHES] + 1 > records.switches.shape[0]:
            return events, STOPPED, 0
        instant = next_change(schedules, motion, acts, truth.counts[WAITING], memory.taken)
        at = instant * NANOSECOND if instant < NEVER else np.inf
        row = first_crossing(truth) if truth.counts[CROSSINGS] > 0 else -1
        crossing = truth.crossings[row, 0] if row >= 0 else np.inf
        earliest = min(at, crossing)
        if not earliest < bounds.end:
            return events, BOUND, 0
        if not make_frames(motion, truth, bounds, records, work, earliest):
            return events, STOPPED, 0
        truth.progress[TIME] = max(truth.progress[TIME], bounds.base + earliest)
        if crossing <= at:
            if not switch(motion, truth, bounds, records, work, row):
                return events, STOPPED, 0
        else:
            outcome = change(
                schedules, sending, motion, acts, memory, law, truth, records, bounds, work, instant
            )  # fmt: skip
            if outcome == STOPPED:
                return events, STOPPED, 0
            if outcome == UNWATCHED:
                return events + 1, UNWATCHED, instant
        events += 1
    return events, BOUND, 0
