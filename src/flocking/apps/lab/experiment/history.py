"""Thinned history since the last intervention, as a run by which claims are judged."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from flocking.apps.lab.experiment.clock import Frame
from flocking.arrays import Array
from flocking.engine.runs.fidelity import UNSTATED, Fidelity
from flocking.engine.runs.run import SWITCH_FIELDS, Accuracy, Closest, Run, SwitchRow, ledger_of
from flocking.model.state import State

MOST_FRAMES = 400
"""Frames of a history, a bound on memory."""
MOST_BYTES = 60e6
"""Bytes of the frames of a history, a bound on memory."""

FEWEST_FRAMES = 8
"""Frames that are stored however large they are: claims about limits need some."""

MOST_ROWS = 4000
"""Rows of the ledger and switches that are stored, a bound on memory."""
SERIES_POINTS = 400
"""Points of a curve: about one for each pixel of its width on the page."""
CUMULATIVE = ("work", "dissipated", "supplied", "jumped", "departed")
"""Fields of the ledger that add up from the start of a session on."""


class History:
    """Frames, ledger and switches of one experiment since it was last changed.

    Parameters
    ----------
    which
        Number of the experiment.
    """

    def __init__(self, which: int = 0) -> None:
        self.which = which
        self.clear()

    def clear(self) -> None:
        """Remove everything."""
        self.mark: tuple[float, ...] = ()
        """What distinguishes the motion since one intervention from that since another."""
        self.frames: list[State] = []
        self._trace: list[tuple[float, ...]] = []
        self._switches: list[SwitchRow] = []

    def take(self, frame: Frame) -> None:
        """Add a frame unless it is stored already; an intervention begins a new one, with the state after it."""
        state, self._scenario = frame.states[self.which], frame.scenarios[self.which]
        trace, switches = frame.rows[self.which]
        mark = (frame.changed_at[self.which], frame.versions[self.which], id(trace))
        if mark != self.mark or state.t < self.frames[-1].t:
            self.clear()
            self.mark = mark
            self.frames = [frame.began[self.which]]
            self._trace = _between(trace, -np.inf, self.frames[0].t)[-1:]
        if state.t == self.frames[-1].t:
            return
        if self._trace:
            self._trace += _between(trace, self._trace[-1][0], state.t)
        else:
            self._trace = _between(trace, -np.inf, state.t)[-1:]
        self._switches += _between(switches, self.frames[-1].t, state.t)
        self.frames.append(state)
        self._thin(state)

    def _thin(self, state: State) -> None:
        links = state.n**2 if state.links is not None else 0
        most = int(min(MOST_FRAMES, max(FEWEST_FRAMES, MOST_BYTES // (16 * state.q.size + links + 1))))
        if len(self.frames) > most:
            self.frames = [*self.frames[:-1:2], self.frames[-1]]
        if len(self._trace) > MOST_ROWS:
            self._trace = [*self._trace[:-1:2], self._trace[-1]]
        if len(self._switches) > MOST_ROWS:
            # Links cannot be followed across dropped switches: the history begins later.
            half = float(self._switches[len(self._switches) // 2][0])
            self.frames = [s for s in self.frames if s.t >= half] or self.frames[-1:]
            self._switches = [row for row in self._switches if row[0] > self.frames[0].t]
            self._trace = [row for row in self._trace if row[0] >= self.frames[0].t] or self._trace[-1:]

    @property
    def span(self) -> tuple[float, float]:
        """First and last time."""
        return (self.frames[0].t, self.frames[-1].t) if self.frames else (0.0, 0.0)

    def run(
        self, closest: tuple[Closest, Closest], accuracy: Accuracy | None = None, fidelity: Fidelity = UNSTATED
    ) -> Run | None:
        """The history as a run; None before there are three frames.

        Parameters
        ----------
        closest
            Closest linked and unlinked pairs, which frames do not show.
        accuracy
            Errors of the session, where they are known.
        fidelity
            What the session states about its accuracy.
        """
        frames = self.frames
        if len(frames) < 3:
            return None
        with_links = all(s.links is not None for s in frames)
        trace = ledger_of(self._trace)
        for name in CUMULATIVE:
            if len(trace):
                trace[name] -= trace[name][0]
        known = accuracy
        if known is not None:
            # A maximum of the session reached since then is the maximum since then.
            doubts = known.doubts[known.doubts["end"] >= frames[0].t]
            largest = {name: x for name, x in known.largest.items() if x.time >= frames[0].t}
            known = replace(known, frames=np.full((len(frames), 2), np.nan), doubts=doubts, largest=largest)
        return Run(
            self._scenario, np.array([s.t for s in frames]), np.array([s.q for s in frames]),
            np.array([s.p for s in frames]),
            np.array([s.links for s in frames]) if with_links else np.zeros((len(frames), 0, 0), dtype=bool),
            np.array(self._switches, dtype=SWITCH_FIELDS), trace, *closest, "running",
            {"engine": "lab", "tolerance": self._scenario.tolerance}, accuracy=known, fidelity=fidelity,
            columns={name: np.array([s.columns[name] for s in frames]) for name in frames[0].columns},
        )  # fmt: skip


TimedRow = TypeVar("TimedRow", tuple[float, ...], SwitchRow)
"""A row of the ledger, or a switch: its time comes first."""


def _between(rows: Iterable[TimedRow], after: float, until: float) -> list[TimedRow]:
    """Rows later than ``after`` and not later than ``until``; rows may be added and dropped meanwhile."""
    found = []
    for row in reversed(list(rows)):
        if row[0] <= after:
            break
        if row[0] <= until:
            found.append(row)
    found.reverse()
    return found


class Series:
    """Measured numbers over time, the last few hundred of them.

    Parameters
    ----------
    names
        What they are called.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self.rows: deque[tuple[float, ...]] = deque(maxlen=SERIES_POINTS)

    def add(self, t: float, values: tuple[float, ...]) -> None:
        """Add a row; an earlier time clears the others.

        Parameters
        ----------
        values
            The numbers of the row after its time.
        """
        if self.rows and t < self.rows[-1][0]:
            self.rows.clear()
        if not self.rows or t > self.rows[-1][0]:
            self.rows.append((t, *values))

    def columns(self) -> tuple[Array, ...]:
        """Time and the values, one array each."""
        table = np.array(self.rows, dtype=np.float64).reshape(-1, 1 + len(self.names))
        return tuple(np.ascontiguousarray(column) for column in table.T)
