"""Audited runs for the rows of theorems and tasks, as functions of a factor of the gains; 1 gives the paper's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.engine.runs.run import Run
from flocking.model.checks import Array
from flocking.model.law import Law, Scenario
from flocking.model.observables import mean_position, mean_velocity
from flocking.model.state import Agents, State
from flocking.model.terms.pair_terms import Consensus
from flocking.papers import examples
from flocking.papers.olfati_saber_2003 import system
from flocking.papers.olfati_saber_2003.examples_energy import example_state
from flocking.papers.olfati_saber_2003.theorems import claims
from flocking.study.claims.audit import Report, audit
from flocking.study.claims.judgement import Judgement, judge
from flocking.study.evidence import Evidence

if TYPE_CHECKING:
    pass

FEW_AGENTS = 24
"""Number of agents of the smaller run among obstacles, which takes seconds."""
FEW_START = ((40.0, 12.5), (40.0, 20.0))
"""Start box of the few agents: of the same density as for a hundred, close to the first obstacle."""
FEW_DURATION = 30.0
"""Duration of their simulation."""
SEEDS = range(5)
"""Seeds of the judgements."""


def scaled_law(law: Law, scale: float) -> Law:
    """The law with its damping c1 times ``scale``."""
    return Law(law.graph, tuple(replace_gain(t, scale) if isinstance(t, Consensus) else t for t in law.terms))


def replace_gain(term: Consensus, scale: float) -> Consensus:
    """The term with its gain times ``scale``."""
    return Consensus(np.multiply(term.gain, scale), weighted=term.weighted)


def few_through_obstacles(seed: int = 0) -> Scenario:
    """The first task with few agents, for tests and examples."""
    return system.obstacle_scenario(seed, agents=FEW_AGENTS, box=FEW_START).with_(t_end=FEW_DURATION)


def few_to_sink(seed: int = 0) -> Scenario:
    """The second task with thirty agents from a start a quarter as large."""
    scenario = system.sink_scenario(seed, agents=30)
    start = scenario.start
    return scenario.with_(start=replace(start, q=start.q * np.sqrt(0.3)))


SCENARIOS: dict[str, Callable[[int], Scenario]] = {
    system.KEY: few_through_obstacles,
    system.SINK: few_to_sink,
    system.FREE: lambda seed: system.free_scenario(seed),
    system.SMOOTH: lambda seed: system.free_scenario(seed, smooth=True),
}
"""Scenarios of the rows: the tasks with fewer agents than the paper's hundred."""


@lru_cache(maxsize=64)
def audited(name: str, seed: int, scale: float) -> Report:
    """A run whose agents' damping is scaled by ``scale``, audited by the declared law and the paper's claims."""
    scenario = SCENARIOS[name](seed)
    plant = None if scale == 1.0 else scaled_law(scenario.law, scale)
    return audit(simulate(scenario, plant=plant, progress=False), claims(name))


def judged(name: str) -> Callable[[float], dict[str, Judgement]]:
    """Builder: judgements over a few seeds by claim."""

    def build(scale: float) -> dict[str, Judgement]:
        found = judge(claims(name), [audited(name, seed, scale) for seed in SEEDS])
        return {j.claim.key: j for j in found}

    return build


free = judged(system.FREE)
smooth = judged(system.SMOOTH)
sink = judged(system.SINK)


def passing(scale: float) -> Report:
    """The audit of a few agents that pass the obstacles."""
    return audited(system.KEY, 0, scale)


def few_for_figures() -> Scenario:
    """The first task with few agents, up to the times of Fig. 7 and 8."""
    return few_through_obstacles().with_(t_end=26.0, name="")


def few_gathering() -> Scenario:
    """The second task with few agents, for the first snapshots of Fig. 9."""
    return few_to_sink().with_(t_end=8.0, frames=81, name="")


DRAWN: dict[str, Callable[[], Scenario]] = {"7": few_for_figures, "8": few_for_figures, "9": few_gathering}
"""Scenarios whose runs replace those of figures, by number; the other figures show no run."""


def picture(number: str) -> Callable[[float], examples.Pictured]:
    """Builder of the content of a figure.

    Parameters
    ----------
    number
        Its number.
    """
    return examples.pictured(system.KEY, number, DRAWN.get(number))


def newton(scale: float) -> tuple[Scenario, Run]:
    """A tenth of a millisecond of (21) under (34), masses times ``scale``."""
    scenario = system.free_scenario(1).with_(t_end=1e-4, frames=(0.0, 1e-4), name="")
    return scenario, simulate(scenario.with_(agents=Agents(masses=scale)), progress=False)


def mean_motion(scale: float) -> tuple[Scenario, Array, Array, Array]:
    """Times, mean positions and velocities of ten agents at a sink (23), their c2 times ``scale``."""
    scenario = system.sink_scenario(3, agents=10).with_(t_end=4.0, frames=9, name="")
    plant = system.sink_scenario(3, agents=10, c2=system.SINK_DAMPING * scale).law
    run = simulate(scenario, plant=plant, progress=False)
    states = [run.state(k) for k in range(len(run.t))]
    return (
        scenario, run.t, np.array([mean_position(s) for s in states]), np.array([mean_velocity(s) for s in states])
    )  # fmt: skip


def distance_rates(scale: float) -> tuple[State, float, float]:
    """The example state, the largest rate of change of a distance in it, and that of agents at one velocity, that of
    the first times ``scale``.
    """

    def largest(state: State) -> float:
        law = Law(system.hard_net(), system.alpha_terms())
        return Evidence(simulate(Scenario(law, state, t_end=0.0, frames=1), progress=False)).distance_rate

    state = example_state()
    p = np.tile([3.0, 2.0], (state.n, 1))
    p[0] *= scale
    return state, largest(state), largest(State(state.q, p))
