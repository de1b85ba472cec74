"""The native loop over the steps of a session.

It does what `flocking.engine.exact.session.ExactSession` does with a step, by the same native functions. It stops with
a step that ends in a switch, or on which a pair comes within the error of one, and before a step that needs more than a
cut at the first crossing: the session goes on from there.
"""

from __future__ import annotations

import math

import numpy as np

from flocking.engine.exact.barriers import LEDGER_GAP, relative_gap
from flocking.engine.exact.companion import LOST, NODES, SAFETY, SLOWER, compare, summary
from flocking.engine.exact.crossings.ball_guards import ball_slack, find_ball_crossings
from flocking.engine.exact.crossings.band_guards import find_within_error
from flocking.engine.exact.crossings.guards import NEVER, deepest_dip, find_crossings
from flocking.engine.exact.crossings.switching import TIE
from flocking.engine.exact.extremes import add_unexplained, follow_extremes
from flocking.engine.exact.integrator.method import DEGREE, STAGES, error_norm, next_length, polynomial
from flocking.engine.exact.integrator.segment import ROUNDING, fill_part, split_motion
from flocking.engine.exact.integrator.stepper import SPACINGS
from flocking.engine.exact.narrow_features import allowed_share
from flocking.engine.exact.precision import COARSEST, EPSILON
from flocking.engine.kernels.law_kernels import stages, state_energies
from flocking.formula.native.functions import native
from flocking.model.checks import Array

TIME, LENGTH, ENERGY, KINETIC, RATE, GAP, BEGIN, TRIED, STOP, PROPOSED = range(10)
"""What ``now`` holds: time, length proposed for the next step, energy and kinetic energy, rate of the companion, what
the ledger of the companion misses, when the step taken last began, and of the step tried last its length, its end
before it was cut, and the length proposed for the one after it."""

NOW = PROPOSED + 1

OPEN, REFUSED, FAILED = range(3)
"""How it ends: with a step that is not on record yet; or, all being on record, before a step that was tried and needs a
closer look, or that could not be tried."""

END, BOUND, BASE, TOLERANCE, REACH, FINEST, UNLINKED, VELOCITY_ROUNDING = range(8)
"""What ``limits`` holds: where to stop, where a step must end, the time at which the own time is 0, the tolerance of
the scenario, the shortest reach of a graph, the finest difference of radii, the energy of all pairs without links, and
the rounding of velocities by that of the origin."""

LIMITS = VELOCITY_ROUNDING + 1

LAST = NODES - 1
"""Number of the node at the end of a step."""

ERRORS = 8
"""How many numbers are known of the error of the step taken last."""

STEP_END, STEP_ENERGY, STEP_KINETIC, STEP_LENGTH = range(4)
"""What is kept of each step."""


