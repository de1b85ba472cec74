"""Equation table of Tanner I: where each numbered statement lives and how it is read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flocking.engine.reference import evaluate
from flocking.engine.run import Run
from flocking.engine.simulate import simulate
from flocking.model.energy import Energy
from flocking.model.graphs import Fixed
from flocking.model.law import Law
from flocking.model.potentials import Potential
from flocking.model.state import State
from flocking.model.terms import Consensus, Gradient
from flocking.papers.tanner_2003_fixed import system
from flocking.study.equations import Demonstration, Row

KEY = system.KEY
MODEL = "flocking.model"


def law(gain: float = 1.0, stiffness: float = 1.0) -> Law:
    """Control law (5) on a ring of five agents with a chord, both parts scaled."""
    graph = Fixed(5, ((0, 1), (1, 2), (2, 3), (3, 4), (0, 4), (1, 3)))
    psi = Potential("k*(1/r**2 + log(r**2))", k=stiffness)
    return Law(graph, (Gradient(psi), Consensus(gain)))


def short_run(gain: float = 1.0, *, complete: bool = False) -> Run:
    """A run of the paper's system whose agents obey (5) with another gain than the audited law declares."""
    declared = system.scenario(seed=0, complete=complete)
    plant = Law(declared.law.graph, (Gradient(system.potential()), Consensus(gain)))
    return simulate(declared, progress=False, plant=plant)


def figure_numbers(scale: float) -> dict[str, float]:
    """Numbers of the simulation of sec. V as the scenario has them, the radius and duration scaled."""
    scenario = system.scenario(seed=0)
    radius = float(np.linalg.norm(scenario.start.q, axis=1).max())
    return {
        "agents": scenario.start.n,
        "radius": system.START_RADIUS * scale,
        "farthest": radius,
        "speed": system.LARGEST_SPEED * scale,
        "fastest": float(np.linalg.norm(scenario.start.p, axis=1).max()),
        "duration": scenario.t_end * scale,
    }


def snapshot_time(k: int) -> Any:
    """Builder of a printed snapshot time."""
    return lambda scale: system.PRINTED_TIMES[k] * scale


def coincidence() -> Demonstration:
    """Remark IV.5 at work: two unlinked agents with the same two neighbours run into each other."""
    start = State(np.array([[0.0, 0.9], [0.0, -0.9], [0.6, 0.1], [1.1, -0.1]]))
    chain = Fixed(4, ((0, 2), (1, 2), (0, 3), (1, 3)))
    scenario = system.scenario(seed=0).with_(
        law=Law(chain, (Gradient(system.potential()), Consensus(1.0))), start=start, t_end=200.0, frames=11, name=""
    )
    run = simulate(scenario, progress=False)
    linked = run.closest_linked.distance
    return Demonstration(linked, run.closest_unlinked.distance, 0.1, "closest pair when linked, and when not")


def speed_bound() -> Demonstration:
    """After (6): from W <= c follows |v_i| <= sqrt(2 c), not sqrt(c): one moving agent and one link at its minimum."""
    psi = Potential("1/r**2 + log(r**2) - 1")
    state = State(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0.0, 2.0], [0.0, 0.0]]))
    found = evaluate(Law(Fixed.complete(2), (Gradient(psi),)), state)
    c = found.storage + found.kinetic
    return Demonstration(float(np.sqrt(c)), 2.0, 1e-9, "bound sqrt(c) against the speed of an agent with W = c")


def distance_bound() -> Demonstration:
    """After (6): V^-1(c (N-1)) does not bound ||r_ij|| along N-1 links; (N-1) V^-1(c) does."""
    from scipy.optimize import brentq

    psi = Potential("1/r**2 + r**4")
    links, length = 9, 3.0
    c = links * float(psi(length))
    printed = brentq(lambda s: float(psi(s)) - c * links, 1.0, 1e3)
    return Demonstration(
        float(printed),
        links * length,
        1e-6,
        "printed bound, against the length of a chain of nine links with V = 1/s^2 + s^4",
    )


