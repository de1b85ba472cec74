"""Objects of the equation table of Tanner II; each depends on a factor that is 1 for the paper."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.engine.reference.control import evaluate
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.law import Law, Scenario
from flocking.model.observables import headings
from flocking.model.potentials.potential import Potential
from flocking.model.state import State
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.papers import examples
from flocking.papers.tanner_2003_dynamic import system, theorems
from flocking.study.claims.judgement import Judgement
from flocking.study.claims.potential_minimum import smallest_value
from flocking.study.evidence import Evidence
from flocking.study.potentials import nonsmooth
from flocking.study.potentials.equilibrium import Equilibrium
from flocking.study.potentials.state_energy import agent_energies, total_energy

if TYPE_CHECKING:
    pass

DISTANCES = np.array([0.5, 1.0, 1.5, 1.9, 1.999, 2.0, 2.01, 2.5, 4.0])
"""Distances on both sides of the radius."""


def scaled_potential(stiffness: float) -> Potential:
    """The inner potential times a number.

    Parameters
    ----------
    stiffness
        Factor on the potential.
    """
    return Potential(f"stiffness*({system.inner_potential().formula.text})", stiffness=stiffness)


def law(gain: float = 1.0, stiffness: float = 1.0) -> Law:
    """Control law (4), its two parts scaled.

    Parameters
    ----------
    gain
        Consensus gain.
    stiffness
        Factor on the potential.
    """
    return Law(Proximity(system.RADIUS), (Gradient(scaled_potential(stiffness)), Consensus(gain)))


def example_state() -> State:
    """Six agents, of which some are neighbours."""
    return examples.example_state(6, spread=1.2, seed=3)


def switching_pair() -> State:
    """Three agents; the first two are at distance R and separate."""
    q = np.array([[0.0, 0.0], [system.RADIUS, 0.0], [0.5, 1.2]])
    return State(q, np.array([[-0.4, 0.1], [0.3, -0.2], [0.2, 0.5]]))


def entering_pair() -> State:
    """Three agents; the first two are at distance R and approach each other."""
    state = switching_pair()
    return State(state.q, -state.p)


def displacement_of(scale: float) -> Array:
    """Displacements of the simulated agents within a scaled time."""
    return examples.displacement(system.scenario(seed=0), examples.STEP * scale)


def velocity_change_of(scale: float) -> Array:
    """Changes of their velocities with a scaled mass."""
    return examples.velocity_change(system.scenario(seed=0), scale)


def headings_of(scale: float) -> Array:
    """Heading angles with scaled vertical velocities."""
    state = example_state()
    return headings(State(state.q, state.p * [1.0, scale]))


def control_of(scale: float) -> Array:
    """Control of the example state, both parts scaled."""
    return evaluate(law(scale, scale), example_state()).u


def links_of(scale: float) -> Links:
    """Links of a chain with spacings from 1.985 to 2.015 under the scaled radius."""
    q = np.stack([np.cumsum([0.0, 1.985, 1.995, 2.005, 2.015]), np.zeros(5)], axis=1)
    return Proximity(system.RADIUS * scale).initial(q)


def laplacian_of(scale: float) -> Array:
    """Laplacian of that chain."""
    from flocking.study.nets.matrices import laplacian

    return np.asarray(laplacian(links_of(scale)))


def second_eigenvalue_of(scale: float) -> float:
    """Algebraic connectivity of four agents in a square of side 1.99 under the scaled radius 2/1.01."""
    from flocking.study.nets.matrices import algebraic_connectivity

    q = 1.99 * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    return float(algebraic_connectivity(Proximity(system.RADIUS / scale**0.6).initial(q)))


def definition_of(scale: float) -> tuple[float, tuple[tuple[bool | None, ...], ...]]:
    """Minimum of the potential with a scaled repulsion, and the items of Definition IV.2 that the paper's potential, a
    spring and -1/r satisfy.
    """
    first, _, rest = system.inner_potential().formula.text.partition(" + ")
    least = smallest_value(Potential(f"repulsion*{first} + {rest}", repulsion=scale), system.RADIUS)[0]
    shown = system.potential(), Potential("(r - 1)**2"), Potential("-1/r")
    return least, examples.meets(system.KEY, system.RADIUS, *shown)


def potential_of(scale: float) -> Array:
    """U_ij at distances on both sides of the scaled radius."""
    return system.potential(system.RADIUS * scale)(DISTANCES)


def agent_potentials_of(scale: float) -> Array:
    """U_i of the example state, V_R that of a scaled radius."""
    return agent_energies(law(), example_state(), system.energy(system.RADIUS * scale))


def energy_of(scale: float) -> float:
    """Q of the example state, V_R that of a scaled radius."""
    return total_energy(law(), example_state(), system.energy(system.RADIUS * scale))


def filippov_of(scale: float) -> Array:
    """Corners of Filippov's set where a pair is at the radius, the potential scaled."""
    return nonsmooth.filippov_corners(law(1.0, scale), switching_pair())


