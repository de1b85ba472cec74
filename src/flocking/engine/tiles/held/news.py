"""What the control kernel reads about messages, and the messages that it cannot follow."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array, Reals
from flocking.errors import InvalidInput
from flocking.model.law import Scenario
from flocking.model.world.information import Messages
from flocking.model.world.losses import Bernoulli, DistanceLoss, GilbertElliott, Loss

MOST_SAMPLES = 1 << 30
"""Samples of an agent that kernels distinguish, see `flocking.engine.tiles.kernels.heard_samples.BEST`."""

WORTH_FETCHING = 1.0 / 32.0
"""Share of its neighbours that must use a sample for it to be fetched before its use: a line of memory has two agents
with some six neighbours each, so that below it two of three lines would be fetched in vain."""

MOST_FETCHED = 6
"""Most samples of an agent that are fetched before their use: with more, those of a tile would fill much of the first
cache of a processor."""

TYPICAL_LOSS = 0.2
"""Share of lost messages that is assumed where it depends on distances or on the messages before."""


class News(NamedTuple):
    """What the control kernel reads about messages; arrays of length 1 where all agents are alike, else by place.

    Parameters
    ----------
    now
        Nanoseconds from the start.
    counts
        How many samples of each agent may have arrived.
    slots
        Place of the newest of them.
    ages, periods
        Its age, and the time between two, in nanoseconds.
    fresh
        How many of them, counted back from the newest, have not expired.
    start
        1 while the exact state that everyone has of everyone at the start has not expired, else 0.
    depth, size
        Number of places for samples of each agent, and rows of one place.
    delay, jitter
        Times of messages in nanoseconds.
    key, key2
        Words of the seed.
    loss
        Numbers of the loss, see `loss_numbers`.
    truth
        True states at the samples, in the form of these, shape (rows, 2m).
    tested
        Number of the newest sample that was looked at for every entry of the lists before, at a time when its messages
        had arrived if ever they would; 0 where that is not known.
    ahead, older
        How many tiles before its use the older samples of a tile are fetched, and how many of each agent: what these
        are changes no result.
    """

    now: float
    counts: NDArray[np.uint32]
    slots: NDArray[np.uint32]
    ages: Array
    periods: Array
    fresh: NDArray[np.uint32]
    start: int
    depth: int
    size: int
    delay: float
    jitter: float
    key: int
    key2: int
    loss: Array
    truth: Reals
    tested: int
    ahead: int
    older: int


def is_plain(loss: Loss | None) -> bool:
    """Whether a loss is of the commonest form, see `flocking.engine.tiles.kernels.heard_samples.HeardSamples`."""
    if isinstance(loss, GilbertElliott):
        return loss.loss_good == 0.0 and loss.loss_bad == 1.0
    return isinstance(loss, DistanceLoss) and loss.exponent == 2.0


def loss_numbers(loss: Loss | None) -> Array:
    """Numbers of a loss as the control kernel reads them."""
    if isinstance(loss, Bernoulli):
        return np.array([loss.probability])
    if isinstance(loss, DistanceLoss):
        return np.array([loss.floor, loss.exponent, 2.0 * math.log(loss.range), loss.range**-2.0])
    if isinstance(loss, GilbertElliott):
        redrawn, share = loss.redraws
        return np.array([loss.loss_good, loss.loss_bad, redrawn, loss.stationary_bad, share])
    return np.zeros(1)


def older_places(loss: Loss | None, jitter: float, period: float) -> int:
    """How many samples of each agent before the newest are used by enough others to be fetched before their use.

    Parameters
    ----------
    loss
        The loss of messages; None for none.
    jitter, period
        Largest delay that is drawn, and time between two samples, in nanoseconds.
    """
    lost = TYPICAL_LOSS
    if loss is None:
        lost = 0.0
    elif isinstance(loss, Bernoulli):
        lost = loss.probability
    by_loss = next((k for k in range(MOST_FETCHED) if lost ** (k + 1) < WORTH_FETCHING), MOST_FETCHED)
    return min(by_loss + math.ceil(jitter / period), MOST_FETCHED)


def check_messages(scenario: Scenario) -> None:
    """Refuse messages that need samples of any age, true distances at times of others, or too many numbers.

    Raises
    ------
    InvalidInput
        When they do; the message names the field.
    """
    messages = scenario.information
    if not isinstance(messages, Messages):
        return
    loss = messages.loss
    count = (scenario.t_end - scenario.start.t) / float(np.min(messages.period))
    if count >= MOST_SAMPLES:
        raise InvalidInput(
            "Messages", "period", f"must give fewer than {MOST_SAMPLES:,} samples until t_end in engine='tiles'",
            messages.period, "Its kernels number samples by 30 bits.",
        )  # fmt: skip
    if loss is not None and not loss.ideal:
        if messages.leader:
            raise InvalidInput(
                "Messages", "loss", "must be left out with leader=True in engine='tiles'", loss.summary,
                "Samples are kept for a bounded time there, and leaders send none that expire: use engine='sampled'.",
            )  # fmt: skip
        if not isinstance(loss, Bernoulli | GilbertElliott | DistanceLoss):
            raise InvalidInput("Messages", "loss", "must be one of this library in engine='tiles'", type(loss).__name__)
        if messages.expires is None:
            raise InvalidInput(
                "Messages", "expires", "must be given in engine='tiles' where messages may be lost", None,
                "Samples are kept for a bounded time: give the age from which one is not used any more.",
            )  # fmt: skip
        if isinstance(loss, DistanceLoss) and (np.ptp(messages.period) > 0.0 or np.ptp(messages.phase) > 0.0):
            raise InvalidInput(
                "Messages", "phase", "must be that of all agents in engine='tiles' where losses depend on distances",
                "one for each", "Distances are known at common times.",
            )  # fmt: skip
