"""Objects of the equation table of Zhou; each depends on a factor that is 1 for the paper."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.engine.reference.control import evaluate
from flocking.model.checks import Array
from flocking.model.energy import Energy
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Hysteresis
from flocking.model.law import Law, Scenario
from flocking.model.leaders_and_obstacles.leaders import Velocity
from flocking.model.observables import mean_position, mean_velocity
from flocking.model.potentials.potential import Potential
from flocking.model.state import State
from flocking.model.terms.body_terms import Track
from flocking.model.terms.pair_terms import Consensus, Gradient, PairTerm
from flocking.papers import examples
from flocking.papers.zhou_2015 import bounds, system, theorems
from flocking.study.claims.claim import Measure
from flocking.study.claims.judgement import Judgement
from flocking.study.claims.potential_minimum import smallest_value
from flocking.study.evidence import Evidence
from flocking.study.potentials.equilibrium import Equilibrium
from flocking.study.potentials.state_energy import total_energy

if TYPE_CHECKING:
    pass


FIRST_WITH_LEADER = 8
"""Number of the first figure of the system with a virtual leader."""


def scaled_potential(stiffness: float) -> Potential:
    """Potential (9) times a number.

    Parameters
    ----------
    stiffness
        Factor on the potential.
    """
    return Potential(f"stiffness*({system.potential().formula.text})", stiffness=stiffness, R=system.RADIUS)


def weights() -> Array:
    """Symmetric weights w_ij of the six example agents."""
    drawn = np.random.default_rng(5).uniform(0.5, 2.0, (6, 6))
    return np.asarray((drawn + drawn.T) / 2)


def law(gain: float = 1.0, stiffness: float = 1.0, pull: float | None = None) -> Law:
    """Protocol (8), or (24) if ``pull``, the leader's gain, is given, with weights and scaled parts.

    Parameters
    ----------
    gain
        Consensus gain.
    stiffness
        Factor on the potential.
    """
    terms: list[PairTerm | Track] = [Gradient(scaled_potential(stiffness)), Consensus(gain, weights=weights())]
    if pull is not None:
        terms.append(Track(Velocity(system.LEADER_VELOCITY), velocity_gain=pull))
    return Law(system.graph(), tuple(terms))


def example_state() -> State:
    """Six agents, of which some are neighbours."""
    return examples.example_state(6, spread=1.6, seed=11)


def links_after(scale: float) -> list[Links]:
    """Links of a pair that goes from 3.5 to 4.2 and back, at every hundredth, under the scaled radius."""
    net = Hysteresis(system.RADIUS * scale, system.GAP)
    found, links = [], np.zeros((0, 0), dtype=bool)
    for step, distance in enumerate(journey()):
        q = np.array([[0.0, 0.0], [distance, 0.0]])
        links = net.initial(q) if step == 0 else net.update(q, links)
        found.append(links)
    return found


def journey() -> Array:
    """Distances of a pair: out from 3.5 to 4.205 and back."""
    out = np.arange(3.505, 4.21, 0.01)
    return np.concatenate([out, out[::-1]])


def laplacian_of(scale: float) -> Array:
    """Laplacian of a chain with spacings from 3.97 to 4.03 under the scaled radius."""
    from flocking.study.nets.matrices import laplacian

    q = np.stack([np.cumsum([0.0, 3.97, 3.99, 4.01, 4.03]), np.zeros(5)], axis=1)
    return np.asarray(laplacian(system.graph(system.RADIUS * scale).initial(q)))


def sum_of_squares_of(scale: float) -> float:
    """z^T L z of the example state's velocities along x: half the sum over ordered pairs, the gain scaled."""
    state = example_state()
    flat = State(state.q, state.p * [1.0, 0.0])
    return evaluate(Law(system.graph(), (Consensus(scale),)), flat).dissipation


def displacement_of(scale: float) -> tuple[Array, Array]:
    """Displacements and changes of velocity of the simulated agents with scaled time and mass."""
    scenario = system.scenario(seed=0)
    return examples.displacement(scenario, examples.STEP * scale), examples.velocity_change(scenario, scale)


def stacked_of(scale: float) -> tuple[Array, Array]:
    """Stacked positions and velocities of the start, the side of the square scaled."""
    start = start_of(scale)
    return start.q.reshape(-1), start.p.reshape(-1)


def control_of(scale: float) -> Array:
    """Control (8) of the example state, both parts scaled."""
    return evaluate(law(scale, scale), example_state()).u


def led_control_of(scale: float) -> Array:
    """Control (24) of the example state, the leader's gain scaled."""
    return evaluate(law(pull=scale), example_state()).u


def relative_control_of(scale: float) -> Array:
    """Control (27): that of (24) relative to the leader, the consensus gain scaled."""
    state = example_state()
    moved = State(state.q - np.asarray(system.LEADER_VELOCITY) * 2.5, state.p - np.asarray(system.LEADER_VELOCITY))
    terms = (*law(gain=scale).terms, Track(Velocity((0.0, 0.0)), velocity_gain=system.LEADER_GAIN))
    return evaluate(Law(system.graph(), terms), moved).u


