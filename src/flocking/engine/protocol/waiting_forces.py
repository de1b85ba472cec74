"""Forces that agents have computed and that do not act yet, in the order of the times at which they will."""

from __future__ import annotations

from bisect import bisect_left

import numpy as np

from flocking.arrays import Indices, Reals

Waiting = list[tuple[int, Indices, Reals]]
"""Forces that act later: when, in nanoseconds, each once and ascending; whose, ascending; what, shape (agents, m)."""


def put(waiting: Waiting, when: int, agents: Indices, force: Reals) -> None:
    """Let forces wait until ``when``, beside those of other agents that wait until then already.

    Parameters
    ----------
    waiting
        Takes them. An agent has one force at a time: it acts at different times, and its latency stays the same.
    when
        Nanoseconds from the start.
    agents, force
        Whose, ascending, and what, shape (agents, m).
    """
    place = bisect_left(waiting, when, key=lambda entry: entry[0])
    if place == len(waiting) or waiting[place][0] != when:
        waiting.insert(place, (when, agents, force))
        return
    _, others, theirs = waiting[place]
    every = np.concatenate([others, agents])
    order = np.argsort(every, kind="stable")
    waiting[place] = (when, every[order], np.concatenate([theirs, force])[order])
