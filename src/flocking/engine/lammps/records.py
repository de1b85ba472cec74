"""What the first rank writes down of a run; all records stay in its memory."""

from __future__ import annotations

from flocking.engine.lammps.ledger import Ledger
from flocking.engine.runs.recorder import Recorder
from flocking.engine.runs.run import Run
from flocking.model.law import Scenario
from flocking.model.state import State


class LammpsRecorder(Recorder):
    """Frames, ledger and observations, on the first rank; the others count frames.

    Parameters
    ----------
    scenario
        What is simulated.
    rims
        Energy of a pair where its link ends, for each graph of the law.
    observe
        Whether there are observations.
    """

    def __init__(self, scenario: Scenario, rims: list[float], *, observe: bool = False) -> None:
        super().__init__(scenario, observe=observe, lets_go=False)
        self.scenario = scenario
        self.ledger = Ledger(scenario, rims, self)

    def due(self, t: float) -> bool:
        """Whether a frame is due at time ``t``, on or after its time; the same on all ranks."""
        return self.count < len(self.frame_times) and bool(self.frame_times[self.count] <= t + 1e-12 * max(1.0, abs(t)))

    def state_frame(self, state: State, observed: tuple[float, ...] | None) -> None:
        """Store a frame.

        Parameters
        ----------
        observed
            Observations of the frame, fields `OBSERVED_FIELDS`, or None.
        """
        links = self.scenario.law.graph.initial(state.q) if self.with_links else None
        self.frame(state.t, state.q, state.p, links, observed=observed)

    def go_on(self, run: Run, now: State | None) -> None:
        """Go on with the records of a run that ended in ``now``; None on ranks that keep no records."""
        if now is None:
            self._skipped = len(run.t)
            return
        self.recall({}, lambda: run)
        self.ledger.go_on(now)