def potential_of(scale: float) -> Array:
    """Potential (9) for a scaled radius, at distances inside and at both ends."""
    return system.potential(system.RADIUS * scale)([0.0, 0.1, 1.0, 2.0, 3.0, 3.9])


def energy_of(scale: float) -> float:
    """Q of the example state, the potential scaled."""
    return total_energy(law(stiffness=scale), example_state())


def led_energy_of(scale: float) -> float:
    """U of the example state, the leader's velocity scaled."""
    leader = Velocity(np.asarray(system.LEADER_VELOCITY) * scale)
    return total_energy(law(pull=1.0), example_state(), Energy(frame="leader", leader=leader))


def means_of(scale: float) -> tuple[Array, Array]:
    """Mean velocity and position with the weight ``scale`` of the first agent."""
    state = example_state()
    masses = np.array([scale, *np.ones(5)])
    return mean_velocity(state, masses), mean_position(state, masses)


def rate_of(scale: float) -> float:
    """dQ/dt at the example state by central differences along the motion, the consensus gain scaled."""
    return _rate(law(gain=scale), Energy())


def led_rate_of(scale: float) -> float:
    """dU/dt at the example state by central differences along the motion, the leader's gain scaled."""
    leader = Velocity(system.LEADER_VELOCITY)
    return _rate(law(pull=scale), Energy(frame="leader", leader=leader))


def _rate(declared: Law, energy: Energy) -> float:
    state, step = example_state(), 1e-5
    u = evaluate(declared, state).u
    ends = [State(state.q + h * state.p + 0.5 * h**2 * u, state.p + h * u) for h in (step, -step)]
    ahead, behind = (total_energy(declared, end, energy) for end in ends)
    return (ahead - behind) / (2 * step)


def dissipation_of(scale: float) -> float:
    """Power (14) dissipated at the example state, the gain scaled."""
    return evaluate(law(gain=scale), example_state()).dissipation


def led_dissipation_of(scale: float) -> float:
    """Power (29) dissipated at the example state in the leader's frame, the leader's gain scaled."""
    leader = Velocity(system.LEADER_VELOCITY)
    declared = Law(system.graph(), (*law().terms, Track(leader, velocity_gain=scale)))
    return evaluate(declared, example_state(), energy=Energy(frame="leader", leader=leader)).dissipation


def mean_control_of(scale: float) -> Array:
    """Mean of the control if the weights of agent 0 are scaled."""
    gains = np.array([scale, *np.ones(5)])
    declared = Law(system.graph(), (Gradient(system.potential()), Consensus(gains, weights=weights())))
    return np.asarray(evaluate(declared, example_state()).u.mean(axis=0))


def led_mean_control_of(scale: float) -> Array:
    """Mean of control (24), the leader's gain scaled."""
    return np.asarray(led_control_of(scale).mean(axis=0))


def potential_forces_of(scale: float) -> Array:
    """Forces of the potentials at the example state, the potential scaled."""
    return Equilibrium(law(stiffness=scale), example_state()).forces


def start_evidence(gap: float = system.GAP, *, leader: bool = False) -> Evidence:
    """Evidence of the simulated start alone."""
    scenario = system.scenario(seed=0, leader=leader)
    net = system.graph(gap=gap)
    changed = scenario.with_(law=Law(net, scenario.law.terms), t_end=0.0, frames=1, name="")
    return Evidence(simulate(changed, progress=False))


def new_links_of(scale: float) -> int:
    """M for a hundred agents, their number scaled."""
    return bounds.most_new_links(round(100 * scale))


def distance_margin_of(scale: float) -> float:
    """Margin of the bound (N-1) r at the simulated start, r scaled."""
    scenario = system.scenario(seed=0)
    wider = scenario.with_(law=Law(system.graph(system.RADIUS * scale), scenario.law.terms), t_end=0.0, frames=1)
    return theorems.distances_bounded(Evidence(simulate(wider.with_(name=""), progress=False))).margin


def speed_margin_of(scale: float) -> float:
    """Margin of the bound sqrt(2 Q_max) at the simulated start, eps scaled."""
    return theorems.speeds_bounded(start_evidence(system.GAP * scale)).margin


def limit_rate_of(scale: float) -> tuple[State, float, State, float]:
    """Three agents under (8) at first and at last, each with the power that (14) dissipates there, the gain scaled."""
    moving, declared = (Law(system.graph(), (Gradient(system.potential()), Consensus(c))) for c in (1.0, scale))
    start = State(np.array([[0.0, 0.0], [1.5, 0.3], [0.4, 1.8]]), np.array([[0.5, 0.0], [-0.2, 0.8], [0.1, -0.6]]))
    run = simulate(Scenario(moving, start, t_end=20.0, frames=2), progress=False)
    first, last = run.state(0), run.state(-1)
    return first, evaluate(declared, first).dissipation, last, evaluate(declared, last).dissipation


