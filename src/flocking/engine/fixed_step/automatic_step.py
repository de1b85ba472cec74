"""Choice of the time step from the start: rates of change of forces, strength of damping, and speed of approach."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flocking.arrays import AnyArray, Array, Indices
from flocking.engine.fixed_step.passing_pairs import singular_reach
from flocking.engine.fixed_step.step_checks import STRIDE
from flocking.engine.protocol.body_chains import chain_of
from flocking.model.bodies.actuators import Lagged
from flocking.model.bodies.unicycles import Unicycle
from flocking.model.graphs.weights import PairWeights
from flocking.model.law import Scenario
from flocking.model.terms.pair_terms import Consensus, Gradient, Term
from flocking.model.terms.schedules import Schedule

LEAST_STEPS = 100
"""Least steps of a run however slow its motion, so that its curves have points enough to be drawn."""

SAMPLE = 4000
"""Number of sampled agents."""

PROBE = 1e-4
"""Relative step of the finite differences that measure stiffness."""

LARGEST = 0.1
"""Largest automatic step; by convention a tenth of the unit of time."""
PERIODS = 0.15
"""Product of the step and the fastest rate of the linearised motion."""
DESCENTS = {"euler": 0.05, "rk4": 0.5}
"""Product of the step and the fastest rate of gradient descent of agents of order 1, by integrator. At the first step
of such a descent the ledger residual is half of this product with the Euler method, 2.5 % of the energy, and 0.18 %
with Runge-Kutta; they are unstable beyond 2 and 2.8."""
DAMPING, DAMPED = 0.1, 0.4
"""Product of the step and the strongest damping, and the value for integrators that allow more. The ledger residual of
a flock that settles is then about two per cent of the energy exchanged, well below the limit of the check."""
CLOSING = 0.02
"""Largest approach of a pair per step at the start, relative to its distance."""


@dataclass(frozen=True, eq=False)
class SampledPairs:
    """All pairs of some agents under one graph.

    Parameters
    ----------
    agent, other
        Numbers of the two agents of each pair; all pairs of the first ones are included.
    distance
        Distance of the pair.
    speed
        Magnitude of its relative velocity.
    """

    agent: Indices
    other: Indices
    distance: Array
    speed: Array


def largest_step(
    scenario: Scenario, sampled: Sequence[SampledPairs | None], scheme: str, velocities: AnyArray | None = None
) -> float:
    """The largest step that resolves the start: at most 0.1, and 1/100 of the run.

    The rates of the motion are bounded by sums over neighbours: the curvature of every potential at the distance of a
    pair (frequency; for agents of order 1 the rate of descent), and the gains of velocity terms (damping).

    Parameters
    ----------
    scenario
        The law and the duration.
    sampled
        Pairs of each graph of the law; None for a graph that is not sampled.
    scheme
        Name of the integrator: ``"damped"`` allows four times the damping, ``"rk4"`` ten times the rate of descent of
        ``"euler"``.
    velocities
        Velocities at the start, shape (N, m), for agents of order 1; those of the state otherwise.
    """
    span = scenario.t_end - scenario.start.t
    limits = [LARGEST, span / LEAST_STEPS if span > 0 else LARGEST, resolving_step(scenario, sampled, scheme)]
    limits += [PERIODS / rate for rate in _rates_of_bodies(scenario) if rate > 0]
    for pairs in sampled:
        if pairs is not None and scenario.law.singular_at_zero():
            apart = pairs.distance > 0
            closing = float((pairs.speed[apart] / pairs.distance[apart]).max(initial=0.0))
            if closing > 0:
                limits.append(CLOSING / closing)
    reach = singular_reach(scenario.law)
    p = scenario.start.p if velocities is None else velocities
    fastest = 2.0 * float(np.sqrt(((p - p.mean(axis=0)) ** 2).sum(axis=1).max())) if np.isfinite(reach) else 0.0
    if fastest > 0:
        # Half of the limit for pairs that are not linked yet.
        limits.append(0.5 * STRIDE * reach / fastest)
    return float(min(limits))


def _rates_of_bodies(scenario: Scenario) -> list[float]:
    """Rates at which what bodies add changes: of lagged forces, and of headings at the speeds of the start."""
    chain, inner = chain_of(scenario.agents)
    found = [1.0 / float(np.min(part.time_constant)) for part in chain if isinstance(part, Lagged)]
    if isinstance(inner, Unicycle) and scenario.control.ideal:
        fastest = float(np.linalg.norm(scenario.start.p, axis=1).max())
        found.append(fastest / float(np.min(inner.offset)))
    return found


def resolving_step(
    scenario: Scenario, sampled: Sequence[SampledPairs | None], scheme: str, *, across: bool = True
) -> float:
    """The largest step that resolves the forces at the start, regardless of the length of the run and of speeds.

    Parameters
    ----------
    sampled, scheme
        See `largest_step`.
    across
        Whether to include the rotation of forces with the pair. Its rate is unbounded near contact, but only there.
    """
    if scenario.agents.order == 1:
        return _resolving_descent(scenario, sampled, scheme, across=across)
    n, agents = scenario.start.n, scenario.agents
    masses = np.broadcast_to(np.asarray(agents.masses, dtype=np.float64), n)
    # Coefficients of what resists motion of each agent, and squares of frequencies.
    drag = np.broadcast_to(np.asarray(agents.damping, dtype=np.float64), n) / masses
    fastest = 0.0
    for number, pairs in enumerate(sampled):
        if pairs is None or not len(pairs.agent):
            continue
        stiff = np.zeros(len(pairs.agent))
        for term in scenario.law.pair_terms:
            if scenario.law.graph_number(term) != number:
                continue
            if isinstance(term, Gradient):
                stiff += _stiffness(term, pairs.distance, across)
            elif across or _is_unweighted(term):
                drag = drag + np.bincount(pairs.agent, _coefficients(term, pairs, scenario), minlength=n) / masses
        fastest = max(fastest, float((2.0 * np.bincount(pairs.agent, stiff, minlength=n) / masses).max()))
    springs = np.zeros(n)
    for body in scenario.law.body_terms:
        scale = 1.0 if getattr(body, "per_mass", False) else 1.0 / masses
        for name, value in body.parameters.items():
            if name == "velocity_gain":
                drag = drag + _largest_of_each(value) * scale
            elif name == "position_gain":
                springs = springs + _largest_of_each(value) * scale
    limits = [np.inf]
    limits += [PERIODS / float(np.sqrt(square)) for square in (fastest, float(springs.max())) if square > 0]
    if drag.max() > 0:
        limits.append((DAMPED if scheme == "damped" else DAMPING) / float(drag.max()))
    return float(min(limits))


def _resolving_descent(
    scenario: Scenario, sampled: Sequence[SampledPairs | None], scheme: str, *, across: bool
) -> float:  # fmt: skip
    """The same for agents of order 1: the curvature of all potentials at an agent bounds its rate of descent."""
    n, fastest = scenario.start.n, 0.0
    for number, pairs in enumerate(sampled):
        if pairs is None or not len(pairs.agent):
            continue
        bend = np.zeros(len(pairs.agent))
        for term in scenario.law.pair_terms:
            if isinstance(term, Gradient) and scenario.law.graph_number(term) == number:
                bend += _stiffness(term, pairs.distance, across)
        fastest += 2.0 * float(np.bincount(pairs.agent, bend, minlength=n).max())
    for body in scenario.law.body_terms:
        fastest += sum(_largest(value) for name, value in body.parameters.items() if name == "position_gain")
    return DESCENTS[scheme] / fastest if fastest > 0 else np.inf


def _stiffness(term: Gradient, r: Array, across: bool) -> Array:
    """Curvature of the potential along the pair, and across it; zero at contact, where the force has no direction.

    Without ``across`` only what drives pairs back to where they were: what drives them away does not oscillate.
    """
    near, far = r * (1 - PROBE), r * (1 + PROBE)
    with np.errstate(all="ignore"):
        bend = (term.potential.slope(far) - term.potential.slope(near)) / (far - near)
        if not across:
            return np.where((r > 0) & np.isfinite(bend), np.maximum(bend, 0.0), 0.0)
        turn = np.abs(term.potential.slope(r)) / r
        return np.where(r > 0, np.where(np.isfinite(bend), np.abs(bend), 0.0) + np.where(r > 0, turn, 0.0), 0.0)


def _is_unweighted(term: Term) -> bool:
    """Whether the coefficients of a term are known from its numbers alone."""
    return isinstance(term, Consensus) and not term.weighted and not term.functional


def _coefficients(term: Term, pairs: SampledPairs, scenario: Scenario) -> Array:
    """Coefficients of the velocities of pairs, from gains and pair weights; those of graphs count as 1."""
    values = term.parameters
    gain = _largest_of_each(values.get("gain", 1.0))
    found = np.broadcast_to(gain[pairs.agent] if gain.ndim else gain, len(pairs.agent))
    weights = values.get("weights")
    if not isinstance(weights, PairWeights):
        return found
    return found * weights.of_pairs(pairs.agent, pairs.other, scenario.agents.headings, scenario.start.n)


def _largest(value: object) -> float:
    """Largest value of a gain over time."""
    return float(np.max(_largest_of_each(value)))


def _largest_of_each(value: object) -> Array:
    """Largest value over time of a gain, one or one for each agent, shape () or (N,)."""
    values = value.values if isinstance(value, Schedule) else [value]
    return np.asarray(np.max([np.asarray(v, dtype=np.float64) for v in values], axis=0))