def minimises() -> Demonstration:
    """Theorem IV.4 on the complete graph: the limit is stationary, but no agent is at its minimum."""
    from flocking.study.evidence import Evidence

    evidence = Evidence(simulate(system.scenario(seed=0, complete=True), progress=False))
    lowest = float(system.potential()(1.0)) * (system.AGENTS - 1)
    return Demonstration(lowest, float(evidence.equilibrium.agent_potentials.min()), 1e-3,
                         "smallest possible V_i against the smallest at the limit")  # fmt: skip


def equations() -> Sequence[Row]:
    """Every numbered statement of the paper."""

    def row(number: str, kind: str, title: str, home: str, build: Any, **more: Any) -> Row:
        return Row(KEY, number, kind, title, home, build, **more)

    scaled_law = lambda s: law(s, s)  # noqa: E731
    figure = "flocking.papers.tanner_2003_fixed.figures.figures"
    return (
        row("(1a)", "equation", "dr_i/dt = v_i", "flocking.engine.codegen.compiled_kernels", rhs_of),
        row("(1b)", "equation", "dv_i/dt = u_i", "flocking.engine.codegen.compiled_kernels", rhs_of),
        row("(2)", "equation", "heading angle of an agent", "flocking.model.observables.headings", headings_of),
        row("(3)", "equation", "u_i = a_i + alpha_i", f"{MODEL}.law.Law", scaled_law),
        row("L(G)", "equation", "Laplacian L = B B^T", "flocking.study.nets.laplacian", laplacian_of),
        row("Definition IV.1", "definition", "neighbouring graph", f"{MODEL}.graphs.Fixed", links_of),
        row("Assumption IV.2", "assumption", "the graph is connected", f"{MODEL}.connectivity.is_connected", connected_of),
        row("Definition IV.3", "definition", "potential function", "flocking.study.potential_check.check_potential",
            minimum_of),
        row("(4)", "equation", "V_i, the potential of agent i", "flocking.study.equilibrium.Equilibrium", agent_potentials_of),
        row("(5)", "equation", "the control law", f"{MODEL}.law.Law", scaled_law),
        row("W", "equation", "W = (1/2) sum (V_i + v_i^T v_i)", f"{MODEL}.energy.Energy", energy_of),
        row("(6)", "equation", "level sets of W bound speeds and distances",
            "flocking.papers.tanner_2003_fixed.theorems.distances_bounded", speed_limit_of, demonstration=speed_bound),
        row("after (6)", "equation", "bound on distances along a path",
            "flocking.papers.tanner_2003_fixed.theorems.distances_bounded", path_limit_of, demonstration=distance_bound),
        row("(7)", "equation", "gradients of V_ij are opposite", f"{MODEL}.terms.Gradient", pair_forces_of),
        row("Theorem IV.4", "theorem", "flocking in a fixed network",
            "flocking.papers.tanner_2003_fixed.theorems.claims", short_run, demonstration=minimises),
        row("(8)", "equation", "dW/dt as the sum of the powers", "flocking.engine.reference.evaluate", power_of),
        row("(9)", "equation", "dW/dt = -v_x^T L v_x - v_y^T L v_y", "flocking.engine.reference.evaluate", power_of),
        row("(10)", "equation", "forces are -(B x I) times link gradients", "flocking.study.equilibrium.Equilibrium",
            forces_of),
        row("(11)", "equation", "forces lie in the range of B", "flocking.study.equilibrium.Equilibrium", forces_of),
        row("(12)", "equation", "equal velocities stay equal in an invariant set",
            f"{MODEL}.terms.Consensus", scaled_law),
        row("Remark IV.5", "remark", "only a complete graph keeps all agents apart",
            "flocking.papers.tanner_2003_fixed.theorems.claims", lambda s: short_run(s, complete=True)),
        row("sec. V", "example", "the simulated system", "flocking.papers.tanner_2003_fixed.scenario", figure_numbers,
            reading="The paper gives neither potential nor graph: 1/s^2 + log s^2 without cut-off, and G(10, 0.3)"
                    " redrawn until connected."),
        row("Fig. 1", "figure", "the two control forces of an agent", figure, scaled_law),
        row("Fig. 2", "figure", "an example of a potential", figure, minimum_of,
            reading="No formula is given; Part II's is used."),
        row("Fig. 3", "figure", "initial configuration", figure, figure_numbers),
        *(row(f"Fig. {4 + k}", "figure", f"snapshot at {t} s", figure, snapshot_time(k))
          for k, t in enumerate(system.PRINTED_TIMES)),
        row("Fig. 8", "figure", "steady state", figure, figure_numbers),
    )  # fmt: skip