def balance_of(scale: float) -> tuple[State, Array]:
    """Four linked agents in balance at one velocity, their distances scaled, and the forces of the potentials."""
    square = scale * examples.balanced_square(system.potential(), system.RADIUS / 2)
    state = State(square, np.tile((0.3, -0.7), (4, 1)))
    return state, Equilibrium(Law(system.graph(), (Gradient(system.potential()), Consensus(1.0))), state).forces


def moved_control_of(scale: float) -> tuple[Array, Array]:
    """Control (24) of the example state, the leader's gain scaled, and of the same state far from the leader."""
    state = example_state()
    return led_control_of(scale), evaluate(law(pull=scale), State(state.q + 1000.0, state.p)).u


def numbers_of(scale: float) -> dict[str, float]:
    """Numbers of the simulations as the scenario has them, lengths, gains and times times ``scale``."""
    scenario = system.scenario(seed=0, leader=True)
    net, (_, consensus, track) = scenario.law.graph, scenario.law.terms
    assert isinstance(net, Hysteresis)
    assert isinstance(consensus, Consensus)
    assert isinstance(track, Track)
    place, velocity, _ = track.leader.at(0.0)
    return {
        "agents": scenario.start.n,
        "r": net.radius * scale,
        "eps": net.gap * scale,
        "s_gamma": float(place[0]) * scale,
        "v_gamma": float(velocity[1]) * scale,
        "w": float(np.asarray(consensus.gain)) * scale,
        "c1": float(np.asarray(track.velocity_gain)) * scale,
        "duration": scenario.t_end * scale,
    }


def theorem_of(gain: float, *, leader: bool = False) -> dict[str, Judgement]:
    """The paper's claims about agents whose consensus gain is not the declared one."""
    name = system.LEADER if leader else system.KEY

    def plant(declared: Scenario) -> Law:
        changed = [Consensus(gain) if isinstance(t, Consensus) else t for t in declared.law.terms]
        return Law(declared.law.graph, tuple(changed))

    return examples.judged(system.scenarios()[name], plant, theorems.claims(name))


def led_theorem_of(gain: float) -> dict[str, Judgement]:
    """The claims of Theorem 2.

    Parameters
    ----------
    gain
        Consensus gain of the plant; 1 is declared.
    """
    return theorem_of(gain, leader=True)


def coming_together_of(scale: float) -> tuple[Array, float]:
    """Link lengths in the limit of the second start, the radius of the potential and the graph scaled, and the largest
    deviation from a common length.
    """
    radius = system.RADIUS * scale
    scenario = system.scenario(seed=1)
    changed = Law(system.graph(radius), (Gradient(system.potential(radius)), Consensus(1.0)))
    run = simulate(scenario.with_(law=changed, name=""), progress=False)
    return np.sort(Equilibrium(changed, run.state(-1)).r), theorems.links_have_one_length(Evidence(run)).margin


def definition_of(scale: float) -> tuple[float, tuple[tuple[bool | None, ...], ...]]:
    """Minimum of the potential with a scaled radius, and the items of the definition of psi that the paper's
    potential, a spring and -1/r satisfy.
    """
    radius = system.RADIUS * scale
    least = smallest_value(system.potential(radius), radius)[0]
    shown = system.potential(), Potential("(r - 1)**2"), Potential("-1/r")
    return least, examples.meets(system.KEY, system.RADIUS, *shown)


def mean_velocity_of(scale: float) -> tuple[Array, Measure]:
    """Mean velocity of the led group after one second, the leader's gain scaled, and (34) compared with the run."""
    scenario = system.scenario(seed=0, leader=True)
    pair_terms = [t for t in scenario.law.terms if not isinstance(t, Track)]
    pull = Track(scenario.law.leaders[0], velocity_gain=system.LEADER_GAIN * scale)
    changed = Law(scenario.law.graph, (*pair_terms, pull))
    run = simulate(scenario.with_(law=changed, t_end=1.0, frames=2, name=""), progress=False)
    return np.asarray(run.p[-1].mean(axis=0)), theorems.mean_velocity_decays(Evidence(run))


def start_of(scale: float) -> State:
    """The simulated start, the side of the square scaled."""
    return system.scenario(seed=0, side=system.SIDE * scale).start


def alone() -> Scenario:
    """The simulation without a leader, slightly longer than the figures show."""
    return system.scenario(seed=0, duration=13.0).with_(name="")


def led() -> Scenario:
    """The simulation with the leader, slightly longer than the figures show."""
    return system.scenario(seed=0, duration=13.0, leader=True).with_(name="")


def picture_of(number: int) -> Callable[[float], examples.Pictured]:
    """Builder: content of a figure.

    Parameters
    ----------
    number
        Number of the figure.
    """
    return examples.pictured(system.KEY, number, alone if number < FIRST_WITH_LEADER else led)
