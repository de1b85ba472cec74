"""The systems of Cucker and Smale: alignment of all pairs with weights that decrease with the distance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flocking.model import starts
from flocking.model.bodies.discrete_bodies import Impulsive
from flocking.model.checks import number
from flocking.model.graphs.all_pairs import Complete
from flocking.model.law import Law, Scenario
from flocking.model.parts.seeds import seeded
from flocking.model.state import State
from flocking.model.terms.alignment import CuckerSmale
from flocking.model.world.control import Held
from flocking.model.world.information import Delayed
from flocking.papers.named_scenarios import scenario_by_name

KEY = "cucker-smale-2007"
CRITICAL, SHARP = f"{KEY}-critical", f"{KEY}-sharp"
PAIR, PARTING = f"{KEY}-pair", f"{KEY}-parting"
DELAYED, REACTION, MONOTONE, UNSTABLE = (f"{KEY}-{x}" for x in ("delayed", "reaction", "monotone", "unstable"))
DISCRETE = f"{KEY}-discrete"

FIGURES = {"A": SHARP, "B": PAIR, "C": MONOTONE}
"""Scenario of each figure of this package; the first of those that it shows."""

AGENTS = 20
"""Number of agents of the groups; the authors simulate none."""
SPREAD = 3.0
"""Radius of the ball in which they start, and their largest speed."""
DURATION = 30.0
"""Duration of the runs, in units of 1/K and more; audits extend it where a limit is not reached."""

PARTING_DURATION = 20000.0
"""Duration of the run of two agents that part, whose relative speed tends to its limit as 1/t."""

MEETING, LEAVING = 1.2, 1.7
"""Relative speeds of two agents that start at one place: below and above K times the integral of psi, pi/2."""

STEP = 0.2
"""Step of the system in discrete time; h times the largest sum of weights is below 1."""

DELAY, DELAYED_EXPONENT = 2.0, 0.4
"""Delay of the neighbours' states and beta for the seed 0; agents know their own state."""
DELAYS, DELAYED_EXPONENTS = (0.1, 6.0), (0.0, 0.5)
"""Ranges from which both are drawn for other seeds: the theorem is about every delay and every beta up to 1/2."""
LATE, MONOTONE_LATE, TOO_LATE = 1.5, 0.36, 1.7
"""Delays of all states for lambda = 1: between 1/e and pi/2, below 1/e, and above pi/2."""
NEAR = 1e-9
"""Distance at which two agents start that the theory starts at one point: their kernels would meet at contact."""


def law(gain: float = 1.0, exponent: float = 0.4, scale: float = 1.0) -> Law:
    """v_i' = sum over all j of K/(sigma^2 + |x_i - x_j|^2)^beta (v_j - v_i), without 1/N.

    Parameters
    ----------
    gain, exponent, scale
        K, beta and sigma.
    """
    return Law(Complete(), (CuckerSmale(gain, exponent, scale),))


@seeded
def group(
    exponent: float, *, gain: float = 1.0, seed: int = 0, agents: int = AGENTS, spread: float = SPREAD, name: str = ""
) -> Scenario:
    """A group in space with weights (K/N)/(1 + r^2)^beta.

    Parameters
    ----------
    exponent, gain
        beta and K.
    seed
        Seed of the start, uniform in balls of positions and of velocities.
    agents
        Number of agents N.
    spread
        Radius of both balls.
    name
        Name of the scenario.
    """
    begin = starts.ball(agents, radius=spread, speed=spread, dimension=3, seed=seed)
    return Scenario(law(gain / agents, exponent), begin, t_end=DURATION, frames=301, name=name, seed=seed)


def pair(
    speed: float, *, exponent: float = 1.0, gain: float = 1.0, distance: float = NEAR, duration: float = DURATION,
    name: str = "",
) -> Scenario:  # fmt: skip
    """Two agents on a line that move apart, with weights (K/2)/(1 + r^2)^beta, so that w' = -K psi(r) w.

    Parameters
    ----------
    speed
        Their relative speed w at the start, positive.
    exponent, gain
        beta and K.
    distance
        Their distance r at the start.
    duration
        Duration of the run.
    name
        Name of the scenario.

    Raises
    ------
    InvalidInput
        If the speed is not positive.
    """
    w = number("pair", "speed", speed, above=0.0)
    begin = State(np.array([[0.5 * distance], [-0.5 * distance]]), np.array([[0.5 * w], [-0.5 * w]]))
    return Scenario(law(0.5 * gain, exponent), begin, t_end=duration, frames=301, name=name)


def drawn(seed: int | tuple[int, int], first: float, low: float, high: float) -> float:
    """A number of a scenario: ``first`` for the seed 0, else drawn between ``low`` and ``high``.

    Parameters
    ----------
    seed
        Seed of the draw; a second number distinguishes several draws of one seed.
    first
        The number for the seed 0.
    low, high
        Ends of the range for other seeds.
    """
    return first if seed == 0 else float(np.random.default_rng(seed).uniform(low, high))


