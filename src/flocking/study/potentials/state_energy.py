"""Energy of one state, pairs that are not linked included."""

from __future__ import annotations

import numpy as np

from flocking.engine.reference.control import evaluate
from flocking.model.bodies.body import Body
from flocking.model.checks import Array
from flocking.model.energy import Energy
from flocking.model.graphs.seen_headings import links_at_state
from flocking.model.law import Law
from flocking.model.space import OPEN, Space
from flocking.model.state import Agents, State


def total_energy(
    law: Law, state: State, energy: Energy | None = None, *, agents: Body | None = None, space: Space = OPEN
) -> float:
    """The energy of a ledger at a state (Tanner I W, Tanner II (6), Zhou (10) and (25), Shi (11)).

    Parameters
    ----------
    law
        The control law.
    state
        The state; without links the graph's initial rule decides.
    energy
        Frame, and energy of a pair that is not linked; the lab frame and zero when absent.
    agents
        What the agents are; point masses of 1 when absent.
    space
        Space of the agents.

    Returns
    -------
    float
        Kinetic energy, what links and bodies store, and that of every pair that is not linked, in units of mass times
        velocity squared.
    """
    energy, agents = energy or Energy(), Agents() if agents is None else agents
    found = evaluate(law, state, agents=agents, energy=energy, space=space)
    links = links_at_state(law.graph, space, state, agents.headings) if state.links is None else state.links
    apart = (state.n * (state.n - 1) - int(np.count_nonzero(links))) / 2
    return found.storage + found.kinetic + apart * energy.unlinked


def agent_energies(
    law: Law, state: State, energy: Energy | None = None, *, agents: Body | None = None, space: Space = OPEN
) -> Array:
    """Potential of each agent: its links, and the energy of every other agent it is not linked with.

    Source: Tanner I (4); U_i (Tanner II). Links store what the ledger counts, those of further graphs too.

    Parameters
    ----------
    law
        The control law.
    state
        The state.
    energy
        Energy of a pair that is not linked; zero when absent.
    agents
        What the agents are; point masses of 1 when absent.
    space
        Space of the agents.

    Returns
    -------
    Array
        V_i or U_i, shape (N,), in the units of the potential. Their sum is twice the energy of all pairs; what single
        agents store, as in the pursuit of a leader, is in none of them.
    """
    agents = Agents() if agents is None else agents
    found = evaluate(law, state, agents=agents, space=space)
    links = links_at_state(law.graph, space, state, agents.headings) if state.links is None else state.links
    unlinked = energy.unlinked if energy is not None else 0.0
    return np.asarray(found.links_storage + (state.n - 1 - np.count_nonzero(links, axis=1)) * unlinked)
