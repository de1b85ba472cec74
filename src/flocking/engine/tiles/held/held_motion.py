"""Motion under a constant force for one step, in closed form, for groups of any size.

``q' = q + drift p + lift u`` and ``p' = keep p + push u``. Without damping drift = h, lift = h^2/(2 m), keep = 1 and
push = h/m; with damping k they are the integrals of exp(-k t/m); of agents of order 1 the velocity is the control.
"""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Numbers32, Reals
from flocking.engine.fixed_step.step_counts import LARGEST_SQUARE
from flocking.engine.tiles.neighbours.neighbour_lists import WIDTH
from flocking.engine.tiles.simd.reductions import total
from flocking.engine.tiles.simd.row_transposition import column
from flocking.engine.tiles.simd.vectors import double_of, load, numbers_from, select, spread
from flocking.formula.native.functions import native
from flocking.model.bodies.body import Body

SERIES_BELOW = 1e-2
"""Share of its time constant below which a damped step is summed as a series: its fifth term is below rounding."""


def _decays(z: Array) -> tuple[Array, Array]:
    """``(1 - exp(-z))/z`` and ``(exp(-z) - 1 + z)/z**2``."""
    small = np.abs(z) < SERIES_BELOW
    safe = np.where(small, 1.0, z)
    terms = [np.ones_like(z)]
    for k in range(2, 9):
        terms.append(-terms[-1] * z / k)
    first = np.where(small, sum(terms), -np.expm1(-safe) / safe)
    twos = [0.5 * np.ones_like(z)]
    for k in range(3, 10):
        twos.append(-twos[-1] * z / k)
    second = np.where(small, sum(twos), (np.expm1(-safe) + safe) / safe**2)
    return first, second


def coefficients(body: Body, n: int, h: float) -> Array:
    """Drift, lift, keep and push for a step ``h``, shape (4,) where all agents are alike, else (n, 4).

    Parameters
    ----------
    body
        The agents.
    n
        Their number.
    """
    if body.order == 1:
        return np.array([0.0, h, 0.0, 1.0])
    masses = np.asarray(body.masses, dtype=np.float64)
    rates = np.asarray(body.damping, dtype=np.float64) / masses
    first, second = _decays(np.asarray(rates * h))
    rows = [h * first, h * h * second / masses, np.exp(-rates * h), h * first / masses]
    alike = all(row.ndim == 0 for row in map(np.asarray, rows))
    return np.array(rows) if alike else np.stack([np.broadcast_to(row, n) for row in rows], axis=1)


@native
def coast(first, last, agents, target, force, constants, frame, n, fastest, powers):  # type: ignore[no-untyped-def]
    """Move the agents of some tiles by one step.

    Parameters
    ----------
    first, last
        Range of tiles, without the last.
    agents, target
        Positions and velocities before and after, shape (size, 2m); they may be one array.
    force
        What acts on each agent, shape (m, size).
    constants
        See `coefficients`, shape (1, 4) or (size, 4).
    frame
        Velocity of the frame of the lists, shape (m,).
    n
        Number of agents.
    fastest
        Takes the largest squared speed in that frame at the end of the step, by tile; infinite where one is not finite.
    powers
        Takes the powers of the forces at the beginning and at the end of the step, shape (tiles, 2); no rows for none.
    """
    # With a known number of axes their loops are written out.
    if force.shape[0] == 2:
        _coast(2, first, last, agents, target, force, constants, frame, n, fastest, powers)  # type: ignore[no-untyped-call]
    else:
        _coast(3, first, last, agents, target, force, constants, frame, n, fastest, powers)  # type: ignore[no-untyped-call]