@seeded
def meeting_pair(seed: int = 0) -> Scenario:
    """Two agents slow enough for each other: of relative speed 1.2, for other values of ``seed`` from 0.2 to 1.3."""
    return pair(drawn(seed, MEETING, 0.2, 1.3), name=PAIR).with_(seed=seed)


@seeded
def parting_pair(seed: int = 0) -> Scenario:
    """Two agents too fast for each other, at many times near the start and far behind it.

    Their relative speed is 1.7, for other seeds drawn from 1.6 to 3.

    Parameters
    ----------
    seed
        Seed of the draw.
    """
    times = (*np.linspace(0.0, DURATION, 301), *np.linspace(2.0 * DURATION, PARTING_DURATION, 200))
    found = pair(drawn(seed, LEAVING, 1.6, 3.0), duration=PARTING_DURATION, name=PARTING)
    return found.with_(frames=tuple(map(float, times)), seed=seed)


def late_pair(delay: float, *, rate: float = 1.0, duration: float = 300.0, name: str = "") -> Scenario:
    """Two agents with constant weights whose velocities, the own one too, are known late: w'(t) = -lambda w(t - tau).

    Parameters
    ----------
    delay
        tau.
    rate
        lambda, the sum of both weights.
    duration
        Duration of the run.
    name
        Name of the scenario.
    """
    begin = pair(1.0, exponent=0.0, gain=rate, distance=1.0)
    return begin.with_(information=Delayed(delay, self_delayed=True), t_end=duration, frames=1201, name=name)


@seeded
def delayed_group(
    *, seed: int = 0, delay: float = DELAY, exponent: float = DELAYED_EXPONENT, name: str = ""
) -> Scenario:
    """Five agents that know their own state, and those of the others ``delay`` late.

    Parameters
    ----------
    seed
        Seed of the start.
    delay
        The delay.
    exponent
        beta.
    name
        Name of the scenario.
    """
    begin = group(exponent, gain=2.0, agents=5, spread=1.0, seed=seed, name=name)
    return begin.with_(information=Delayed(delay), t_end=4.0 * DURATION)


@seeded
def drawn_delayed_group(seed: int = 0) -> Scenario:
    """The same with delay 2 and exponent 0.4, for other seeds with both drawn from `DELAYS` and `DELAYED_EXPONENTS`."""
    # Numbers of their own: those of the start come from the seed alone.
    delay = drawn((seed, 1) if seed else 0, DELAY, *DELAYS)
    exponent = drawn((seed, 2) if seed else 0, DELAYED_EXPONENT, *DELAYED_EXPONENTS)
    return delayed_group(seed=seed, delay=delay, exponent=exponent, name=DELAYED)


@seeded
def discrete_group(*, seed: int = 0, step: float = STEP, name: str = "") -> Scenario:
    """The authors' system in discrete time: x(t + h) = x + h v, v(t + h) = v + h sum a_ij (v_j - v_i), by old values.

    Parameters
    ----------
    seed
        Seed of the start.
    step
        The step h; every step is a frame.
    name
        Name of the scenario.
    """
    begin = group(0.4, gain=4.0, seed=seed, name=name)
    frames = 1 + round(DURATION / step)
    return begin.with_(agents=Impulsive(), control=Held(step), frames=frames, t_end=(frames - 1) * step)


def scenarios() -> dict[str, Callable[[int], Scenario]]:
    """Scenarios by name, each a function of the seed."""
    return {
        KEY: lambda seed: group(0.4, gain=4.0, seed=seed, name=KEY),
        CRITICAL: lambda seed: group(0.5, gain=4.0, seed=seed, name=CRITICAL),
        SHARP: lambda seed: group(1.0, gain=10.0, seed=seed, spread=1.0, name=SHARP),
        PAIR: meeting_pair,
        PARTING: parting_pair,
        DELAYED: drawn_delayed_group,
        REACTION: lambda seed: late_pair(drawn(seed, LATE, 0.5, 1.5), name=REACTION).with_(seed=seed),
        MONOTONE: lambda seed: late_pair(
            drawn(seed, MONOTONE_LATE, 0.1, 0.36), duration=2.0 * DURATION, name=MONOTONE
        ).with_(seed=seed),
        DISCRETE: lambda seed: discrete_group(seed=seed, name=DISCRETE),
        UNSTABLE: lambda seed: late_pair(
            drawn(seed, TOO_LATE, 1.65, 2.5), duration=2.0 * DURATION, name=UNSTABLE
        ).with_(seed=seed),
    }


scenario = scenario_by_name(scenarios, FIGURES)
"""A scenario by its name, or that of a figure, see `scenario_by_name`."""
