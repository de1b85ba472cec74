"""The simulated systems of Zhou, Zhou and Zeng, sec. 4: without and with a virtual leader."""

from __future__ import annotations

from collections.abc import Callable

from flocking.model import starts
from flocking.model.checks import number
from flocking.model.energy import Energy
from flocking.model.graphs.distance_graphs import Hysteresis
from flocking.model.law import Law, Scenario
from flocking.model.leaders_and_obstacles.leaders import Velocity
from flocking.model.parts.seeds import seeded
from flocking.model.potentials.potential import Potential
from flocking.model.terms.body_terms import Track
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.papers.examples import check_figure

KEY = "zhou-2015"
LEADER = "zhou-2015-leader"
"""The system with a virtual leader of sec. 4.2."""
AGENTS = 10
"""Number of agents of the simulations."""
LAST_FIGURE = 14
"""Number of the last figure of the paper."""
SIDE = 8.0
"""Side of the start square."""
LARGEST_COMPONENT = 4.0
"""Upper end of the interval of initial velocity components."""
RADIUS = 4.0
"""r, the sensing radius."""
GAP = 0.1
"""eps: links appear below r - eps."""
LEADER_POSITION = (10.0, 10.0)
"""Initial position of the virtual leader."""
LEADER_VELOCITY = (3.0, 3.0)
"""Velocity of the virtual leader."""
LEADER_GAIN = 1.0
"""c_1, the same for all agents."""
DURATION = 100.0
"""Not in the paper."""
LONGEST = 1e6
"""Durations are below it: frames are kept every half second."""


def potential(radius: float = RADIUS) -> Potential:
    """Potential (9): infinite at distance 0 and at the sensing radius."""
    return Potential("1/r + 1/(R - r)", R=radius)


def graph(radius: float = RADIUS, gap: float = GAP) -> Hysteresis:
    """Graph of rules (i)-(iii) and (1): links appear below r - eps and break at r."""
    return Hysteresis(radius, gap)


def virtual_leader(speed: float = 1.0) -> Velocity:
    """The virtual leader of sec. 4.2: it starts at (10, 10) and keeps its velocity (3, 3), times ``speed``."""
    return Velocity([speed * v for v in LEADER_VELOCITY], start=LEADER_POSITION)


@seeded
def scenario(
    figure: int | None = None,
    seed: int = 0,
    *,
    leader: bool = False,
    side: float = SIDE,
    gain: float = 1.0,
    duration: float = DURATION,
) -> Scenario:
    """The simulation of sec. 4: ten agents in a square, linked by hysteresis; with a leader from Fig. 8 on.

    Velocities have both components uniform in [0, 4), the reading of "arbitrary directions and magnitudes
    within [0, 4] x [0, 4]". The start is redrawn until the graph is connected, as Theorems 1 and 2 assume.

    Parameters
    ----------
    figure
        Number of the figure: 1-7 without, 8-14 with the leader.
    seed
        Seed of the start.
    leader
        Whether to include the virtual leader, regardless of the figure.
    side
        Side of the square of the start.
    gain
        Common factor of the weights w_ij, which the paper does not give; 1 by default.
    duration
        Duration of the run, which the paper does not give.

    Raises
    ------
    InvalidInput
        If the paper has no such figure, or the duration is negative or not below `LONGEST`.
    """
    check_figure(figure, LAST_FIGURE)
    duration = number("zhou-2015", "duration", duration, least=0.0, below=LONGEST)
    net, times = graph(), frame_times(duration)
    start = starts.box(
        AGENTS, side=side, speed=LARGEST_COMPONENT, velocities="box", seed=seed, connected_under=net
    )  # fmt: skip
    terms = (Gradient(potential()), Consensus(gain))
    led = leader or (figure is not None and figure >= 8)
    if not led:
        return Scenario(
            Law(net, terms), start, t_end=duration, frames=times, energy=Energy(name="Q"), name=KEY, seed=seed
        )
    guide = virtual_leader()
    law = Law(net, (*terms, Track(guide, velocity_gain=LEADER_GAIN)))
    energy = Energy(frame="leader", leader=guide, name="U")
    return Scenario(law, start, t_end=duration, frames=times, energy=energy, name=LEADER, seed=seed)


def frame_times(duration: float = DURATION) -> tuple[float, ...]:
    """Short intervals while velocities change fast, then every half second until ``duration``."""
    early = (0.05 * k for k in range(241))
    late = (0.5 * k for k in range(2 * int(duration) + 1))
    return tuple(sorted({round(t, 9) for t in (*early, *late, duration) if t <= duration}))


def scenarios() -> dict[str, Callable[[int], Scenario]]:
    """Scenarios of this paper by name, each a function of the seed."""
    return {KEY: lambda seed: scenario(seed=seed), LEADER: lambda seed: scenario(seed=seed, leader=True)}
