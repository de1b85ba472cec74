"""A control law as the sum of its parts, and a scenario: a law, a start and an end."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property, wraps
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

from flocking.errors import InvalidInput
from flocking.model.bodies.body import Body
from flocking.model.checks import largest
from flocking.model.energy import Energy
from flocking.model.graphs.coincident_starts import coincident_groups, linked_pair
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.mutual_links import check_mutual
from flocking.model.graphs.seen_headings import seen_headings
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.parts import seeds, values
from flocking.model.parts.description import Group, Nested, Unwritten, add_group
from flocking.model.parts.registration import register_part
from flocking.model.scenario_numbers import checked_end, checked_frames, checked_tolerance
from flocking.model.scenario_world import ScenarioWorld
from flocking.model.space import OPEN, Space
from flocking.model.space_checks import check_acting, check_kept_clear
from flocking.model.state import Agents, State
from flocking.model.symmetries import SYMMETRIES
from flocking.model.terms.balances import check_body_term, check_pair_term
from flocking.model.terms.body_terms import BodyTerm, Compensate
from flocking.model.terms.pair_terms import Gradient, PairTerm, Term
from flocking.model.terms.poles_under_errors import warn_of_poles
from flocking.model.terms.potential_reach import check_reach, is_barrier
from flocking.model.terms.steering import Steering
from flocking.model.typesetting.cells import LawCell, ScenarioCell
from flocking.model.world.control import CONTINUOUS, Control
from flocking.model.world.information import INSTANT, Information

MOST_TERMS = 100
"""Most terms of a law in a file."""


@register_part()
@dataclass(frozen=True, repr=False)
class Law(LawCell):
    """A control law: who is a neighbour of whom, and the terms that act.

    Parameters
    ----------
    graph
        Graph of the pair terms that name no other.
    terms
        Pair, body and steering terms; their forces add up.

    Raises
    ------
    InvalidInput
        When the graph or a term is none, two compensate damping, or the energies of a pair term are not of its forces.

    Examples
    --------
    >>> import flocking as fk
    >>> law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    >>> law.distributed
    True
    """

    graph: Graph
    terms: Annotated[Sequence[Term], Nested("term", many=True, most=MOST_TERMS)]

    def __post_init__(self) -> None:
        if not isinstance(self.graph, Graph):
            raise InvalidInput("Law", "graph", "must be a graph", self.graph, "Use Fixed, Proximity or Hysteresis.")
        given = self.terms if isinstance(self.terms, Sequence) and not isinstance(self.terms, str) else (self.terms,)
        terms = tuple(given)
        for term in terms:
            if not isinstance(term, PairTerm | BodyTerm | Steering):
                raise InvalidInput(
                    "Law", "terms", "must be pair, body or steering terms", term, "Use Gradient, Consensus or Track."
                )
        if not terms:
            raise InvalidInput("Law", "terms", "must hold at least one term", terms)
        if sum(isinstance(t, Compensate) for t in terms) > 1:
            hint = "One cancels the damping of the agents; a second one would drive them."
            raise InvalidInput("Law", "terms", "must hold at most one Compensate", "several", hint)
        object.__setattr__(self, "terms", terms)
        for pair_term in self.pair_terms:
            check_pair_term(pair_term, pair_term.over or self.graph)

    @cached_property
    def pair_terms(self) -> tuple[PairTerm, ...]:
        """The terms that sum over neighbours."""
        return tuple(t for t in self.terms if isinstance(t, PairTerm))

    @cached_property
    def body_terms(self) -> tuple[BodyTerm, ...]:
        """The terms that act on one agent."""
        return tuple(t for t in self.terms if isinstance(t, BodyTerm))

    @cached_property
    def steering_terms(self) -> tuple[Steering, ...]:
        """The terms that an agent computes from all that it sees at once."""
        return tuple(t for t in self.terms if isinstance(t, Steering))

    @cached_property
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

    @cached_property
    def leaders(self) -> tuple[Leader, ...]:
        """Every leader a term looks at, each once."""
        found: list[Leader] = []
        for term in self.body_terms:
            if term.leader is not None and all(term.leader is not x for x in found):
                found.append(term.leader)
        return tuple(found)

    @property
    def beyond_neighbours(self) -> tuple[str, ...]:
        """What an agent must know that its neighbours cannot send: empty for a distributed law."""
        needs = ["centre of mass" for t in self.body_terms if t.uses_means]
        needs += ["graph functional" for t in self.pair_terms if getattr(t, "functional", False) is True]
        return tuple(dict.fromkeys(needs))

    @property
    def distributed(self) -> bool:
        """Whether every agent can compute its control from itself, its neighbours and the leader."""
        return not self.beyond_neighbours

    @property
    def symmetries(self) -> frozenset[str]:
        """Symmetries that all terms and graphs keep."""
        common = SYMMETRIES
        for term in self.terms:
            common &= term.symmetries
        for graph in self.graphs:
            common &= graph.symmetries
        return common

    def singular_at_zero(self) -> bool:
        """Whether some potential of the law diverges where two neighbours coincide."""
        return any(self.singular_at_contact(graph) for graph in self.graphs)

    def has_barrier(self, graph: Graph) -> bool:
        """Whether a potential over ``graph`` is infinite where its links break."""
        radius = largest(graph.break_radius)
        if not np.isfinite(radius):
            return False
        return any(
            is_barrier(term.potential, float(radius))
            for term in self.pair_terms
            if isinstance(term, Gradient) and self.graphs[self.graph_number(term)] is graph
        )

    def singular_at_contact(self, graph: Graph) -> bool:
        """Whether a potential over ``graph`` is infinite at contact."""
        return any(
            not np.isfinite(term.potential.at_contact)
            for term in self.pair_terms
            if isinstance(term, Gradient) and self.graphs[self.graph_number(term)] is graph
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


add_group(Group("law", Law, key=None))

SORTS = {
    Body: "a body, such as PointMass, or a Mixture of several",
    Energy: "Energy", str: "text",
    Space: "a space, such as Open",
    Information: "an information, such as Instant or Messages",
    Control: "a control, such as Continuous or Held",
}  # fmt: skip
"""What some fields of a scenario must be, in words."""

BODIES_PLACE = 3
"""Place of the agents among the arguments of a scenario."""


@register_part()
@dataclass(frozen=True, eq=False, repr=False)
class Scenario(ScenarioCell, ScenarioWorld):
    """Everything an engine needs: a law, a start, the agents, and how long to run.

    Parameters
    ----------
    law
        The control law.
    start
        Initial state; its time is the start time.
    t_end
        When the run ends.
    agents, bodies
        What the agents are, such as `PointMass` or `SingleIntegrator`; point masses of 1 without damping when absent.
    frames
        Number of frames stored at even times, or the times themselves.
    energy
        The energy the ledger keeps; the lab-frame energy of the law when absent.
    tolerance
        Error tolerance of an adaptive step, relative to distances and speeds of the run; those of 0.01 to 1 count as 1.
    name
        What to call it.
    seed
        Seed that drew the start, for the record; ``rng`` is another name, and takes a `numpy.random.SeedSequence` too.
    space
        Space of the agents; `Open` when absent.
    information
        What agents know of each other; the present, exactly, when absent.
    control
        When agents act; continuously when absent.

    Raises
    ------
    InvalidInput
        When parts disagree in number of agents or dimensions, times are out of order, links of the start are not
        mutual under an undirected graph, two agents coincide under a potential that is singular there, or the law
        cannot act in the space, see `flocking.model.space_checks`.
    """

    law: Annotated[Law, Nested("law", inline=True)]
    start: State
    t_end: float
    agents: Body = field(default_factory=Agents)
    frames: Annotated[int | Sequence[float], values.FRAMES] = 201
    energy: Energy = field(default_factory=Energy)
    tolerance: float = 1e-9
    name: str = ""
    seed: Annotated[int | None, values.SEED] = None
    space: Annotated[Space, Unwritten(OPEN)] = OPEN
    information: Annotated[Information, Unwritten(INSTANT)] = INSTANT
    control: Annotated[Control, Unwritten(CONTINUOUS)] = CONTINUOUS

    if TYPE_CHECKING:

        def __init__(
            self, law: Law, start: State, t_end: float, agents: Body = ..., frames: int | Sequence[float] = ...,
            energy: Energy = ..., tolerance: float = ..., name: str = ..., seed: int | None = ..., space: Space = ...,
            information: Information = ..., control: Control = ..., *, bodies: Body = ..., rng: seeds.SeedNumber = ...,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        if not isinstance(self.law, Law):
            raise InvalidInput("Scenario", "law", "must be a Law", self.law)
        if not isinstance(self.start, State):
            raise InvalidInput(
                "Scenario", "start", "must be a State", self.start, "Use fk.State(q, p) or fk.start.box(...)."
            )
        kinds = {"agents": Body, "energy": Energy, "space": Space, "information": Information, "control": Control}
        for name, kind in (kinds | {"name": str}).items():
            if not isinstance(getattr(self, name), kind):
                raise InvalidInput("Scenario", name, f"must be {SORTS[kind]}", getattr(self, name))
        object.__setattr__(self, "t_end", checked_end(self.t_end, self.start.t))
        object.__setattr__(self, "tolerance", checked_tolerance(self.tolerance))
        object.__setattr__(self, "seed", None if self.seed is None else seeds.seed_number("Scenario", self.seed))
        object.__setattr__(self, "frames", checked_frames(self.frames, self.start.t, self.t_end))
        for part in (self.agents, self.information, self.control):
            part.check_count(self.start.n)
        self.agents.check_scenario(self.control, self.start.q, self.start.p)
        object.__setattr__(self, "start", self._with_all_columns())
        self.law.check_count(self.start.n, self.start.dimension)
        check_acting(self.law, self.space, self.agents, self.start)
        check_kept_clear(self.space, self.control, self.start.dimension)
        if self.start.links is not None:
            check_mutual(self.law.graph, self.start.links)
        self._check_coincidence()
        check_reach(self.law.pair_terms, self.law.graph)
        warn_of_poles(self.unbounded_forces)

    def _with_all_columns(self) -> State:
        """The start with every further column of the bodies."""
        body, start = self.agents, self.start
        sizes = body.widths(start.dimension)
        for name, given in start.columns.items():
            if name not in sizes:
                known = ", ".join(sizes) or "none"
                raise InvalidInput(
                    "Scenario", "start", f"must have columns of {type(body).__name__} alone, which are: {known}", name
                )
            if given.shape[1] != sizes[name]:
                raise InvalidInput(
                    "Scenario", "start", f"must have {sizes[name]} numbers for each agent in column {name!r}",
                    f"shape {given.shape}",
                )  # fmt: skip
        missing = body.missing_columns(start.columns, start.q, start.p)
        return replace(start, columns={**start.columns, **missing}) if missing else start

    def _check_coincidence(self) -> None:
        if not self.law.singular_at_zero():
            return
        groups = coincident_groups(self.space.wrapped(self.start.q))
        for term in self.law.pair_terms:
            if groups and isinstance(term, Gradient) and not np.isfinite(term.potential.at_contact):
                graph = term.over or self.law.graph
                headings = seen_headings(graph, self.agents.headings, self.start)
                pair = linked_pair(graph, groups, self.start.q, headings)
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

    def with_numbers(self, law: Law, t_end: float) -> Scenario:
        """The same scenario, under a law over the same graphs, from an instant on: the start is not looked at.

        Parameters
        ----------
        law
            The law.
        t_end
            When the run ends.

        Raises
        ------
        InvalidInput
            When the law does not fit the agents, or its potentials have no values where its neighbours are.
        """
        law.check_count(self.start.n, self.start.dimension)
        check_acting(law, self.space, self.agents, self.start)
        check_reach(law.pair_terms, law.graph)
        found = copy(self)
        object.__setattr__(found, "law", law)
        object.__setattr__(found, "t_end", t_end)
        return found

    @property
    def bodies(self) -> Body:
        """What the agents are; another word for `agents`."""
        return self.agents

    def with_(self, **changes: Any) -> Scenario:
        """The same scenario with some fields changed.

        An earlier ``t_end`` without new ``frames`` keeps those of the given times that come before it, and itself.
        Other ``agents`` without a new ``start`` keep those columns of it that they have.
        """
        if "bodies" in changes:
            _take_bodies(changes, given="agents" in changes)
        if isinstance(changes.get("agents"), Body) and "start" not in changes:
            known = {column.name for column in changes["agents"].columns}
            left = {name: values for name, values in self.start.columns.items() if name in known}
            changes["start"] = replace(self.start, columns=left)
        end = changes.get("t_end")
        if isinstance(end, int | float) and "frames" not in changes and not isinstance(self.frames, int):
            start = changes.get("start", self.start)
            if end < self.frames[-1] and isinstance(start, State) and end >= start.t:
                changes["frames"] = (*(t for t in self.frames if t < end), float(end))
        return replace(self, **changes)


def _take_bodies(fields: dict[str, Any], *, given: bool) -> None:
    """Put ``bodies`` where the field of a scenario is, ``agents``."""
    if given:
        raise InvalidInput("Scenario", "bodies", "must be given once", "bodies and agents", "They are one field.")
    fields["agents"] = fields.pop("bodies")


_fields_alone = Scenario.__init__


@wraps(_fields_alone)
def _with_bodies(self: Scenario, *values: Any, **fields: Any) -> None:
    if "bodies" in fields:
        _take_bodies(fields, given="agents" in fields or len(values) > BODIES_PLACE)
    _fields_alone(self, *values, **fields)


# A dataclass cannot have two names for one field.
Scenario.__init__ = _with_bodies  # type: ignore[method-assign]
