"""The simulated system of Tanner II, sec. VII."""

from __future__ import annotations

from collections.abc import Callable

from flocking.model import starts
from flocking.model.checks import number
from flocking.model.energy import Energy
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.law import Law, Scenario
from flocking.model.parts.seeds import seeded
from flocking.model.potentials.potential import Potential
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.papers.examples import check_figure

KEY = "tanner-2003-dynamic"
AGENTS = 10
"""Number of agents of the simulations."""
LAST_FIGURE = 7
"""Number of the last figure of the paper."""
START_RADIUS = 2.5
"""Radius of the start ball."""
LARGEST_SPEED = 1.0
"""Largest initial speed."""
RADIUS = 2.0
"""Sensing radius."""
DURATION = 100.0
"""Duration of the simulation."""
SNAPSHOT_TIMES = (0.0, 2.0, 5.0, 25.0, 100.0)
"""Times of Fig. 3-7, chosen to show the same stages; the paper prints its times only under the pictures."""


def inner_potential() -> Potential:
    """Fig. 2 inside the radius: 1/r^2 + log r^2, the part of U_ij that acts on linked agents; r in metres."""
    return Potential("1/r**2 + log(r**2)")


def potential(radius: float = RADIUS) -> Potential:
    """U_ij (Fig. 2): the inner potential, and from ``radius`` R on the constant V_R that makes it continuous."""
    return inner_potential().capped(radius)


def boundary_value(radius: float = RADIUS) -> float:
    """V_R = 1/R^2 + log R^2, the value of U_ij from R on, by continuity (Definition IV.2, Lemma VI.3).

    Parameters
    ----------
    radius
        R, above 0, in metres.

    Raises
    ------
    InvalidInput
        If the radius is not positive.
    """
    radius = number("boundary_value", "radius", radius, above=0.0)
    return float(inner_potential()(radius))


def energy(radius: float = RADIUS) -> Energy:
    """The energy Q of (6): linked pairs store U_ij, every other pair V_R, that of the ``radius`` R."""
    return Energy(unlinked=boundary_value(radius), name="Q")


@seeded
def scenario(
    figure: int | None = None, seed: int = 0, *, speed: float = LARGEST_SPEED, start_radius: float = START_RADIUS
) -> Scenario:
    """The simulation of sec. VII: ten agents in a ball, linked while closer than 2, 100 seconds.

    The start is redrawn until the graph is connected, since Assumption VI.1 cannot hold otherwise.

    Parameters
    ----------
    figure
        Number of the figure; all figures show the same run.
    seed
        Seed of the start.
    speed
        Largest initial speed.
    start_radius
        Radius of the start ball, which determines the density.

    Raises
    ------
    InvalidInput
        If the paper has no such figure.
    """
    check_figure(figure, LAST_FIGURE)
    graph = Proximity(RADIUS)
    start = starts.ball(AGENTS, radius=start_radius, speed=speed, seed=seed, connected_under=graph)
    law = Law(graph, (Gradient(inner_potential()), Consensus(1.0)))
    return Scenario(law, start, t_end=DURATION, frames=frame_times(), energy=energy(), name=KEY, seed=seed)


def frame_times() -> tuple[float, ...]:
    """Evenly spaced times that include those of the snapshots."""
    return tuple(sorted({*(k * 0.5 for k in range(201)), *SNAPSHOT_TIMES}))


def scenarios() -> dict[str, Callable[[int], Scenario]]:
    """Scenarios of this paper by name, each a function of the seed."""
    return {KEY: lambda seed: scenario(seed=seed)}
