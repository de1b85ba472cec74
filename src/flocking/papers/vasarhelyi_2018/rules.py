"""What a flock without noise does from one tick to the next, from the states alone: motions are judged by it."""

from __future__ import annotations

import numpy as np

from flocking.engine.reference.steering import everyone
from flocking.errors import InvalidInput
from flocking.model.bodies.velocity_units import VelocityUnit
from flocking.model.checks import Array
from flocking.model.law import Scenario
from flocking.model.terms.steering import Seen, Steering
from flocking.model.world.control import Held
from flocking.model.world.satellite_fixes import Fixes


def why_not(scenario: Scenario) -> str:
    """Why the motion of a scenario does not follow from its states at ticks; empty where it does.

    Parameters
    ----------
    scenario
        The scenario.
    """
    body, known, control = scenario.agents, scenario.information, scenario.control
    if not isinstance(body, VelocityUnit) or not isinstance(known, Fixes) or not isinstance(control, Held):
        return "agents are not told velocities at ticks, by fixes"
    if np.any(np.asarray(control.period) != known.period) or np.any(control.phase):
        return "agents do not act at their fixes"
    if body.diffusion or known.diffusion:
        return "there is noise"
    if not scenario.space.is_open or not all(isinstance(term, Steering) for term in scenario.law.terms):
        return "the law has other terms than those of desired velocities, or space is not open"
    return ""


def desired_velocities(scenario: Scenario, q: Array, p: Array, tick: int) -> Array:
    """Sums of the terms on what agents know at a tick, before they are cut or scaled, shape (N, m).

    An agent knows its own state, and that of the others within range as it was a delay before, or at the start.

    Parameters
    ----------
    scenario
        A scenario whose motion follows from its states.
    q, p
        Positions and velocities at all ticks up to this one, shape (tick + 1 or more, N, m).
    tick
        Number of the tick.
    """
    known = scenario.information
    assert isinstance(known, Fixes)
    agents, before = np.arange(q.shape[1]), max(tick - known.late, 0)
    of, j = everyone(agents, q[tick], np.inf if known.range is None else known.range)
    if known.range is not None:
        near = ((q[tick][j] - q[tick][of]) ** 2).sum(axis=1) < known.range**2
        of, j = of[near], j[near]
    offset = q[before][j] - q[tick][of]
    seen = Seen(q[tick], p[tick], of, offset, np.sqrt((offset**2).sum(axis=1)), p[before][j])
    found = np.zeros(q[tick].shape)
    for term in scenario.law.terms:
        assert isinstance(term, Steering)
        found += term.steer(seen)
    return found


def next_state(scenario: Scenario, q: Array, p: Array, tick: int) -> tuple[Array, Array]:
    """Positions and velocities one tick later, shape (N, m) each.

    Parameters
    ----------
    scenario, q, p, tick
        As for `desired_velocities`.

    Raises
    ------
    InvalidInput
        When the motion does not follow from the states.
    """
    reason = why_not(scenario)
    if reason:
        raise InvalidInput("next_state", "scenario", "must be one whose motion follows from its states", reason)
    body, known = scenario.agents, scenario.information
    assert isinstance(body, VelocityUnit)
    assert isinstance(known, Fixes)
    agents = np.arange(q.shape[1])
    desired = desired_velocities(scenario, q, p, tick)
    period = np.full(len(agents), known.period)
    w = body.updated(p[tick], desired, period, agents, np.full(len(agents), tick))
    return body.moved(q[tick], p[tick], w, np.zeros_like(w), known.period, tick)