def generalized_derivatives_of(scale: float) -> tuple[float, float]:
    """U degree (R; 1) and U degree (R; -1), the radius scaled."""
    radius = system.RADIUS * scale
    return tuple(nonsmooth.generalized_derivative(system.potential(radius), radius, w) for w in (1.0, -1.0))  # type: ignore[return-value]


def gradient_of(scale: float) -> tuple[float, float]:
    """Generalized gradient of U_ij at the scaled radius."""
    radius = system.RADIUS * scale
    return nonsmooth.generalized_gradient(system.potential(radius), radius)


def partial_gradient_of(scale: float) -> Array:
    """Ends of the generalized gradient of U_ij with respect to r_i for a pair at the scaled radius."""
    ends = gradient_of(scale)
    direction = np.array([0.6, 0.8])
    return np.array([end * direction for end in ends])


def derivatives_of(scale: float) -> tuple[float, float]:
    """U'(R; 1) and U'(R; -1), the radius scaled."""
    radius = system.RADIUS * scale
    return tuple(nonsmooth.directional_derivative(system.potential(radius), radius, w) for w in (1.0, -1.0))  # type: ignore[return-value]


def regularity_of(scale: float) -> tuple[tuple[float, float], bool]:
    """The usual derivatives at the scaled radius, and whether U_ij is regular there."""
    radius = system.RADIUS * scale
    return derivatives_of(scale), nonsmooth.is_regular(system.potential(radius), radius)


def rates_of(scale: float) -> nonsmooth.Rates:
    """Set-valued rate of Q where a pair is at the radius, the gain scaled."""
    return nonsmooth.energy_rates(law(scale), system.potential(), switching_pair())


def both_rates_of(scale: float) -> tuple[nonsmooth.Rates, nonsmooth.Rates]:
    """Set-valued rates of Q where a pair leaves the radius and where one enters it, the gain scaled."""
    return rates_of(scale), nonsmooth.energy_rates(law(scale), system.potential(), entering_pair())


def dissipation_of(scale: float) -> float:
    """Power dissipated at the example state, the gain scaled."""
    return evaluate(law(scale), example_state()).dissipation


def invariant_set_of(scale: float) -> Array:
    """Control (4) of four agents in balance that all have one velocity, their distances scaled."""
    still = scale * examples.balanced_square(system.inner_potential())
    return evaluate(law(), State(still, np.tile((0.3, -0.7), (4, 1)))).u


def level_set_of(scale: float) -> tuple[float, float]:
    """Margins of the bounds (N-1) R for the first start, the radius scaled, and sqrt(2 c) for a pair."""
    return distance_margin_of(scale), speed_margin_of(1.0)


def potential_forces_of(scale: float) -> Array:
    """Forces of the potentials at the example state, the potential scaled."""
    return Equilibrium(law(1.0, scale), example_state()).forces


def first_loss_of(scale: float) -> float:
    """Time at which the graph of the second seed becomes disconnected under the scaled radius."""
    drawn = system.scenario(seed=1)
    wider = Law(Proximity(system.RADIUS * scale), drawn.law.terms)
    return Evidence(simulate(drawn.with_(law=wider, t_end=1.0, frames=2), progress=False)).first_disconnected


def speed_margin_of(scale: float) -> float:
    """Margin of the speed bound sqrt(2 c) for a pair of which one agent moves at the scaled speed 2."""
    from flocking.study.claims.general_claims import speeds_bounded

    return speeds_bounded(2.0)(_short_look(2.0 * scale)).margin


def distance_margin_of(scale: float) -> float:
    """Margin of the distance bound (N-1) R for the first start, the radius scaled."""
    drawn = system.scenario(seed=0)
    wider = Law(Proximity(system.RADIUS * scale), drawn.law.terms)
    return theorems.distances_bounded(
        Evidence(simulate(drawn.with_(law=wider, t_end=0.0, frames=1), progress=False))
    ).margin  # fmt: skip


def _short_look(speed: float) -> Evidence:
    from flocking.model.law import Scenario

    start = State(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0.0, speed], [0.0, 0.0]]))
    pair = Law(Proximity(system.RADIUS), system.scenario(seed=0).law.terms)
    return Evidence(simulate(Scenario(pair, start, t_end=0.0, frames=1, energy=system.energy()), progress=False))


def theorem_of(gain: float) -> dict[str, Judgement]:
    """The paper's claims about agents whose consensus gain is not the declared one."""
    return examples.judged(
        system.scenarios()[system.KEY],
        lambda declared: Law(declared.law.graph, (Gradient(system.inner_potential()), Consensus(gain))),
        theorems.claims(),
    )


def start_of(scale: float) -> State:
    """The simulated start, its largest speed scaled."""
    return system.scenario(seed=0, speed=system.LARGEST_SPEED * scale).start


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
