"""Objects of the equation table for sections 6, 7 and 10: protocols, the neighbours' vote, tracking.

Every function takes a factor of the number that determines its object; 1 gives the value of the paper.
"""

from __future__ import annotations

import numpy as np

from flocking.engine.reference.control import control, evaluate
from flocking.model.checks import Array
from flocking.model.energy import Energy
from flocking.model.law import Law
from flocking.model.leaders_and_obstacles.leaders import Leader, Sink, Velocity
from flocking.model.state import State
from flocking.model.terms.body_terms import Track
from flocking.model.terms.pair_terms import Consensus, Gradient, Term
from flocking.papers.olfati_saber_2003 import system
from flocking.papers.olfati_saber_2003.closed_forms import gathering_energy, translational_energy
from flocking.papers.olfati_saber_2003.examples_energy import example_state, potential, rate_of_structural_energy
from flocking.papers.olfati_saber_2003.structural_nets import Vote, structural_energy, vote, vote_weights
from flocking.study.nets.matrices import laplacian

TRACKING_DAMPING = 2.0
"""c2 of the example controllers."""


def protocol_34(scale: float) -> tuple[State, Array]:
    """Example state and its control (34), c1 times ``scale``."""
    state = example_state()
    return state, control(Law(system.hard_net(), system.alpha_terms(c1=system.DAMPING * scale)), state)


def common_length(scale: float) -> Array:
    """Distances of zero force of links in three directions under (34), d_alpha times ``scale``."""
    from scipy.optimize import brentq

    gradient, damping = system.alpha_terms()
    assert isinstance(gradient, Gradient)
    other = gradient.potential.with_parameters(d=system.DISTANCE * scale)
    law = Law(system.hard_net(), (Gradient(other), damping))

    def pull(length: float, way: Array) -> float:
        return float(control(law, State(np.array([0.0 * way, length * way])))[0] @ way)

    ways = [np.array([np.cos(angle), np.sin(angle)]) for angle in (0.0, 1.0, 2.5)]
    return np.array([brentq(pull, 5.0, 8.3, args=(way,), xtol=1e-12) for way in ways])


def unit_vectors(scale: float) -> Array:
    """Control (34) without damping of two agents 8 apart, over phi_alpha(1): the vectors n_ij; a times ``scale``."""
    state = State(np.array([[0.0, 0.0], [4.8, 6.4]]))
    u = control(Law(system.hard_net(), (Gradient(potential(scale)),)), state)
    return np.asarray(u / float(potential().slope(8.0)))


def protocol_35(scale: float) -> tuple[State, Array]:
    """Example state and its control (35), c1 times ``scale``."""
    state = example_state()
    return state, control(Law(system.smooth_net(), system.alpha_terms(c1=system.DAMPING * scale)), state)


def protocol_36(scale: float) -> tuple[State, Array]:
    """Example state and its control (36), c1 times ``scale``."""
    state = example_state()
    terms = system.alpha_terms(c1=system.DAMPING * scale, weighting="force")
    return state, control(Law(system.smooth_net(), terms), state)


def approximation_error(scale: float) -> tuple[State, float, float]:
    """Example state, sum of |u - u^| of (35) and (36), and 2 L_rho V/r with the nonsmooth V; a times ``scale``."""
    state = example_state()
    psi, net = potential(scale), system.smooth_net()
    exact, rough = (control(Law(net, (Gradient(psi, weighting=w),)), state) for w in ("energy", "force"))
    steepest = net.shape.steepest(system.ONSET)
    bound = 2 * steepest / system.RADIUS * structural_energy(system.hard_net(), psi, state).potential
    return state, float(np.linalg.norm(exact - rough, axis=1).sum()), bound


def weights(scale: float) -> tuple[State, Array]:
    """Example state and w_ij (38), a times ``scale``."""
    state = example_state()
    return state, vote_weights(system.hard_net(), potential(scale), state)


def undamped(scale: float) -> tuple[State, Array]:
    """Example state and (39) as sum_j w_ij q_j - (sum_j w_ij) q_i, a times ``scale``."""
    state, w = weights(scale)
    return state, np.asarray(-laplacian(w) @ state.q)


