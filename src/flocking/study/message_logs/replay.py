"""A second computation of what agents knew and of the forces that follow: which entries of a log are wrong."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flocking.engine.runs.message_log import AT_START, LEADER, LEADER_SENDER, OWN, PRESENT, MessageLog
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.formula.compiled import Reading
from flocking.model.law import Scenario
from flocking.model.world.control import Held
from flocking.model.world.safety_filters import SafetyFilter
from flocking.model.world.times import NANOSECOND, PER_SECOND
from flocking.study.message_logs.arrivals import NEVER
from flocking.study.message_logs.link_margins import margin_of
from flocking.study.message_logs.logged_world import LoggedWorld

SAME_FORCE = 1e-7
"""Difference of two computations of a force, relative to 1 and to it: steep potentials amplify the rounding of
positions, 1e-16 of them, by up to their second derivative, for which this leaves 1e9."""

STEEP = 100.0
"""Largest change of a force, relative to 1 and to it, over that of positions by which it is taken to change where both
motions have errors of steps: forces of steeper laws are reported where they agree with nothing that the log names."""

MOST_ERRORS = 20
"""Findings that are listed."""

Uses = dict[tuple[int, int], int]
"""Number of the sample that is used, by graph and sender."""


@dataclass(frozen=True)
class WrongEntry:
    """What is wrong in a log.

    Parameters
    ----------
    time
        When, in the scenario's time.
    agent
        Who acted.
    entry
        Number of the entry in ``run.log.uses``; None where an entry is missing, or the act itself is wrong.
    what
        What is wrong, in words.
    """

    time: float
    agent: int
    entry: int | None
    what: str

    def __str__(self) -> str:
        where = "" if self.entry is None else f" (entry {self.entry})"
        return f"t = {self.time:.9g}, agent {self.agent}{where}: {self.what}"


@dataclass(frozen=True)
class Replay:
    """What a second computation found in the log of a run.

    Parameters
    ----------
    acts, entries
        How many acts and entries were computed again.
    undecided
        Acts in which rounding leaves open what was to be used.
    wrong
        The first `MOST_ERRORS` things that are wrong, in order of time.
    """

    acts: int
    entries: int
    undecided: int
    wrong: tuple[WrongEntry, ...]

    @property
    def agrees(self) -> bool:
        """Whether nothing is wrong."""
        return not self.wrong

    def as_dict(self) -> dict[str, object]:
        """What was found, as plain data for JSON."""
        return {
            "agrees": self.agrees, "acts": self.acts, "entries": self.entries, "undecided": self.undecided,
            "wrong": [{"time": w.time, "agent": w.agent, "entry": w.entry, "what": w.what} for w in self.wrong],
        }  # fmt: skip

    def __str__(self) -> str:
        size = f"{self.acts} acts with {self.entries} entries computed again"
        open_ = f", {self.undecided} left open by rounding" if self.undecided else ""
        if self.agrees:
            return f"{size}{open_}: all as declared"
        return "\n".join([f"{size}{open_}: not as declared", *map(str, self.wrong)])


def replay(run: Run) -> Replay:
    """Compute again what agents used when they acted, and the forces that follow from that.

    The energy ledger proves that a run moves as recorded, not that agents used what they could know. Here the motion
    is computed from the logged forces, samples, arrivals, expiries and links from the declared world, and forces from
    the entries of the log, by plain code that shares with the engine the declared parts and their random numbers alone.

    Parameters
    ----------
    run
        A run with held control, whole or up to some time; stored ones have the log.

    Returns
    -------
    Replay
        What was found.

    Raises
    ------
    InvalidInput
        When it is no run, or one without a log.
    UnsupportedLaw
        When a safety filter changed the forces.

    Examples
    --------
    >>> import flocking as fk
    >>> law = fk.Law(fk.Proximity(4.0), [fk.Consensus(1.0)])
    >>> start = fk.start.box(4, side=3, speed=1, seed=0)
    >>> world = dict(control=fk.Held(0.1), information=fk.Messages(0.1, delay=0.03, loss=0.2))
    >>> fk.replay(fk.simulate(fk.Scenario(law, start, t_end=2, **world))).agrees
    True
    """
    scenario, log = logged(run)
    # Forces of a log may be too large to compute with; what they lead to then agrees with nothing.
    with Reading(), np.errstate(over="ignore", invalid="ignore"):
        return _Replaying(run, scenario, log).result()


def logged(run: Run) -> tuple[Scenario, MessageLog]:
    """The scenario and the log of a run.

    Raises
    ------
    InvalidInput
        When there is none.
    UnsupportedLaw
        When a safety filter changed the forces, or the session was changed while it went on.
    """
    if not isinstance(run, Run):
        raise InvalidInput("replay", "run", "must be a Run", run, "Read it with fk.read_run(folder).")
    scenario = run.scenario
    if run.log is None or not isinstance(scenario.control, Held):
        raise InvalidInput(
            "replay", "run", "must have a log of what agents used", f"one of the engine {run.fidelity.engine!r}",
            "The engine 'sampled' keeps one; runs stored by earlier versions have none.",
        )  # fmt: skip
    if isinstance(scenario.control, SafetyFilter):
        raise UnsupportedLaw("replay computes the forces of the law again, not those that a SafetyFilter changed.")
    if run.fidelity.changed:
        raise UnsupportedLaw("replay computes again runs of one world and law; this one was changed while it went on.")
    return scenario, run.log


class _Replaying:
    """The second computation of one run."""

    def __init__(self, run: Run, scenario: Scenario, log: MessageLog) -> None:
        self.run, self.log = run, log
        self.world = LoggedWorld(run, scenario, log)
        self.links = [links.copy() for links in self.world.first_links]
        self.undecided = 0

    def result(self) -> Replay:
        wrong = sorted([*self._acts(), *self._ticks(), *self._frames()], key=lambda w: w.time)
        return Replay(len(self.log.ticks), len(self.log.uses), self.undecided, tuple(wrong[:MOST_ERRORS]))

    def _finding(self, instant: float, agent: int, entry: int | None, what: str) -> WrongEntry:
        return WrongEntry(self.world.base + instant * NANOSECOND, agent, entry, what)

    def _frames(self) -> Iterator[WrongEntry]:
        """Frames against the motion under the logged forces."""
        run = self.run
        for k, t in enumerate(run.t):
            q, p = self.world.motion.states(float(t) - self.world.base)
            pairs = [("position", q, run.q[k])] + ([] if self.world.motion.order == 1 else [("velocity", p, run.p[k])])
            for name, again, stored in pairs:
                off = np.abs(again - stored).max(axis=1)
                bad = np.flatnonzero(~(off <= self.world.near * (1.0 + np.abs(stored).max())))
                if bad.size:
                    agent = int(bad[0])
                    yield WrongEntry(
                        float(t),
                        agent,
                        None,
                        f"its {name} in frame {k} is {off[agent]:.3g} from where the logged forces lead",
                    )
                    return

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

    def _is_known(self, key: tuple[int, int], k: int | None, instant: int) -> bool:
        """Whether an entry names a state that there was."""
        if k is None or k == AT_START or (k == PRESENT and self.world.messages is None):
            return True
        arrivals, leaders = self.world.arrivals, self.world.leaders
        if key[0] == LEADER:
            return leaders is not None and k >= 0 and leaders.taken(k) <= instant
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
        if off <= (SAME_FORCE + STEEP * self.world.motion.error) * (1.0 + float(np.abs(again).max())):
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
        messages, arrivals = world.messages, world.arrivals
        numbers = [PRESENT] * world.n
        there = [True] * world.n
        own = world.sample(agent, PRESENT, instant)
        if world.leaders is not None:
            found[LEADER, LEADER_SENDER] = world.leaders.newest(agent, instant)
        if messages is not None and arrivals is not None:
            if messages.self_known == "measured":
                found[OWN, agent] = arrivals.newest_taken(agent, instant)
                own = world.sample(agent, found[OWN, agent], instant)
            for j in range(world.n):
                if j != agent:
                    numbers[j] = arrivals.newest(agent, j, instant)
                    age = instant - arrivals.taken(j, numbers[j])
                    there[j] = messages.expires is None or age < max(1, round(messages.expires * PER_SECOND))
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
                    doubtful = sample.open or own.open or abs(inside) <= world.near * (1.0 + level)
                    if there[j] and doubtful:
                        near, undecided = (number, j) in logged, True
                    mine[j] = near
                if near and there[j]:
                    found[number, j] = numbers[j]
        return found, undecided

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
