"""Interaction graphs with links that appear and break at distances."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

import numpy as np

from flocking.arrays import Indices
from flocking.errors import InvalidInput
from flocking.model.checks import Array, axes_of, integer, listed, number, truth
from flocking.model.graphs.connectivity import MOST_CONNECTED, Links, is_connected, most_draws
from flocking.model.graphs.weights import PairWeights
from flocking.model.parts import values
from flocking.model.parts.description import Group, add_group
from flocking.model.parts.registration import register_part
from flocking.model.parts.seeds import Rng, generator_from
from flocking.model.space import OPEN, Space
from flocking.model.symmetries import SYMMETRIES

if TYPE_CHECKING:
    import networkx
    import sympy


class Graph(ABC):
    """Base of all graphs: a link rule with memory, given by two distances per sensing agent.

    A pair that is not linked is linked when its distance falls below `appear_radius`; a linked pair is
    unlinked when its distance rises above `break_radius`. Equal radii give a graph without hysteresis.
    """

    keeps_identity = True
    directed: bool = False
    """Whether i may sense j while j does not sense i."""
    moves: bool = True
    """Whether links appear and break as the agents move."""
    follows_radii: bool = False
    """Whether agents closer than `break_radius` are linked at the start, and later links follow `Graph.update`. Engines
    may then determine links from the two distances alone."""
    sees_headings: bool = False
    """Whether links depend on the agents' headings."""

    @property
    @abstractmethod
    def appear_radius(self) -> float | Array:
        """Distance below which an absent link appears, for all or per sensing agent; 0 when none ever does."""

    @property
    @abstractmethod
    def break_radius(self) -> float | Array:
        """Distance above which a link breaks, for all or per sensing agent; infinite when none ever does."""

    @abstractmethod
    def initial(self, q: Array) -> Links:
        """Links at the start, shape (N, N), from positions ``q`` of shape (N, m)."""

    def start_links(self, q: Array, headings: Array | None = None) -> Links:
        """Links at the start from positions and, for graphs that see them, ``headings`` as in `Agents`."""
        return self.initial(q)

    def among(self, distance: Array) -> Links:
        """Links at the start of pairs at a ``distance``, shape (N, N), infinite on the diagonal.

        Raises
        ------
        InvalidInput
            If the graph does not implement it; it then supports only open space.
        """
        raise InvalidInput(
            type(self).__name__, "space", "must be open for a graph without links by distance",
            "another", "Implement Graph.among.",
        )  # fmt: skip

    def links_in(self, space: Space, q: Array, headings: Array | None = None) -> Links:
        """Links at the start in a ``space``, from positions ``q``, shape (N, m), and ``headings``.

        Raises
        ------
        InvalidInput
            If the space is not open and the graph does not support it, see `among`.
        """
        return self.start_links(q, headings) if space.is_open else self.among(pair_distances(q, space))

    def allowed(self, headings: Array | None) -> Links | None:
        """Pairs whose headings allow a link at some distance, shape (N, N); None for all."""
        return None

    def update(self, q: Array, links: Links, space: Space = OPEN) -> Links:
        """Links after the agents moved to ``q`` in a ``space``, given the ``links`` they had before."""
        if not self.moves:
            return links
        distance = pair_distances(q, space)
        leaves = np.asarray(self.break_radius)[..., None]
        enters = np.asarray(self.appear_radius)[..., None]
        unbroken = links & (distance < leaves)
        new = ~links & (distance < enters)
        result = unbroken | new
        np.fill_diagonal(result, False)
        return np.asarray(result)

    def weight(self, r: sympy.Expr, parameter: Callable[[str], sympy.Expr]) -> sympy.Expr:
        """Weight a_ij of a link of length ``r`` as a SymPy expression; 1 for hard graphs."""
        import sympy

        return sympy.Integer(1)

    def functional(self, links: Links, weights: Array) -> Array:
        """Functional s_i of the links for every agent, shape (N,): xi of Shi's Remark 3.

        Parameters
        ----------
        links
            Link matrix, shape (N, N).
        weights
            Weights w_ij of the links, shape (N, N).

        Raises
        ------
        InvalidInput
            If the links are not strongly connected.
        """
        from flocking.model.graphs.functionals import left_eigenvector

        return left_eigenvector(np.where(links, weights, 0.0))

    @property
    def parameters(self) -> Mapping[str, float | PairWeights]:
        """Run-time parameters of `weight`."""
        return {}

    @property
    def structure(self) -> tuple[object, ...]:
        """Everything that determines the formulas of this graph, without the values of its parameters."""
        return ("hard",)

    @property
    def symmetries(self) -> frozenset[str]:
        """Symmetries that its links keep: not momentum if one-way, nor relabelling with radii for each agent."""
        each = np.ndim(self.appear_radius) or np.ndim(self.break_radius)
        return SYMMETRIES - ({"momentum"} if self.directed else set()) - ({"relabelling"} if each else set())

    def kinks(self) -> tuple[float, ...]:
        """Distances at which the weight has a kink."""
        return ()

    def check_count(self, n: int) -> None:
        """Check that the graph fits ``n`` agents; most fit any number."""
        return None


