"""What agents were to use when they acted, and the forces that follow, computed a second time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from flocking.arrays import Array
from flocking.engine.runs.message_log import AT_START, LEADER, LEADER_SENDER, OWN, PRESENT, MessageLog
from flocking.engine.runs.run import Run
from flocking.errors import FlockingError
from flocking.model.bodies.actuators import APPLIED
from flocking.model.law import Scenario
from flocking.model.world.times import NANOSECOND, PER_SECOND
from flocking.study.message_logs.arrivals import NEVER
from flocking.study.message_logs.forced_motion import ForcedMotion
from flocking.study.message_logs.link_margins import doubt_of, margin_of
from flocking.study.message_logs.logged_world import LoggedWorld
from flocking.study.message_logs.replay_result import WrongEntry

SAME_FORCE = 1e-7
"""Difference of two computations of a force, relative to it, that is looked into no further."""

ROUNDED_FORCE = 1e-12
"""The same, relative to the largest force that was computed so far: forces that cancel leave rounding."""

SURE = 2.0
"""Ratio of the difference of forces that is allowed to that by which they change with the errors of what is known: to
first order they change by no more than that; the rest is for the second one."""

JUDGED = 0.01
"""Largest difference of forces, relative to the largest one computed so far, within which an act counts as judged:
where errors of what is known allow more, it counts as undecided. A convention, far below the change when a neighbour is
left out. The same of positions at frames, relative to the size of the group and to how far it moved."""

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
        self._largest_force = 0.0

    def _finding(self, instant: float, agent: int, entry: int | None, what: str) -> WrongEntry:
        return WrongEntry(self.world.base + instant * NANOSECOND, agent, entry, what)

    def _is_open(self, frame: int) -> bool:
        """Whether rounding leaves open how agents moved to a frame from the one before."""
        return False

    def _frames(self) -> Iterator[WrongEntry]:
        """Frames against the motion under the logged forces."""
        run, world = self.run, self.world
        start, sizes = world.scenario.start, world.sizes
        for k, t in enumerate(run.t):
            if self._is_open(k):
                continue
            q, p = world.motion.states(float(t) - world.base)
            # By the size of what is computed here: a stored number must not widen what it is compared within.
            extent = max(float(np.ptp(q, axis=0).max()), float(np.abs(q - start.q).max()))
            compared = [("position", q, run.q[k], world.near * (sizes.place + extent) + world.off_q, extent)]
            if world.motion.order > 1:
                fastest = float(np.abs(p).max())
                off_p = world.near * (sizes.velocity + fastest) + world.motion.shifts[1]
                compared.append(("velocity", p, run.p[k], off_p, fastest))
            for name, again in self._columns(float(t) - world.base).items():
                size = float(np.abs(again).max())
                compared.append((name, again, run.columns[name][k], world.near * (sizes.force + size), size))
            for name, again, stored, allowed, size in compared:
                off = np.abs(again - stored).max(axis=1)
                bad = np.flatnonzero(~(off <= allowed))
                self.undecided += int((off > SAME_FORCE * size).sum()) if allowed > JUDGED * size else 0
                if bad.size:
                    agent = int(bad[0])
                    yield WrongEntry(
                        float(t),
                        agent,
                        None,
                        f"its {name} in frame {k} is {off[agent]:.3g} from where the logged forces lead",
                    )
                    return

    def _columns(self, seconds: float) -> dict[str, Array]:
        """Further columns of the agents at a time from the motion, shape (N, width) each; headings are not followed."""
        motion, found = self.world.motion, {}
        if isinstance(motion, ForcedMotion):
            found[APPLIED] = motion.acting(seconds)[1]
        else:
            found = motion.columns(seconds)
        return {name: values for name, values in found.items() if name in self.run.columns}

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
        leaders = logged.get((LEADER, LEADER_SENDER))
        again = world.force(agent, (own.q, own.p), others, instant, leaders)
        stored = self.log.forces[row]
        off, size = float(np.abs(again - stored).max()), float(np.abs(again).max())
        self._largest_force = max(self._largest_force, size)
        allowed = 0.0
        if not off <= max(SAME_FORCE * size, ROUNDED_FORCE * self._largest_force):
            age = max((instant - x.instant for x in samples.values()), default=0) * NANOSECOND
            # Of a difference that is small beside the largest force it is enough that one error explains it.
            enough = off / SURE if off <= SAME_FORCE * self._largest_force else np.inf
            allowed = SURE * self._change(agent, (own.q, own.p), others, (instant, leaders), again, age, enough)
            self.undecided += (not open_) and off <= allowed and allowed > JUDGED * self._largest_force
        if off <= max(SAME_FORCE * size, ROUNDED_FORCE * self._largest_force, allowed):
            self.undecided += open_
        elif open_:
            self.undecided += 1
        else:
            yield self._finding(
                instant, agent, None,
                f"its force is logged as {force_digits(stored, off)}; from the samples that the log names, the law "
                f"gives {force_digits(again, off)}",
            )  # fmt: skip

    def _change(
        self, agent: int, own: tuple[Array, Array], others: Mapping[int, list[tuple[int, Array, Array]]],
        when: tuple[int, int | None], force: Array, age: float, enough: float,
    ) -> float:  # fmt: skip
        """By how much a force changes with what positions and velocities are uncertain by; infinite at a pole.

        Parameters
        ----------
        own
            Position and velocity by which the agent knows itself.
        others
            Neighbours by the number of the graph: who, position and velocity.
        when
            Nanosecond of the act, and the sample by which leaders are known.
        force
            The force.
        age
            Age of the oldest sample in seconds: positions that are moved on are uncertain by velocities, too.
        enough
            The change beyond which no further errors are looked at.
        """
        world = self.world
        off_q = world.off_q + (age * world.off_p if world.messages is not None and world.messages.predict else 0.0)
        axes = np.eye(world.m)
        moves = [(off_q * axis, 0.0 * axis) for axis in axes] + [(0.0 * axis, world.off_p * axis) for axis in axes]
        found = 0.0
        neighbours = {x[0] for listed in others.values() for x in listed} - {agent}
        for j in (agent, *sorted(neighbours)):
            for by_q, by_p in moves:
                if found >= enough:
                    return found
                mine = (own[0] + by_q, own[1] + by_p) if j == agent else own
                lists = {
                    graph: [(k, q + by_q, p + by_p) if k == j else (k, q, p) for k, q, p in listed]
                    for graph, listed in others.items()
                }
                try:
                    moved = world.force(agent, mine, lists, *when)
                except FlockingError:
                    return np.inf
                change = float(np.abs(moved - force).max())
                found += change if np.isfinite(change) else np.inf
        return found

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
            looks, off = world.looks(graph, instant * NANOSECOND, np.tile(own.p, (world.n, 1)))
            for j in range(world.n):
                if j == agent:
                    continue
                near = bool(mine[j])
                if graph.moves:
                    sample = world.sample(j, numbers[j], instant)
                    place, _ = world.received(sample, instant)
                    offset = world.space.displacement(place - own.q)
                    headings = world.scenario.agents.headings
                    inside, level = margin_of(graph, headings, (agent, j), near, offset, looks[agent])
                    near = there[j] and inside > 0.0
                    within = world.near * (world.sizes.place + level) + 2.0 * world.off_q
                    within += doubt_of(graph, offset, looks[agent], off)
                    doubtful = sample.open or own.open or abs(inside) <= within
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


def force_digits(values: Array, off: float) -> list[float]:
    """A force in as many digits as show a difference.

    Parameters
    ----------
    values
        The force, shape (m,).
    off
        The difference.
    """
    size = float(np.abs(values).max(initial=0.0))
    digits = 6 if not (off > 0.0 and size > 0.0) else min(17, max(6, math.ceil(math.log10(size / off)) + 2))
    return [float(f"{x:.{digits}g}") for x in values.tolist()]
