"""The log of what agents used when they acted: whose sample, with which number, and the force that followed."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray, Array, Indices
from flocking.engine.archives.data_checks import MalformedError
from flocking.model.graphs.connectivity import Links
from flocking.model.world.times import PER_SECOND

CHANGED = "changed at"
"""Name in the provenance of a run of the times at which its law or world was changed while it went on: its log then
follows from several declarations."""

NO_LOG = "no log because"
"""Name in the provenance of a run of why it has no log of what agents used, where its engine could have kept one."""

GRAPHS_CHANGED = "graphs changed at"
"""Name in the provenance of a run of the last time at which the graphs of its law were replaced while messages went on:
the law that the run states has other ones than entries of the log before."""

AT_START = -1
"""Number of the sample that everyone has of everyone at the start."""

PRESENT = -2
"""In place of a sample's number: the sender's true state at that instant."""

DELAYED = -3
"""In place of a sample's number: the sender's state as it was the declared delay before."""

OWN = -1
"""In place of a graph's number: the agent's own sample, where it knows itself by one."""

LEADER = -2
"""In place of a graph's number: the newest sample of the leaders of the law, where they are known by messages."""

LEADER_SENDER = -1
"""Who sends it."""

TICK_PARTS = ("instant", "agent", "uses")
"""Numbers of an act: nanoseconds since the start, who acts, and how many entries of the log are its own."""

USE_PARTS = ("graph", "sender", "sample")
"""Numbers of an entry: under which graph the sample was used, whose it is, and its number."""


def changed_times(provenance: Mapping[str, object]) -> tuple[float, ...]:
    """Times at which the law or the state of a run was replaced, as far as it states them; see `CHANGED`.

    Parameters
    ----------
    provenance
        That of the run.
    """
    stated = provenance.get(CHANGED)
    return tuple(float(t) for t in stated if isinstance(t, int | float)) if isinstance(stated, list) else ()


def keeping_logs(provenance: Mapping[str, object]) -> str:
    """Which runs have a log, in words, for messages of errors on one that has none.

    Parameters
    ----------
    provenance
        That of the run.
    """
    why = provenance.get(NO_LOG)
    none = f"This run keeps none: {why}. " if isinstance(why, str) and why else ""
    return (
        f"{none}The engines 'sampled' and 'tiles' keep one under held control, and 'delayed' keeps one; runs stored by "
        "earlier versions may have none."
    )


def nanosecond_of(seconds: float) -> float:
    """The nanosecond of a time in seconds since the start, with half a nanosecond for its rounding."""
    return seconds * PER_SECOND + 0.5


@dataclass(frozen=True, eq=False)
class MessageLog:
    """What was used at every tick of a control that is held, in order of the ticks.

    Under continuous control, with messages or delayed knowledge, what is used from each change on: an act of an agent
    holds until its next.

    Parameters
    ----------
    ticks
        Of every act its nanosecond since the start, the agent and its number of entries, shape (K, 3).
    forces
        The force that the agent computed, shape (K, m).
    uses
        Entries of the acts one after another: graph, sender and number of the sample, shape (U, 3). The number is -1
        for the state that everyone has at the start, -2 for the true present one, and -3 for that a delay ago; the
        graph is -1 where an agent knows itself by its own sample, and -2, with the sender -1, where it knows leaders by
        theirs.

    Raises
    ------
    MalformedError
        When the arrays do not fit together.
    """

    ticks: NDArray[np.int64]
    forces: Array
    uses: NDArray[np.int64]

    def __post_init__(self) -> None:
        counts = self.ticks[:, 2]
        # Each is bounded first: the sum of what is larger could wrap around.
        fits = counts.max(initial=0) <= len(self.uses) and counts.sum() == len(self.uses)
        if len(self.ticks) != len(self.forces) or not fits:
            raise MalformedError("the log of messages must have a force and all entries of every act")
        if (np.diff(self.ticks[:, 0]) < 0).any() or (self.ticks < 0).any():
            raise MalformedError("the log of messages must be in order of its times")

    @property
    def firsts(self) -> Indices:
        """Number of the first entry of every act, shape (K,)."""
        return np.asarray(np.cumsum(self.ticks[:, 2]) - self.ticks[:, 2])

    def known_links(self, instant: float, first: Links) -> Links:
        """By what agents know before an ``instant``, in nanoseconds: whose samples each used when it last acted.

        Parameters
        ----------
        first
            The links of agents that have not acted yet, shape (graphs, N, N).

        Returns
        -------
        array
            Shape (graphs, N, N); entry (g, i, j) is whether i used a sample of j under graph g.
        """
        found, firsts = first.copy(), self.firsts
        before = self.ticks[: int(np.searchsorted(self.ticks[:, 0], instant, side="left")), 1]
        # The last act of each agent is the first one of the acts read backwards.
        agents, back = np.unique(before[::-1], return_index=True)
        for agent, row in zip(agents, len(before) - 1 - back, strict=True):
            entries = self.uses[firsts[row] : firsts[row] + self.ticks[row, 2]]
            others = entries[entries[:, 0] >= 0]
            found[:, agent] = False
            found[others[:, 0], agent, others[:, 1]] = True
        return found

    def until(self, instant: float) -> MessageLog:
        """The acts up to an ``instant``, in nanoseconds, that one included."""
        count = int(np.searchsorted(self.ticks[:, 0], instant, side="right"))
        return MessageLog(self.ticks[:count], self.forces[:count], self.uses[: int(self.ticks[:count, 2].sum())])


