"""What agents were to use when they acted, and the forces that follow, computed a second time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flocking.engine.runs.message_log import AT_START, LEADER, LEADER_SENDER, OWN, PRESENT, MessageLog
from flocking.engine.runs.run import Run
from flocking.model.law import Scenario
from flocking.model.world.times import NANOSECOND, PER_SECOND
from flocking.study.message_logs.arrivals import NEVER
from flocking.study.message_logs.link_margins import margin_of
from flocking.study.message_logs.logged_world import LoggedWorld
from flocking.study.message_logs.replay_result import WrongEntry

SAME_FORCE = 1e-7
"""Difference of two computations of a force, relative to a size of the run and to it: steep potentials amplify the
rounding of positions, 1e-16 of them, by up to their second derivative, for which this leaves 1e9."""

STEEP = 100.0
"""Largest change of a force, relative to 1 and to it, over that of positions by which it is taken to change where both
motions have errors of steps: forces of steeper laws are reported where they agree with nothing that the log names."""

Uses = dict[tuple[int, int], int]
"""Number of the sample that is used, by graph and sender."""


class SecondComputation:
    """What a second computation of any run with a log needs.

    Parameters
    ----------
    run, scenario, log
        The run, its scenario and its log.
    """

    def __init__(self, run: Run, scenario: Scenario, log: MessageLog) -> None:
        self.run, self.log = run, log
        self.world = LoggedWorld(run, scenario, log)
        self.links = list(self.world.scenario.links_at_start)
        self.undecided = 0

    def _finding(self, instant: float, agent: int, entry: int | None, what: str) -> WrongEntry:
        return WrongEntry(self.world.base + instant * NANOSECOND, agent, entry, what)

    def _is_open(self, frame: int) -> bool:
        """Whether rounding leaves open how agents moved to a frame from the one before."""
        return False

    def _frames(self) -> Iterator[WrongEntry]:
        """Frames against the motion under the logged forces."""
        run = self.run
        for k, t in enumerate(run.t):
            if self._is_open(k):
                continue
            q, p = self.world.motion.states(float(t) - self.world.base)
            sizes = self.world.sizes
            compared = [("position", q, run.q[k], sizes.place)]
            if self.world.motion.order > 1:
                compared.append(("velocity", p, run.p[k], sizes.velocity))
            for name, again, stored, size in compared:
                off = np.abs(again - stored).max(axis=1)
                # By the size of what is computed here: a stored number must not widen what it is compared within.
                bad = np.flatnonzero(~(off <= self.world.near * (size + np.abs(again).max())))
                if bad.size:
                    agent = int(bad[0])
                    yield WrongEntry(
                        float(t),
                        agent,
                        None,
                        f"its {name} in frame {k} is {off[agent]:.3g} from where the logged forces lead",
                    )
                    return

    def _is_known(self, key: tuple[int, int], k: int | None, instant: int) -> bool:
        """Whether an entry names a state that there was."""
        if k is None or k == AT_START or (k == PRESENT and self.world.messages is None):
            return True
        arrivals, leaders = self.world.arrivals, self.world.leaders
        if key[0] == LEADER:
            return leaders is not None and leaders.is_there(k, instant)
        return arrivals is not None and k >= 0 and arrivals.taken(key[1], k) <= instant

    def _force(self, row: int, instant: int, agent: int, logged: Uses, *, open_: bool) -> Iterator[WrongEntry]:
        """The force of an act against that of the law on the entries of the log."""
        world, others = self.world, {}
        own = world.sample(agent, logged.get((OWN, agent), PRESENT), instant)
        samples = {key: world.sample(key[1], k, instant) for key, k in logged.items() if key[0] != LEADER}
        open_ = open_ or own.open or any(x.open for x in samples.values())
        for graph in range(len(world.graphs)):
            received = [(key[1], *world.received(samples[key], instant)) for key in sorted(logged) if key[0] == graph]
            others[graph] = received
        again = world.force(agent, (own.q, own.p), others, instant, logged.get((LEADER, LEADER_SENDER)))
        stored = self.log.forces[row]
        off = float(np.abs(again - stored).max())
        size = self.world.sizes.force + float(np.abs(again).max())
        if off <= (SAME_FORCE + STEEP * self.world.motion.error) * size:
            self.undecided += open_
        elif open_:
            self.undecided += 1
        else:
            yield self._finding(
                instant, agent, None,
                f"its force is logged as {np.round(stored, 6).tolist()}; from the samples that the log names, the law "
                f"gives {np.round(again, 6).tolist()}",
            )  # fmt: skip

    def _expected(self, instant: int, agent: int, logged: Uses) -> tuple[Uses, bool]:
        """What an agent is to use, and whether rounding leaves some of it open; link memory goes on from it."""
        world, found, undecided = self.world, {}, False
        numbers, there = self._newest(instant, agent)
        own = world.sample(agent, numbers[agent], instant)
        if numbers[agent] != PRESENT:
            found[OWN, agent] = numbers[agent]
        if world.leaders is not None:
            found[LEADER, LEADER_SENDER] = world.leaders.newest(agent, instant)
        for number, graph in enumerate(world.graphs):
            mine = self.links[number][agent]
            for j in range(world.n):
                if j == agent:
                    continue
                near = bool(mine[j])
                if graph.moves:
                    sample = world.sample(j, numbers[j], instant)
                    place, _ = world.received(sample, instant)
                    offset = world.space.displacement(place - own.q)
                    inside, level = margin_of(graph, world.scenario.agents.headings, (agent, j), near, offset)
                    near = there[j] and inside > 0.0
                    doubtful = sample.open or own.open or abs(inside) <= world.near * (world.sizes.place + level)
                    if there[j] and doubtful:
                        near, undecided = (number, j) in logged, True
                    mine[j] = near
                if near and there[j]:
                    found[number, j] = numbers[j]
        return found, undecided

    def _newest(self, instant: int, agent: int) -> tuple[list[int], list[bool]]:
        """Number of the sample that an agent has of every agent, itself included, and whether it is young enough."""
        messages, arrivals, n = self.world.messages, self.world.arrivals, self.world.n
        numbers, there = [PRESENT] * n, [True] * n
        if messages is not None and arrivals is not None:
            if messages.self_known == "measured":
                numbers[agent] = arrivals.newest_taken(agent, instant)
            for j in range(n):
                if j != agent:
                    numbers[j] = arrivals.newest(agent, j, instant)
                    age = instant - arrivals.taken(j, numbers[j])
                    there[j] = messages.expires is None or age < max(1, round(messages.expires * PER_SECOND))
        return numbers, there

    def _why(self, agent: int, key: tuple[int, int], logged: int | None, expected: int | None, instant: int) -> str:
        """What is wrong with an entry, in words."""
        graph, sender = key
        if graph == OWN:
            return f"it knew itself by its sample {logged}, where {expected} was its newest"
        if graph == LEADER:
            return f"it knew leaders by their sample {logged}, where {expected} was the newest that had arrived"
        arrivals = self.world.arrivals
        if logged is None:
            return f"agent {sender} was its neighbour and nothing of it was used; sample {expected} was to be used"
        found = f"sample {logged} of agent {sender} was used"
        if arrivals is not None and logged >= 0:
            times = arrivals.arrivals(agent, sender)
            if logged >= len(times) or arrivals.taken(sender, logged) > instant:
                return f"{found}, which was not taken yet"
            if times[logged] == NEVER:
                return f"{found}, which was lost"
            if times[logged] > instant:
                return f"{found}, which arrived only at {self.world.base + times[logged] * NANOSECOND:.9g}"
        if expected is None:
            return f"{found}, of which it knew nothing young enough, or which was no neighbour by what it knew"
        return f"{found}, where sample {expected} was the newest that had arrived"
