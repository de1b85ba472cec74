"""The agents of a run: a process for each, or, for comparison, all in this one."""

from __future__ import annotations

import re
import secrets
import signal
import subprocess
import sys
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import cast

from flocking.engine.interruption import uninterrupted
from flocking.engine.nodes.bus import Bus, free_endpoint
from flocking.engine.nodes.exported_node import ExportedNode
from flocking.engine.nodes.nodes import Node, PythonNode
from flocking.engine.nodes.requests import Answer, Request, answer, packed, unpacked
from flocking.errors import EngineFailed
from flocking.model.law import Scenario
from flocking.model.serial import to_data

LAST_WAIT = 0.01
"""Seconds that each process is given at least before it is killed, when the others have used up the time of all."""

PATIENCE = 10.0
"""Seconds in which an agent must answer; one that does not is late."""

BEGINNING = 120.0
"""Seconds in which a process must begin: Python and a law to compile, on a busy machine."""

GLANCE = 0.05
"""Seconds after which it is looked whether a process that has not answered has ended."""

BEAT = 1.0
"""Seconds between two words to all agents, by which they know that the world goes on: a fifteenth of their patience."""

LEAVING = 5.0
"""Seconds in which a process must end by itself."""


def _said(line: str) -> None:
    """Print a line for whoever begins the agents, who may read it through a pipe."""
    print(line, flush=True)


def _sender(key: str, n: int) -> int:
    """The agent whom the end of a key names; -1 where it names none."""
    return int(key) if re.fullmatch("[0-9]{1,9}", key) and int(key) < n else -1


class Agents(ABC):
    """All agents of a run."""

    @abstractmethod
    def ask(self, requests: Mapping[int, Request], seconds: float) -> dict[int, Answer]:
        """Ask agents at once; those that have ended or do not answer in time are missing in what is found.

        Parameters
        ----------
        requests
            What to ask of each agent.
        seconds
            How long to wait.
        """

    @abstractmethod
    def ended(self, agent: int) -> bool:
        """Whether an agent has ended."""

    @abstractmethod
    def kill(self, agent: int) -> None:
        """End an agent at once."""

    @abstractmethod
    def restart(self, agent: int) -> None:
        """Begin an agent anew, which has no samples."""

    @abstractmethod
    def close(self) -> None:
        """End all agents."""


class LocalAgents(Agents):
    """All agents in this process.

    Parameters
    ----------
    scenario
        The scenario.
    library
        Exported C as a shared object; Python where it is None.
    """

    def __init__(self, scenario: Scenario, library: Path | None = None) -> None:
        def made(agent: int) -> Node:
            return PythonNode(scenario, agent) if library is None else ExportedNode(scenario, agent, library)

        self._made: Callable[[int], Node] = made
        self._nodes: dict[int, Node] = {i: made(i) for i in range(scenario.start.n)}
        for node in self._nodes.values():
            node.begin()

    def ask(self, requests: Mapping[int, Request], seconds: float) -> dict[int, Answer]:
        """Ask agents."""
        return {i: answer(self._nodes[i], request) for i, request in requests.items() if i in self._nodes}

    def ended(self, agent: int) -> bool:
        """Whether an agent was ended."""
        return agent not in self._nodes

    def kill(self, agent: int) -> None:
        """Discard an agent."""
        self._nodes.pop(agent, None)

    def restart(self, agent: int) -> None:
        """Begin an agent anew."""
        self._nodes[agent] = self._made(agent)

    def close(self) -> None:
        """Nothing is to be ended."""


