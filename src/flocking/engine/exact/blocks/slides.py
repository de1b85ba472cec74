"""Pairs that cross a distance again and again without moving, in the native loop."""

from __future__ import annotations

from flocking.arrays import Array
from flocking.engine.exact.blocks.arrays import SLID_AT, SLID_SPEED, SLIDES, SLIDING_ROWS, Switched
from flocking.engine.exact.blocks.doubts import row_of
from flocking.engine.exact.crossings.switching import MOST_SLIDES, SLIDE


def slides(switched: Switched, smooth: bool, leave: float, crossing: Array, time: float, speed: float) -> bool:
    """Whether a pair has crossed so often without moving that it slides, for native functions; nothing is recorded.

    Parameters
    ----------
    switched
        The last crossings.
    smooth, leave
        Whether the force is continuous at the distance, and the distance.
    crossing
        A row of ``crossed``.
    time, speed
        When and how fast it crosses.
    """
    if smooth:
        return False
    k = row_of(switched.sliding, switched.counts[SLIDING_ROWS], crossing[0], crossing[2], crossing[3])
    return slides_now(switched.sliding, k, time, speed, leave) >= MOST_SLIDES


def slides_now(sliding: Array, k: int, time: float, speed: float, leave: float) -> float:
    """Number of crossings in a row without moving, with one at ``time``; ``k`` is the row of the pair, or -1.

    Parameters
    ----------
    sliding
        Last crossings of pairs.
    speed, leave
        How fast the pair crosses, and the distance.
    """
    if k < 0:
        return 0.0
    still = (time - sliding[k, SLID_AT]) * max(sliding[k, SLID_SPEED], abs(speed)) <= SLIDE * leave
    return sliding[k, SLIDES] + 1.0 if still else 0.0
