"""The law on NumPy arrays: the control of a state, and the control that one agent can compute by itself."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np

from flocking.arrays import Indices
from flocking.engine.kernels.codegen import array_kernels
from flocking.engine.kernels.law_kernels import Slots
from flocking.engine.kernels.layout import Layout
from flocking.engine.reference.evaluation import Evaluation
from flocking.engine.reference.finite_forces import check_finite, check_neighbours
from flocking.engine.reference.known_slots import known_slots
from flocking.engine.reference.motion import motion_of
from flocking.engine.reference.steering import steering_forces
from flocking.errors import InvalidInput
from flocking.model.bodies.body import Body
from flocking.model.checks import Array, array, listed
from flocking.model.checks import number as checked_number
from flocking.model.energy import Energy
from flocking.model.graph_functional import averages, graph_functional
from flocking.model.graphs.connectivity import linked_pairs
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.seen_headings import links_of_graphs
from flocking.model.law import Law, Scenario
from flocking.model.space import OPEN, Space
from flocking.model.space_checks import check_space, check_steering_space
from flocking.model.state import Agents, State

__all__ = ["Agent", "Evaluation", "control", "control_of", "evaluate", "evaluate_each"]


def control(law: Law, state: State, *, agents: Body | None = None, space: Space = OPEN) -> Array:
    """Control u_i of every agent under ``law``.

    Parameters
    ----------
    law
        The control law.
    state
        Positions, velocities, time and, for graphs with memory, the links; without links the graph's initial
        rule decides.
    agents
        What the agents are; point masses of 1 without damping when absent.
    space
        Their space.

    Returns
    -------
    Array
        Forces u, shape (N, m).

    Raises
    ------
    InvalidInput
        When law, agents and state disagree in numbers of agents or dimensions, the law cannot act in the space, as
        scenarios state, or the force between two neighbours is not finite, as at one point under a potential that is
        infinite there.
    """
    return _evaluated(law, state, agents, None, space, checked=True).u


def evaluate(
    law: Law, state: State, *, agents: Body | None = None, energy: Energy | None = None, space: Space = OPEN
) -> Evaluation:
    """Control, energies and ledger powers of one state, on NumPy arrays over all linked pairs.

    Parameters
    ----------
    law
        The control law.
    state
        The state; see `control`.
    agents
        Masses and damping.
    energy
        Frame of the energies; the lab frame when absent.
    space
        Space of the agents.

    Raises
    ------
    InvalidInput
        When law, agents and state disagree in numbers of agents or dimensions, or the law cannot act in the space.
    """
    return _evaluated(law, state, agents, energy, space, checked=False)


def evaluate_each(scenario: Scenario, states: Iterable[State]) -> list[Evaluation]:
    """What `evaluate` gives for each state under the law of a scenario, which is taken apart once.

    Parameters
    ----------
    states
        States of the agents of the scenario.
    """
    law, agents, energy, space = scenario.law, scenario.agents, scenario.energy, scenario.space
    layout = Layout(law, energy, agents, space, steering=True)
    n, m = scenario.start.q.shape
    taken_apart = layout, array_kernels(layout, m), Slots(*layout.values(agents, n)) if layout.constant else None
    return [_evaluated(law, state, agents, energy, space, taken_apart, checked=False) for state in states]


def _evaluated(
    law: Law, state: State, agents: Body | None, energy: Energy | None, space: Space,
    taken_apart: tuple[Layout, ModuleType, Slots | None] | None = None, *, checked: bool,
) -> Evaluation:  # fmt: skip
    if not isinstance(state, State):
        raise InvalidInput("control", "state", "must be a State", state, "Use fk.State(q, p).")
    given_parts = (
        ("law", law, Law, "Law"),
        ("agents", agents, Body | None, "Agents"),
        ("energy", energy, Energy | None, "Energy"),
        ("space", space, Space, "a space, such as Open"),
    )
    for name, part, kind, word in given_parts:
        if not isinstance(part, kind):
            raise InvalidInput("control", name, f"must be {word}", part)
    n, m = state.q.shape
    agents = Agents() if agents is None else agents
    agents.check_count(n)
    if agents.order == 1:
        state = replace(state, p=np.zeros_like(state.q))
    law.check_count(n, m)
    energy = energy or Energy()
    if taken_apart is None:
        state.check_extent("control", "state")
        check_space(space, law.graphs, law.body_terms, m)
        check_steering_space(space, law.steering_terms)
        layout = Layout(law, energy, agents, space, steering=True)
        taken_apart = layout, array_kernels(layout, m), None
    layout, module, slots = taken_apart
    P, A, W = layout.values(agents, n, state.t) if slots is None else slots
    u = np.zeros((n, m))
    force_sum, linked = np.zeros(n), np.zeros(n)
    frame = frame_velocity(energy, state, A[0])
    storage = dissipation = supply = 0.0
    pairs = [linked_pairs(links) for links in links_of_graphs(law.graphs, space, state, agents.headings)]
    for number, (i, j) in enumerate(pairs):
        functional = _functional(law, number, (i, j), n)
        d = displacements(space, state.q, (i, j))
        values, force = _pair_forces(module, number, d, state.p, (i, j), (P, A, W), functional, frame)
        if checked:
            check_finite("control", d, force, (i, j))
        np.add.at(u, i, force)
        np.add.at(force_sum, i, np.linalg.norm(force, axis=1))
        stored = values["storage"] * np.ones(len(i))
        np.add.at(linked, i, stored)
        storage += 0.5 * float(np.sum(stored))
        dissipation += 0.5 * float(np.sum(values["dissipation"] * np.ones(len(i))))
        supply += 0.5 * float(np.sum(values["supply"] * np.ones(len(i))))
    mean_q, mean_p = (A[0] @ x / A[0].sum() for x in (state.q, state.p))
    given: dict[str, object] = {"t": state.t, **{f"A{k}": row for k, row in enumerate(A)}}
    for k in range(m):
        given |= {f"q{k}": state.q[:, k], f"p{k}": state.p[:, k], f"mean_q{k}": mean_q[k], f"mean_p{k}": mean_p[k]}
    body = {k: v * np.ones(n) for k, v in module.body(P, given).items()}
    near = obstacles_met(law, layout, module, state.q, P, given)
    for i, values in near:
        np.add.at(u, i, np.stack([values[f"force{k}"] for k in range(m)], axis=1))
        dissipation += float(values["dissipation"].sum())
        supply += float(values["supply"].sum())
    u += np.stack([body[f"force{k}"] for k in range(m)], axis=1) + steering_forces(law, state.q, state.p, space)
    storage += float(body["storage"].sum())
    moving = motion_of(layout, module, state, P, given, u, frame)
    if agents.order == 1:

        def flow(v: Array) -> float:
            """What is supplied to agents that move with velocities ``v``."""
            means = {f"mean_u{k}": x for k, x in enumerate(A[0] @ v / A[0].sum())}
            named = given | {f"u{k}": v[:, k] for k in range(m)} | means
            found = float(np.sum(module.body_flow(P, named)["supply"] * np.ones(n)))
            for number, (i, j) in enumerate(pairs):
                seen = _pair_values(displacements(space, state.q, (i, j)), v, (i, j), (A, W), np.zeros(m))
                power = getattr(module, f"pair_flow{number}")(P, seen)["supply"]
                found += 0.5 * float(np.sum(power * np.ones(len(i))))
            return found + sum(
                float(sum((values[f"force{k}"] * v[i, k]).sum() for k in range(m))) for i, values in near
            )

        desired, own = float((u**2).sum()), np.stack([moving[f"rate_q{k}"] for k in range(m)], axis=1)
        departure = 0.0 if (own == u).all() else desired - flow(u) - float((u * own).sum()) + flow(own)
        return Evaluation(u, storage, 0.0, desired, flow(u), force_sum, departure, linked)
    kinetic, departure = float(moving["kinetic"].sum()), float(moving["departure"].sum())
    dissipation, supply = dissipation + float(body["dissipation"].sum()), supply + float(body["supply"].sum())
    return Evaluation(u, storage, kinetic, dissipation, supply, force_sum, departure, linked)


def obstacles_met(
    law: Law, layout: Layout, module: object, q: Array, P: Array, given: Mapping[str, Any]
) -> list[tuple[Any, dict[str, Array]]]:
    """For every group of obstacles: the agents within range, once for each obstacle, and the forces on them.

    Parameters
    ----------
    layout, module
        The law's slots, and its functions for NumPy.
    P, given
        Values of the slots of single numbers, and of all other names.
    """
    from flocking.engine.kernels.obstacle_distances import ObstacleDistances

    rows, found = layout.obstacle_rows(), []
    for group, (i, o) in enumerate(ObstacleDistances(law).met(q, given["t"])):
        values = {k: v[i] if np.ndim(v) else v for k, v in given.items()}
        values |= {f"O{k}": row[o] for k, row in enumerate(rows)}
        with np.errstate(all="ignore"):
            result = getattr(module, f"obstacles{group}")(P, values)
        found.append((i, {k: v * np.ones(len(i)) for k, v in result.items()}))
    return found


def _functional(law: Law, number: int, pairs: tuple[Indices, Indices], n: int) -> Array | None:
    links = np.zeros((n, n), dtype=bool)
    links[pairs] = True
    return graph_functional(law, number, links)


def frame_velocity(energy: Energy, state: State, masses: Array) -> Array:
    """Velocity of the frame of an energy, shape (m,)."""
    if energy.frame == "centre of mass":
        return np.asarray(masses @ state.p / masses.sum())
    if energy.leader is not None:
        return energy.leader.at(state.t)[1]
    return np.zeros(state.dimension)


def _pair_forces(
    module: Any,
    number: int,
    d: Array,
    p: Array,
    pairs: tuple[Indices, Indices],
    slots: tuple[Array, Array, Array],
    functional: Array | None,
    frame: Array,
) -> tuple[dict[str, Any], Array]:
    i, _ = pairs
    P, A, W = slots
    given = _pair_values(d, p, pairs, (A, W), frame)
    if functional is not None:
        given["functional"] = functional[i]
    r, v = given["r"], given.pop("v")
    with np.errstate(all="ignore"):
        values = getattr(module, f"pair{number}")(P, given)
        along = np.broadcast_to(values["along"], r.shape)
        direction = np.where(r[:, None] > 0, d / r[:, None], 0.0)
        drag = np.broadcast_to(values["drag"], r.shape)
        return values, along[:, None] * direction + drag[:, None] * v


def displacements(space: Space, q: Array, pairs: tuple[Indices, Indices]) -> Array:
    """Vectors from the first to the second agent of each of ``pairs`` at positions ``q`` in a ``space``."""
    i, j = pairs
    return space.displacement(q[j] - q[i])


def _pair_values(
    d: Array, p: Array, pairs: tuple[Indices, Indices], slots: tuple[Array, Array], frame: Array
) -> dict[str, Any]:
    """Values that pair formulas may use of each ordered pair at displacements d, and the relative velocities v."""
    i, j = pairs
    A, W = slots
    v = p[j] - p[i]
    r = np.sqrt((d**2).sum(axis=1))
    length = np.where(r > 0, r, 1.0)
    given: dict[str, Any] = {
        "r": r,
        "v": v,
        "speed2": (v**2).sum(axis=1),
        "radial": (d * v).sum(axis=1) / length,
    }
    given["push"] = (d * (p[i] - frame)).sum(axis=1) / length
    given["pull"] = (v * (p[i] - frame)).sum(axis=1)
    given |= {f"A{k}": row[i] for k, row in enumerate(A)}
    return given | {f"W{k}": matrix[i, j] for k, matrix in enumerate(W)}


@dataclass(frozen=True, eq=False)
class Agent:
    """One agent as another one sees it.

    Parameters
    ----------
    q, p
        Position and velocity, shape (m,).
    index
        Which agent it is: selects per-agent and per-pair parameters of the law.

    Raises
    ------
    InvalidInput
        When shapes disagree or a value is not finite.
    """

    q: Array
    p: Array
    index: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", array("Agent", "q", self.q, ndim=1))
        object.__setattr__(self, "p", array("Agent", "p", self.p, ndim=1))
        if self.q.shape != self.p.shape:
            raise InvalidInput("Agent", "p", f"must have {len(self.q)} components", self.p.tolist())


def control_of(
    law: Law,
    agent: Agent,
    neighbours: Sequence[Agent] | Mapping[Graph, Sequence[Agent]],
    t: float = 0.0,
    *,
    mass: float = 1.0,
    damping: float = 0.0,
    space: Space = OPEN,
    seen: Sequence[Agent] | None = None,
    headings: Array | None = None,
) -> Array:
    """Control of one agent from what that agent may know: itself, its neighbours, the leader and the time.

    Parameters
    ----------
    law
        The control law; it must be distributed.
    agent
        The agent itself.
    neighbours
        Its neighbours under the law's graph, or one list per graph of the law. Who they are is the caller's
        knowledge: nothing else about the group enters.
    t
        Time.
    mass, damping
        Mass and velocity damping of the agent.
    space
        Their space.
    seen
        All agents that it sees, linked or not, of which steering terms take those within their radius; the neighbours
        when absent.
    headings
        Headings of all agents, angles of shape (N,) or rotation matrices of shape (N, m, m), for graphs that weigh
        neighbours by them, as `SmoothCone` does.

    Returns
    -------
    Array
        Force u, shape (m,).

    Raises
    ------
    InvalidInput
        When the law needs more than neighbours can send, or a neighbour is where the law has no force: at the
        agent's own place under a potential that is infinite there, or beyond one of its poles.
    """
    for name, part, kind in (("law", law, Law), ("agent", agent, Agent)):
        if not isinstance(part, kind):
            raise InvalidInput("control_of", name, f"must be {name.capitalize()}", part)
    t = checked_number("control_of", "t", t)
    mass = checked_number("control_of", "mass", mass, above=0.0)
    damping = checked_number("control_of", "damping", damping, least=0.0)
    if not law.distributed:
        raise InvalidInput(
            "control_of", "law", "must be distributed", f"a law that needs the {', '.join(law.beyond_neighbours)}",
            "Use control(law, state), which is given the whole group.",
        )  # fmt: skip
    m = len(agent.q)
    check_space(space, law.graphs, law.body_terms, m)
    check_steering_space(space, law.steering_terms)
    layout = Layout(law, Energy(), space=space, steering=True)
    module = array_kernels(layout, m)
    lists = neighbours if isinstance(neighbours, Mapping) else {law.graph: neighbours}
    rule = "must be agents with as many coordinates"
    lists = {graph: listed("control_of", "neighbours", group, rule) for graph, group in lists.items()}
    around = None if seen is None else listed("control_of", "seen", seen, rule)
    for seen_one in (b for group in (*lists.values(), around or ()) for b in group):
        if not isinstance(seen_one, Agent) or len(seen_one.q) != m:
            raise InvalidInput("control_of", "neighbours", rule, seen_one)
    count = 1 + max([agent.index, *(b.index for group in lists.values() for b in group)])
    (P, A, W), u = known_slots(law, layout, agent.index, count, (mass, damping), t, headings), np.zeros(m)
    for number, graph in enumerate(law.graphs):
        if not (seen := list(lists.get(graph, []))):
            continue
        together = State(np.array([agent.q, *(b.q for b in seen)]), np.array([agent.p, *(b.p for b in seen)]), t)
        k = np.arange(1, len(seen) + 1)
        rows = A[:, [agent.index, *(b.index for b in seen)]]
        index = np.array([b.index for b in seen])
        weights = np.zeros((len(W), len(seen) + 1, len(seen) + 1))
        if len(W):
            weights[:, 0, 1:] = W[:, agent.index, index]
        pairs = np.zeros_like(k), k
        offsets = displacements(space, together.q, pairs)
        mean = np.array([1.0 / (1.0 + len(seen))]) if averages(law, number) else None
        _, force = _pair_forces(module, number, offsets, together.p, pairs, (P, rows, weights), mean, np.zeros(m))
        check_neighbours("control_of", law, number, offsets, force, (np.full_like(index, agent.index), index))
        u += force.sum(axis=0)
    given: dict[str, Any] = {"t": t, **{f"A{k}": row[agent.index] for k, row in enumerate(A)}}
    given |= {f"q{k}": agent.q[k] for k in range(m)} | {f"p{k}": agent.p[k] for k in range(m)}
    given |= {f"mean_{letter}{k}": np.nan for letter in "qp" for k in range(m)}
    body = module.body(P, given)
    u += np.array([body[f"force{k}"] for k in range(m)], dtype=np.float64)
    alone = {k: np.reshape(v, 1) if k != "t" else v for k, v in given.items()}
    for _, values in obstacles_met(law, layout, module, agent.q[None], P, alone):
        u += np.array([values[f"force{k}"].sum() for k in range(m)])
    if law.steering_terms:
        others = {b.index: b for group in lists.values() for b in group} if around is None else dict(enumerate(around))
        q, p = (np.array([getattr(agent, x), *(getattr(b, x) for b in others.values())]) for x in "qp")
        u += steering_forces(law, q, p, space, np.array([0]))[0]
    return u
