"""Steering terms: forces that an agent computes from all that it sees at once, which are no sums over pairs."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from flocking.arrays import Indices, Mask
from flocking.errors import InvalidInput
from flocking.model.checks import Array, number, one_of, truth
from flocking.model.parts import values
from flocking.model.parts.registration import register_part
from flocking.model.terms.pair_terms import Term, Value

TOTALS = ("direction", "mean", "sum")
"""What becomes of the sum over those an agent sees."""

COMPARED = ("headings", "velocities")
"""What alignment compares: unit vectors, or velocities as they are."""

ALL_ROUND = -1.0
"""Cosine of the angle of a cone that is the whole surroundings."""


@dataclass(frozen=True, eq=False)
class Seen:
    """Some agents, and those around them.

    Parameters
    ----------
    q, p
        Positions and velocities of K agents, shape (K, m).
    of
        Which of the K agents each of L pairs belongs to, shape (L,).
    offset, distance
        Vector to the other agent of a pair, to its nearest image, and its length, shapes (L, m) and (L,).
    velocity
        Velocity of the other agent, shape (L, m).
    """

    q: Array
    p: Array
    of: Indices
    offset: Array
    distance: Array
    velocity: Array

    def within(self, radius: float) -> Seen:
        """The same agents with those others alone that are closer than a radius.

        Parameters
        ----------
        radius
            The radius.
        """
        return self.those(self.distance < radius)

    def those(self, chosen: Mask) -> Seen:
        """The same agents with some of the pairs.

        Parameters
        ----------
        chosen
            Which pairs, shape (L,).
        """
        return Seen(self.q, self.p, self.of[chosen], self.offset[chosen], self.distance[chosen], self.velocity[chosen])

    @property
    def count(self) -> Indices:
        """Number of pairs of each agent, shape (K,)."""
        return np.bincount(self.of, minlength=len(self.q))

    def total(self, vectors: Array) -> Array:
        """Sum of vectors of pairs, shape (L, m), for each agent, shape (K, m).

        Parameters
        ----------
        vectors
            One vector for each pair.
        """
        n, dimension = self.q.shape
        found = np.empty((n, dimension))
        for k in range(dimension):
            found[:, k] = np.bincount(self.of, vectors[:, k], minlength=n)
        return found


class Steering(Term):
    """A term that an agent computes from its own state and from all agents that it sees, on arrays.

    Where other terms state formulas, `steer` is a function of arrays. It keeps no ledger of energy: such terms act on
    bodies in discrete time alone, see `flocking.model.bodies.discrete_bodies`. A subclass states `steer`, and `reach`
    where it sees others.
    """

    @property
    def reach(self) -> float:
        """Distance up to which it needs to see others; 0 where it sees none."""
        return 0.0

    @property
    def sees_places(self) -> bool:
        """Whether its force depends on where an agent is, so that it has no meaning in space that repeats."""
        return False

    @abstractmethod
    def steer(self, seen: Seen) -> Array:
        """Forces on the agents of ``seen``, shape (K, m).

        Parameters
        ----------
        seen
            Agents, and all others up to at least `reach` from them.
        """

    @property
    def parameters(self) -> dict[str, Value]:
        """None: no formula is compiled."""
        return {}

    @property
    def structure(self) -> tuple[object, ...]:
        """The name of the class."""
        return (type(self).__name__,)

    @property
    def symmetries(self) -> frozenset[str]:
        """Relabelling and locality; a subclass that depends on no place and no direction adds ``"rotation"``."""
        return frozenset({"relabelling", "locality"})


def lengths(vectors: Array) -> Array:
    """Lengths of vectors, shape (K, m), as a column of shape (K, 1)."""
    return np.asarray(np.sqrt((vectors**2).sum(axis=1, keepdims=True)))


def directions(vectors: Array) -> Array:
    """Unit vectors of vectors, shape (K, m); zero where they are zero."""
    length = lengths(vectors)
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0))


class _Cone(Steering):
    """A steering term that sees others within a radius and a cone about its velocity."""

    weight: float
    radius: float
    cosine: float
    near: float
    total: str

    def _check_cone(self) -> None:
        owner = type(self).__name__
        for name in ("weight", "near"):
            object.__setattr__(self, name, number(owner, name, getattr(self, name), least=0.0))
        object.__setattr__(self, "radius", number(owner, "radius", self.radius, above=0.0))
        object.__setattr__(self, "cosine", number(owner, "cosine", self.cosine, least=-1.0, below=1.0))
        if self.near > self.radius:
            raise InvalidInput(owner, "near", f"must be at most the radius, {self.radius:g}", self.near)
        one_of(owner, "total", self.total, TOTALS, "must be 'direction', 'mean' or 'sum'")

    @property
    def reach(self) -> float:
        """The radius."""
        return self.radius

    @property
    def symmetries(self) -> frozenset[str]:
        """Rotation, relabelling and locality."""
        return frozenset({"rotation", "relabelling", "locality"})

    def seen_in_cone(self, seen: Seen) -> Seen:
        """Those that the term sees.

        An agent at rest has no direction: it sees all around.

        Parameters
        ----------
        seen
            Agents, and all others around them.
        """
        inside = seen.distance < self.radius
        if self.cosine > ALL_ROUND:
            p = seen.p[seen.of]
            speed = lengths(p)[:, 0]
            ahead = (seen.offset * p).sum(axis=1)
            inside &= (seen.distance < self.near) | (speed == 0.0) | (ahead > self.cosine * seen.distance * speed)
        return seen.those(inside)

    def weighed(self, total: Array, count: Indices) -> Array:
        """The force: the weight times the direction of the sum, the mean, or the sum.

        Parameters
        ----------
        total
            Sums over those seen, shape (K, m).
        count
            By how many a mean is divided, shape (K,).
        """
        if self.total == "direction":
            return self.weight * directions(total)
        if self.total == "mean":
            return self.weight * total / np.maximum(count, 1)[:, None]
        return self.weight * total


@register_part("separation")
@dataclass(frozen=True)
class Separation(_Cone):
    """Steering away from those near: the sum of -d/r^k over those seen (Reynolds 1987).

    d = q_j - q_i is the vector to another agent and r its length. Agents at one place do not push each other.

    Parameters
    ----------
    weight
        Factor of the force; not negative.
    radius
        Distance below which others are seen; positive.
    cosine
        Least cosine of the angle between an agent's velocity and the direction of another that it sees; -1 where it
        sees all around. It must be exceeded. An agent at rest sees all around.
    near
        Distance below which another is seen in any direction. One at the same place has no direction: in a cone it is
        seen where this is positive alone.
    total
        ``"direction"``: the unit vector of the sum; ``"mean"``: the sum divided by the number of those seen; ``"sum"``.
    exponent
        k; not negative.
    among
        With ``"mean"``: radius, all around, of those by whose number the sum is divided; None for those seen.

    Raises
    ------
    InvalidInput
        When a value is out of range.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Separation(12.0, radius=5.0, cosine=-0.707).reach
    5.0
    """

    weight: float
    radius: float
    cosine: float = ALL_ROUND
    near: float = 0.0
    total: Annotated[str, values.choice(*TOTALS)] = "direction"
    exponent: float = 2.0
    among: float | None = None

    def __post_init__(self) -> None:
        self._check_cone()
        object.__setattr__(self, "exponent", number("Separation", "exponent", self.exponent, least=0.0))
        if self.among is not None:
            object.__setattr__(self, "among", number("Separation", "among", self.among, above=0.0))
            if self.total != "mean":
                raise InvalidInput("Separation", "among", "must be None where no mean is taken", self.among)

    @property
    def reach(self) -> float:
        """The larger one of the radius and ``among``."""
        return max(self.radius, self.among or 0.0)

    def steer(self, seen: Seen) -> Array:
        """Forces away from those in ``seen``."""
        found = self.seen_in_cone(seen)
        apart = found.those(found.distance > 0.0)
        total = apart.total(-apart.offset / (apart.distance**self.exponent)[:, None])
        return self.weighed(total, found.count if self.among is None else seen.within(self.among).count)


@register_part("alignment")
@dataclass(frozen=True)
class Alignment(_Cone):
    """Steering along with those near: the sum of their headings less the agent's own, over those seen (Reynolds 1987).

    Parameters
    ----------
    weight, radius, cosine, near, total
        As for `Separation`.
    compared
        ``"headings"``: unit vectors of velocities, zero at rest; ``"velocities"``.
    relative
        Whether the agent's own heading, or velocity, is subtracted from each.

    Raises
    ------
    InvalidInput
        When a value is out of range.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Alignment(8.0, radius=7.5, cosine=0.7).compared
    'headings'
    """

    weight: float
    radius: float
    cosine: float = ALL_ROUND
    near: float = 0.0
    total: Annotated[str, values.choice(*TOTALS)] = "direction"
    compared: Annotated[str, values.choice(*COMPARED)] = "headings"
    relative: bool = True

    def __post_init__(self) -> None:
        self._check_cone()
        one_of("Alignment", "compared", self.compared, COMPARED, "must be 'headings' or 'velocities'")
        object.__setattr__(self, "relative", truth("Alignment", "relative", self.relative))

    def steer(self, seen: Seen) -> Array:
        """Forces towards the headings of those in ``seen``."""
        found = self.seen_in_cone(seen)
        own, others = found.p, found.velocity
        if self.compared == "headings":
            own, others = directions(own), directions(others)
        return self.weighed(found.total(others - own[found.of] if self.relative else others), found.count)


@register_part("cohesion")
@dataclass(frozen=True)
class Cohesion(_Cone):
    """Steering towards the centroid of those near: the sum of q_j - q_i over those seen (Reynolds 1987).

    Parameters
    ----------
    weight, radius, cosine, near, total
        As for `Separation`.

    Raises
    ------
    InvalidInput
        When a value is out of range.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Cohesion(8.0, radius=9.0, cosine=-0.15).total
    'direction'
    """

    weight: float
    radius: float
    cosine: float = ALL_ROUND
    near: float = 0.0
    total: Annotated[str, values.choice(*TOTALS)] = "direction"

    def __post_init__(self) -> None:
        self._check_cone()

    def steer(self, seen: Seen) -> Array:
        """Forces towards the centroid of those in ``seen``."""
        found = self.seen_in_cone(seen)
        return self.weighed(found.total(found.offset), found.count)


@register_part("turn_back")
@dataclass(frozen=True)
class TurnBack(Steering):
    """Steering back to the origin from a radius on, sideways alone.

    The desired velocity leads to the origin, with the distance as its length, at most ``speed``. The force is its
    difference from the velocity of the agent, less the part along that velocity.

    Parameters
    ----------
    radius
        Distance from the origin from which it acts; positive.
    speed
        Largest speed wanted; positive.

    Raises
    ------
    InvalidInput
        When a value is out of range.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.TurnBack(50.0, speed=9.0).reach
    0.0
    """

    radius: float
    speed: float

    def __post_init__(self) -> None:
        for name in ("radius", "speed"):
            object.__setattr__(self, name, number("TurnBack", name, getattr(self, name), above=0.0))

    @property
    def sees_places(self) -> bool:
        """True: it acts about a place."""
        return True

    def steer(self, seen: Seen) -> Array:
        """Forces on those in ``seen`` that are outside."""
        distance = lengths(seen.q)
        desired = -seen.q * np.minimum(1.0, self.speed / np.maximum(distance, self.radius))
        ahead = directions(seen.p)
        difference = desired - seen.p
        sideways = difference - (difference * ahead).sum(axis=1, keepdims=True) * ahead
        return np.where(distance >= self.radius, sideways, 0.0)
