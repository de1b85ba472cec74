"""Which messages are lost: independently, in bursts, or more often from far away."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.errors import InvalidInput
from flocking.formula.safe_digits import compared_texts
from flocking.model.checks import Array, number, truth
from flocking.model.parts import values
from flocking.model.parts.description import Group, Short, add_group
from flocking.model.parts.registration import register_part
from flocking.model.world.random_numbers import Purpose, uniform

LEAST_REDRAWN = 1e-3
"""Least probability that the state of a channel is drawn anew at a sample: one looks back over 1,000 on average."""

Lost = NDArray[np.bool_]
"""Whether a message is lost."""


class Loss(ABC):
    """States which messages are lost: a function of the seed, the two agents and the index of the sample."""

    reads_distance: bool = False
    """Whether it needs the distance at which the message was sent."""

    @property
    @abstractmethod
    def ideal(self) -> bool:
        """Whether nothing is ever lost."""

    @property
    @abstractmethod
    def summary(self) -> str:
        """What is lost, in a few words."""

    @abstractmethod
    def lost(
        self, seed: int, sender: NDArray[np.int64], receiver: NDArray[np.int64], sample: NDArray[np.int64],
        distance: Array | None = None,
    ) -> Lost:  # fmt: skip
        """Which messages are lost.

        Parameters
        ----------
        seed
            Seed of the world.
        sender, receiver, sample
            The agents, and the index of the sample that is sent, arrays of one shape.
        distance
            True distance of the two agents when the sample was taken; None unless `reads_distance`.
        """


def _bernoulli(share: object) -> Bernoulli:
    assert isinstance(share, int | float)
    return Bernoulli(float(share))


add_group(Group("loss", Loss, short=Short(values.number_from(0.0, 1.0), _bernoulli)))


def _ordered(
    paired: bool, sender: NDArray[np.int64], receiver: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The two agents in the order in which draws name them: smaller first where both directions share a draw."""
    return (np.minimum(sender, receiver), np.maximum(sender, receiver)) if paired else (sender, receiver)


@register_part("bernoulli")
@dataclass(frozen=True)
class Bernoulli(Loss):
    """Each message is lost with one probability, independently of all others.

    Parameters
    ----------
    probability
        Probability of a loss, from 0 to 1.
    paired
        Whether messages about the samples of two agents that have the same number are lost in both directions at once,
        also where they are taken at different times; else each direction by itself.

    Raises
    ------
    InvalidInput
        When the probability is not from 0 to 1.
    """

    probability: float
    paired: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "paired", truth("Bernoulli", "paired", self.paired))
        object.__setattr__(self, "probability", probability("Bernoulli", "probability", self.probability))

    @property
    def ideal(self) -> bool:
        """Whether the probability is zero."""
        return self.probability == 0.0

    @property
    def summary(self) -> str:
        """Share that is lost."""
        return f"{share_text(self.probability)} of them lost"

    def lost(
        self, seed: int, sender: NDArray[np.int64], receiver: NDArray[np.int64], sample: NDArray[np.int64],
        distance: Array | None = None,
    ) -> Lost:  # fmt: skip
        """Those whose draw lies below the probability."""
        i, j = _ordered(self.paired, sender, receiver)
        return np.asarray(uniform(seed, Purpose.LOSS, i, j, sample) < self.probability)


