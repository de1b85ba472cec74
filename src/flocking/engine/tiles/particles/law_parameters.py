"""Numbers of a law that the kernel reads, with values per agent in sorted order."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Numbers32, Reals
from flocking.engine.tiles.kernels.parameters import kernel_numbers
from flocking.engine.tiles.kernels.spec import PRECISIONS, KernelSpec
from flocking.model.law import Scenario
from flocking.model.world.times import PER_SECOND


class LawParameters:
    """Parameters of a law at one time.

    Parameters
    ----------
    scenario
        Law, agents and energy.
    spec
        Specification of the kernel.
    t
        The time.
    ids
        Number of the agent at each index, shape (size,).
    n
        Number of agents in the arrays, which may be a part of those of the scenario.
    """

    def __init__(self, scenario: Scenario, spec: KernelSpec, t: float, ids: Numbers32, n: int) -> None:
        self._n = n
        dtype = PRECISIONS[spec.precision]
        self.P, rows, self.seeds, self.matrices = kernel_numbers(scenario, spec, t)
        masses: Array = np.asarray(rows[0], dtype=np.float64)
        self.mass = float(masses.sum()) if masses.ndim else scenario.start.n * float(masses)
        """Total mass of all agents of the scenario."""
        drawn = _drawn(scenario, spec, t)
        several = len(rows) > 2 or spec.mass_each or spec.damping_each or bool(drawn)
        rows = [*rows, *drawn]
        self.A: Reals = np.zeros((len(rows) if several else 0, len(ids)), dtype)
        """Values per agent, shape (rows, size); the last are numbers of bodies that the clock sets."""
        for k, value in enumerate(rows if several else []):
            if np.ndim(value):
                self.A[k, :n] = np.asarray(value, dtype=dtype)[ids[:n]]
            else:
                self.A[k] = value
        self.fill_pads()

    def reorder(self, order: Numbers32) -> None:
        """Sort the values per agent.

        Parameters
        ----------
        order
            Index of each agent before the sort, shape (n,).
        """
        for k in range(len(self.A)):
            self.A[k, : self._n] = self.A[k, order]
        self.fill_pads()

    def fill_pads(self) -> None:
        """Fill the padding with the values of the last agent."""
        n = self._n
        if n:
            self.A[:, n:] = self.A[:, n - 1 : n]


def _drawn(scenario: Scenario, spec: KernelSpec, t: float) -> list[float | Array]:
    """Numbers of bodies that are held between events, of all agents: 0 for limits, whose kernels ask themselves."""
    bodies, m = spec.layout.bodies, spec.dimension
    names = bodies.held(m)
    if not names:
        return []
    found = bodies.drawn(elapsed(scenario, t), scenario.start.n, m)
    return [found.get(name, 0.0) for name in names]


def elapsed(scenario: Scenario, t: float) -> float:
    """Time since the start in whole nanoseconds, of which periods of gusts are made.

    Of late times a nanosecond is less than the rounding: then it is rounded up, so that the gust that begins at a time
    is in force at it.

    Parameters
    ----------
    t
        The time.
    """
    rounding = float(np.spacing(max(abs(t), abs(scenario.start.t))))
    return round((t - scenario.start.t + rounding) * PER_SECOND) / PER_SECOND


def next_gust(scenario: Scenario, t: float) -> float:
    """The first time after ``t`` at which gusts change; infinite where there are none."""
    return scenario.start.t + scenario.agents.drawn_until(elapsed(scenario, t))