def star(distance: float) -> State:
    """An agent with three neighbours at ``distance``, not evenly spread."""
    angle = np.array([0.1, 1.5, 2.9])
    ring = distance * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return State(np.vstack([np.zeros((1, 2)), ring]))


def balanced() -> State:
    """An agent whose vote is zero: two neighbours 8 away, one at d_alpha, one so near that its vote cancels."""
    from scipy.optimize import brentq

    psi = potential()
    near = brentq(lambda r: float(psi.slope(r) / r + 2 * psi.slope(8.0) / 8.0), 4.0, 7.0, xtol=1e-15, rtol=1e-15)
    q = [[0.0, 0.0], [8.0, 0.0], [0.0, 8.0], [near * np.cos(2.5), near * np.sin(2.5)], [0.0, -system.DISTANCE]]
    return State(np.array(q))


def vote_of(state: State, scale: float) -> tuple[State, Vote]:
    """A state and the vote on its first agent, a times ``scale``."""
    return state, vote(vote_weights(system.hard_net(), potential(scale), state), state.q, 0)


def average(scale: float) -> tuple[State, Vote]:
    """The vote in the example net."""
    return vote_of(example_state(), scale)


def positive_vote(scale: float) -> tuple[State, Vote]:
    """Case i: neighbours farther than d_alpha."""
    return vote_of(star(8.0), scale)


def negative_vote(scale: float) -> tuple[State, Vote]:
    """Case ii: neighbours nearer than d_alpha."""
    return vote_of(star(5.5), scale)


def zero_vote(scale: float) -> tuple[State, Vote]:
    """Case iii."""
    return vote_of(balanced(), scale)


def alignment(scale: float) -> tuple[State, Array]:
    """Example state and the damping of (34) alone times ``scale``: the protocol (13) for velocities."""
    state = example_state()
    return state, control(Law(system.hard_net(), (Consensus(scale),)), state)


# -- separation principle -------------------------------------------------------------------------------


def destination(sink: bool) -> Leader:
    """The origin at rest, or the desired velocity.

    Parameters
    ----------
    sink
        Whether agents go to a sink; else they follow a desired velocity.
    """
    return Sink((3.0, -2.0)) if sink else Velocity(system.DESIRED_VELOCITY)


def shared_controller(sink: bool, scale: float) -> Track:
    """Controller (64) or (66), c2 times ``scale``.

    Parameters
    ----------
    sink
        Whether agents go to a sink; else they follow a desired velocity.
    """
    gain = TRACKING_DAMPING * scale
    return Track(destination(sink), 1.0 if sink else 0.0, gain, shared=True, saturated=True)


def with_controller(terms: tuple[Term, ...], sink: bool, scale: float) -> Law:
    """Protocol (48) on the smooth net.

    Parameters
    ----------
    terms
        Terms of the protocol without its controller.
    sink
        Whether agents go to a sink; else they follow a desired velocity.
    """
    return Law(system.smooth_net(), (*terms, shared_controller(sink, scale)))


def separated(scale: float) -> tuple[State, Array, Array]:
    """Example state, control (48) towards a sink, and the interaction alone; c2 times ``scale``."""
    state = example_state()
    terms = system.alpha_terms()
    return state, control(with_controller(terms, True, scale), state), control(Law(system.smooth_net(), terms), state)


def mean_control(scale: float) -> tuple[State, Array]:
    """Example state and the mean of the controls (50), c2 times ``scale``."""
    state, u = pursuit(scale)
    return state, u.mean(axis=0)


def tracking_energy(scale: float) -> tuple[float, float]:
    """H_tr (49) towards a sink and towards a velocity, for a mean position and velocity times ``scale``."""
    q, p = np.array([4.0, 1.0]), np.array([0.5, -2.0])
    return translational_energy(q * scale, p, destination(True)), translational_energy(q, p * scale, destination(False))


def structural_rates(scale: float) -> tuple[State, float, float]:
    """dH_s/dt under (35) alone and under (48), c1 times ``scale``."""
    state, net = example_state(), system.smooth_net()
    terms = system.alpha_terms(c1=system.DAMPING * scale)
    laws = (Law(net, terms), with_controller(terms, True, 1.0))
    alone, both = (rate_of_structural_energy(state, control(law, state), net, potential()) for law in laws)
    return state, alone, both


