"""The ranks of an MPI job: what one of them does alone, and what becomes of the others when it fails."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np

from flocking.errors import FlockingError

T = TypeVar("T")


class Ranks:
    """All ranks of a communicator.

    Parameters
    ----------
    comm
        An mpi4py communicator.
    """

    def __init__(self, comm: Any) -> None:
        self.comm = comm
        self.rank, self.size = int(comm.rank), int(comm.size)

    @property
    def first(self) -> bool:
        """Whether this is the rank that writes and speaks."""
        return self.rank == 0

    def alone(self, action: Callable[[], T]) -> T | None:
        """Let the first rank do something. Its result stays there; its failure is raised on all ranks."""
        result, failure = None, None
        if self.first:
            try:
                with self.bound():
                    result = action()
            except (FlockingError, KeyboardInterrupt) as error:
                failure = error
        # An error may hold a whole run: the others get its words.
        words = self.comm.bcast(None if failure is None else (type(failure).__name__, str(failure)))
        if failure is not None:
            raise failure
        if words is not None:
            raise OtherRankError(f"{words[0]}: {words[1]}")
        return result

    def gathered(self, rows: Any) -> Any | None:
        """Rows of all ranks one after the other, on the first rank; None elsewhere."""
        from mpi4py import MPI

        counts = self.comm.gather(rows.size)
        if not self.first:
            self.comm.Gatherv(rows, None)
            return None
        whole = np.empty((sum(counts) // rows.shape[1], rows.shape[1]))
        self.comm.Gatherv(rows, [whole, counts, MPI.DOUBLE])
        return whole

    @contextmanager
    def bound(self) -> Iterator[None]:
        """Whatever one rank alone fails with ends the job at once and says why: the others would wait for ever."""
        try:
            yield
        except (FlockingError, KeyboardInterrupt):
            raise
        except BaseException:
            if self.size > 1:
                print(f"flocking: rank {self.rank} of {self.size} failed:", file=sys.stderr)
                traceback.print_exc()
                sys.stderr.flush()
                self.comm.Abort(1)
            raise


class OtherRankError(FlockingError):
    """Another rank of the job met an error and has said which."""
