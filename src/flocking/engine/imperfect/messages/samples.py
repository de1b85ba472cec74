"""Samples of agents by their numbers, as far back as an agent may still use them."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.runs.message_log import AT_START
from flocking.model.world.times import Instants

START = AT_START
"""Number of the sample that all agents have of all others at the start."""

FIRST_ROOM = 4
"""Samples of each agent for which there is room at first; it doubles where messages are old."""


class Samples:
    """Samples by agent and number, as far back as an agent may still use them.

    Parameters
    ----------
    q, p
        Exact positions and velocities at the start, shape (N, m).
    with_distances
        Whether true distances are kept too.
    room
        How many samples of each agent there is room for.
    """

    def __init__(self, q: Array, p: Array, *, with_distances: bool = False, room: int = FIRST_ROOM) -> None:
        n = len(q)
        self.rows = np.repeat(np.concatenate([q, p], axis=1)[None], room, axis=0)
        """Measured positions and velocities, sample k in row k % room, shape (room, N, 2 m)."""
        self.start = np.concatenate([q, p], axis=1)
        self.distances = np.zeros((room, n, n) if with_distances else (room, 0, 0))
        """True distances of all agents from the one measured, at that time, shape (room, N, N)."""

    def make_room(self, newest: Instants, least: Instants) -> None:
        """Double the room until no sample in use is written over.

        Parameters
        ----------
        newest
            Number of each agent's newest sample, about to be written, shape (N,).
        least
            Number of each agent's oldest sample in use, shape (N,).
        """
        while (newest - np.maximum(least, 0) >= len(self.rows)).any():
            room = len(self.rows)
            for name in ("rows", "distances"):
                old = getattr(self, name)
                new = np.concatenate([old, old])
                for agent, last in enumerate(newest if new.shape[1] else ()):
                    for k in range(max(int(last) - room, 0), int(last)):
                        new[k % (2 * room), agent] = old[k % room, agent]
                setattr(self, name, new)

    def put(self, agents: Indices, numbers: Instants, measured: Array, distances: Array | None) -> None:
        """Keep samples.

        Parameters
        ----------
        agents, numbers
            Whose they are, and their numbers.
        measured
            What was measured, shape (agents, 2 m).
        distances
            True distances of all agents, shape (agents, N), where they are kept.
        """
        place = numbers % len(self.rows)
        self.rows[place, agents] = measured
        if distances is not None:
            self.distances[place, agents] = distances

    def of(self, agents: Indices, numbers: Instants) -> Array:
        """What ``agents`` measured, by sample ``numbers``, shape (..., 2 m); their start for number `START`."""
        found = self.rows[numbers % len(self.rows), agents]
        return np.where((numbers == START)[..., None], self.start[agents], found)

    def distances_of(self, senders: Indices, receivers: Indices, numbers: Instants) -> Array:
        """True distances of ``receivers`` from ``senders`` when samples of these ``numbers`` were taken."""
        return np.asarray(self.distances[numbers % len(self.distances), senders, receivers])
