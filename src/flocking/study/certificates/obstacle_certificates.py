"""Obstacles that agents never enter: what their speed and the stiffness of the repulsion allow.

Beta-agents of obstacles at rest push with the force -c3 rho(s/r0) psi'(s) N at the signed distance s, N = grad s: E(s),
the integral of c3 rho psi' from the range on, is stored. Their damping takes c4 (w - v) . v of power, where w = J v is
the velocity of the projection; J, the derivative of the projection onto a convex body, is symmetric with eigenvalues in
[0, 1], so that the damping never supplies any. The sum of the energy of the group at rest (see
`flocking.study.certificates.energy_setting`) and of all E does not grow, and no agent comes where its E alone exceeds
it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, cast

import numpy as np

from flocking.formula.intervals import Interval
from flocking.formula.safe_digits import rounded_down, rounded_up
from flocking.model.graphs.all_pairs import Complete
from flocking.model.law import Law, Scenario
from flocking.model.leaders_and_obstacles.obstacles import Ball, Obstacle, Wall
from flocking.model.leaders_and_obstacles.polygons import ConvexPolygon
from flocking.model.potentials.potential import Potential
from flocking.model.terms.avoidance import Avoid
from flocking.model.terms.pair_terms import Gradient
from flocking.study.certificates.certificate import Certificate, Hypothesis, decided, not_applicable
from flocking.study.certificates.energy_setting import EnergySetting
from flocking.study.certificates.pair_energy import IntegratedEnergy, integrated_energy_of
from flocking.study.certificates.pieces import jump
from flocking.study.certificates.sources import sources

if TYPE_CHECKING:
    import sympy

    from flocking.model.terms.symbols import ObstacleSymbols

KEY = "obstacles_not_entered"
"""Key of the certificate."""

CONVEX = (Ball, Wall, ConvexPolygon)
"""Obstacles that are proven to be convex bodies; one of a user may be none, whatever its documentation requires."""

DISTANCE_ERROR = 1e-12
"""Error of computed signed distances relative to the numbers from which they are computed, places of agents and of the
obstacle and its radius: some thousand units of rounding."""


@dataclass(frozen=True)
class _Numbers:
    """What the formulas of `Avoid` read: the distance as a symbol, and its parameters as numbers.

    Parameters
    ----------
    distance
        The signed distance.
    term
        The term.
    """

    distance: sympy.Symbol
    term: Avoid

    def parameter(self, name: str) -> sympy.Expr:
        """A parameter by its name."""
        import sympy

        return sympy.Rational(float(cast(float, self.term.parameters[name])))


@dataclass(frozen=True, eq=False)
class ObstacleSetting:
    """A scenario as a group whose energy does not grow among obstacles at rest.

    Parameters
    ----------
    scenario
        The scenario.
    """

    scenario: Scenario

    @cached_property
    def terms(self) -> tuple[Avoid, ...]:
        """The terms that avoid obstacles."""
        return tuple(t for t in self.scenario.law.body_terms if type(t) is Avoid)

    @cached_property
    def group(self) -> EnergySetting:
        """The same group without obstacles."""
        law = self.scenario.law
        others = tuple(t for t in law.terms if type(t) is not Avoid)
        # Agents that obstacles alone act on are a group without forces.
        left = Law(law.graph, others) if others else Law(Complete(), (Gradient(Potential("0")),))
        start = self.scenario.start if others else replace(self.scenario.start, links=None)
        return EnergySetting(self.scenario.with_(law=left, start=start))

    def repulsion(self) -> Hypothesis:
        """Whether the terms store the energy of their repulsion and only dissipate besides."""
        import sympy

        statement = "obstacles are convex and at rest, and beta-agents alone act, with a force that does not jump"
        for term in self.terms:
            if term.gamma_agents:
                return Hypothesis(statement, False, "there are gamma-agents")
            if not isinstance(term.bump, str):
                return Hypothesis(statement, False, "not known for a bump of one's own")
            for obstacle in term.obstacles:
                if type(obstacle) not in CONVEX:
                    return Hypothesis(statement, False, f"a {type(obstacle).__name__} is not known to be convex")
                if obstacle.mover is not None and any(
                    v != 0
                    for v in obstacle.mover.velocity(sympy.Symbol("t", real=True), lambda name: sympy.Symbol(name))
                ):
                    return Hypothesis(statement, False, f"a {type(obstacle).__name__} moves")
            s = sympy.Symbol("s", positive=True)
            found = jump(term.repulsion.expression(s), s, 0.0, term.range)
            if found:
                return Hypothesis(statement, False, found)
        return Hypothesis(statement, True, "so")

    def still(self) -> Hypothesis:
        """Whether energies are counted at rest, and links need not be counted."""
        group, statement = self.group, "agents of order 2 follow no leader that moves, and no link has memory"
        if group.order == 1:
            return Hypothesis(statement, False, "agents are of order 1")
        if group.keeps_links:
            return Hypothesis(statement, False, "links appear at another distance than they break")
        track, start = group.track, self.scenario.start
        if track is not None and not (group.leader_is_steady and not np.any(track.leader.at(start.t)[1])):
            return Hypothesis(statement, False, "the leader moves")
        return Hypothesis(statement, True, "so")

    def outside(self) -> Hypothesis:
        """Whether all agents start outside all obstacles."""
        least = min(
            float(obstacle.distance(self.scenario.start.q, self.scenario.start.t).min())
            for term in self.terms
            for obstacle in term.obstacles
        )
        return Hypothesis(
            "all agents start outside all obstacles", least > 0.0, f"the nearest is {rounded_down(least, 6)} away"
        )

    @cached_property
    def energies(self) -> tuple[IntegratedEnergy, ...]:
        """The energies of an agent near an obstacle, one for each term."""
        import sympy

        found = []
        for term in self.terms:
            s = sympy.Symbol("s", positive=True)
            numbers = cast("ObstacleSymbols", _Numbers(s, term))
            slope = numbers.parameter("repulsion_gain") * term._fading(numbers)
            slope = slope * term._slope(term.repulsion, "repulsion", s, numbers)
            found.append(integrated_energy_of(s, slope, term.range))
        return tuple(found)

    def excess(self) -> tuple[Interval, list[Interval]]:
        """The largest energy above the sum of least values, and the least values near an obstacle of each term."""
        group, scenario = self.group, self.scenario
        total, leasts = group.excess, []
        if group.frame == "centre of mass":
            # At rest there is that of the centre of mass besides.
            mass = Interval.of(group.masses).total()
            total = total + mass * group.drift.power(2) * Interval.of(0.5)
        for term, energy in zip(self.terms, self.energies, strict=True):
            least = energy.least()
            leasts.append(least)
            for obstacle in term.obstacles:
                s = obstacle.distance(scenario.start.q, scenario.start.t)
                size = _extent(obstacle, scenario.start.t) + float(np.abs(scenario.start.q).max())
                slack = DISTANCE_ERROR * (size + np.abs(s))
                places = Interval(
                    np.clip(s - slack, np.finfo(np.float64).tiny, term.range), np.minimum(s + slack, term.range)
                )
                above = energy.on(places) - least
                total = total + Interval(np.maximum(above.lo, 0.0), above.hi).total()
        return total, leasts


def _extent(obstacle: Obstacle, time: float) -> float:
    """The largest number from which the distance of a convex body at rest is computed."""
    place = np.zeros(1) if obstacle.mover is None else np.abs(obstacle.mover.at(time)[0])
    lengths = [getattr(obstacle, name, 0.0) for name in ("radius", "rounding")]
    corners = np.abs(getattr(obstacle, "vertices", np.zeros(1)))
    return float(place.max()) + float(corners.max()) + float(sum(lengths))


def obstacle_certificates(scenario: Scenario) -> tuple[Certificate, ...]:
    """The guarantee that no agent enters an obstacle of a scenario.

    Parameters
    ----------
    scenario
        The scenario.
    """
    setting, source = ObstacleSetting(scenario), sources()["obstacles"]
    if not setting.terms:
        return not_applicable((KEY,), source, (Hypothesis("the law avoids obstacles", False, "it has no such term"),))
    hypotheses = setting.group.hypotheses
    for check in (setting.still, setting.repulsion, setting.outside):
        if all(h.holds for h in hypotheses):
            hypotheses = (*hypotheses, check())
    quantity = "distance of an agent from an obstacle of the law"
    if not all(h.holds for h in hypotheses):
        return (decided(KEY, source, hypotheses, quantity=quantity),)
    total, leasts = setting.excess()
    nearest = []
    for energy, least in zip(setting.energies, leasts, strict=True):
        allowed, contact = least + total, float(energy.at_contact.lo)
        if not contact > allowed.hi:
            reason = (
                f"the energy may suffice to reach an obstacle: {rounded_down(contact, 6)} is needed at its boundary, "
                f"{rounded_up(allowed.hi, 6)} may be there"
            )
            return (decided(KEY, source, hypotheses, reason=reason, quantity=quantity),)
        nearest.append(energy.nearest(allowed))
    bound = Interval.of(min(float(x.lo) for x in nearest), min(float(x.hi) for x in nearest))
    return (decided(
        KEY, source, hypotheses, bound=bound, side="at least", quantity=quantity,
        statement=f"No agent enters an obstacle: none comes closer than {rounded_down(bound.lo)}.",
    ),)  # fmt: skip
