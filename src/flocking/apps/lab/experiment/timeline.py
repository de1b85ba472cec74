"""The record of a run for its timeline: states to look at, curves, and verdicts as they were judged."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from flocking.model.law import Scenario
from flocking.model.state import State

MOST_STATES = 600
"""States of a record: about two for each pixel of a narrow timeline."""
MOST_BYTES = 80e6
"""Bytes of the states of a record, a bound on memory."""
FEWEST_STATES = 20
"""States that are kept however large they are."""
MOST_ROWS = 800
"""Rows of the curves: about one for each pixel of the timeline's width."""
MOST_SEGMENTS = 200
"""Segments of a strip, a bound on what is sent; the oldest are joined."""

CURVES = ("energy", "departed", "velocity spread", "connectivity")
"""Quantities that are drawn over time."""


@dataclass
class Strip:
    """The verdicts on one claim over time.

    Parameters
    ----------
    segments
        Beginnings and words of the verdicts, ascending; each holds until the next begins.
    largest
        Largest absolute margin that was met, the scale of its bar.
    """

    segments: list[tuple[float, str]] = field(default_factory=list)
    largest: float = 0.0

    def judge(self, t: float, word: str, since: float) -> None:
        """Note a verdict.

        Parameters
        ----------
        t
            Time until which the motion was judged.
        word
            The verdict.
        since
            Time from which on it is known to be so, at most ``t``.
        """
        if self.segments and self.segments[-1][1] == word:
            return
        self.segments.append((max(since, self.segments[-1][0]) if self.segments else since, word))
        if len(self.segments) > MOST_SEGMENTS:
            del self.segments[1]

    def cut(self, t: float) -> None:
        """Remove what was judged after ``t``."""
        self.segments = [s for s in self.segments if s[0] <= t]


class Timeline:
    """States, curves and verdicts of a run from its start to now."""

    def __init__(self) -> None:
        self.version = 0
        """Rises when anything changes."""
        self.reset()

    def reset(self) -> None:
        """Remove everything."""
        self._states: list[State] = []
        self._scenarios: list[Scenario] = []
        self._rows: list[tuple[float, ...]] = []
        self.strips: dict[str, Strip] = {}
        self.judged: float | None = None
        """Time until which the motion was judged last."""
        self.version += 1

    def take(self, state: State, scenario: Scenario, values: Sequence[float]) -> None:
        """Add a moment; one that lies before the last cuts the record there.

        Parameters
        ----------
        state
            The state.
        scenario
            Its scenario, whose obstacles and leaders are drawn with it.
        values
            The quantities of `CURVES`; of a comparison those of the second run follow.
        """
        if self._states and state.t < self._states[-1].t:
            self.cut(state.t)
        if self._states and state.t == self._states[-1].t and state.n == self._states[-1].n:
            self._states[-1], self._scenarios[-1] = state, scenario
        else:
            self._states.append(state)
            self._scenarios.append(scenario)
        if self._rows and len(self._rows[-1]) != 1 + len(values):
            self._rows = []
        if self._rows and self._rows[-1][0] == state.t:
            self._rows.pop()
        self._rows.append((state.t, *values))
        self._thin(state)
        self.version += 1

    def _thin(self, state: State) -> None:
        size = 16 * state.q.size + (state.n**2 if state.links is not None else 0) + 1
        most = int(min(MOST_STATES, max(FEWEST_STATES, MOST_BYTES // size)))
        if len(self._states) > most:
            self._states = [*self._states[:-1:2], self._states[-1]]
            self._scenarios = [*self._scenarios[:-1:2], self._scenarios[-1]]
        if len(self._rows) > MOST_ROWS:
            self._rows = [*self._rows[:-1:2], self._rows[-1]]

    def cut(self, t: float) -> None:
        """Remove what lies after ``t``."""
        keep = bisect_right(self.times, t)
        del self._states[keep:], self._scenarios[keep:]
        self._rows = [row for row in self._rows if row[0] <= t]
        for strip in self.strips.values():
            strip.cut(t)
        if self.judged is not None and self.judged > t:
            self.judged = None
        self.version += 1

    def judge(self, key: str, t: float, word: str, since: float, margin: float) -> None:
        """Note the verdict on a claim.

        Parameters
        ----------
        key
            The claim's.
        t
            Time until which the motion was judged.
        word
            The verdict.
        since
            Time from which on it is known to be so.
        margin
            Its margin, not a number where there is none.
        """
        strip = self.strips.setdefault(key, Strip())
        strip.judge(t, word, since)
        if np.isfinite(margin):
            strip.largest = max(strip.largest, abs(margin))
        self.judged = t
        self.version += 1

    @property
    def times(self) -> list[float]:
        """Times of the states."""
        return [state.t for state in self._states]

    @property
    def states(self) -> tuple[State, ...]:
        """The recorded states, ascending."""
        return tuple(self._states)

    def at(self, t: float) -> tuple[State, Scenario] | None:
        """The last recorded state not after ``t``, else the first; None while there is none."""
        if not self._states:
            return None
        k = max(bisect_right(self.times, t) - 1, 0)
        return self._states[k], self._scenarios[k]

    def content(self, events: Iterable[tuple[float, str]]) -> dict[str, object]:
        """The record as JSON data.

        Parameters
        ----------
        events
            Times and kinds of interventions.
        """
        columns = list(zip(*self._rows, strict=True)) or [()] * (1 + len(CURVES))
        runs = max(1, (len(columns) - 1) // len(CURVES))
        curves = [
            {name: [_plain(x) for x in columns[1 + run * len(CURVES) + k]] for k, name in enumerate(CURVES)}
            for run in range(runs)
        ]
        return {
            "times": list(columns[0]), "curves": curves, "events": [list(e) for e in events],
            "first": self._states[0].t if self._states else 0.0, "judged": self.judged,
            "strips": {key: [list(s) for s in strip.segments] for key, strip in self.strips.items()},
        }  # fmt: skip


def _plain(x: float) -> float | None:
    return float(f"{x:.6g}") if np.isfinite(x) else None
