"""Sampled trajectories, for example of an experiment, as runs that can be audited."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Links, Reals, Records
from flocking.engine.reference.control import evaluate_each
from flocking.engine.runs.fidelity import Approaches, Fidelity, LedgerRule
from flocking.engine.runs.run import SWITCH_FIELDS, TRACE_FIELDS, Closest, Run, ledger_of
from flocking.errors import InvalidInput
from flocking.formula.compiled import Reading
from flocking.model.checks import Array, array
from flocking.model.graphs.distance_graphs import pair_distances
from flocking.model.law import Law, Scenario
from flocking.model.space import OPEN, Space
from flocking.model.state import State
from flocking.model.terms.pair_terms import Gradient

SAMPLES = "samples"
"""Name of the engine in runs made here."""


def run_from_samples(scenario: Scenario, t: Array, q: Reals, p: Reals) -> Run:
    """A run made of samples of a motion under a declared law.

    Links follow the law's graph from sample to sample; energies are evaluated at the samples, and the powers
    of the ledger are integrated by Simpson's rule. The error is its difference from the trapezoidal rule, and half the
    jump of the power where links switch.

    Parameters
    ----------
    scenario
        The declared law, agents and energy; its start and end are replaced by the samples'.
    t
        Times, ascending, shape (F,).
    q, p
        Positions and velocities, shape (F, N, m).

    Raises
    ------
    InvalidInput
        When shapes disagree, a value is not finite, times do not ascend, or there are fewer than three samples.
    """
    t, q, p = (array("trajectory", name, x, ndim=k) for name, x, k in (("t", t, 1), ("q", q, 3), ("p", p, 3)))
    if q.shape != p.shape or len(t) != len(q):
        raise InvalidInput(
            "trajectory", "q", "must have the shape of p and one entry per time", f"{q.shape}, {p.shape}, {len(t)}"
        )
    if scenario.agents.columns:
        raise InvalidInput(
            "trajectory", "scenario", "must have agents whose state is their position and velocity", scenario.agents,
            "Samples of positions and velocities do not contain the other columns.",
        )  # fmt: skip
    if len(t) < 3 or (np.diff(t) <= 0).any():
        raise InvalidInput("trajectory", "t", "must be at least three ascending times", np.asarray(t)[:5].tolist())
    # Overflow leaves values of the ledger that are not finite.
    with np.errstate(all="ignore"):
        return _run_of(scenario, t, q, p)


def _run_of(scenario: Scenario, t: Array, q: Reals, p: Reals) -> Run:
    graph, space = scenario.law.graph, scenario.space
    links = [graph.links_in(space, q[0], scenario.agents.headings)]
    for place in q[1:]:
        links.append(graph.update(place, links[-1], space))
    linked, free = closest_of(t, q, links, space)
    declared = scenario.with_(
        start=State(q[0], p[0], float(t[0])), t_end=float(t[-1]), frames=tuple(float(s) for s in t)
    )
    # In discrete time velocities jump: no powers are integrated, and there is nothing between two updates.
    trace, rule = (ledger_of([]), LedgerRule()) if scenario.agents.discrete else _ledger(scenario, t, q, p, links)
    gap = largest_gap(t, p)
    account = Fidelity(SAMPLES, sampled=True, approaches=Approaches("all", gap), ledger=rule)
    about: dict[str, object] = {"engine": SAMPLES, "gap": gap}
    if rule.kind == "estimate":
        about |= {"ledger_error": rule.size, "switch_error": rule.switch_error}
    none = np.zeros(0, dtype=SWITCH_FIELDS)
    return Run(declared, t, q, p, np.array(links), none, trace, linked, free, "finished", about, fidelity=account)


def _ledger(scenario: Scenario, t: Array, q: Reals, p: Reals, links: list[Links]) -> tuple[Records, LedgerRule]:
    """The ledger of samples by the powers of the declared law, and how far it is known."""
    with Reading():
        found = evaluate_each(scenario, (State(q[k], p[k], float(t[k]), links[k]) for k in range(len(t))))
    n = q.shape[1]
    unlinked = np.array([0.5 * (n * (n - 1) - int(x.sum())) for x in links]) * scenario.energy.unlinked
    energy = np.array([e.storage + e.kinetic for e in found]) + unlinked
    work = np.array([float((e.u * v).sum()) for e, v in zip(found, p, strict=True)])
    switched = np.array([bool((a != b).any()) for a, b in itertools.pairwise(links)])
    integrals, errors, switching = zip(
        *(
            _integrate(t, x, switched)
            for x in (work, np.array([e.dissipation for e in found]), np.array([e.supply for e in found]))
        ),
        strict=True,
    )
    jumped = _jumps(scenario, links)
    trace = np.zeros(len(t), dtype=TRACE_FIELDS)
    trace["time"], trace["energy"], trace["kinetic"] = t, energy, [e.kinetic for e in found]
    trace["work"], trace["dissipated"], trace["supplied"] = integrals
    trace["jumped"] = jumped
    return trace, LedgerRule("estimate", float(errors[1] + errors[2]), float(switching[1] + switching[2]))


def _integrate(t: Array, power: Array, switched: NDArray[np.bool_]) -> tuple[Array, float, float]:
    """Running integral of sampled power, an estimate of its error, and what switches add to that at most.

    Where links switched between two samples the power jumped at an unknown time.

    Parameters
    ----------
    switched
        Whether links switched between each sample and the next, shape (F - 1,).
    """
    from scipy.integrate import cumulative_simpson

    coarse = np.concatenate([[0.0], np.cumsum(np.diff(t) * (power[1:] + power[:-1]) / 2)])
    fine = np.concatenate([[0.0], np.asarray(cumulative_simpson(power, x=t))])
    jumps = np.abs(np.diff(power) * np.diff(t) / 2)[switched]
    return fine, float(np.abs(np.diff(fine - coarse))[~switched].sum()), float(jumps.sum())


def _jumps(scenario: Scenario, links: list[Links]) -> Array:
    """Sum of the energy jumps of switches: the stored energy of a pair at the distance where the graph switches it."""
    law = scenario.law
    first = np.max(np.asarray(law.graph.appear_radius))
    last = np.max(np.asarray(law.graph.break_radius))
    if not law.graph.moves:
        return np.zeros(len(links))
    gained, lost = (_stored_at(law, float(r)) - scenario.energy.unlinked for r in (first, last))
    new = np.array([0, *(int((b & ~a).sum()) for a, b in itertools.pairwise(links))])
    broken_links = np.array([0, *(int((a & ~b).sum()) for a, b in itertools.pairwise(links))])
    steps = 0.5 * (np.where(new > 0, new * gained, 0.0) - np.where(broken_links > 0, broken_links * lost, 0.0))
    return np.asarray(np.cumsum(steps))


def _stored_at(law: Law, r: float) -> float:
    """Energy a linked pair stores just inside distance ``r``, summed over the potentials of the law's own graph."""
    # The weight of a smooth graph is zero where a link breaks.
    smooth = law.graph.structure != ("hard",)
    terms = [t for t in law.pair_terms if isinstance(t, Gradient) and t.over is None]
    return 0.0 if smooth else float(sum(float(t.potential(r)) for t in terms))