add_group(Group("graph", Graph, names="graph"))


def pair_distances(q: Array, space: Space = OPEN) -> Array:
    """Distances of all pairs, shape (N, N), infinite on the diagonal.

    Parameters
    ----------
    q
        Positions, shape (N, m).
    space
        The space of the agents.
    """
    offsets = space.displacement(q[None, :, :] - q[:, None, :])
    # Axis by axis: a sum over the few numbers of a vector takes NumPy several times as long.
    distance = offsets[..., 0] ** 2
    for k in range(1, offsets.shape[-1]):
        distance += offsets[..., k] ** 2
    np.sqrt(distance, out=distance)
    np.fill_diagonal(distance, np.inf)
    return np.asarray(distance)


class OneRadius(Graph):
    """Base of graphs whose links appear and break at one distance, their `radius`."""

    radius: float | Array

    @property
    def appear_radius(self) -> float | Array:
        """The radius."""
        return self.radius

    @property
    def break_radius(self) -> float | Array:
        """The radius."""
        return self.radius

    def initial(self, q: Array) -> Links:
        """Links of the positions ``q``, shape (N, m)."""
        return self.among(pair_distances(q))


@register_part("fixed")
@dataclass(frozen=True)
class Fixed(Graph):
    """A fixed graph (Tanner I, Definition IV.1).

    Parameters
    ----------
    n
        Number of agents.
    edges
        Pairs (i, j). Undirected unless ``directed``; then (i, j) means that i senses j.
    directed
        Whether pairs are one-way.

    Raises
    ------
    InvalidInput
        If a pair joins an agent with itself or contains an agent that does not exist.
    """

    n: Annotated[int, values.FEW_AGENTS]
    edges: Annotated[Sequence[tuple[int, int]], values.PAIRS]
    directed: Annotated[bool, values.hidden(values.TRUTH)] = False
    moves: bool = field(default=False, init=False, repr=False)

    def __post_init__(self) -> None:
        integer("Fixed", "n", self.n, least=1)
        object.__setattr__(self, "directed", truth("Fixed", "directed", self.directed))
        pairs = set()
        for edge in listed("Fixed", "edges", self.edges, "must be pairs of agents"):
            if axes_of(edge) != 1 or np.shape(edge) != (2,):
                raise InvalidInput("Fixed", "edges", "must be pairs of agents", edge, "Write [(0, 1), (1, 2)].")
            i, j = (integer("Fixed", "edges", k, least=0) for k in edge)
            if i == j or max(i, j) >= self.n:
                raise InvalidInput("Fixed", "edges", f"must join two different agents of 0..{self.n - 1}", (i, j))
            pairs.add((i, j) if self.directed else (min(i, j), max(i, j)))
        object.__setattr__(self, "edges", tuple(sorted(pairs)))

    def of_agents(self, chosen: Indices) -> Fixed:
        """The graph of the agents ``chosen``, in this order; an agent may occur twice."""
        i, j = np.nonzero(self.initial(np.zeros((self.n, 1)))[np.ix_(chosen, chosen)])
        pairs = tuple((int(a), int(b)) for a, b in zip(i, j, strict=True) if a != b)
        return Fixed(len(chosen), pairs, directed=self.directed)

    @classmethod
    def from_networkx(cls, graph: networkx.Graph[object]) -> Fixed:
        """The links of a networkx graph; its nodes are numbered in their sorted or given order.

        Edges with a weight other than 1 are refused: links have none.
        """
        if any(weight != 1 for *_, weight in graph.edges(data="weight", default=1)):
            fix = "Give weights to the term: Consensus(weights=MatrixWeights(...))."
            raise InvalidInput("Fixed.from_networkx", "graph", "must have no weights other than 1", graph, fix)
        try:
            nodes = sorted(graph.nodes)
        except TypeError:
            nodes = list(graph.nodes)
        number_of = {node: k for k, node in enumerate(nodes)}
        edges = tuple((number_of[a], number_of[b]) for a, b in graph.edges())
        return cls(len(nodes), edges, directed=bool(graph.is_directed()))

    @classmethod
    def complete(cls, n: int) -> Fixed:
        """The complete graph."""
        return cls(n, tuple((i, j) for i in range(n) for j in range(i + 1, n)))

    @classmethod
    def random_connected(
        cls, n: int, probability: float, seed: int | np.random.Generator | None = None, *, rng: Rng | None = None
    ) -> Fixed:
        """G(n, probability), redrawn until it is connected; ``seed`` and ``rng`` as in `flocking.start.box`.

        Raises
        ------
        InvalidInput
            If a value is out of range, or 100,000 draws gave no connected graph, fewer of more than 63 agents.
        """
        owner = "Fixed.random_connected"
        if integer(owner, "n", n, least=1) > MOST_CONNECTED:
            raise InvalidInput(owner, "n", f"must be at most {MOST_CONNECTED}", n, "Every pair is drawn.")
        chance = number(owner, "probability", probability, above=0.0)
        if chance > 1.0:
            raise InvalidInput(owner, "probability", "must be at most 1", probability)
        generator = generator_from(owner, seed, rng)
        upper = np.triu_indices(n, 1)
        for _ in range(most_draws(n)):
            matrix = np.zeros((n, n), dtype=bool)
            matrix[upper] = generator.random(len(upper[0])) < chance
            if is_connected(matrix):
                return cls(n, tuple((int(i), int(j)) for i, j in np.argwhere(matrix)))
        raise InvalidInput(
            owner, "probability", f"gave no connected graph in {most_draws(n)} draws", probability, "Raise it."
        )

    @property
    def appear_radius(self) -> float:
        """No link ever appears."""
        return 0.0

    @property
    def break_radius(self) -> float:
        """No link ever breaks."""
        return np.inf

    @property
    def symmetries(self) -> frozenset[str]:
        """As of all graphs; relabelling only where every agent is linked to every other."""
        most = self.n * (self.n - 1) // (1 if self.directed else 2)
        return super().symmetries - (set() if len(self.edges) == most else {"relabelling"})

    def initial(self, q: Array) -> Links:
        """The given links, for all positions ``q``."""
        self.check_count(len(q))
        links = np.zeros((self.n, self.n), dtype=bool)
        if self.edges:
            i, j = np.array(self.edges).T
            links[i, j] = True
            if not self.directed:
                links[j, i] = True
        return links

    def check_count(self, n: int) -> None:
        """Check that the graph has ``n`` agents.

        Raises
        ------
        InvalidInput
            If it has another number of agents.
        """
        if n != self.n:
            raise InvalidInput("Fixed", "n", f"must be the number of agents, {n}", self.n)


