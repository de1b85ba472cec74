"""Agents on another host: the world and the agents in two network namespaces, which a virtual cable joins."""

import json
import os
import signal
import subprocess
import sys
import time
from shutil import which

import numpy as np
import pytest

import flocking as fk
from flocking.engine.nodes.bus import free_endpoint
from flocking.engine.nodes.kills_and_cuts import Kill
from flocking.errors import InvalidInput
from flocking.study.sample_files.reading import read_samples
from tests.engine.nodes.worlds import scenario

pytestmark = pytest.mark.nodes
ENDING = 120.0
"""Seconds within which a run that must end is seen to have ended, on a busy machine."""


def ip(*words, check=True):
    return subprocess.run(["ip", *words], check=check, capture_output=True, text=True)


class Hosts:
    """Two network namespaces and the cable between them; where none may be made, two addresses of this machine."""

    def __init__(self):
        mark = f"fk{os.getpid() % 100_000}"
        self.world, self.agents = f"{mark}w", f"{mark}a"
        self.ends = f"{mark}0", f"{mark}1"
        self.apart = which("ip") is not None and ip("netns", "add", self.world, check=False).returncode == 0
        self.place = "tcp/10.77.0.1:7447" if self.apart else free_endpoint().replace("127.0.0.1", "127.0.0.2")
        self.processes = []

    def __enter__(self):
        if not self.apart:
            return self
        ip("netns", "add", self.agents)
        ip("link", "add", self.ends[0], "type", "veth", "peer", "name", self.ends[1])
        for name, end, address in zip((self.world, self.agents), self.ends, ("10.77.0.1", "10.77.0.2"), strict=True):
            ip("link", "set", end, "netns", name)
            ip("-n", name, "addr", "add", f"{address}/24", "dev", end)
            ip("-n", name, "link", "set", end, "up")
        return self

    def __exit__(self, *_):
        for process in self.processes:
            process.kill()
            process.wait()
        if self.apart:
            for name in (self.world, self.agents):
                ip("netns", "del", name, check=False)

    def begin(self, host, *words, **options):
        within = ["ip", "netns", "exec", host] if self.apart else []
        found = subprocess.Popen([*within, sys.executable, *words], **options)
        self.processes.append(found)
        return found

    def cable(self, state, agents):
        """Pull the cable or plug it in; without one the agents are stopped, who then do not answer either."""
        if self.apart:
            ip("-n", self.agents, "link", "set", self.ends[1], state)
            return
        for agent in agents:
            agent.send_signal(signal.SIGSTOP if state == "down" else signal.SIGCONT)


def started(hosts, folder, found, *options):
    """A world that waits for agents on another host, and those agents; gives the world and what it printed."""
    path = fk.write_scenario(found, folder / "hosts.toml")
    words = ["-m", "flocking", "nodes", str(path), "--listen", hosts.place, "--no-spawn", "--json", *options]
    world = hosts.begin(hosts.world, "-u", *words, stdout=subprocess.PIPE, text=True)
    line = world.stdout.readline().split()
    assert line[:3] == ["python", "-m", "flocking.engine.nodes.agent_process"]
    assert line[3] == hosts.place
    agents = [hosts.begin(hosts.agents, *line[1:-1], str(i)) for i in range(found.start.n)]
    return world, agents, line


def test_agents_on_another_host_give_the_bits_of_one_process(tmp_path):
    found = scenario(3, 1.0)
    with Hosts() as hosts:
        world, agents, _ = started(hosts, tmp_path, found, "--record", str(tmp_path / "run.mcap"))
        said, _ = world.communicate(timeout=ENDING)
        assert json.loads(said)["status"] == "finished"
        assert [agent.wait(timeout=ENDING) for agent in agents] == [0, 0, 0]
    samples, expected = read_samples(tmp_path / "run.mcap"), fk.simulate(found, progress=False)
    assert (samples.q == expected.q).all()
    assert (samples.p == expected.p).all()


def wait_for(place):
    """Wait until a recording has begun."""
    stop = time.monotonic() + ENDING
    while not place.exists():
        assert time.monotonic() < stop
        time.sleep(0.02)


def test_a_cable_that_is_pulled_costs_answers_and_ends_nothing(tmp_path):
    found = scenario(3, 6.0, latency=0.04)
    with Hosts() as hosts:
        place = tmp_path / "run.mcap"
        world, agents, _ = started(hosts, tmp_path, found, "--real-time", "1.0", "--record", str(place))
        wait_for(place)
        time.sleep(1.0)
        hosts.cable("down", agents)
        time.sleep(1.0)
        hosts.cable("up", agents)
        about = json.loads(world.communicate(timeout=ENDING)[0])
        assert about["status"] == "finished"
        # A second of ticks and samples, three agents each.
        assert about["late answers"] > 30
        assert [agent.wait(timeout=ENDING) for agent in agents] == [0, 0, 0]
    assert read_samples(place).t[-1] == 6.0


def test_an_agent_that_is_ended_on_its_host_and_begun_anew_joins(tmp_path):
    """In lock-step the world waits for it for a while at every tick, and its velocity changes again at the end."""
    found = scenario(3, 10.0)
    with Hosts() as hosts:
        place = tmp_path / "run.mcap"
        world, agents, line = started(hosts, tmp_path, found, "--record", str(place))
        wait_for(place)
        agents[1].kill()
        agents[1].wait()
        agents[1] = hosts.begin(hosts.agents, *line[1:-1], "1")
        about = json.loads(world.communicate(timeout=ENDING)[0])
        assert about["status"] == "finished"
        assert about["late answers"] > 0
        assert [agent.wait(timeout=ENDING) for agent in agents] == [0, 0, 0]
    assert np.ptp(read_samples(place).p[-8:, 1], axis=0).max() > 0.0


def test_agents_elsewhere_are_not_killed_from_here():
    with pytest.raises(InvalidInput, match="whose processes are begun elsewhere"):
        fk.simulate_nodes(scenario(3, 1.0), spawn=False, faults=[Kill(0, 0.5)], progress=False)
