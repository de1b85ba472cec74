"""Copies of agents of other ranks: who sends which agents to whom, and the messages of every step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Indices, Reals
from flocking.engine.lammps.domains.messages import Numbering, owners, sent

if TYPE_CHECKING:
    from mpi4py.MPI import Comm, Prequest


class Copies:
    """The copies that a rank keeps until agents are exchanged again. Making them is collective.

    Parameters
    ----------
    comm
        An mpi4py communicator.
    numbers, indices
        Numbers and indices of the agents of this rank of which others may keep copies.
    requested
        Numbers of the agents of which it keeps copies; none of its own.

    Attributes
    ----------
    ids
        Numbers of the copies, in the order of their rows.
    """

    def __init__(
        self, comm: Comm, numbers: NDArray[np.int32], indices: Indices, requested: NDArray[np.int32]
    ) -> None:  # fmt: skip
        from mpi4py import MPI

        self._comm = comm
        rank = owners(comm, numbers, requested)
        order = np.argsort(rank, kind="stable")
        self.ids = requested[order]
        asked, counts = sent(comm, rank[order], self.ids[:, None])
        self._places: Indices = Numbering(numbers, indices).places(asked[:, 0])
        self._rows: Indices = np.arange(len(self.ids))
        self._senders = [(int(r), slice(*x)) for r, x in _spans(np.bincount(rank, minlength=comm.size))]
        self._takers = [(int(r), slice(*x)) for r, x in _spans(counts)]
        self._requests: list[Prequest] = []
        # Looked up once: a step has few microseconds for all of its messages.
        self._start_all, self._wait_all = MPI.Prequest.Startall, MPI.Request.Waitall
        self._first, self._at = -1, self._rows
        self._begun: Reals | None = None
        self._out: Reals = np.empty((0, 0))
        self._in: Reals = np.empty((0, 0))

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def partners(self) -> int:
        """Number of ranks to which this one sends."""
        return len(self._takers)

    def reorder(self, place: Indices, rows: Indices) -> None:
        """Follow a change of the order of agents and of copies.

        Parameters
        ----------
        place
            New index of each agent of this rank.
        rows
            New row of each copy.
        """
        self._places = place[self._places]
        moved = np.empty_like(self.ids)
        moved[rows] = self.ids
        self.ids, self._rows = moved, rows[self._rows]
        self._first = -1

    def begin(self, agents: Reals) -> None:
        """Begin to send rows that `refresh` is going to be called with, unchanged until then. Collective.

        Parameters
        ----------
        agents
            As for `refresh`.
        """
        self._finish()
        if self._out.shape[1] != agents.shape[1] or self._out.dtype != agents.dtype:
            self._set_up(agents)
        agents.take(self._places, 0, self._out, "clip")
        self._start_all(self._requests)
        self._begun = agents

    def refresh(self, agents: Reals, first: int) -> None:
        """Send the own agents that others copy, and receive the copies. Collective.

        Parameters
        ----------
        agents
            Positions and velocities of agents, and of copies from row ``first`` on, shape (rows, 2m).
        first
            Row of the first copy.
        """
        if self._begun is not agents:
            self.begin(agents)
        self._finish()
        if first != self._first:
            self._first, self._at = first, first + self._rows
        agents[self._at] = self._in

    def _finish(self) -> None:
        """Wait for the messages that have begun."""
        if self._begun is not None:
            self._wait_all(self._requests)
            self._begun = None

    def _set_up(self, agents: Reals) -> None:
        self.close()
        self._out = np.empty((len(self._places), agents.shape[1]), agents.dtype)
        self._in = np.empty((len(self._rows), agents.shape[1]), agents.dtype)
        self._requests = [self._comm.Recv_init(self._in[part], rank) for rank, part in self._senders]
        self._requests += [self._comm.Send_init(self._out[part], rank) for rank, part in self._takers]

    def close(self) -> None:
        """Free the requests of the messages."""
        self._finish()
        for request in self._requests:
            request.Free()
        self._requests = []


def _spans(counts: NDArray[np.integer]) -> list[tuple[int, tuple[int, int]]]:
    """Ranks with rows, and the range of these among all rows."""
    ends = np.cumsum(counts)
    return [(int(rank), (int(ends[rank] - counts[rank]), int(ends[rank]))) for rank in np.flatnonzero(counts)]
