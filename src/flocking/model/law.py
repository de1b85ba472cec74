"""A control law as the sum of its parts, and a scenario: a law, a start and an end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flocking.errors import InvalidInput
from flocking.model.checks import array, integer, number
from flocking.model.energy import Energy
from flocking.model.graphs.coincident_starts import coincident_groups, linked_pair
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.state import Agents, State
from flocking.model.terms.balances import check_body_term, check_pair_term
from flocking.model.terms.body_terms import BodyTerm
from flocking.model.terms.pair_terms import Gradient, PairTerm, Term
from flocking.model.terms.potential_reach import check_reach


@dataclass(frozen=True)
class Law:
    """A control law: who is a neighbour of whom, and the terms that act.

    Parameters
    ----------
    graph
        Graph of the pair terms that name no other.
    terms
        Pair and body terms; their forces add up.

    Raises
    ------
    InvalidInput
        When the graph or a term is none, or the energies a pair term states are not those of its forces.

    Examples
    --------
    >>> import flocking as fk
    >>> law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    >>> law.distributed
    True
    """

    graph: Graph
    terms: tuple[Term, ...]

    def __post_init__(self) -> None:
        if not isinstance(self.graph, Graph):
            raise InvalidInput("Law", "graph", "must be a graph", self.graph, "Use Fixed, Proximity or Hysteresis.")
        given = self.terms if isinstance(self.terms, Sequence) and not isinstance(self.terms, str) else (self.terms,)
        terms = tuple(given)
        for term in terms:
            if not isinstance(term, PairTerm | BodyTerm):
                raise InvalidInput(
                    "Law", "terms", "must be pair or body terms", term, "Use Gradient, Consensus or Track."
                )
        if not terms:
            raise InvalidInput("Law", "terms", "must hold at least one term", terms)
        object.__setattr__(self, "terms", terms)
        for pair_term in self.pair_terms:
            check_pair_term(pair_term, pair_term.over or self.graph)

    @property
    def pair_terms(self) -> tuple[PairTerm, ...]:
        """The terms that sum over neighbours."""
        return tuple(t for t in self.terms if isinstance(t, PairTerm))

    @property
    def body_terms(self) -> tuple[BodyTerm, ...]:
        """The terms that act on one agent."""
        return tuple(t for t in self.terms if isinstance(t, BodyTerm))

    @property
    def graphs(self) -> tuple[Graph, ...]:
        """The law's graph, then every other graph a term names, each once."""
        found = [self.graph]
        for term in self.pair_terms:
            if term.over is not None and all(term.over is not g for g in found):
                found.append(term.over)
        return tuple(found)

    def graph_number(self, term: PairTerm) -> int:
        """Position in `graphs` of the graph of a pair term."""
        if term.over is None:
            return 0
        return next(k for k, g in enumerate(self.graphs) if g is term.over)

    @property
    def leaders(self) -> tuple[Leader, ...]:
        """Every leader a term looks at, each once."""
        found: list[Leader] = []
        for term in self.body_terms:
            if term.leader is not None and all(term.leader is not x for x in found):
                found.append(term.leader)
        return tuple(found)

    @property
    def beyond_neighbours(self) -> tuple[str, ...]:
        """What an agent must know that its neighbours cannot tell: empty for a distributed law."""
        needs = ["centre of mass" for t in self.body_terms if t.uses_means]
        needs += ["graph functional" for t in self.pair_terms if getattr(t, "functional", False)]
        return tuple(dict.fromkeys(needs))

    @property
    def distributed(self) -> bool:
        """Whether every agent can compute its control from itself, its neighbours and the leader."""
        return not self.beyond_neighbours

    @property
    def symmetries(self) -> frozenset[str]:
        """Symmetries that all terms and graphs keep."""
        from flocking.model.terms.pair_terms import SYMMETRIES

        common = SYMMETRIES
        for term in self.terms:
            common &= term.symmetries
        if any(g.directed for g in self.graphs):
            common -= {"momentum"}
        return common

    def singular_at_zero(self) -> bool:
        """Whether some potential of the law diverges where two neighbours coincide."""
        return any(not np.isfinite(t.potential(0.0)) for t in self.pair_terms if isinstance(t, Gradient))

    def has_barrier(self, graph: Graph) -> bool:
        """Whether a potential over ``graph`` is infinite where its links break."""
        radius = np.max(np.asarray(graph.break_radius))
        if not np.isfinite(radius):
            return False
        numbers = [k for k, g in enumerate(self.graphs) if g is graph]
        return any(
            not np.isfinite(term.potential(radius))
            for term in self.pair_terms
            if isinstance(term, Gradient) and self.graph_number(term) in numbers
        )

    def check_count(self, n: int, dimension: int) -> None:
        """Check that the parts fit ``n`` agents in ``dimension`` dimensions.

        Raises
        ------
        InvalidInput
            When a part was made for another number of agents or dimensions, or the energies a body term states
            are not those of its force.
        """
        for graph in self.graphs:
            graph.check_count(n)
        for term in self.terms:
            term.check_count(n)
            term.check_dimension(dimension)
        for leader in self.leaders:
            if leader.dimension != dimension:
                raise InvalidInput(
                    type(leader).__name__, "dimension", f"must be that of the agents, {dimension}", leader.dimension,
                    "Give one component per axis.",
                )  # fmt: skip
        if dimension not in self._balanced:
            for body_term in self.body_terms:
                check_body_term(body_term, dimension)
            self._balanced.add(dimension)

    @cached_property
    def _balanced(self) -> set[int]:
        """Numbers of dimensions for which the body terms were checked."""
        return set()


