"""Motion of bodies under the law on the true state at every moment, by another integrator."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array
from flocking.engine.imperfect.range_crossings import ObstacleRanges
from flocking.engine.imperfect.true_law import TrueLaw
from flocking.engine.protocol.body_chains import of_points
from flocking.engine.runs.message_log import MessageLog
from flocking.engine.runs.run import Run
from flocking.model.world.times import NANOSECOND
from flocking.study.departed_energy.true_links import TrueLinks
from flocking.study.message_logs.integrated_motion import Forces, IntegratedForcedMotion


class IdealMotion(IntegratedForcedMotion):
    """Where every agent is under the law on the truth, from frame to frame; links switch when those of the run do.

    Parameters
    ----------
    run
        The run, with its frames and switches.
    """

    def __init__(self, run: Run) -> None:
        scenario = run.scenario
        m = scenario.start.q.shape[1]
        self._law, self._links = TrueLaw(of_points(scenario)), TrueLinks(run)
        self._ranges = ObstacleRanges(scenario.law, scenario.start.q, scenario.start.t)
        switches = {s for term in scenario.law.body_terms for s in term.switch_times(scenario.start.t, np.inf)}
        self._met = run.switches[run.switches["kind"] == "obstacle"]
        self._changes = [t - scenario.start.t for t in (*run.switches["time"].tolist(), *switches)]
        none = np.zeros((0, 3), dtype=np.int64)
        super().__init__(run, scenario, MessageLog(none, np.zeros((0, m)), none))

    def _jumps(self) -> list[float]:
        return self._changes

    def _forces(self, end: float) -> Forces:
        begin = self._ends[-1] if self._ends else 0.0
        law, before = self._law, end - NANOSECOND
        law.take_parameters(self._base + 0.5 * (begin + end))
        # What switches at the end has not switched on the stretch.
        self._meet(before)
        pairs, slots = law.pairs(np.array(self._links.at(before)), self._ranges.pairs), law.slots

        def at(t: float, y: Array) -> Array:
            q = np.ascontiguousarray(y[: self.m].T)
            p = np.ascontiguousarray(y[self.m : 2 * self.m].T) if self.order == 2 else np.zeros_like(q)
            u = np.zeros((self.n, self.m))
            law.kernels.control(self._base + t, q, p, pairs, slots, law.functionals, u, law.rates)
            return u

        return at

    def _meet(self, seconds: float) -> None:
        """Let agents come within range of obstacles, or leave it, until a time since the start, as those of the run."""
        while len(self._met) and self._met["time"][0] - self._base <= seconds:
            _, agent, number, _, group, *_ = self._met[0].tolist()
            there = self._ranges.near[group]
            obstacle = list(self._ranges.groups[group].numbers).index(number)
            there[agent, obstacle] = not there[agent, obstacle]
            self._met = self._met[1:]

    def desired(self, seconds: float) -> Array:
        """Forces of the law, shape (N, m).

        Parameters
        ----------
        seconds
            Time since the start.
        """
        stretch, y = self._vector(seconds)
        return stretch.forces(seconds, y)
