"""Positions, velocities and numbers of agents in the order of their cells, padded to whole tiles."""

from __future__ import annotations

import numpy as np

from flocking.arrays import AnyArray, Array, Numbers32, Reals
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.kernels.spec import PRECISIONS, KernelSpec
from flocking.engine.tiles.neighbours.neighbour_lists import WIDTH
from flocking.model.state import State


class AgentArrays:
    """Arrays of all agents.

    Parameters
    ----------
    state
        Positions and velocities.
    spec
        Specification of the kernel.
    workers
        Threads to use.

    Attributes
    ----------
    agents, successor
        The state and the next or previous one, each shape (size, 2m).
    ids
        Number of the agent at each index, shape (size,).
    """

    def __init__(self, state: State, spec: KernelSpec, workers: Workers) -> None:
        self.m, self.spec, self.workers = state.dimension, spec, workers
        self.dtype: type[np.float32] | type[np.float64] = PRECISIONS[spec.precision]
        # For agents of order 1 the second half is the velocity of the last step, which no formula reads.
        self._hold(np.arange(state.n, dtype=np.int32), state.q, state.p if spec.order == 2 else np.zeros_like(state.p))

    def _hold(self, ids: Numbers32, q: AnyArray, p: AnyArray, copies: int = 0) -> None:
        """Allocate the arrays for some agents, with rows for ``copies`` of agents of other processes behind them."""
        n, m = q.shape
        self.n, self.tiles = n, (n + WIDTH - 1) // WIDTH
        self.size = self.tiles * WIDTH
        self.agents: Reals = np.empty((self.size + copies, 2 * m), self.dtype)
        self.agents[:n, :m], self.agents[:n, m:] = q, p
        self.successor: Reals = np.empty((self.size + copies, 2 * m), self.dtype)
        self.ids: Numbers32 = np.zeros(self.size + copies, np.int32)
        self.ids[:n] = ids
        self._ids_buffer: Numbers32 = np.zeros(self.size + copies, np.int32)
        self._fill_pads()

    @property
    def X(self) -> Reals:  # noqa: N802
        """Positions and velocities, shape (2m, size): a view of `agents`, which has a row for each agent."""
        return self.agents.T

    @X.setter
    def X(self, values: Reals) -> None:  # noqa: N802
        self.agents = np.ascontiguousarray(values.T)

    @property
    def Y(self) -> Reals:  # noqa: N802
        """The previous or next state, shape (2m, size)."""
        return self.successor.T

    def _fill_pads(self) -> None:
        n, size = self.n, self.size
        if n:
            self.agents[n:size] = self.agents[n - 1]
            self.ids[n:size] = self.ids[n - 1]

    @property
    def place(self) -> Numbers32:
        """Index of each identity, shape (n,)."""
        found = np.empty(self.n, np.int32)
        found[self.ids[: self.n]] = np.arange(self.n, dtype=np.int32)
        return found

    def in_order(self, array: Reals) -> Array:
        """Rows of ``array``, shape (k, size), as float64 columns in the order of identities, shape (n, k)."""
        out = np.empty((self.n, len(array)))
        out[self.ids[: self.n]] = array[:, : self.n].T
        return out
