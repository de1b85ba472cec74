"""Ledger, closest approaches and true links within the native loop, as `ImperfectSession` keeps them."""

from __future__ import annotations

import numpy as np

from flocking.engine.imperfect.pair_polynomials import Paths, find_closest
from flocking.engine.imperfect.pair_switches import find_pair_events
from flocking.engine.imperfect.powers import integrate_powers
from flocking.engine.kernels.codegen import ARGUMENTS
from flocking.engine.kernels.displacements import nearest_difference
from flocking.engine.sampled.blocks.arrays import (
    ACCOUNTED,
    CROSSINGS,
    ENDS,
    ENERGY,
    FRAMES,
    JUMPED,
    KINETIC,
    LARGEST,
    LINKED,
    ROWS,
    SWITCHES,
    Bounds,
    Movement,
    Records,
    Truth,
    Work,
)
from flocking.engine.sampled.blocks.pieces import move, series
from flocking.formula.native.functions import by_address, native_apart

_energies = by_address(ARGUMENTS)


@native_apart
def energy_now(motion: Movement, truth: Truth, bounds: Bounds, work: Work, seconds: float) -> None:
    """Take the energies at ``seconds`` from the start; positions and velocities then are in ``work``.

    Parameters
    ----------
    motion, truth, bounds
        The motion, the law on the true state, and the scenario's time at the start.
    """
    law, n = truth.law, work.q.shape[0]
    pairs, slots, found = law.pairs, law.slots, work.three
    move(motion, seconds, work.q, work.p)
    for i in range(n):
        for k in range(work.q.shape[1]):
            work.seen[i, k] = work.p[i, k] if law.order == 2 else 0.0
    _energies(
        truth.energies, bounds.base + seconds, work.q, work.seen, pairs.senders, pairs.sensed, pairs.offsets,
        pairs.pieces, pairs.spans, slots.P, slots.A, slots.W, law.functionals, found,
    )  # fmt: skip
    apart = 0.5 * (n * (n - 1) - truth.counts[LINKED]) * truth.unlinked
    truth.progress[ENERGY], truth.progress[KINETIC] = found[0] + found[1] + found[2] + apart, found[2]


@native_apart
def account(motion: Movement, truth: Truth, bounds: Bounds, work: Work, seconds: float) -> bool:
    """Bring ledger and closest approaches up to a time; false where a pair has too many images, and nothing changed.

    Parameters
    ----------
    motion, truth, bounds, work
        The motion, the ledger, the quadrature, and arrays to work with.
    seconds
        The time, since the start.
    """
    progress, begin = truth.progress, truth.progress[ACCOUNTED]
    length = seconds - begin
    if length <= 0.0:
        return True
    series(motion, begin, work.S)
    for row in range(2):
        for c in range(4):
            work.closest[row, c] = truth.closest[row, c]
    paths = Paths(work.S, truth.lengths, truth.table, bounds.base + begin)
    if find_closest(paths, length, truth.links[0], work.closest) < 0:
        return False
    for row in range(2):
        if work.closest[row, 0] != truth.closest[row, 0]:
            work.closest[row, 1] += begin
        for c in range(4):
            truth.closest[row, c] = work.closest[row, c]
    if bounds.base + begin < progress[ENDS]:
        n, m = work.q.shape[0], work.q.shape[1]
        forces = np.empty((1, n, m))
        for i in range(n):
            for k in range(m):
                forces[0, i, k] = motion.force[i, k]
        for row in range(2):
            for c in range(4):
                work.found[row, c] = 0.0
        progress[LARGEST] = integrate_powers(
            truth.law,
            bounds.base + begin,
            work.S,
            forces,
            length,
            bounds.tolerance,
            progress[LARGEST],
            bounds.rule,
            work.found,
        )
        for row in range(2):
            for c in range(4):
                truth.sums[row, c] += work.found[row, c]
    progress[ACCOUNTED] = seconds
    energy_now(motion, truth, bounds, work, seconds)
    return True


def record_row(truth: Truth, bounds: Bounds, records: Records, seconds: float) -> None:
    """Put the ledger at ``seconds`` from the start on record, unless it has ended; for native functions.

    Parameters
    ----------
    truth, bounds, records
        The ledger, the scenario's time at the start, and room for a row.
    """
    progress, row = truth.progress, records.counts[ROWS]
    if bounds.base + seconds <= progress[ENDS]:
        trace = records.trace
        trace[row, 0], trace[row, 1], trace[row, 2] = bounds.base + seconds, progress[ENERGY], progress[KINETIC]
        trace[row, 3], trace[row, 4], trace[row, 5] = truth.sums[0, 0], truth.sums[0, 1], truth.sums[0, 2]
        trace[row, 6], trace[row, 7] = progress[JUMPED], truth.sums[0, 3]
        records.counts[ROWS] = row + 1


def make_frames(motion: Movement, truth: Truth, bounds: Bounds, records: Records, work: Work, until: float) -> bool:
    """Make the frames that are due until a time; whether there was room. For native functions.

    Parameters
    ----------
    motion, truth, bounds, records, work
        The motion, the links, the scenario's time at the start, room for frames, and arrays to work with.
    until
        The time, since the start.
    """
    shown, n, m = records.counts[FRAMES], work.q.shape[0], work.q.shape[1]
    while shown < records.frame_times.shape[0] and records.frame_times[shown] - bounds.base <= until:
        if shown >= records.q.shape[0]:
            return False
        move(motion, records.frame_times[shown] - bounds.base, work.q, work.p)
        for i in range(n):
            for k in range(m):
                records.q[shown, i, k] = work.q[i, k]
                records.p[shown, i, k] = work.p[i, k] if truth.law.order == 2 else 0.0
            for j in range(n):
                records.links[shown, i, j] = truth.links[0, i, j]
        shown += 1
        records.counts[FRAMES] = shown
    return True


