"""Objects of the equation table for section 11: obstacles, beta- and gamma-agents, the tasks and their pictures.

Every function takes a factor of the number that determines its object; 1 gives the value of the paper.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from flocking.engine.driver.simulate import simulate
from flocking.engine.reference.control import control
from flocking.model.checks import Array
from flocking.model.law import Law
from flocking.model.leaders_and_obstacles.leaders import Velocity
from flocking.model.leaders_and_obstacles.obstacles import Ball
from flocking.model.potentials.potential import Potential
from flocking.model.potentials.structural_potential import structural_potential
from flocking.model.state import State
from flocking.model.terms.avoidance import Avoid
from flocking.papers.olfati_saber_2003 import closed_forms, passage, system
from flocking.papers.olfati_saber_2003.obstacle_links import beta_links

CENTRE, SIZE = (100.0, 20.0), 10.0
"""The first obstacle of (59)."""


def nearby() -> State:
    """Three agents within r0 of the first obstacle, no two within r, and one at distance 1.005 r0."""
    angles = np.array([2.8, -2.2, 1.0, -0.4])
    out = np.array([1.5, 3.8, 2.5, 1.005 * system.BETA_RANGE]) + SIZE
    q = np.array(CENTRE) + out[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return State(q, np.array([[9.0, 1.0], [8.0, -2.0], [10.0, 0.5], [11.0, -1.0]]))


def first_obstacle(scale: float = 1.0) -> Ball:
    """The first obstacle, its radius times ``scale``."""
    return Ball(CENTRE, SIZE * scale)


class AvoidanceNumbers(TypedDict, total=False):
    """Parameters of (54), by the names of `Avoid`."""

    range: float
    repulsion_gain: float
    damping_gain: float
    attraction: Potential
    offset: float
    onset: float
    gamma_agents: bool


def avoidance(**changes: Unpack[AvoidanceNumbers]) -> Avoid:
    """(54) for the first obstacle with the paper's parameters, some changed."""
    given: AvoidanceNumbers = {
        "range": system.BETA_RANGE, "repulsion_gain": system.BETA_GAIN, "damping_gain": system.BETA_DAMPING,
        "attraction": structural_potential(system.GAMMA_DISTANCE, system.ATTRACTION, system.REPULSION),
        "offset": system.GAMMA_OFFSET, "onset": system.ONSET, **changes,
    }  # fmt: skip
    return Avoid((first_obstacle(),), Velocity(system.DESIRED_VELOCITY), **given)


def avoided(**changes: Unpack[AvoidanceNumbers]) -> Array:
    """Control of the agents near the first obstacle under (54) alone."""
    return control(Law(system.smooth_net(), (avoidance(**changes),)), nearby())


def distance(scale: float) -> tuple[State, Array]:
    """Agents near the first obstacle and d(q_i, O_k), its radius times ``scale``."""
    return nearby(), first_obstacle(scale).distance(nearby().q)


def projection(scale: float) -> tuple[State, Array]:
    """Agents near the first obstacle and their projections (53)."""
    return nearby(), first_obstacle(scale).project(nearby().q)


def active(scale: float) -> list[bool]:
    """Whether each agent is within range of the first obstacle, r0 times ``scale``."""
    return [bool(x) for x in (avoided(range=system.BETA_RANGE * scale) != 0).any(axis=1)]


def gamma_pull(scale: float) -> tuple[State, Array]:
    """Agents near the obstacle and the forces of their gamma-agents, lambda_d times ``scale``."""
    return nearby(), avoided(repulsion_gain=0.0, damping_gain=0.0, offset=system.GAMMA_OFFSET * scale)


def beta_push(scale: float) -> tuple[State, Array]:
    """Agents near the obstacle and the forces of their beta-agents, c3 times ``scale``."""
    return nearby(), avoided(repulsion_gain=system.BETA_GAIN * scale, damping_gain=0.0, gamma_agents=False)


def protocol_54(scale: float) -> tuple[State, Array]:
    """Agents near the obstacle and their control (54), c4 times ``scale``."""
    return nearby(), avoided(damping_gain=system.BETA_DAMPING * scale)


def fading(scale: float) -> tuple[State, Array, Array]:
    """Agents near the obstacle, their control (54) without the push of beta-agents, and that push, c4 and c3 off by
    ``scale``.
    """
    rest = avoided(repulsion_gain=0.0, damping_gain=system.BETA_DAMPING * scale)
    return nearby(), rest, beta_push(scale)[1]


def two_obstacles(scale: float) -> tuple[Array, NDArray[np.bool_]]:
    """Four agents about the gap between the last two obstacles, and who has a beta-agent on which of them when r0 is
    7.55 times ``scale``.
    """
    q = np.array([[200.0, 22.5], [200.0, 22.6], [200.0, 15.0], [160.0, 22.5]])
    term = Avoid(system.obstacles()[4:], range=7.55 * scale, gamma_agents=False)
    return q, beta_links(term, q)


def passing_alone(scale: float) -> tuple[Array, Array]:
    """Where one agent is after 4 s that heads for the first obstacle 7 off its axis under (58), without the pull of
    gamma-agents and with it; c2 times ``scale``.
    """
    scenario = system.obstacle_scenario(0, agents=1, tracking_gain=system.TRACKING_GAIN * scale)
    start = State(np.array([[80.0, 27.0]]), np.array([system.DESIRED_VELOCITY]))

    def end(law: Law) -> Array:
        run = simulate(scenario.with_(law=law, start=start, t_end=4.0, frames=2, name=""), progress=False)
        return np.asarray(run.q[-1, 0])

    nothing = structural_potential(system.GAMMA_DISTANCE, 1e-13, 5e-13)
    *others, avoid = scenario.law.terms
    assert isinstance(avoid, Avoid)
    # A zero potential: the law keeps its structure, so one kernel serves both.
    return end(Law(scenario.law.graph, (*others, replace(avoid, attraction=nothing)))), end(scenario.law)