def largest_gap(t: Array, p: Reals) -> float:
    """Largest distance by which two agents may have approached each other between samples.

    Parameters
    ----------
    t
        Times, shape (F,).
    p
        Velocities, shape (F, N, m).
    """
    spread = np.linalg.norm(p - p.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    return float((np.diff(t) * np.maximum(spread[1:], spread[:-1])).max()) if len(t) > 1 else math.inf


def closest_of(t: Array, q: Reals, links: list[Links] | None, space: Space = OPEN) -> tuple[Closest, Closest]:
    """Closest approach of linked agents, and of others, at the samples.

    Parameters
    ----------
    t
        Times, shape (F,).
    q
        Positions, shape (F, N, m).
    links
        Link matrices, F of shape (N, N); None where nobody is linked.
    space
        Space of the agents.
    """
    best = [Closest(), Closest()]
    for k, place in enumerate(q):
        distance = pair_distances(place, space)
        either = np.zeros(distance.shape, dtype=bool) if links is None else links[k] | links[k].T
        for number, mask in enumerate((either, ~either)):
            masked = np.where(mask, distance, np.inf)
            i, j = np.unravel_index(int(np.argmin(masked)), masked.shape)
            if masked[i, j] < best[number].distance:
                best[number] = Closest(float(masked[i, j]), float(t[k]), (int(min(i, j)), int(max(i, j))))
    return best[0], best[1]
