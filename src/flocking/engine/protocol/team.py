"""The processes that compute one run together; most engines use one."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


class Team:
    """All processes of a run, each of which calls the same methods in the same order: here there is one.

    An engine of several processes derives its own, as `flocking.engine.lammps.ranks.Ranks` does.
    """

    rank = 0
    size = 1

    @property
    def first(self) -> bool:
        """Whether this is the process that writes and speaks."""
        return self.rank == 0

    def alone(self, action: Callable[[], T]) -> T | None:
        """Let the first process do something. Its result stays there; its failure is raised in all of them.

        Parameters
        ----------
        action
            Called without arguments.
        """
        return action()

    def shared(self, action: Callable[[], T]) -> T:
        """Let the first process do something, and give its result to all of them; its failure is raised in all.

        Parameters
        ----------
        action
            Called without arguments; what it gives can be pickled.
        """
        return action()


ONE_PROCESS = Team()
"""The team of an engine that runs in this process alone."""
