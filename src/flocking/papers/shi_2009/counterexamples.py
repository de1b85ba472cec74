"""Computed counter-examples to statements of Shi, Wang, Chu; and the motions of their Examples 1-3."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from flocking.arrays import Array, Reals
from flocking.engine.driver.simulate import simulate
from flocking.engine.runs.run import Run
from flocking.model.energy import Energy
from flocking.model.graphs.distance_graphs import Fixed
from flocking.model.graphs.functionals import left_eigenvector
from flocking.model.law import Law, Scenario
from flocking.model.leaders_and_obstacles.leaders import Path
from flocking.model.state import State
from flocking.model.terms.body_terms import Track
from flocking.model.terms.pair_terms import Consensus
from flocking.papers.equation_table import Demonstration
from flocking.papers.shi_2009 import system
from flocking.papers.shi_2009.closed_forms import (
    centre_motion,
    exponential_leading_part,
    exponential_motion,
    free_motion,
    jordan_form,
    ramp_motion,
    steady_velocity_error,
)  # fmt: skip


def single_agent(
    velocity: str,
    *,
    h0: float = 1.0,
    r0: float = 0.0,
    t_end: float = 10.0,
    q: float = 0.4,
    p: float = -0.3,
    **parameters: float,
) -> Run:
    """One agent of unit mass after a leader on a line: the centre of mass under (12) or (15).

    Parameters
    ----------
    velocity
        Formula of ``t`` for the leader's velocity.
    h0, r0
        Gains on the velocity and the position error.
    t_end
        End of the run.
    parameters
        Values for the other names of the formula.
    """
    leader = Path([velocity], None, 0.0, **parameters)
    law = Law(Fixed(1, ()), (Track(leader, r0, h0),))
    start = State(np.array([[q]]), np.array([[p]]))
    return simulate(Scenario(law, start, t_end=t_end, frames=201, tolerance=1e-11, energy=Energy()), progress=False)


def example_1(scale: float) -> tuple[Array, Reals, Array]:
    """Times and velocity after a leader of constant velocity 2, h_0 = 1 times ``scale``, and the closed form."""
    run = single_agent("v", h0=scale, v=2.0)
    error = free_motion(1.0, 0.0, run.t, run.q[0, 0], run.p[0, 0] - 2.0)[1]
    return run.t, run.p[:, 0, 0], 2.0 + error[:, 0]


def example_2(scale: float) -> tuple[Array, Reals, Reals, tuple[Array, Array]]:
    """Times, position and velocity after v0 = alpha t, alpha = 0.7, h_0 = 1.3 times ``scale``, and the closed form."""
    run = single_agent("alpha*t", h0=1.3 * scale, t_end=20.0, alpha=0.7)
    x, v = run.q[:, 0, 0], run.p[:, 0, 0]
    return run.t, x, v, ramp_motion(1.3, 0.7, run.t, float(x[0]), float(v[0]))


def example_3(*, distinct: bool) -> Callable[[float], tuple[Array, Reals, Reals, tuple[Array, Array]]]:
    """Builder: times, position and velocity after v0 = exp(alpha h_0 t) under (15), the gain r_0 times ``scale``, and
    the closed form.

    Parameters
    ----------
    distinct
        Whether the two rates of the homogeneous solution differ; else r_0 makes them equal.
    """

    def build(scale: float) -> tuple[Array, Reals, Reals, tuple[Array, Array]]:
        h0, alpha = 1.2, 0.5
        r0 = 0.8 if distinct else h0 * h0 / 4
        run = single_agent("exp(c*t)", h0=h0, r0=r0 * scale, t_end=12.0, c=alpha * h0)
        x, v = run.q[:, 0, 0], run.p[:, 0, 0]
        return run.t, x, v, exponential_motion(h0, r0, alpha, run.t, float(x[0]), float(v[0]))

    return build


def centre_under(law: int) -> Callable[[float], tuple[object, Run]]:
    """Builder: a run of ten seconds and the closed form of its centre of mass, started times ``scale``."""

    def build(scale: float) -> tuple[object, Run]:
        name = {8: "uniform", 12: "velocity-only", 15: "position"}[law]
        scenario = system.scenario(seed=2, name=f"{system.KEY}-{name}").with_(t_end=10.0, frames=51, name="")
        run = simulate(scenario, progress=False)
        w = np.asarray(scenario.agents.masses) / np.sum(scenario.agents.masses)
        place, velocity = w @ run.q[0], w @ run.p[0]
        return centre_motion(law, run.t, place, velocity * scale), run

    return build


def decay(scale: float) -> tuple[Array, Array]:
    """Times and velocity error of the centre of mass under (8), started at 1, the gain times ``scale``."""
    t = np.linspace(0, 3, 31)
    return t, free_motion(2.0 * scale, 0.0, t, np.zeros(1), np.ones(1))[1][:, 0]


def limit_difference(scale: float) -> float:
    """Limit of the position difference under (8): h_0 = 2, start difference 1, velocity error 3 times ``scale``."""
    t = np.array([0.0, 40.0])
    return float(free_motion(2.0, 0.0, t, np.ones(1), np.full(1, 3.0 * scale))[0][-1, 0])


def theorem_3(scale: float) -> tuple[Array, Array, Array, Array]:
    """Times, and under (8) the velocity error and the position difference of the centre of mass for h_0 = 2 times
    ``scale``; and the largest velocity error of one that starts with the velocity of the leader.
    """
    t = np.linspace(0.0, 20.0, 201)
    leader_q = np.stack([1 - np.cos(t), np.sin(t)], axis=1)
    leader_p = np.stack([np.sin(t), np.cos(t)], axis=1)
    start = np.array([0.4, -0.3])
    place, velocity = centre_motion(8, t, start, np.array([3.0, 0.0]), h0=2.0 * scale)
    _, same = centre_motion(8, t, start, leader_p[0], h0=2.0 * scale)
    return t, velocity - leader_p, place - leader_q, np.abs(same - leader_p).max()


def centre_for_gains(scale: float) -> list[tuple[Array, Array]]:
    """Centre of mass under (8), (12) and (15) for h_0 = 0.6 times ``scale``, r_0 = 2.5, at times 0, 1, ... 8."""
    t, x, v = np.arange(9.0), np.array([0.4, -0.3]), np.array([1.0, 2.0])
    return [centre_motion(law, t, x, v, 0.6 * scale, 2.5 if law == 15 else 0.0) for law in (8, 12, 15)]


def decomposed(*, distinct: bool) -> Callable[[float], tuple[Array, Reals, Array]]:
    """Builder: A of (16) for h_0 = 1.2, and P and J of Example 3 for h_0 times ``scale``.

    Parameters
    ----------
    distinct
        Whether the eigenvalues differ, r_0 = 0.2; else r_0 = h_0^2/4.
    """

    def build(scale: float) -> tuple[Array, Reals, Array]:
        h0 = 1.2
        r0 = 0.2 if distinct else h0 * h0 / 4
        A = np.array([[0.0, 1.0], [-r0, -h0]])
        return A, *jordan_form(h0 * scale, r0 if distinct else r0 * scale**2)

    return build


def leading_part(*, distinct: bool) -> Callable[[float], tuple[Array, Reals, Reals, tuple[Array, Array]]]:
    """Builder: late times, position and velocity after v0 = exp(alpha h_0 t) under (15), and the leading part for r_0
    times ``scale``.

    Parameters
    ----------
    distinct
        As for `example_3`.
    """

    def build(scale: float) -> tuple[Array, Reals, Reals, tuple[Array, Array]]:
        t, x, v, _ = example_3(distinct=distinct)(1.0)
        late = t > 11.5
        r0 = 0.8 if distinct else 0.36
        return t[late], x[late], v[late], exponential_leading_part(1.2, r0 * scale, 0.5, t[late])

    return build


def steady(law: int) -> Callable[[float], tuple[float, float]]:
    """Builder: steady error for h_0 = 0.7 times ``scale`` and r_0 = 2."""
    return lambda scale: (steady_velocity_error(law, 0.7 * scale, 2.0 if law == 15 else 0.0), 0.7)


def unequal_gains(scale: float) -> float:
    """Rate of the mean velocity when two agents at opposite velocities have gains 1 and 2 times ``scale``."""
    leader = Path(["0*t"])
    law = Law(Fixed.complete(2), (Track(leader, velocity_gain=np.array([1.0, 2.0 * scale])),))
    from flocking.engine.reference.control import control

    return float(control(law, State(np.array([[0.0], [1.0]]), np.array([[1.0], [-1.0]]))).mean())


# -- printed forms that a number refutes ---------------------------------------------------------------


@lru_cache(maxsize=4)
def _excess(name: str) -> float:
    """Largest excess of an agent's potential over its minimum at the end of a scenario."""
    from flocking.study.evidence import Evidence

    evidence = Evidence(simulate(system.scenario(seed=0, name=name), progress=False))
    lowest = float(system.potential()(1.0)) * np.bincount(evidence.equilibrium.i, minlength=system.AGENTS)
    return float((evidence.equilibrium.agent_potentials - lowest).max())