def example_state() -> State:
    """Five agents in general position."""
    rng = np.random.default_rng(7)
    return State(rng.normal(size=(5, 2)) * 1.5, rng.normal(size=(5, 2)))


def rhs_of(scale: float) -> tuple[Any, Any]:
    """Velocity and acceleration of the simulated motion at its start by finite differences, scaled."""
    scenario = system.scenario(seed=1).with_(t_end=2e-4, frames=(0.0, 1e-4, 2e-4), name="")
    run = simulate(scenario, progress=False)
    return scale * (run.q[2] - run.q[0]) / 2e-4, scale * (run.p[2] - run.p[0]) / 2e-4


def headings_of(scale: float) -> Any:
    """Heading angles of the example state, scaled."""
    from flocking.model.observables import headings

    return scale * headings(example_state())


def laplacian_of(scale: float) -> Any:
    """Laplacian of the example graph, scaled."""
    from flocking.study.nets import laplacian

    return scale * laplacian(law().graph.initial(example_state().q))


def links_of(scale: float) -> Any:
    """Links of the example graph, weighted by the scale."""
    return scale * law().graph.initial(example_state().q).astype(float)


def connected_of(scale: float) -> bool:
    """Whether a chain of agents with spacing 1 is connected under a radius 1/scale + 0.005."""
    from flocking.model.connectivity import is_connected
    from flocking.model.graphs import Proximity

    q = np.stack([np.arange(5.0), np.zeros(5)], axis=1)
    return is_connected(Proximity(1.0 / scale + 0.005).initial(q))


def minimum_of(scale: float) -> float:
    """Distance of the minimum of the example potential, scaled."""
    from flocking.study.potential_minimum import smallest_value

    return scale * smallest_value(system.potential())[0]


def agent_potentials_of(scale: float) -> Any:
    """V_i of the example state under potentials scaled."""
    from flocking.study.equilibrium import Equilibrium

    return Equilibrium(law(1.0, scale), example_state()).agent_potentials


def energy_of(scale: float) -> float:
    """W of the example state with potentials scaled."""
    found = evaluate(law(1.0, scale), example_state(), energy=Energy())
    return found.storage + found.kinetic


def speed_limit_of(scale: float) -> float:
    """Largest speed of an agent whose group has W = c = 2, scaled: sqrt(2 c)."""
    return scale * float(np.sqrt(2.0 * 2.0))


def path_limit_of(scale: float) -> float:
    """Length of a chain of ten agents whose links are all stretched to 3, scaled."""
    return scale * 9 * 3.0


def pair_forces_of(scale: float) -> Any:
    """Potential forces on two linked agents, the first scaled."""
    pair = Law(Fixed.complete(2), (Gradient(system.potential()),))
    u = evaluate(pair, State(np.array([[0.0, 0.0], [0.8, 0.3]]))).u
    return u[0] * scale, u[1]


def power_of(scale: float) -> float:
    """Dissipation of the example state with the gain scaled."""
    return evaluate(law(scale), example_state()).dissipation


def forces_of(scale: float) -> Any:
    """Potential forces of the example state, scaled along one agent."""
    from flocking.study.equilibrium import Equilibrium

    forces = np.array(Equilibrium(law(), example_state()).forces)
    forces[0] *= scale
    return forces
