"""Equilibria of pair potentials: found by descent, proven to exist nearby, with their second derivatives enclosed.

With the energies E(r) of linked pairs the force on i is the sum of E'(r) n_ij, and the second derivative has the blocks
K = E'' n n^T + (E'/r)(1 - n n^T) of every link. A computed place q of small force has an exact equilibrium nearby if a
ball of radius eta is mapped into itself by y - C G(y), where G(y) = V^T grad E(q + V y), V spans what is orthogonal to
translations and rotations at q, and C is about the inverse of V^T H V: |C G(0)| + k eta <= eta for a bound k < 1 of
|1 - C V^T H V| over the ball (Krawczyk 1969). There grad E is orthogonal to V and, since E does not change when the
group is moved or turned, to translations and rotations too: it vanishes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array, Links
from flocking.formula.derivatives import derivative
from flocking.formula.interval_values import enclosed
from flocking.formula.intervals import Interval
from flocking.study.certificates.enclosed_matrices import INFLATION, UNIT, EnclosedMatrix, exact, norm_bound
from flocking.study.nets.rigidity import rigid_motions

if TYPE_CHECKING:
    import sympy

STEPS = 400
"""Steps of the descent, of which some 30 to 100 are needed where it ends at an equilibrium."""

FIRST_STEP, LONGEST = 0.1, 0.1
"""Length in time of its first step, in the unit of the stiffest direction, and the largest move of a step as a share of
the smallest distance."""

BALANCED = 1e-11
"""Largest force, relative to the stiffness times the diameter, that counts as none."""

SOFTEST = 1e-9
"""Stiffness, relative to the largest, below which a direction counts as a rigid motion where places are improved."""

RADII = (1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6)
"""Radii, relative to the diameter, of balls in which the exact equilibrium is sought."""


@dataclass(frozen=True, eq=False)
class PairForce:
    """The force of a linked pair, E'(r), as a formula, and the pairs that are linked.

    Parameters
    ----------
    symbol
        The distance r.
    slope
        E'(r); all its numbers are known.
    fixed
        Link matrix of a graph whose links are fixed; None where links follow from distances.
    appear, end
        Distances below which pairs get a link and up to which they keep it.
    """

    symbol: sympy.Symbol
    slope: sympy.Expr
    fixed: Links | None
    appear: float
    end: float

    @cached_property
    def curvature(self) -> sympy.Expr:
        """E''(r)."""
        return derivative(self.slope, self.symbol)

    def links(self, q: Array, before: Links) -> Links:
        """Links at some places, of agents that had others before."""
        if self.fixed is not None:
            return self.fixed
        r = np.linalg.norm(q[:, None] - q, axis=2)
        found = (r < self.appear) | (before & (r < self.end))
        np.fill_diagonal(found, False)
        return np.asarray(found)

    def values(self, r: Array) -> tuple[Array, Array]:
        """E' and E'' at distances."""
        found = [enclosed(x, self.symbol, Interval.of(r)) for x in (self.slope, self.curvature)]
        first, second = (np.asarray(0.5 * (x.lo + x.hi)) for x in found)
        return first, second


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """An exact equilibrium of a group, known to within a radius.

    Parameters
    ----------
    q
        Computed places, shape (N, m).
    radius
        No agent's exact place is farther away.
    links
        Links there, shape (N, N).
    force
        The force of a pair.
    """

    q: Array
    radius: float
    links: Links
    force: PairForce

    @property
    def distances(self) -> Array:
        """Distances of all pairs, shape (N (N - 1)/2,)."""
        i, j = np.triu_indices(len(self.q), 1)
        return np.asarray(np.linalg.norm(self.q[i] - self.q[j], axis=1))

    @cached_property
    def stiffness(self) -> EnclosedMatrix:
        """The second derivative of the energy, shape (N m, N m)."""
        return hessian(self.q, self.links, self.force, self.radius)

    @property
    def rigid_motions(self) -> int:
        """Number of independent translations and rotations."""
        return int(rigid_motions(self.q).shape[1])

    @cached_property
    def link_stresses(self) -> tuple[Interval, Interval]:
        """E' and E'' of all links at the exact equilibrium."""
        i, j = np.nonzero(np.triu(self.links))
        r = np.linalg.norm(self.q[i] - self.q[j], axis=1)
        wide = 2.0 * self.radius + 8.0 * UNIT * np.abs(self.q).max()
        places = Interval.of(np.maximum(r - wide, np.finfo(np.float64).tiny), r + wide)
        return tuple(enclosed(x, self.force.symbol, places) for x in (self.force.slope, self.force.curvature))  # type: ignore[return-value]