def not_minimal(name: str) -> Callable[[], Demonstration]:
    """Theorems 1, 2, 4, 5: the limit of a scenario is stationary, but not a minimum of every agent's potential."""
    return lambda: Demonstration(
        0.0, _excess(name), 1e-3, "largest excess of an agent's potential over its minimum at the limit"
    )


def wrong_sign() -> Demonstration:
    """(8) as printed, -sum w_ij (v^j - v^i): the relative speed of two agents grows."""
    from flocking.engine.reference.control import control

    pair = Law(Fixed.complete(2), (Consensus(1.0),))
    state = State(np.array([[0.0], [1.0]]), np.array([[0.0], [1.0]]))
    right = control(pair, state)
    printed = -right
    return Demonstration(
        float((printed[1] - printed[0])[0]),
        float((right[1] - right[0])[0]),
        1e-12,
        "rate of the relative velocity 1 of two agents: as printed, and with the sign of (4)",
    )


def time_constant() -> Demonstration:
    """After (9): the error falls to 1/e after 1/h_0, not after h_0."""
    h0 = 2.0
    t = np.linspace(0, 4, 400001)
    error = free_motion(h0, 0.0, t, np.zeros(1), np.ones(1))[1][:, 0]
    return Demonstration(h0, float(t[np.argmax(error <= np.exp(-1))]), 1e-4, "time to 1/e for h_0 = 2")


