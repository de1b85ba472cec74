"""Random initial states, optionally redrawn until their graph is connected."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, integer, number, one_of, stop_if_refused
from flocking.model.graphs.connectivity import MOST_CONNECTED, is_connected, most_draws
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.parts import values
from flocking.model.parts.registration import register_part
from flocking.model.parts.seeds import Rng, generator_from
from flocking.model.parts.values import MOST_PAIRWISE
from flocking.model.state import State

VELOCITIES = ("disc", "box", "sphere")
"""Distributions of velocities."""

MOST_AGENTS = 200_000_000
"""Default limit on the number of agents of a random start."""

MOST_DIMENSIONS = 1000
"""Largest number of axes of a random start."""

MOST_AXES = 8
"""Largest number of axes of a start with the largest number of agents; smaller groups may have more."""


@register_part("box")
def box(
    n: Annotated[int, values.AGENTS],
    *,
    side: Annotated[float | Sequence[float], values.NUMBER_OR_NUMBERS],
    speed: float = 0.0,
    seed: Annotated[int | np.random.Generator | None, values.SEED] = None,
    rng: Rng | None = None,
    corner: Annotated[Sequence[float] | None, values.POINT] = None,
    dimension: Annotated[int, values.DIMENSION] = 2,
    velocities: Annotated[str, values.choice(*VELOCITIES)] = "disc",
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
        Largest speed (``"disc"``), largest component (``"box"``) or speed (``"sphere"``).
    seed
        Seed of the random generator, the same one gives the same state; or a generator of NumPy, which is drawn from.
        One of ``seed`` and ``rng`` is given.
    rng
        The same by the name of SPEC 7; a `numpy.random.SeedSequence` too.
    corner
        Lowest corner of the box; the origin by default.
    dimension
        Number of axes, if ``side`` is a single number.
    velocities
        ``"disc"``: any direction and a magnitude uniform in [0, speed). ``"box"``: each component uniform in
        [0, speed). ``"sphere"``: any direction and the magnitude ``speed``.
    connected_under
        Graph under which the start must be connected in open space, whichever way links point; it is redrawn until it
        is.
    most_agents
        Limit on ``n``, which protects the memory from mistakes.

    Raises
    ------
    InvalidInput
        If a value is out of range, or no connected draw is found in 100,000 tries
        (fewer for more than 63 agents: 400 million pairs in all).
    """
    n = _count("start.box", n, dimension, most_agents)
    dimension = integer("start.box", "dimension", dimension, least=1)
    sides = array("start.box", "side", [side] * dimension if np.ndim(side) == 0 else side, ndim=1)
    for value in sides:
        number("start.box", "side", value, above=0.0)
    _count("start.box", n, len(sides), most_agents)
    low = array("start.box", "corner", np.zeros(len(sides)) if corner is None else corner, ndim=1)
    if low.shape != sides.shape:
        raise InvalidInput("start.box", "corner", f"must have {len(sides)} coordinates", corner)
    return _draw(
        "start.box", n, len(sides), lambda rng: low + sides * rng.random((n, len(sides))),
        speed, velocities, (seed, rng), connected_under,
    )  # fmt: skip


