"""Objects of the equation table for sections 4, 5 and 9: means, structural energy, potentials, defects.

Every function takes a factor of the number that determines its object; 1 gives the value of the paper.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flocking.engine.reference.control import control, evaluate
from flocking.model.checks import Array
from flocking.model.graphs.distance_graphs import Graph, Proximity
from flocking.model.law import Law
from flocking.model.observables import mean_position, mean_velocity
from flocking.model.potentials.potential import Potential
from flocking.model.potentials.structural_potential import structural_potential
from flocking.model.starts import hexagonal
from flocking.model.state import State
from flocking.model.terms.pair_terms import Gradient
from flocking.papers.olfati_saber_2003 import system
from flocking.papers.olfati_saber_2003.rigid_motion import converse_conditions, largest_distance_rate
from flocking.papers.olfati_saber_2003.structural_nets import Defect, defect, is_quasi_realization, structural_energy
from flocking.study.potentials.equilibrium import Equilibrium

EXAMPLE_AGENTS = 12
"""Number of agents of the examples, small enough for brute force."""
WIDE = 10.0
"""d_alpha of Example 2; r is 12."""


def example_state() -> State:
    """Twelve moving agents near a lattice slightly denser than d_alpha."""
    return hexagonal(EXAMPLE_AGENTS, spacing=6.9, noise=0.8, speed=1.0, seed=4)


def potential(scale: float = 1.0) -> Potential:
    """psi_alpha(r - d_alpha) with a times ``scale``."""
    return structural_potential(system.DISTANCE, system.ATTRACTION * scale, system.REPULSION)


def uneven_masses(scale: float) -> Array:
    """Weights of the means: those of the first agent times ``scale``."""
    masses = np.ones(EXAMPLE_AGENTS)
    masses[0] = scale
    return masses


def means(scale: float) -> tuple[State, Array, Array]:
    """Example state, its mean position and velocity."""
    state, masses = example_state(), uneven_masses(scale)
    return state, mean_position(state, masses), mean_velocity(state, masses)


def relative(scale: float) -> tuple[State, Array, Array, Array]:
    """Example state and the positions, velocities and controls relative to the means."""
    state, q, p = means(scale)
    u = control(Law(system.hard_net(), system.alpha_terms(c1=system.DAMPING * scale)), state)
    return state, state.q - q, state.p - p, u - u.mean(axis=0)


def stacked(scale: float) -> tuple[State, Array, Array]:
    """Example state and its stacked relative positions and velocities, q - 1 (x) mean q, shape (2 N,)."""
    state, q, p = means(scale)
    ones = np.ones(state.n)
    return state, state.q.ravel() - np.kron(ones, q), state.p.ravel() - np.kron(ones, p)


def energy(scale: float) -> tuple[State, float]:
    """Example state and H_s of the uniform net, a times ``scale``."""
    state = example_state()
    return state, structural_energy(system.hard_net(), potential(scale), state).total


def energy_pieces(scale: float) -> tuple[State, Array, float, float]:
    """Example state with V_i, V and K_r, a times ``scale``."""
    state = example_state()
    found = structural_energy(system.hard_net(), potential(scale), state)
    return state, found.each, found.potential, found.relative_kinetic


def smooth_energy(scale: float) -> tuple[State, float]:
    """Example state and H_s of the smooth net (30), a times ``scale``."""
    state = example_state()
    return state, structural_energy(system.smooth_net(), potential(scale), state).total


def deviations() -> Array:
    """Values of z for potential and action function."""
    return np.array([-7.0, -4.0, -1.0, 0.0, 0.5, 1.4, 5.0, 20.0])


def potential_values(scale: float) -> tuple[Array, Array]:
    """psi_alpha and phi_alpha at the deviations, b times ``scale``."""
    psi = structural_potential(system.DISTANCE, system.ATTRACTION, system.REPULSION * scale)
    return psi(system.DISTANCE + deviations()), psi.slope(system.DISTANCE + deviations())


def bounds_of_action(scale: float) -> tuple[float, float]:
    """phi_alpha for large positive and negative deviations, a and b times ``scale``."""
    psi = structural_potential(1e7, system.ATTRACTION * scale, system.REPULSION * scale)
    return float(psi.slope(2e7)), float(psi.slope(0.0))


def zero_energy(scale: float) -> tuple[float, float]:
    """V of a realization for d_alpha times ``scale``, and of the disturbed example net."""
    q = hexagonal(EXAMPLE_AGENTS, spacing=system.DISTANCE, seed=0).q
    psi = structural_potential(system.DISTANCE * scale, system.ATTRACTION, system.REPULSION)
    net = system.hard_net()
    return structural_energy(net, psi, State(q)).potential, structural_energy(net, psi, example_state()).potential


def moving_together(scale: float) -> tuple[float, Array, bool]:
    """Agents at one velocity, that of the first times ``scale``: K_r, rates of distances, whether the net stays."""
    q = hexagonal(EXAMPLE_AGENTS, spacing=system.DISTANCE, seed=0).q
    p = np.tile([3.0, 2.0], (EXAMPLE_AGENTS, 1))
    p[0] *= scale
    i, j = np.triu_indices(EXAMPLE_AGENTS, 1)
    way = q[j] - q[i]
    rates = (way * (p[j] - p[i])).sum(axis=1) / np.linalg.norm(way, axis=1)
    net = system.hard_net()
    kinetic = structural_energy(net, potential(), State(q, p)).relative_kinetic
    return kinetic, rates, bool((net.initial(q) == net.initial(q + 100.0 * p)).all())


def converse(scale: float) -> list[tuple[tuple[bool, bool, bool], float, float]]:
    """For agents at one velocity, that of the first times ``scale``, for a net that turns, for the example state, for
    two agents that meet and for a net in two parts: conditions a) to c), the largest rate of a distance, and K_r.
    """
    q = hexagonal(EXAMPLE_AGENTS, spacing=system.DISTANCE, seed=0).q
    together = np.tile([3.0, 2.0], (EXAMPLE_AGENTS, 1))
    together[0] *= scale
    turning = 0.3 * np.stack([-q[:, 1], q[:, 0]], axis=1)
    met, parts = np.array(q), np.array(q)
    met[1] = met[0]
    parts[0] += 1000.0
    still = np.zeros_like(q)
    states = (State(q, together), State(q, turning), example_state(), State(met, still), State(parts, still))
    net = system.hard_net()
    return [
        (converse_conditions(net, s), largest_distance_rate(s),
         structural_energy(net, potential(), s).relative_kinetic)
        for s in states
    ]  # fmt: skip


def line_in_balance(scale: float) -> tuple[Graph, State, Array]:
    """Net of radius 2.5 d_alpha; three agents in a line, all linked, in balance, their distances times ``scale``; and
    the forces on them.
    """
    from scipy.optimize import brentq

    psi, net = potential(), Proximity(2.5 * system.DISTANCE, closed=True)
    step = brentq(lambda s: float(psi.slope(s) + psi.slope(2 * s)), 0.5 * system.DISTANCE, system.DISTANCE, xtol=1e-15)
    state = State(scale * step * np.array([[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0]]))
    return net, state, Equilibrium(Law(net, (Gradient(psi),)), state).forces


def no_energy(scale: float) -> tuple[float, Array, Array]:
    """A realization that moves at one velocity: H_s for d_alpha times ``scale``, its forces, and its velocities."""
    q = hexagonal(EXAMPLE_AGENTS, spacing=system.DISTANCE, seed=0).q
    state = State(q, np.tile([3.0, 2.0], (EXAMPLE_AGENTS, 1)))
    psi = structural_potential(system.DISTANCE * scale, system.ATTRACTION, system.REPULSION)
    forces = control(Law(system.hard_net(), (Gradient(psi),)), state)
    return structural_energy(system.hard_net(), psi, state).total, forces, state.p


def jump(scale: float) -> float:
    """H_s of two agents just within r minus that just beyond, a times ``scale``."""
    net = system.hard_net()

    def at(distance: float) -> float:
        return structural_energy(net, potential(scale), State(np.array([[0.0, 0.0], [distance, 0.0]]))).total

    return at(system.RADIUS) - at(system.RADIUS * (1 + 1e-12))


def pair_net(smooth: bool, scale: float = 1.0) -> Graph:
    """The net of Example 2: r = 12, d_alpha = 10; r times ``scale``.

    Parameters
    ----------
    smooth
        Whether links fade to zero before the radius; else they end at it.
    """
    from flocking.model.graphs.distance_graphs import Proximity
    from flocking.model.graphs.smooth_graphs import Smooth

    radius = 1.2 * WIDE * scale
    return Smooth(radius, WIDE / radius) if smooth else Proximity(radius, closed=True)


def pair_deviations() -> Array:
    """Deviations eta of Example 2."""
    return np.array([-10.0, -5.0, -1.0, 0.0, 1.0, 1.5, 1.98, 2.005, 3.0])


def pair_potentials(scale: float) -> tuple[Array, Array]:
    """V of two agents at each eta (32), nonsmooth and smooth; r times ``scale``."""
    psi = structural_potential(WIDE, system.ATTRACTION, system.REPULSION)

    def value(net: Graph, eta: float) -> float:
        q = np.array([[0.0, 0.0], [WIDE + eta, 0.0]])
        return structural_energy(net, psi, State(q)).potential

    hard, smooth = pair_net(False, scale), pair_net(True, scale)
    return np.array([value(hard, e) for e in pair_deviations()]), np.array(
        [value(smooth, e) for e in pair_deviations()]
    )


def edge_deviation(scale: float) -> tuple[State, float]:
    """Two agents and the deviation of their link from d_alpha times ``scale``."""
    from flocking.papers.olfati_saber_2003.structural_nets import deviation

    q = np.array([[1.0, 2.0], [9.0, 3.0]])
    return State(q), deviation(q, system.hard_net().initial(q), system.DISTANCE * scale)


def largest_potential(scale: float) -> tuple[float, float]:
    """V of twelve agents at one point (psi(-d_alpha) for every pair), and the largest value of a pair within r."""
    psi = structural_potential(system.DISTANCE * scale, system.ATTRACTION, system.REPULSION)
    q = np.zeros((EXAMPLE_AGENTS, 2))
    found = structural_energy(system.hard_net(), psi, State(q)).potential
    return found, float(psi(np.linspace(0.0, system.RADIUS, 1000)).max())


# -- quasi-realizations ---------------------------------------------------------------------------------


def wheel() -> State:
    """One agent inside a ring of five at rest, in balance: links to it are shorter than d_alpha, others longer."""
    from scipy.optimize import brentq

    psi, half = potential(), np.sin(np.pi / 5)

    def outward(spoke: float) -> float:
        return float(psi.slope(spoke) + 2 * half * psi.slope(2 * half * spoke))

    radius = brentq(outward, system.DISTANCE / (2 * half), system.DISTANCE, xtol=1e-15, rtol=1e-15)
    angle = 2 * np.pi * np.arange(5) / 5
    ring = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return State(np.vstack([np.zeros((1, 2)), ring]))


def defect_of(scale: float) -> tuple[State, Defect]:
    """Example state and the defect of its uniform net for w = 0.01, a times ``scale``."""
    state = example_state()
    return state, defect(system.hard_net(), potential(scale), state)


def wheel_defect(scale: float) -> tuple[State, Defect, tuple[bool, ...]]:
    """The wheel, its defect, and what is a quasi-realization of (0.2 at most): its limit at rest, of which a is off by
    ``scale``; one that continues moving; one further off.
    """
    found = defect(system.hard_net(), potential(scale), wheel())
    moving = [found, replace(found, potential=1.01 * found.potential)]
    far = replace(found, potential=1.2 * found.potential)
    verdicts = tuple(is_quasi_realization(d, most=1.1 * found.normalized) for d in ([found] * 3, moving, [far] * 3))
    return wheel(), found, verdicts


def invariance(scale: float) -> tuple[Array, Array]:
    """Sum of the controls (34) and of the controls (35) of the example state, one agent's damping times ``scale``."""
    from flocking.model.terms.pair_terms import Consensus

    gains = np.full(EXAMPLE_AGENTS, system.DAMPING)
    gains[0] *= scale
    terms = (Gradient(potential()), Consensus(gains))
    state = example_state()
    hard, smooth = (control(Law(net, terms), state).sum(axis=0) for net in (system.hard_net(), system.smooth_net()))
    return hard, smooth


def rate_of_structural_energy(state: State, u: Array, net: Graph, psi: Potential) -> float:
    """dH_s/dt under accelerations ``u``, by central differences of H_s along the motion.

    Parameters
    ----------
    net
        The graph.
    psi
        The potential.
    """
    step = 1e-5

    def at(s: float) -> float:
        return structural_energy(net, psi, State(state.q + s * state.p, state.p + s * u)).total

    return (at(step) - at(-step)) / (2 * step)


def dissipation(scale: float, *, smooth: bool = False) -> tuple[State, float, float]:
    """Example state, dH_s/dt by differences of H_s, and the dissipation by the law; c1 times ``scale``.

    Parameters
    ----------
    smooth
        Whether the net is the smooth one.
    """
    state = example_state()
    net: Graph = system.smooth_net() if smooth else system.hard_net()
    law = Law(net, system.alpha_terms(c1=system.DAMPING * scale))
    found = evaluate(law, state)
    return state, rate_of_structural_energy(state, found.u, net, potential()), found.dissipation


def smooth_dissipation(scale: float) -> tuple[State, float, float]:
    """The same for (35) on the smooth net."""
    return dissipation(scale, smooth=True)
