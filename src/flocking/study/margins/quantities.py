"""Quantities of the world that are varied one at a time, each with its base world and its grid of levels."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.bodies.actuators import Limited
from flocking.model.checks import number
from flocking.model.law import Scenario
from flocking.model.world.control import Control, Held
from flocking.model.world.information import Delayed, Messages
from flocking.model.world.losses import Bernoulli
from flocking.model.world.noises import Noise, WhiteNoise
from flocking.model.world.times import NANOSECOND

ROUNDED = 1e-9
"""Relative difference by which a level may lie outside its ends and count as one of them."""

MOST_DIGITS = 15
"""Digits of a double that are the same after it is written and read."""

UNRESOLVED = 1e-4
"""Share of a level by which it may differ from what is simulated: the fourth digit, as levels between others have."""

PERIODS = 1000
"""Ticks of the base world in the duration of a scenario, about: few enough that a run of ten agents takes seconds."""

FINEST, COARSEST = 500, 10
"""The shortest and the longest period on the default grid are this part of the duration: fewer ticks show little."""

LONGEST_DELAY = 20
"""The longest delay on the default grid is this part of the duration."""

WIDEST_GAP = 2.5
"""Largest ratio of neighbours among the numbers 1, 2 and 5 times a power of ten."""

LOSSES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
"""Default grid of the probability of a loss."""

SPANS = 1e-3, 1.0
"""Least and largest standard deviation on the default grid, as shares of the scale of positions or of velocities."""

FORCES = 10.0, 1e-3
"""Largest and least limit on the default grid, as multiples of the largest force at the start."""


@dataclass(frozen=True)
class Quantity:
    """A quantity of the world that can be varied.

    Parameters
    ----------
    name
        Its name; letters, digits and ``-``.
    meaning
        What it is, in a few words.
    world
        Gives the scenario with a value of the quantity, from a scenario, the value and the base period. What the
        scenario's own control and information state stays; what they lack is the base world.
    levels
        Gives the default grid, from the ideal value outwards, from a scenario and the base period.
    falling
        Whether smaller values are further from the ideal one, as for a limit.
    resolution
        Values are whole multiples of this, as times are of a nanosecond; 0 where they are not rounded.
    unvaried
        Value at which nothing but the base world is left, 0 as of a loss; None where there is none, as for a period.
        A conclusion that is refuted at the first level is looked at there before the quantity is given the blame.
    """

    name: str
    meaning: str
    world: Callable[[Scenario, float, float], Scenario]
    levels: Callable[[Scenario, float], tuple[float, ...]]
    falling: bool = False
    resolution: float = 0.0
    unvaried: float | None = None

    def resolved(self, level: float) -> float:
        """The value that is simulated for a ``level``."""
        if not self.resolution:
            return level
        return float(f"{round(level / self.resolution) * self.resolution:.{MOST_DIGITS}g}")

    def is_resolved(self, level: float) -> bool:
        """Whether what is simulated for a ``level`` is that value, to the fourth digit."""
        return level == 0.0 or abs(self.resolved(level) - level) <= UNRESOLVED * level


def rounded_levels(low: float, high: float) -> tuple[float, ...]:
    """The numbers 1, 2 and 5 times a power of ten from ``low`` to ``high``, ascending."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    found = [float(f"{digit}e{power}") for power in range(first, last + 1) for digit in (1, 2, 5)]
    return tuple(x for x in found if low * (1 - ROUNDED) <= x <= high * (1 + ROUNDED))


def base_period(scenario: Scenario) -> float:
    """The period of the base world of a scenario: its own, or one that gives about `PERIODS` ticks.

    Raises
    ------
    InvalidInput
        When the run is so short that this is less than a nanosecond.
    """
    for part in (scenario.control, scenario.information):
        if isinstance(part, Held | Messages):
            return float(np.max(part.period))
    length = scenario.t_end - scenario.start.t
    if length / PERIODS < NANOSECOND:
        rule = f"must be at least {PERIODS * NANOSECOND:g} after the start, or period must be given"
        raise InvalidInput("margins", "t_end", rule, scenario.t_end, "Runs need time for controls and messages.")
    return max(rounded_levels(length / PERIODS / 10, length / PERIODS))


def held(scenario: Scenario, period: float) -> Held:
    """Control of the base world: the scenario's own held control, or one of this ``period``."""
    return scenario.control if isinstance(scenario.control, Held) else Held(period)


def control_beside_messages(scenario: Scenario, period: float) -> Control:
    """Control beside messages: the scenario's own where it has messages, else held for the base ``period``."""
    return scenario.control if isinstance(scenario.information, Messages) else held(scenario, period)