def joined_logs(first: MessageLog | None, second: MessageLog | None) -> MessageLog | None:
    """One log of two parts of a run; None unless both were kept.

    Parameters
    ----------
    first, second
        The earlier part and the later one.
    """
    if first is None or second is None:
        return None
    names = ("ticks", "forces", "uses")
    return MessageLog(*(np.concatenate([getattr(first, name), getattr(second, name)]) for name in names))


class Rows:
    """Rows of one array that grows, kept as the blocks in which they came.

    Parameters
    ----------
    width
        Numbers in a row.
    kind
        Their type, such as ``"i8"``.
    """

    def __init__(self, width: int, kind: str) -> None:
        self._blocks: list[AnyArray] = [np.zeros((0, width), dtype=kind)]
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def nbytes(self) -> int:
        """Memory of the rows."""
        return self._count * int(self._blocks[0].shape[1]) * self._blocks[0].itemsize

    def __copy__(self) -> Self:
        other = type(self).__new__(type(self))
        other._blocks, other._count = copy.copy(self._blocks), self._count
        return other

    def extend(self, block: AnyArray) -> None:
        """Add a ``block`` of rows."""
        self._blocks.append(np.array(block, dtype=self._blocks[0].dtype))
        self._count += len(block)

    def since(self, first: int) -> AnyArray:
        """The rows from number ``first`` on."""
        if len(self._blocks) > 1:
            self._blocks = [np.concatenate(self._blocks)]
        return self._blocks[0][first:]

    def drop(self, count: int) -> None:
        """Let go of the first ``count`` rows."""
        self._blocks = [self.since(0)[count:].copy()]
        self._count -= count


class LogRecorder:
    """Collects the log of a running session.

    Parameters
    ----------
    m
        Number of axes.
    """

    def __init__(self, m: int) -> None:
        self.ticks, self.forces, self.uses = Rows(len(TICK_PARTS), "i8"), Rows(m, "f8"), Rows(len(USE_PARTS), "i8")

    def __copy__(self) -> Self:
        other = type(self).__new__(type(self))
        for name, rows in vars(self).items():
            setattr(other, name, copy.copy(rows))
        return other

    def act(self, instant: int, agents: Indices, forces: Array, uses: list[AnyArray]) -> None:
        """Log what some ``agents`` used at one ``instant``, in nanoseconds.

        Parameters
        ----------
        forces
            The forces that they computed, shape (agents, m).
        uses
            Entries of each, shape (entries, 3).
        """
        self.acts(instant, agents, forces, np.array([len(x) for x in uses], dtype=np.int64))
        for block in uses:
            self.uses.extend(block)

    def acts(self, instant: int, agents: Indices, forces: Array, counts: Indices, uses: AnyArray | None = None) -> None:
        """As `act`, with the entries of all agents in one array, which may follow later.

        Parameters
        ----------
        instant, agents, forces
            As for `act`.
        counts
            How many entries each agent has, shape (agents,).
        uses
            Entries of one agent after another, shape (entries, 3).
        """
        self.ticks.extend(np.stack([np.full(len(agents), instant), agents, counts], axis=1))
        self.forces.extend(forces)
        if uses is not None:
            self.uses.extend(uses)

    @property
    def nbytes(self) -> int:
        """Memory of the rows in memory."""
        return self.ticks.nbytes + self.forces.nbytes + self.uses.nbytes

    def part(self, ticks: int, uses: int) -> MessageLog:
        """The log from some number of acts and of entries on.

        Parameters
        ----------
        ticks, uses
            How many acts and entries in memory to leave out.
        """
        return MessageLog(self.ticks.since(ticks), self.forces.since(ticks), self.uses.since(uses))

    def drop(self, ticks: int, uses: int) -> None:
        """Let go of the first rows, which are on disk.

        Parameters
        ----------
        ticks, uses
            How many acts and entries.
        """
        self.ticks.drop(ticks)
        self.forces.drop(ticks)
        self.uses.drop(uses)
