"""Claims about energy and momentum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flocking.engine.adaptive_steps.state_tolerances import state_tolerances
from flocking.formula.safe_digits import compared_texts
from flocking.model.bodies.point_bodies import is_point_mass
from flocking.study.claims.claim import Measure, below
from flocking.study.claims.conclusions.frames import frame_note
from flocking.study.claims.subjects import Subject, Witness, about
from flocking.study.evidence import Evidence, NotMeasurable, NotResolvable

SUPPLY_ROUNDING = 1e-12
"""Supplied energy that rounding explains, as a share of the energy moved."""

DRIFT_TOLERANCES = 100
"""The mean velocity may change by this many tolerances: as many as a ledger may be open by, see `LEDGER_FACTOR`."""

LEAST = float(np.finfo(np.float64).smallest_subnormal)
"""The margin of what is at its bound and may be: the least positive number."""

ROUNDING = 1e-9
"""Relative error of energies and speeds that is rounding: sums over some thousand agents and ten thousand rows."""


def _worst_residual(e: Evidence) -> Witness:
    return Witness(float(e.run.trace["time"][int(np.abs(e.run.residual).argmax())]))


def _largest_rise(e: Evidence) -> Witness:
    rises = e.changes("energy") - e.changes("jumped")
    return Witness(float(e.run.trace["time"][1 + int(rises.argmax())]))


def _fastest_agent(e: Evidence) -> Witness:
    frame = int(e.speeds.argmax())
    return Witness(float(e.run.t[frame]), (int(np.linalg.norm(e.run.p[frame], axis=1).argmax()),))


@about(Subject.LEDGER, _worst_residual, lasting=True)
def ledger_residual(e: Evidence) -> Measure:
    """Residual of the energy ledger against what the tolerance allows; links and forces must be the declared ones."""
    if e.foreign_link or e.foreign_force:
        return Measure(-1.0, 0.0, e.foreign_link or e.foreign_force)
    if e.foreign_motion or e.ledger_doubt:
        raise NotResolvable(e.foreign_motion or e.ledger_doubt)
    if e.residual == 0.0 == e.ledger_bound:
        return Measure(np.inf, 0.0, e.ledger_note)
    return below(e.residual, e.ledger_bound, e.ledger_note)


@about(Subject.VELOCITIES, _fastest_agent, lasting=True)
def momentum_drift(e: Evidence) -> Measure:
    """Largest change of the mean velocity against rounding and tolerance."""
    if len(e.t) < 2:
        raise NotResolvable("one frame does not show whether the mean velocity changes")
    drift = float(np.abs(e.mean_velocity - e.mean_velocity[0]).max(initial=0.0))
    # Tolerances of engines are absolute errors in usual units; samples are judged in their own, however small.
    absolute = 0.0 if e.sampled and float(e.speeds.max()) > 0.0 else _velocity_tolerance(e)
    note = f"mean velocity moved by {drift:.1e}"
    found = within_tolerances(e, drift, DRIFT_TOLERANCES, absolute, note, 2.0 * e.velocity_error)
    if found.holds:
        # What frames show refutes; what they do not show of the rest of the run proves nothing.
        e.need_end(float(e.t[-1]))
    # A conserved quantity is decided at any time. Steps of fixed length keep it as the law does: by forces that cancel.
    return replace(found, everywhere=False, conserved=e.fixed_step and not needs_momentum(e))


def within_tolerances(
    e: Evidence, off: float, tolerances: float, absolute: float, note: str, error: float = 0.0
) -> Measure:
    """A difference of mean velocities against tolerances of the engine.

    Between what the tolerance allows relative to the largest speed, and what it allows at all, nothing is decided.

    Parameters
    ----------
    e
        The evidence.
    off
        The difference.
    tolerances
        How many tolerances it may be.
    absolute
        Absolute tolerance of velocities.
    note
        The difference in words.
    error
        Error of the difference.
    """
    fastest = float(e.speeds.max())
    of_speeds, most = tolerances * e.run.scenario.tolerance * fastest, tolerances * absolute
    if of_speeds < off < most:
        note += f", the largest speed is {fastest:.1e}: the absolute tolerance of the engine may explain it"
        return Measure(most - off, np.inf, note)
    return below(off, max(of_speeds, most), note, error)


def _velocity_tolerance(e: Evidence) -> float:
    """Absolute tolerance of velocities of an engine with adaptive steps; of speeds below 1 in usual units, of 1."""
    scenario = e.run.scenario
    duration = scenario.t_end - scenario.start.t
    return min(scenario.tolerance, float(state_tolerances(scenario.start, 2, scenario.tolerance, duration)[-1]))


@about(Subject.LEDGER, _largest_rise, lasting=True)
def energy_rise(e: Evidence) -> Measure:
    """Largest rise of the energy between switches against the bound of the ledger."""
    rise = float((e.changes("energy") - e.changes("jumped")).max(initial=0.0))
    # A fixed step may miss some energy in every step.
    allowed = e.step_residual if e.fixed_step else e.ledger_bound
    note = f"largest rise {rise:.1e} between switches"
    if rise == 0.0 == allowed:
        return Measure(np.inf, 0.0, note)
    if e.changes("supplied").any() and rise < allowed:
        # Dissipation is never negative: only supplied energy makes the energy rise.
        gained = float((e.changes("supplied") - e.changes("dissipated")).max(initial=0.0))
        if gained > SUPPLY_ROUNDING * e.energy_moved:
            return Measure(
                allowed - rise, np.inf, f"{note}; the law supplies {gained:.1e}, less than the ledger resolves"
            )
    return below(rise, allowed, note)


def supplied_energy(e: Evidence) -> float:
    """Total absolute energy supplied over the run; 0 where rounding explains it.

    The formula of what passive terms supply is zero, so that an error of the motion makes nothing of it.
    """
    supplied = float(np.abs(e.changes("supplied")).sum())
    return supplied if supplied > _supply_rounding(e) * e.energy_moved else 0.0


def _supply_rounding(e: Evidence) -> float:
    """The share `SUPPLY_ROUNDING`, in the precision of the run."""
    return SUPPLY_ROUNDING * float(np.finfo(e.run.q.dtype).eps / np.finfo(np.float64).eps)


@about(Subject.LEDGER, lasting=True)
def energy_continuous(e: Evidence) -> Measure:
    """Total absolute jump of the energy at switches."""
    jumps = float(np.abs(e.changes("jumped")).sum())
    largest = float(np.abs(e.trace["energy"]).max())
    allowed = ROUNDING * largest
    if jumps > allowed:
        allowed = max(allowed, e.cancelled)
    over = f" over {len(e.link_switches)} switches" if e.switches_known else ""
    note = f"jumps add up to {jumps:.1e}{over}"
    if ROUNDING * largest < jumps < allowed:
        # Terms that cancel in the energies may have rounded by as much.
        return Measure(
            allowed - jumps, np.inf, f"{note}, the largest energy is {largest:.1e}: rounding may explain them"
        )
    return below(jumps, allowed, note)


def speeds_bounded(factor: float) -> Callable[[Evidence], Measure]:
    """Largest speed against sqrt(factor c), c the initial energy."""

    @about(Subject.VELOCITIES, lasting=True)
    def conclusion(e: Evidence) -> Measure:
        bound = float(np.sqrt(max(factor * e.trace["energy"][0], 0.0)))
        return at_most(e, "speed", float(e.speeds.max()), bound)

    return conclusion


def at_most(e: Evidence, name: str, seen: float, bound: float) -> Measure:
    """Largest value of a quantity over the run against a bound; frames alone can refute it but not show it.

    Parameters
    ----------
    name
        Name of the quantity, as in `flocking.engine.runs.run.Accuracy`.
    seen
        Its largest value at the frames.
    """
    found = e.largest(name)
    if seen == 0.0 == bound and (found is None or found.value <= 0.0):
        # Agents that rest keep a bound of zero; samples and frames alone show no more than themselves.
        unseen = found is None and not e.sampled
        return Measure(np.inf, np.nan if unseen else 0.0, f"largest {name} 0, bound 0")
    if found is None:
        largest, limit = compared_texts(seen, bound)
        note = f"largest {name} at {len(e.t)} frames {largest}, bound {limit}"
        known = seen > bound or e.sampled
        error = 0.0 if known else np.inf
        if e.sampled:
            error += 2.0 * (e.velocity_error + e.position_error) * float(np.sqrt(e.q.shape[2]))
        return _no_more(seen, bound, note if known else f"{note}; nothing is known between", error)
    value, error = max(seen, found.value), max(found.error, ROUNDING * bound)
    largest, limit = compared_texts(value, bound)
    return _no_more(value, bound, f"largest {name} {largest} at t = {e.when(found.time, 3)}, bound {limit}", error)


def _no_more(value: float, bound: float, note: str, error: float) -> Measure:
    """A measure that holds when ``value <= bound``: what is exactly at its bound, as 0 at rest, does not exceed it."""
    return Measure(bound - value if value != bound else LEAST, error, note)


def needs_ideal(e: Evidence) -> str:
    """Why other forces acted than those of the law on the present state; the ledger counts them as departed."""
    world = e.run.scenario.imperfections
    return f"not the forces of the law on the present state acted: {world}" if world else ""


def opposite_forces(e: Evidence) -> Measure:
    """That the forces of pairs are all that acts, equal and opposite: the claim does not apply elsewhere."""
    if why := needs_momentum(e):
        raise NotMeasurable(why)
    return Measure(np.inf, 0.0, "forces of pairs alone, equal and opposite", everywhere=False)


def needs_momentum(e: Evidence) -> str:
    """Why momentum is not conserved: a force from outside, or forces that are not equal and opposite."""
    if e.replaced:
        return e.replaced
    if world := needs_ideal(e):
        return "; ".join(filter(None, (world, frame_note(e))))
    if e.law.body_terms:
        return "a body term acts from outside"
    if "momentum" not in e.law.symmetries:
        return "pair forces are not equal and opposite"
    agents = e.run.scenario.agents
    if agents.order == 1 and np.ptp(agents.masses):
        return "agents of order 1 have different masses"
    if agents.order == 2 and not is_point_mass(agents):
        return "agents are not point masses"
    return "agents are damped" if np.ndim(agents.damping) or agents.damping else ""


def needs_passive(e: Evidence) -> str:
    """Why the energy may rise: it is supplied, or other forces act than those of the law."""
    return needs_ideal(e) or ("the law supplies energy" if supplied_energy(e) else "")


def needs_ledger(e: Evidence) -> str:
    """Why there is no ledger: none was recorded, or samples hold no velocities to compute one."""
    if len(e.run.trace) < 2:
        return f"the run has no ledger{e.why_no_ledger}"
    sampled = e.sampled and e.run.scenario.agents.order == 1
    return "samples of agents of order 1 hold no velocities" if sampled else ""
