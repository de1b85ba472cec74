"""What boids and birds do at an update, from the states alone: the reference that motions are judged by."""

from __future__ import annotations

import numpy as np

from flocking.engine.reference.steering import steering_forces
from flocking.model.bodies.discrete_bodies import DiscreteBody
from flocking.model.checks import Array
from flocking.model.law import Scenario
from flocking.model.state import State
from flocking.papers.reynolds_1987 import system


def boid_force(state: State) -> Array:
    """Steering forces on boids before the limit, shape (N, m): weighed unit vectors and the turn back.

    Parameters
    ----------
    state
        Positions and velocities.
    """
    return steering_forces(system.boid_law(), state.q, state.p)


def bird_force(state: State, side: float, vision: float) -> Array:
    """What is added to the velocity of birds before it is made a unit vector, shape (N, 2).

    Parameters
    ----------
    state
        Positions and velocities.
    side
        Length after which both axes repeat.
    vision
        Distance below which others are seen.
    """
    scenario = system.birds(state.n, side, vision)
    return steering_forces(scenario.law, state.q, state.p, scenario.space)


def next_state(scenario: Scenario, q: Array, p: Array, tick: int) -> tuple[Array, Array]:
    """Positions and velocities after an update, shape (N, m) each, by the law on all pairs.

    Parameters
    ----------
    scenario
        A scenario of this package.
    q, p
        Positions and velocities before it, shape (N, m).
    tick
        How many updates there were before.
    """
    body, law, space = scenario.agents, scenario.law, scenario.space
    assert isinstance(body, DiscreteBody)
    n = len(q)
    everyone = np.arange(n)
    period = np.full(n, float(np.max(np.asarray(getattr(scenario.control, "period")))))  # noqa: B009
    ticks = np.full(n, tick)
    if not body.in_turn:
        found = body.updated(p, steering_forces(law, q, p, space), period, everyone, ticks)
        return q + period[:, None] * found, found
    q, p = q.copy(), p.copy()
    for agent in body.turns(n, tick):
        one = np.array([agent])
        p[one] = body.updated(p[one], steering_forces(law, q, p, space, one), period[one], one, ticks[one])
        q[one] += period[one][:, None] * p[one]
    return q, p