@native_apart
def relink(truth: Truth) -> None:
    """Put the pairs that are linked in truth among those of the law, for which there is room.

    Parameters
    ----------
    truth
        Links and law.
    """
    pairs, links, e = truth.law.pairs, truth.links, 0
    for g in range(links.shape[0]):
        pairs.offsets[g] = e
        for i in range(links.shape[1]):
            for j in range(links.shape[2]):
                if links[g, i, j]:
                    pairs.senders[e], pairs.sensed[e], pairs.pieces[e] = i, j, truth.rows[g, i]
                    e += 1
        if g == 0:
            truth.counts[LINKED] = e
    pairs.offsets[links.shape[0]] = e


def first_crossing(truth: Truth) -> int:
    """Row of the first of all crossings, by time, agents and graph; -1 where there is none. For native functions.

    Parameters
    ----------
    truth
        The crossings.
    """
    best, x = -1, truth.crossings
    for row in range(truth.counts[CROSSINGS]):
        if best < 0:
            best = row
            continue
        c = 0
        while c < 3 and x[row, c] == x[best, c]:
            c += 1
        if x[row, c] < x[best, c]:
            best = row
    return best


@native_apart
def watch(motion: Movement, truth: Truth, bounds: Bounds, work: Work, seconds: float) -> bool:
    """Find the switches of the pairs of changed agents until a piece ends; whether there was room for them.

    Parameters
    ----------
    motion, truth, bounds
        The motion, links and rules, and the scenario's time at the start.
    work
        Who has changed, and how long each motion goes on.
    seconds
        Now, since the start.
    """
    rules, x, some = truth.rules, truth.crossings, False
    for g in range(rules.ways.shape[0]):
        some = some or rules.ways[g] > 0
    if not some:
        return True
    remaining = 0
    for row in range(truth.counts[CROSSINGS]):
        if not (work.changed[int(x[row, 1])] or work.changed[int(x[row, 2])]):
            for c in range(4):
                x[remaining, c] = x[row, c]
            remaining += 1
    truth.counts[CROSSINGS] = remaining
    series(motion, seconds, work.S)
    size = 0.0
    for i in range(work.q.shape[0]):
        for k in range(work.q.shape[1]):
            size = max(size, abs(work.S[0, i, k]))
    paths = Paths(work.S, truth.lengths, truth.table, bounds.base + seconds)
    count = find_pair_events(
        paths, work.length, work.changed, truth.links, rules.ways, rules.appear, rules.break_, size, work.fresh
    )
    if count < 0 or count > work.fresh.shape[0] or remaining + count > x.shape[0]:
        return False
    for row in range(count):
        x[remaining + row, 0] = seconds + work.fresh[row, 0]
        for c in range(1, 4):
            x[remaining + row, c] = work.fresh[row, c]
    truth.counts[CROSSINGS] = remaining + count
    return True


@native_apart
def switch(motion: Movement, truth: Truth, bounds: Bounds, records: Records, work: Work, row: int) -> bool:
    """Let the pair of a row of the crossings switch; false where that is left to Python, and nothing changed.

    Parameters
    ----------
    motion, truth, bounds, records, work
        The motion, links and ledger, the scenario's time at the start, room for the rows, and arrays to work with.
    """
    x, pairs, progress = truth.crossings, truth.law.pairs, truth.progress
    seconds, i, j, g = x[row, 0], int(x[row, 1]), int(x[row, 2]), int(x[row, 3])
    breaks, links = truth.links[g, i, j], truth.links
    if pairs.offsets[links.shape[0]] + 2 > pairs.senders.shape[0]:
        return False
    ends = progress[ENDS]
    if breaks and truth.barriers[g]:
        progress[ENDS] = min(ends, bounds.base + progress[ACCOUNTED])
    if not account(motion, truth, bounds, work, seconds):
        progress[ENDS] = ends
        return False
    last = truth.counts[CROSSINGS] - 1
    for c in range(4):
        x[row, c] = x[last, c]
    truth.counts[CROSSINGS] = last
    move(motion, seconds, work.q, work.p)
    square, dot, relative = 0.0, 0.0, 0.0
    for k in range(work.q.shape[1]):
        d, w = work.q[j, k] - work.q[i, k], work.p[j, k] - work.p[i, k]
        if truth.lengths[k] < np.inf:
            d = nearest_difference(d, truth.lengths[k])
        square += d * d
        dot += d * w
        relative += w * w
    distance = np.sqrt(square)
    speed = dot / distance if distance > 0.0 else 0.0
    record_row(truth, bounds, records, seconds)
    links[g, i, j] = not breaks
    if truth.rules.ways[g] == 1:
        links[g, j, i] = not breaks
    relink(truth)
    before = progress[ENERGY]
    energy_now(motion, truth, bounds, work, seconds)
    if np.isfinite(progress[ENERGY]) and np.isfinite(before):
        progress[JUMPED] += progress[ENERGY] - before
    else:
        progress[ENDS] = min(progress[ENDS], bounds.base + progress[ACCOUNTED])
    found, at = records.switches, records.counts[SWITCHES]
    found[at, 0], found[at, 1], found[at, 2], found[at, 3] = bounds.base + seconds, i, j, 1.0 if breaks else 0.0
    found[at, 4], found[at, 5], found[at, 6] = g, speed, np.sqrt(relative)
    records.counts[SWITCHES] = at + 1
    record_row(truth, bounds, records, seconds)
    return True
