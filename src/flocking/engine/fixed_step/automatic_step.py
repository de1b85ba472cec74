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
from flocking.model.law import Scenario
from flocking.model.terms.pair_terms import Gradient, Term
from flocking.model.terms.schedules import Schedule

CONTACT = 1e-12
"""Distance that counts as the least, so that rates at contact are finite; far below any radius of interaction."""

SLOWEST = 1e-9
"""Rate that counts as the least of a leader's spring: its limit of the step is far above the largest step."""

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
    agent
        First agent of each pair, a number below N; all pairs of these agents are included.
    distance
        Distance of the pair.
    speed
        Magnitude of its relative velocity.
    """

    agent: Indices
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
        if pairs is not None and len(pairs.agent) and scenario.law.singular_at_zero():
            closing = float((pairs.speed / np.maximum(pairs.distance, CONTACT)).max())
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
    n = scenario.start.n
    limits = [np.inf]
    mass = float(np.min(scenario.agents.masses))
    damping = float(np.max(scenario.agents.damping))
    for number, pairs in enumerate(sampled):
        if pairs is None or not len(pairs.agent):
            continue
        degree = np.bincount(pairs.agent, minlength=n)
        stiff = np.zeros(len(pairs.agent))
        for term in scenario.law.pair_terms:
            if scenario.law.graph_number(term) != number:
                continue
            if isinstance(term, Gradient):
                stiff += _stiffness(term, pairs.distance, across)
            else:
                damping += _gain(term) * float(degree.max())
        rate = float(np.sqrt(2.0 * np.bincount(pairs.agent, stiff, minlength=n).max() / mass))
        if rate > 0:
            limits.append(PERIODS / rate)
    for body in scenario.law.body_terms:
        for name, value in body.parameters.items():
            if name == "velocity_gain":
                damping += _largest(value)
            elif name == "position_gain":
                limits.append(PERIODS / max(float(np.sqrt(_largest(value))), SLOWEST))
    if damping > 0:
        limits.append((DAMPED if scheme == "damped" else DAMPING) * mass / damping)
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
    """Curvature of the potential along the pair, and across it; zero at contact, where the force has no direction."""
    near, far = np.maximum(r * (1 - PROBE), CONTACT), r * (1 + PROBE)
    with np.errstate(all="ignore"):
        bend = np.abs(term.potential.slope(far) - term.potential.slope(near)) / (far - near)
        turn = np.abs(term.potential.slope(r)) / np.maximum(r, CONTACT) if across else 0.0
        return np.where(r > 0, np.where(np.isfinite(bend), bend, 0.0) + turn, 0.0)


def _gain(term: Term) -> float:
    values = term.parameters
    gain = _largest(values.get("gain", 1.0))
    weights = values.get("weights")
    if weights is None:
        return gain
    return gain * float(getattr(weights, "high", 0.0) or np.max(getattr(weights, "values", 1.0)))


def _largest(value: object) -> float:
    """Largest value of a gain over time."""
    values = value.values if isinstance(value, Schedule) else [value]
    return max(float(np.max(np.asarray(v))) for v in values)
