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