def messages(scenario: Scenario, period: float) -> Messages:
    """Messages of the base world: the scenario's own, or exact ones of this ``period`` that arrive at once."""
    return scenario.information if isinstance(scenario.information, Messages) else Messages(period)


def _with_period(scenario: Scenario, value: float, _: float) -> Scenario:
    control, information = control_beside_messages(scenario, value), scenario.information
    if isinstance(control, Held):
        control = replace(control, period=value)
    if isinstance(information, Messages):
        information = replace(information, period=value)
    return scenario.with_(control=control, information=information)


def _with_latency(scenario: Scenario, value: float, period: float) -> Scenario:
    return scenario.with_(control=replace(held(scenario, period), latency=value))


def _with_messages(scenario: Scenario, period: float, **changes: object) -> Scenario:
    if isinstance(scenario.information, Delayed) and not scenario.information.ideal:
        raise UnsupportedLaw(
            f"{', '.join(changes)} is a property of messages, and this scenario has Delayed knowledge, which messages "
            "would replace. Vary delay, or give it Messages."
        )
    information = replace(messages(scenario, period), **changes)  # type: ignore[arg-type]
    return scenario.with_(control=control_beside_messages(scenario, period), information=information)


def _with_delay(scenario: Scenario, value: float, period: float) -> Scenario:
    if isinstance(scenario.information, Delayed):
        if scenario.information.of_pairs:
            raise UnsupportedLaw(
                "delay is one number, and this scenario has a delay for every pair, which it would replace. Give it "
                "one delay, or leave delay out."
            )
        return scenario.with_(information=replace(scenario.information, tau=value))
    return _with_messages(scenario, period, delay=value)


def _with_loss(scenario: Scenario, value: float, period: float) -> Scenario:
    own = messages(scenario, period).loss
    paired = isinstance(own, Bernoulli) and own.paired
    return _with_messages(scenario, period, loss=Bernoulli(value, paired) if value else None)


def _noise(scenario: Scenario, period: float, **changes: float) -> Noise:
    """The scenario's own noise, or white one where it has none, with another standard deviation."""
    return replace(messages(scenario, period).noise or WhiteNoise(), **changes)  # type: ignore[type-var]


def _with_noise(scenario: Scenario, value: float, period: float) -> Scenario:
    return _with_messages(scenario, period, noise=_noise(scenario, period, position=value))


def _with_velocity_noise(scenario: Scenario, value: float, period: float) -> Scenario:
    return _with_messages(scenario, period, noise=_noise(scenario, period, velocity=value))


def _with_limit(scenario: Scenario, value: float, _: float) -> Scenario:
    return scenario.with_(agents=Limited(scenario.agents, force=value))


def _periods(scenario: Scenario, _: float) -> tuple[float, ...]:
    length = scenario.t_end - scenario.start.t
    return rounded_levels(length / FINEST, length / COARSEST)


def _delays(scenario: Scenario, period: float) -> tuple[float, ...]:
    length = scenario.t_end - scenario.start.t
    least, longest = period / 2, max(period, length / LONGEST_DELAY)
    # From half a period to a whole one there may be no round number: then the next one.
    return (0.0, *(rounded_levels(least, longest) or rounded_levels(least, WIDEST_GAP * least)))


def _position_noises(scenario: Scenario, _: float) -> tuple[float, ...]:
    return _noises(_scale(scenario.start.q) or _natural(scenario)[0])


def _velocity_noises(scenario: Scenario, _: float) -> tuple[float, ...]:
    return _noises(_scale(scenario.start.p) or _natural(scenario)[1])


def _natural(scenario: Scenario) -> tuple[float, float]:
    """Sizes of distances and velocities that are not zero, from the start and the duration; 1 where agents are as one.

    A group at rest has the velocity that takes an agent through it in the duration.
    """
    from flocking.engine.adaptive_steps.state_tolerances import natural_sizes

    length, speed = natural_sizes(scenario.start, scenario.t_end - scenario.start.t)
    return length or 1.0, speed or 1.0


def _noises(scale: float) -> tuple[float, ...]:
    return (0.0, *rounded_levels(SPANS[0] * scale, SPANS[1] * scale))


