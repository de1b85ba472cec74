"""The nearest acceleration that satisfies linear conditions and is no larger than the largest one."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array

ROUNDING = 1e-12
"""Relative rounding with which a condition counts as satisfied."""

ROUNDED = 1e-9
"""Relaxation, by the largest acceleration, that rounding explains."""

FOUND = 1e-6
"""Relative rounding with which a condition counts as satisfied by an iterative solver."""

HALVINGS = 60
"""Halvings of an interval in which a bound on the acceleration or a relaxation is sought."""

FARTHEST = 1e6
"""Largest acceleration that is looked at, by the largest one allowed: the size of a farther one would hide whether the
conditions hold. Of projections x, y of vectors s w, t w with s < t and a unit vector w onto a convex set of radius a,
w . (y - x) <= x . (y - x)/s <= 2 a^2/s, so that 2e-6 of the largest one is lost along w at most."""

ORDINARY = 1e-3
"""What is missing counts as at least 1 from this size on; less is taken in units of itself, in which least squares do
not take it for rounding."""

CLOSED_FORM = 2
"""Number of binding conditions up to which the nearest acceleration is computed in closed form."""


def nearest(desired: Array, normals: Array, bounds: Array, most: float) -> tuple[Array, bool]:
    """The acceleration nearest to the desired one with n_k . u >= b_k for all k and |u| <= a, and whether there is one.

    Where there is none, all conditions are relaxed by the least amount for which there is.

    Parameters
    ----------
    desired
        Shape (m,).
    normals, bounds
        Unit vectors n_k, shape (K, m), and b_k, shape (K,).
    most
        a.

    Raises
    ------
    FloatingPointError
        When numbers are so far apart that rounding hides the smaller ones.
    """
    desired = shortened(desired, FARTHEST * most)
    found = _within_ball(desired, normals, bounds, most)
    if found is not None:
        return found, True
    # With b_k <= -a any acceleration will do.
    low, high = 0.0, float(bounds.max()) + most
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        found = _within_ball(desired, normals, bounds - middle, most)
        low, high = (low, middle) if found is not None else (middle, high)
    found = _within_ball(desired, normals, bounds - high, most)
    if found is None:
        raise FloatingPointError("a condition is so large that rounding hides the largest acceleration")
    return found, high <= ROUNDED * most


def shortened(desired: Array, most: float) -> Array:
    """A vector of the same direction that is no longer than ``most``, also where its square overflows.

    Parameters
    ----------
    desired
        The vector, shape (m,).
    """
    largest = float(np.abs(desired).max())
    if not largest > 0.0:
        return desired
    unit = desired / largest
    length = float(np.linalg.norm(unit))
    return desired if length <= most / largest else np.asarray(unit * (most / length))


def _within_ball(desired: Array, normals: Array, bounds: Array, most: float) -> Array | None:
    """The nearest acceleration that satisfies all, or None."""
    size = max(most, float(np.linalg.norm(desired)))
    found = _projected(desired, normals, bounds, size)
    if found is None or float(np.linalg.norm(found)) <= most * (1.0 + ROUNDING):
        return found
    least = _projected(np.zeros_like(desired), normals, bounds, size)
    if least is None or float(np.linalg.norm(least)) > most * (1.0 + ROUNDING):
        return None
    # The projections of shares of the desired acceleration are the nearest for each bound on the length.
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        found = _projected(middle * desired, normals, bounds, size)
        fits = found is not None and float(np.linalg.norm(found)) <= most
        low, high = (middle, high) if fits else (low, middle)
    found = _projected(low * desired, normals, bounds, size)
    return least if found is None else found


def _projected(desired: Array, normals: Array, bounds: Array, size: float) -> Array | None:
    """The point nearest to ``desired`` with n_k . u >= b_k for all k, or None where there is none.

    ``size`` is that of the numbers whose rounding counts as none.
    """
    slack = ROUNDING * size
    missing = bounds - normals @ desired
    if (missing <= slack).all():
        return desired
    candidates: list[Array] = [desired + missing[k] * normals[k] for k in np.flatnonzero(missing > slack)]
    fitting = [u for u in candidates if (normals @ u >= bounds - slack).all()]
    if fitting:
        away = [float(((u - desired) ** 2).sum()) for u in fitting]
        return fitting[int(np.argmin(away))]
    if len(bounds) <= CLOSED_FORM:
        return _on_both(desired, normals, missing) if len(bounds) == CLOSED_FORM else None
    found = _by_active_sets(desired, normals, missing)
    return found if found is not None and (normals @ found >= bounds - FOUND * size).all() else None


def _on_both(desired: Array, normals: Array, missing: Array) -> Array | None:
    """The nearest point at which both of two conditions bind."""
    gram = normals @ normals.T
    determinant = 1.0 - gram[0, 1] ** 2
    if determinant <= ROUNDING:
        return None
    weights = np.array([missing[0] - gram[0, 1] * missing[1], missing[1] - gram[0, 1] * missing[0]]) / determinant
    return np.asarray(desired + weights @ normals)


def _by_active_sets(desired: Array, normals: Array, missing: Array) -> Array | None:
    """The same of many conditions: least distance programming by non-negative least squares (Lawson, Hanson 1974)."""
    from scipy.optimize import nnls

    largest = float(np.abs(missing).max())
    scale = largest if largest < ORDINARY else max(largest, 1.0)
    system = np.vstack([normals.T, missing[None] / scale])
    if not np.isfinite(system).all():
        raise FloatingPointError("a condition is infinite or not a number")
    target = np.zeros(len(desired) + 1)
    target[-1] = 1.0
    weights, _ = nnls(system, target)
    residual = system @ weights - target
    if -residual[-1] <= ROUNDING:
        return None
    return np.asarray(desired - scale * residual[:-1] / residual[-1], dtype=np.float64)
