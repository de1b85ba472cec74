"""The energy of a scenario that cannot grow, and the theorem's hypotheses about it.

The function is K + S + sum of E(r_ij): kinetic energy in a frame that moves steadily with the group, what the pursuit
of a leader stores, and the energies of pairs. E continues beyond the radius as the constant E(R) where links come and
go at one radius, so that no switch changes the sum. What is counted here is its excess over the sum of least values:
then no term is negative, and no single one ever exceeds the whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from flocking.arrays import Array, Links, PerAgent
from flocking.formula.derivatives import derivative
from flocking.formula.intervals import Interval
from flocking.formula.safe_digits import rounded_up
from flocking.model.bodies.point_bodies import is_point_mass, is_single_integrator
from flocking.model.graphs.distance_graphs import Graph, Hysteresis
from flocking.model.graphs.smooth_graphs import Smooth
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.terms.body_terms import Compensate, Track
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.model.terms.schedules import Schedule
from flocking.study.certificates.certificate import Hypothesis, ideal_world, until_failed
from flocking.study.certificates.pair_energy import PairEnergy, energy_of, integrated_energy_of
from flocking.study.certificates.pieces import KNOWN_GRAPHS, inside, jump, leader_at, leader_jump, unknown_weight

LARGEST_GROUP = 500
"""Agents up to which all pairs are looked at: 125,000 intervals, some seconds."""


NEAR_EDGE, EDGE_SAMPLES = (1e-15, 1e-3), 64
"""Relative distances below the radius at which the energy of a pair is compared with what there is, and their
number: one place that needs more is enough.
"""


@dataclass(frozen=True, eq=False)
class EnergySetting:
    """A scenario, seen as a system whose energy does not grow.

    Parameters
    ----------
    scenario
        The scenario.
    """

    scenario: Scenario

    @property
    def law(self) -> Law:
        """The law."""
        return self.scenario.law

    @property
    def graph(self) -> Graph:
        """The graph of the law."""
        return self.law.graph

    @property
    def n(self) -> int:
        """Number of agents."""
        return self.scenario.start.n

    @property
    def order(self) -> int:
        """Order of the agents."""
        return self.scenario.agents.order

    @cached_property
    def gradients(self) -> tuple[Gradient, ...]:
        """The terms with a potential."""
        return tuple(t for t in self.law.pair_terms if type(t) is Gradient)

    @cached_property
    def track(self) -> Track | None:
        """The pursuit of a leader, if there is one."""
        return next((t for t in self.law.body_terms if type(t) is Track), None)

    @cached_property
    def masses(self) -> PerAgent:
        """Masses, shape (N,)."""
        return np.broadcast_to(np.asarray(self.scenario.agents.masses, dtype=np.float64), (self.n,))

    @cached_property
    def damped(self) -> bool:
        """Whether some agent has damping that the law does not cancel."""
        compensated = any(type(t) is Compensate for t in self.law.body_terms)
        return bool(np.any(np.asarray(self.scenario.agents.damping))) and not compensated

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """What must hold for the energy not to grow, in the order of the checks; later ones assume earlier ones."""
        return until_failed(
            partial(ideal_world, self.scenario), self._point_masses, self._known_terms, self._opposite_forces,
            self._known_graph, self._body_terms, self._near_pairs_linked, self._finite,
        )  # fmt: skip

    @property
    def holds(self) -> bool:
        """Whether all hypotheses hold."""
        return all(h.holds for h in self.hypotheses)

    def _point_masses(self) -> Hypothesis:
        body = self.scenario.agents
        fits = is_point_mass(body) or is_single_integrator(body)
        statement = "agents are point masses or single integrators"
        if fits and self.n > LARGEST_GROUP:
            return Hypothesis(f"at most {LARGEST_GROUP} agents, whose pairs are all looked at", False, f"{self.n}")
        return Hypothesis(statement, fits, type(body).__name__)

    def _known_terms(self) -> Hypothesis:
        statement = "pairs act by gradients of potentials and by velocity consensus alone"
        own = next((g for t in self.law.pair_terms if (g := unknown_weight(t, self.graph)) is not None), None)
        if own is not None:
            # A negative weight would push agents apart in their velocities.
            found = f"the weight of {type(own).__name__} by which velocity consensus is multiplied is not known"
            return Hypothesis(statement, False, found)
        kinds = [type(t) for t in self.law.pair_terms]
        strange = [k.__name__ for k in kinds if k not in (Gradient, Consensus)]
        velocities = self.order == 1 and Consensus in kinds
        found = ", ".join(strange or (["Consensus, with agents of order 1"] if velocities else [])) or "so"
        return Hypothesis(statement, not strange and not velocities, found)

    def _opposite_forces(self) -> Hypothesis:
        statement = "forces of a pair are opposite, with constant potentials over the graph of the law"
        for term in self.law.pair_terms:
            if "momentum" not in term.symmetries:
                return Hypothesis(statement, False, f"weights of {type(term).__name__} differ between i and j")
            if type(term) is Gradient and self.law.graph_number(term):
                return Hypothesis(statement, False, "a potential acts over another graph")
            if any(isinstance(v, Schedule) for v in term.parameters.values()):
                return Hypothesis(statement, False, f"parameters of {type(term).__name__} change in time")
        if any(g.directed for g in self.law.graphs):
            return Hypothesis(statement, False, "links are directed")
        return Hypothesis(statement, True, "so")

    def _known_graph(self) -> Hypothesis:
        graph = self.graph
        statement = "the energy of a pair is continuous in its distance, also where it is linked or unlinked"
        known = type(graph) in KNOWN_GRAPHS
        if not known or getattr(graph, "has_own_bump", True) is False:
            return Hypothesis(statement, False, f"not known for links by {type(graph).__name__}")
        if type(graph) is Smooth:
            if not isinstance(graph.bump, str):
                return Hypothesis(statement, False, "not known for a bump of one's own")
            if len({t.weighting for t in self.gradients}) > 1:
                return Hypothesis(statement, False, "one potential is weighted, and the force of another")
        for term in self.gradients:
            found = self._jump(term)
            if found:
                return Hypothesis(statement, False, found)
        if not self.keeps_links and graph.moves:
            edge = self.pair.on(Interval.of(self.pair.end))
            if not np.isfinite(edge.hi):
                return Hypothesis(statement, False, "the energy is infinite where links appear")
        return Hypothesis(statement, True, "so")

    def _jump(self, term: Gradient) -> str:
        """Where a potential may jump."""
        import sympy

        r = sympy.Symbol("r", positive=True)
        last = float(np.asarray(self.graph.break_radius)) if self.graph.moves else np.inf
        return jump(term.potential.expression(r), r, 0.0, last)

    def _body_terms(self) -> Hypothesis:
        statement = "a pursuit of the leader, if any, is linear, constant, and knows the leader's acceleration"
        terms = [t for t in self.law.body_terms if type(t) is not Compensate]
        others = [type(t).__name__ for t in terms if type(t) is not Track]
        if others:
            return Hypothesis(statement, False, f"the law has {', '.join(others)}")
        if len(terms) > 1:
            return Hypothesis(statement, False, f"the law has {len(terms)} pursuits")
        track = self.track
        if track is None:
            return Hypothesis(statement, True, "no pursuit")
        if track.shared or track.saturated:
            return Hypothesis(statement, False, "the pursuit is shared or saturated")
        if any(isinstance(v, Schedule) for v in track.parameters.values()):
            return Hypothesis(statement, False, "its gains change in time")
        if self.order == 1:
            return Hypothesis(statement, False, "agents are of order 1")
        found = leader_jump(track.leader, self.scenario.start.t, self.scenario.t_end)
        if found:
            return Hypothesis(statement, False, f"the leader's velocity may jump: {found}")
        steady = self.leader_is_steady
        if not steady and not np.all(np.asarray(track.acceleration_gain) == 1.0):
            return Hypothesis(statement, False, "the leader accelerates and not every agent knows its acceleration")
        if self.damped and not (steady and not np.any(track.leader.at(self.scenario.start.t)[1])):
            return Hypothesis(statement, False, "agents are damped while the leader moves")
        return Hypothesis(statement, True, "so")

    @cached_property
    def leader_is_steady(self) -> bool:
        """Whether the leader, which the law has, is known not to accelerate."""
        import sympy

        assert self.track is not None
        leader = self.track.leader
        numbers = {name: sympy.Rational(value) for name, value in leader.parameters.items()}
        return all(a == 0 for a in leader.acceleration(sympy.Symbol("t", real=True), lambda name: numbers[name]))

    def _near_pairs_linked(self) -> Hypothesis:
        statement = "every pair within the radius at which links appear is linked at the start"
        if not self.graph.moves:
            return Hypothesis(statement, True, "links are fixed")
        radius = self.pair.end if not self.keeps_links else float(np.asarray(self.graph.appear_radius))
        i, j = np.triu_indices(self.n, 1)
        apart = ~self.start_links[i, j] & (self._distances(i, j).hi < radius)
        far = self.start_links[i, j] & (self._distances(i, j).lo > self.pair.end)
        if apart.any():
            k = int(np.argmax(apart))
            return Hypothesis(statement, False, f"agents {i[k]} and {j[k]} are not")
        if far.any():
            k = int(np.argmax(far))
            return Hypothesis(statement, False, f"agents {i[k]} and {j[k]} are linked beyond the radius")
        return Hypothesis(statement, True, "so")

    def _finite(self) -> Hypothesis:
        least = self.least
        if not np.isfinite(least.lo):
            return Hypothesis("the energy of a pair is bounded from below", False, "no bound was proven")
        largest = float(self.excess.hi)
        if not np.isfinite(largest):
            return Hypothesis("the energy is finite at the start and where links appear", False, "no bound was proven")
        if self.keeps_links and not self.links_stay:
            found = f"at most {rounded_up((self.least + self.excess).hi, 6)} in one pair, which suffices"
            return Hypothesis("the energy does not suffice to stretch a link to the radius", False, found)
        return Hypothesis("the energy is finite at the start and where links appear", True, f"{rounded_up(largest, 6)}")

    @property
    def keeps_links(self) -> bool:
        """Whether links break at a larger distance than that at which they appear."""
        return isinstance(self.graph, Hysteresis) and self.graph.gap > 0.0

    def at(self, state: State) -> EnergySetting:
        """The same law in another state, such as that of a frame."""
        later = self.scenario.with_(start=state, t_end=float(np.nextafter(state.t, np.inf)), frames=1)
        found = EnergySetting(later)
        # What depends on the law alone is not computed anew.
        vars(found).update(pair=self.pair, least=self.least)
        return found

    @cached_property
    def start_links(self) -> Links:
        """Links at the start, shape (N, N)."""
        start = self.scenario.start
        return np.asarray(start.links if start.links is not None else self.graph.initial(start.q), dtype=bool)

    @cached_property
    def pair(self) -> PairEnergy:
        """The energy of a linked pair."""
        import sympy

        r = sympy.Symbol("r", positive=True)
        end = float(np.asarray(self.graph.break_radius)) if self.graph.moves else np.inf
        value: sympy.Expr = sympy.Integer(0)
        for term in self.gradients:
            of_all = term.potential.expression(r)
            value += inside(of_all, r, end) if np.isfinite(end) else of_all
        if isinstance(self.graph, Smooth):
            numbers = {name: sympy.Rational(x) for name, x in self.graph.parameters.items()}
            weight = self.graph.weight(r, lambda name: numbers[name])
            if any(t.weighting == "force" for t in self.gradients):
                # The force is the slope of psi times the weight; its energy is the integral.
                return integrated_energy_of(r, weight * derivative(value, r), end)
            value = value * weight
        return energy_of(r, value, end)

    @cached_property
    def least(self) -> Interval:
        """The least energy of a pair, linked or beyond the radius."""
        return self.pair.least()

    def _distances(self, i: np.ndarray, j: np.ndarray) -> Interval:
        q = Interval.of(self.scenario.start.q)
        d = Interval(q.lo[j], q.hi[j]) - Interval(q.lo[i], q.hi[i])
        squares = d.power(2)
        found = Interval.of(np.zeros(len(i)))
        for k in range(self.scenario.start.dimension):
            found = found + Interval(squares.lo[:, k], squares.hi[:, k])
        return Interval(np.maximum(found.lo, 0.0), found.hi).sqrt()

    @cached_property
    def pair_count(self) -> int:
        """Number of pairs whose energies are counted: those with a link, or all where each may get and lose one."""
        if not self.graph.moves or self.keeps_links:
            return int(np.count_nonzero(self.start_links)) // 2
        return self.n * (self.n - 1) // 2

    @cached_property
    def start_excess(self) -> Interval:
        """Energy at the start above the sum of the least values."""
        i, j = np.nonzero(np.triu(self.start_links, 1))
        distances = self._distances(i, j)
        if np.isfinite(self.pair.end):
            distances = Interval(np.minimum(distances.lo, self.pair.end), np.minimum(distances.hi, self.pair.end))
        parts = [self.kinetic, self.stored]
        linked = self.pair.on(distances) - self.least
        parts.append(Interval(np.maximum(linked.lo, 0.0), linked.hi).total())
        others = self.pair_count - len(i)
        if others:
            beyond = self.pair.on(Interval.of(self.pair.end)) - self.least
            parts.append(Interval(np.maximum(beyond.lo, 0.0), beyond.hi) * Interval.of(float(others)))
        found = parts[0]
        for part in parts[1:]:
            found = found + part
        return found

    @cached_property
    def excess(self) -> Interval:
        """The largest energy above the sum of least values that the system can ever have.

        Where links appear at a smaller distance than they break, each new link adds its energy there.
        """
        if not self.keeps_links:
            return self.start_excess
        new = self.n * (self.n - 1) // 2 - self.pair_count
        each = self.pair.on(Interval.of(float(np.asarray(self.graph.appear_radius)))) - self.least
        return self.start_excess + Interval(np.maximum(each.lo, 0.0), each.hi) * Interval.of(float(new))

    @cached_property
    def nearest(self) -> Interval:
        """Smallest distance of a linked pair that the energy allows; see `PairEnergy.nearest`."""
        return self.pair.nearest(self.least + self.excess)

    @cached_property
    def farthest(self) -> Interval | None:
        """Largest distance of a linked pair that the energy allows; see `PairEnergy.farthest`."""
        return self.pair.farthest(self.least + self.excess)

    @cached_property
    def links_stay(self) -> bool:
        """Whether no link is ever lost: they are fixed, or the energy does not suffice to stretch one to the radius."""
        if not self.graph.moves:
            return True
        if not self.keeps_links:
            return False
        below = self.pair.end * (1.0 - np.geomspace(*NEAR_EDGE, EDGE_SAMPLES))
        # A pair that is nearer to the radius than the place looked at would not have to pass it.
        i, j = np.nonzero(np.triu(self.start_links, 1))
        inner = max([float(np.asarray(self.graph.appear_radius)), *self._distances(i, j).hi.tolist()])
        below = below[below >= inner]
        edge = self.pair.on(Interval.of(below)).lo
        return bool((edge > (self.least + self.excess).hi).any())

    @property
    def frame(self) -> str:
        """The frame of the kinetic energy: ``"leader"``, ``"lab"`` or ``"centre of mass"``."""
        if self.track is not None:
            return "leader"
        return "lab" if self.damped else "centre of mass"

    @cached_property
    def relative_velocities(self) -> Interval:
        """Velocities at the start in the frame, shape (N, m)."""
        p = Interval.of(self.scenario.start.p)
        if self.frame == "leader":
            return p - self._leader(1)
        if self.frame == "lab":
            return p
        return p - self.mean_velocity

    def _leader(self, which: int) -> Interval:
        """Position (0) or velocity (1) of the leader at the start, shape (m,)."""
        assert self.track is not None
        return leader_at(self.track.leader, self.scenario.start.t)[which]

    @cached_property
    def mean_velocity(self) -> Interval:
        """Velocity of the centre of mass, shape (m,)."""
        masses = Interval.of(self.masses)
        columns = []
        for k in range(self.scenario.start.dimension):
            p = Interval.of(self.scenario.start.p[:, k])
            columns.append((masses * p).total() / masses.total())
        return Interval(np.array([c.lo for c in columns]), np.array([c.hi for c in columns]))

    @property
    def drift(self) -> Interval:
        """Speed of the centre of mass, which stays where no agent is damped or led."""
        square = self.mean_velocity.power(2).total()
        return Interval(np.maximum(square.lo, 0.0), square.hi).sqrt()

    @cached_property
    def kinetic(self) -> Interval:
        """Kinetic energy at the start in the frame."""
        if self.order == 1:
            return Interval.of(0.0)
        squares = self.relative_velocities.power(2)
        half = Interval.of(0.5 * self.masses[:, None])
        return (half * squares).total()

    @cached_property
    def position_gains(self) -> PerAgent:
        """Gains of the feedback of positions, times the mass where the law scales by it, shape (N,)."""
        if self.track is None:
            return np.zeros(self.n)
        gain = np.broadcast_to(np.asarray(self.track.position_gain, dtype=np.float64), (self.n,))
        return gain * self.masses if self.track.per_mass else gain

    @cached_property
    def stored(self) -> Interval:
        """What the pursuit of the leader stores at the start."""
        if self.track is None or not self.position_gains.any():
            return Interval.of(0.0)
        away = Interval.of(self.scenario.start.q) - self._leader(0)
        gains: Array = self.position_gains[:, None]
        return (Interval.of(0.5 * gains) * away.power(2)).total()
