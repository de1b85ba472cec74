"""Objects of the equation table of Cucker and Smale; each depends on a factor that is 1 for the paper."""

from __future__ import annotations

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.engine.reference.control import evaluate
from flocking.model.checks import Array
from flocking.model.state import State
from flocking.papers import examples
from flocking.papers.cucker_smale_2007 import closed_forms, system, theorems
from flocking.study.certificates.alignment_certificates import Alignment
from flocking.study.claims.judgement import Judgement

GAIN, EXPONENT, SCALE = 1.3, 0.7, 0.8
"""K, beta and sigma of the examples."""


def example_state() -> State:
    """Five agents in general position."""
    return examples.example_state()


def weights_of(scale: float) -> Array:
    """Weights of the example state, the exponent scaled."""
    return closed_forms.weights(example_state().q, GAIN, EXPONENT * scale, SCALE)


def control_of(scale: float) -> Array:
    """Accelerations of the example state, the length sigma scaled."""
    return evaluate(system.law(GAIN, EXPONENT, SCALE * scale), example_state()).u


def step_of(scale: float) -> tuple[Array, Array]:
    """One step of the discrete system from the example state, the step scaled."""
    found = closed_forms.discrete_step(example_state(), 0.1 * scale, GAIN, EXPONENT, SCALE)
    return found.q, found.p


def scatters_of(scale: float) -> tuple[float, float]:
    """Gamma and Lambda of the example state, both vectors scaled."""
    state = example_state()
    return closed_forms.scatter(scale * state.q), closed_forms.scatter(scale * state.p)


def critical_condition_of(scale: float) -> float:
    """The condition for beta = 1/2, K scaled."""
    return closed_forms.sufficient_condition(2.0, 0.1, GAIN * scale, 0.5)


def condition_of(scale: float) -> tuple[float, float]:
    """The condition for beta = 1 and beta = 3/4, sigma scaled."""
    return (
        closed_forms.sufficient_condition(2.0, 0.1, GAIN, 1.0, SCALE * scale),
        closed_forms.sufficient_condition(2.0, 0.1, GAIN, 0.75, SCALE * scale),
    )


def theorem_of(gain: float) -> dict[str, Judgement]:
    """Claims about groups with beta < 1/2 whose gain is not the declared one."""
    return examples.judged(
        system.scenarios()[system.KEY], lambda _: system.law(gain * 4.0 / system.AGENTS, 0.4), theorems.claims()
    )


def bounds_of(scale: float) -> tuple[float, float]:
    """X and the rate N phi(X) of the first start with beta = 1, the gain scaled."""
    found = Alignment(system.group(1.0, gain=10.0 * scale, spread=1.0))
    assert found.farthest is not None
    return float(found.farthest.hi), float(found.rate(float(found.farthest.hi)).lo)


def invariant_of(scale: float) -> Array:
    """W + K arctan r at three distances, the gain scaled."""
    return closed_forms.pair_invariant(np.array([0.0, 1.0, 2.5]), np.array([1.2, 0.4, 0.01]), 1.5 * scale)


def final_distances_of(scale: float) -> tuple[float, float]:
    """Limits of the distance for two starts, the speed scaled."""
    return closed_forms.final_distance(0.0, system.MEETING * scale), closed_forms.final_distance(0.5, scale, 2.0)


def final_speeds_of(scale: float) -> tuple[float, float]:
    """Limits of the relative speed for two starts, the speed scaled."""
    return closed_forms.final_speed(0.0, system.LEAVING * scale), closed_forms.final_speed(1.0, 2.0 * scale, 1.5)


def delay_limits_of(scale: float) -> tuple[float, float]:
    """Limits of the delay for lambda = 2, scaled."""
    return closed_forms.delay_limits(2.0 * scale)


def late_velocities_of(scale: float) -> Array:
    """Relative velocities of two agents known 1.5 late, the rate scaled, at some times."""
    scenario = system.late_pair(system.LATE, rate=scale, duration=4.5)
    run = simulate(scenario.with_(frames=(0.0, 1.0, 2.0, 3.5, 4.5), name=""), progress=False)
    return np.asarray(run.p[:, 0, 0] - run.p[:, 1, 0])


def neighbours_late_of(scale: float) -> Array:
    """Velocities of a group that knows its neighbours late, the delay scaled, after three times it."""
    scenario = system.delayed_group(delay=0.5 * scale)
    run = simulate(scenario.with_(t_end=1.5, frames=(0.0, 1.5), name=""), progress=False)
    return np.asarray(run.p[-1])


def discrete_motion_of(scale: float) -> tuple[Array, Array]:
    """Positions and velocities of a group in discrete time after ten steps, the step scaled."""
    scenario = system.discrete_group(step=system.STEP * scale)
    end = 10.0 * system.STEP * scale
    run = simulate(scenario.with_(t_end=end, frames=(0.0, end), name=""), progress=False)
    return run.q[-1], run.p[-1]
