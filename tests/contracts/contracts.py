"""The contracts: what every law must keep. Each is a function of a case; a user's own term can be held against all.

A contract that a law does not declare in its symmetries is not asked of it, unless ``declared`` is overruled.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import flocking as fk
from flocking.engine.reference.control import Evaluation
from flocking.model.symmetries import SYMMETRIES
from tests.contracts.strategies import Case


def forces(case: Case) -> np.ndarray:
    return fk.control(case.law, case.state, agents=case.agents)


def scale(case: Case) -> float:
    return 1.0 + float(np.abs(forces(case)).max()) + float(evaluated(case).pair_force_sum.max())


def evaluated(case: Case, energy: fk.Energy | None = None) -> Evaluation:
    return fk.evaluate(case.law, case.state, agents=case.agents, energy=energy)


def momentum(case: Case) -> None:
    """Pair forces cancel: their sum is zero."""
    assert np.abs(forces(case).sum(axis=0)).max() <= 1e-12 * case.state.n * scale(case)


def rotation(case: Case) -> None:
    """Turned or mirrored states have turned or mirrored forces."""
    turn, _ = np.linalg.qr(case.rng.normal(size=(case.state.dimension,) * 2))
    turned = case.with_state(q=case.state.q @ turn, p=case.state.p @ turn)
    assert forces(turned) == pytest.approx(forces(case) @ turn, abs=1e-11 * scale(case))


def relabelling(case: Case) -> None:
    """Agents have no names: renumbering them renumbers the forces."""
    order = case.rng.permutation(case.state.n)
    agents = fk.Agents(case.agents.masses[order], case.agents.damping[order])
    links = case.state.links[np.ix_(order, order)]
    state = fk.State(case.state.q[order], case.state.p[order], case.state.t, links)
    assert fk.control(case.law, state, agents=agents) == pytest.approx(forces(case)[order], abs=1e-12 * scale(case))


def galilean(case: Case) -> None:
    """No place and no constant velocity is special."""
    place, speed = (case.rng.normal(size=case.state.dimension) for _ in range(2))
    moved = case.with_state(q=case.state.q + place, p=case.state.p + speed)
    assert forces(moved) == pytest.approx(forces(case), abs=1e-11 * scale(case))


def locality(case: Case) -> None:
    """What is no neighbour of i may do anything: u_i stays the same to the last bit."""
    n = case.state.n
    linked = np.logical_or.reduce(case.links) | np.eye(n, dtype=bool)
    before = forces(case)
    for i in range(n):
        strangers = np.flatnonzero(~linked[i])
        q, p = np.array(case.state.q), np.array(case.state.p)
        q[strangers] += 1000 + 10 * strangers[:, None]
        p[strangers] -= 7
        after = forces(case.with_state(q=q, p=p))
        assert (after[i] == before[i]).all()


CONTRACTS: dict[str, Callable[[Case], None]] = {
    "momentum": momentum, "rotation": rotation, "relabelling": relabelling, "galilean": galilean,
    "locality": locality,
}  # fmt: skip
assert set(CONTRACTS) == SYMMETRIES


def declared(case: Case) -> None:
    """Every symmetry the law declares."""
    for name in sorted(case.law.symmetries):
        CONTRACTS[name](case)


def gradient(case: Case) -> None:
    """At rest, the force is minus the gradient of the storage, links held fixed."""
    if not case.structure.conservative:
        return
    rest = case.with_state(p=np.zeros_like(case.state.p))
    h = 1e-6
    slope = np.empty_like(case.state.q)
    for place in np.ndindex(slope.shape):
        values = []
        for sign in (1, -1):
            q = np.array(case.state.q)
            q[place] += sign * h
            values.append(evaluated(rest.with_state(q=q)).storage)
        slope[place] = (values[0] - values[1]) / (2 * h)
    assert forces(rest) == pytest.approx(-slope, abs=1e-6 * scale(rest))


def power(case: Case, energy: fk.Energy) -> None:
    """Along the motion, kinetic energy and storage change by what is supplied and dissipated."""
    here = evaluated(case, energy)
    masses, damping = case.agents.masses[:, None], case.agents.damping[:, None]
    acceleration = (here.u - damping * case.state.p) / masses
    h = 1e-5
    totals = []
    for s in (h, -h):
        q = case.state.q + s * case.state.p + s**2 / 2 * acceleration
        there = evaluated(case.with_state(q=q, p=case.state.p + s * acceleration, t=case.state.t + s), energy)
        totals.append(there.kinetic + there.storage)
    rate = (totals[0] - totals[1]) / (2 * h)
    size = 1 + abs(here.kinetic) + abs(here.storage) + abs(here.supply) + abs(here.dissipation) + scale(case) ** 2
    assert abs(rate - (here.supply - here.dissipation)) <= 1e-7 * size


def alone(case: Case) -> None:
    """Every agent finds its own force from its neighbours alone, where the law is distributed."""
    if not case.law.distributed:
        return
    q, p, u = case.state.q, case.state.p, forces(case)
    for i in range(case.state.n):
        seen = {
            graph: [fk.Agent(q[j], p[j], int(j)) for j in np.flatnonzero(links[i])]
            for graph, links in zip(case.law.graphs, case.links, strict=True)
        }
        found = fk.control_of(
            case.law, fk.Agent(q[i], p[i], i), seen, case.state.t,
            mass=float(case.agents.masses[i]), damping=float(case.agents.damping[i]),
        )  # fmt: skip
        assert found == pytest.approx(u[i], abs=1e-12 * scale(case))


def brute_force(case: Case) -> None:
    """Two plain loops over agents and neighbours find the same forces."""
    q, p, m = case.state.q, case.state.p, case.agents.masses
    u = np.zeros_like(q)
    for term in case.law.terms:
        for i in range(case.state.n):
            if isinstance(term, fk.BodyTerm):
                u[i] += _body(term, case, i)
                continue
            links = case.links[case.law.graph_number(term)]
            for j in range(case.state.n):
                if links[i, j]:
                    u[i] += _pair(term, case, i, j, q, p)
    assert len(m) == len(u)
    assert forces(case) == pytest.approx(u, abs=1e-11 * scale(case))


def _pair(term: fk.PairTerm, case: Case, i: int, j: int, q: np.ndarray, p: np.ndarray) -> np.ndarray:
    own = case.structure.brute.get(type(term))
    if own is not None:
        return own(term, i, j, q, p)
    if isinstance(term, fk.Gradient):
        r = float(np.linalg.norm(q[j] - q[i]))
        return float(term.potential.slope(r)) * (q[j] - q[i]) / r
    if isinstance(term, fk.VelocityAverage):
        count = case.links[case.law.graph_number(term)][i].sum()
        return np.broadcast_to(term.gain, len(q))[i] / (1 + count) * (p[j] - p[i])
    if isinstance(term, fk.CuckerSmale):
        return term.gain / (term.scale**2 + ((q[j] - q[i]) ** 2).sum()) ** term.exponent * (p[j] - p[i])
    weight = 1.0 if term.weights is None else term.weights.matrix(len(q))[i, j]
    return np.broadcast_to(term.gain, len(q))[i] * weight * (p[j] - p[i])


def _body(term: fk.BodyTerm, case: Case, i: int) -> np.ndarray:
    own = case.structure.brute.get(type(term))
    if own is not None:
        return own(term, case, i)
    q, p, m = case.state.q, case.state.p, case.agents.masses
    if isinstance(term, fk.Compensate):
        return case.agents.damping[i] * p[i]
    place, speed, acceleration = term.leader.at(case.state.t)
    c1, c2, g = (
        np.broadcast_to(x, len(q))[i] for x in (term.position_gain, term.velocity_gain, term.acceleration_gain)
    )
    whose_q, whose_p = (q[i], p[i]) if not term.shared else (m @ q / m.sum(), m @ p / m.sum())
    errors = [whose_q - place, whose_p - speed]
    if term.saturated:
        errors = [e / np.sqrt(1 + e @ e) for e in errors]
    per_mass = m[i] if term.per_mass else 1.0
    return -per_mass * (c1 * errors[0] + c2 * errors[1]) + g * m[i] * acceleration
