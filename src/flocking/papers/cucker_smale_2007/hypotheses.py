"""Hypotheses of claims about Cucker and Smale's systems, and what their measures ask of a run."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from flocking.model.bodies.discrete_bodies import Impulsive
from flocking.model.bodies.point_bodies import is_point_mass
from flocking.model.checks import NO_LESS
from flocking.model.graphs.all_pairs import Complete
from flocking.model.law import Scenario
from flocking.model.terms.alignment import CuckerSmale
from flocking.model.world.control import Held
from flocking.model.world.information import Delayed
from flocking.papers.cucker_smale_2007.closed_forms import delay_limits
from flocking.study.certificates.alignment_certificates import Alignment
from flocking.study.claims import general_claims as general
from flocking.study.claims.claim import Measure
from flocking.study.evidence import Evidence, NotMeasurable

CRITICAL_EXPONENT = 0.5
"""Largest beta for which the weights are not summable over the distance."""


@lru_cache(maxsize=64)
def alignment(scenario: Scenario) -> Alignment:
    """A scenario as alignment of all pairs that its weights hold together.

    Parameters
    ----------
    scenario
        The scenario.

    Raises
    ------
    NotMeasurable
        When it is none.
    """
    found = Alignment(scenario)
    if not found.holds or found.farthest is None:
        raise NotMeasurable("the weights do not suffice to hold this start together")
    return found


def held_together(e: Evidence) -> Measure:
    """D_v(0) against N times the integral of the weight from D_x(0) on."""
    found = Alignment(e.run.scenario)
    if not found.holds:
        raise NotMeasurable("not an alignment of all pairs")
    now, most = float(found.difference.hi), found.available
    note = f"velocities differ by up to {now:.4g}, the weights suffice for {most:.4g}"
    margin = (np.inf if found.unconditional else most - now) if found.farthest is not None else min(most - now, 0.0)
    return Measure(margin, 0.0, note, everywhere=False)


def alignment_alone(e: Evidence) -> Measure:
    """That agents do nothing but align, with equal weights both ways: their energy is the kinetic one."""
    if any(not isinstance(term, CuckerSmale) for term in e.law.terms) or e.run.scenario.energy.unlinked:
        raise NotMeasurable("the law is not alignment alone")
    return general.opposite_forces(e)


def discrete_system(e: Evidence) -> tuple[CuckerSmale, float]:
    """The term and the step of a run of the system in discrete time."""
    world, terms = e.run.scenario, e.law.terms
    if not isinstance(world.agents, Impulsive) or world.agents.parameters or world.agents.update != "backward":
        raise NotMeasurable("velocities are not set at steps, without limits")
    unit = np.all(np.asarray(world.agents.masses) == 1.0) and not np.any(np.asarray(world.agents.damping))
    if not unit or len(terms) != 1 or not isinstance(terms[0], CuckerSmale):
        raise NotMeasurable("the law is not one alignment of undamped unit masses")
    control = world.control
    if not isinstance(e.law.graph, Complete) or terms[0].over is not None or not world.space.is_open:
        raise NotMeasurable("not all pairs align in open space")
    if not isinstance(control, Held) or np.ndim(control.period) or np.any(control.phase):
        raise NotMeasurable("agents do not step together from the start on")
    return terms[0], float(control.period)


def short_steps(e: Evidence) -> Measure:
    """The step times the largest possible sum of an agent's weights, against 1."""
    term, step = discrete_system(e)
    most = step * (e.run.n - 1) * term.gain / term.scale ** (2.0 * term.exponent)
    if term.exponent > CRITICAL_EXPONENT:
        return Measure(CRITICAL_EXPONENT - term.exponent, 0.0, f"beta = {term.exponent:.4g}", everywhere=False)
    return Measure(1.0 - most, 0.0, f"h times the sum of the weights is at most {most:.4g}", everywhere=False)


