"""The safety filter of stopping paths: every agent stays, while it moves and while it brakes, on its side of planes.

The stopping path of an agent is the straight way on which it comes to rest under its largest force against its
velocity, held for whole periods. At a tick every two agents have a plane between their stopping paths, in the middle of
the two points at which these are nearest to each other; each keeps half the distance from it until the next tick and on
the stopping path that it has then. Braking satisfies that for all planes at once, whatever the number of agents: the
rest of a stopping path is again one, and a segment lies beyond the plane that is normal to the shortest way to it. So
conditions never contradict each other. What lies half the distance away from a plane on its two sides is the whole
distance apart; hence no two agents come closer during the period, and at the next tick stopping paths are the distance
apart again. An obstacle that is a ball or a half space at rest has such a plane through its nearest point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Mask
from flocking.engine.sampled.nearest_force import FARTHEST, nearest, shortened

ROUNDED = 1.0 + 1e-12
"""Factor by which the norm of an acceleration may exceed its bound by rounding."""

SHARES = 32
"""Parts into which the way from braking to the desired acceleration is divided, and then the last part: an acceleration
1/1024 of the way further was tried and does not keep the planes."""

ROUNDING = 64 * float(np.finfo(np.float64).eps)
"""Rounding, by the length of a stopping path and the distance, within which braking keeps the planes that it reaches:
some dozens of operations. A million ticks add up to a hundredth of the margin of the filter."""

RELAXED = 1e-9
"""Relaxation of a plane, by the distance, that rounding explains."""


def stopping_distance(speed: Array, most: Array | float, period: Array | float) -> Array:
    """Distance on which agents stop that brake for whole periods, the last one only as much as is needed.

    Parameters
    ----------
    speed
        Speeds.
    most
        Largest accelerations.
    period
        The period, one for all or one for each.
    """
    periods = np.floor(speed / (most * period))
    rest = np.maximum(speed - periods * most * period, 0.0)
    return np.asarray(periods * period * (speed - 0.5 * periods * most * period) + 0.5 * rest * period)


def stopping_paths(v: Array, most: Array | float, period: Array | float) -> Array:
    """Vectors from where agents are to where they stop, shape (K, m).

    Parameters
    ----------
    v
        Velocities, shape (K, m).
    most, period
        As for `stopping_distance`.
    """
    speed = np.linalg.norm(v, axis=-1)
    share = stopping_distance(speed, most, period) / np.where(speed > 0.0, speed, 1.0)
    return np.asarray(v * share[..., None])


def braking(v: Array, most: float, period: float) -> Array:
    """The acceleration that brakes on the stopping path, shape (m,).

    Parameters
    ----------
    v
        Velocity, shape (m,).
    most, period
        As for `stopping_distance`.
    """
    speed = float(np.linalg.norm(v))
    return np.asarray(-v / period if speed <= most * period else -v * (most / speed))


def nearest_points(d: Array, q: Array, e: Array) -> tuple[Array, Array]:
    """The points of the segment from 0 to d and of those from q to q + e that are nearest to each other.

    Parameters
    ----------
    d
        Shape (m,).
    q, e
        Shape (K, m).

    Returns
    -------
    tuple
        Points on the one segment and on the others, shape (K, m) each.
    """
    dd, ee, de = float(d @ d), (e * e).sum(axis=1), e @ d
    dq, eq = q @ d, (e * q).sum(axis=1)

    def share(over: Array, under: Array | float) -> Array:
        with np.errstate(all="ignore"):
            found = np.where(np.asarray(under) > 0.0, over / under, 0.0)
        return np.asarray(np.clip(np.nan_to_num(found), 0.0, 1.0))

    zero, one = np.zeros(len(q)), np.ones(len(q))
    inner = share(dq * ee - de * eq, dd * ee - de**2)
    pairs = [(zero, share(-eq, ee)), (one, share(de - eq, ee)), (share(dq, dd), zero), (share(dq + de, dd), one),
             (inner, share(inner * de - eq, ee))]  # fmt: skip
    own = np.array([s[:, None] * d for s, _ in pairs])
    theirs = np.array([q + t[:, None] * e for _, t in pairs])
    best = ((own - theirs) ** 2).sum(axis=2).argmin(axis=0)
    row = np.arange(len(q))
    return own[best, row], theirs[best, row]


@dataclass(frozen=True)
class Planes:
    """Half spaces n . z >= b.

    Parameters
    ----------
    normals
        Unit vectors n, shape (K, m).
    levels
        b, shape (K,).
    """

    normals: Array
    levels: Array

    def joined(self, other: Planes) -> Planes:
        """These and others.

        Parameters
        ----------
        other
            The others.
        """
        return Planes(np.vstack([self.normals, other.normals]), np.concatenate([self.levels, other.levels]))


def between(d: Array, q: Array, e: Array, distance: float) -> Planes:
    """The planes between the stopping path from 0 to d and those from q to q + e; see the module.

    Parameters
    ----------
    d
        Shape (m,).
    q, e
        Shape (K, m).
    distance
        The distance that is kept.
    """
    own, theirs = nearest_points(d, q, e)
    away = own - theirs
    size = np.linalg.norm(away, axis=1)
    # Where paths meet, but for rounding, there is no plane: away from the other agent, as far as braking allows.
    instead = -q
    far = np.linalg.norm(instead, axis=1)
    apart = size > ROUNDING * (float(np.linalg.norm(d)) + far + np.linalg.norm(e, axis=1))
    normals = np.where(
        apart[:, None], away / np.where(size > 0.0, size, 1.0)[:, None],
        instead / np.where(far > 0.0, far, 1.0)[:, None],
    )  # fmt: skip
    levels = 0.5 * (normals * (own + theirs)).sum(axis=1) + 0.5 * distance
    return Planes(normals, levels)


def beside_balls(d: Array, centres: Array, radii: Array, distance: float) -> Planes:
    """The planes between the stopping path from 0 to d and balls.

    Parameters
    ----------
    d
        Shape (m,).
    centres, radii
        Of the balls, shapes (K, m) and (K,).
    distance
        The distance that is kept from them.
    """
    size = float(d @ d)
    share = np.clip(centres @ d / size, 0.0, 1.0) if size else np.zeros(len(centres))
    away = share[:, None] * d - centres
    far = np.linalg.norm(away, axis=1)
    normals = away / np.where(far > 0.0, far, 1.0)[:, None]
    return Planes(normals, (normals * centres).sum(axis=1) + radii + distance)


def stopping_acceleration(
    desired: Array, v: Array, planes: Planes, most: float, period: float, distance: float
) -> tuple[Array, bool]:
    """An acceleration near the desired one that keeps an agent at 0 on its side of planes, and whether none is relaxed.

    Parameters
    ----------
    desired, v
        Desired acceleration and velocity, shape (m,).
    planes
        The planes.
    most, period
        As for `stopping_distance`.
    distance
        The distance, by which relaxations are measured.
    """
    desired = shortened(desired, FARTHEST * most)
    brake = braking(v, most, period)
    path = stopping_paths(v[None], most, period)[0]
    reached = np.minimum(0.0, planes.normals @ path) - ROUNDING * (float(np.linalg.norm(path)) + distance)
    held = Planes(planes.normals, np.minimum(planes.levels, reached))
    fits = bool((planes.levels - held.levels <= RELAXED * distance).all())
    size = float(np.linalg.norm(desired))
    first = desired if size <= most else desired * (most / size)
    fit = _on_their_sides(first[None], v, held, most, period)
    if fit.all():
        return first, fits
    found = [_towards(first, brake, v, held, most, period)]
    # No nearer to the planes that the desired one crosses than braking brings it: the agent slides along them.
    crossed = ~_sides(first[None], v, held, most, period)[0]
    along, _ = nearest(first, held.normals[crossed], held.normals[crossed] @ brake, most)
    found.append(_towards(along, brake, v, held, most, period))
    away = [float(((u - desired) ** 2).sum()) for u in found]
    return found[int(np.argmin(away))], fits


def _towards(target: Array, brake: Array, v: Array, planes: Planes, most: float, period: float) -> Array:
    """The acceleration nearest to a target, on the way there from braking, that is found to keep the planes."""
    low, width = 0.0, 1.0
    for _ in range(2):
        shares = low + width * np.linspace(1.0, 0.0, SHARES + 1)[:-1]
        candidates = brake + shares[:, None] * (target - brake)
        fit = _on_their_sides(candidates, v, planes, most, period)
        if fit.any():
            low = float(shares[int(np.argmax(fit))])
        if low >= 1.0:
            return target
        width /= SHARES
    return np.asarray(brake + low * (target - brake))


def _on_their_sides(u: Array, v: Array, planes: Planes, most: float, period: float) -> Mask:
    """Which accelerations, shape (C, m), keep all planes and are not larger than the largest."""
    small = np.linalg.norm(u, axis=1) <= most * ROUNDED
    return np.asarray(_sides(u, v, planes, most, period).all(axis=1) & small)


def _sides(u: Array, v: Array, planes: Planes, most: float, period: float) -> Mask:
    """Which accelerations, shape (C, m), keep which planes: in the period, and on the stopping path after it."""
    later = v + period * u
    place = period * v + 0.5 * period**2 * u
    end = place + stopping_paths(later, most, period)
    least = np.minimum(place @ planes.normals.T, end @ planes.normals.T)
    along, bent = planes.normals @ v, u @ planes.normals.T
    with np.errstate(divide="ignore", invalid="ignore"):
        turns = (along < 0.0) & (bent > 0.0) & (-along < bent * period)
        turning = np.where(turns, -(along**2) / (2.0 * bent), np.inf)
    return np.asarray(np.minimum(least, turning) >= planes.levels)
