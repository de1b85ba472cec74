"""The ranks of an MPI job: what one of them does alone, and what becomes of the others when it fails."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from flocking.arrays import Array
from flocking.engine.protocol.team import Team
from flocking.errors import FlockingError, SimulationError

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

T = TypeVar("T")

MESSAGE_SECONDS = 0.5
"""``mpiexec`` drops what it has not passed on when a job is ended."""


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

    def alone(self, action: Callable[[], T]) -> T | None:
        """Let the first rank do something. Its result stays there; its failure is raised on all ranks.

        Parameters
        ----------
        action
            Called without arguments.
        """
        result, failure = None, None
        if self.first:
            try:
                with self.bound():
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
        """Let the first rank do something, and give its result to all ranks; its failure is raised on all.

        Parameters
        ----------
        action
            Called without arguments; what it gives can be pickled.
        """
        found: T = self.comm.bcast(self.alone(action))
        return found

    def end(self, words: str) -> None:
        """Say why on standard error, and end the whole job: all its ranks.

        Parameters
        ----------
        words
            The reason.
        """
        sys.stderr.write(f"flocking: rank {self.rank} of {self.size}: {words}\n")
        sys.stderr.flush()
        time.sleep(MESSAGE_SECONDS)
        self.comm.Abort(1)

    def gathered(self, rows: Array) -> Array | None:
        """Rows of all ranks one after the other, on the first rank; None elsewhere.

        Parameters
        ----------
        rows
            This rank's rows, shape (K, columns).
        """
        from mpi4py import MPI

        counts = self.comm.gather(rows.size)
        if not self.first:
            self.comm.Gatherv(rows, None)
            return None
        all_rows = np.empty((sum(counts) // rows.shape[1], rows.shape[1]))
        self.comm.Gatherv(rows, [all_rows, counts, MPI.DOUBLE])
        return all_rows

    @contextmanager
    def bound(self) -> Iterator[None]:
        """Whatever one rank alone fails with ends the job at once and says why: the others would wait for ever."""
        try:
            yield
        except (FlockingError, KeyboardInterrupt):
            raise
        except BaseException:
            if self.size > 1:
                self.end(f"failed:\n{traceback.format_exc()}")
            raise


class OtherRankError(FlockingError):
    """Another rank of the job met an error and has said which."""

    reported_elsewhere = True


def _reported(failure: BaseException) -> tuple[type[BaseException], tuple[object, ...], dict[str, object]]:
    """What other ranks are told of an error. The run that it may hold is not theirs."""
    if isinstance(failure, SimulationError):
        return type(failure), failure.args, {**vars(failure), "run": None}
    return OtherRankError, (f"{type(failure).__name__}: {failure}",), {}


def _rebuilt(kind: type[BaseException], args: tuple[object, ...], facts: dict[str, object]) -> BaseException:
    found = kind.__new__(kind, *args)
    found.args = args
    vars(found).update(facts)
    return found