def _scale(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
    """Root mean square distance of rows from their mean; 0 where all are equal."""
    return float(np.sqrt(((values - values.mean(axis=0)) ** 2).sum(axis=1).mean()))


def _limits(scenario: Scenario, _: float) -> tuple[float, ...]:
    from flocking.engine.reference.control import control

    forces = control(scenario.law, scenario.start, agents=scenario.agents, space=scenario.space)
    largest = float(np.linalg.norm(forces, axis=1).max()) or 1.0
    return rounded_levels(FORCES[1] * largest, FORCES[0] * largest)[::-1]


def default_levels(quantity: Quantity, scenario: Scenario, period: float) -> list[float]:
    """The default grid of a quantity, without levels that would be rounded, as times shorter than a nanosecond.

    Parameters
    ----------
    quantity
        The quantity.
    scenario, period
        The scenario and the base period.

    Raises
    ------
    InvalidInput
        When none is left but the value at which nothing is varied.
    """
    found = [level for level in quantity.levels(scenario, period) if quantity.is_resolved(level)]
    if not set(found) - {quantity.unvaried}:
        rule = f"must be given: of the default grid none is a whole multiple of {quantity.resolution:g}"
        raise InvalidInput("margins", f"levels[{quantity.name!r}]", rule, list(quantity.levels(scenario, period)))
    return found


def checked_levels(name: str, given: Sequence[float], quantity: Quantity) -> list[float]:
    """The levels of a quantity that are given, in order from the ideal one outwards.

    Parameters
    ----------
    name, quantity
        The quantity and its name.
    given
        The levels.

    Raises
    ------
    InvalidInput
        When one is negative, there are none, one is given twice, or it would be rounded.
    """
    found = [number("margins", f"levels[{name!r}]", value, least=0.0) for value in given]
    if not found or len(set(found)) < len(found):
        raise InvalidInput("margins", f"levels[{name!r}]", "must hold different levels, at least one", list(given))
    for level in found:
        if not quantity.is_resolved(level):
            rule = f"must be 0 or whole multiples of {quantity.resolution:g}, to which levels are rounded"
            raise InvalidInput("margins", f"levels[{name!r}]", rule, level)
    return sorted(found, reverse=quantity.falling)


_quantities: dict[str, Quantity] = {}


def register_quantity(quantity: Quantity) -> Quantity:
    """Make a quantity known by its name to `margins` and to ``flocking margins --vary``.

    Parameters
    ----------
    quantity
        The quantity; one that has its name is replaced.

    Raises
    ------
    InvalidInput
        When it is none, its name has other characters than letters, digits and ``-``, or nothing of it is varied at
        another value than 0, the one that is nearest to the ideal world.
    """
    if not isinstance(quantity, Quantity):
        raise InvalidInput("register_quantity", "quantity", "must be a Quantity", quantity)
    if not quantity.name.replace("-", "").isalnum():
        raise InvalidInput("register_quantity", "name", "must have letters, digits and '-' alone", quantity.name)
    if quantity.unvaried is not None and (quantity.falling or quantity.unvaried != 0.0):
        raise InvalidInput(
            "register_quantity", "unvaried", "must be 0, of a quantity that is not falling, or None", quantity.unvaried,
            "Levels go outwards from there, and tables name the level 0: give the difference from such a value.",
        )  # fmt: skip
    _quantities[quantity.name] = quantity
    return quantity


def quantities() -> dict[str, Quantity]:
    """All quantities by name."""
    return dict(_quantities)


def quantity_named(name: str) -> Quantity:
    """The quantity of a name.

    Raises
    ------
    InvalidInput
        When there is none.
    """
    from flocking.model.parts.values import nearest

    if name not in _quantities:
        raise InvalidInput(
            "margins", "vary", f"must be among {', '.join(_quantities)}", name, nearest(name, list(_quantities))
        )
    return _quantities[name]


for _quantity in (
    Quantity("period", "time between two controls of an agent, and between two of its messages where there are any",
             _with_period, _periods, resolution=NANOSECOND),
    Quantity("latency", "time from a control until its force acts", _with_latency, _delays,
             resolution=NANOSECOND, unvaried=0.0),
    Quantity("delay", "time from a sample until it arrives", _with_delay, _delays, resolution=NANOSECOND,
             unvaried=0.0),
    Quantity("loss", "probability that a message is lost, each independently; the last one that came is used",
             _with_loss, lambda scenario, period: LOSSES, unvaried=0.0),
    Quantity("noise", "standard deviation of measured positions along each axis", _with_noise, _position_noises,
             unvaried=0.0),
    Quantity("velocity-noise", "standard deviation of measured velocities along each axis", _with_velocity_noise,
             _velocity_noises, unvaried=0.0),
    Quantity("limit", "largest force of an agent; longer ones are scaled back", _with_limit, _limits, falling=True),
):  # fmt: skip
    register_quantity(_quantity)
