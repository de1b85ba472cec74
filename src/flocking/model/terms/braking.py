"""Steering terms of self-propelled agents that brake in time: desired velocities (Vasarhelyi et al. 2018)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, number
from flocking.model.leaders_and_obstacles.obstacles import Ball, Obstacle, Wall
from flocking.model.parts import values
from flocking.model.parts.registration import register_part
from flocking.model.terms.steering import Seen, Steering, directions, lengths


def braking_speed(distance: Array | float, acceleration: float, slope: float) -> Array:
    """D(x; a, p): the largest speed from which one stops within a distance, by a braking curve.

    p x up to the speed a/p, sqrt(2 a x - a^2/p^2) above, 0 where the distance is not positive: constant deceleration a,
    then exponential approach with the rate p. Value and slope agree where the two meet.

    Parameters
    ----------
    distance
        x, any shape.
    acceleration
        a; positive.
    slope
        p; positive.
    """
    x = np.asarray(distance, dtype=np.float64)
    linear = slope * x
    root = np.sqrt(np.maximum(2.0 * acceleration * x - (acceleration / slope) ** 2, 0.0))
    return np.asarray(np.where(x <= 0.0, 0.0, np.where(linear < acceleration / slope, linear, root)))


def braking_distance(speed: Array | float, acceleration: float, slope: float) -> Array:
    """The inverse of `braking_speed`: v/p below the speed a/p, else (v^2 + a^2/p^2)/(2 a).

    Parameters
    ----------
    speed
        v, any shape; not negative.
    acceleration, slope
        As for `braking_speed`.
    """
    v, meet = np.asarray(speed, dtype=np.float64), acceleration / slope
    return np.asarray(np.where(v < meet, v / slope, (v**2 + meet**2) / (2.0 * acceleration)))


def _beyond(difference: Array, allowed: Array) -> Array:
    """What of velocity differences, shape (K, m), is longer than is allowed, shape (K,)."""
    excess = np.maximum(lengths(difference)[:, 0] - allowed, 0.0)
    return np.asarray(excess[:, None] * directions(difference))


def _positive(owner: object, *names: str) -> None:
    for name in names:
        object.__setattr__(owner, name, number(type(owner).__name__, name, getattr(owner, name), above=0.0))


ROTATING = frozenset({"rotation", "relabelling", "locality"})
"""Symmetries of terms that depend on no place and no direction."""


@register_part("self_propulsion")
@dataclass(frozen=True)
class SelfPropulsion(Steering):
    """The desired velocity v p/|p| along the own one; zero for an agent at rest.

    Parameters
    ----------
    speed
        v; positive.

    Raises
    ------
    InvalidInput
        When it is out of range.
    """

    speed: float

    def __post_init__(self) -> None:
        _positive(self, "speed")

    @property
    def symmetries(self) -> frozenset[str]:
        """Rotation, relabelling and locality."""
        return ROTATING

    def steer(self, seen: Seen) -> Array:
        """The speed along the velocities in ``seen``."""
        return self.speed * directions(seen.p)


@register_part("linear_repulsion")
@dataclass(frozen=True)
class LinearRepulsion(Steering):
    """Repulsion that grows with the overlap: sum over those closer than r0 of min(p (r0 - r), v) away from them.

    Parameters
    ----------
    slope
        p; positive.
    radius
        r0; positive.
    most
        v, the largest contribution of one neighbour; positive.

    Raises
    ------
    InvalidInput
        When a value is out of range.
    """

    slope: float
    radius: float
    most: float

    def __post_init__(self) -> None:
        _positive(self, "slope", "radius", "most")

    @property
    def reach(self) -> float:
        """The radius."""
        return self.radius

    @property
    def symmetries(self) -> frozenset[str]:
        """Rotation, relabelling and locality."""
        return ROTATING

    def steer(self, seen: Seen) -> Array:
        """Velocities away from those in ``seen``."""
        near = seen.within(self.radius)
        size = np.minimum(self.slope * (self.radius - near.distance), self.most)
        return near.total(-size[:, None] * directions(near.offset))


@register_part("braking_alignment")
@dataclass(frozen=True)
class BrakingAlignment(Steering):
    """Alignment beyond what a braking curve allows: sum of C (|dv| - m) dv/|dv| over those seen where |dv| > m.

    dv = p_j - p_i, and m is the larger one of a slack and D(r - r0; a, p) of `braking_speed`.

    Parameters
    ----------
    gain
        C; not negative.
    slack
        Difference of velocities that is always allowed; not negative.
    radius
        r0, up to which no more than the slack is allowed; not negative.
    acceleration, slope
        a and p of the braking curve; positive.
    range
        Distance up to which others are seen; positive.

    Raises
    ------
    InvalidInput
        When a value is out of range.
    """

    gain: float
    slack: float
    radius: float
    acceleration: float
    slope: float
    range: float

    def __post_init__(self) -> None:
        _positive(self, "acceleration", "slope", "range")
        for name in ("gain", "slack", "radius"):
            object.__setattr__(self, name, number("BrakingAlignment", name, getattr(self, name), least=0.0))

    @property
    def reach(self) -> float:
        """The range."""
        return self.range

    @property
    def symmetries(self) -> frozenset[str]:
        """Rotation, relabelling and locality."""
        return ROTATING

    def steer(self, seen: Seen) -> Array:
        """Velocities towards those of the agents in ``seen``."""
        near = seen.within(self.range)
        allowed = np.maximum(self.slack, braking_speed(near.distance - self.radius, self.acceleration, self.slope))
        return near.total(self.gain * _beyond(near.velocity - near.p[near.of], allowed))


@register_part("shill_walls")
@dataclass(frozen=True)
class ShillWalls(Steering):
    """The walls of a square arena: on each axis the excess of s - p over D(distance from the wall; a, p).

    s is the velocity of a virtual (shill) agent at the nearest point of the wall, of a given speed along the axis to
    the centre. An agent at the centre of an axis has no nearer wall on it: no such agent acts.

    Parameters
    ----------
    half_width
        Distance of the walls from the centre, which is the origin; positive.
    speed
        Speed of the shill agents; positive.
    acceleration, slope
        a and p of the braking curve; positive.
    offset
        Distance from the wall at which the curve ends.

    Raises
    ------
    InvalidInput
        When a value is out of range.
    """

    half_width: float
    speed: float
    acceleration: float
    slope: float
    offset: float = 0.0

    def __post_init__(self) -> None:
        _positive(self, "half_width", "speed", "acceleration", "slope")
        object.__setattr__(self, "offset", number("ShillWalls", "offset", self.offset))

    @property
    def sees_places(self) -> bool:
        """True: walls stand at a place."""
        return True

    def solids(self, dimension: int) -> tuple[Obstacle, ...]:
        """The two walls on each axis."""
        axes = np.eye(dimension)
        return tuple(Wall(-side * self.half_width * axis, side * axis) for axis in axes for side in (1.0, -1.0))

    def steer(self, seen: Seen) -> Array:
        """Velocities away from the walls."""
        found = np.zeros_like(seen.q)
        for axis in range(seen.q.shape[1]):
            shill = np.zeros_like(seen.q)
            shill[:, axis] = -self.speed * np.sign(seen.q[:, axis])
            distance = self.half_width - np.abs(seen.q[:, axis]) - self.offset
            excess = _beyond(shill - seen.p, braking_speed(distance, self.acceleration, self.slope))
            found += np.where(seen.q[:, axis, None] != 0.0, excess, 0.0)
        return found


@register_part("shill_disc")
@dataclass(frozen=True)
class ShillDisc(Steering):
    """A round obstacle: the excess of s - p over D(distance from its boundary; a, p).

    s has a given speed along the outward normal; inside the obstacle the distance is negative, and D zero.

    Parameters
    ----------
    centre
        Centre, shape (m,).
    radius
        Radius; positive.
    speed, acceleration, slope
        As for `ShillWalls`.

    Raises
    ------
    InvalidInput
        When a value is out of range.
    """

    centre: Annotated[Sequence[float], values.POINT]
    radius: float
    speed: float
    acceleration: float
    slope: float

    def __post_init__(self) -> None:
        _positive(self, "radius", "speed", "acceleration", "slope")
        centre = array("ShillDisc", "centre", self.centre, ndim=1)
        object.__setattr__(self, "centre", tuple(float(x) for x in centre))

    def check_dimension(self, dimension: int) -> None:
        """Refuse another number of axes than that of the centre.

        Raises
        ------
        InvalidInput
            When it is so.
        """
        if len(self.centre) != dimension:
            raise InvalidInput("ShillDisc", "centre", f"must have {dimension} coordinates", list(self.centre))

    @property
    def sees_places(self) -> bool:
        """True: an obstacle stands at a place."""
        return True

    def solids(self, dimension: int) -> tuple[Obstacle, ...]:
        """The disc."""
        return (Ball(self.centre, self.radius),)

    def steer(self, seen: Seen) -> Array:
        """Velocities away from the obstacle."""
        offset = seen.q - np.asarray(self.centre)
        distance = lengths(offset)[:, 0] - self.radius
        shill = self.speed * directions(offset)
        return _beyond(shill - seen.p, braking_speed(distance, self.acceleration, self.slope))