def priority(scale: float) -> tuple[State, Array, Array, Array]:
    """Agents among the obstacles, the forces of their beta-agents for c3 and for c3/100, both scaled by ``scale``, and
    the other terms of (58).
    """
    law = system.obstacle_scenario(0, agents=2).law
    rest = Law(law.graph, tuple(replace(t, repulsion_gain=0.0) if isinstance(t, Avoid) else t for t in law.terms))
    push = control(law, fourteen_agents()) - control(rest, fourteen_agents())
    return fourteen_agents(), scale * push, scale * push / 100, control(rest, fourteen_agents())


def contraction(scale: float) -> tuple[State, Array, Array]:
    """Agents near the obstacle, s of (55), and qhat, the obstacle's radius times ``scale``."""
    q = nearby().q
    s = closed_forms.contraction(q, np.array(CENTRE), SIZE * scale)
    return nearby(), s, s[:, None] * q + (1 - s)[:, None] * np.array(CENTRE)


def beta_velocity(scale: float) -> tuple[State, Array]:
    """Agents near the obstacle and the velocities of their beta-agents, the radius times ``scale``."""
    return nearby(), first_obstacle(scale).at(nearby().q, nearby().p)["boundary"]


def contraction_rate(scale: float) -> tuple[State, Array]:
    """Agents near the obstacle and ds/dt of (57), the radius times ``scale``."""
    return nearby(), closed_forms.contraction_rate(nearby().q, nearby().p, np.array(CENTRE), SIZE * scale)


def moving_beta_velocity(scale: float) -> tuple[State, Array, Array]:
    """Remark 7: the obstacle moves; its velocity, and those of beta-agents. The velocity is scaled by ``scale``."""
    velocity = np.array([-3.0, 2.0])
    ball = Ball(Velocity(velocity * scale, start=CENTRE), SIZE)
    return nearby(), velocity, ball.at(nearby().q, nearby().p)["boundary"]


def protocol_58(scale: float) -> tuple[State, Array]:
    """Agents among the obstacles and their control (58), c2 times ``scale``."""
    return fourteen_agents(), control(
        system.obstacle_scenario(0, tracking_gain=system.TRACKING_GAIN * scale, agents=2).law, fourteen_agents()
    )


def fourteen_agents() -> State:
    """Fourteen agents in motion about the first obstacle, some close to it and to each other."""
    rng = np.random.default_rng(12)
    angle = 2 * np.pi * np.arange(14) / 14
    out = SIZE + np.tile([1.2, 3.0], 7) + 2 * rng.random(14)
    q = np.array(CENTRE) + out[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return State(q, np.array([10.0, 0.0]) + rng.normal(size=(14, 2)))


def obstacle_matrix(scale: float) -> list[tuple[float, float, float]]:
    """Centre and radius of the obstacles as simulated, lengths times ``scale``."""
    return [(*(scale * ball.centre.at(0.0)[0]).tolist(), scale * ball.radius) for ball in system.obstacles()]


def desired_velocity(scale: float) -> Array:
    """p_d as simulated times ``scale``."""
    leader = system.obstacle_scenario(0, agents=2).law.leaders[0]
    return np.asarray(leader.at(0.0)[1] * scale)


def gap(scale: float) -> tuple[float, float]:
    """d_56, and 2 d_alpha + 2 r0, the width for three agents side by side; lengths times ``scale``."""
    return passage.gap_width() * scale, scale * (2 * system.DISTANCE + 2 * system.BETA_RANGE)


def numbers(scale: float) -> dict[str, float]:
    """Parameters of the first task in the scenario, lengths and gains times ``scale``."""
    scenario = system.obstacle_scenario(0)
    avoid = next(t for t in scenario.law.terms if isinstance(t, Avoid))
    graph = system.smooth_net()
    return {
        "agents": scenario.start.n,
        "obstacles": len(avoid.obstacles),
        "d_alpha": system.DISTANCE * scale,
        "r": graph.radius * scale,
        "r0": avoid.range * scale,
        "c3": avoid.repulsion_gain * scale,
        "c4": avoid.damping_gain * scale,
        "speed": float(np.abs(scenario.start.p).max()),
        "left": float(scenario.start.q[:, 0].min()),
        "right": float(scenario.start.q[:, 0].max()),
    }


def sink_numbers(scale: float) -> dict[str, float]:
    """Parameters of the second task in the scenario, lengths and gains times ``scale``."""
    scenario = system.sink_scenario(0)
    psi = scenario.law.terms[0].potential  # type: ignore[attr-defined]
    return {
        "agents": scenario.start.n,
        "d_alpha": psi.parameters["d"] * scale,
        "a": psi.parameters["a"] * scale,
        "b": psi.parameters["b"] * scale,
        "speed": float(np.abs(scenario.start.p).max()),
        "farthest": float(np.abs(scenario.start.q).max()),
        "duration": scenario.t_end * scale,
    }


def figure_6(scale: float) -> dict[str, Array]:
    """Positions of Fig. 6: an alpha-agent near the first obstacle, its beta-agent and the gamma-agent."""
    q = nearby().q[:1]
    direction = np.asarray(system.DESIRED_VELOCITY) / np.linalg.norm(system.DESIRED_VELOCITY)
    return {
        "alpha": q[0],
        "beta": first_obstacle(scale).project(q)[0],
        "gamma": np.asarray(CENTRE) + scale * system.GAMMA_OFFSET * direction,
    }
