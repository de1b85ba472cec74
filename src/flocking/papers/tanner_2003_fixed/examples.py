"""Objects of the equation table of Tanner I; each depends on a factor that is 1 for the paper."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Links
from flocking.engine.reference.control import evaluate
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import is_connected
from flocking.model.graphs.distance_graphs import Fixed, Proximity
from flocking.model.law import Law, Scenario
from flocking.model.observables import headings
from flocking.model.potentials.potential import Potential
from flocking.model.state import State
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.papers import examples
from flocking.papers.tanner_2003_fixed import system, theorems
from flocking.study.claims.judgement import Judgement
from flocking.study.claims.potential_minimum import smallest_value
from flocking.study.evidence import Evidence
from flocking.study.potentials.equilibrium import Equilibrium
from flocking.study.potentials.state_energy import agent_energies, total_energy

if TYPE_CHECKING:
    pass

EDGES = ((0, 1), (1, 2), (2, 3), (3, 4), (0, 4), (1, 3))
"""A ring of five agents with a chord."""


def scaled_potential(stiffness: float) -> Potential:
    """The paper's potential times a number.

    Parameters
    ----------
    stiffness
        Factor on the potential.
    """
    return Potential(f"stiffness*({system.potential().formula.text})", stiffness=stiffness)


def law(gain: float = 1.0, stiffness: float = 1.0) -> Law:
    """Control law (5) on the example graph, its two parts scaled.

    Parameters
    ----------
    gain
        Consensus gain.
    stiffness
        Factor on the potential.
    """
    return Law(Fixed(5, EDGES), (Gradient(scaled_potential(stiffness)), Consensus(gain)))


def displacement_of(scale: float) -> Array:
    """Displacements of the simulated agents within a scaled time."""
    return examples.displacement(system.scenario(seed=1), examples.STEP * scale)


def velocity_change_of(scale: float) -> Array:
    """Changes of their velocities with a scaled mass."""
    return examples.velocity_change(system.scenario(seed=1), scale)


def headings_of(scale: float) -> Array:
    """Heading angles with scaled vertical velocities."""
    state = examples.example_state()
    return headings(State(state.q, state.p * [1.0, scale]))


def forces_of_law(scale: float) -> Array:
    """Control of the example state, both parts scaled."""
    return evaluate(law(scale, scale), examples.example_state()).u


COMMON_VELOCITY = (0.3, -0.7)
"""Velocity of all agents in the examples of (12)."""


def invariant_set_of(scale: float) -> tuple[Array, Array]:
    """Control (5) of agents that all have one velocity: of four in balance, all linked, their distances scaled, which
    is a state of an invariant set; and of the five example agents, which are not in balance.
    """
    together = Law(Fixed.complete(4), law().terms)
    still = scale * examples.balanced_square(system.potential())
    balanced = evaluate(together, State(still, np.tile(COMMON_VELOCITY, (4, 1)))).u
    other = State(examples.example_state().q, np.tile(COMMON_VELOCITY, (5, 1)))
    return balanced, evaluate(law(), other).u


def laplacian_of(scale: float) -> Array:
    """Laplacian of the graph of chain links shorter than the scaled radius."""
    from flocking.study.nets.matrices import laplacian

    return np.asarray(laplacian(chain_links(scale)))


def chain_links(scale: float) -> Links:
    """Links of a chain with spacings from 0.991 to 1.009 under the scaled radius 1."""
    q = np.stack([np.cumsum([0.0, 0.991, 0.996, 1.003, 1.009]), np.zeros(5)], axis=1)
    return Proximity(scale).initial(q)


def drawn_edges(scale: float) -> list[Sequence[tuple[int, int]]]:
    """Edges of forty drawn graphs, the probability of a link scaled."""
    chance = system.LINK_PROBABILITY * scale
    return [Fixed.random_connected(system.AGENTS, chance, seed).edges for seed in range(40)]


def connected_of(scale: float) -> bool:
    """Whether a chain with spacing 1 is connected under the radius 1.005 divided by the scale."""
    q = np.stack([np.arange(5.0), np.zeros(5)], axis=1)
    return is_connected(Proximity(1.005 / scale).initial(q))


def definition_of(scale: float) -> tuple[float, tuple[tuple[bool | None, ...], ...]]:
    """Minimum of the potential with a scaled repulsion, and the items of Definition IV.3 that the paper's potential, a
    spring and -1/r satisfy.
    """
    first, _, rest = system.potential().formula.text.partition(" + ")
    least = smallest_value(Potential(f"repulsion*{first} + {rest}", repulsion=scale))[0]
    return least, examples.meets(system.KEY, None, system.potential(), Potential("(r - 1)**2"), Potential("-1/r"))


def agent_potentials_of(scale: float) -> Array:
    """V_i of the example state, the potential scaled."""
    return agent_energies(law(1.0, scale), examples.example_state())


def energy_of(scale: float) -> float:
    """W of the example state, the potential scaled."""
    return total_energy(law(1.0, scale), examples.example_state())


def pair_forces_of(scale: float) -> Array:
    """Forces of a linked pair on each other, the potential scaled."""
    pair = Law(Fixed.complete(2), (Gradient(scaled_potential(scale)),))
    return evaluate(pair, State(np.array([[0.0, 0.0], [0.8, 0.3]]))).u


def power_of(scale: float) -> float:
    """Power dissipated at the example state, the gain scaled."""
    return evaluate(law(scale), examples.example_state()).dissipation


def total_power_of(scale: float) -> float:
    """dW/dt at the example state as the difference of W along the motion, the gain scaled."""
    state, step = examples.example_state(), 1e-5
    u = evaluate(law(scale), state).u
    ahead, behind = (
        State(state.q + h * state.p + 0.5 * h**2 * u, state.p + h * u) for h in (step, -step)
    )  # fmt: skip
    return (total_energy(law(scale), ahead) - total_energy(law(scale), behind)) / (2 * step)


def potential_forces_of(scale: float) -> Array:
    """Forces of the potentials at the example state, the potential scaled."""
    return Equilibrium(law(1.0, scale), examples.example_state()).forces


def speed_limit_of(scale: float) -> float:
    """Margin of the speed bound sqrt(2 c) for a pair of which one agent moves at the scaled speed 2."""
    from flocking.study.claims.general_claims import speeds_bounded

    evidence = _moving_pair(2.0 * scale)
    return speeds_bounded(2.0)(evidence).margin


def level_set_of(scale: float) -> tuple[float, float]:
    """Margins of the bounds sqrt(2 c) and (N-1) V^-1(c) for the pair of which one agent moves at the scaled speed 2."""
    evidence = _moving_pair(2.0 * scale)
    return speed_limit_of(scale), theorems.distances_bounded(evidence).margin


def distance_limit_of(scale: float) -> float:
    """Longest path of nine links when W is at most 2, that value scaled."""
    return theorems.longest_path(system.potential(), 9, 2.0 * scale)


def _moving_pair(speed: float) -> Evidence:
    from flocking.engine.driver.simulate import simulate
    from flocking.model.law import Scenario
    from flocking.study.evidence import Evidence

    pair = Law(Fixed.complete(2), (Gradient(system.potential()), Consensus(1.0)))
    start = State(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0.0, speed], [0.0, 0.0]]))
    return Evidence(simulate(Scenario(pair, start, t_end=0.0, frames=1), progress=False))


def theorem_of(gain: float, *, complete: bool = False) -> dict[str, Judgement]:
    """The paper's claims about agents whose consensus gain is not the declared one.

    Parameters
    ----------
    gain
        Consensus gain of the plant; 1 is declared.
    complete
        Whether all agents are linked.
    """
    name = system.COMPLETE if complete else system.KEY
    return examples.judged(
        system.scenarios()[name],
        lambda declared: Law(declared.law.graph, (Gradient(system.potential()), Consensus(gain))),
        theorems.claims(name),
    )


def remark_of(gain: float) -> dict[str, Judgement]:
    """The claims about the complete graph.

    Parameters
    ----------
    gain
        Consensus gain of the plant; 1 is declared.
    """
    return theorem_of(gain, complete=True)


def start_of(scale: float) -> State:
    """The simulated start, its largest speed scaled."""
    start = system.scenario(seed=0, speed=system.LARGEST_SPEED * scale).start
    return State(start.q, start.p)


def simulated() -> Scenario:
    """The simulation the figures show."""
    return system.scenario(seed=0)


def picture_of(number: int) -> Callable[[float], examples.Pictured]:
    """Builder: content of a figure.

    Parameters
    ----------
    number
        Number of the figure.
    """
    return examples.pictured(system.KEY, number, simulated)
