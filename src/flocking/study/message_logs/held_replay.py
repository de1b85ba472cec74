"""A second computation of a run with held control: what was used at every tick."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flocking.model.world.control import Held
from flocking.model.world.times import NANOSECOND, PER_SECOND
from flocking.study.message_logs.replay_result import MOST_ERRORS, Replay, WrongEntry
from flocking.study.message_logs.second_computation import SecondComputation, Uses


class HeldReplay(SecondComputation):
    """The second computation of one run: agents act at the ticks of their clocks."""

    def result(self) -> Replay:
        """What was found."""
        wrong = sorted([*self._acts(), *self._ticks(), *self._frames()], key=lambda w: w.time)
        return Replay(len(self.log.ticks), len(self.log.uses), self.undecided, tuple(wrong[:MOST_ERRORS]))

    def _ticks(self) -> Iterator[WrongEntry]:
        """Acts against the ticks of every agent's clock."""
        held = self.world.scenario.control
        assert isinstance(held, Held)
        period, phase = (
            np.broadcast_to(np.rint(np.asarray(x) * PER_SECOND), self.world.n).astype(np.int64)
            for x in (held.period, held.phase)
        )
        until = (float(self.run.t[-1]) - self.world.base) * PER_SECOND - 0.5 if len(self.run.t) else 0.0
        for agent in range(self.world.n):
            mine = self.log.ticks[self.log.ticks[:, 1] == agent, 0]
            due = phase[agent] + np.arange(len(mine)) * period[agent]
            apart = np.flatnonzero(mine != due)
            if apart.size:
                k = int(apart[0])
                what = f"its act {k} is logged at another time, {mine[k] * NANOSECOND:.9g}"
                yield self._finding(float(due[k]), agent, None, what)
            elif phase[agent] + len(mine) * period[agent] < until:
                at = float(phase[agent] + len(mine) * period[agent])
                yield self._finding(at, agent, None, "it was to act and did not")

    def _acts(self) -> Iterator[WrongEntry]:
        firsts = self.log.firsts
        for row, (instant, agent, count) in enumerate(self.log.ticks.tolist()):
            first = int(firsts[row])
            entries = self.log.uses[first : first + count].tolist()
            logged: Uses = {(graph, sender): k for graph, sender, k in entries}
            numbers = {(graph, sender): first + e for e, (graph, sender, _) in enumerate(entries)}
            expected, open_ = self._expected(instant, agent, logged)
            known = True
            for key in sorted({*logged, *expected}):
                if logged.get(key) != expected.get(key):
                    known = known and self._is_known(key, logged.get(key), instant)
                    what = self._why(agent, key, logged.get(key), expected.get(key), instant)
                    yield self._finding(instant, agent, numbers.get(key), what)
            if len(logged) != len(entries):
                yield self._finding(instant, agent, None, "two of its entries are of one sender under one graph")
            if known:
                yield from self._force(row, instant, agent, logged, open_=open_)