@register_part("gilbert-elliott")
@dataclass(frozen=True)
class GilbertElliott(Loss):
    """Losses in bursts: each link has a channel that is good or bad, which changes from sample to sample.

    The channel is a Markov chain that begins in its stationary law (Gilbert 1960, Elliott 1963). Its state at any
    sample follows from draws about that link alone, by looking back to the last draw that does not depend on the state
    before.

    Parameters
    ----------
    to_bad, to_good
        Probabilities that a good channel turns bad and a bad one good, from one sample to the next; their sum is
        from 0.001 to 1.999, or 2, so that the state is found within some thousand samples.
    loss_good, loss_bad
        Probabilities of a loss in either state.
    paired
        Whether both directions of a link share one channel and its losses, by the number of the sample, also where two
        agents take theirs at different times.

    Raises
    ------
    InvalidInput
        When a probability is not from 0 to 1, or their sum is out of range.
    """

    to_bad: float
    to_good: float
    loss_good: float = 0.0
    loss_bad: float = 1.0
    paired: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "paired", truth("GilbertElliott", "paired", self.paired))
        for name in ("to_bad", "to_good", "loss_good", "loss_bad"):
            object.__setattr__(self, name, probability("GilbertElliott", name, getattr(self, name)))
        leave = self.to_bad + self.to_good
        if leave < LEAST_REDRAWN or 2.0 - LEAST_REDRAWN < leave < 2.0:
            raise InvalidInput(
                "GilbertElliott", "to_bad",
                f"must give, with to_good, a sum from {LEAST_REDRAWN:g} to {2 - LEAST_REDRAWN:g}, or 2", leave,
                "Its state is found by looking back to the last sample that does not depend on the one before. "
                "For a channel that hardly changes use Bernoulli for each link.",
            )  # fmt: skip

    @property
    def stationary_bad(self) -> float:
        """Share of samples at which a channel is bad."""
        return self.to_bad / (self.to_bad + self.to_good)

    @property
    def stationary_loss(self) -> float:
        """Share of messages that are lost in the long run."""
        bad = self.stationary_bad
        return bad * self.loss_bad + (1.0 - bad) * self.loss_good

    @property
    def ideal(self) -> bool:
        """Whether nothing is lost in either state."""
        return self.loss_good == self.loss_bad == 0.0

    @property
    def summary(self) -> str:
        """Share that is lost in the long run."""
        return f"{share_text(self.stationary_loss)} of them lost in bursts"

    @property
    def redraws(self) -> tuple[float, float]:
        """Probability that a sample draws the state anew, and that it is bad then; -1 where each state is left at once.

        With a sum of `to_bad` and `to_good` up to 1 a sample redraws from the stationary law or keeps the state; beyond
        1 it redraws or flips it.
        """
        leave = self.to_bad + self.to_good
        if leave <= 1.0:
            return leave, self.stationary_bad
        return (2.0 - leave, (1.0 - self.to_good) / (2.0 - leave)) if leave < 2.0 else (-1.0, 0.0)

    def bad(self, seed: int, sender: NDArray[np.int64], receiver: NDArray[np.int64], sample: NDArray[np.int64]) -> Lost:
        """Whether the channel of each link is bad at a sample.

        Parameters
        ----------
        seed, sender, receiver, sample
            As for `lost`.
        """
        i, j = _ordered(self.paired, sender, receiver)
        leave = self.to_bad + self.to_good
        redraws, law = self.redraws
        shape = np.broadcast_shapes(np.shape(i), np.shape(j), np.shape(sample))
        i, j, at = (np.broadcast_to(x, shape).ravel() for x in (i, j, sample))
        at = at.copy()
        found, flips = np.zeros(at.size, dtype=bool), np.zeros(at.size, dtype=bool)
        if leave == 2.0:
            flips, at = at % 2 == 1, np.zeros_like(at)
        open_ = np.arange(at.size)
        while open_.size:
            draw = uniform(seed, Purpose.CHANNEL, i[open_], j[open_], at[open_])
            first = at[open_] <= 0
            chance = np.where(first, 1.0, redraws)
            settled = draw < chance
            share = np.where(first, self.stationary_bad, law)
            chosen = open_[settled]
            found[chosen] = (draw[settled] < chance[settled] * share[settled]) ^ flips[chosen]
            open_ = open_[~settled]
            at[open_] -= 1
            if leave > 1.0:
                flips[open_] ^= True
        return found.reshape(shape)

    def lost(
        self, seed: int, sender: NDArray[np.int64], receiver: NDArray[np.int64], sample: NDArray[np.int64],
        distance: Array | None = None,
    ) -> Lost:  # fmt: skip
        """Those whose draw lies below the probability of the state of their channel."""
        i, j = _ordered(self.paired, sender, receiver)
        chance = np.where(self.bad(seed, sender, receiver, sample), self.loss_bad, self.loss_good)
        return np.asarray(uniform(seed, Purpose.LOSS, i, j, sample) < chance)


@register_part("distance")
@dataclass(frozen=True)
class DistanceLoss(Loss):
    """Loss that grows with the distance: probability ``1 - (1 - floor) exp(-(r/range)**exponent)``.

    The distance r is the true one when the sample is taken. With exponent 2 this is the outage probability of a
    Rayleigh fading channel in free space, where the received power falls with the square of the distance.

    Parameters
    ----------
    range
        Distance at which a share 1/e of the messages that survive the floor arrives; positive.
    exponent
        Path-loss exponent; positive.
    floor
        Probability of a loss at no distance, from 0 to 1.
    paired
        Whether messages about the samples of two agents that have the same number are lost by the same draw, also where
        they are taken at different times.

    Raises
    ------
    InvalidInput
        When the range or the exponent is not positive, or the floor is not from 0 to 1.
    """

    range: float
    exponent: float = 2.0
    floor: float = 0.0
    paired: bool = False
    reads_distance = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "paired", truth("DistanceLoss", "paired", self.paired))
        object.__setattr__(self, "range", number("DistanceLoss", "range", self.range, above=0.0))
        object.__setattr__(self, "exponent", number("DistanceLoss", "exponent", self.exponent, above=0.0))
        object.__setattr__(self, "floor", probability("DistanceLoss", "floor", self.floor))

    @property
    def ideal(self) -> bool:
        """False."""
        return False

    @property
    def summary(self) -> str:
        """That losses grow with the distance."""
        return f"more of them lost the further apart (range {self.range:g})"

    def probability_at(self, distance: Array) -> Array:
        """Probability of a loss at each distance."""
        return np.asarray(1.0 - (1.0 - self.floor) * np.exp(-((distance / self.range) ** self.exponent)))

    def lost(
        self, seed: int, sender: NDArray[np.int64], receiver: NDArray[np.int64], sample: NDArray[np.int64],
        distance: Array | None = None,
    ) -> Lost:  # fmt: skip
        """Those whose draw lies below the probability at their distance.

        Raises
        ------
        InvalidInput
            When no distance is given.
        """
        if distance is None:
            raise InvalidInput("DistanceLoss", "distance", "must be given", distance)
        i, j = _ordered(self.paired, sender, receiver)
        return np.asarray(uniform(seed, Purpose.LOSS, i, j, sample) < self.probability_at(distance))


def share_text(share: float) -> str:
    """A share in a few digits, and in more where these would round to all.

    Parameters
    ----------
    share
        From 0 to 1.
    """
    return compared_texts(share, 1.0)[0]


def probability(owner: str, name: str, value: object) -> float:
    """A probability.

    Parameters
    ----------
    owner, name
        The part and its parameter, for messages.

    Raises
    ------
    InvalidInput
        When it is not from 0 to 1.
    """
    found = number(owner, name, value, least=0.0)
    if found > 1.0:
        raise InvalidInput(owner, name, "must be a probability, from 0 to 1", value)
    return found
