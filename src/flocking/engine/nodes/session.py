"""The process of the world: it moves the bodies, requests samples and forces of the agents, and forwards messages."""

from __future__ import annotations

import dataclasses
import time as clock
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array, Indices
from flocking.engine.imperfect.messages.knowledge import Knowledge, Known
from flocking.engine.imperfect.session import ImperfectSession
from flocking.engine.nodes.kills_and_cuts import Cut, Fault, Kill, Restart, check_faults, in_order
from flocking.engine.nodes.nodes import START
from flocking.engine.nodes.processes import PATIENCE, Agents
from flocking.engine.nodes.recording import Recording
from flocking.engine.nodes.requests import Answer, Request, sample_of, well_formed
from flocking.engine.protocol.body_chains import is_integrated
from flocking.engine.protocol.session import Session
from flocking.engine.runs.fidelity import Fidelity
from flocking.engine.sampled.engine import ENGINE as SAMPLED
from flocking.engine.sampled.safety import filter_counts
from flocking.engine.sampled.session import SampledSession
from flocking.errors import InvalidInput, SimulationError, UnsupportedLaw, said
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.world.control import Held
from flocking.model.world.information import Information, Messages
from flocking.model.world.times import NANOSECOND, PER_SECOND, Instants


class HeardKnowledge(Knowledge):
    """What agents know, where samples that were never sent or not let through count as lost.

    Attributes
    ----------
    unsent
        Agents and numbers of samples that nobody sent.
    cuts
        Agents, and from when until when samples do not pass to or from them, in nanoseconds.
    """

    unsent: set[tuple[int, int]]
    cuts: list[tuple[int, int, int]]

    def _lost(
        self, messages: Messages, sender: NDArray[np.int64], receiver: NDArray[np.int64], k: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        found = super()._lost(messages, sender, receiver, k).copy()
        if self.unsent:
            found |= np.array([(int(j), int(n)) in self.unsent for j, n in zip(sender, k, strict=True)], dtype=bool)
        begun = self.begun(sender, k)
        for agent, first, last in self.cuts:
            found |= ((sender == agent) | (receiver == agent)) & (begun >= first) & (begun < last)
        return found


def check_nodes(scenario: Scenario, *, real_time: float | None, exported: bool) -> None:
    """Refuse by name what agents cannot run by themselves.

    Parameters
    ----------
    scenario
        The scenario.
    real_time
        Seconds of the scenario in a second; None for lock-step.
    exported
        Whether agents run exported C.

    Raises
    ------
    UnsupportedLaw, InvalidInput
        When there is such a part, or a number is out of range.
    """
    if not isinstance(scenario.control, Held):
        raise UnsupportedLaw("Processes of agents need control=Held(...): they act at ticks, not at every moment.")
    SAMPLED.check(scenario)
    SAMPLED.check_space(scenario)
    if is_integrated(scenario):
        raise UnsupportedLaw(
            "The process of the world moves bodies in closed form between two ticks, which "
            f"{scenario.agents.summary} do not, nor those that look along their headings. A run in one process does, "
            "by engine='sampled'."
        )
    if exported and scenario.start.links is not None:
        raise UnsupportedLaw(
            "Exported C begins with the links of its graph: a start with links of its own is for Python agents."
        )
    if real_time is not None:
        if not (np.isfinite(real_time) and real_time > 0.0):
            raise InvalidInput("nodes", "real_time", "must be a positive number of seconds in a second", real_time)
        if not np.all(np.asarray(scenario.control.latency) > 0.0):
            raise InvalidInput(
                "nodes", "real_time", "must be absent for control without latency, of all or of one agent", real_time,
                "In real time the latency is the time in which an agent must answer: "
                "control=Held(period=0.05, latency=0.02).",
            )  # fmt: skip


class NodeSession(SampledSession):
    """A run in which agents compute their samples and forces by themselves.

    An agent whose process has ended exerts no force from its next tick on, and sends nothing. One that does not answer
    in time exerts the force that it exerted before, and its sample is not sent.

    Parameters
    ----------
    scenario
        The scenario, which `check_nodes` lets pass.
    agents
        The agents.
    faults
        What happens to them.
    real_time
        Seconds of the scenario in a second; None for lock-step, in which the world waits for every agent. All must then
        answer within the shortest latency of one of them.
    patience
        Seconds in which an agent must answer in lock-step.
    recording
        Takes every frame and every sample, while the run goes on.
    """

    engine = "nodes"

    def __init__(
        self, scenario: Scenario, agents: Agents, *, faults: Sequence[Fault] = (), real_time: float | None = None,
        patience: float = PATIENCE, recording: Recording | None = None,
    ) -> None:  # fmt: skip
        if isinstance(scenario.information, Messages) and scenario.information.leader:
            raise UnsupportedLaw("Processes of agents know leaders exactly: leave leader=True of Messages out.")
        check_faults(tuple(faults), scenario.start.n, scenario.t_end - scenario.start.t)
        self.recording = recording
        super().__init__(scenario)
        start = scenario.start
        # Agents filter their forces themselves; here it is only counted what they did.
        self._by_agents, self.filter = self.filter, None
        self.agents, self.patience, self._speed = agents, patience, real_time
        sent = start.p if scenario.agents.order > 1 else np.zeros_like(start.p)
        self._heard = HeardKnowledge(scenario.information, start.q, sent, self.links, scenario.space)
        self.knowledge, self._heard.unsent = self._heard, set()
        cuts = [f for f in faults if isinstance(f, Cut)]
        self._heard.cuts = [(f.agent, round(f.time * PER_SECOND), round(f.until * PER_SECOND)) for f in cuts]
        self._coming = in_order(faults)
        self._announced = np.full((self.n, self.n), START, dtype=np.int64)
        self.killed, self.restarted, self.late = 0, 0, 0
        self.dead_ticks = 0
        """Ticks of agents whose process had ended."""
        self.behind = 0.0
        """Largest time by which the world was late, in seconds; 0 in lock-step."""
        self._begun: float | None = None

    # Time.

    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Not possible: every process has the law that it was started with."""
        ImperfectSession.replace(self, law=law, state=state)

    def replace_information(self, information: Information) -> None:
        """Not possible: every process sends as configured at the start."""
        Session.replace_information(self, information)

    def _change(self) -> None:
        """What falls on an instant, after what happens to agents until then."""
        seconds = self._instant * NANOSECOND
        if self._speed is not None:
            self._begun = clock.monotonic() if self._begun is None else self._begun
            ahead = self._begun + seconds / self._speed - clock.monotonic()
            if ahead > 0.0:
                clock.sleep(ahead)
            self.behind = max(self.behind, -ahead)
        self._strike(self._instant)
        super()._change()

    def advance(self, to: float, seconds: float = np.inf) -> None:
        """Go on until time ``to``, or for ``seconds`` of wall time."""
        super().advance(to, seconds)
        if self.time >= self.scenario.t_end:
            # What happens to agents after the last instant of the run.
            self._strike(round((self.scenario.t_end - self._base) * PER_SECOND))

    def _strike(self, instant: int) -> None:
        """What happens to agents until an instant."""
        while self._coming and round(self._coming[0].time * PER_SECOND) <= instant:
            fault = self._coming.pop(0)
            if isinstance(fault, Kill):
                self.agents.kill(fault.agent)
                self.killed += 1
            elif isinstance(fault, Restart):
                self.agents.restart(fault.agent)
                self.restarted += 1
                # What is sent to it again is what arrives from now on.

    def _answers(self, requests: dict[int, Request]) -> dict[int, Answer]:
        """Ask the agents that there are; answers that do not come in time are counted."""
        asked = {i: request for i, request in requests.items() if not self.agents.ended(i)}
        found = self.agents.ask(asked, self._patience)
        self.late += sum(1 for i in asked if i not in found and not self.agents.ended(i))
        sizes = self.m, self.n, len(self.scenario.law.graphs)
        for i, answer in found.items():
            if not well_formed(answer, i, asked[i], sizes):
                raise SimulationError(
                    f"Agent {i} gave another answer than was requested: {said(answer)}.",
                    time=self.time, agents=(i,),
                )  # fmt: skip
            if "fault" in answer:
                raise SimulationError(f"Agent {i} has no force: {answer['fault']}", time=self.time, agents=(i,))
        return found

    @property
    def _patience(self) -> float:
        if self._speed is None:
            return self.patience
        return int(self._latency.min()) * NANOSECOND / self._speed

    # What agents send.

    def _measure(self, measuring: Indices, seconds: float) -> None:
        """Let agents take samples, and keep what they send."""
        numbers = self.knowledge.taken[measuring].copy()
        super()._measure(measuring, seconds)
        rows, m = self.knowledge.samples.of(measuring, numbers), self.m
        requests = {
            int(i): Request(do="measure", now=self._instant, number=int(k), q=row[:m].tolist(), p=row[m:].tolist())
            for i, k, row in zip(measuring, numbers, rows, strict=True)
        }
        found = self._answers(requests)
        for place, (i, k) in enumerate(zip(measuring.tolist(), numbers.tolist(), strict=True)):
            if i not in found:
                self._heard.unsent.add((i, k))
                continue
            sample = sample_of(found[i]["sample"])
            if self.recording is not None:
                self.recording.sample(sample)
            rows[place] = [*sample.q, *sample.p]
        self.knowledge.samples.put(measuring, numbers, rows, None)

    def _desired(
        self, instant: int, known: Known, pairs: tuple[Indices, Indices, Indices], leaders: Instants | None
    ) -> Array:
        """Forces that agents answer with, shape (agents, m)."""
        acting = known.agents
        requests = {int(i): self._request(row, int(i), known) for row, i in enumerate(acting)}
        found = self._answers(requests)
        force = np.zeros((len(acting), self.m))
        for row, i in enumerate(acting.tolist()):
            if i in found:
                force[row] = found[i]["force"]
                self._count(instant, *found[i]["filtered"])
                for graph, linked in enumerate(found[i]["links"]):
                    self.knowledge.links[graph, i] = False
                    self.knowledge.links[graph, i, linked] = True
            elif self.agents.ended(i):
                self.dead_ticks += 1
            else:
                force[row] = self._last_force(i)
        return force

    def _count(self, instant: int, changed: bool, relaxed: bool) -> None:
        """Count what the safety filter of an agent did."""
        if self._by_agents is not None:
            memory = self._by_agents.memory
            memory.changed, memory.relaxed = memory.changed + changed, memory.relaxed + relaxed
            if relaxed and memory.first_relaxed < 0:
                memory.first_relaxed = instant

    def _last_force(self, agent: int) -> Array:
        """The last desired force of an agent."""
        for _, agents, force in reversed(self.waiting):
            if agent in agents:
                return np.asarray(force[agents.tolist().index(agent)])
        return np.asarray(self.desired[agent])

    def _request(self, row: int, agent: int, known: Known) -> Request:
        m = self.m
        own = known.own[row]
        heard: list[list[object]] = []
        knowledge = self.knowledge
        if knowledge.messages is None:
            # Everyone knows the present of everyone.
            rows, tick = known.rows[row], int(self.ticked[agent])
            heard = [
                [j, tick, self._instant, rows[j, :m].tolist(), rows[j, m:].tolist()]
                for j in range(self.n)
                if j != agent
            ]
        else:
            newest: Instants = knowledge.newest[agent]
            for j in np.flatnonzero(newest > self._announced[agent]).tolist():
                if j != agent:
                    stamp = int(knowledge.begun(np.array([j]), newest[[j]])[0])
                    sample = known.rows[row, j]
                    heard.append([j, int(newest[j]), stamp, sample[:m].tolist(), sample[m:].tolist()])
            self._announced[agent] = newest
        return Request(do="act", now=self._instant, q=own[:m].tolist(), p=own[m:].tolist(), heard=heard)

    def _record_frames(self, until: float) -> None:
        before = self.records.count
        super()._record_frames(until)
        if self.recording is not None:
            moving = self.scenario.agents.order > 1
            for k in range(before, self.records.count):
                p = self.records.p[k] if moving else None
                self.recording.frame(self.records.t[k], self.records.q[k], p, start=self._base)

    # What others ask.

    @property
    def fidelity(self) -> Fidelity:
        """As of the engine, and whether something happened to agents, which the scenario does not state."""
        happened = self.killed or self.restarted or self.late or self._heard.cuts
        found = super().fidelity
        return dataclasses.replace(found, changed=found.changed or bool(happened))

    @property
    def about(self) -> dict[str, object]:
        """Where the results come from, and what happened to agents."""
        found = (
            super().about
            | filter_counts(self._by_agents, self._base)
            | {"agents killed": self.killed, "agents restarted": self.restarted}
        )
        found |= {"late answers": self.late, "ticks of ended agents": self.dead_ticks}
        found |= {"radio cut": [f"agent {a}, {b * NANOSECOND:g} to {c * NANOSECOND:g}" for a, b, c in self._heard.cuts]}
        if self._speed is not None:
            found |= {"seconds in a second": self._speed, "largest lateness of the world": self.behind}
        return found

    def close(self) -> None:
        """End the agents."""
        self.agents.close()
