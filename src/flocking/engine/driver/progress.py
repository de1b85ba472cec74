"""Times at which a session stops to report and save, and the progress report."""

from __future__ import annotations

import time

import numpy as np

from flocking.engine.driver.waits import Wait
from flocking.formula.safe_digits import time_text
from flocking.model.law import Scenario

STOPS = 100
"""Stops of a session for its progress, a percent apart."""


def stops(scenario: Scenario, now: float, *, often: bool) -> list[float]:
    """Times at which a session stops before the end of its scenario; ``often``: also at its frames.

    Parameters
    ----------
    now
        Time of the session.
    """
    times = np.linspace(scenario.start.t, scenario.t_end, STOPS + 1)
    if often:
        times = np.union1d(times, scenario.frame_times)
    return [float(t) for t in times if now < t < scenario.t_end] + [scenario.t_end]


class Progress(Wait):
    """Time that a run has reached, shown only for runs that take some time.

    Parameters
    ----------
    enabled
        Whether to show anything.
    scenario
        The scenario.
    """

    def __init__(self, enabled: bool, scenario: Scenario) -> None:
        start, end = scenario.start.t, scenario.t_end
        super().__init__(scenario.name or "simulation", end - start, shown=enabled)
        self._start, self._end = start, end
        self._reached: tuple[float, float, str] | None = None
        self._at_first: tuple[float, float] | None = None

    def show(self, t: float, agent_steps: int, note: str = "") -> None:
        """Report the time reached.

        Parameters
        ----------
        agent_steps
            Number of steps so far times the number of agents.
        note
            Further text, such as the reason for a delay.
        """
        now = time.monotonic()
        self._at_first = self._at_first or (now, t)
        self._reached = t, agent_steps / max(now - self._begin, CLOCK_SECONDS), note
        self.done = t - self._start
        self.refresh()

    def line(self, now: float) -> str:
        """The time reached, the speed and the time left."""
        if self._reached is None or self._at_first is None:
            return f"{self.title}: the first steps, {now - self._begin:.0f} s so far"
        (t, rate, note), (begin, first) = self._reached, self._at_first
        left = f"about {(now - begin) * (self._end - t) / (t - first):.0f} s left" if t > first else ""
        here, end = (time_text(x, self._start, self._end, DIGITS) for x in (t, self._end))
        share = f"t = {here} of {end} ({100 * (t - self._start) / (self._end - self._start):.0f} %)"
        words = (share, f"{rate:.3g} agent-steps/s", note, left)
        return f"{self.title}: {', '.join(filter(None, words))}"


DIGITS = 6
"""Digits of times, as pictures and tables of runs have them; a convention."""

CLOCK_SECONDS = 1e-9
"""Seconds that no clock resolves, so that no speed is divided by zero."""
