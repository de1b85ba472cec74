"""What a session writes down while it runs: frames, switches, the ledger and the closest pair."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np

from flocking.engine.exact.extremes import Extremes
from flocking.engine.exact.integrator.segment import Segment
from flocking.engine.exact.origin import Origin
from flocking.engine.runs.new_records import NewRecords
from flocking.engine.runs.run import DOUBT_FIELDS, SWITCH_FIELDS, TRACE_FIELDS, Accuracy, FineSamples, Largest
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.law import Scenario
from flocking.model.leaders_and_obstacles.leaders import Velocity

FINE_SAMPLES = 8
"""Samples in a step, a polynomial of degree 7."""


class Recorder:
    """Collects the records of a run.

    Parameters
    ----------
    scenario
        What is simulated.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.frame_times = scenario.frame_times
        self.n, self.m = scenario.start.n, scenario.start.dimension
        self.t: list[float] = []
        self.q: list[Array] = []
        self.p: list[Array] = []
        self.links: list[Links] = []
        self.switches: list[tuple[Any, ...]] = []
        self.trace: list[tuple[float, ...]] = []
        self.errors: list[tuple[float, float]] = []
        self.doubts: list[tuple[Any, ...]] = []
        agents = scenario.agents
        masses = np.array(np.broadcast_to(np.asarray(agents.masses, dtype=np.float64), self.n))
        leaders = {id(x): x for x in scenario.law.leaders}.values()
        goals = [leader.value for leader in leaders if isinstance(leader, Velocity)]
        goal = np.asarray(goals[0]) if len(goals) == len(leaders) == 1 else None
        self.extremes = Extremes(masses, self.m, agents.order, goal)
        self.fine: list[tuple[float, Array, Array]] | None = None

    def copy(self) -> Recorder:
        """One that goes on by itself. The records are shared: none is changed after it was made."""
        other = copy.copy(self)
        for name in ("t", "q", "p", "links", "switches", "trace", "errors", "doubts"):
            setattr(other, name, list(getattr(self, name)))
        other.extremes = self.extremes.copy()
        other.fine = None if self.fine is None else list(self.fine)
        return other

    def frame(self, t: float, q: Array, p: Array, links: Links, errors: tuple[float, float]) -> None:
        """Store a frame, with the errors of any position and any velocity in it."""
        # The time comes last: a frame counts once it has one, so an interrupt in between loses nothing else.
        count = len(self.t)
        self.q[count:] = [q.copy()]
        self.p[count:] = [p.copy()]
        self.links[count:] = [links.copy()]
        self.errors[count:] = [errors]
        self.t.append(t)

    def frame_at(
        self,
        own: float,
        t: float,
        motion: tuple[Array, Array],
        links: Links,
        error: tuple[float, float],
        origin: Origin,
    ) -> None:
        """Store a frame from positions and velocities, and their errors, relative to an origin.

        Parameters
        ----------
        own, t
            The session's own time and the user's.
        motion
            Positions and velocities, shape (N, m) each.
        """
        self.frame(t, *origin.outwards(own, *motion), links, origin.rounded(own, *error))

    def due(self, until: float, base: float) -> list[tuple[float, float]]:
        """Frame times not yet stored, up to ``until``: each in the session's own time and in the user's.

        Parameters
        ----------
        until
            The session's own time.
        base
            The time at which that is 0.
        """
        todo = self.frame_times[len(self.t) :]
        if not len(todo) or todo[0] - base > until:
            return []
        own = todo - base
        count = int(np.searchsorted(own, until, side="right"))
        return [(float(s), float(t)) for s, t in zip(own[:count], todo[:count], strict=True)]

    def to_come(self, base: float) -> Array:
        """Times of the frames not yet stored, from the time ``base`` on."""
        return self.frame_times[len(self.t) :] - base

    frame_bytes = 0.0
    waiting = 0.0
    """Records of small groups stay in memory: none waits to be let go."""

    @property
    def stored(self) -> dict[str, int]:
        """Numbers of records that are on disk alone."""
        return {}

    @property
    def layout(self) -> dict[str, Any]:
        """How the records are stored on disk, as options of `RunWriter.create`."""
        return {"with_links": True, "with_errors": True}

    def since(self, counts: dict[str, int], *, complete: bool) -> NewRecords:
        """What came after the first ``counts`` records of each kind; ``complete`` or not, no row is still open."""
        new = slice(counts["time"], len(self.t))
        t, q, p, links = (np.array(x[new]) for x in (self.t, self.q, self.p, self.links))
        return NewRecords(
            t, q, p, links, np.array(self.switches[counts["switch"] :], dtype=SWITCH_FIELDS),
            np.array(self.trace[counts["step"] :], dtype=TRACE_FIELDS), None, np.array(self.errors[new]),
        )  # fmt: skip

    def forget(self, counts: dict[str, int]) -> None:
        """Let go of what is on disk: nothing, for these records stay in memory.

        Parameters
        ----------
        counts
            Numbers of rows on disk, by kind.
        """

    def sample(self, segment: Segment, split: Callable[[Array], tuple[Array, Array, Array]], origin: Origin) -> None:
        """Keep the solution at several times in a segment, where that was asked for.

        Parameters
        ----------
        segment
            The segment.
        split
            Gives positions and velocities of a state vector.
        origin
            What they are relative to.
        """
        if self.fine is None or segment.t1 <= segment.t0:
            return
        times = np.linspace(segment.t0, segment.t1, FINE_SAMPLES + 1)
        for own in map(float, times if not self.fine else times[1:]):
            q, p = origin.outwards(own, *split(segment.at(own))[:2])
            self.fine.append((origin.time_at(own), q.copy(), p.copy()))

    def _fine_samples(self) -> FineSamples | None:
        if not self.fine:
            return None
        t, q, p = zip(*self.fine, strict=True)
        return FineSamples(np.array(t), np.array(q), np.array(p))

    def tables(self) -> dict[str, Any]:
        """Frames, switches and ledger as arrays, by the names of `Run`."""
        shape = (0, self.n, self.m)
        count = len(self.t)
        return {
            "t": np.array(self.t),
            "q": np.array(self.q[:count]) if count else np.zeros(shape),
            "p": np.array(self.p[:count]) if count else np.zeros(shape),
            "links": np.array(self.links[:count]) if count else np.zeros((0, self.n, self.n), dtype=bool),
            "switches": np.array(self.switches, dtype=SWITCH_FIELDS),
            "trace": np.array(self.trace, dtype=TRACE_FIELDS),
            "fine": self._fine_samples(),
        }

    def accuracy(self, doubts: list[tuple[Any, ...]], largest: dict[str, Largest], known_until: float) -> Accuracy:
        """What is known of the errors.

        Parameters
        ----------
        doubts
            Rows of `DOUBT_FIELDS`.
        largest
            Largest values.
        known_until
            Since when nothing is known.
        """
        count = len(self.t)
        return Accuracy(
            np.array(self.errors[:count]).reshape(count, 2), np.array(doubts, dtype=DOUBT_FIELDS), dict(largest),
            known_until,
        )  # fmt: skip
