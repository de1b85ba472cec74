"""Random initial states, redrawn until the graph they induce is connected where asked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, integer, number, one_of
from flocking.model.graphs.connectivity import is_connected
from flocking.model.state import State

if TYPE_CHECKING:
    from flocking.model.graphs.distance_graphs import Graph

MOST_DRAWS = 100_000
"""Draws tried before a connected start is declared out of reach."""

MOST_PAIRS = 4 * 10**8
"""Pairs looked at in all these draws: of many agents fewer draws are tried."""

MOST_AGENTS = 200_000_000
"""Most agents of a random start, unless the caller says otherwise."""

MOST_DIMENSIONS = 1000
"""Most axes of a random start."""

MOST_CONNECTED = 10_000
"""Most agents of a start that must be connected."""


def box(
    n: int,
    *,
    side: float | Sequence[float],
    speed: float = 0.0,
    seed: int,
    corner: Sequence[float] | None = None,
    dimension: int = 2,
    velocities: str = "disc",
    connected_under: Graph | None = None,
    most_agents: int = MOST_AGENTS,
) -> State:
    """Positions uniform in a box, velocities random.

    Parameters
    ----------
    n
        Number of agents.
    side
        Side of the box, or one side per axis.
    speed
        Largest speed (``"disc"``) or largest component (``"box"``).
    seed
        Seed of the random generator; the same seed gives the same state.
    corner
        Lowest corner of the box; the origin when absent.
    dimension
        Number of axes, where ``side`` is a single number.
    velocities
        ``"disc"``: any direction and a magnitude uniform in [0, speed). ``"box"``: each component uniform in
        [0, speed).
    connected_under
        Redraw until the initial links of this graph connect all agents.
    most_agents
        Limit on ``n``, so that a slip does not fill the memory.

    Raises
    ------
    InvalidInput
        When a value is out of range, or no connected draw is found in 100,000 tries
        (fewer for more than 63 agents: 400 million pairs in all).
    """
    n = _count("start.box", n, dimension, most_agents)
    dimension = integer("start.box", "dimension", dimension, least=1)
    sides = array("start.box", "side", [side] * dimension if np.ndim(side) == 0 else side, ndim=1)
    for value in sides:
        number("start.box", "side", value, above=0.0)
    low = array("start.box", "corner", np.zeros(len(sides)) if corner is None else corner, ndim=1)
    if low.shape != sides.shape:
        raise InvalidInput("start.box", "corner", f"must have {len(sides)} coordinates", corner)
    return _draw(
        "start.box", n, len(sides), lambda rng: low + sides * rng.random((n, len(sides))),
        speed, velocities, seed, connected_under,
    )  # fmt: skip


def ball(
    n: int,
    *,
    radius: float,
    speed: float = 0.0,
    seed: int,
    dimension: int = 2,
    velocities: str = "disc",
    connected_under: Graph | None = None,
    most_agents: int = MOST_AGENTS,
) -> State:
    """Positions uniform in a ball about the origin, velocities random.

    Parameters
    ----------
    n
        Number of agents.
    radius
        Radius of the ball.
    speed
        Largest speed (``"disc"``) or largest component (``"box"``).
    seed
        Seed of the random generator; the same seed gives the same state.
    dimension
        Number of axes.
    velocities
        ``"disc"``: any direction and a magnitude uniform in [0, speed). ``"box"``: each component uniform in
        [0, speed).
    connected_under
        Redraw until the initial links of this graph connect all agents.
    most_agents
        Limit on ``n``, so that a slip does not fill the memory.

    Raises
    ------
    InvalidInput
        When a value is out of range, or no connected draw is found in 100,000 tries
        (fewer for more than 63 agents: 400 million pairs in all).
    """
    n = _count("start.ball", n, dimension, most_agents)
    dimension = integer("start.ball", "dimension", dimension, least=1)
    outer = number("start.ball", "radius", radius, above=0.0)

    def positions(rng: np.random.Generator) -> Array:
        return _directions(rng, n, dimension) * (outer * rng.random((n, 1)) ** (1.0 / dimension))

    return _draw("start.ball", n, dimension, positions, speed, velocities, seed, connected_under)


def hexagonal(
    n: int, *, spacing: float, noise: float = 0.0, speed: float = 0.0, seed: int, most_agents: int = MOST_AGENTS
) -> State:
    """The n points of a planar triangular lattice nearest its centre, with Gaussian noise.

    Parameters
    ----------
    n
        Number of agents.
    spacing
        Distance of nearest neighbours.
    noise
        Standard deviation added to each coordinate.
    speed
        Standard deviation of each velocity component.
    seed
        Seed of the random generator; the same seed gives the same state.
    most_agents
        Limit on ``n``, so that a slip does not fill the memory.

    Raises
    ------
    InvalidInput
        When a value is out of range.
    """
    n = _count("start.hexagonal", n, 2, most_agents)
    spacing = number("start.hexagonal", "spacing", spacing, above=0.0)
    noise = number("start.hexagonal", "noise", noise, least=0.0)
    speed = number("start.hexagonal", "speed", speed, least=0.0)
    rng = np.random.default_rng(integer("start.hexagonal", "seed", seed, least=0))
    half = int(np.ceil(np.sqrt(n))) + 2
    column, row = np.meshgrid(np.arange(-half, half + 1), np.arange(-half, half + 1))
    points = np.stack([column + 0.5 * (row % 2), row * np.sqrt(3) / 2], axis=-1).reshape(-1, 2)
    nearest = np.argsort(np.linalg.norm(points, axis=1), kind="stable")[:n]
    q = points[np.sort(nearest)] * spacing + noise * rng.normal(size=(n, 2))
    return State(q, speed * rng.normal(size=(n, 2)))


def _directions(rng: np.random.Generator, n: int, dimension: int) -> Array:
    vectors = rng.normal(size=(n, dimension))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _count(owner: str, n: int, dimension: int, most_agents: int) -> int:
    n = integer(owner, "n", n, least=1)
    if n > integer(owner, "most_agents", most_agents, least=1):
        raise InvalidInput(owner, "n", f"must be at most {most_agents}", n, "Pass most_agents for more.")
    if integer(owner, "dimension", dimension, least=1) > MOST_DIMENSIONS:
        raise InvalidInput(owner, "dimension", f"must be at most {MOST_DIMENSIONS}", dimension)
    return n


def _check_graph(owner: str, n: int, graph: object) -> None:
    from flocking.model.graphs.distance_graphs import Graph

    if graph is None:
        return
    if not isinstance(graph, Graph):
        raise InvalidInput(owner, "connected_under", "must be a graph", graph, "Use Proximity or Hysteresis.")
    if n > MOST_CONNECTED:
        raise InvalidInput(
            owner, "n", f"must be at most {MOST_CONNECTED} where the start must be connected", n,
            "Every pair is looked at: draw without connected_under, or smaller parts.",
        )  # fmt: skip
    graph.check_count(n)


def _draw(
    owner: str,
    n: int,
    dimension: int,
    positions: Callable[[np.random.Generator], Array],
    speed: float,
    velocities: str,
    seed: int,
    graph: Graph | None,
) -> State:
    speed = number(owner, "speed", speed, least=0.0)
    integer(owner, "seed", seed, least=0)
    one_of(owner, "velocities", velocities, ("disc", "box"), "must be 'disc' or 'box'")
    _check_graph(owner, n, graph)
    rng = np.random.default_rng(seed)
    allowed = MOST_DRAWS if graph is None else max(1, min(MOST_DRAWS, MOST_PAIRS // max(1, n * n)))
    for _ in range(allowed):
        q = positions(rng)
        if graph is None or is_connected(graph.initial(q)):
            break
    else:
        raise InvalidInput(
            owner, "connected_under", f"gave no connected graph of {n} agents in {allowed} draws", graph,
            "Draw from a smaller region or use a larger radius.",
        )  # fmt: skip
    if velocities == "disc":
        p = _directions(rng, n, dimension) * (speed * rng.random((n, 1)))
    else:
        p = speed * rng.random((n, dimension))
    return State(q, p)
