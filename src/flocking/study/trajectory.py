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
from flocking.model.graphs.distance_graphs import Graph, pair_distances
from flocking.model.law import Law, Scenario
from flocking.model.space import OPEN, Space
from flocking.model.state import State
from flocking.model.terms.pair_terms import Gradient

SAMPLES = "samples"
"""Name of the engine in runs made here."""


def run_from_samples(scenario: Scenario, t: Array, q: Reals, p: Reals, *, begins: bool | None = None) -> Run:
    """A run made of samples of a motion under a declared law.

    Links follow the law's graphs from sample to sample; energies are evaluated at the samples, and the powers
    of the ledger are integrated by Simpson's rule. The error is its difference from the trapezoidal rule, and half the
    jump of the power where links switch. Where the motion does not begin at the first sample nothing is known of what
    was before: if links appear and break at different distances, pairs between these are taken as at a start, and
    audits count their links as uncertain. With further graphs of this kind the run has no ledger.

    Parameters
    ----------
    scenario
        The declared law, agents and energy; its end is replaced by that of the samples, and its start by the first one.
    t
        Times, ascending, shape (F,).
    q, p
        Positions and velocities, shape (F, N, m).
    begins
        Whether the motion begins at the first sample, with the links that the graph has at a start. Where absent: if
        the start of the scenario has the time and the positions of the first sample.

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
        return _run_of(scenario, t, q, p, starts_with(scenario, t, q) if begins is None else begins)


def starts_with(scenario: Scenario, t: Array, q: Reals, rounding: float = 0.0) -> bool:
    """Whether the start of a scenario has the time and the positions of the first sample.

    Parameters
    ----------
    scenario
        The scenario.
    t, q
        Times and positions of the samples, shape (F,) and (F, N, m).
    rounding
        Most that a coordinate was rounded by where it was stored.
    """
    start = scenario.start
    return bool(start.t == t[0]) and start.q.shape == q[0].shape and bool((np.abs(start.q - q[0]) <= rounding).all())


def _run_of(scenario: Scenario, t: Array, q: Reals, p: Reals, begins: bool) -> Run:
    space, law, given = scenario.space, scenario.law, scenario.start
    first = given.links if begins and given.n == q.shape[1] else None
    followed = [_links_of(scenario, graph, q, None if number else first) for number, graph in enumerate(law.graphs)]
    links = followed[0]
    linked, free = closest_of(t, q, links, space)
    # What an audit takes to be known of the memory of links.
    start = State(q[0], p[0], float(t[0]), links[0] if begins and law.graph.moves else None)
    declared = scenario.with_(start=start, t_end=float(t[-1]), frames=tuple(float(s) for s in t))
    # In discrete time velocities jump: no powers are integrated, and there is nothing between two updates.
    none_kept = unseen_links(law) or scenario.agents.discrete
    trace, rule = (ledger_of([]), LedgerRule()) if none_kept else _ledger(scenario, t, q, p, followed)
    gap = largest_gap(t, p)
    account = Fidelity(SAMPLES, sampled=True, approaches=Approaches("all", gap), ledger=rule)
    about: dict[str, object] = {"engine": SAMPLES, "gap": gap}
    if rule.kind == "estimate":
        about |= {"ledger_error": rule.size, "switch_error": rule.switch_error}
    none = np.zeros(0, dtype=SWITCH_FIELDS)
    return Run(declared, t, q, p, np.array(links), none, trace, linked, free, "finished", about, fidelity=account)


def _links_of(scenario: Scenario, graph: Graph, q: Reals, first: Links | None) -> list[Links]:
    """Links of a graph at every sample: ``first`` at the first one, or where it is None those of a start there."""
    space, headings = scenario.space, scenario.agents.headings
    links = [graph.links_in(space, q[0], headings) if first is None else np.asarray(first)]
    for place in q[1:]:
        # Graphs that see headings have no memory.
        links.append(
            graph.links_in(space, place, headings) if graph.sees_headings else graph.update(place, links[-1], space)
        )
    return links


def unseen_links(law: Law) -> str:
    """Why samples of a motion under a law have no ledger: they do not show who is linked, or since which distance.

    Parameters
    ----------
    law
        The law.
    """
    for graph in law.graphs[1:]:
        remembers = np.any(np.asarray(graph.appear_radius) < np.asarray(graph.break_radius))
        if graph.moves and remembers and not graph.sees_headings:
            return f"a further graph, {type(graph).__name__}, links pairs by their past"
    for term in law.pair_terms:
        graph = law.graphs[law.graph_number(term)]
        if isinstance(term, Gradient) and graph.sees_headings:
            return f"links of {type(graph).__name__} appear at distances that samples do not show"
    return ""


def _ledger(
    scenario: Scenario, t: Array, q: Reals, p: Reals, followed: list[list[Links]]
) -> tuple[Records, LedgerRule]:
    """The ledger of samples by the powers of the declared law, and how far it is known.

    Parameters
    ----------
    followed
        Links of each graph of the law at every sample.
    """
    links = followed[0]
    with Reading():
        found = evaluate_each(scenario, (State(q[k], p[k], float(t[k]), links[k]) for k in range(len(t))))
    n = q.shape[1]
    unlinked = np.array([0.5 * (n * (n - 1) - int(x.sum())) for x in links]) * scenario.energy.unlinked
    energy = np.array([e.storage + e.kinetic for e in found]) + unlinked
    work = np.array([float((e.u * v).sum()) for e, v in zip(found, p, strict=True)])
    pairs = list(zip(*(itertools.pairwise(x) for x in followed), strict=True))
    switched = np.array([any(bool((a != b).any()) for a, b in each) for each in pairs])
    integrals, errors, switching = zip(
        *(
            _integrate(t, x, switched)
            for x in (work, np.array([e.dissipation for e in found]), np.array([e.supply for e in found]))
        ),
        strict=True,
    )
    jumped = sum((_jumps(scenario, number, x) for number, x in enumerate(followed)), np.zeros(len(t)))
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


def _jumps(scenario: Scenario, number: int, links: list[Links]) -> Array:
    """Sum of the energy jumps of switches: the stored energy of a pair at the distance where its graph switches it.

    Parameters
    ----------
    number
        Number of the graph in the law.
    links
        Its links at every sample.
    """
    law = scenario.law
    graph = law.graphs[number]
    first = np.max(np.asarray(graph.appear_radius))
    last = np.max(np.asarray(graph.break_radius))
    if not graph.moves:
        return np.zeros(len(links))
    apart = scenario.energy.unlinked if number == 0 else 0.0
    gained, lost = (_stored_at(law, number, float(r)) - apart for r in (first, last))
    new = np.array([0, *(int((b & ~a).sum()) for a, b in itertools.pairwise(links))])
    broken_links = np.array([0, *(int((a & ~b).sum()) for a, b in itertools.pairwise(links))])
    steps = 0.5 * (np.where(new > 0, new * gained, 0.0) - np.where(broken_links > 0, broken_links * lost, 0.0))
    return np.asarray(np.cumsum(steps))


def _stored_at(law: Law, number: int, r: float) -> float:
    """Energy a linked pair stores just inside distance ``r``, summed over the potentials of a graph of the law."""
    # The weight of a smooth graph is zero where a link breaks.
    smooth = law.graphs[number].structure != ("hard",)
    terms = [t for t in law.pair_terms if isinstance(t, Gradient) and law.graph_number(t) == number]
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
