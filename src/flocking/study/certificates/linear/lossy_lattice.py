"""Lost messages near an equilibrium without stress, of agents of order 2 that act together and hold their force.

Where no link presses or pulls, the force on i of a neighbour j is -K (x_i - x_j) - w (v_i - v_j) with the stiffness
K = E'' n n^T of the link and the weight w of velocity consensus, and it is left out with the message. Rigid motions of
the places exert no force of any link, and neither do velocities that are the same for all: deformations y = V^T x and
relative velocities U^T v, with orthonormal V and U, form a linear recursion with independent random parts.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array
from flocking.formula.interval_values import enclosed
from flocking.formula.intervals import Interval
from flocking.study.certificates.certificate import Hypothesis
from flocking.study.certificates.consensus_certificates import LinearConsensus
from flocking.study.certificates.enclosed_matrices import (
    INFLATION,
    UNIT,
    exact,
    norm_bound,
    rounding,
    spectral_radius,
    unit_of_rates,
)
from flocking.study.certificates.linear.equilibria import Equilibrium, orthogonal_to
from flocking.study.certificates.linear.near_equilibrium import NearEquilibrium
from flocking.study.certificates.random_recursion import RandomRecursion
from flocking.study.certificates.sampled_consensus import NUMBER_ERROR, SampledConsensus
from flocking.study.nets.rigidity import rigid_motions

ORTHONORMAL = 1e-3
"""Largest distance of computed columns from orthonormal ones with which a bound is proven; rounding leaves them 1e-13
apart."""

UNIT_NORM = 1.01
"""Bound of products of the norms of two or four columns that are that near to orthonormal ones: (1 + 1e-3)^4 < 1.01."""

TWO_NORMS = 2.01
"""Bound of the difference of two rows of such columns, whose norms are at most 1 + 1e-3, and of its products with unit
vectors."""

LARGEST = 400
"""Components up to which growths below 1 are bounded: 100 agents in the plane, some 5 seconds on one core."""

FEW = 40
"""Components up to which growths that are not below 1 are enclosed, in some seconds."""

DEPENDENT = 1e8
"""Condition of eigenvectors beyond which a moment that is computed with them is not tried."""

HALVES, NARROW = 12, 0.02
"""Most bounds that are tried, and the width of what is left, relative to the rate at which moments fall."""

STEPS, ENDED, HIGHEST = 1000, 0.5, 1e13
"""Steps of the search for a moment, change of its trace at which it ends, and its largest trace. Moments rise from step
to step, and the proof needs that the last one added less than the unit matrix."""

SINGULAR = 1e-12
"""Relative error of computed singular values of a few columns, with room: some N units of rounding."""


@dataclass(frozen=True, eq=False)
class LossyLattice:
    """A law of order 2 near an equilibrium without stress, in a declared world that loses messages.

    Parameters
    ----------
    near
        The law near its equilibrium, which was found.
    """

    near: NearEquilibrium

    @cached_property
    def world(self) -> SampledConsensus:
        """The declared world."""
        return SampledConsensus(LinearConsensus(self.near.scenario))

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """What must hold of the declared world and of the size of the group."""
        at = self.near.equilibrium
        n, m = at.q.shape
        size = 2 * n * m - m - at.rigid_motions
        return (
            *self.world.leaves_out,
            Hypothesis(f"{LARGEST} numbers at most", size <= LARGEST, f"{size}"),
            Hypothesis(
                "agents are not in a row, of three dimensions", at.rigid_motions == m * (m + 1) // 2,
                f"{at.rigid_motions} translations and rotations",
            ),
        )  # fmt: skip

    @property
    def growth(self) -> tuple[float, float]:
        """Two numbers between which the factor of the mean square from tick to tick lies, in the long run."""
        recursion = self.recursion()
        if not np.isfinite(recursion.absolute).all():
            return 0.0, np.inf
        low, _ = spectral_radius(recursion.enclosed_mean())
        high = growth_bound(recursion)
        if np.isinf(high) and recursion.size <= FEW:
            low, high = recursion.growth()
            return float(low), float(high)
        return float(np.nextafter(low * low, 0.0)), high

    def recursion(self) -> RandomRecursion:
        """Deformations and relative velocities from tick to tick.

        Velocities are over a power of two near the root of the largest stiffness per mass, so that no number depends on
        a unit of time; dividing by it rounds nothing.
        """
        at, world = self.near.equilibrium, self.world
        n, m = at.q.shape
        deforming, away = deformations(at)
        across = orthogonal_to(np.ones((n, 1)))
        moving = np.asarray(np.kron(across, np.eye(m)), dtype=np.float64)
        # Of exact ones: how far the computed columns are from orthonormal, and from orthogonal to the same for all.
        apart = _defect(across) + float(np.linalg.norm(across.sum(axis=0))) / np.sqrt(n) + n * 4.0 * UNIT
        if not max(away, apart) <= ORTHONORMAL:
            away = np.inf
        mass = float(self.near.mass.lo)
        often = unit_of_rates(float(at.link_stresses[1].hi.max()) / mass)
        t = float(world.period * often)
        d, e = deforming.shape[1], moving.shape[1]
        steady = np.eye(d + e)
        steady[:d, d:] = t * (deforming.T @ moving)
        units = 1.0 / (mass * often**2), 1.0 / (mass * often)
        into, out_of, slack = self._links(deforming, moving, away, apart, units)
        into[:d] *= 0.5 * t * t
        into[d:] *= t
        absolute = (
            INFLATION * t * (UNIT_NORM * (away + apart) + rounding(n * m)),
            INFLATION * max(0.5 * t * t * away, t * apart),
            INFLATION * slack,
        )  # fmt: skip
        none = np.zeros((d + e, 0))
        width = m * (2 if world.paired else 1)
        return RandomRecursion(
            steady, none, none.T.copy(), np.zeros((0, 1)), into, out_of, np.zeros((len(out_of), 1)), width,
            1.0 - world.probability, NUMBER_ERROR, absolute,
        )  # fmt: skip

    def _links(
        self, deforming: Array, moving: Array, away: float, apart: float, units: tuple[float, float]
    ) -> tuple[Array, Array, float]:
        """What forces of unit size do to the velocities, what the forces are of, and the largest error of the latter.

        Links that are lost together follow each other.

        Parameters
        ----------
        deforming, moving
            Deformations V and relative velocities U, shapes (N m, D) and (N m, E).
        away, apart
            How far they are from exact ones.
        units
            What stiffness and damping are multiplied by.
        """
        of_places, of_rates = units
        at, damping = self.near.equilibrium, self.near.damping
        m = at.q.shape[1]
        i, j = np.nonzero(np.triu(at.links))
        d = at.q[j] - at.q[i]
        r = np.linalg.norm(d, axis=1)
        wide = 2.0 * at.radius + 16.0 * UNIT * np.abs(at.q).max()
        low = np.maximum(r - wide, np.finfo(np.float64).tiny)
        along = enclosed(at.force.curvature, at.force.symbol, Interval.of(low, r + wide))
        middle = 0.5 * (along.lo + along.hi)
        size, turned = np.maximum(np.abs(along.lo), np.abs(along.hi)), 2.0 * wide / low
        error = 0.5 * (along.hi - along.lo) + size * (2.0 * turned + turned**2 + 16.0 * UNIT)
        into, out_of, slack = [], [], 0.0
        for k in range(len(i)):
            a, b = int(i[k]), int(j[k])
            unit = d[k] / r[k]
            stiff, weight = of_places * middle[k] * np.outer(unit, unit), -of_rates * float(damping.values[a, b])
            # Rows of V and U have norms of at most about 1, their differences of at most 2.
            of_stiffness = TWO_NORMS * float(error[k]) + (TWO_NORMS + m * UNIT) * float(size[k]) * (
                away + 8.0 * m * UNIT
            )
            slack = max(
                slack, of_places * of_stiffness,
                TWO_NORMS * of_rates * float(damping.error[a, b]) + TWO_NORMS * weight * (apart + 8.0 * UNIT),
            )  # fmt: skip
            for one, other in ((a, b), (b, a)):
                mine, theirs = (slice(x * m, (x + 1) * m) for x in (one, other))
                into.append(np.vstack([deforming[mine].T, moving[mine].T]))
                out_of.append(np.hstack([
                    -stiff @ (deforming[mine] - deforming[theirs]), -weight * (moving[mine] - moving[theirs])
                ]))  # fmt: skip
        return np.hstack(into), np.vstack(out_of), slack


def growth_bound(recursion: RandomRecursion) -> float:
    """A bound of the growth of second moments; infinite where none is proven.

    For a c above the growth X = E(X)/c + 1, E the step of moments, is positive definite with E(X) below c X. It is
    found from X = M X M^T/c + (S(X)/c + 1) for the mean step M and what chance adds, S, again and again, and proves its
    bound whatever led to it. The growth lies between the square of the spectral radius of M and the bound, which is
    narrowed by halves.

    Parameters
    ----------
    recursion
        The recursion.
    """
    mean = recursion.mean
    values, vectors = np.linalg.eig(mean)
    if np.linalg.cond(vectors) > DEPENDENT:
        return np.inf
    back, found = np.linalg.inv(vectors), np.inf
    low, high = float(np.abs(values).max(initial=0.0)) ** 2, 1.0
    if low >= high:
        return np.inf
    for _ in range(HALVES):
        c = high if np.isinf(found) else 0.5 * (low + high)
        x = _moment_above(recursion, values, vectors, back, c)
        bound = np.inf if x is None else recursion.bounds(x)[1]
        if bound < 1.0:
            found = min(found, bound)
            high = min(c, bound)
        elif np.isinf(found):
            return np.inf
        else:
            low = c
        if high - low < NARROW * (1.0 - high):
            break
    return found


def _moment_above(
    recursion: RandomRecursion, values: NDArray[np.complex128], vectors: NDArray[np.complex128],
    back: NDArray[np.complex128], c: float,
) -> Array | None:  # fmt: skip
    """About the X with X = E(X)/c + 1; None where it is not found."""
    mean, unit = recursion.mean, np.eye(recursion.size)
    x, added, size = unit, unit, 1.0
    share = 1.0 / (1.0 - np.outer(values, values.conj()) / c)
    for _ in range(STEPS):
        turned = back @ added @ back.conj().T
        x = np.real(vectors @ (share * turned) @ vectors.conj().T)
        x = np.asarray(0.5 * (x + x.T))
        before, size = size, float(np.trace(x))
        if not (np.isfinite(size) and size < HIGHEST):
            return None
        if abs(size - before) < ENDED:
            return x
        added = unit + (recursion.moment(x, mean) - mean @ x @ mean.T) / c
    return x


def deformations(at: Equilibrium) -> tuple[Array, float]:
    """Computed orthonormal deformations V, and how far they are at most from exact ones of the exact equilibrium.

    With the rigid motions R of the exact equilibrium and x >= |R^T V|, g >= |V^T V - 1|: V - R R^T V is orthogonal to
    R, x away from V, and g + x^2 from orthonormal columns, the orthogonal factor of its polar decomposition.

    Parameters
    ----------
    at
        An equilibrium with as many rigid motions as its dimension admits.
    """
    n, m = at.q.shape
    deforming = orthogonal_to(rigid_motions(at.q))
    centred = at.q - at.q.mean(axis=0)
    # The same motions in a unit in which turns are of the size of shifts; a power of two rounds nothing.
    size = 2.0 ** np.ceil(np.log2(np.abs(centred).max()))
    centred = centred / size
    columns = [np.kron(np.ones(n), unit) for unit in np.eye(m)]
    turns = 0
    for a in range(m):
        for b in range(a + 1, m):
            turn = np.zeros((n, m))
            turn[:, a], turn[:, b] = -centred[:, b], centred[:, a]
            columns.append(turn.ravel())
            turns += 1
    rigid = np.array(columns).T
    rounded = 8.0 * UNIT * float(np.abs(at.q).max())
    moved = np.sqrt(turns * n) * (np.sqrt(2.0) * at.radius + rounded) / size * INFLATION
    sizes = np.linalg.svd(rigid, compute_uv=False)
    least = float(sizes[-1] - SINGULAR * sizes[0]) - moved
    if not least > 0.0:
        return deforming, np.inf
    product = exact(rigid.T) @ exact(deforming)
    x = (norm_bound(np.abs(product.values) + product.error) + moved) / least
    return deforming, INFLATION * (x + _defect(deforming) + x * x)


def _defect(columns: Array) -> float:
    """A bound of the distance of the products of some columns from those of orthonormal ones."""
    product = exact(columns.T) @ exact(columns)
    return norm_bound(np.abs(product.values - np.eye(columns.shape[1])) + product.error + UNIT)