MOST_FRAMES = 10_000_000
"""Most frames at even times; a list of times has no limit."""


@dataclass(frozen=True, eq=False)
class Scenario:
    """Everything an engine needs: a law, a start, the agents, and how long to run.

    Parameters
    ----------
    law
        The control law.
    start
        Initial state; its time is the start time.
    t_end
        When the run ends.
    agents
        Masses, damping and order of the agents; unit masses, no damping, order 2 when absent.
    frames
        Number of frames stored at even times, or the times themselves.
    energy
        The energy the ledger keeps; the lab-frame energy of the law when absent.
    tolerance
        Relative and absolute error tolerance of the adaptive engine.
    name
        What to call it.
    seed
        Seed that drew the start, for the record.

    Raises
    ------
    InvalidInput
        When parts disagree in number of agents or dimensions, times are out of order, or two agents coincide
        under a potential that is singular there.
    """

    law: Law
    start: State
    t_end: float
    agents: Agents = field(default_factory=Agents)
    frames: int | Sequence[float] = 201
    energy: Energy = field(default_factory=Energy)
    tolerance: float = 1e-9
    name: str = ""
    seed: int | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.law, Law):
            raise InvalidInput("Scenario", "law", "must be a Law", self.law)
        if not isinstance(self.start, State):
            raise InvalidInput(
                "Scenario", "start", "must be a State", self.start, "Use fk.State(q, p) or fk.start.box(...)."
            )
        for name, kind in (("agents", Agents), ("energy", Energy)):
            if not isinstance(getattr(self, name), kind):
                raise InvalidInput("Scenario", name, f"must be {kind.__name__}", getattr(self, name))
        object.__setattr__(self, "t_end", number("Scenario", "t_end", self.t_end, least=self.start.t))
        object.__setattr__(self, "tolerance", number("Scenario", "tolerance", self.tolerance, above=0.0, below=0.1))
        if np.ndim(self.frames) == 0:
            object.__setattr__(self, "frames", integer("Scenario", "frames", self.frames, least=1))
            if isinstance(self.frames, int) and self.frames > MOST_FRAMES:
                raise InvalidInput(
                    "Scenario", "frames", f"must be at most {MOST_FRAMES}", self.frames, "Give the times for more."
                )
        else:
            times = array("Scenario", "frames", self.frames, ndim=1)
            if len(times) == 0 or (np.diff(times) <= 0).any() or times[0] < self.start.t or times[-1] > self.t_end:
                raise InvalidInput(
                    "Scenario", "frames", "must be ascending times between the start and t_end", self.frames
                )
            object.__setattr__(self, "frames", tuple(float(t) for t in times))
        self.agents.check_count(self.start.n)
        self.law.check_count(self.start.n, self.start.dimension)
        self._check_coincidence()
        check_reach(self.law.pair_terms, self.law.graph)

    def _check_coincidence(self) -> None:
        if not self.law.singular_at_zero():
            return
        groups = coincident_groups(self.start.q)
        for term in self.law.pair_terms:
            if groups and isinstance(term, Gradient) and not np.isfinite(term.potential(0.0)):
                graph = term.over or self.law.graph
                pair = linked_pair(graph, groups, self.start.q, self.agents.headings)
                if pair is not None:
                    raise InvalidInput(
                        "Scenario", "start", f"must not place agents {pair[0]} and {pair[1]} at the same point",
                        self.start.q[pair[0]].tolist(), "The potential is infinite there; move one of them.",
                    )  # fmt: skip

    @property
    def frame_times(self) -> NDArray[np.float64]:
        """Times of the stored frames."""
        if isinstance(self.frames, int):
            if self.frames == 1:
                return np.array([self.start.t])
            return np.linspace(self.start.t, self.t_end, self.frames)
        return np.array(self.frames)

    def with_(self, **changes: Any) -> Scenario:
        """The same scenario with some fields changed.

        An earlier ``t_end`` without new ``frames`` keeps those of the given times that come before it, and itself.
        """
        end = changes.get("t_end")
        if isinstance(end, int | float) and "frames" not in changes and not isinstance(self.frames, int):
            start = changes.get("start", self.start)
            if end < self.frames[-1] and isinstance(start, State) and end >= start.t:
                changes["frames"] = (*(t for t in self.frames if t < end), float(end))
        return replace(self, **changes)