@register_part("random_connected")
def random_connected(
    n: Annotated[int, values.FEW_AGENTS], probability: float, seed: Annotated[int, values.SEED]
) -> Fixed:
    """`Fixed.random_connected` of ``n``, ``probability`` and ``seed``, for scenario files."""
    return Fixed.random_connected(n, probability, seed)


@register_part("proximity")
@dataclass(frozen=True)
class Proximity(OneRadius):
    """Agents closer than one radius are neighbours (Tanner II Definition IV.1, Olfati-Saber (8)).

    Parameters
    ----------
    radius
        Sensing radius.
    closed
        Whether a pair at exactly ``radius`` is linked, as in Olfati-Saber (8).

    Raises
    ------
    InvalidInput
        If the radius is not positive.
    """

    radius: float
    closed: bool = False
    follows_radii = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", number("Proximity", "radius", self.radius, above=0.0))
        object.__setattr__(self, "closed", truth("Proximity", "closed", self.closed))

    def among(self, distance: Array) -> Links:
        """Pairs at a ``distance`` below the radius, or at it."""
        return np.asarray(distance <= self.radius if self.closed else distance < self.radius)


@register_part("hysteresis")
@dataclass(frozen=True)
class Hysteresis(Graph):
    """Links break at ``radius`` and appear only below ``radius - gap`` (Zhou (1), rules (i)-(iii)).

    Parameters
    ----------
    radius
        Sensing radius; links break at it, and at the start every closer pair is linked.
    gap
        Distance below ``radius`` at which a pair is linked again.

    Raises
    ------
    InvalidInput
        If the radius is not positive, or the gap is not in [0, radius).
    """

    radius: float
    gap: float
    follows_radii = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", number("Hysteresis", "radius", self.radius, above=0.0))
        gap = number("Hysteresis", "gap", self.gap, least=0.0)
        if gap >= self.radius:
            raise InvalidInput(
                "Hysteresis", "gap", f"must be smaller than the radius, {self.radius:g}", self.gap,
                "A link appears below radius - gap.",
            )  # fmt: skip
        object.__setattr__(self, "gap", gap)

    @property
    def appear_radius(self) -> float:
        """``radius - gap``."""
        return self.radius - self.gap

    @property
    def break_radius(self) -> float:
        """The sensing radius."""
        return self.radius

    def initial(self, q: Array) -> Links:
        """Links of the positions ``q``: every pair closer than ``radius`` (Zhou, rule (i))."""
        return self.among(pair_distances(q))

    def among(self, distance: Array) -> Links:
        """Pairs at a ``distance`` below the radius."""
        return np.asarray(distance < self.radius)
