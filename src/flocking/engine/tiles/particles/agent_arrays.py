"""Positions, velocities and numbers of agents in the order of their cells, padded to whole tiles."""

from __future__ import annotations

import numpy as np

from flocking.arrays import AnyArray, Array, Numbers32, Reals
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.kernels.spec import PRECISIONS, KernelSpec
from flocking.engine.tiles.neighbours.neighbour_lists import WIDTH
from flocking.engine.tiles.simd.aligned_memory import aligned
from flocking.model.state import State

SPARE_SHARE = 8
"""Share of the rows, as a divisor, by which memory for other agents exceeds the need."""


class Room:
    """Memory for agents.

    Parameters
    ----------
    rows
        Number of rows.
    m
        Number of axes.
    dtype
        Precision.

    Attributes
    ----------
    spare_ids
        The rows of the buffer that a sort writes numbers to.
    """

    def __init__(self, rows: int, m: int, dtype: type[np.float32] | type[np.float64]) -> None:
        self.agents: Reals = aligned((rows, 2 * m), dtype)
        self.successor: Reals = aligned((rows, 2 * m), dtype)
        self.ids: Numbers32 = np.zeros(rows, np.int32)
        self.ids_buffer: Numbers32 = np.zeros(rows, np.int32)
        self.spare_ids = self.ids_buffer


class BodyRows:
    """What agents have beside position and velocity, and what the last pass computed of it.

    Parameters
    ----------
    width
        Number of further numbers of an agent.
    size
        Number of agents, filled up to whole tiles.
    axes
        Number of axes of controls that are stored; 0 where agents are points.
    dtype
        Precision.

    Attributes
    ----------
    further, slopes
        The numbers and their rates in the last pass, shape (width, size).
    controls
        Controls of the law in the last pass, shape (axes, size).
    """

    def __init__(self, width: int, size: int, axes: int, dtype: type[np.float32] | type[np.float64]) -> None:
        self.further: Reals = np.zeros((width, size), dtype)
        self.slopes: Reals = np.zeros_like(self.further)
        self.controls: Reals = np.zeros((axes, size), dtype)


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
    body_rows
        What agents have beside position and velocity.
    """

    def __init__(self, state: State, spec: KernelSpec, workers: Workers) -> None:
        self.spec, self.workers = spec, workers
        self._room = Room(0, state.dimension, self.dtype)
        # For agents of order 1 the second half is the velocity of the last step, which no formula reads.
        self._hold(np.arange(state.n, dtype=np.int32), state.q, state.p if spec.order == 2 else np.zeros_like(state.p))
        self._hold_columns(state)

    def _hold(self, ids: Numbers32, q: AnyArray, p: AnyArray, copies: int = 0) -> None:
        """Allocate the arrays for some agents, with rows for ``copies`` of agents of other processes behind them."""
        n, m = q.shape
        self.n: int = n
        rows = self.size + copies
        if len(self._room.ids) < rows:
            # Who takes other agents once does so again.
            self._room = Room(rows + rows // SPARE_SHARE if len(self._room.ids) else rows, m, self.dtype)
        self.agents: Reals = self._room.agents[:rows]
        self.successor: Reals = self._room.successor[:rows]
        self.ids: Numbers32 = self._room.ids[:rows]
        self._room.spare_ids = self._room.ids_buffer[:rows]
        self.agents[:n, :m], self.agents[:n, m:] = q, p
        self.ids[:n] = ids
        width = sum(self.spec.layout.bodies.widths(m).values())
        self.body_rows = BodyRows(width, self.size, m if self.spec.bodied else 0, self.dtype)
        self._fill_pads()

    def _hold_columns(self, state: State) -> None:
        """Take the further columns of a state, whose agents are those here, in order."""
        bodies = self.spec.layout.bodies
        widths, columns = bodies.widths(self.m), dict(state.columns)
        if not widths:
            return
        if any(name not in columns for name in widths):
            columns |= bodies.missing_columns(columns, state.q, state.p)
        self.body_rows.further[:, : self.n] = np.concatenate([columns[name] for name in widths], axis=1).T
        self._fill_pads()

    @property
    def dtype(self) -> type[np.float32] | type[np.float64]:
        """Precision of positions and velocities."""
        return PRECISIONS[self.spec.precision]

    @property
    def m(self) -> int:
        """Number of axes."""
        return int(self.agents.shape[1]) // 2

    @property
    def tiles(self) -> int:
        """Number of tiles."""
        return (self.n + WIDTH - 1) // WIDTH

    @property
    def size(self) -> int:
        """Number of agents, filled up to whole tiles."""
        return self.tiles * WIDTH

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
            self.body_rows.further[:, n:] = self.body_rows.further[:, n - 1 : n]

    @property
    def columns_in_order(self) -> dict[str, Array]:
        """Further columns in the order of identities, shape (N, width) each, by name."""
        found, first = {}, 0
        for name, width in self.spec.layout.bodies.widths(self.m).items():
            found[name] = self.in_order(self.body_rows.further[first : first + width])
            first += width
        return found

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