class AgentProcesses(Agents):
    """A process for each agent, on this machine or elsewhere.

    Parameters
    ----------
    scenario
        The scenario, of registered parts.
    library
        Exported C as a shared object; Python where it is None.
    place
        Where to listen; a free port of this machine alone when empty.
    spawn
        Whether to begin the processes here; others are waited for, which are begun on other hosts.
    announce
        Called with a line about what to do, where processes are not begun here; printed at once when absent.
    stack
        Takes their `close` before anything is opened, so that no interrupt comes between.

    Raises
    ------
    EngineMissing
        When zenoh is not installed.
    EngineFailed
        When a process does not begin.
    """

    def __init__(
        self, scenario: Scenario, *, library: Path | None = None, place: str = "", spawn: bool = True,
        announce: Callable[[str], None] | None = None, stack: ExitStack | None = None,
    ) -> None:  # fmt: skip
        self._scenario, self._library, self._spawned = to_data(scenario), library, spawn
        self.n, self._time = scenario.start.n, scenario.start.t
        self.run = secrets.token_hex(8)
        self.place = place or free_endpoint()
        self.processes: dict[int, subprocess.Popen[bytes]] = {}
        self._ready: set[int] = set()
        self._asked = 0
        self._stopped = threading.Event()
        self._open = ExitStack()
        if stack is not None:
            stack.callback(self.close)
        self._bus = self._open.enter_context(Bus(listen=self.place))
        self._open.callback(self._end_processes)
        self._beats = threading.Thread(target=self._beat, daemon=True)
        self._beats.start()
        self._open.callback(self._beats.join)
        try:
            self._bus.subscribe(f"flocking/{self.run}/from/*")
            if not spawn:
                (announce or _said)(f"python -m flocking.engine.nodes.agent_process {self.place} {self.run} AGENT")
            for agent in range(self.n):
                self._begin(agent)
            self._gather(set(range(self.n)), begin=True)
        except BaseException:
            self.close()
            raise

    def _beat(self) -> None:
        while not self._stopped.wait(BEAT):
            self._bus.publish(f"flocking/{self.run}/all", packed({"wait": True}))

    def _begin(self, agent: int) -> None:
        if not self._spawned:
            return
        command = [sys.executable, "-m", "flocking.engine.nodes.agent_process", self.place, self.run, str(agent)]
        command += [] if self._library is None else ["--library", str(self._library)]
        # Ctrl-C is for the world, which ends its agents. A new process inherits what is blocked; without that, it would
        # print where among its imports the signal interrupted it. Here the signal only waits.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
        try:
            self.processes[agent] = subprocess.Popen(command, stdin=subprocess.DEVNULL)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def _gather(self, agents: set[int], *, begin: bool) -> None:
        """Wait until agents have stated that they are ready."""
        stop, greeted = time.monotonic() + BEGINNING, set[int]()
        while not agents <= self._ready:
            found = self._bus.next(GLANCE)
            missing = sorted(agents - self._ready)
            if any(self.ended(i) for i in missing):
                ended = [i for i in missing if self.ended(i)]
                raise EngineFailed(f"The processes of agents {ended} ended before they began.", time=self._time)
            if time.monotonic() > stop:
                raise EngineFailed(
                    f"The processes of agents {missing} did not begin within {BEGINNING:g} s.", time=self._time
                )
            if found is None:
                continue
            agent, data = _sender(found[0], self.n), unpacked(found[1])
            if "ready" in data and agent >= 0:
                self._ready.add(agent)
            elif "hello" in data and agent in agents and agent not in greeted:
                greeted.add(agent)
                self._tell(agent, {"scenario": self._scenario, "begin": begin})

    def _tell(self, agent: int, data: Mapping[str, object]) -> None:
        self._bus.publish(f"flocking/{self.run}/to/{agent}", packed(data))

    def ask(self, requests: Mapping[int, Request], seconds: float) -> dict[int, Answer]:
        """Ask agents at once."""
        self._asked += 1
        for agent, request in requests.items():
            self._tell(agent, {"id": self._asked, "request": request})
        stop, found, missing = time.monotonic() + seconds, dict[int, Answer](), set(requests)
        while missing:
            left = stop - time.monotonic()
            came = self._bus.next(min(left, GLANCE)) if left > 0.0 else None
            if came is None:
                missing -= {i for i in missing if self.ended(i)}
                if left <= 0.0:
                    break
                continue
            agent, data = _sender(came[0], self.n), unpacked(came[1])
            if "hello" in data and not self._spawned and agent >= 0:
                # Begun anew on another host: it has no samples.
                self._tell(agent, {"scenario": self._scenario, "begin": False})
            # An answer to an earlier question comes too late.
            if agent in missing and data.get("id") == self._asked:
                found[agent] = cast(Answer, data.get("answer"))
                missing.discard(agent)
        return found

    def ended(self, agent: int) -> bool:
        """Whether a process that was begun here has ended."""
        process = self.processes.get(agent)
        return process is not None and process.poll() is not None

    def kill(self, agent: int) -> None:
        """Send the signal that no process can ignore, and wait for the end."""
        process = self.processes.get(agent)
        if process is not None:
            process.kill()
            process.wait()
        self._ready.discard(agent)

    def restart(self, agent: int) -> None:
        """Begin the process of an agent anew."""
        self.kill(agent)
        self._begin(agent)
        self._gather({agent}, begin=False)

    def close(self) -> None:
        """Send all agents the end of the run; processes that do not end are killed.

        Ctrl-C waits until all is closed: Python waits at its end for a thread of the bus that is still open.
        """
        with uninterrupted():
            self._stopped.set()
            self._open.close()

    def _end_processes(self) -> None:
        for agent in range(self.n):
            self._tell(agent, {"end": True})
        stop = time.monotonic() + LEAVING
        for process in self.processes.values():
            try:
                process.wait(timeout=max(stop - time.monotonic(), LAST_WAIT))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