def ledger_rates(scale: float) -> tuple[State, float, float]:
    """Supply minus dissipation in the ledger of H_s for (35) alone and for (48)."""
    state, net = example_state(), system.smooth_net()
    terms = system.alpha_terms(c1=system.DAMPING * scale)
    found = [
        evaluate(law, state, energy=Energy("centre of mass"))
        for law in (Law(net, terms), with_controller(terms, False, 1.0))
    ]
    return state, found[0].supply - found[0].dissipation, found[1].supply - found[1].dissipation


def tracking_rate(sink: bool, scale: float) -> tuple[State, float]:
    """dH_tr/dt under (48) by central differences of H_tr, c2 times ``scale``.

    Parameters
    ----------
    sink
        Whether agents go to a sink; else they follow a desired velocity.
    """
    state, step = example_state(), 1e-5
    u = control(with_controller(system.alpha_terms(), sink, scale), state).mean(axis=0)
    q, p = state.q.mean(axis=0), state.p.mean(axis=0)
    values = [translational_energy(q + s * p, p + s * u, destination(sink)) for s in (-step, step)]
    return state, (values[1] - values[0]) / (2 * step)


def sink_rate(scale: float) -> tuple[State, float]:
    """dH_tr/dt towards a sink."""
    return tracking_rate(True, scale)


def velocity_rate(scale: float) -> tuple[State, float]:
    """dH_tr/dt towards a velocity."""
    return tracking_rate(False, scale)


def total_rates(scale: float) -> tuple[State, float, float]:
    """dH/dt = dH_s/dt + dH_tr/dt under (48) towards a sink and towards a velocity, c1 times ``scale``."""
    _, _, both = structural_rates(scale)
    state, to_sink = sink_rate(1.0)
    return state, both + to_sink, both + velocity_rate(1.0)[1]


def controller(sink: bool, scale: float) -> tuple[State, Array]:
    """Example state and the controller u-bar alone, c2 times ``scale``.

    Parameters
    ----------
    sink
        Whether agents go to a sink; else they follow a desired velocity.
    """
    state = example_state()
    return state, control(Law(system.smooth_net(), (shared_controller(sink, scale),)), state)[0]


def sink_controller(scale: float) -> tuple[State, Array]:
    """(64)."""
    return controller(True, scale)


def velocity_controller(scale: float) -> tuple[State, Array]:
    """(66)."""
    return controller(False, scale)


def both_controllers(scale: float) -> tuple[State, Array, Array]:
    """Example state and the controllers (64) and (66) alone, c2 times ``scale``."""
    state, to_sink = sink_controller(scale)
    return state, to_sink, velocity_controller(scale)[1]


def largest_feedback(scale: float) -> tuple[float, float]:
    """|u-bar| of (64) and (66) at a large distance and speed, c2 times ``scale``."""
    far = State(np.full((1, 2), 1e9), np.full((1, 2), 1e9))
    first, second = (
        control(Law(system.smooth_net(), (shared_controller(sink, scale),)), far)[0] for sink in (True, False)
    )
    return float(np.linalg.norm(first)), float(np.linalg.norm(second))


def pursuit(scale: float) -> tuple[State, Array]:
    """Example state and control (50) with c2 = 5 times ``scale``."""
    state = example_state()
    law = system.sink_scenario(0, c2=system.SINK_DAMPING * scale, agents=2).law
    return state, control(law, state)


def gathering(scale: float) -> tuple[State, float, float]:
    """Example state, H_a of (52) and its rate without interaction, c2 times ``scale``."""
    state, step = example_state(), 1e-6
    track = Track(Sink((0.0, 0.0)), 1.0, TRACKING_DAMPING * scale)
    u = control(Law(system.smooth_net(), (track,)), state)
    values = [gathering_energy(state.q + s * state.p, state.p + s * u) for s in (-step, step)]
    return state, gathering_energy(state.q, state.p), (values[1] - values[0]) / (2 * step)


def all_together(scale: float) -> tuple[Array, int]:
    """Twelve agents in a ball of radius 0.499 r times ``scale`` at its edge: positions, and their number of links."""
    angle = 2 * np.pi * np.arange(12) / 12
    q = 0.499 * system.RADIUS * scale * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return q, int(np.triu(system.hard_net().initial(q)).sum())