def _coast(m, first, last, agents, target, force, constants, frame, n, fastest, powers):  # type: ignore[no-untyped-def]
    each = constants.shape[0] > 1
    drift, lift, keep, push = constants[0, 0], constants[0, 1], constants[0, 2], constants[0, 3]
    for tile in range(first, last):
        most, before, after = np.float64(0.0), np.float64(0.0), np.float64(0.0)
        for i in range(tile * 16, tile * 16 + 16):
            if each:
                drift, lift, keep, push = constants[i, 0], constants[i, 1], constants[i, 2], constants[i, 3]
            square = np.float64(0.0)
            for k in range(m):
                p, u = agents[i, m + k], force[k, i]
                target[i, k] = agents[i, k] + drift * p + lift * u
                speed = keep * p + push * u
                target[i, m + k] = speed
                c = np.float64(speed) - np.float64(frame[k])
                square += c * c
                if i < n:
                    before += np.float64(u) * np.float64(p)
                    after += np.float64(u) * np.float64(speed)
            if i < n:
                most = max(most, square) if square < LARGEST_SQUARE else np.float64(np.inf)
        fastest[tile] = most
        if powers.shape[0] > 0:
            powers[tile, 0], powers[tile, 1] = before, after


@native
def force_sums(first, last, agents, force, rates, masses, damping, frame, n, moves, lawful, found):  # type: ignore[no-untyped-def]
    """By tile, what the powers of forces follow from in any frame: powers in one frame, and sums of forces and momenta.

    Parameters
    ----------
    first, last, agents, force, n
        As for `coast`.
    rates
        In the second half of each row the rate of change of the velocity under the law, shape (size, 2m).
    masses, damping
        Shape (1,) or (size,).
    frame
        Velocity of the frame, shape (m,).
    moves, lawful
        Whether to sum forces and momenta, and the desired forces of the law.
    found
        Takes, shape (tiles, 2 + 3m): the powers of the forces that act and of the desired ones; then the sums of the
        former, of the momenta in the frame, and of the desired forces.
    """
    m = force.shape[0]
    for tile in range(first, last):
        base = tile * 16
        live = numbers_from(base) < np.uint32(n)
        mass = load(masses, base) if masses.shape[0] > 1 else spread(masses[0])
        drag = load(damping, base) if damping.shape[0] > 1 else spread(damping[0])
        work, desired = spread(0.0), spread(0.0)
        for k in range(m):
            p, u = double_of(column(agents, base, m + k)) - frame[k], double_of(load(force[k], base))
            work = work + u * p
            if moves:
                found[tile, 2 + k] = total(select(live, u, 0.0))
                found[tile, 2 + m + k] = total(select(live, mass * p, 0.0))
            if lawful:
                u = mass * double_of(column(rates, base, m + k)) + drag * (p + frame[k])
                desired = desired + u * p
                found[tile, 2 + 2 * m + k] = total(select(live, u, 0.0))
        found[tile, 0], found[tile, 1] = total(select(live, work, 0.0)), total(select(live, desired, 0.0))


class HeldMotion:
    """Coefficients of the motion of agents in sorted order, for steps of several lengths.

    Parameters
    ----------
    body
        The agents.
    n
        Their number.
    dtype
        Precision of the state.
    """

    def __init__(self, body: Body, n: int, dtype: type[np.float32] | type[np.float64]) -> None:
        self.body, self.n, self.dtype = body, n, dtype
        self._found: dict[float, Reals] = {}

    def reorder(self) -> None:
        """Drop what belongs to the order before."""
        self._found.clear()

    def over(self, h: float, ids: Numbers32) -> Reals:
        """Coefficients for a step of length ``h``, shape (1, 4) or (size, 4).

        Parameters
        ----------
        ids
            Number of the agent at each place, shape (size,).
        """
        if h not in self._found:
            rows = coefficients(self.body, self.n, h)
            self._found[h] = np.ascontiguousarray((rows[ids] if rows.ndim > 1 else rows[None]).astype(self.dtype))
        return self._found[h]

    def by_place(self, value: float | Array, ids: Numbers32) -> Array:
        """A number of each agent, or of all, in sorted order, shape (size,) or (1,).

        Parameters
        ----------
        ids
            As for `over`.
        """
        found = np.asarray(value, dtype=np.float64)
        return np.ascontiguousarray(found[ids]) if found.ndim else found[None]


assert WIDTH == 16, "these functions go through the agents of a tile"
