"""Parts of frames of very many agents, each with one of the processes of a run, which write them to disk themselves."""

from __future__ import annotations

from dataclasses import dataclass

from flocking.arrays import Array, Reals


@dataclass(frozen=True, eq=False)
class FramePart:
    """Some agents of a frame, whose numbers follow each other.

    Parameters
    ----------
    t
        Time of the frame.
    first
        Number of the first of them.
    q, p
        Positions and velocities, shape (agents, m), in the precision of the frames.
    columns
        Further columns, joined, shape (agents, components).
    """

    t: float
    first: int
    q: Reals
    p: Reals
    columns: Array

    def __len__(self) -> int:
        return len(self.q)
