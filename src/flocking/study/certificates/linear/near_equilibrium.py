"""The linearisation of a law at an equilibrium of its potentials, such as a lattice.

Near an equilibrium of single integrators x' = -H x, of point masses of one mass x'' = -H x - B x', with the second
derivative H of the energy and the weighted Laplacian B of the velocity consensus, both per mass. H vanishes on
translations and rotations: what is stated is stated of deformations. H and B need not commute. An eigenvalue of the
motion with the direction x, |x| = 1, is one of the scalar motion of h = x* H x and b = x* B x, whose limits bound those
of the group: h <= h_max, h <= c b for the least c with H <= c B, and b_min <= b <= b_max.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flocking.errors import FormulaError
from flocking.formula.intervals import Interval
from flocking.formula.safe_digits import rounded_up
from flocking.model.graphs.smooth_graphs import Smooth
from flocking.model.law import Scenario
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.model.terms.schedules import Schedule
from flocking.study.certificates.certificate import Hypothesis, graph_in_words, until_failed
from flocking.study.certificates.consensus_certificates import PI, LinearConsensus
from flocking.study.certificates.enclosed_matrices import (
    INFLATION,
    UNIT,
    EnclosedMatrix,
    eigenvalues,
    least_eigenvalue,
    symmetric_eigenvalues,
    unit_of_rates,
)
from flocking.study.certificates.energy_setting import EnergySetting
from flocking.study.certificates.linear.equilibria import Equilibrium, PairForce, descended, proven
from flocking.study.certificates.pieces import has_known_weight

PRODUCT = 4e-16
"""Relative error of one product, quotient or difference, at most 1.2e-16 of its value, with room for that of the
bound."""

WEIGHTED = 8e-16
"""Relative error of the sum of two products with a sum of gains: at most seven roundings of 1.1e-16."""

SUMMED = 2e-16
"""Relative error for each number of a sum, 1.1e-16 times the sum of the absolute values, with room."""

LENGTH = 1e-14
"""Error of a computed distance relative to the largest coordinate: of a norm of three differences ten roundings."""

LARGEST = 200
"""Coordinates up to which an equilibrium is sought: 100 agents in the plane, a few seconds."""

UNSTRESSED = 1e-9
"""Largest force of a link at the equilibrium, relative to its stiffness times its length, that counts as none."""

SHARES = 4096
"""Parts of the range of b that are looked at for the delay of second order. Every number gives a delay that holds,
more of them a larger one."""

STEEPEST = (1e-9, 1e-6, 1e-3, 1.0)
"""Relative widenings of the computed largest ratio of H to B that are tried until they are proven."""


@dataclass(frozen=True, eq=False)
class NearEquilibrium:
    """A scenario near the equilibrium to which descent from its start leads.

    Parameters
    ----------
    scenario
        The scenario.
    """

    scenario: Scenario

    @cached_property
    def setting(self) -> EnergySetting:
        """The same, with the energy of a pair."""
        return EnergySetting(self.scenario)

    @property
    def order(self) -> int:
        """Order of the agents."""
        return self.scenario.agents.order

    @cached_property
    def speaks(self) -> tuple[Hypothesis, ...]:
        """What must hold for anything to be stated."""
        return until_failed(LinearConsensus(self.scenario).body_hypothesis, self._terms, self._graph)

    def _terms(self) -> Hypothesis:
        statement = "pairs act by gradients of potentials that are not quadratic, and by velocity consensus of one gain"
        law = self.scenario.law
        if law.body_terms:
            return Hypothesis(statement, False, f"the law has {type(law.body_terms[0]).__name__}")
        for term in law.pair_terms:
            if type(term) not in (Gradient, Consensus) or law.graph_number(term):
                return Hypothesis(statement, False, f"the law has {type(term).__name__}, or over another graph")
            if any(isinstance(x, Schedule) or not isinstance(x, float | int) for x in term.parameters.values()):
                return Hypothesis(statement, False, f"parameters of {type(term).__name__} differ or change in time")
            if type(term) is Consensus and (np.ndim(term.gain) or term.weights is not None or term.functional):
                return Hypothesis(statement, False, "weights of Consensus differ")
        if not self.setting.gradients:
            return Hypothesis(statement, False, "no potential acts")
        if self.order == 2 and not any(isinstance(t, Consensus) and t.gain > 0.0 for t in law.pair_terms):
            return Hypothesis(statement, False, "without velocity consensus nothing decays")
        if LinearConsensus(self.scenario).term_hypothesis().holds:
            return Hypothesis(statement, False, "they are: the law is linear, see `decay_rate`")
        return Hypothesis(statement, True, "so")

    def _graph(self) -> Hypothesis:
        law, start = self.scenario.law, self.scenario.start
        statement = f"two agents or more, of {LARGEST} coordinates at most, have one undirected graph in open space"
        known = has_known_weight(law.graph) and not law.graph.directed and len(law.graphs) == 1
        known = known and self.scenario.space.is_open and len({t.weighting for t in self.setting.gradients}) == 1
        known = known and not np.ndim(law.graph.break_radius)
        found = f"{start.q.size} coordinates of {start.n} agents, {graph_in_words(self.scenario)}"
        return Hypothesis(statement, bool(known and start.n > 1 and start.q.size <= LARGEST), found)

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """All hypotheses, with that of the equilibrium."""
        statement = "descent from the start leads to an equilibrium, which exists and is stable but for rigid motions"
        found = self.found
        if isinstance(found, str):
            return (*self.speaks, Hypothesis(statement, False, found))
        if not self.least_stiffness.lo > 0.0:
            return (*self.speaks, Hypothesis(statement, False, "a direction without force, or one that falls, is left"))
        return (*self.speaks, Hypothesis(statement, True, self.name))

    @cached_property
    def found(self) -> Equilibrium | str:
        """The equilibrium, or why there is none."""
        graph, start = self.scenario.law.graph, self.scenario.start
        pair = self.setting.pair
        appear = float(np.asarray(graph.appear_radius)) if graph.moves else np.inf
        force = PairForce(pair.symbol, pair.slope, None if graph.moves else self.setting.start_links, appear, pair.end)
        try:
            reached = descended(np.asarray(start.q, dtype=np.float64), self.setting.start_links, force)
            if reached is None:
                return "none was reached"
            return proven(*reached, force)
        except (FormulaError, np.linalg.LinAlgError, FloatingPointError) as error:
            return f"none was found ({type(error).__name__})"

    @property
    def equilibrium(self) -> Equilibrium:
        """The equilibrium, where it was found."""
        assert isinstance(self.found, Equilibrium)
        return self.found

    @cached_property
    def name(self) -> str:
        """The equilibrium in words, which distinguish it from others."""
        r, at = self.equilibrium.distances, self.equilibrium
        moved = float(np.linalg.norm(at.q - self.scenario.start.q, axis=1).max())
        return (
            f"{len(at.q)} agents with {int(at.links.sum()) // 2} links, smallest distance {r.min():.6g}, largest "
            f"{r.max():.6g}, up to {moved:.6g} from the start, known to within {rounded_up(at.radius, 2)}"
        )

    @cached_property
    def mass(self) -> Interval:
        """The mass of an agent."""
        return Interval.of(float(np.max(self.scenario.agents.masses)) if self.order == 2 else 1.0)

    @cached_property
    def stiffness(self) -> EnclosedMatrix:
        """H times the mass."""
        return self.equilibrium.stiffness

    @cached_property
    def _spectrum(self) -> tuple[np.ndarray, float]:
        return symmetric_eigenvalues(self.stiffness)

    @property
    def least_stiffness(self) -> Interval:
        """The smallest eigenvalue of H times the mass but those of rigid motions, which are exactly zero."""
        values, radius = self._spectrum
        # With as many others as there are rigid motions within the radius of zero, the rest is the rest.
        first = float(values[self.equilibrium.rigid_motions])
        return Interval.of(first - radius, first + radius)

    @property
    def largest_stiffness(self) -> Interval:
        """The largest eigenvalue of H."""
        values, radius = self._spectrum
        return Interval.of(float(values[-1]) - radius, float(values[-1]) + radius) / self.mass

    @cached_property
    def damping(self) -> EnclosedMatrix:
        """B times the mass, of one axis: the Laplacian with the gains and the weights of the links, shape (N, N)."""
        import sympy

        from flocking.formula.interval_values import enclosed

        gains = dict.fromkeys((False, True), 0.0)
        for term in self.scenario.law.pair_terms:
            if isinstance(term, Consensus):
                gains[term.weighted] += float(np.max(term.gain))
        at, graph = self.equilibrium, self.scenario.law.graph
        weights = np.asarray(at.links, dtype=np.float64)
        errors = np.zeros_like(weights)
        if isinstance(graph, Smooth):
            r = sympy.Symbol("r", positive=True)
            numbers = {name: sympy.Rational(x) for name, x in graph.parameters.items()}
            i, j = np.nonzero(at.links)
            length = np.linalg.norm(at.q[i] - at.q[j], axis=1)
            wide = 2.0 * at.radius + LENGTH * np.abs(at.q).max()
            found = enclosed(graph.weight(r, lambda name: numbers[name]), r, Interval.of(length - wide, length + wide))
            weights[i, j], errors[i, j] = 0.5 * (found.lo + found.hi), 0.5 * (found.hi - found.lo)
        weights = gains[True] * weights + gains[False] * np.asarray(at.links, dtype=np.float64)
        errors = gains[True] * errors + WEIGHTED * weights
        laplacian = np.diag(weights.sum(axis=1)) - weights
        spread = np.diag(errors.sum(axis=1) + len(weights) * SUMMED * weights.sum(axis=1)) + errors
        return EnclosedMatrix(laplacian, spread)

    @cached_property
    def damped(self) -> Interval:
        """The smallest eigenvalue of B but that of translations."""
        values, radius = symmetric_eigenvalues(self.damping)
        return Interval.of(float(values[1]) - radius, float(values[1]) + radius) / self.mass

    @property
    def most_damped(self) -> Interval:
        """The largest eigenvalue of B."""
        values, radius = symmetric_eigenvalues(self.damping)
        return Interval.of(float(values[-1]) - radius, float(values[-1]) + radius) / self.mass

    @cached_property
    def full_damping(self) -> EnclosedMatrix:
        """B times the mass of all axes, shape (N m, N m)."""
        unit = np.eye(self.scenario.start.dimension)
        damping = self.damping
        values, error = (np.asarray(np.kron(x, unit), dtype=np.float64) for x in (damping.values, damping.error))
        return EnclosedMatrix(values, error)

    @cached_property
    def steepest(self) -> float | None:
        """A c with H <= c B, proven, near the least one; None where none is proven."""
        from scipy.linalg import eigh

        m = self.scenario.start.dimension
        # Both vanish on translations: agent 0 may be taken to stay.
        h, b = (EnclosedMatrix(x.values[m:, m:], x.error[m:, m:]) for x in (self.stiffness, self.full_damping))
        try:
            near = float(eigh(h.values, b.values, eigvals_only=True)[-1])
        except np.linalg.LinAlgError:
            return None
        for share in STEEPEST:
            c = near * (1.0 + share)
            scaled = EnclosedMatrix(c * b.values, c * b.error * INFLATION + PRODUCT * np.abs(c * b.values))
            if least_eigenvalue(scaled - h) >= 0.0:
                return c
        return None

    def rate(self) -> Interval | str:
        """Rate at which the slowest deformation decays, or why none was proven."""
        if self.order == 1:
            return self.least_stiffness
        m = self.scenario.start.dimension
        size = len(self.stiffness.values) - m

        def relative(x: EnclosedMatrix) -> EnclosedMatrix:
            # Of the differences to agent 0: its rows are taken away from those of the others.
            rows = np.arange(m, m + size)
            first = np.tile(np.arange(m), size // m)
            values = x.values[rows][:, rows] - x.values[first][:, rows]
            error = x.error[rows][:, rows] + x.error[first][:, rows]
            return EnclosedMatrix(values, error * INFLATION + PRODUCT * np.abs(values))

        mass = float(np.max(self.scenario.agents.masses))
        h, b = (relative(x) for x in (self.stiffness, self.full_damping))
        # Velocities in lengths times a power of two near the highest frequency, which rounds nothing: all numbers are
        # rates then, and a unit of time does not decide how far the discs of eigenvalues reach.
        frequency = unit_of_rates(float(np.abs(h.values).max(initial=0.0)) / mass)
        h = EnclosedMatrix(h.values / frequency, h.error / frequency)
        none = np.zeros((size, size))
        matrix = EnclosedMatrix(
            np.block([[none, frequency * np.eye(size)], [-h.values / mass, -b.values / mass]]),
            np.block([[none, none], *[[(x.error / mass + PRODUCT * np.abs(x.values / mass)) for x in (h, b)]]]),
        )
        found = eigenvalues(matrix)
        if found is None:
            return "eigenvectors of the motion are too close to dependent"
        values, radius = found
        turns = self.equilibrium.rigid_motions - m
        near = np.abs(values) <= radius * INFLATION
        others = values[~near]
        apart = len(others) == 0 or np.abs(others).min() > 3.0 * radius
        if int(near.sum()) != turns or not apart:
            return "slow deformations are not distinguished from rotations"
        slowest = float(-others.real.max())
        return Interval.of(slowest - radius, slowest + radius)

    def delay(self) -> Interval | None:
        """A delay of all states below which no deformation grows."""
        if self.order == 1:
            return PI / (self.largest_stiffness * Interval.of(2.0))
        c = self.steepest
        if c is None or not self.damped.lo > 0.0:
            return None
        edges = np.geomspace(float(self.damped.lo), float(self.most_damped.hi), SHARES + 1)
        edges[0], edges[-1] = float(self.damped.lo), float(self.most_damped.hi)
        b = Interval.of(edges[:-1], edges[1:])
        # The limit falls as h grows.
        h = b * Interval.of(c)
        h = Interval.of(
            np.minimum(h.lo, float(self.largest_stiffness.hi)), np.minimum(h.hi, float(self.largest_stiffness.hi))
        )
        x = b.power(2)
        w = ((x + (x.power(2) + h.power(2) * Interval.of(4.0)).sqrt()) * Interval.of(0.5)).sqrt()
        found = (w * b / h).atan() / w
        return Interval.of(float(found.lo.min()), float(found.hi.min()))

    def period(self) -> Interval | None:
        """A period of held control up to which no deformation grows."""
        if self.order == 1:
            return Interval.of(2.0) / self.largest_stiffness
        c = self.steepest
        if c is None:
            return None
        second = Interval.of(2.0) / self.most_damped
        first = Interval.of(2.0) / Interval.of(c)
        return Interval.of(min(float(first.lo), float(second.lo)), min(float(first.hi), float(second.hi)))

    @property
    def unstressed(self) -> bool:
        """Whether links hardly pull or push at the equilibrium, and resist changes of their length.

        Without any force H is the sum of E'' (n . d)^2 over links, and the mean square of |x| after a tick of length T
        is at most |x|^2 - q T (2 - T (q h + 2 p k)) x* H x, where p = 1 - q is the probability of a loss, k the largest
        E'' and h that of H: 2 k <= h, so that no p needs a shorter period than p = 0.
        """
        stress, stiffness = self.equilibrium.link_stresses
        largest = np.maximum(np.abs(stress.lo), np.abs(stress.hi))
        return bool((largest <= UNSTRESSED * stiffness.lo * self.equilibrium.distances.min()).all())

    @property
    def links_return(self) -> bool:
        """Whether a link that ends with a lost message appears again with the next: not beyond where links appear."""
        at = self.equilibrium
        if at.force.fixed is not None:
            return True
        i, j = np.nonzero(np.triu(at.links))
        wide = 2.0 * at.radius + 16.0 * UNIT * np.abs(at.q).max()
        return bool((np.linalg.norm(at.q[i] - at.q[j], axis=1) + wide < at.force.appear).all())

    def noise(self) -> Interval:
        """Mean square in the long run under white noise of intensity 1 on all rates, of an agent, all axes together.

        Of deformations for order 1, sum of 1/(2 lambda)/N; of velocities for order 2, at most (N - 1) m/(2 b_min N),
        since twice the power x' B x' that damping takes is what noise gives.
        """
        n, m = self.equilibrium.q.shape
        if self.order == 1:
            values, radius = self._spectrum
            rest = values[self.equilibrium.rigid_motions :]
            total = Interval.of(rest - radius, rest + radius).reciprocal().total()
            return total / Interval.of(2.0 * n)
        return Interval.of(float((n - 1) * m)) / (self.damped * Interval.of(2.0 * n))
