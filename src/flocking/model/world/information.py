"""What agents know of each other, and when: the present, or what messages state that take time and may be lost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, axes_of, check_each, number, one_of, scalar_or_each, truth
from flocking.model.parts import values
from flocking.model.parts.registration import register_part
from flocking.model.parts.seeds import seed_number
from flocking.model.symmetries import DRAWN, SYMMETRIES
from flocking.model.world.control import Control, Held
from flocking.model.world.knowledge import INSTANT, Information, Instant, delays_of_pairs
from flocking.model.world.losses import Bernoulli, Loss, probability
from flocking.model.world.noises import Noise, WhiteNoise
from flocking.model.world.times import NANOSECOND, PeriodicTimes, nanoseconds, shared_times, span

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

SELF_KNOWN = ("true", "measured")
"""What an agent may know of itself: its true state, or its own newest sample."""


@register_part("messages")
@dataclass(frozen=True, eq=False)
class Messages(Information):
    """Agents measure themselves at times phase_j + k period_j and send the samples to all others.

    A sample is the true position and velocity plus noise, rounded to the resolution; those of order 1 send the velocity
    with which they moved until then, zero at the start. It reaches agent i after the delay and a jitter of its own,
    unless it is lost. Agent i uses the newest sample of each other agent by the time at which
    it was taken, held as it is or, with ``predict``, moved on with its velocity. A sample that is ``expires`` old is
    discarded, and its sender with it: link memory is cleared, and a link must appear anew. Under held control links
    follow at the ticks of the receiver alone: one whose sample expired and was replaced between two of them stays as it
    was. At the start everyone has everyone's exact state. Times are rounded to whole nanoseconds from the start. At one
    instant samples are taken first, then they arrive, then they expire, then links follow, then controls are computed
    from what is known. Under continuous control forces and links follow what is known at every moment in between, too.
    Obstacles are known exactly, and so are leaders unless they send messages too; whether an agent is within range of
    an obstacle, and its force, follow from the place and velocity that it knows of itself.

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
        Whether a receiver moves the samples of others on with their velocity; its own one it holds as it is.
    self_known
        ``"true"``: an agent knows its own true state; ``"measured"``: its own newest sample, without delay, held until
        the next one whether or not those of others are moved on.
    seed
        Seed of losses, jitter and noise.
    leader
        Whether leaders of the law are known by messages too: at the same times a sample of the position, velocity and
        acceleration of all of them is sent, with the same delay, jitter and loss, which are drawn for each receiver.
        With ``predict`` it is moved on with velocity and acceleration. Period and phase then are one number; samples
        with errors or an age from which they expire, and losses by distance, are not known of leaders.

    Raises
    ------
    InvalidInput
        When a time is negative or a period not positive, a part is none, or a leader cannot send what is declared.

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
    leader: bool = False

    if TYPE_CHECKING:

        def __init__(
            self,
            period: ArrayLike,
            phase: ArrayLike = 0.0,
            delay: float = 0.0,
            jitter: float = 0.0,
            loss: Loss | float | None = None,
            noise: Noise | float | None = None,
            resolution: float = 0.0,
            velocity_resolution: float = 0.0,
            expires: float | None = None,
            predict: bool = False,
            self_known: str = "true",
            seed: int = 0,
            leader: bool = False,
        ) -> None: ...

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
        object.__setattr__(self, "seed", seed_number("Messages", self.seed))
        one_of("Messages", "self_known", self.self_known, SELF_KNOWN)
        object.__setattr__(self, "leader", truth("Messages", "leader", self.leader))
        if self.leader:
            self._check_leader()

    def _check_leader(self) -> None:
        """Refuse what is not known of the messages of leaders."""
        refused = {
            "period": bool(np.ndim(self.period)), "phase": bool(np.ndim(self.phase)),
            "noise": self.noise is not None and not self.noise.ideal, "resolution": self.resolution > 0.0,
            "velocity_resolution": self.velocity_resolution > 0.0, "expires": self.expires is not None,
            "loss": self.loss is not None and self.loss.reads_distance,
        }  # fmt: skip
        for name, wrong in refused.items():
            if wrong:
                rule = "must be one number" if name in ("period", "phase") else "must be left out"
                raise InvalidInput(
                    "Messages", name, f"{rule} with leader=True", getattr(self, name),
                    "Samples of leaders are exact and kept, are taken at times of their own, and are not lost by "
                    "distance.",
                )  # fmt: skip

    @property
    def ideal(self) -> bool:
        """False."""
        return False

    @property
    def summary(self) -> str:
        """Periods, and whatever else is not as in the ideal world."""
        found = [f"messages every {span(self.period)}"]
        if nanoseconds("Messages", "phase", self.phase).any():
            found.append(f"first at {span(self.phase)}")
        if nanoseconds("Messages", "delay", np.array([self.delay, self.jitter])).any():
            found.append(f"{span([self.delay, self.delay + self.jitter])} late")
        if self.loss is not None and not self.loss.ideal:
            found.append(self.loss.summary)
        if self.noise is not None and not self.noise.ideal:
            found.append(self.noise.summary)
        if self.resolution or self.velocity_resolution:
            found.append(f"rounded to {self.resolution:g} and {self.velocity_resolution:g}")
        if self.expires is not None:
            found.append(f"used up to an age of {self.expires:g}")
        if self.predict:
            found.append("moved on with the velocity sent")
        if self.self_known == "measured":
            found.append("the own state measured")
        if self.leader:
            found.append("leaders known by them too")
        return ", ".join(found)

    @property
    def symmetries(self) -> frozenset[str]:
        """Locality, and what the samples keep.

        Momentum where all agents, themselves included, are known as they were at one moment; Galilean shifts there, and
        where samples are moved on beside true own states, unless they are rounded; rotation where they have no errors;
        relabelling where nothing is drawn and all send at the same times.
        """
        at_one_time = shared_times(self.period, self.phase) is not None
        of_one_moment = at_one_time and self._all_arrive_at_once and self.self_known == "measured" and not self.predict
        moved_on = self.predict and self.self_known == "true"
        lost = set() if of_one_moment else {"momentum"}
        if self._rounds or not (of_one_moment or moved_on):
            lost.add("galilean")
        if self._rounds:
            lost.add("rotation")
        if self.jitter or self._loses or not at_one_time:
            lost.add("relabelling")
        return SYMMETRIES - lost - (DRAWN if self._noisy else set())

    @property
    def errors_of_positions(self) -> str:
        """Noise and rounding of positions."""
        noise = 0.0 if self.noise is None else self.noise.position
        found = [f"noise of {noise:g} in positions"] if noise else []
        return " and ".join(found + ([f"positions rounded to {self.resolution:g}"] if self.resolution else []))

    @property
    def _rounds(self) -> bool:
        return self.resolution > 0.0 or self.velocity_resolution > 0.0

    @property
    def _loses(self) -> bool:
        return self.loss is not None and not self.loss.ideal

    @property
    def _noisy(self) -> bool:
        return self.noise is not None and not self.noise.ideal

    @property
    def _all_arrive_at_once(self) -> bool:
        """Whether every sample is known to everybody when it is taken."""
        return not (self.delay or self.jitter or self._loses)

    def _taken_at_ticks(self, control: Control) -> bool:
        """Whether every tick of held ``control`` is a time at which all take samples, known at once."""
        taken = shared_times(self.period, self.phase)
        ticks = shared_times(control.period, control.phase) if isinstance(control, Held) else None
        if taken is None or ticks is None or not self._all_arrive_at_once:
            return False
        since = ticks[1] - taken[1]
        return since >= 0 and since % taken[0] == 0 and ticks[0] % taken[0] == 0

    def symmetries_under(self, control: Control) -> frozenset[str]:
        """Also Galilean shifts with samples of the tick, unless rounded, and momentum where both ends know the same."""
        kept = set(self.symmetries)
        if self._taken_at_ticks(control):
            if not self._rounds:
                kept.add("galilean")
            if self.self_known == "measured" or not (self._rounds or self._noisy):
                kept.add("momentum")
        return frozenset(kept)

    def keeps_uniform_motion(self, control: Control, pursued: bool) -> bool:
        """Of leaders that are ``pursued`` where they are known at the moment for which agents know themselves."""
        at_one_moment = self.leader or self.self_known == "true" or self._taken_at_ticks(control)
        return super().keeps_uniform_motion(control, pursued) and (at_one_moment or not pursued)

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
@dataclass(frozen=True, eq=False)
class Delayed(Information):
    """Every agent knows its neighbours as they were a time ``tau`` ago, at every moment.

    Agent i computes its force at time t from q_j(t - tau) and p_j(t - tau), and links follow from the distances that it
    knows. Before the start agents are taken to have moved in straight lines, q(t) = q(t0) + (t - t0) p(t0); agents of
    order 1 to have stood still. Leaders and obstacles are known without delay, and physical damping acts at once.
    Without ``self_delayed`` the world's rest frame matters: a flock that moves is braked (see the page on the world).

    Parameters
    ----------
    tau
        The delay, in the unit of time; not negative. One number, or one for every ordered pair of agents, shape (N, N):
        agent i, of row i, knows agent j, of column j, as it was tau[i, j] ago. Zeros mean the present state. The
        diagonal is how late agents know themselves, and is zero unless they are ``self_delayed``.
    self_delayed
        Whether an agent knows itself, too, only as it was ``tau`` ago, so that differences are of one moment, and it
        meets obstacles, which are where they are now, at the place where it was. With a
        delay for every pair it was tau[i, i] ago, for all terms of the law: differences are of one moment where the
        row of the agent has one value.

    Raises
    ------
    InvalidInput
        When a delay is negative or not finite, or the matrix is not square; when its diagonal is not zero though agents
        know their present state, or zero though they do not.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Delayed(0.1).summary
    'neighbours known 0.1 late'
    >>> fk.Delayed([[0.0, 0.1], [0.4, 0.0]]).summary
    'neighbours known 0.1 to 0.4 late'
    """

    tau: Annotated[float | Array, values.NUMBER_OR_ROWS]
    self_delayed: bool = False

    if TYPE_CHECKING:

        def __init__(self, tau: ArrayLike, self_delayed: bool = False) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "self_delayed", truth("Delayed", "self_delayed", self.self_delayed))
        one = axes_of(self.tau) == 0
        tau = number("Delayed", "tau", self.tau, least=0.0) if one else delays_of_pairs(self.tau, self.self_delayed)
        object.__setattr__(self, "tau", tau)

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self.self_delayed == other.self_delayed and np.array_equal(self.tau, other.tau)

    def __hash__(self) -> int:
        return hash(((np.asarray(self.tau) + 0.0).tobytes(), self.self_delayed))  # -0.0 equals 0.0.

    @property
    def of_pairs(self) -> bool:
        """Whether there is a delay for every pair of agents."""
        return bool(np.ndim(self.tau))

    @property
    def ideal(self) -> bool:
        """Whether there is no delay."""
        return self.largest == 0.0

    @property
    def largest(self) -> float:
        """The largest delay, in the unit of time."""
        return float(np.max(self.tau))

    @property
    def least(self) -> float:
        """The least delay that is not zero, in the unit of time; zero where there is none."""
        delays = np.ravel(self.tau)
        return float(min(delays[delays > 0.0], default=0.0))

    @property
    def symmetries(self) -> frozenset[str]:
        """All where all agents are known as they were at one moment.

        Else momentum is lost, and so are Galilean shifts unless each agent knows itself as late as all others, and
        relabelling where delays differ between pairs.
        """
        if self.ideal:
            return SYMMETRIES
        tau = np.asarray(self.tau)
        lost: set[str] = set()
        if not self.self_delayed or np.ptp(tau):
            lost.add("momentum")
        if not self.self_delayed or (self.of_pairs and np.ptp(tau, axis=1).any()):
            lost.add("galilean")
        if self.of_pairs:
            own = np.eye(len(tau), dtype=bool)
            lost |= {"relabelling"} if any(np.ptp(x) for x in (tau[own], tau[~own]) if x.size) else set()
        return SYMMETRIES - lost

    def keeps_uniform_motion(self, control: Control, pursued: bool) -> bool:
        """Not where leaders are ``pursued``, who are known without delay by agents that know themselves late."""
        return self.ideal or (super().keeps_uniform_motion(control, pursued) and not pursued)

    def check_count(self, n: int) -> None:
        """Check that a delay for every pair is given for ``n`` agents.

        Raises
        ------
        InvalidInput
            When the matrix is for another number.
        """
        if self.of_pairs and len(np.asarray(self.tau)) != n:
            rule = f"must be one number, or have shape ({n}, {n}) for {n} agents"
            raise InvalidInput("Delayed", "tau", rule, f"shape {np.shape(self.tau)}")

    @property
    def summary(self) -> str:
        """The delays, and of whom; empty where there is none."""
        if self.ideal:
            return ""
        tau = np.asarray(self.tau)
        shown = tau if self.self_delayed or not self.of_pairs else tau[~np.eye(len(tau), dtype=bool)]
        return f"{'everybody' if self.self_delayed else 'neighbours'} known {span(shown)} late"


__all__ = ["INSTANT", "Delayed", "Information", "Instant", "Messages"]