def offset_divided() -> Demonstration:
    """Before Theorem 3: the limit is x*(0) + (v* - v0)/h_0; printed once as a product."""
    return Demonstration(1.0 + 3.0 * 2.0, limit_difference(1.0), 1e-9, "limit for h_0 = 2, offset 1, velocity error 3")


def no_eigenvector() -> Demonstration:
    """Example 3 (ii): (1, 1 + l1) is not an eigenvector of A."""
    h0 = 1.2
    A, both, w = np.array([[0.0, 1.0], [-h0 * h0 / 4, -h0]]), -h0 / 2, np.array([1.0, 1.0 - h0 / 2])
    return Demonstration(
        0.0, float(np.linalg.norm(A @ w - both * w)), 1e-9, "|A w - l1 w| for w = (1, 1 + l1), h_0 = 1.2, r_0 = h_0^2/4"
    )


def position_left_behind() -> Demonstration:
    """Example 2: alpha/h_0 is the lag of the velocity; the position difference grows without bound."""
    t, alpha, h0 = np.array([100.0]), 0.7, 1.3
    place, _ = ramp_motion(h0, alpha, t, 0.0, 0.0)
    return Demonstration(
        -alpha / h0, float(place[0] - alpha * t[0] ** 2 / 2), 1e-6, "e_p* after 100 s for alpha = 0.7, h_0 = 1.3"
    )


def product_of_errors() -> Demonstration:
    """Proof of Theorem 2: e_v^i e_v^j of two agents is not bounded by 2 c/m_i; |e_v^i|^2 is."""
    heavy, light, c = 1.0, 0.05, 1.0
    # Half of c in either agent, parallel velocity errors, zero potential.
    product = np.sqrt(c / heavy) * np.sqrt(c / light)
    return Demonstration(
        2 * c / heavy,
        float(product),
        1e-9,
        "bound 2 c/m_i of e_v^i e_v^j, and the product for masses 1 and 0.05, c = 1",
    )


def wrong_index() -> Demonstration:
    """Remark 3 with xi_j w_ij: the power of the alignment forces is not the printed negative form."""
    weights = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [2.0, 0.5, 0.0]])
    xi = left_eigenvector(weights)
    laplacian = np.diag(weights.sum(axis=1)) - weights
    v = np.array([1.0, -0.4, 0.3])
    right = -float(v @ np.diag(xi) @ laplacian @ v)
    swapped = weights * xi[None, :]
    printed = -float(v @ (np.diag(swapped.sum(axis=1)) - swapped) @ v)
    return Demonstration(
        printed, right, 1e-9, "power of the alignment forces on three agents: with xi_j, and with xi_i"
    )