@native
def step_block(
    control: int, energies: int, order: int, n: int, m: int, senders: Array, sensed: Array, offsets: Array,
    pieces: Array, spans: Array, P: Array, A: Array, W: Array, S: Array, nodes: Array, weights: Array, third: Array,
    fifth: Array, dense: Array, to_bernstein: Array, inside: Array, second: Array, barred: Array, near: Array,
    active: Array, enter: Array, leave: Array, graze: Array, directed: Array, smooth: Array, centres: Array,
    radii: Array, inside_ball: Array, watched_ball: Array, levels: Array, zones: Array, owners: Array,
    linked_senders: Array, linked_sensed: Array, singular: bool, timed: bool, recording: bool, tolerance: Array,
    limits: Array, linked: Array, shares: Array, goal: Array, has_goal: bool, moving: Array, now: Array, y: Array,
    slope: Array, K: Array, coefficients: Array, whole: Array, difference: Array, errors: Array, crossed: Array,
    extremes: Array, frame_times: Array, frames: Array, frame_errors: Array, steps: Array, states: Array,
) -> tuple[int, int, int, int, int]:  # fmt: skip
    """Take steps, and put those on record that leave nothing to decide.

    Parameters
    ----------
    control, energies
        Addresses of the compiled functions of the law.
    order, n, m
        Order of the agents, their number and that of the axes.
    senders, sensed, offsets, pieces, spans, P, A, W, S
        Pairs, parameters and functionals in force, see `flocking.engine.kernels.law_kernels`.
    nodes, weights, third, fifth, dense, to_bernstein, inside, second
        Coefficients of the method, of its polynomial and of the comparison with the companion.
    barred, near, active, enter, leave, graze, directed, smooth
        What is watched: whether the potential of a link is infinite where it breaks, which pairs are within a
        distance and which are looked at, shape (watches, N, N), the distances, shape (watches, N), how far beyond
        them a pair has crossed, whether pairs are ordered, and whether the force is continuous there.
    centres, radii, inside_ball, watched_ball, levels
        Distances from balls at rest that are watched: the balls, shape (levels, 8, K, m) and (levels, K), which
        agents are within the distance, which pairs are looked at, shape (levels, N, K), and the distances.
    zones, owners
        Narrow features of the potentials, and the graphs they belong to.
    linked_senders, linked_sensed
        The linked pairs among all pairs.
    singular, timed, recording
        Whether a potential is infinite at zero, whether the law depends on time, and whether steps may be put on
        record here: a step taken after a doubt may not.
    tolerance
        Tolerance of each component, shape (size,).
    limits
        See `END`.
    linked
        Links of the graph of the law, shape (N, N).
    shares, goal, has_goal, moving
        As for `flocking.engine.exact.extremes.follow_extremes`.
    now
        See `TIME`; changed.
    y, slope
        State vector and its slope, shape (size,); changed.
    K
        Slopes at the stages of the step tried last, shape (16, size); changed.
    coefficients, whole
        Of the step taken last, shape (8, size), and the state vector at its end before it was cut; changed.
    difference, errors
        Of the companion on the step taken last, shape (6, size), and the numbers of
        `flocking.engine.exact.companion.summary`, then what the error leaves the ledger unable to explain; changed.
    crossed
        Takes the crossings at the end of the step taken last: watch, place, and pair, shape (room, 4).
    extremes
        See `flocking.engine.exact.extremes.Extremes`; changed.
    frame_times
        The own times of the frames to come.
    frames, frame_errors
        Take their state vectors, shape (frames, size), and the errors of positions and velocities, shape (frames, 2).
    steps, states
        Take what is kept of each step, see `STEP_END`, shape (steps, 4), and the state vectors at their ends.

    Returns
    -------
    tuple
        How many steps were taken and how many are on record, how many frames were made, how it ends, see `OPEN`, and
        how many pairs cross at the end. Of a step that was refused ``coefficients`` holds the polynomial.
    """
    size, tail = y.shape[0], order * n * m
    taken, left, shown = 0, 0, 0
    base = limits[BASE]
    companion, found = np.empty((K.shape[0], size)), np.empty(3)
    new, fresh, other, middle, end = np.empty(size), np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    C, e = np.empty((DEGREE + 1, size)), np.empty((NODES, size))
    B, V, far = np.empty((DEGREE + 1, n, m)), np.empty((DEGREE + 1, n * (order - 1), m)), np.empty(n)
    off, none, part = np.empty((NODES, n, m)), np.empty((0, 6)), np.empty((DEGREE + 1, size))
    hits = np.empty((crossed.shape[0], 3))
    for c in range(size):
        other[c] = y[c] + difference[LAST, c]
    state_energies(
        energies, order, now[TIME] + base, other, n, m, senders, sensed, offsets, pieces, spans, P, A, W, S, found
    )
    gap = found[0] + found[1] + found[2] + limits[UNLINKED]
    state_energies(
        energies, order, now[TIME] + base, y, n, m, senders, sensed, offsets, pieces, spans, P, A, W, S, found
    )
    gap -= found[0] + found[1] + found[2] + limits[UNLINKED]
    now[GAP] = gap + difference[LAST, tail + 1] - difference[LAST, tail + 2]
    while True:
        # A step is tried until its error is small enough.
        t = now[TIME]
        shortest = SPACINGS * abs(math.nextafter(t, np.inf) - t)
        length = max(now[LENGTH], shortest)
        h, stop, error, rejected = 0.0, t, 1.0, False
        for c in range(size):
            K[0, c] = slope[c]
        while not error < 1.0 and length >= shortest:
            stop = min(t + length, limits[BOUND])
            h = stop - t
            stages(
                control, order, 1, STAGES + 1, STAGES, t + base, y, h, K, nodes, weights, n, m, senders, sensed,
                offsets, pieces, spans, P, A, W, S, new,
            )  # fmt: skip
            error = error_norm(K, h, y, new, tolerance, third, fifth)
            length = next_length(h, error, rejected)
            rejected = True
        now[TRIED] = h
        if not error < 1.0:
            return taken, left, shown, FAILED, 0
        finite = True
        for c in range(size):
            finite = finite and np.isfinite(new[c])
            fresh[c] = K[STAGES, c]
        if not finite:
            return taken, left, shown, FAILED, 0
        stages(
            control, order, STAGES + 1, nodes.shape[0], STAGES, t + base, y, h, K, nodes, weights, n, m, senders,
            sensed, offsets, pieces, spans, P, A, W, S, other,
        )  # fmt: skip
        polynomial(K, h, y, new, dense, to_bernstein, C)
        extent = split_motion(C, B, V, far)
        now[STOP] = stop
        for c in range(size):
            whole[c] = new[c]
        for a in range(DEGREE + 1):
            for c in range(size):
                coefficients[a, c] = C[a, c]
        # The last step before a bound is cut short; it says nothing about the next one.
        now[PROPOSED] = max(length, now[LENGTH]) if stop == limits[BOUND] else length
        count, first, fits = 0, NEVER, True
        for w in range(enter.shape[0] + levels.shape[0]):
            if w < enter.shape[0]:
                slack = graze[w] + ROUNDING * extent
                some = find_crossings(B, far, near[w], active[w], enter[w], leave[w], directed[w], slack, V, hits)
            else:
                ball = w - enter.shape[0]
                slack = ball_slack(extent) * max(levels[ball], 1.0)
                some = find_ball_crossings(
                    B, centres[ball], radii[ball], inside_ball[ball], watched_ball[ball], levels[ball], slack, hits
                )
            fits = fits and count + some <= crossed.shape[0]
            if fits:
                for k in range(some):
                    crossed[count, 0], crossed[count, 1] = w, hits[k, 0]
                    crossed[count, 2], crossed[count, 3] = hits[k, 1], hits[k, 2]
                    first = min(first, hits[k, 0])
                    count += 1
        if not fits:
            return taken, left, shown, REFUSED, 0
        if count > 0:
            # It ends at the first crossing, with all of the same instant.
            some, count = count, 0
            for k in range(some):
                if crossed[k, 1] <= first + TIE:
                    for c in range(4):
                        crossed[count, c] = crossed[k, c]
                    w = int(crossed[count, 0])
                    if w < enter.shape[0] and barred[w]:
                        fits = fits and not near[w, int(crossed[count, 2]), int(crossed[count, 3])]
                    count += 1
            if not fits:
                return taken, left, shown, REFUSED, 0
            stop = t + first * (stop - t)
            fill_part(coefficients, first, C)
            split_motion(C, B, V, far)
            for c in range(size):
                new[c] = C[DEGREE, c]
            h = stop - t
        # It may not jump over a feature or a barrier of a potential, nor lose its digits.
        sound = True
        if zones.shape[0] > 0:
            sound = not allowed_share(B, far, senders, sensed, offsets, zones, owners) < 1.0
        state_energies(
            energies, order, stop + base, new, n, m, senders, sensed, offsets, pieces, spans, P, A, W, S, found
        )
        energy, kinetic = found[0] + found[1] + found[2] + limits[UNLINKED], found[2]
        dissipated, supplied = new[tail + 1] - y[tail + 1], new[tail + 2] - y[tail + 2]
        missed = relative_gap(energy, kinetic, now[ENERGY], now[KINETIC], dissipated, supplied)
        sound = sound and missed <= LEDGER_GAP * limits[TOLERANCE]
        if sound and singular:
            sound = deepest_dip(B, far, linked_senders, linked_sensed) > 1.0
        largest = 0.0
        for c in range(n * m):
            largest = max(largest, abs(new[c]))
        sound = sound and EPSILON * largest <= COARSEST * limits[TOLERANCE]
        sound = sound and 4.0 * EPSILON * largest <= limits[FINEST]
        if timed:
            sound = sound and EPSILON * abs(stop + base) <= COARSEST * limits[TOLERANCE]
        if not sound:
            return taken, left, shown, REFUSED, 0
        # The companion takes two half steps.
        for c in range(size):
            other[c] = y[c] + difference[LAST, c]
        stages(
            control, order, 0, STAGES + 1, STAGES, t + base, other, 0.5 * h, companion, nodes, weights, n, m, senders,
            sensed, offsets, pieces, spans, P, A, W, S, middle,
        )  # fmt: skip
        for c in range(size):
            companion[0, c] = companion[STAGES, c]
        stages(
            control, order, 1, nodes.shape[0], STAGES, t + 0.5 * h + base, middle, 0.5 * h, companion, nodes, weights,
            n, m, senders, sensed, offsets, pieces, spans, P, A, W, S, end,
        )  # fmt: skip
        compare(C, difference[LAST], middle, end, companion, 0.5 * h, dense, inside, second, e)
        known, position, velocity, pairs, q_floor, p_floor, spread = summary(e, C, n, m, order)
        if not known or position > LOST * min(spread, limits[REACH]) > 0.0:
            return taken, left, shown, REFUSED, 0
        # The step is taken.
        for c in range(size):
            other[c] = new[c] + e[LAST, c]
            y[c], slope[c] = new[c], fresh[c]
        for a in range(DEGREE + 1):
            for c in range(size):
                coefficients[a, c] = C[a, c]
        for a in range(NODES):
            for c in range(size):
                difference[a, c] = e[a, c]
        now[BEGIN], now[TIME], now[LENGTH] = t, stop, now[PROPOSED]
        now[ENERGY], now[KINETIC] = energy, kinetic
        now[RATE] *= SLOWER
        state_energies(
            energies, order, stop + base, other, n, m, senders, sensed, offsets, pieces, spans, P, A, W, S, found
        )
        gap = found[0] + found[1] + found[2] + limits[UNLINKED] - energy
        gap = gap + e[LAST, tail + 1] - e[LAST, tail + 2]
        unexplained = abs(gap - now[GAP])
        unexplained = unexplained if np.isfinite(unexplained) else np.inf
        now[GAP] = gap
        errors[0], errors[1], errors[2], errors[3], errors[4] = 1.0, position, velocity, pairs, q_floor
        errors[5], errors[6], errors[7] = p_floor, spread, unexplained
        steps[taken, STEP_END], steps[taken, STEP_ENERGY], steps[taken, STEP_KINETIC] = stop, energy, kinetic
        steps[taken, STEP_LENGTH] = stop - t
        taken += 1
        last = taken == steps.shape[0] or not recording
        if last or count > 0 or stop >= limits[END] or stop == limits[BOUND]:
            return taken, left, shown, OPEN, count
        # It is put on record, unless a pair came within the error of a distance, or there is no room for its frames.
        for k in range(NODES):
            for i in range(n):
                for c in range(m):
                    off[k, i, c] = SAFETY * e[k, i * m + c]
        count = 0
        for w in range(enter.shape[0]):
            if not smooth[w]:
                floor = 2.0 * q_floor + (graze[w] + ROUNDING * (q_floor / ROUNDING))
                count += find_within_error(
                    B, far, near[w], active[w], enter[w], leave[w], directed[w], off, pairs + floor, floor, none
                )
        due = shown
        while due < frame_times.shape[0] and frame_times[due] <= stop:
            due += 1
        if count > 0 or due > frames.shape[0]:
            return taken, left, shown, OPEN, 0
        follow_extremes(
            B, V, far, linked, shares, goal, has_goal, moving, t, stop, base, False, pairs,
            velocity + limits[VELOCITY_ROUNDING], extremes,
        )  # fmt: skip
        add_unexplained(extremes, unexplained, stop + base)
        for f in range(shown, due):
            if frame_times[f] == stop:
                for c in range(size):
                    frames[f, c] = new[c]
            else:
                fill_part(C, (frame_times[f] - t) / (stop - t), part)
                for c in range(size):
                    frames[f, c] = part[DEGREE, c]
            frame_errors[f, 0], frame_errors[f, 1] = position, velocity
        shown = due
        for c in range(size):
            states[left, c] = new[c]
        left += 1