def orthogonal_to(columns: Array) -> Array:
    """Orthonormal columns that are orthogonal to some independent ones."""
    basis = np.linalg.qr(np.hstack([columns, np.eye(len(columns))]))[0]
    return np.asarray(basis[:, columns.shape[1] : len(columns)])


def hessian(q: Array, links: Links, force: PairForce, radius: float) -> EnclosedMatrix:
    """Second derivative of the energy at all places within a radius of some, as one enclosed matrix.

    Parameters
    ----------
    q, links, force, radius
        As in `Equilibrium`.
    """
    n, m = q.shape
    i, j = np.nonzero(links)
    d = q[j] - q[i]
    r = np.linalg.norm(d, axis=1)
    wide = 2.0 * radius + 16.0 * UNIT * np.abs(q).max()
    low, high = np.maximum(r - wide, np.finfo(np.float64).tiny), r + wide
    places = Interval.of(low, high)
    along = enclosed(force.curvature, force.symbol, places)
    across = enclosed(force.slope, force.symbol, places) / places
    direction = d / r[:, None]
    outer = direction[:, :, None] * direction[:, None, :]
    middle_along, middle_across = (0.5 * (x.lo + x.hi) for x in (along, across))
    blocks = middle_along[:, None, None] * outer + middle_across[:, None, None] * (np.eye(m) - outer)
    # Directions differ by at most twice the move over the distance, their products by twice that and its square.
    turned = 2.0 * wide / low
    size = np.maximum(np.abs(along.lo), np.abs(along.hi)) + np.maximum(np.abs(across.lo), np.abs(across.hi))
    error = (
        0.5 * (along.hi - along.lo) + 0.5 * (across.hi - across.lo) + size * (2.0 * turned + turned**2 + 16.0 * UNIT)
    )
    error = np.where(np.isfinite(error), INFLATION * error, np.inf)
    values, errors = np.zeros((n, n, m, m)), np.zeros((n, n))
    values[i, j] = -blocks
    errors[i, j] = error
    np.add.at(values, (i, i), blocks)
    np.add.at(errors, (i, i), error * (1.0 + n * UNIT) + n * UNIT * size)
    return EnclosedMatrix(
        values.transpose(0, 2, 1, 3).reshape(n * m, n * m), np.repeat(np.repeat(errors, m, axis=0), m, axis=1)
    )


def slope_of_energy(q: Array, links: Links, force: PairForce) -> tuple[Array, Array]:
    """The slope of the energy at some places and bounds of its rounding errors, shape (N, m) each.

    Parameters
    ----------
    q, links, force
        As in `Equilibrium`.
    """
    i, j = np.nonzero(links)
    d = q[j] - q[i]
    r = np.linalg.norm(d, axis=1)
    wide = 16.0 * UNIT * np.abs(q).max()
    found = enclosed(force.slope, force.symbol, Interval.of(r - wide, r + wide))
    middle = 0.5 * (found.lo + found.hi)
    error = 0.5 * (found.hi - found.lo) + np.abs(middle) * (2.0 * wide / r + 16.0 * UNIT)
    total, errors = np.zeros_like(q), np.zeros_like(q)
    np.add.at(total, i, -middle[:, None] * d / r[:, None])
    np.add.at(errors, i, INFLATION * (error + len(q) * UNIT * np.abs(middle))[:, None])
    return total, errors


def descended(q: Array, links: Links, force: PairForce) -> tuple[Array, Links] | None:
    """Places of no force to which descent from some places leads; None where none was reached.

    Steps of the implicit method of Euler for q' = -grad E, longer as the force falls (Kelley, Keyes 1998).

    Parameters
    ----------
    q, links
        Places and links to begin with.
    force
        The force of a pair.
    """
    n, m = q.shape
    links, step, before = force.links(q, links), 0.0, 0.0
    for _ in range(STEPS):
        i, j = np.nonzero(links)
        if not len(i):
            return None
        r = np.linalg.norm(q[j] - q[i], axis=1)
        if not r.min() > 0.0:
            return None
        first, second = force.values(r)
        if not (np.isfinite(first).all() and np.isfinite(second).all()):
            return None
        slope, matrix = _computed(q, links, first, second)
        size, stiff = float(np.linalg.norm(slope)), float(np.abs(matrix).sum(axis=1).max())
        if not stiff > 0.0:
            return None
        if size <= BALANCED * stiff * float(np.ptp(q, axis=0).max() + r.min()):
            return _polished(q, links, force, slope, matrix), links
        step = FIRST_STEP / stiff if not step else step * min(max(before / size, 0.5), 4.0)
        before = size
        try:
            move = -np.linalg.solve(np.eye(n * m) / step + matrix, slope.ravel()).reshape(n, m)
        except np.linalg.LinAlgError:
            return None
        longest = float(np.abs(move).max())
        q = q + move * min(1.0, LONGEST * float(r.min()) / longest if longest else 1.0)
        links = force.links(q, links)
    return None


