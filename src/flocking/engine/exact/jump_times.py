"""Times at which terms of a law switch or leaders move suddenly; steps end at the last floating-point time before."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from flocking.engine.exact.origin import Origin
from flocking.engine.kernels.layout import Layout
from flocking.model.law import Scenario
from flocking.model.leaders_and_obstacles.sudden_velocities import sudden_times


class JumpTimes:
    """The session's own times at which terms of a law switch by themselves, leaders move suddenly, or bodies change by
    the clock.

    Sudden moves of leaders are found for one stretch of time after the other: the run, and beyond it stretches each
    twice as long as the one before, at whose ends steps end. Where these are depends on the run alone.

    Parameters
    ----------
    layouts
        Those of the law that acts, and of the declared one of the ledger where that is another.
    origin
        Origin of the session's own time.
    scenario
        Has the start and the end of the run, beyond which a session may go on, and the bodies, of whose numbers some
        are set by the clock.

    Attributes
    ----------
    end
        End of the run.
    """

    def __init__(self, layouts: Iterable[Layout], origin: Origin, scenario: Scenario) -> None:
        start, end = scenario.start.t, scenario.t_end
        self._origin, self._bodies = origin, scenario.agents
        self.end = origin.own_time(end)
        found = tuple(layouts)
        self._terms = [term for layout in found for term in layout.law.body_terms]
        leaders = {id(leader): leader for layout in found for leader in layout.leaders()}
        self._leaders = [leader for leader in leaders.values() if not leader.closed_form]
        self._next = self._energy_jumps = -np.inf
        self._sudden: list[float] = []
        self._stretches = [start, end]
        self._look(start, end)

    def _look(self, start: float, end: float) -> None:
        """Find the sudden moves in a stretch of time."""
        times = {s for leader in self._leaders for s in sudden_times(leader, start, end)}
        self._sudden += sorted({self._first_own(s, start) for s in times})
        self._next = -np.inf

    def look_beyond(self, own: float) -> None:
        """Find all sudden moves until the session's own time ``own`` that it is to reach."""
        while self._leaders and self._own_ends[-1] < own < np.inf:
            begin, start = self._stretches[-2:]
            self._stretches.append(end := start + 2.0 * (start - begin))
            self._look(start, end)

    @property
    def _own_ends(self) -> list[float]:
        """Ends of the stretches that were looked at, in the session's own time."""
        return [self._origin.own_time(t) for t in self._stretches[1:]]

    def _first_own(self, time: float, start: float) -> float:
        """The first of the session's own times, which are finer, that are rounded to a ``time`` or a later one."""
        low, high = self._origin.own_time(max(float(np.nextafter(time, -np.inf)), start)), self._origin.own_time(time)
        while float(np.nextafter(low, np.inf)) < high:
            middle = low + 0.5 * (high - low)
            low, high = (low, middle) if self._origin.time_at(middle) >= time else (middle, high)
        return high

    def following(self, now: float) -> float:
        """The first one after ``now``."""
        if not self._next > now:
            times = [s for term in self._terms for s in term.switch_times(self._origin.time_at(now), np.inf)]
            later = [s for s in (*map(self._origin.own_time, times), *self._sudden) if s > now]
            self._energy_jumps = min(later, default=np.inf)
            self._next = min(self._energy_jumps, self._bodies.drawn_until(now))
        return self._next

    def gust_at_end(self, now: float) -> bool:
        """Whether the run ends at a time and numbers of bodies change there, for which no step ends before it.

        Parameters
        ----------
        now
            The session's own time.
        """
        return now == self.end == self._bodies.drawn_until(float(np.nextafter(now, -np.inf)))

    def bound(self, now: float) -> float:
        """Latest end of a step from ``now`` on: the end of a stretch of time, or the last time before a jump."""
        end = next((t for t in self._own_ends if now < t), np.inf)
        jump = self.following(now)
        before = float(np.nextafter(jump, -np.inf))
        # Gusts that would come at the end of the run change nothing any more, but energies are those of that moment.
        ahead = jump < end or (jump == end < np.inf and (jump == self._energy_jumps or end > self.end))
        return before if ahead and before > now else end
