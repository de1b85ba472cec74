"""The slots of the run-time parameters of a law in the arrays of a compiled kernel."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flocking.errors import UnsupportedLaw
from flocking.formula.origins import library_states_all
from flocking.model.bodies.body import Body
from flocking.model.bodies.point_bodies import PointMass
from flocking.model.checks import Array
from flocking.model.energy import Energy
from flocking.model.graphs.smooth_cones import HeadingWeights
from flocking.model.graphs.weights import HashedWeights, PairWeights
from flocking.model.law import Law
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.space import OPEN, Space
from flocking.model.terms.avoidance import ObstacleGroup, ObstacleTerm, PerObstacle
from flocking.model.terms.fading_potentials import Fall
from flocking.model.terms.pair_terms import Term, Value
from flocking.model.terms.schedules import Schedule

MASS, DAMPING = "A0", "A1"
SPACE = "space"
"""Owner of the lengths of space."""
BODIES = "bodies"
"""Owner of the parameters of the agents' bodies."""
FACTORS = "factors"
"""Start of the names of arrays of factors of headings, before the number of the graph."""


@dataclass(frozen=True)
class Place:
    """One coordinate of a leader whose position has no closed form: a parameter that is integrated in time.

    Parameters
    ----------
    axis
        Number of the coordinate.
    """

    leader: Leader
    axis: int

    def at(self, t: float) -> float:
        """The coordinate at time ``t``."""
        return float(self.leader.at(t)[0][self.axis])


class LawNumbers(NamedTuple):
    """The run-time numbers of a law at one time, each kind in the order of its slots.

    Parameters
    ----------
    single
        One number for each slot ``P``.
    each
        Masses and damping, then the slots ``A``: each one number or shape (N,).
    pairs
        The pair weights, for each slot ``W``.
    """

    single: list[float]
    each: list[float | Array]
    pairs: list[PairWeights]


