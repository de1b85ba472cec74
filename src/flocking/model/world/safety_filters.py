"""Held control behind a safety filter, which changes a force where agents could come too close."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import ArrayLike

from flocking.errors import InvalidInput
from flocking.model.checks import Array, check_each, listed, number, one_of, scalar_or_each
from flocking.model.leaders_and_obstacles.leaders import Sink
from flocking.model.leaders_and_obstacles.obstacles import Ball, Obstacle, Wall
from flocking.model.parts import values
from flocking.model.parts.registration import register_part
from flocking.model.world.control import Held
from flocking.model.world.times import span

MARGIN = 1e-6
"""Share of the distance by which the filter keeps agents farther apart, so that rounding never leads below it."""

ROUNDING = 1e-9
"""Share of the distance below it within which an approach counts as rounding."""

FORMS = ("sampled", "continuous", "stopping")
"""Conditions of the filter: of pairs, for forces that are held for a period and for forces that change at every moment;
and of stopping paths, for held forces and groups of any size."""

SMALLEST, LARGEST = 1e-60, 1e60
"""Bounds of distances, accelerations and the gain: products of four of them are still floating-point numbers."""

SAMPLED = FORMS[0]
"""The form for forces that are held for a period."""


@register_part("safety_filter")
@dataclass(frozen=True, eq=False)
class SafetyFilter(Held):
    """Held control whose forces keep agents apart, by pairwise barriers of double integrators with bounded force.

    At a tick agent i exerts, instead of the desired force of the law, the nearest one that is no larger than
    m_i a_i and satisfies a condition for every other agent it knows of. Two agents at a distance r that close in at
    the speed w can brake before the distance D if w^2 <= 2 (a_i + a_j) (r - D). Each takes the share a_i/(a_i + a_j)
    of the acceleration that this asks of both, so that nobody needs to know the other's force.

    ``form="continuous"`` is the condition of Borrmann, Wang, Ames and Egerstedt (2015): h' >= -gain h^3 for
    h = sqrt(2 (a_i + a_j)(r - D)) + (relative position . relative velocity)/r. It is one of continuous time: where its
    forces are held for a period it may be broken. ``form="sampled"`` asks instead that after a period, whose force is
    held, the two can still brake, along the line between them or that of the tick before: two agents that know each
    other's present state, and can brake at the start, then never come closer than D. Of more agents the conditions may
    contradict each other; then all are relaxed by the least common amount, which is counted.

    ``form="stopping"`` is for groups of any size, and for obstacles. The stopping path of an agent is the straight way
    on which its largest force, held for whole periods, brings it to rest. At a tick a plane lies between the stopping
    paths of every two agents, in the middle of their nearest points, and each agent keeps half the distance D from it
    during the period and on its next stopping path. Braking always does, so that conditions never contradict each
    other: agents whose stopping paths are D apart at the start, who act together and know each other's present state,
    never come closer than D, nor to an obstacle than the clearance. What is taken is not the nearest such force but a
    near one, and agents keep more room than two of them need.

    Parameters
    ----------
    period, phase, latency
        As for `Held`.
    distance
        The distance D; positive, as all that follow between 1e-60 and 1e60.
    acceleration
        Largest acceleration a, one for all agents or one for each; positive.
    form
        ``"sampled"``, ``"continuous"`` or ``"stopping"``.
    gain
        Gain of the condition of pairs; positive.
    obstacles
        Balls and walls at rest that the form ``"stopping"`` keeps agents from.
    clearance
        Distance that is kept from them; positive. Half the distance of agents when absent.

    Raises
    ------
    InvalidInput
        When a value is out of range.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.SafetyFilter(0.1, distance=0.7, acceleration=10.0).summary
    'control held for 0.1 behind a safety filter'
    """

    distance: float = field(kw_only=True)
    acceleration: float | Array = field(kw_only=True)
    form: Annotated[str, values.choice(*FORMS)] = field(default="sampled", kw_only=True)
    gain: float = field(default=1.0, kw_only=True)
    obstacles: Sequence[Obstacle] = field(default=(), kw_only=True)
    clearance: float | None = field(default=None, kw_only=True)

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(
            self, period: float | ArrayLike, phase: float | ArrayLike = 0.0,
            latency: float | ArrayLike = 0.0, *,
            distance: float, acceleration: float | ArrayLike, form: str = "sampled", gain: float = 1.0,
            obstacles: Sequence[Obstacle] = (), clearance: float | None = None,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        Held.__post_init__(self)
        object.__setattr__(self, "distance", number("SafetyFilter", "distance", self.distance, above=0.0))
        found = scalar_or_each("SafetyFilter", "acceleration", self.acceleration, above=0.0)
        object.__setattr__(self, "acceleration", found)
        one_of("SafetyFilter", "form", self.form, FORMS, "must be 'sampled', 'continuous' or 'stopping'")
        object.__setattr__(self, "gain", number("SafetyFilter", "gain", self.gain, above=0.0))
        if self.clearance is not None:
            object.__setattr__(self, "clearance", number("SafetyFilter", "clearance", self.clearance, above=0.0))
        for name in ("distance", "acceleration", "gain", "clearance"):
            given = getattr(self, name)
            found = np.atleast_1d(np.asarray(1.0 if given is None else given, dtype=np.float64))
            if outside := found[(found < SMALLEST) | (found > LARGEST)].tolist():
                raise InvalidInput(
                    "SafetyFilter", name, f"must lie between {SMALLEST:g} and {LARGEST:g}", outside[0],
                    "Products of other numbers are too small or too large to compute with.",
                )  # fmt: skip
        obstacles = listed("SafetyFilter", "obstacles", self.obstacles, "must be a sequence of balls and walls")
        object.__setattr__(self, "obstacles", tuple(obstacles))
        for each in self.obstacles:
            own = type(each) not in (Ball, Wall)  # Its planes may be others.
            if own or not (isinstance(each, Ball | Wall) and isinstance(each.mover, Sink)):
                raise InvalidInput(
                    "SafetyFilter", "obstacles", "must be balls and walls at rest", each,
                    "Let the law avoid other ones.",
                )  # fmt: skip
        if self.obstacles and self.form != "stopping":
            raise InvalidInput(
                "SafetyFilter", "form", "must be 'stopping' where there are obstacles", self.form,
                "The conditions of pairs have no term for them.",
            )  # fmt: skip

    def check_count(self, n: int) -> None:
        """Check that values given for each agent are ``n``.

        Raises
        ------
        InvalidInput
            When they are another number.
        """
        Held.check_count(self, n)
        check_each("SafetyFilter", "acceleration", self.acceleration, n)

    @property
    def summary(self) -> str:
        """As that of `Held`, with ``behind a safety filter``."""
        return f"control held for {span(self.period)} behind a safety filter{self._delays_in_words}"

    @property
    def symmetries(self) -> frozenset[str]:
        """Relabelling as of held control, and Galilean shifts unless its form is that of stopping paths."""
        kept = {"relabelling"} if self.form == "stopping" else {"relabelling", "galilean"}
        return super().symmetries & kept

    @property
    def guarded_distance(self) -> float:
        """The distance that the conditions keep, a millionth larger than `distance`."""
        return self.distance * (1.0 + MARGIN)

    @property
    def balls(self) -> tuple[Ball, ...]:
        """The obstacles that are balls."""
        return tuple(x for x in self.obstacles if isinstance(x, Ball))

    @property
    def walls(self) -> tuple[Wall, ...]:
        """The obstacles that are walls."""
        return tuple(x for x in self.obstacles if isinstance(x, Wall))

    @property
    def margin_of_obstacles(self) -> float:
        """The distance that is kept from obstacles: `clearance`, or half of `distance`."""
        return 0.5 * self.distance if self.clearance is None else self.clearance

    @property
    def guarded_clearance(self) -> float:
        """The distance from obstacles that the conditions keep, a millionth larger."""
        return self.margin_of_obstacles * (1.0 + MARGIN)

    def reserve(self, along: Array, closing: Array, braking: Array) -> Array:
        """Distance that two agents have left when both brake along a line from now on.

        Parameters
        ----------
        along, closing
            Distance along the line, and speed at which it shrinks.
        braking
            Sum of the largest accelerations of both.
        """
        return np.asarray(along - self.guarded_distance - np.maximum(closing, 0.0) ** 2 / (2.0 * braking))

    def accelerations(self, n: int) -> Array:
        """Largest acceleration of each of ``n`` agents, shape (N,)."""
        return np.broadcast_to(np.asarray(self.acceleration, dtype=np.float64), n)
