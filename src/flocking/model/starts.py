"""Random initial states, redrawn until the graph they induce is connected where asked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, integer, number
from flocking.model.connectivity import is_connected
from flocking.model.state import State

if TYPE_CHECKING:
    from flocking.model.graphs import Graph

MOST_DRAWS = 100_000
"""Draws tried before a connected start is declared out of reach."""


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

    Raises
    ------
    InvalidInput
        When a value is out of range, or no connected draw is found in 100,000 tries.
    """
    n = integer("start.box", "n", n, least=1)
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

    Raises
    ------
    InvalidInput
        When a value is out of range, or no connected draw is found in 100,000 tries.
    """
    n = integer("start.ball", "n", n, least=1)
    dimension = integer("start.ball", "dimension", dimension, least=1)
    outer = number("start.ball", "radius", radius, above=0.0)

    def positions(rng: np.random.Generator) -> Array:
        return _directions(rng, n, dimension) * (outer * rng.random((n, 1)) ** (1.0 / dimension))

    return _draw("start.ball", n, dimension, positions, speed, velocities, seed, connected_under)


def hexagonal(n: int, *, spacing: float, noise: float = 0.0, speed: float = 0.0, seed: int) -> State:
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

    Raises
    ------
    InvalidInput
        When a value is out of range.
    """
    n = integer("start.hexagonal", "n", n, least=1)
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
    if velocities not in ("disc", "box"):
        raise InvalidInput(owner, "velocities", "must be 'disc' or 'box'", velocities)
    rng = np.random.default_rng(seed)
    for _ in range(MOST_DRAWS):
        q = positions(rng)
        if graph is None or is_connected(graph.initial(q)):
            break
    else:
        raise InvalidInput(
            owner, "connected_under", f"gave no connected graph in {MOST_DRAWS} draws", graph,
            "Draw from a smaller region or use a larger radius.",
        )  # fmt: skip
    if velocities == "disc":
        p = _directions(rng, n, dimension) * (speed * rng.random((n, 1)))
    else:
        p = speed * rng.random((n, dimension))
    return State(q, p)
