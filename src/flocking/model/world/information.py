"""What agents know of each other, and when: the present, or what messages state that take time and may be lost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, check_each, integer, number, one_of, scalar_or_each, truth
from flocking.model.parts import values
from flocking.model.parts.description import Group, add_group
from flocking.model.parts.registration import register_part
from flocking.model.world.losses import Bernoulli, Loss, probability
from flocking.model.world.noises import Noise, WhiteNoise
from flocking.model.world.times import NANOSECOND, PeriodicTimes, nanoseconds
from flocking.model.world.world_part import IdealPart, WorldPart

SELF_KNOWN = ("true", "measured")
"""What an agent may know of itself: its true state, or its own newest sample."""


class Information(WorldPart):
    """What an agent knows of the others when it computes its force."""


add_group(Group("information", Information, default="instant"))


@register_part("instant")
@dataclass(frozen=True)
class Instant(IdealPart, Information):
    """Every agent knows the present positions and velocities of its neighbours exactly."""


INSTANT = Instant()
"""What a scenario has that names no other."""


@register_part("messages")
@dataclass(frozen=True, eq=False)
class Messages(Information):
    """Agents measure themselves at times phase_j + k period_j and send the samples to all others.

    A sample is the true position and velocity plus noise, rounded to the resolution. It reaches agent i after the delay
    and a jitter of its own, unless it is lost. Agent i uses the newest sample of each other agent by the time at which
    it was taken, held as it is or, with ``predict``, moved on with its velocity. A sample that is ``expires``
    old is discarded, and its sender with it: link memory is cleared, and a link must appear anew. At the start everyone
    has everyone's exact state. Times are rounded to whole nanoseconds from the start. At one instant samples are taken
    first, then they arrive, then they expire, then links follow, then controls are computed from what is known. The
    leader and obstacles are known exactly.

    Parameters
    ----------
    period
        Time between two samples, one for all agents or one for each; positive.
    phase
        Time of the first sample after the start, one for all or one for each; not negative.
    delay
        Time from a sample until it arrives; not negative.
    jitter
        Largest further delay, drawn evenly for each message; not negative.
    loss
        Which messages are lost; a number is the probability that each is lost, independently.
    noise
        Errors of the samples; none when absent. A number is the standard deviation of white noise of positions.
    resolution, velocity_resolution
        Positions and velocities are rounded to multiples of these; not where they are zero.
    expires
        Age from which a sample is not used any more; None where it is used until a newer one arrives.
    predict
        Whether a receiver moves samples on with their velocity.
    self_known
        ``"true"``: an agent knows its own true state; ``"measured"``: its own newest sample, without delay.
    seed
        Seed of losses, jitter and noise.

    Raises
    ------
    InvalidInput
        When a time is negative or a period not positive, or a part is none.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Messages(0.1, delay=0.05, loss=0.2).summary
    'messages every 0.1, 0.05 late, 0.2 of them lost'
    """

    period: float | Array
    phase: float | Array = 0.0
    delay: float = 0.0
    jitter: float = 0.0
    loss: Loss | None = None
    noise: Noise | None = None
    resolution: float = 0.0
    velocity_resolution: float = 0.0
    expires: float | None = None
    predict: bool = False
    self_known: Annotated[str, values.choice(*SELF_KNOWN)] = "true"
    seed: Annotated[int, values.SEED] = 0

    def __post_init__(self) -> None:
        nanoseconds("Messages", "period", self.period, positive=True)
        nanoseconds("Messages", "phase", self.phase)
        object.__setattr__(self, "period", scalar_or_each("Messages", "period", self.period, above=0.0))
        object.__setattr__(self, "phase", scalar_or_each("Messages", "phase", self.phase, least=0.0))
        for name in ("delay", "jitter", "resolution", "velocity_resolution"):
            object.__setattr__(self, name, number("Messages", name, getattr(self, name), least=0.0))
        nanoseconds("Messages", "delay", self.delay)
        nanoseconds("Messages", "jitter", self.jitter)
        if isinstance(self.loss, int | float) and not isinstance(self.loss, bool):
            object.__setattr__(self, "loss", Bernoulli(probability("Messages", "loss", self.loss)))
        if isinstance(self.noise, int | float) and not isinstance(self.noise, bool):
            object.__setattr__(self, "noise", WhiteNoise(number("Messages", "noise", self.noise, least=0.0)))
        for name, kind in (("loss", Loss), ("noise", Noise)):
            if not isinstance(getattr(self, name), kind | None):
                raise InvalidInput("Messages", name, f"must be a {name}, or None", getattr(self, name))
        if self.expires is not None:
            object.__setattr__(self, "expires", number("Messages", "expires", self.expires, above=0.0))
            nanoseconds("Messages", "expires", self.expires, positive=True)
        object.__setattr__(self, "predict", truth("Messages", "predict", self.predict))
        object.__setattr__(self, "seed", integer("Messages", "seed", self.seed, least=0))
        if self.seed > values.LARGEST_SEED:
            raise InvalidInput("Messages", "seed", f"must be at most {values.LARGEST_SEED}", self.seed)
        one_of("Messages", "self_known", self.self_known, SELF_KNOWN)

    @property
    def ideal(self) -> bool:
        """False."""
        return False

    @property
    def summary(self) -> str:
        """Period, and whatever else is not zero."""
        found = [f"messages every {float(np.max(self.period)):g}"]
        if self.delay or self.jitter:
            span = f"{self.delay:g} to {self.delay + self.jitter:g}" if self.jitter else f"{self.delay:g}"
            found.append(f"{span} late")
        if self.loss is not None and not self.loss.ideal:
            found.append(self.loss.summary)
        if self.noise is not None and not self.noise.ideal:
            found.append(self.noise.summary)
        if self.resolution or self.velocity_resolution:
            found.append(f"rounded to {self.resolution:g} and {self.velocity_resolution:g}")
        if self.expires is not None:
            found.append(f"used up to an age of {self.expires:g}")
        return ", ".join(found)

    def check_count(self, n: int) -> None:
        """Check that periods and phases given for each agent are ``n``.

        Raises
        ------
        InvalidInput
            When they are another number.
        """
        for name, value in (("period", self.period), ("phase", self.phase)):
            check_each("Messages", name, value, n)

    def schedule(self, n: int) -> PeriodicTimes:
        """Times at which ``n`` agents take samples."""
        return PeriodicTimes(
            np.broadcast_to(nanoseconds("Messages", "period", self.period), n).copy(),
            np.broadcast_to(nanoseconds("Messages", "phase", self.phase), n).copy(),
        )

    @property
    def expires_in_nanoseconds(self) -> int | None:
        """`expires` as a whole number of nanoseconds; None where samples are never discarded."""
        return None if self.expires is None else max(1, round(self.expires / NANOSECOND))


@register_part("delayed")
@dataclass(frozen=True)
class Delayed(Information):
    """Every agent knows its neighbours as they were a time ``tau`` ago, at every moment.

    Agent i computes its force at time t from q_j(t - tau) and p_j(t - tau), and links follow from the distances that it
    knows. Before the start agents are taken to have moved in straight lines, q(t) = q(t0) + (t - t0) p(t0); agents of
    order 1 to have stood still. The leader is known without delay, and physical damping acts at once. Without
    ``self_delayed`` the world's rest frame matters: a flock that moves is braked (see the page on the world).

    Parameters
    ----------
    tau
        The delay, in the unit of time; not negative.
    self_delayed
        Whether an agent knows itself, too, only as it was ``tau`` ago, so that differences are of one moment.

    Raises
    ------
    InvalidInput
        When the delay is negative or not finite.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Delayed(0.1).summary
    'neighbours known 0.1 late'
    """

    tau: float
    self_delayed: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "tau", number("Delayed", "tau", self.tau, least=0.0))
        object.__setattr__(self, "self_delayed", truth("Delayed", "self_delayed", self.self_delayed))

    @property
    def ideal(self) -> bool:
        """Whether there is no delay."""
        return self.tau == 0.0

    @property
    def summary(self) -> str:
        """The delay, and of whom; empty where there is none."""
        if self.ideal:
            return ""
        return f"{'everybody' if self.self_delayed else 'neighbours'} known {self.tau:g} late"