@dataclass(frozen=True, eq=False)
class Layout:
    """Slots of all parameters of a law, in an order that depends on its structure alone.

    Parameters
    ----------
    energy
        The energy; its leader's parameters get slots too.
    bodies
        What the agents are; their parameters get slots too.
    space
        Their space; the lengths of axes that repeat get slots too.
    steering
        Whether the caller adds the forces of steering terms, which have no formulas.

    Raises
    ------
    UnsupportedLaw
        When the law has steering terms and `steering` is false.
    """

    law: Law
    energy: Energy
    bodies: Body = field(default_factory=PointMass)
    space: Space = OPEN
    steering: bool = False

    def __post_init__(self) -> None:
        if self.law.steering_terms and not self.steering:
            name = type(self.law.steering_terms[0]).__name__
            raise UnsupportedLaw(
                f"{name} states no formulas: it acts in discrete time, by engine='discrete' and flocking.control alone."
            )

    def leaders(self) -> tuple[Leader, ...]:
        """Leaders of the law, then the energy's if it is another one."""
        return self._leaders

    @cached_property
    def _leaders(self) -> tuple[Leader, ...]:
        found = list(self.law.leaders)
        if self.energy.leader is not None and all(self.energy.leader is not x for x in found):
            found.append(self.energy.leader)
        return tuple(found)

    def obstacle_groups(self) -> tuple[tuple[ObstacleTerm, ObstacleGroup], ...]:
        """Every group of obstacles with its term, in the order of the terms."""
        return self._obstacle_groups

    @cached_property
    def _obstacle_groups(self) -> tuple[tuple[ObstacleTerm, ObstacleGroup], ...]:
        return tuple((t, g) for t in self.law.body_terms if isinstance(t, ObstacleTerm) for g in t.groups)

    def owners(self) -> list[tuple[str, dict[str, Value | PerObstacle | Place]]]:
        """Every owner of parameters with what it owns, in slot order."""
        return self._owners

    @cached_property
    def _owners(self) -> list[tuple[str, dict[str, Value | PerObstacle | Place]]]:
        found: list[tuple[str, dict[str, Value | PerObstacle | Place]]] = []
        found += [(f"graph{k}", dict(g.parameters)) for k, g in enumerate(self.law.graphs)]
        found += [(f"term{k}", dict(t.parameters)) for k, t in enumerate(self.law.terms)]
        found += [(f"leader{k}", {**x.parameters, **self._places(x)}) for k, x in enumerate(self.leaders())]
        found += [(owner, dict(fall.parameters)) for owner, fall in self.falls.items()]
        found += [(f"obstacles{k}", dict(group.rows)) for k, (_, group) in enumerate(self.obstacle_groups())]
        found += [(BODIES, dict(self.bodies.parameters)), (SPACE, self._lengths)]
        return found

    @cached_property
    def _lengths(self) -> dict[str, Value | PerObstacle | Place]:
        return {f"length_{k}": x for k, x in enumerate(self.space.lengths) if np.isfinite(x)}

    def period_slots(self, dimension: int) -> tuple[str | None, ...]:
        """Slot of the length after which each of ``dimension`` axes repeats, None where it does not."""
        return tuple(self.slots.get((SPACE, f"length_{k}")) for k in range(dimension))

    @staticmethod
    def _places(leader: Leader) -> dict[str, Place]:
        if leader.closed_form:
            return {}
        return {f"place_{k}": Place(leader, k) for k in range(leader.dimension)}

    @cached_property
    def places(self) -> tuple[tuple[int, Place], ...]:
        """Positions in P of the coordinates that are integrated in time."""
        owned = dict(self.owners())
        found = ((slot, owned[owner][name]) for (owner, name), slot in self.slots.items())
        return tuple((int(slot[1:]), value) for slot, value in found if isinstance(value, Place))

    @cached_property
    def slots(self) -> dict[tuple[str, str], str]:
        """Symbol of each (owner, parameter).

        ``P0``, ``P1``... one number, ``A2``... one per agent, ``W0``... one per pair, ``O0``... one per obstacle.
        """
        counts = {"P": 0, "A": 2, "W": 0, "O": 0}
        found = {}
        for owner, values in self.owners():
            for name, value in values.items():
                kind = _kind(value)
                found[owner, name] = f"{kind}{counts[kind]}"
                counts[kind] += 1
        return found

    def held_rows(self, dimension: int) -> dict[str, int]:
        """Rows of A, after those of `values`, of the numbers of the bodies that are held between events, by name."""
        first = 2 + sum(slot[0] == "A" for slot in self.slots.values())
        return {name: first + k for k, name in enumerate(self.bodies.held(dimension))}

    @property
    def counts(self) -> tuple[int, int]:
        """Numbers of slots for single numbers and for rows of obstacles."""
        kinds = [slot[0] for slot in self.slots.values()]
        return kinds.count("P"), kinds.count("O")

    def slot(self, owner: str, name: str) -> str:
        """Symbol of one parameter."""
        return self.slots[owner, name]

    def same_kernels(self, other: Layout) -> bool:
        """Whether the kernels of this layout are those of ``other``, with other numbers at most."""
        return library_states_all(self.parts) and self.structure == other.structure

    @cached_property
    def structure(self) -> tuple[object, ...]:
        """What determines the kernels of the library's own parts: which terms act on which graph, and the slots."""
        law = self.law
        return (
            tuple(g.structure for g in law.graphs),
            tuple((t.structure, law.graph_number(t)) for t in law.pair_terms),
            tuple((t.structure, self.leader_number(t.leader)) for t in law.body_terms),
            tuple(type(t).__name__ for t in law.terms),
            # Whether forces come in opposite pairs decides the formula of the ledger, not only its numbers.
            tuple(g.directed for g in law.graphs),
            tuple("momentum" in t.symmetries for t in law.pair_terms),
            tuple(x.structure for x in self.leaders()),
            (self.energy.structure, self.leader_number(self.energy.leader)),
            self.bodies.structure,
            self.space.structure,
            tuple(self.slots.items()),
        )

    @property
    def parts(self) -> tuple[object, ...]:
        """Everything that states formulas; leaders and obstacles are parts of these."""
        return (*self.law.graphs, *self.law.terms, self.energy, self.bodies)

    def weight_kinds(self) -> tuple[str, ...]:
        """Kind of each pair weight of a tiled kernel.

        ``"hash"`` or ``"matrix"``, or the name of the array of factors of headings beside the lists of a graph.
        """
        weights = (
            (o, value) for o, owned in self.owners() for value in owned.values() if isinstance(value, PairWeights)
        )
        return tuple(
            "hash" if isinstance(value, HashedWeights)
            else owner.replace("graph", FACTORS) if isinstance(value, HeadingWeights)
            else "matrix"
            for owner, value in weights
        )  # fmt: skip

    def leader_number(self, leader: Leader | None) -> int | None:
        """Position of a leader in `leaders`."""
        return None if leader is None else next(k for k, x in enumerate(self.leaders()) if x is leader)

    @cached_property
    def falls(self) -> dict[str, Fall]:
        """Integrals over the fall of weights that terms store, by owner."""
        found = {self.fall_owner(t): t.fall(t.over or self.law.graph) for t in self.law.pair_terms}
        return {owner: fall for owner, fall in found.items() if fall is not None}

    def fall_owner(self, term: Term) -> str:
        """Owner name of the integral over the fall of a weight that a term stores."""
        return f"fall of {self.term_owner(term)}"

    def term_owner(self, term: Term) -> str:
        """Owner name of a term."""
        return f"term{next(k for k, t in enumerate(self.law.terms) if t is term)}"

    def numbers(self, agents: Body, t: float) -> LawNumbers:
        """All run-time numbers at time ``t`` but those per obstacle, each kind in the order of its slots.

        Parameters
        ----------
        agents
            Masses and damping.
        """
        found = LawNumbers([], [agents.masses, agents.damping], [])
        for _, owned in self.owners():
            for value in owned.values():
                kind = _kind(value)
                if isinstance(value, Schedule | Place):
                    value = value.at(t)
                if isinstance(value, PairWeights):
                    found.pairs.append(value)
                elif kind == "A":
                    found.each.append(np.asarray(value, dtype=np.float64))
                elif kind == "P":
                    found.single.append(float(np.asarray(value)))
        return found

    @property
    def constant(self) -> bool:
        """Whether all run-time numbers are the same at any time."""
        return not any(isinstance(v, Schedule | Place) for _, owned in self.owners() for v in owned.values())

    def values(self, agents: Body, n: int, t: float = 0.0) -> tuple[Array, Array, Array]:
        """Numbers for the slots at time ``t``.

        P has the single numbers, then the rows of `obstacle_rows`; A has shape (rows, n), W (matrices, n, n).

        Parameters
        ----------
        agents
            Masses, damping and headings.
        """
        single, each, weights = self.numbers(agents, t)
        pairs = np.array([w.of(agents.headings, n) for w in weights]) if weights else np.zeros((0, 1, 1))
        rows = np.empty((len(each), n))
        for row, given in zip(rows, each, strict=True):
            row[:] = given
        return self.packed(single), rows, pairs

    def packed(self, single: list[float]) -> Array:
        """The array P of a kernel: the single numbers, then the rows of `obstacle_rows`."""
        return np.concatenate([np.array(single, dtype=np.float64), self.obstacle_rows().ravel()])

    def obstacle_rows(self) -> Array:
        """Numbers for the slots per obstacle, shape (rows, K): K is that of the largest group, the rest is NaN."""
        rows = [v.values for _, owned in self.owners() for v in owned.values() if isinstance(v, PerObstacle)]
        table = np.full((len(rows), max(map(len, rows), default=0)), np.nan)
        for row, values in zip(table, rows, strict=True):
            row[: len(values)] = values
        return table


def _kind(value: Value | PerObstacle | Place) -> str:
    """Letter of the slots for a parameter."""
    if isinstance(value, float):
        return "P"
    if isinstance(value, Place):
        return "P"
    if isinstance(value, PairWeights):
        return "W"
    if isinstance(value, PerObstacle):
        return "O"
    if isinstance(value, Schedule):
        return "A" if value.per_agent else "P"
    return "A" if np.ndim(value) else "P"
