"""The few laws the tests of the exact engine share: a new structure costs seconds to compile, new numbers nothing."""

from __future__ import annotations

from typing import Any

import numpy as np

import flocking as fk

SPRING = fk.Potential("k*r**2/2", k=1.0)
BARRIER = fk.Potential("1/r + 1/(R - r)", R=4.0)


def spring(graph: fk.Graph, gain: float = 0.5, k: float = 1.0, **terms: Any) -> fk.Law:
    """Linear springs with friction."""
    return fk.Law(graph, [fk.Gradient(SPRING.with_parameters(k=k)), fk.Consensus(gain, **terms)])


def zhou(gain: float = 1.0, gap: float = 0.1) -> fk.Law:
    """The law of Zhou, without its leader."""
    return fk.Law(fk.Hysteresis(radius=4.0, gap=gap), [fk.Gradient(BARRIER), fk.Consensus(gain)])


def flight(positions: Any, velocities: Any, t: float = 0.0) -> fk.State:
    """A start from lists."""
    return fk.State(np.array(positions, dtype=float), np.array(velocities, dtype=float), t)


def simulate(law: fk.Law, start: fk.State, t_end: float, **options: Any) -> fk.Run:
    """A run without progress bar."""
    return fk.simulate(fk.Scenario(law, start, t_end=t_end, **options), progress=False)
