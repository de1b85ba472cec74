"""Motion under continuous control, by another integrator, from what agents use by a log."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flocking.arrays import Array
from flocking.engine.runs.message_log import AT_START, LEADER, OWN, MessageLog
from flocking.engine.runs.run import Run
from flocking.model.law import Scenario
from flocking.model.world.information import Messages
from flocking.model.world.times import NANOSECOND, PER_SECOND
from flocking.study.message_logs.arrivals import Arrivals, Sample
from flocking.study.message_logs.integrated_motion import SAME_TIME, Forces, IntegratedForcedMotion, end_of_ledger
from flocking.study.message_logs.leader_arrivals import leader_arrivals
from flocking.study.message_logs.reference_law import ReferenceLaw

EXPECTED = 100.0
"""Error of the motion of a run in tolerances, by which samples are taken to be off as long as it is not known: that of
the steps between two frames of most runs."""

SWITCHES = 8.0
"""Links that may switch between two frames beside each other, at times that the log rounds to a nanosecond: a jump of a
force is no larger than twice the largest one, by half a nanosecond, and random roundings of 64 add up to 8."""


class InUse(NamedTuple):
    """What an agent uses.

    Parameters
    ----------
    own
        Its own sample, where it knows itself by one.
    others
        Neighbours by the number of the graph: who, and the sample.
    leaders
        Number of the sample by which it knows leaders; None where it knows them exactly.
    """

    own: Sample | None
    others: dict[int, list[tuple[int, Sample]]]
    leaders: int | None = None


class ContinuousMotion(IntegratedForcedMotion):
    """Where every agent is under the law on what agents use by the log, from frame to frame.

    Parameters
    ----------
    run, scenario, log
        As for `IntegratedForcedMotion`; information are messages, control is continuous.
    law
        Gives the forces.

    Attributes
    ----------
    arrivals
        Samples and arrivals until the end of the run.
    leaders
        Those of leaders; None where these are known exactly.
    """

    def __init__(self, run: Run, scenario: Scenario, log: MessageLog, law: ReferenceLaw) -> None:
        assert isinstance(scenario.information, Messages)
        self._law, self._predict = law, scenario.information.predict
        self._uses = [InUse(None, {}) for _ in range(scenario.start.n)]
        self._largest_force = 0.0
        super().__init__(run, scenario, log)

    def _follow(self, run: Run, scenario: Scenario, log: MessageLog, latency: list[int]) -> None:
        end = max(float(run.t[-1]) - self._base if len(run.t) else 0.0, end_of_ledger(run))
        last = min(max(end, *(log.ticks[-1:, 0] * NANOSECOND).tolist(), 0.0), scenario.t_end - self._base)
        self.error = EXPECTED * scenario.tolerance
        self.open_until: list[float] = []
        """Ends of stretches on which a sample in use may be rounded to another multiple, in seconds from the start."""
        self.arrivals = Arrivals(scenario, self, int(last * PER_SECOND))
        self.leaders = leader_arrivals(scenario, int(last * PER_SECOND))
        super()._follow(run, scenario, log, latency)
        # Times of the log are whole nanoseconds: agents and their velocities move on in one of them. How fast is taken
        # from what is computed here: a stored number must not widen what it is compared within.
        speed = max((float(np.abs(self.states(float(t) - self._base)[1]).max()) for t in run.t), default=0.0)
        if self.order == 1:
            self.shifts = SWITCHES * NANOSECOND * max(speed, self._largest_force), 0.0
            return
        rate = self._largest_force / float(self.masses.min())
        gap = float(np.diff(run.t, prepend=self._base).max(initial=0.0))
        self.shifts = SWITCHES * NANOSECOND * (speed + rate * gap), SWITCHES * NANOSECOND * rate

    def _jumps(self) -> list[float]:
        return [at - self._base for at in self._law.switches]

    def _take(self, log: MessageLog, row: int) -> None:
        self._uses[int(log.ticks[row, 1])] = self.in_use(log, row)

    def in_use(self, log: MessageLog, row: int) -> InUse:
        """What an agent uses from act ``row`` of a log on."""
        instant, _, count = log.ticks[row].tolist()
        first = int(log.firsts[row])
        own: Sample | None = None
        leaders: int | None = None
        others: dict[int, list[tuple[int, Sample]]] = {}
        for graph, sender, k in log.uses[first : first + count].tolist():
            if graph == LEADER:
                leaders = k if self.leaders is not None and self.leaders.is_there(k, instant) else None
                continue
            if k < AT_START or self.arrivals.taken(sender, k) > instant:
                continue  # No such sample was there; it is named where entries are looked at.
            sample = self.arrivals.sample(sender, k, instant)
            if graph == OWN:
                own = sample
            else:
                others.setdefault(graph, []).append((sender, sample))
        return InUse(own, others, leaders)

    def _forces(self, end: float) -> Forces:
        uses = list(self._uses)
        samples = [s for used in uses for listed in used.others.values() for _, s in listed]
        if any(s.open for s in (*samples, *(used.own for used in uses if used.own is not None))):
            self.open_until.append(end)
        # Gains that change at the end of a stretch have not changed within it.
        ends = any(abs(end - at) <= SAME_TIME * (1.0 + end) for at in self._jumps())
        latest = end - SAME_TIME * (1.0 + end) if ends else np.inf

        def at(t: float, y: Array) -> Array:
            q = y[: self.m].T
            p = y[self.m : 2 * self.m].T if self.order == 2 else np.zeros_like(q)
            now, found = min(t, latest), np.empty((self.n, self.m))
            for agent, used in enumerate(uses):
                own = (q[agent], p[agent]) if used.own is None else (used.own.q, used.own.p)
                others = {graph: [(j, *self._moved(s, t)) for j, s in listed] for graph, listed in used.others.items()}
                law = None
                if self.leaders is not None and used.leaders is not None:
                    law = self.leaders.law(used.leaders, t / NANOSECOND)
                found[agent] = self._law.force(agent, own, others, self._base + now, law)
            self._largest_force = max(self._largest_force, float(np.abs(found).max(initial=0.0)))
            return found

        return at

    def _moved(self, sample: Sample, t: float) -> tuple[Array, Array]:
        """Position and velocity that a receiver takes a sender to have at a time since the start."""
        if not self._predict:
            return sample.q, sample.p
        return sample.q + (t - sample.instant * NANOSECOND) * sample.p, sample.p
