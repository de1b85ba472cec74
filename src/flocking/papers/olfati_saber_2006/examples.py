"""Objects of the equation table of Olfati-Saber 2006; each depends on a factor that is 1 for the paper."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.engine.reference.control import control
from flocking.model.checks import Array
from flocking.model.law import Law, Scenario
from flocking.model.leaders_and_obstacles.leaders import Sink, Velocity
from flocking.model.leaders_and_obstacles.obstacles import Ball, Wall
from flocking.model.potentials.sigma_norm import SigmaNorm
from flocking.model.state import State
from flocking.model.terms.pair_terms import Consensus
from flocking.model.world.control import Held
from flocking.papers import examples
from flocking.papers.olfati_saber_2006 import closed_forms, system, theorems
from flocking.study.claims.judgement import Judgement

LENGTHS = np.array([0.0, 0.5, 3.0, 7.0, 8.0, 8.4, 12.0])
"""Lengths on both sides of d and r."""
SIGMAS = np.array([0.0, 1.0, 4.0, 10.0, 14.0, 15.0, 18.0, 19.0])
"""Sigma-norms on both sides of d_alpha and r_alpha."""
PLACES = np.array([[3.0, 1.0], [-2.0, 4.5], [7.0, -3.0]])
"""Agents beside the obstacles of the examples."""
SPEEDS = np.array([[-1.0, 0.5], [2.0, 0.3], [0.4, -1.2]])
"""Their velocities."""


def example_state() -> State:
    """Eight agents, of which some are neighbours."""
    rng = np.random.default_rng(11)
    return State(6.0 * rng.normal(size=(8, 2)), rng.normal(size=(8, 2)))


def near_obstacles() -> State:
    """Three agents within d' of the obstacles of Algorithm 3 in the examples, and one inside the first of them."""
    angle = np.array([0.3, 2.0, -1.4, 0.9])
    depth = np.array([1.0, 2.5, 4.1, -0.7])
    q = np.array([100.0, 20.0]) + (10.0 + depth)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return State(q, np.array([[4.0, 1.0], [5.0, -1.0], [3.0, 2.0], [4.5, 0.0]]))


def sigma_of(scale: float) -> Array:
    """Sigma-norms of lengths, epsilon scaled."""
    return SigmaNorm(system.EPSILON * scale)(LENGTHS)


def slope_of(scale: float) -> Array:
    """Lengths of n_ij, epsilon scaled."""
    return SigmaNorm(system.EPSILON * scale).slope(LENGTHS)


def bump_of(scale: float) -> Array:
    """rho_h for both onsets, scaled."""
    z = np.array([0.0, 0.1, 0.3, 0.6, 0.89, 0.93, 0.97, 1.0, 1.2])
    return np.stack([closed_forms.bump(z, h * scale) for h in (system.ALPHA_ONSET, system.BETA_ONSET)])


def adjacency_of(scale: float) -> Array:
    """Velocity consensus with the weights of the net, its radius scaled."""
    net = replace(system.net(), radius=system.RADIUS * scale)
    return control(Law(net, (Consensus(1.0, weighted=True),)), example_state())


def sigmoid_of(scale: float) -> Array:
    """Sigmoids phi for the paper's a = b, and for a = 1 and b = 5, b scaled."""
    z = np.linspace(-20.0, 5.0, 6)
    return np.stack(
        [closed_forms.uneven_sigmoid(z, 5.0, 5.0 * scale), closed_forms.uneven_sigmoid(z, 1.0, 5.0 * scale)]
    )


def action_of(scale: float) -> Array:
    """phi_alpha, its argument scaled."""
    return closed_forms.action(SIGMAS * scale)


def pair_potential_of(scale: float) -> Array:
    """psi_alpha, its argument scaled."""
    return np.array([closed_forms.pair_potential(float(z) * scale) for z in SIGMAS])


def obstacle_action_of(scale: float) -> Array:
    """phi_beta, its argument scaled."""
    return closed_forms.obstacle_action(np.array([0.0, 1.0, 3.0, 5.0, 6.0, 6.5, 6.7]) * scale)


