"""Safety filters of exported laws: random states, and what the filter of the engine makes of them."""

from __future__ import annotations

import numpy as np

import flocking as fk
from flocking.engine.imperfect.messages.knowledge import Known
from flocking.engine.sampled.safety import ForceFilter
from tests.engine.c_export.building import CODES

LAW = fk.Law(fk.Proximity(9.0), [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=6.0)), fk.Consensus(0.4)])


def filtered_scenario(form, n=6, m=2, **options):
    """Agents that the law drives together, behind a safety filter."""
    given = {"distance": 0.7, "acceleration": np.linspace(6.0, 9.0, n), "form": form} | options
    start = fk.State(3.0 * np.arange(n * m, dtype=float).reshape(n, m), np.zeros((n, m)))
    agents = fk.Agents(masses=np.linspace(0.5, 2.0, n))
    return fk.Scenario(LAW, start, 1.0, agents=agents, control=fk.SafetyFilter(0.1, **given))


def crowd(rng, n, m):
    """Positions and velocities of agents among which some approach each other."""
    q = rng.uniform(-2.0, 2.0, (n, m)) * rng.uniform(0.5, 2.5)
    return q, rng.normal(size=(n, m)) * rng.uniform(0.0, 3.0)


def of_engine(filtering, agent, q, p, heard, force):
    """What the filter of the engine makes of a force, and whether it relaxed its conditions."""
    n = len(q)
    there = np.isin(np.arange(n), heard)
    rows = np.concatenate([q, p], axis=1)
    known = Known(np.array([agent]), rows[[agent]], rows[None], there[None], None, 0)
    before = filtering.memory.relaxed
    return filtering.filtered(0, known, force[None])[0], filtering.memory.relaxed > before


def engine_filter(scenario):
    """The filter of the engine."""
    start = scenario.start
    return ForceFilter(scenario.control, np.asarray(scenario.agents.masses), start.q, scenario.space)


def called(compiled, memory, agent, q, p, heard, number):
    """Code and force of one call of an exported law."""
    for j in heard:
        assert compiled.receive(memory, j, q[j], p[j], number=number, stamp=number) == CODES["OK"]
    return compiled.control(memory, q[agent], p[agent], number)


def violated(filtering, agent, q, p, heard, acceleration):
    """By how much an acceleration misses the conditions of pairs, at most, and how far it is above the largest."""
    others = np.isin(np.arange(len(q)), heard)
    dp, dv = (x[agent] - x[others] for x in (q, p))
    normals, bounds = filtering._conditions(agent, others, dp, dv)
    misses = (bounds - normals @ acceleration).max(initial=-np.inf)
    return float(misses), float(np.linalg.norm(acceleration) - filtering.most[agent])
