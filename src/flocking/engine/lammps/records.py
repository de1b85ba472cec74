"""What the first rank writes down of a run: frames, ledger and observations."""

from __future__ import annotations

from typing import Any

import numpy as np

from flocking.arrays import Links, Positions, Velocities
from flocking.engine.lammps.ledger import Ledger
from flocking.engine.runs.run import OBSERVED_FIELDS, SWITCH_FIELDS, TRACE_FIELDS, Run
from flocking.model.law import Scenario
from flocking.model.state import State

MOST_LINKED = 2000
"""Larger groups carry no link matrix in their frames."""
MOST_LINK_BYTES = 256 * 2**20
"""Frames hold link matrices only up to this size in total."""


class Records:
    """Frames, ledger and observations, on the first rank alone.

    Parameters
    ----------
    scenario
        What is simulated.
    rims
        Energy of a pair where its link ends, for each graph of the law.
    """

    def __init__(self, scenario: Scenario, rims: list[float]) -> None:
        n = scenario.start.n
        self.scenario = scenario
        self.frame_times = scenario.frame_times
        self.with_links = n <= MOST_LINKED and len(self.frame_times) * n**2 <= MOST_LINK_BYTES
        self.t: list[float] = []
        self.q: list[Positions] = []
        self.p: list[Velocities] = []
        self.links: list[Links] = []
        self.observed: list[tuple[float, ...]] = []
        self.ledger = Ledger(scenario, rims)
        self.count = 0

    def due(self, t: float) -> bool:
        """Whether a frame is due at time ``t``, on or after its time; the same on all ranks."""
        return self.count < len(self.frame_times) and bool(self.frame_times[self.count] <= t + 1e-12 * max(1.0, abs(t)))

    def frame(self, state: State, observed: tuple[float, ...] | None) -> None:
        """Store a frame.

        Parameters
        ----------
        observed
            Observations of the frame, fields `OBSERVED_FIELDS`, or None.
        """
        if observed is not None:
            self.observed.append(observed)
        self.q.append(state.q)
        self.p.append(state.p)
        if self.with_links:
            self.links.append(self.scenario.law.graph.initial(state.q))
        self.t.append(state.t)

    def recall(self, run: Run, now: State | None) -> None:
        """Go on with the records of a run that ended in ``now``; None on ranks that keep no records."""
        self.count = len(run.t)
        if now is None:
            return
        self.t, self.q, self.p = [float(t) for t in run.t], list(run.q), list(run.p)
        self.links = list(run.links) if self.with_links else []
        self.observed = [] if run.observables is None else run.observables.tolist()
        self.ledger.closest_linked, self.ledger.closest_unlinked = run.closest_linked, run.closest_unlinked
        self.ledger.go_on(run.trace.tolist(), now)

    def tables(self, n: int, m: int) -> dict[str, Any]:
        """All records as arrays, by the names of `Run`."""
        frames = len(self.t)
        linked = self.with_links and frames
        return {
            "t": np.array(self.t),
            "q": np.array(self.q) if frames else np.zeros((0, n, m)),
            "p": np.array(self.p) if frames else np.zeros((0, n, m)),
            "links": np.array(self.links) if linked else np.zeros((frames, 0, 0), dtype=bool),
            "switches": np.zeros(0, dtype=SWITCH_FIELDS),
            "trace": np.array(self.ledger.trace, dtype=TRACE_FIELDS),
            "closest_linked": self.ledger.closest_linked,
            "closest_unlinked": self.ledger.closest_unlinked,
            "observables": np.array(self.observed, dtype=OBSERVED_FIELDS) if self.observed else None,
        }