@register_part("ball")
def ball(
    n: Annotated[int, values.AGENTS],
    *,
    radius: float,
    speed: float = 0.0,
    seed: Annotated[int | np.random.Generator | None, values.SEED] = None,
    rng: Rng | None = None,
    dimension: Annotated[int, values.DIMENSION] = 2,
    velocities: Annotated[str, values.choice(*VELOCITIES)] = "disc",
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
        Largest speed (``"disc"``), largest component (``"box"``) or speed (``"sphere"``).
    seed
        Seed of the random generator, the same one gives the same state; or a generator of NumPy, which is drawn from.
        One of ``seed`` and ``rng`` is given.
    rng
        The same by the name of SPEC 7; a `numpy.random.SeedSequence` too.
    dimension
        Number of axes.
    velocities
        ``"disc"``: any direction and a magnitude uniform in [0, speed). ``"box"``: each component uniform in
        [0, speed). ``"sphere"``: any direction and the magnitude ``speed``.
    connected_under
        Graph under which the start must be connected in open space, whichever way links point; it is redrawn until it
        is.
    most_agents
        Limit on ``n``, which protects the memory from mistakes.

    Raises
    ------
    InvalidInput
        If a value is out of range, or no connected draw is found in 100,000 tries
        (fewer for more than 63 agents: 400 million pairs in all).
    """
    n = _count("start.ball", n, dimension, most_agents)
    dimension = integer("start.ball", "dimension", dimension, least=1)
    outer = number("start.ball", "radius", radius, above=0.0)

    def positions(rng: np.random.Generator) -> Array:
        return _directions(rng, n, dimension) * (outer * rng.random((n, 1)) ** (1.0 / dimension))

    return _draw("start.ball", n, dimension, positions, speed, velocities, (seed, rng), connected_under)


@register_part("hexagonal")
def hexagonal(
    n: Annotated[int, values.AGENTS],
    *,
    spacing: float,
    noise: float = 0.0,
    speed: float = 0.0,
    seed: Annotated[int | np.random.Generator | None, values.SEED] = None,
    rng: Rng | None = None,
    most_agents: int = MOST_AGENTS,
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
        Seed of the random generator, the same one gives the same state; or a generator of NumPy, which is drawn from.
        One of ``seed`` and ``rng`` is given.
    rng
        The same by the name of SPEC 7; a `numpy.random.SeedSequence` too.
    most_agents
        Limit on ``n``, which protects the memory from mistakes.

    Raises
    ------
    InvalidInput
        If a value is out of range.
    """
    n = _count("start.hexagonal", n, 2, most_agents)
    spacing = number("start.hexagonal", "spacing", spacing, above=0.0)
    noise = number("start.hexagonal", "noise", noise, least=0.0)
    speed = number("start.hexagonal", "speed", speed, least=0.0)
    generator = generator_from("start.hexagonal", seed, rng)
    stop_if_refused()
    # All points of a disc that holds n: one of each lies in a cell of area sqrt(3)/2, which reaches 1/sqrt(3) from it.
    reach = np.sqrt(n * np.sqrt(3) / (2 * np.pi)) + 1.0
    columns, rows = (int(np.ceil(x)) + 1 for x in (reach, reach * 2 / np.sqrt(3)))
    column, row = np.meshgrid(np.arange(-columns, columns + 1), np.arange(-rows, rows + 1))
    points = np.stack([column + 0.5 * (row % 2), row * np.sqrt(3) / 2], axis=-1).reshape(-1, 2)
    del column, row
    nearest = np.argsort(np.linalg.norm(points, axis=1), kind="stable")[:n]
    q = points[np.sort(nearest)] * spacing + noise * generator.normal(size=(n, 2))
    return State(q, speed * generator.normal(size=(n, 2)))


def _given_state(state: object) -> dict[str, object]:
    assert isinstance(state, State)
    links = None if state.links is None else np.argwhere(state.links)
    found = {"t": state.t, "q": state.q, "p": state.p, "links": links}
    return {**found, "columns": state.columns} if state.columns else found


@register_part("given", taken=_given_state)
def given(
    q: Annotated[Sequence[Sequence[float]], values.POSITIONS],
    p: Annotated[Sequence[Sequence[float]] | None, values.ROWS] = None,
    t: Annotated[float, values.TIME] = 0.0,
    links: Annotated[Sequence[tuple[int, int]] | None, values.PAIRS] = None,
    columns: Annotated[Mapping[str, Sequence[Sequence[float]]] | None, values.NAMED_ROWS] = None,
) -> State:
    """A state given by its numbers, for scenario files.

    Parameters
    ----------
    q, p, t
        Positions, velocities and time, as in `State`.
    links
        Pairs (i, j) where agent i senses agent j.
    columns
        Further columns of the agents by name, a row for each agent.

    Raises
    ------
    InvalidInput
        If the state is invalid, or there are too many agents for a link matrix.
    """
    n = len(q)
    if links is not None and n > MOST_PAIRWISE:
        raise InvalidInput("start.given", "links", f"must be left out for more than {MOST_PAIRWISE} agents", n)
    further = {name: np.array(rows) for name, rows in (columns or {}).items()}
    state = State(np.array(q), None if p is None else np.array(p), t, columns=further)
    if links is None:
        return state
    matrix = np.zeros((n, n), dtype=bool)
    for i, j in links:
        if max(i, j) >= n or i == j:
            raise InvalidInput("start.given", "links", f"must join two different agents of 0..{n - 1}", [i, j])
        matrix[i, j] = True
    return replace(state, links=matrix)


def _directions(rng: np.random.Generator, n: int, dimension: int) -> Array:
    vectors = rng.normal(size=(n, dimension))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _count(owner: str, n: int, dimension: int, most_agents: int) -> int:
    n = integer(owner, "n", n, least=1)
    if n > integer(owner, "most_agents", most_agents, least=1):
        raise InvalidInput(owner, "n", f"must be at most {most_agents}", n, "Pass most_agents for more.")
    if integer(owner, "dimension", dimension, least=1) > MOST_DIMENSIONS:
        raise InvalidInput(owner, "dimension", f"must be at most {MOST_DIMENSIONS}", dimension)
    if n * dimension > MOST_AXES * most_agents:
        raise InvalidInput(owner, "dimension", f"must be fewer axes for {n} agents", dimension)
    return n


def _check_graph(owner: str, n: int, graph: object) -> None:
    if graph is None:
        return
    if not isinstance(graph, Graph):
        raise InvalidInput(owner, "connected_under", "must be a graph", graph, "Use Proximity or Hysteresis.")
    if n > MOST_CONNECTED:
        raise InvalidInput(
            owner, "n", f"must be at most {MOST_CONNECTED} where the start must be connected", n,
            "Every pair is evaluated: draw without connected_under, or smaller groups.",
        )  # fmt: skip
    graph.check_count(n)


def _draw(
    owner: str,
    n: int,
    dimension: int,
    positions: Callable[[np.random.Generator], Array],
    speed: float,
    velocities: str,
    seeds: tuple[int | np.random.Generator | None, Rng | None],
    graph: Graph | None,
) -> State:
    speed = number(owner, "speed", speed, least=0.0)
    rng = generator_from(owner, *seeds)
    one_of(owner, "velocities", velocities, VELOCITIES, "must be 'disc', 'box' or 'sphere'")
    _check_graph(owner, n, graph)
    stop_if_refused()
    allowed = most_draws(n)
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
    elif velocities == "sphere":
        p = speed * _directions(rng, n, dimension)
    else:
        p = speed * rng.random((n, dimension))
    return State(q, p)
