"""The processes that compute one run together; most engines use one."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


class Team:
    """All processes of a run, each of which calls the same methods in the same order; here there is one.

    An engine of several processes derives its own, as `flocking.engine.lammps.ranks.Ranks` does.
    """

    rank = 0
    size = 1

    @property
    def first(self) -> bool:
        """Whether this is the process that writes files and messages."""
        return self.rank == 0

    def alone(self, action: Callable[[], T]) -> T | None:
        """Call ``action`` in the first process. Its result stays there; its exception is raised in all of them."""
        return action()

    def shared(self, action: Callable[[], T]) -> T:
        """Call ``action`` in the first process and return its result, which can be pickled, in all of them.

        Its exception is raised in all.
        """
        return action()

    def collected(self, value: T) -> list[T] | None:
        """The values of all processes in their order, in the first one; None in the others."""
        return [value]


ONE_PROCESS = Team()
"""The team of an engine that runs in this process only."""
