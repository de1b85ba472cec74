"""The safety filter of held control: conditions on accelerations, and the nearest acceleration that satisfies them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.sampled.knowledge import Known
from flocking.model.space import Space
from flocking.model.world.safety_filters import SafetyFilter
from flocking.model.world.times import NANOSECOND

ROUNDING = 1e-12
"""Relative rounding with which a condition counts as satisfied."""

ROUNDED = 1e-9
"""Relaxation, by the largest acceleration, that rounding explains."""

FOUND = 1e-6
"""Relative rounding with which a condition counts as satisfied by an iterative solver."""

ASKED = 1e6
"""Largest acceleration that is asked for, by what both agents can brake: two that are too close would ask for more."""

HALVINGS = 60
"""Halvings of an interval in which a bound on the acceleration or a relaxation is sought."""

CLOSED_FORM = 2
"""Number of binding conditions up to which the nearest acceleration is computed in closed form."""


@dataclass
class FilterMemory:
    """What a safety filter goes on from.

    Parameters
    ----------
    normals
        Unit vectors of each ordered pair along which the two can brake, from j to i, shape (N, N, m).
    changed, relaxed
        How often the force of an agent was changed, and how often its conditions contradicted each other.
    first_relaxed
        When they first did, in nanoseconds from the start; -1 if never.
    """

    normals: Array
    changed: int = 0
    relaxed: int = 0
    first_relaxed: int = -1


def sampled_bound(r: Array, closing: Array, braking: Array, distance: Array, period: float) -> Array:
    """Least relative acceleration along a line, held for a period, after which two agents can still brake in time.

    Parameters
    ----------
    r, closing
        Distances along the line, and speeds at which they shrink.
    braking
        Sums of the largest accelerations of both.
    distance
        Distances before which they can brake.
    period
        The period.
    """
    gap = r - distance - 0.5 * closing * period
    # After the period they close in at y, and need y^2/(2 braking): r - (closing + y) period/2 - y^2/(2 braking) >= D.
    last = -0.5 * braking * period + np.sqrt(0.25 * (braking * period) ** 2 + 2.0 * braking * np.maximum(gap, 0.0))
    going_on = (closing - last) / period
    # They turn round within the period.
    room = np.maximum(r - distance, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        turning = np.where(closing > 0.0, closing**2 / (2.0 * room), -np.inf)
    bound = np.where(gap >= 0.0, going_on, turning)
    return np.clip(np.where(np.isnan(bound), braking, bound), -ASKED * braking, ASKED * braking)


def continuous_bound(dp: Array, dv: Array, braking: Array, distance: float, gain: float) -> Array:
    """Least relative acceleration along the line of two agents by the condition in continuous time.

    Parameters
    ----------
    dp, dv
        Relative positions and velocities, from j to i, shape (K, m).
    braking
        As for `sampled_bound`.
    distance
        The distance that is kept.
    gain
        Gain of the condition.
    """
    r = np.linalg.norm(dp, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        opening = (dp * dv).sum(axis=1) / r
        root = np.sqrt(2.0 * braking * (r - distance))
        across = ((dv**2).sum(axis=1) - opening**2) / r
        bound = -(gain * (root + opening) ** 3 + across + braking * opening / root)
    return np.clip(np.where(np.isfinite(bound), bound, braking), -ASKED * braking, ASKED * braking)


def nearest(wanted: Array, normals: Array, bounds: Array, most: float) -> tuple[Array, bool]:
    """The acceleration nearest to the wanted one with n_k . u >= b_k for all k and |u| <= a, and whether there is one.

    Where there is none, all conditions are relaxed by the least amount for which there is.

    Parameters
    ----------
    wanted
        Shape (m,).
    normals, bounds
        Unit vectors n_k, shape (K, m), and b_k, shape (K,).
    most
        a.
    """
    found = _within_ball(wanted, normals, bounds, most)
    if found is not None:
        return found, True
    # With b_k <= -a any acceleration will do.
    low, high = 0.0, float(bounds.max()) + most
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        found = _within_ball(wanted, normals, bounds - middle, most)
        low, high = (low, middle) if found is not None else (middle, high)
    found = _within_ball(wanted, normals, bounds - high, most)
    assert found is not None
    return found, high <= ROUNDED * most


def _within_ball(wanted: Array, normals: Array, bounds: Array, most: float) -> Array | None:
    """The nearest acceleration that satisfies all, or None."""
    size = max(most, float(np.linalg.norm(wanted)))
    found = _projected(wanted, normals, bounds, size)
    if found is None or float(np.linalg.norm(found)) <= most * (1.0 + ROUNDING):
        return found
    least = _projected(np.zeros_like(wanted), normals, bounds, size)
    if least is None or float(np.linalg.norm(least)) > most * (1.0 + ROUNDING):
        return None
    # The projections of shares of the wanted acceleration are the nearest for each bound on the length.
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        found = _projected(middle * wanted, normals, bounds, size)
        fits = found is not None and float(np.linalg.norm(found)) <= most
        low, high = (middle, high) if fits else (low, middle)
    found = _projected(low * wanted, normals, bounds, size)
    return least if found is None else found


def _projected(wanted: Array, normals: Array, bounds: Array, size: float) -> Array | None:
    """The point nearest to ``wanted`` with n_k . u >= b_k for all k, or None where there is none.

    ``size`` is that of the numbers whose rounding counts as none.
    """
    slack = ROUNDING * size
    missing = bounds - normals @ wanted
    if (missing <= slack).all():
        return wanted
    candidates: list[Array] = [wanted + missing[k] * normals[k] for k in np.flatnonzero(missing > slack)]
    fitting = [u for u in candidates if (normals @ u >= bounds - slack).all()]
    if fitting:
        away = [float(((u - wanted) ** 2).sum()) for u in fitting]
        return fitting[int(np.argmin(away))]
    if len(bounds) <= CLOSED_FORM:
        return _on_both(wanted, normals, missing) if len(bounds) == CLOSED_FORM else None
    found = _by_active_sets(wanted, normals, missing)
    return found if found is not None and (normals @ found >= bounds - FOUND * size).all() else None


def _on_both(wanted: Array, normals: Array, missing: Array) -> Array | None:
    """The nearest point at which both of two conditions bind."""
    gram = normals @ normals.T
    determinant = 1.0 - gram[0, 1] ** 2
    if determinant <= ROUNDING:
        return None
    weights = np.array([missing[0] - gram[0, 1] * missing[1], missing[1] - gram[0, 1] * missing[0]]) / determinant
    return np.asarray(wanted + weights @ normals)


def _by_active_sets(wanted: Array, normals: Array, missing: Array) -> Array | None:
    """The same of many conditions: least distance programming by non-negative least squares (Lawson, Hanson 1974)."""
    from scipy.optimize import nnls

    scale = max(float(np.abs(missing).max()), 1.0)
    system = np.vstack([normals.T, missing[None] / scale])
    target = np.zeros(len(wanted) + 1)
    target[-1] = 1.0
    weights, _ = nnls(system, target)
    residual = system @ weights - target
    if -residual[-1] <= ROUNDING:
        return None
    return np.asarray(wanted - scale * residual[:-1] / residual[-1], dtype=np.float64)


class ForceFilter:
    """The safety filter of a session.

    Parameters
    ----------
    control
        The filter.
    masses
        Masses of the agents, shape (N,).
    q
        Positions at the start, shape (N, m).
    space
        Where the agents live.
    """

    def __init__(self, control: SafetyFilter, masses: Array, q: Array, space: Space) -> None:
        self.control, self.space = control, space
        n, m = q.shape
        self.masses = np.broadcast_to(np.asarray(masses, dtype=np.float64), n)
        self.most = control.accelerations(n)
        # As it is, in whole nanoseconds, not as it was written.
        self.period: Array = np.asarray(control.schedule(n).period * NANOSECOND, dtype=np.float64)
        self.memory = FilterMemory(np.zeros((n, n, m)))

    def filtered(self, time: int, known: Known, force: Array) -> Array:
        """Forces of the agents that act now, shape (agents, m).

        Parameters
        ----------
        time
            Now, in nanoseconds from the start.
        known
            What they know.
        force
            What the law wants of them, shape (agents, m).
        """
        m = force.shape[1]
        found = np.empty_like(force)
        positions = known.positions(m)
        for row, i in enumerate(known.agents.tolist()):
            others = known.there[row].copy()
            others[i] = False
            mass, most = self.masses[i], self.most[i]
            wanted = force[row] / mass
            dp = -self.space.displacement(positions[row] - known.own[row, :m])[others]
            dv = known.own[row, m:] - known.rows[row, others, m:]
            normals, bounds = self._conditions(i, others, dp, dv)
            used, fits = nearest(wanted, normals, bounds, float(most))
            if not fits:
                self.memory.relaxed += 1
                if self.memory.first_relaxed < 0:
                    self.memory.first_relaxed = time
            changed = bool((used != wanted).any())
            self.memory.changed += changed
            found[row] = mass * used if changed else force[row]
        return found

    def _conditions(self, i: int, others: Links, dp: Array, dv: Array) -> tuple[Array, Array]:
        """Unit vectors and least accelerations along them that agent i takes, one for each other agent."""
        control, own = self.control, self.most[i]
        braking = own + self.most[others]
        r = np.linalg.norm(dp, axis=1)
        held = self.memory.normals[i, others]
        apart = r > 0.0
        line = np.where(apart[:, None], dp / np.where(apart, r, 1.0)[:, None], held)
        if control.form == "continuous":
            return line, own / braking * continuous_bound(dp, dv, braking, control.kept, control.gain)
        choices = []
        for normal in (line, held):
            along, closing = (normal * dp).sum(axis=1), -(normal * dv).sum(axis=1)
            known = (normal**2).sum(axis=1) > 0.5
            choices.append((np.where(known, control.reserve(along, closing, braking), -np.inf), along, closing))
        better = choices[1][0] > choices[0][0]
        normals = np.where(better[:, None], held, line)
        left, along, closing = (np.where(better, b, a) for a, b in zip(*choices, strict=True))
        self.memory.normals[i, others] = normals
        period = float(self.period[i])
        kept = control.kept + np.maximum(left, 0.0) * np.exp(-control.gain * period)
        bound = sampled_bound(along, closing, braking, kept, period)
        return normals, own / braking * bound
