"""Motion under a force that follows a held one with a lag, for one step, in closed form, for groups of any size.

With a force f that tends to g as tau f' = g - f beside a constant force b, and c = f - g at the beginning,

    q' = q + drift p + lift (g + b) + place c
    p' = keep p + push (g + b) + speed c
    f' = g + decay c

where drift, lift, keep and push are those of a constant force.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Numbers32, Reals
from flocking.engine.fixed_step.step_counts import LARGEST_SQUARE
from flocking.engine.tiles.held.held_motion import coefficients
from flocking.engine.tiles.held.limited_rates import (
    DECAY,
    DRIFT,
    KEEP,
    LIFT,
    NUMBERS,
    PLACE,
    PUSH,
    RAMP,
    SPEED,
    fill_flow,
    steady_time,
)
from flocking.formula.native.functions import native
from flocking.model.bodies.body import Body

CHORD = 0.125
"""Share of h^2 and the largest second derivative by which a function leaves the chord between its ends at most."""

TERMS = 18
"""Terms of the series of an exponential whose argument is at most 1/2: the next one is 2**-19/19! = 2e-23."""


def exponentials(matrices: Array) -> Array:
    """Exponentials of small square matrices, shape (n, k, k): a series after halvings, then squarings.

    Parameters
    ----------
    matrices
        Shape (n, k, k).
    """
    size = float(np.abs(matrices).sum(axis=2).max(initial=0.0))
    halvings = max(0, math.ceil(math.log2(2.0 * size))) if size > 0 else 0
    small = matrices / 2.0**halvings
    found = np.broadcast_to(np.eye(matrices.shape[1]), matrices.shape).copy()
    for k in range(TERMS, 0, -1):
        found = np.eye(matrices.shape[1]) + small @ found / k
    for _ in range(halvings):
        found = found @ found
    return found


def lag_coefficients(point: Body, time_constant: float | Array, n: int, h: float) -> Array:
    """Drift, lift, keep, push, place, speed and decay for a step ``h``, then what bounds speeds within it.

    These are the rate of the damping, 1/tau, 1/mass and the step. Shape (11,) where all agents are alike, else (n, 11).

    Parameters
    ----------
    point
        The point that moves under the force.
    time_constant
        Time constant tau, one or one for each agent.
    n
        Number of agents.
    """
    constant = coefficients(point, n, h)
    masses = np.asarray(point.masses, dtype=np.float64) if point.order == 2 else np.float64(1.0)
    rates = np.asarray(point.damping, dtype=np.float64) / masses if point.order == 2 else np.float64(0.0)
    taus = np.asarray(time_constant, dtype=np.float64)
    alike = constant.ndim == 1 and not taus.ndim
    count = 1 if alike else n
    tau, mass, rate = (np.broadcast_to(x, count) for x in (taus, masses, rates))
    decay = np.exp(-h / tau)
    if point.order == 1:
        place, speed = -tau * np.expm1(-h / tau), decay
    else:
        matrices = np.zeros((count, 3, 3))
        matrices[:, 0, 1], matrices[:, 1, 1], matrices[:, 1, 2] = h, -rate * h, h / mass
        matrices[:, 2, 2] = -h / tau
        # Agents of a group that are alike share one exponential.
        kinds, which = np.unique(matrices.reshape(count, 9), axis=0, return_inverse=True)
        last = exponentials(kinds.reshape(-1, 3, 3))[:, :, 2][which.reshape(-1)]
        place, speed = last[:, 0], last[:, 1]
    rows = [*np.broadcast_to(constant, (count, 4)).T, place, speed, decay, rate, 1.0 / tau, 1.0 / mass]
    found = np.stack([np.broadcast_to(row, count) for row in (*rows, np.float64(h))], axis=1)
    return np.asarray(found[0] if alike else found)


class LagConstants:
    """What `lag_coefficients` gives, in sorted order.

    Parameters
    ----------
    point, time_constant, n
        As for `lag_coefficients`.
    dtype
        Precision of the state.
    """

    def __init__(
        self, point: Body, time_constant: float | Array, n: int, dtype: type[np.float32] | type[np.float64]
    ) -> None:
        self.time_constant = time_constant
        self._point, self._n, self._dtype = point, n, dtype
        self._sorted: dict[float, Reals] = {}
        self._coefficients: dict[float, Array] = {}

    def reorder(self) -> None:
        """Drop what belongs to the order before."""
        self._sorted.clear()

    def over(self, h: float, ids: Numbers32) -> Reals:
        """Coefficients for a step of length ``h``, shape (1, 11) or (size, 11).

        Parameters
        ----------
        ids
            Number of the agent at each place, shape (size,).
        """
        if h not in self._coefficients:
            if len(self._coefficients) > 1:
                # That of the steps, and that of the last frame between two steps.
                other = list(self._coefficients)[-1]
                del self._coefficients[other]
                self._sorted.pop(other, None)
            self._coefficients[h] = lag_coefficients(self._point, self.time_constant, self._n, h)
        if h not in self._sorted:
            rows = self._coefficients[h]
            self._sorted[h] = np.ascontiguousarray((rows[ids] if rows.ndim > 1 else rows[None]).astype(self._dtype))
        return self._sorted[h]


class LaggedForces(NamedTuple):
    """Forces on agents sorted by tiles, shape (m, size) each.

    Parameters
    ----------
    tended
        What the lagged forces tend to.
    beside
        What acts beside them.
    before, after
        The lagged forces before and after a step; they may be one array.
    largest_rates
        Largest rates of the lagged forces, shape (1,) or (size,); no entries where there are none.
    """

    tended: Reals
    beside: Reals
    before: Reals
    after: Reals
    largest_rates: Array


@native
def coast_lagged(first, last, agents, target, forces, constants, frame, n, second, fastest):  # type: ignore[no-untyped-def]
    """Move the agents of some tiles by one step.

    Parameters
    ----------
    first, last, agents, target, frame, n
        As for `flocking.engine.tiles.held.held_motion.coast`.
    forces
        A `LaggedForces`, of which ``after`` is filled.
    constants
        See `lag_coefficients`, shape (1, 11) or (size, 11).
    second
        Whether agents are of order 2.
    fastest
        Takes the square of a bound on the speed in that frame at any time of the step, by tile; infinite where one is
        not finite.
    """
    m = forces.tended.shape[0]
    steady_flow, free_flow = np.empty(NUMBERS), np.empty(NUMBERS)
    for tile in range(first, last):
        fastest_of, swift_of, push_of, rate_of = np.float64(0.0), np.float64(0.0), np.float64(0.0), np.float64(0.0)
        h = np.float64(constants[0, 10])
        for i in range(tile * 16, tile * 16 + 16):
            row = i if constants.shape[0] > 1 else 0
            rate, each, light = constants[row, 7], constants[row, 8], constants[row, 9]
            before, after, swift, push = np.float64(0.0), np.float64(0.0), np.float64(0.0), np.float64(0.0)
            steady, slope, share = np.float64(0.0), np.float64(0.0), np.float64(1.0)
            if forces.largest_rates.shape[0] > 0:
                most, far = forces.largest_rates[i if forces.largest_rates.shape[0] > 1 else 0], np.float64(0.0)
                for k in range(m):
                    c = np.float64(forces.before[k, i]) - np.float64(forces.tended[k, i])
                    far += c * c
                far = np.sqrt(far)
                steady = np.float64(min(steady_time(far, most, np.float64(each)), h))
                if steady > 0.0:
                    slope = -most / far
                    share = min(-slope / np.float64(each), share)
                    fill_flow(steady, np.float64(rate), np.float64(each), np.float64(light), second, steady_flow)
                    fill_flow(h - steady, np.float64(rate), np.float64(each), np.float64(light), second, free_flow)
            for k in range(m):
                p, g, b, f = agents[i, m + k], forces.tended[k, i], forces.beside[k, i], forces.before[k, i]
                off = f - g
                begin = p if second else f + b
                if steady > 0.0:
                    # At its largest rate, then free.
                    change, force = slope * (np.float64(f) - np.float64(g)), np.float64(f) + np.float64(b)
                    q1 = np.float64(agents[i, k]) + steady_flow[DRIFT] * np.float64(p) + steady_flow[LIFT] * force
                    q1 += steady_flow[RAMP] * change
                    p1 = steady_flow[KEEP] * np.float64(p) + steady_flow[PUSH] * force + steady_flow[LIFT] * change
                    left, goal = np.float64(f) + steady * change - np.float64(g), np.float64(g) + np.float64(b)
                    speed = free_flow[KEEP] * p1 + free_flow[PUSH] * goal + free_flow[SPEED] * left
                    target[i, k] = q1 + free_flow[DRIFT] * p1 + free_flow[LIFT] * goal + free_flow[PLACE] * left
                    forces.after[k, i] = np.float64(g) + free_flow[DECAY] * left
                else:
                    place = agents[i, k] + constants[row, 0] * p + constants[row, 1] * (g + b)
                    target[i, k] = place + constants[row, 4] * off
                    speed = constants[row, 2] * p + constants[row, 3] * (g + b) + constants[row, 5] * off
                    forces.after[k, i] = g + constants[row, 6] * off
                target[i, m + k] = speed
                c = np.float64(begin) - np.float64(frame[k])
                before += c * c
                c = np.float64(speed) - np.float64(frame[k])
                after += c * c
                c = np.float64(off) * share * each * light
                swift += c * c
                c = (np.float64(f) + b) * light - np.float64(rate) * p
                push += c * c
            if i < n:
                # A comparison with a NaN is false: such a speed counts as infinite.
                square = max(before, after)
                fastest_of = max(fastest_of, square) if before + after < LARGEST_SQUARE else np.float64(np.inf)
                swift_of, push_of, rate_of = max(swift_of, swift), max(push_of, push), max(rate_of, np.float64(rate))
        if second:
            # A function leaves the chord between its ends by at most h^2/8 times its largest second derivative.
            swift = np.sqrt(swift_of)
            speed = np.sqrt(fastest_of) + CHORD * h * h * (swift + rate_of * (np.sqrt(push_of) + h * swift))
            fastest_of = speed * speed
        fastest[tile] = fastest_of
