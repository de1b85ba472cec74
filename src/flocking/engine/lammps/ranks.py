"""The ranks of an MPI job: actions of the first rank, broadcasts, and failures of one rank."""

from __future__ import annotations

import math
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from flocking.arrays import Array
from flocking.engine.protocol.team import Team
from flocking.errors import FlockingError, SimulationError

if TYPE_CHECKING:
    from mpi4py.MPI import Comm, Datatype, Op

T = TypeVar("T")

MESSAGE_SECONDS = 0.5
"""Wait in seconds before a job is aborted: ``mpiexec`` drops output that it has not forwarded."""

MEETING_SECONDS = 60.0
"""Longest time in seconds between the same error of two ranks: longer than one of them may need for a scenario."""
POLL_SECONDS = 0.01
"""Time in seconds between two looks at whether other ranks failed too; short beside the end of a job."""


@cache
def _largest_and_sum() -> Op:
    """The reduction of rows whose first entry is how many of the next are largest values; the rest are sums.

    One for the process: MPI has room for few, and a process may hold many sessions one after the other.
    """
    from mpi4py import MPI

    def reduce(one: Any, other: Any, _: MPI.Datatype) -> None:
        a, b = np.frombuffer(one), np.frombuffer(other)
        cut = 1 + int(a[0])
        np.maximum(a[1:cut], b[1:cut], out=b[1:cut])
        b[cut:] += a[cut:]

    return MPI.Op.Create(reduce, commute=True)


@cache
def _row_of(length: int) -> Datatype:
    """The type of a row of so many numbers: it is one element, so that a reduction never gets a part of it."""
    from mpi4py import MPI

    return MPI.DOUBLE.Create_contiguous(length).Commit()