def weights_not_summable(e: Evidence) -> Measure:
    """Whether the weights are not summable over the distance, as up to beta = 1/2."""
    found = Alignment(e.run.scenario)
    if not found.holds:
        raise NotMeasurable("not an alignment of all pairs")
    return _up_to_critical(max(weight.exponent for weight in found.weights), found.unconditional)


def exponent_of_one(e: Evidence) -> Measure:
    """Whether beta is 1, of all weights."""
    found = Alignment(e.run.scenario)
    if not found.holds or any(weight.exponent != 1.0 for weight in found.weights):
        raise NotMeasurable("not an alignment of all pairs with beta = 1")
    return Measure(np.inf, 0.0, "beta = 1", everywhere=False)


def late_neighbours(e: Evidence) -> Measure:
    """Whether only neighbours are known late, all as late, and the weights are not summable over the distance."""
    information, terms, agents = e.run.scenario.information, e.law.terms, e.run.scenario.agents
    late = isinstance(information, Delayed) and not information.self_delayed and not information.of_pairs
    if not late and not information.ideal:
        raise NotMeasurable("it is not the neighbours that are known late, all as late")
    free = is_point_mass(agents) and not np.ptp(agents.masses) and not np.any(np.asarray(agents.damping))
    if len(terms) != 1 or not isinstance(terms[0], CuckerSmale) or not terms[0].gain or not free:
        raise NotMeasurable("the law is not one alignment of free agents of one mass")
    if not isinstance(e.law.graph, Complete) or terms[0].over is not None or not e.run.scenario.space.is_open:
        raise NotMeasurable("not all pairs align in open space")
    return _up_to_critical(terms[0].exponent, terms[0].exponent <= CRITICAL_EXPONENT)


def _up_to_critical(exponent: float, met: bool) -> Measure:
    # At beta = 1/2 itself it is met, by no margin.
    margin = max(CRITICAL_EXPONENT - exponent, NO_LESS) if met else min(CRITICAL_EXPONENT - exponent, -NO_LESS)
    return Measure(margin, 0.0, f"beta = {exponent:.4g}", everywhere=False)


def stable_delay(e: Evidence) -> Measure:
    """The delay against pi/(2 lambda)."""
    return _delay_below(e, 1)


def too_long_delay(e: Evidence) -> Measure:
    """The delay against pi/(2 lambda), which it exceeds."""
    return stable_delay(e).opposite


def monotone_delay(e: Evidence) -> Measure:
    """The delay against 1/(e lambda)."""
    return _delay_below(e, 0)


def _delay_below(e: Evidence, which: int) -> Measure:
    information = e.run.scenario.information
    if not isinstance(information, Delayed) or not information.self_delayed:
        raise NotMeasurable("the own velocity is not known late")
    if information.of_pairs:
        raise NotMeasurable("delays differ between pairs")
    delay = information.largest
    terms = e.law.terms
    if (
        e.run.n != 2
        or len(terms) != 1
        or not isinstance(terms[0], CuckerSmale)
        or terms[0].exponent
        or not terms[0].gain
    ):
        raise NotMeasurable("the run is not one of two agents with constant weights")
    agents = e.run.scenario.agents
    if not is_point_mass(agents) or np.ptp(agents.masses) or np.any(np.asarray(agents.damping)):
        raise NotMeasurable("the two agents are no free point masses of one mass")
    graph, start = terms[0].over or e.law.graph, e.run.scenario.start
    links = graph.initial(start.q) if start.links is None or graph is not e.law.graph else start.links
    if not e.run.scenario.control.ideal or graph.moves or int(np.count_nonzero(links)) != e.run.n:
        raise NotMeasurable("the two agents do not act on each other at all times")
    limit = delay_limits(2.0 * terms[0].gain / float(np.max(agents.masses)))[which]
    return Measure(limit - delay, 0.0, f"delay {delay:.4g}, limit {limit:.4g}", everywhere=False)
