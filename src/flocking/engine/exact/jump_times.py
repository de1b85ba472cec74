"""Times at which terms of a law switch or leaders move suddenly; steps end at the last floating-point time before."""

from __future__ import annotations

import numpy as np

from flocking.engine.exact.origin import Origin
from flocking.model.bodies.body import Body
from flocking.model.law import Law
from flocking.model.leaders_and_obstacles.sudden_velocities import sudden_times


class JumpTimes:
    """The session's own times at which terms of a law switch by themselves, leaders move suddenly, or bodies change by
    the clock.

    Parameters
    ----------
    origin
        Origin of the session's own time.
    start, end
        Start and end of the run, in the user's time; a session that goes on beyond it has no end.
    bodies
        What the agents are: some of their numbers are set by the clock.
    """

    def __init__(self, law: Law, origin: Origin, start: float, end: float, bodies: Body) -> None:
        self._bodies = bodies
        self._law, self._end = law, origin.own_time(end)
        self._origin = origin
        self._next = self._energy_jumps = -np.inf
        times = {s for leader in law.leaders for s in sudden_times(leader, start, end)}
        self._sudden = sorted({self._first_own(s, start) for s in times})

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
            terms = self._law.body_terms
            times = [s for term in terms for s in term.switch_times(self._origin.time_at(now), np.inf)]
            later = [s for s in (*map(self._origin.own_time, times), *self._sudden) if s > now]
            self._energy_jumps = min(later, default=np.inf)
            self._next = min(self._energy_jumps, self._bodies.drawn_until(now))
        return self._next

    def bound(self, now: float) -> float:
        """Latest end of a step from ``now`` on: the end of the run, or the last time before a term switches."""
        end = self._end if now < self._end else np.inf
        jump = self.following(now)
        before = float(np.nextafter(jump, -np.inf))
        # Gusts that would come at the end itself change nothing any more, but energies are those of that moment.
        ahead = jump < end or jump == end == self._energy_jumps < np.inf
        return before if ahead and before > now else end
