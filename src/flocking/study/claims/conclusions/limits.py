"""Claims about limits of a motion; `flocking.study.claims.settling` states when a run is long enough for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flocking.arrays import Mask, Numbers
from flocking.model.checks import NO_LESS, Array
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.weights import PairWeights
from flocking.model.terms.pair_terms import Gradient, PairTerm
from flocking.model.terms.state_symbols import PairStates
from flocking.study.claims.claim import Measure, above
from flocking.study.claims.conclusions.frames import with_frame
from flocking.study.claims.settling import (
    LAST,
    MOVED,
    configuration_unsettled,
    held_for_long,
    limit_of,
    limit_of_series,
)
from flocking.study.claims.subjects import Subject, Witness, about
from flocking.study.evidence import Evidence
from flocking.study.potentials.equilibrium import Equilibrium

SETTLED = 1e-2
"""A quantity counts as zero in the limit when it fell to this fraction of its largest value in the run."""

STATIONARY = 1e-3
"""Forces count as balanced when they cancel to this fraction of the sum of their sizes."""


def _farthest_velocity(e: Evidence) -> Witness:
    offsets = np.linalg.norm(e.run.p[-1] - e.mean_velocity[-1], axis=1)
    return Witness(float(e.run.t[-1]), (int(offsets.argmax()),))


def _last_switch(e: Evidence) -> Witness:
    row = e.link_switches[-1]
    return Witness.pair(row["time"], row["i"], row["j"])


def _unbalanced(e: Evidence) -> Witness:
    return Witness(float(e.run.t[-1]), (int(np.linalg.norm(e.equilibrium.forces, axis=1).argmax()),))


@about(Subject.SPREAD, _farthest_velocity, while_connected=True)
def velocities_agree(e: Evidence) -> Measure:
    """Velocity spread at the end against the largest of the run."""
    most = _resolved_spread(e)
    ratios = e.velocity_spread / most if most > 0 else np.zeros_like(e.velocity_spread)
    found = limit_of_series(
        e, e.spread_times, ratios, SETTLED, lambda r: f"spread fell to {r:.1e} of its maximum", error=_velocity_share(e)
    )
    return with_frame(e, found)


@about(Subject.NET, while_connected=True)
def positions_agree(e: Evidence) -> Measure:
    """Largest distance of two agents at the end against the largest of the run."""
    sizes = e.diameter
    most = float(sizes.max())
    ratios = sizes / most if most > 0 else np.zeros_like(sizes)
    error = e.late_errors[0] / most if most > 0 else 0.0
    return limit_of_series(
        e, e.t, ratios, SETTLED, lambda r: f"distances fell to {r:.1e} of their maximum", error=error
    )


@about(Subject.NET, while_connected=True)
def distances_settle(e: Evidence) -> Measure:
    """Fastest change of a pair distance at the end against the largest velocity spread of the run."""
    e.need_few()
    most = 2 * _resolved_spread(e)

    def ratio(frame: int) -> float:
        return e.distance_rate_at(frame) / most if most > 0 else 0.0

    error = _velocity_share(e) + (e.distance_rate_error / most if most > 0 else 0.0)
    found = limit_of(
        e, SETTLED, ratio, lambda r: f"distances change at {r:.1e} of twice the largest spread", error=error
    )
    if found.holds and not found.unsettled and e.path_about_mean < MOVED and not velocities_agree(e).holds:
        return replace(found, unsettled="velocities differ, and agents have hardly moved against each other")
    return found


def _resolved_spread(e: Evidence) -> float:
    """The largest velocity spread of the run; 0 where it is no more than rounding, so that all velocities are equal."""
    return e.largest_spread if e.largest_spread > e.spread_rounding else 0.0


def _velocity_share(e: Evidence) -> float:
    """Error of a difference of two velocities at the end, by the largest spread."""
    error = e.late_errors[1]
    if not error or e.run.n == 1 or max(error, e.largest_spread) <= e.spread_rounding:
        return 0.0
    return error / e.largest_spread if e.largest_spread > 0.0 else np.inf


@about(Subject.LINKS, _last_switch)
def switching_stops(e: Evidence) -> Measure:
    """Whether the last tenth of the run is free of switches.

    The motion has then settled if velocities agree, or if no pair would reach a radius at its present velocities.
    Switching counts as permanent where it is no rarer in the last tenth than before and the velocity spread stays.
    """
    e.need_one_motion()
    e.need_end(float(e.t[-1]))
    start, end = float(e.t[0]), float(e.t[-1])
    first, last = e.quiet_since if e.law.graph.moves else (e.last_switch, e.last_switch)
    quiet, possible = ((end - t) / (end - start) if end > start else 1.0 for t in (first, last))
    if quiet > LAST >= possible:
        return Measure(quiet - LAST, np.inf, e.doubt_note())
    measured = above(quiet, LAST, _last_in_words(e, first))
    if not e.law.graph.moves:
        return measured
    agreement = velocities_agree(e)
    if measured.margin > 0:
        if why := held_for_long(e):
            return replace(measured, unsettled=why)
        settled = (agreement.holds and not agreement.unsettled) or not _meets_a_radius(e)
        return measured if settled else replace(measured, unsettled="agents still move past each other")
    times, share = e.link_switches["time"], LAST * (end - start)
    last, before = (int(((times > b - share) & (times <= b)).sum()) for b in (end, end - share))
    if last >= before > 0 and not agreement.holds and not agreement.unsettled and _recurs(e, end - share):
        return measured
    return replace(measured, unsettled=f"{last} switches in the last tenth of the run, {before} in the one before")


def _last_in_words(e: Evidence, last: float) -> str:
    """When the last certain switch was; without one the motion counts as quiet from its start on, where none was."""
    if not e.law.graph.moves:
        return "no switch"
    if e.link_certain.any():
        return f"last switch at t = {e.when(last)}"
    return "no certain switch" if len(e.link_switches) or len(e.link_doubts) else "no switch"


def _recurs(e: Evidence, since: float) -> bool:
    """Whether a pair that has switched twice switches again after a time: in free flight in open space none does."""
    if not e.run.scenario.space.is_open:
        return True
    switches = e.link_switches
    i: Numbers = switches["i"]
    j: Numbers = switches["j"]
    early: Mask = switches["time"] <= since
    pairs = np.stack([np.minimum(i, j), np.maximum(i, j)], axis=1)
    found, counts = np.unique(pairs[early], axis=0, return_counts=True)
    often = {tuple(pair) for pair in found[counts >= 2].tolist()}
    return any(tuple(pair) in often for pair in pairs[~early].tolist())


def _meets_a_radius(e: Evidence) -> bool:
    """Whether a pair would switch if all agents kept their velocities from the end on.

    Where space repeats, agents that move past each other are taken to meet at last, by one image or another.
    """
    e.need_few()
    p, links = e.p[-1], e.end_links
    enters, leaves = (np.asarray(r)[..., None] for r in (e.law.graph.appear_radius, e.law.graph.break_radius))
    moving = (p[None] != p[:, None]).any(axis=2)
    _, nearest = e.straight_ahead
    switches = np.where(links, moving & np.isfinite(leaves), nearest < enters)
    if not e.run.scenario.space.is_open:
        switches |= moving
    np.fill_diagonal(switches, False)
    return bool(switches.any())


def _force_scale(e: Evidence) -> float:
    """Stiffness times link length, the unit of forces."""
    lengths = e.equilibrium.r
    return e.largest_stiffness * float(lengths.mean()) if len(lengths) else 0.0


def _imbalance_at(e: Evidence, frame: int, scale: float) -> float:
    found = e.equilibrium if frame in (-1, len(e.t) - 1) else e.equilibrium_at(frame)
    largest = float(np.linalg.norm(found.forces, axis=1).max(initial=0.0)) if len(found.r) else 0.0
    # Without any stiffness no force is small: its unit alone would decide.
    return largest / scale if scale > 0 else np.inf if largest > 0.0 else 0.0


def imbalance(e: Evidence) -> float:
    """Largest potential force on an agent at the end, against stiffness times link length; 0 without links."""
    return _imbalance_at(e, -1, _force_scale(e))


@about(Subject.NET, _unbalanced)
def forces_vanish(e: Evidence) -> Measure:
    """Whether the potential forces of every agent cancel at the end."""
    if len(e.equilibrium.r) == 0:
        absent = e.beyond_radius_at_end() if e.law.graph.moves else None
        return Measure(np.inf, 0.0, "no links", configuration_unsettled(e), everywhere=False, absent=absent)
    scale = _force_scale(e)
    return limit_of(
        e, STATIONARY, lambda k: _imbalance_at(e, k, scale),
        lambda r: f"largest force is {r:.1e} of stiffness times length", error=_force_error(e),
    )  # fmt: skip


def _force_error(e: Evidence) -> float:
    """Error of the imbalance of forces where samples have errors: every link of an agent is that much too long.

    The stated error of a computed run, which is of places and not of distances, is not counted.
    """
    found = e.equilibrium
    if not e.position_error or not len(found.r):
        return 0.0
    links = int(np.bincount(found.i, minlength=e.run.n).max())
    return links * 2.0 * e.position_error * float(np.sqrt(e.q.shape[2])) / float(found.r.mean())


def potential_is_minimal(e: Evidence) -> Measure:
    """Smallest stiffness of the total potential at the end: negative where it is no local minimum.

    The imbalance of the forces is its error.
    """
    error = imbalance(e) + _force_error(e)
    # Raises where the configuration cannot be judged, before all eigenvalues, which take long for many agents.
    unsettled = configuration_unsettled(e)
    stiffness = e.stiffness
    largest = float(np.abs(stiffness).max(initial=0.0))
    ratio = float(stiffness[0]) / largest if largest > 0 else 0.0
    note = f"smallest stiffness {ratio:.1e} of the largest"
    return Measure(ratio + STATIONARY, error, note, unsettled, everywhere=False)


def agents_at_their_minimum(e: Evidence) -> Measure:
    """Whether every agent's V_i is at the sum of its pairs' smallest values.

    V_i is of the links, and of all others too where pairs without a link store an energy (Tanner II U_i, Shi V^i).
    """
    from flocking.study.claims.potential_minimum import smallest_value

    reach = float(np.max(np.asarray(e.law.graph.break_radius)))
    lowest = sum(smallest_value(p, reach)[1] for p in e.equilibrium.potentials)
    unlinked = e.run.scenario.energy.unlinked

    def potentials(found: Equilibrium) -> tuple[Array, Array]:
        """V_i of every agent, and the number of pairs in it."""
        degree = np.bincount(found.i, minlength=e.run.n).astype(float)
        if not unlinked:
            return found.agent_potentials, degree
        return found.agent_potentials + (e.run.n - 1 - degree) * unlinked, np.full(e.run.n, e.run.n - 1.0)

    scale = max(float(np.abs(potentials(e.equilibrium)[0]).max(initial=0.0)), NO_LESS)

    def excess(frame: int) -> float:
        each, pairs = potentials(e.equilibrium_at(frame))
        return float((each - pairs * lowest).max(initial=0.0)) / scale

    return limit_of(
        e, STATIONARY, excess, lambda worst: f"an agent's potential is {worst * scale:.3g} above its minimum"
    )


def needs_potential(e: Evidence) -> str:
    """Why there is no potential over the law's graph whose equilibria could be judged."""
    graph = e.law.graph
    gradients = [t for t in e.law.pair_terms if isinstance(t, Gradient)]
    if any(e.law.graph_number(t) for t in gradients):
        return "a potential acts over another graph"
    if any(isinstance(value, PairWeights) for value in graph.parameters.values()):
        return "the weights of links depend on headings"
    if graph.parameters and any(t.weighting == "force" for t in gradients):
        return "forces are weighted, not the potential"
    return "" if gradients else "the law has no potential over its graph"


def needs_free(e: Evidence) -> str:
    """Why the forces of the potential need not balance: there is none, or a body term acts."""
    if why := needs_potential(e):
        return why
    pulling = next((t for t in e.law.pair_terms if not isinstance(t, Gradient) and pulls_at_rest(t, e.law.graph)), None)
    if pulling is not None:
        return f"{type(pulling).__name__} acts between agents at rest, beside the potential"
    return "a body term acts from outside" if e.law.body_terms else ""


def pulls_at_rest(term: PairTerm, graph: Graph) -> bool:
    """Whether a pair term may exert a force on agents that do not move relative to each other, or store energy.

    Parameters
    ----------
    term
        The term.
    graph
        The graph of its law.
    """
    from sympy import sympify

    x = PairStates(term, term.over or graph).symbols
    at_rest = sympify(term.along(x)).subs({x.radial: 0, x.speed2: 0})
    return bool(at_rest != 0 or sympify(term.storage(x)) != 0)


def needs_total_potential(e: Evidence) -> str:
    """Why there is no total potential: see `needs_free`, or links are one-way."""
    return needs_free(e) or ("links are one-way" if e.law.graph.directed else "")
