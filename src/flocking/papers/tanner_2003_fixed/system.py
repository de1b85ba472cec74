"""The simulated system of Tanner I, sec. V."""

from __future__ import annotations

from collections.abc import Callable

from flocking.model import starts
from flocking.model.graphs.distance_graphs import Fixed
from flocking.model.law import Law, Scenario
from flocking.model.parts.seeds import seeded
from flocking.model.potentials.potential import Potential
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.papers.examples import check_figure

KEY = "tanner-2003-fixed"
COMPLETE = "tanner-2003-fixed-complete"
"""The same system with the complete graph (Remark IV.5)."""
AGENTS = 10
"""Number of agents of the simulations."""
LAST_FIGURE = 8
"""Number of the last figure of the paper."""
START_RADIUS = 2.5
"""Radius of the start ball."""
LARGEST_SPEED = 1.0
"""Largest initial speed."""
DURATION = 100.0
"""Duration of the simulation."""
LINK_PROBABILITY = 0.3
"""Not in the paper, which states only that the graph is random and connected."""
PRINTED_TIMES = (2.22842, 5.21464, 22.8931, 55.0766)
"""Times under Fig. 4-7."""


def potential() -> Potential:
    """The potential of Fig. 2. The paper gives no formula; Part II gives this one, used here without cut-off."""
    return Potential("1/r**2 + log(r**2)")


@seeded
def scenario(
    figure: int | None = None, seed: int = 0, *, complete: bool = False, speed: float = LARGEST_SPEED
) -> Scenario:
    """The simulation of sec. V: ten agents in a ball, a random connected graph, 100 seconds.

    Parameters
    ----------
    figure
        Number of the figure; all figures show the same run.
    seed
        Seed of the graph and of the start.
    complete
        Whether to link all agents, as in Remark IV.5.
    speed
        Largest initial speed.

    Raises
    ------
    InvalidInput
        If the paper has no such figure.
    """
    check_figure(figure, LAST_FIGURE)
    graph = Fixed.complete(AGENTS) if complete else Fixed.random_connected(AGENTS, LINK_PROBABILITY, seed)
    start = starts.ball(AGENTS, radius=START_RADIUS, speed=speed, seed=seed)
    law = Law(graph, (Gradient(potential()), Consensus(1.0)))
    name = COMPLETE if complete else KEY
    return Scenario(law, start, t_end=DURATION, frames=frame_times(), name=name, seed=seed)


def frame_times() -> tuple[float, ...]:
    """Evenly spaced times and the times of the paper."""
    return tuple(sorted({*(k * 0.5 for k in range(201)), *PRINTED_TIMES}))


def scenarios() -> dict[str, Callable[[int], Scenario]]:
    """Scenarios of this paper by name, each a function of the seed."""
    return {KEY: lambda seed: scenario(seed=seed), COMPLETE: lambda seed: scenario(seed=seed, complete=True)}
