"""Records of the exact engine beyond those of others: errors, doubts, extreme values, fine samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.exact.dynamics import Dynamics
from flocking.engine.exact.extremes import Extremes
from flocking.engine.exact.origin import Origin
from flocking.engine.runs.new_records import RecordTables
from flocking.engine.runs.recorder import Recorder
from flocking.engine.runs.run import DOUBT_FIELDS, Accuracy, DoubtRow, FineSamples, Largest
from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.law import Scenario
from flocking.model.leaders_and_obstacles.leaders import Velocity

FINE_SAMPLES = 8
"""Samples in a step, a polynomial of degree 7."""


@dataclass(frozen=True)
class ExactOptions:
    """How the exact engine runs a scenario.

    Parameters
    ----------
    fine
        Keep several samples of every step in memory, for curves; they are not saved.

    Raises
    ------
    InvalidInput
        When it is neither True nor False.
    """

    fine: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.fine, bool):
            raise InvalidInput("ExactOptions", "fine", "must be True or False", self.fine)


class ExactRecorder(Recorder):
    """Collects the records of a run; they stay in memory, as its groups are small.

    Parameters
    ----------
    fine
        Whether several samples of every step are stored.
    """

    def __init__(self, scenario: Scenario, *, fine: bool = False) -> None:
        super().__init__(scenario, with_links=True, with_errors=True, lets_go=False)
        self.doubts: list[DoubtRow] = []
        agents = scenario.agents
        masses = np.array(np.broadcast_to(np.asarray(agents.masses, dtype=np.float64), self.n))
        leaders = {id(x): x for x in scenario.law.leaders}.values()
        goals = [leader.value for leader in leaders if isinstance(leader, Velocity)]
        goal = np.asarray(goals[0]) if len(goals) == len(leaders) == 1 else None
        self.extremes = Extremes(masses, self.m, agents.order, goal)
        self.fine: list[tuple[float, Array, Array]] | None = [] if fine else None

    def copy(self) -> Self:
        """An independent recorder. The rows are shared: none is changed after it was made."""
        other = super().copy()
        other.extremes = self.extremes.copy()
        return other

    def frame_at(
        self, own: float, t: float, y: Array, dynamics: Dynamics, links: Links, error: tuple[float, float],
        origin: Origin,
    ) -> None:  # fmt: skip
        """Store a frame from a state vector ``y`` relative to an origin, and its errors of positions and velocities.

        Parameters
        ----------
        own, t
            The session's own time and the user's.
        dynamics
            The right-hand side of ``y``.
        """
        q, p, _ = dynamics.split(y)
        outside = origin.outwards(own, q, p)
        self.frame(t, *outside, links, origin.rounded(own, *error), columns=dynamics.further(y))

    def frames_at(
        self, own: Array, states: Array, dynamics: Dynamics, links: Links, errors: Array, origin: Origin
    ) -> None:
        """Store the next frames, as `frame_at` does each.

        Parameters
        ----------
        own, states
            The session's own times, shape (k,), and state vectors, shape (k, size).
        dynamics
            The right-hand side of these.
        links, errors
            Links in each frame, shape (k, N, N), and errors of positions and velocities, shape (k, 2).
        origin
            Origin of times and coordinates.
        """
        times = self.frame_times[self.count :][: len(own)].tolist()
        if dynamics.columns:
            for k, t in enumerate(times):
                position, velocity = errors[k].tolist()
                self.frame_at(float(own[k]), t, states[k], dynamics, links[k], (position, velocity), origin)
            return
        shape, size = (len(own), dynamics.n, dynamics.m), dynamics.n * dynamics.m
        q = states[:, :size].reshape(shape)
        p = states[:, size : 2 * size].reshape(shape) if dynamics.order == 2 else np.zeros(shape)
        outside, rounded = errors.tolist(), []
        if not origin.rests:
            places = np.array([origin.at(s) for s in own.tolist()])
            q, p = q + places[:, None], p + origin.velocity
        for s, (position, velocity) in zip(own.tolist(), outside, strict=True):
            rounded.append(origin.rounded(s, position, velocity))
        self.frames(times, q, p, np.ascontiguousarray(links), rounded)

    def due_until(self, until: float, base: float) -> list[tuple[float, float]]:
        """Frame times not yet stored, up to ``until``: each in the session's own time and in the user's.

        Parameters
        ----------
        until
            The session's own time.
        base
            The time at which that is 0.
        """
        todo = self.frame_times[self.count :]
        if not len(todo) or todo[0] - base > until:
            return []
        own = todo - base
        count = int(np.searchsorted(own, until, side="right"))
        return [(float(s), float(t)) for s, t in zip(own[:count], todo[:count], strict=True)]

    def to_come(self, base: float) -> Array:
        """Times of the frames not yet stored, relative to the time ``base``."""
        return self.frame_times[self.count :] - base

    def sample(self, segment: Segment, split: Callable[[Array], tuple[Array, Array, Array]], origin: Origin) -> None:
        """Store the solution at several times in a segment, if fine samples are recorded.

        Parameters
        ----------
        segment
            The segment.
        split
            Gives positions and velocities of a state vector.
        origin
            Origin of its time and coordinates.
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

    def tables(self) -> RecordTables:
        """The records in memory as arrays, by the names of `Run`."""
        return {**super().tables(), "fine": self._fine_samples()}

    def accuracy(self, doubts: list[DoubtRow], largest: dict[str, Largest], known_until: float) -> Accuracy:
        """The `Accuracy` of the run.

        Parameters
        ----------
        doubts
            Rows of `DOUBT_FIELDS`.
        largest
            Largest values.
        known_until
            Time from which on nothing is known.
        """
        return Accuracy(self.frame_errors(), np.array(doubts, dtype=DOUBT_FIELDS), dict(largest), known_until)