def _polished(q: Array, links: Links, force: PairForce, slope: Array, matrix: Array) -> Array:
    """Places of even less force, by one step of Newton's method across rigid motions; the same where it does not help.

    Forces that count as none may displace a soft group by more than its links may be stressed.
    """
    try:
        move = np.linalg.lstsq(matrix, -slope.ravel(), rcond=SOFTEST)[0]
    except np.linalg.LinAlgError:
        return q
    moved = q + move.reshape(q.shape)
    if not np.array_equal(force.links(moved, links), links):
        return q
    i, j = np.nonzero(links)
    after, _ = _computed(moved, links, *force.values(np.linalg.norm(moved[j] - moved[i], axis=1)))
    return moved if np.linalg.norm(after) < np.linalg.norm(slope) else q


def _computed(q: Array, links: Links, first: Array, second: Array) -> tuple[Array, Array]:
    """Slope and second derivative of the energy, of pairs in the order of `numpy.nonzero`."""
    n, m = q.shape
    i, j = np.nonzero(links)
    d = q[j] - q[i]
    r = np.linalg.norm(d, axis=1)
    unit = d / r[:, None]
    outer = unit[:, :, None] * unit[:, None, :]
    blocks = second[:, None, None] * outer + (first / r)[:, None, None] * (np.eye(m) - outer)
    found = np.zeros((n, n, m, m))
    found[i, j] = -blocks
    np.add.at(found, (i, i), blocks)
    slope = np.zeros_like(q)
    np.add.at(slope, i, -first[:, None] * unit)
    return slope, found.transpose(0, 2, 1, 3).reshape(n * m, n * m)


def proven(q: Array, links: Links, force: PairForce) -> Equilibrium | str:
    """The exact equilibrium near a computed one, or why none was proven.

    Parameters
    ----------
    q, links, force
        As found by `descended`.
    """
    rigid = rigid_motions(q)
    v = exact(orthogonal_to(rigid))
    diameter = float(np.linalg.norm(np.ptp(q, axis=0)))
    if _pieces_meet(q, links, force, 2.0 * RADII[-1] * diameter):
        return "pieces of a formula meet at a distance of two agents"
    start = hessian(q, links, force, 0.0)
    inner = v.transposed @ start @ v
    if not np.isfinite(inner.error).all():
        return "second derivatives of the energy are not bounded there"
    try:
        inverse = exact(np.asarray(np.linalg.inv(inner.values), dtype=np.float64))
    except np.linalg.LinAlgError:
        return "it has more directions without force than translations and rotations"
    slope, errors = slope_of_energy(q, links, force)
    column = EnclosedMatrix(slope.reshape(-1, 1), errors.reshape(-1, 1))
    moved = inverse @ (v.transposed @ column)
    first = float(np.linalg.norm(np.abs(moved.values) + moved.error)) * INFLATION
    unit = exact(np.eye(inner.values.shape[0]))
    for share in RADII:
        eta = share * diameter
        if first >= eta or not _links_stay(q, links, force, eta):
            continue
        rest = unit - inverse @ (v.transposed @ hessian(q, links, force, eta * INFLATION) @ v)
        k = norm_bound(np.abs(rest.values) + rest.error)
        if k < 1.0 and first + k * eta <= eta:
            return Equilibrium(q, first / (1.0 - k) * INFLATION, links, force)
    if not _links_stay(q, links, force, RADII[0] * diameter):
        return "a pair is too near the distance at which links appear or break"
    return "no exact one was proven near the computed one: it has directions with hardly any force"


def _pieces_meet(q: Array, links: Links, force: PairForce, wide: float) -> bool:
    """Whether a formula of pieces may change from one to the next near a distance of linked agents."""
    import sympy

    i, j = np.nonzero(np.triu(links))
    r = np.linalg.norm(q[i] - q[j], axis=1)
    places = Interval.of(np.maximum(r - wide, np.finfo(np.float64).tiny), r + wide)
    for each in force.slope.atoms(sympy.Piecewise):
        number = sympy.Piecewise(*((sympy.Integer(k), condition) for k, (_, condition) in enumerate(each.args)))
        found = enclosed(number, force.symbol, places)
        if (found.lo != found.hi).any():
            return True
    return False


def _links_stay(q: Array, links: Links, force: PairForce, eta: float) -> bool:
    """Whether no link appears or breaks when agents move by no more than eta."""
    if force.fixed is not None:
        return True
    r = np.linalg.norm(q[:, None] - q, axis=2)
    np.fill_diagonal(r, np.inf)
    wide = 2.0 * eta + 16.0 * UNIT * np.abs(q).max()
    return bool((r[links] < force.end - wide).all() and (r[~links] > force.appear + wide).all())