def first_of(scale: float) -> Array:
    """Control of Algorithm 1, distances and velocities scaled."""
    state = example_state()
    return control(system.law(system.Algorithm(1)), State(state.q * scale, state.p * scale))


def second_of(scale: float) -> Array:
    """Control of Algorithm 2, c1 scaled."""
    leader = Velocity([5.0, 1.0], start=[3.0, -2.0])
    return control(system.law(system.Algorithm(2, (1.0, 1.0, 1.2 * scale), goal=leader)), example_state())


def third_of(scale: float) -> Array:
    """Control of Algorithm 3 near an obstacle, all gains scaled."""
    leader = Velocity([5.0, 1.0], start=[120.0, 25.0])
    gains = tuple(c * scale for c in system.GAINS)
    obstacles = system.balls(system.SPLIT_OBSTACLES)
    algorithm = system.Algorithm(3, gains, obstacles, leader)  # type: ignore[arg-type]
    return control(system.law(algorithm), near_obstacles())


def sphere_of(scale: float) -> tuple[Array, Array]:
    """Projections on a sphere, and their velocities, its radius scaled."""
    found = Ball(Sink([1.0, -1.0]), 1.5 * scale).at(PLACES, SPEEDS)
    return found["projection"], found["boundary"]


def wall_of(scale: float) -> tuple[Array, Array]:
    """Projections on a wall, and their velocities, its place scaled."""
    found = Wall(Sink([0.0, -4.0 * scale]), np.array([0.6, 0.8])).at(PLACES, SPEEDS)
    return found["projection"], found["boundary"]


def inside_of(scale: float) -> Array:
    """Force of the beta-agent alone on an agent at rest inside an obstacle, its depth scaled."""
    law = system.law(system.Algorithm(3, system.GAINS, system.balls([(0.0, 0.0, 10.0)]), Sink([9.0, 0.0])))
    avoid = Law(law.graph, (Consensus(0.0), law.terms[-1]))
    return np.asarray(control(avoid, State(np.array([[10.0 - scale, 0.0]]), np.zeros((1, 2))))[0])


def energy_of(scale: float) -> float:
    """H of the example state, its velocities scaled."""
    state = example_state()
    return closed_forms.structural_energy(State(state.q, state.p * scale))


def collisions_of(scale: float) -> tuple[int, int, int]:
    """Numbers k for energies near one, two and three times psi_alpha(0), scaled."""
    return tuple(closed_forms.most_collisions(52.383812 * k * 0.999 * scale) for k in (1, 2, 3))  # type: ignore[return-value]


def metrics_of(scale: float) -> dict[str, Array]:
    """Metrics of the first instant of a run, its positions scaled."""
    state = example_state()
    start = State(state.q * scale, state.p)
    scenario = replace(system.scenarios()[system.GENTLE](0), start=start, t_end=0.0, frames=1, name="")
    return dict(closed_forms.metrics(simulate(scenario, progress=False)))


def centre_of(scale: float) -> tuple[Array, Array]:
    """Motion of the centre at some times, c1 scaled."""
    leader = Velocity([5.0, 1.0], start=[3.0, -2.0])
    return closed_forms.centre_motion([0.0, 1.0, 4.0], example_state(), leader, 1.2 * scale)


def start_of(scale: float) -> State:
    """The start of the simulations, its positions scaled."""
    state = system.gaussian(system.AGENTS, 2, 0)
    return State(state.q * scale, state.p)


def theorem_of(gain: float) -> dict[str, Judgement]:
    """Claims about groups in space whose navigational feedback has not the declared ``gain``."""
    name = system.SPACE

    def plant(declared: Scenario) -> Law:
        (goal,) = declared.law.leaders
        return system.law(system.Algorithm(2, (1.0, 1.0, system.GROUP_GAIN * gain), goal=goal))

    return examples.judged(system.scenarios()[name], plant, theorems.claims(name), range(2))


def held_of(scale: float) -> tuple[Array, Array]:
    """Places and velocities at the third update of the network simulator's setting, the time of an update scaled."""
    step = scale * system.NETWORK_STEP
    made = system.held_network(3).with_(control=Held(step), t_end=3.0 * step, frames=4)
    run = simulate(made, progress=False)
    return np.asarray(run.q[3]), np.asarray(run.p[3])
