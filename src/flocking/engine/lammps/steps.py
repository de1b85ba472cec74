"""The time step of a LAMMPS run: choice from the start, and checks during the run."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.fixed_step.automatic_step import largest_step
from flocking.engine.fixed_step.step_checks import ENERGY_ROUNDING, RESIDUAL, check_ledger, check_stride
from flocking.engine.fixed_step.step_checks import step_too_large as too_large
from flocking.engine.lammps.gathered_states import velocities
from flocking.engine.lammps.neighbours import sampled_pairs
from flocking.errors import StepTooLarge
from flocking.model.checks import NO_LESS
from flocking.model.space import OPEN, Space

if TYPE_CHECKING:
    from flocking.engine.lammps.ledger import Ledger
    from flocking.model.law import Scenario
    from flocking.model.state import State

RARE_RESIDUAL = 0.5
"""Largest residual of the ledger, relative to the energy exchanged, if rows are more than one step apart."""


def chosen_step(scenario: Scenario, state: State) -> float:
    """The largest step that resolves a state, as in the tiled engine."""
    if scenario.agents.order == 2:
        return largest_step(scenario, sampled_pairs(scenario.law, state.q, state.p, scenario.space), "verlet")
    moving = velocities(scenario, state)
    return largest_step(scenario, sampled_pairs(scenario.law, state.q, moving, scenario.space), "euler", moving)


def step_too_large(
    scenario: Scenario, last: State, step: float, why: str, time: float, agents: tuple[int, ...] = ()
) -> StepTooLarge:
    """The error with a smaller step: one that resolves the last valid state, and at most half of the current step.

    Parameters
    ----------
    why
        The reason.
    agents
        Numbers of the agents concerned.
    """
    return too_large(step, min(0.5 * step, _resolves(scenario, last)), why, time=time, agents=agents)


def _resolves(scenario: Scenario, state: State) -> float:
    found = min(chosen_step(scenario, scenario.start), chosen_step(scenario, state))
    return min(found, _stays_in_next_box(scenario, scenario.start), _stays_in_next_box(scenario, state))


def _stays_in_next_box(scenario: Scenario, state: State) -> float:
    """A step in which no agent goes further than half a length on an axis that repeats; infinite in open space.

    LAMMPS carries an atom back by one length at a time, and loses one that went further.
    """
    speeds = np.abs(velocities(scenario, state)).max(axis=0, initial=0.0)
    lengths = scenario.space.lengths or (np.inf,) * len(speeds)
    return min((0.5 * x / v for x, v in zip(lengths, speeds.tolist(), strict=True) if v > 0.0), default=np.inf)


def check_strides(
    state: State, moving: Array, pairs: tuple[Indices, Indices], step: float, space: Space = OPEN
) -> None:
    """Check that no linked pair approaches too far for its distance in one step.

    Parameters
    ----------
    moving
        Velocities of the agents, shape (N, m).
    pairs
        Numbers of the two agents of each linked pair, shape (K,) each.
    space
        Their space.

    Raises
    ------
    StepTooLarge
        If one does.
    """
    i, j = pairs
    if not len(i):
        return
    distance = np.linalg.norm(space.displacement(state.q[j] - state.q[i]), axis=1)
    speed = np.linalg.norm(moving[j] - moving[i], axis=1)
    k = int(np.argmax(speed / np.maximum(distance, NO_LESS)))
    pair = (int(min(i[k], j[k])), int(max(i[k], j[k])))
    check_stride(step, float(distance[k]), step * float(speed[k]), time=state.t, agents=pair)


def check_ledger_rows(ledger: Ledger, step: float, rows: int, sound: State, of_places: Callable[[], float]) -> float:
    """Check that the residual of the ledger is small enough; if rows are rare, its integration error is large.

    Parameters
    ----------
    step
        The time step.
    sound
        The last valid state.
    of_places
        Change of the energy by rounding, called where it matters.

    Returns
    -------
    float
        That bound where it was needed, else 0.

    Raises
    ------
    StepTooLarge
        If it is not.
    """
    if len(ledger.trace) < 2:
        return 0.0
    last = ledger.trace[-1]
    scale = abs(last[1]) + last[2]
    instead = "" if rows == 1 else f"; alternatively use a row of the ledger at every step (ledger=1, now {rows})"
    rounding = ENERGY_ROUNDING * float(np.finfo(np.float64).eps) * scale
    return check_ledger(
        step, ledger.trace[0], last, order=1, rounding=rounding, time=last[0],
        at_most=lambda: _resolves(ledger.scenario, sound), instead=instead,
        allowed=RESIDUAL if rows == 1 else RARE_RESIDUAL, of_places=of_places,
    )  # fmt: skip
