"""Numbers of a law that the kernel of particle arrays reads, in the order of the agents."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Numbers32, Reals
from flocking.engine.tiles.kernels.parameters import kernel_numbers
from flocking.engine.tiles.kernels.spec import PRECISIONS, KernelSpec
from flocking.model.law import Scenario


class LawParameters:
    """Parameters of a law at one time.

    Parameters
    ----------
    scenario
        Law, agents and energy.
    spec
        What the kernel is made for.
    t
        The time.
    ids
        Number of the agent in each place, shape (size,).
    """

    def __init__(self, scenario: Scenario, spec: KernelSpec, t: float, ids: Numbers32) -> None:
        n = self._n = scenario.start.n
        dtype = PRECISIONS[spec.precision]
        self.P, rows, self.seeds, self.matrices = kernel_numbers(scenario, spec, t)
        masses: Array = np.asarray(rows[0], dtype=np.float64)
        self.mass = float(masses.sum()) if masses.ndim else n * float(masses)
        """Mass of all agents."""
        several = len(rows) > 2 or spec.mass_each or spec.damping_each
        self.A: Reals = np.zeros((len(rows) if several else 0, len(ids)), dtype)
        """Numbers of each agent, shape (rows, size)."""
        for k, value in enumerate(rows if several else []):
            if np.ndim(value):
                self.A[k, :n] = np.asarray(value, dtype=dtype)[ids[:n]]
            else:
                self.A[k] = value
        self.fill_pads()

    def reorder(self, order: Numbers32) -> None:
        """Sort the numbers of each agent.

        Parameters
        ----------
        order
            Place before the sort of each agent, shape (n,).
        """
        for k in range(len(self.A)):
            self.A[k, : self._n] = self.A[k, order]
        self.fill_pads()

    def fill_pads(self) -> None:
        """Give the places behind the last agent its numbers."""
        n = self._n
        self.A[:, n:] = self.A[:, n - 1 : n]
