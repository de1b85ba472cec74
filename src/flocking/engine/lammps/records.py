"""Records of a run, in the memory of the first rank."""

from __future__ import annotations

from flocking.engine.lammps.ledger import Ledger
from flocking.engine.runs.recorder import Recorder
from flocking.engine.runs.run import Run
from flocking.model.law import Scenario
from flocking.model.state import State

SAME_TIME = 1e-12
"""Relative difference of times that rounding of a sum of steps explains: below a thousandth of any usable step."""


class LammpsRecorder(Recorder):
    """Frames, ledger and observables on the first rank; the others count frames.

    Parameters
    ----------
    scenario
        The scenario.
    break_energies
        Energy of a pair at the break radius, for each graph of the law.
    observe
        Whether observables are recorded.
    """

    def __init__(self, scenario: Scenario, break_energies: list[float], *, observe: bool = False) -> None:
        super().__init__(scenario, observe=observe, lets_go=False)
        self.scenario = scenario
        self.ledger = Ledger(scenario, break_energies, self)

    def due(self, t: float) -> bool:
        """Whether a frame is due at or before time ``t``; the same on all ranks."""
        slack = SAME_TIME * max(abs(t), min(1.0, self.scenario.t_end - self.scenario.start.t))
        return self.count < len(self.frame_times) and bool(self.frame_times[self.count] <= t + slack)

    def state_frame(self, state: State, observed: tuple[float, ...] | None) -> None:
        """Store a frame.

        Parameters
        ----------
        observed
            Observables of the frame, fields `OBSERVED_FIELDS`, or None.
        """
        scenario = self.scenario
        links = scenario.law.graph.links_in(scenario.space, state.q) if self.with_links else None
        self.frame(state.t, state.q, state.p, links, observed=observed)

    def resume(self, run: Run, now: State | None) -> None:
        """Continue the records of a run that ended in ``now``; None on ranks without records."""
        if now is None:
            self._skipped = len(run.t)
            return
        self.recall({}, lambda: run)
        self.ledger.resume(now)
