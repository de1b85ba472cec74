"""Rows of numbers sent among the ranks of a job."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray, Indices, Numbers

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


class Numbering:
    """Where some agents of a rank are, by their numbers.

    Parameters
    ----------
    numbers
        Their numbers, shape (n,); each occurs once.
    indices
        Their indices, shape (n,); by default from 0 on.
    """

    def __init__(self, numbers: NDArray[np.integer], indices: Indices | None = None) -> None:
        order = np.argsort(numbers)
        self._numbers, self._indices = numbers[order], order if indices is None else indices[order]

    def has(self, numbers: NDArray[np.integer]) -> NDArray[np.bool_]:
        """Which of some agents are among them.

        Parameters
        ----------
        numbers
            Numbers of those agents, shape (K,).
        """
        return among(self._numbers, numbers)

    def places(self, numbers: NDArray[np.integer]) -> Indices:
        """Indices of some of them.

        Parameters
        ----------
        numbers
            Their numbers, shape (K,).
        """
        return self._indices[np.searchsorted(self._numbers, numbers)] if len(numbers) else self._indices[:0]


def among(ascending: NDArray[np.integer], numbers: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Which numbers are among others.

    Parameters
    ----------
    ascending
        The others, ascending.
    numbers
        The numbers.
    """
    if not len(ascending):
        return np.zeros(len(numbers), dtype=bool)
    at = np.minimum(np.searchsorted(ascending, numbers), len(ascending) - 1)
    return np.asarray(ascending[at] == numbers)


def newcomers(before: NDArray[np.integer], now: NDArray[np.integer]) -> int:
    """Number of numbers that were not there before; fast where most are in the same places.

    Parameters
    ----------
    before, now
        Numbers; each occurs once.
    """
    both = min(len(before), len(now))
    # A number in its old place is no newcomer, and occurs nowhere else.
    differ = before[:both] != now[:both]
    old, new = (np.concatenate([x[:both][differ], x[both:]]) for x in (before, now))
    found = np.sort(np.concatenate([old, new]))
    return len(new) - int(np.count_nonzero(found[1:] == found[:-1]))


def sent(comm: Comm, to: NDArray[np.integer], rows: AnyArray) -> tuple[AnyArray, Numbers]:
    """Send each row to a rank. Collective.

    Parameters
    ----------
    comm
        An mpi4py communicator.
    to
        The rank of each row, shape (K,), ascending.
    rows
        The rows, shape (K, columns); of the same type and width on all ranks.

    Returns
    -------
    tuple
        The rows received, by the ranks that sent them, and how many came from each, shape (ranks,).
    """
    counts = np.bincount(to, minlength=comm.size).astype(np.int64)
    from_each = np.empty(comm.size, np.int64)
    comm.Alltoall(counts, from_each)
    received = np.empty((int(from_each.sum()), rows.shape[1]), rows.dtype)
    width = rows.shape[1]
    comm.Alltoallv(
        [np.ascontiguousarray(rows), (width * counts, width * (np.cumsum(counts) - counts))],
        [received, (width * from_each, width * (np.cumsum(from_each) - from_each))],
    )
    return received, from_each


def fetched(comm: Comm, own: NDArray[np.integer], rows: AnyArray, requested: NDArray[np.integer]) -> AnyArray:
    """Rows of agents from the ranks that own them. Collective.

    Parameters
    ----------
    comm
        An mpi4py communicator.
    own
        Numbers of the agents of this rank.
    rows
        A row of each of them; of the same type and width on all ranks.
    requested
        Numbers of the agents whose rows are requested.
    """
    rank = owners(comm, own, requested)
    order = np.argsort(rank, kind="stable")
    asked, counts = sent(comm, rank[order], requested[order, None].astype(np.int64))
    answers, _ = sent(comm, np.repeat(np.arange(comm.size), counts), rows[Numbering(own).places(asked[:, 0])])
    found = np.empty((len(requested), rows.shape[1]), rows.dtype)
    found[order] = answers
    return found


def owners(comm: Comm, own: NDArray[np.integer], requested: NDArray[np.integer]) -> Indices:
    """The rank that owns each of some agents. Collective.

    Agent k is entered in a directory on rank k modulo the number of ranks, so that no rank holds the whole directory.

    Parameters
    ----------
    comm
        An mpi4py communicator.
    own
        Numbers of the agents of this rank, which may be requested.
    requested
        Numbers of the requested agents.

    Raises
    ------
    RuntimeError
        If nobody owns one of them.
    """
    order = np.argsort(own % comm.size, kind="stable")
    entered, counts = sent(comm, own[order] % comm.size, own[order, None].astype(np.int64))
    where = np.repeat(np.arange(comm.size), counts)
    directory = Numbering(entered[:, 0])
    order = np.argsort(requested % comm.size, kind="stable")
    asked, counts = sent(comm, requested[order] % comm.size, requested[order, None].astype(np.int64))
    if not directory.has(asked[:, 0]).all():
        raise RuntimeError("a requested agent is owned by no rank")
    found = where[directory.places(asked[:, 0])]
    answers, _ = sent(comm, np.repeat(np.arange(comm.size), counts), found[:, None].astype(np.int64))
    result = np.empty(len(requested), np.int64)
    result[order] = answers[:, 0]
    return result