class Ranks(Team):
    """All ranks of a communicator.

    Parameters
    ----------
    comm
        An mpi4py communicator.
    """

    def __init__(self, comm: Comm) -> None:
        self.comm = comm
        self.rank, self.size = int(comm.rank), int(comm.size)
        self._meeting = _meeting_of(comm)

    @cached_property
    def on_this_machine(self) -> int:
        """Number of ranks on this machine. Collective at the first call."""
        from mpi4py import MPI

        beside = self.comm.Split_type(MPI.COMM_TYPE_SHARED)
        count = int(beside.size)
        beside.Free()
        return count

    def alone(self, action: Callable[[], T]) -> T | None:
        """Call a function on the first rank. The result stays there; an exception is raised on all ranks.

        Parameters
        ----------
        action
            Called without arguments.
        """
        result, failure = None, None
        if self.first:
            try:
                with self._failures_end_all():
                    result = action()
            except (FlockingError, KeyboardInterrupt) as error:
                failure = error
        report = None if self.size == 1 else self.comm.bcast(None if failure is None else _reported(failure))
        if failure is not None:
            raise failure
        if report is not None:
            raise _rebuilt(*report)
        return result

    def shared(self, action: Callable[[], T]) -> T:
        """Call a function on the first rank and broadcast the result; an exception is raised on all ranks.

        Parameters
        ----------
        action
            Called without arguments; its result must be picklable.
        """
        found: T = self.comm.bcast(self.alone(action))
        return found

    def collected(self, value: T) -> list[T] | None:
        """The values of all ranks in their order, on the first one; None elsewhere.

        Parameters
        ----------
        value
            That of this rank, which can be pickled.
        """
        found: list[T] | None = self.comm.gather(value)
        return found

    @cached_property
    def _largest(self) -> Op:
        """The reduction of largest values."""
        from mpi4py import MPI

        return MPI.MAX

    @cached_property
    def _sum(self) -> Op:
        """The reduction of sums."""
        from mpi4py import MPI

        return MPI.SUM

    def reduced(self, largest: Array, sums: Array) -> tuple[Array, Array]:
        """Largest values and sums over the ranks, in one message. All ranks get the same bits.

        Parameters
        ----------
        largest
            Numbers of which the largest is found; what is not a number counts as infinite.
        sums
            Numbers that are added.
        """
        if self.size == 1:
            return largest, sums
        if not len(largest):
            total = np.empty(len(sums))
            self.comm.Allreduce(np.ascontiguousarray(sums, dtype=np.float64), total, self._sum)
            return largest, total
        # A sum shows at once whether there may be a number that is none.
        if not math.isfinite(largest.sum()):
            largest = np.where(np.isnan(largest), np.inf, largest)
        if not len(sums):
            received = np.empty(len(largest))
            self.comm.Allreduce(largest, received, self._largest)
            return received, sums
        row = np.concatenate([[float(len(largest))], largest, sums])
        found, kind = np.empty_like(row), _row_of(len(row))
        self.comm.Allreduce([row, 1, kind], [found, 1, kind], _largest_and_sum())
        return found[1 : 1 + len(largest)], found[1 + len(largest) :]

    def agree(self, check: Callable[[], None]) -> None:
        """Make a check on every rank; the error of the lowest rank that has one is raised on all.

        Parameters
        ----------
        check
            Raises the error. It must not be collective beyond the point where it may do so.
        """
        if self.size == 1:
            check()
            return
        from mpi4py import MPI

        failure: FlockingError | None = None
        try:
            check()
        except FlockingError as error:
            failure = error
        first = self.comm.allreduce(self.size if failure is None else self.rank, MPI.MIN)
        if first == self.size:
            return
        report = self.comm.bcast(None if failure is None else _reported(failure), root=first)
        if failure is not None and self.rank == first:
            raise failure
        raise _rebuilt(*report)

    def end(self, message: str) -> None:
        """Print a message to standard error and abort all ranks of the job.

        Parameters
        ----------
        message
            The message.
        """
        sys.stderr.write(f"flocking: rank {self.rank} of {self.size}: {message}\n")
        sys.stderr.flush()
        time.sleep(MESSAGE_SECONDS)
        self.comm.Abort(1)

    def gathered(self, rows: Array) -> Array | None:
        """Concatenated rows of all ranks, on the first rank; None elsewhere.

        Parameters
        ----------
        rows
            Rows of this rank, shape (K, columns).
        """
        from mpi4py import MPI

        counts = self.comm.gather(rows.size)
        if not self.first:
            self.comm.Gatherv(rows, None)
            return None
        # The first rank has those of all.
        all_rows = np.empty((sum(counts or ()) // rows.shape[1], rows.shape[1]))
        self.comm.Gatherv(rows, [all_rows, counts, MPI.DOUBLE])
        return all_rows

    @contextmanager
    def bound(self) -> Iterator[None]:
        """Abort the job with a message if some ranks fail and others do not, which would wait forever.

        An error that all ranks raise is raised. Collective where an error occurs.
        """
        with self._failures_end_all():
            try:
                yield
            except FlockingError as error:
                if not self._all_fail():
                    self.end(f"failed, but not all ranks did:\n{type(error).__name__}: {error}")
                raise

    @contextmanager
    def _failures_end_all(self) -> Iterator[None]:
        """Abort the job with a message if one rank fails by an error that is no error of this library."""
        try:
            yield
        except (FlockingError, KeyboardInterrupt):
            raise
        except BaseException:
            if self.size > 1:
                self.end(f"failed:\n{traceback.format_exc()}")
            raise

    def _all_fail(self) -> bool:
        """Whether all ranks come to this place within `MEETING_SECONDS`."""
        if self.size == 1:
            return True
        # Messages of the failed computation are never mistaken for this one.
        arrived, stop = self._meeting.Ibarrier(), time.monotonic() + MEETING_SECONDS
        while not arrived.Test():
            if time.monotonic() > stop:
                return False
            time.sleep(POLL_SECONDS)
        return True


_MEETINGS: dict[int, tuple[Comm, Comm]] = {}
"""Communicators and those for `Ranks._all_fail` alone, which are made once for each: MPI has a few thousand."""


def _meeting_of(comm: Comm) -> Comm:
    """The communicator of the same ranks on which they report failures to each other. Collective."""
    if comm.size == 1:
        return comm
    if id(comm) not in _MEETINGS:
        _MEETINGS[id(comm)] = (comm, comm.Dup())
    return _MEETINGS[id(comm)][1]


class OtherRankError(FlockingError):
    """Another rank of the job failed and has reported its error."""

    reported_elsewhere = True


def _reported(failure: BaseException) -> tuple[type[BaseException], tuple[object, ...], dict[str, object]]:
    """An error in a form that is sent to other ranks, without the run that it may contain."""
    if isinstance(failure, SimulationError):
        return type(failure), failure.args, {**vars(failure), "run": None}
    return OtherRankError, (f"{type(failure).__name__}: {failure}",), {}


def _rebuilt(kind: type[BaseException], args: tuple[object, ...], facts: dict[str, object]) -> BaseException:
    found = kind.__new__(kind, *args)
    found.args = args
    vars(found).update(facts)
    return found
