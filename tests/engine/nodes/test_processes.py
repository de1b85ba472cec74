"""A process for each agent: the bits of runs in one, and what happens when processes end, hang or are cut off."""

import json
import math
import os
import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, suppress
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.apps.cli import main
from flocking.engine.nodes import processes
from flocking.engine.nodes.kills_and_cuts import Cut, Kill, Restart
from flocking.engine.nodes.session import NodeSession
from flocking.errors import EngineFailed, StorageError
from flocking.study.sample_files.reading import read_samples
from tests.engine.nodes.worlds import same, scenario

pytestmark = pytest.mark.nodes
ENDING = 60.0
"""Seconds within which a process that must end is seen to have ended, on a busy machine."""


def run(found, **options):
    return fk.simulate_nodes(found, progress=False, **options)


def gone(pid):
    """Whether a process has ended; one that nobody has waited for counts as ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] in "ZX"
    except FileNotFoundError:
        return True


def wait_until(condition):
    stop = time.monotonic() + ENDING
    while not condition():
        assert time.monotonic() < stop
        time.sleep(0.05)


@pytest.mark.parametrize("code", ["python", "c"])
def test_processes_give_the_bits_of_one_process(code, tmp_path):
    found = scenario(4, 2.0, predict=True)
    place = tmp_path / "run.mcap"
    seen = run(found, code=code, record=place)
    assert same(seen, run(found, code=code, processes=False))
    if code == "python":
        assert same(seen, fk.simulate(found, progress=False))
    from flocking.study.sample_files.reading import read_samples

    samples = read_samples(place)
    assert all((a == b).all() for a, b in ((samples.t, seen.t), (samples.q, seen.q), (samples.p, seen.p)))
    with pytest.raises(StorageError, match="there already"):
        run(found, processes=False, record=place)


def test_kills_restarts_and_cuts_give_the_bits_of_one_process():
    found, rng = scenario(5, 2.0), np.random.default_rng(8)
    killed = rng.choice(5, size=3, replace=False).tolist()
    faults = [Kill(int(i), float(t)) for i, t in zip(killed, rng.uniform(0.2, 1.2, 3), strict=True)]
    faults += [Restart(int(killed[0]), 1.5), Cut(next(i for i in range(5) if i not in killed), 0.4, 1.0)]
    seen = run(found, faults=faults)
    assert seen.status == "finished"
    assert same(seen, run(found, faults=faults, processes=False))
    assert not same(seen, fk.simulate(found, progress=False))
    assert seen.provenance["agents killed"] == 3
    assert seen.provenance["ticks of ended agents"] > 20


def session_of(found, patience=2.0):
    agents = processes.AgentProcesses(found)
    return NodeSession(found, agents, patience=patience), agents


def test_a_process_that_is_struck_from_outside_and_one_that_hangs_do_not_stop_the_others():
    found = scenario(4, 1.0)
    session, agents = session_of(found, patience=1.0)
    try:
        session.advance(0.3)
        os.kill(agents.processes[1].pid, signal.SIGKILL)
        agents.processes[1].wait()
        os.kill(agents.processes[2].pid, signal.SIGSTOP)
        session.advance(0.42)
        late = session.late
        assert late > 0
        held = session.motion.force[2].copy()
        assert held.any()
        assert not session.motion.force[1].any()
        os.kill(agents.processes[2].pid, signal.SIGCONT)
        wait_until(lambda: agents.ask({2: {"do": "measure", "now": 0, "number": 0, "q": [0.0], "p": [0.0]}}, 1.0))
        session.advance(1.0)
        assert session.late == late
        # Ticks at 0.3, 0.35, ..., 0.95.
        assert session.dead_ticks == 14
        assert not np.array_equal(session.motion.force[2], held)
    finally:
        session.close()
    assert all(process.poll() is not None for process in agents.processes.values())


def test_agents_end_when_the_world_is_killed_or_silent(tmp_path):
    path = fk.write_scenario(scenario(3, 1e6), tmp_path / "long.toml")
    script = (
        "import sys, flocking as fk\n"
        "from flocking.engine.nodes.processes import AgentProcesses\n"
        "from flocking.engine.nodes.session import NodeSession\n"
        "found = fk.read_scenario(sys.argv[1])\n"
        "agents = AgentProcesses(found)\n"
        "print(*(p.pid for p in agents.processes.values()), flush=True)\n"
        "NodeSession(found, agents).advance(found.t_end)\n"
    )
    world = subprocess.Popen([sys.executable, "-c", script, str(path)], stdout=subprocess.PIPE, text=True)
    try:
        pids = [int(x) for x in world.stdout.readline().split()]
        assert len(pids) == 3
        assert not any(gone(pid) for pid in pids)
    finally:
        world.kill()
        world.wait()
    wait_until(lambda: all(gone(pid) for pid in pids))


def test_an_agent_whose_world_says_nothing_ends():
    from flocking.engine.nodes.bus import Bus, free_endpoint

    place = free_endpoint()
    with Bus(listen=place):
        command = [sys.executable, "-m", "flocking.engine.nodes.agent_process", place, "none", "0", "--idle", "1"]
        assert subprocess.run(command, timeout=ENDING, check=False).returncode == 3


def test_an_interrupt_while_agents_are_told_to_end_leaves_nothing_behind(monkeypatch):
    """Otherwise Python waits at its end for the thread that hands on messages, for ever."""
    before = set(threading.enumerate())
    agents = processes.AgentProcesses(scenario(2, 0.2))
    tell, struck = agents._tell, []

    def interrupted(agent, data):
        if not struck:
            struck.append(agent)
            signal.raise_signal(signal.SIGINT)
        tell(agent, data)

    monkeypatch.setattr(agents, "_tell", interrupted)
    with pytest.raises(KeyboardInterrupt):
        agents.close()
    agents.close()
    assert [process.poll() for process in agents.processes.values()] == [0, 0]
    wait_until(lambda: not [thread for thread in set(threading.enumerate()) - before if not thread.daemon])


def test_ctrl_c_keeps_what_was_until_then(tmp_path, capsys, monkeypatch):
    """A run in real time cannot be had again."""
    file, advance = fk.write_scenario(scenario(2, 1.0), tmp_path / "two.toml"), NodeSession.advance

    def interrupted(session, to, seconds=math.inf):
        advance(session, min(to, 0.5), seconds)
        if session.time >= 0.5:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(NodeSession, "advance", interrupted)
    out, recording = tmp_path / "run", tmp_path / "run.mcap"
    assert main(["nodes", str(file), "--out", str(out), "--record", str(recording)]) == 130
    assert f"interrupted at t = 0.5: {out}, {recording} hold what was until then." in capsys.readouterr().err
    found = fk.read_run(out)
    assert found.status == "interrupted at t = 0.5"
    assert 0.4 < found.t[-1] <= 0.5
    assert read_samples(recording).t[-1] == found.t[-1]


def test_agents_that_an_interrupt_takes_from_their_owner_are_closed(monkeypatch):
    """They stand on his stack before anything is opened."""
    with ExitStack() as stack:
        agents = processes.AgentProcesses(scenario(2, 0.2), stack=stack)
    assert [process.poll() for process in agents.processes.values()] == [0, 0]


def test_processes_that_end_at_once_are_named(monkeypatch):
    monkeypatch.setattr(processes.sys, "executable", "/bin/false")
    with pytest.raises(EngineFailed, match=r"agents \[0, 1, 2\] ended before they began"):
        run(scenario(3, 1.0))


def test_the_world_listens_to_this_machine_alone():
    agents = processes.AgentProcesses(scenario(2, 1.0))
    try:
        pids = [os.getpid(), *(p.pid for p in agents.processes.values())]
        inodes = set()
        for fd in (fd for pid in pids for fd in Path(f"/proc/{pid}/fd").iterdir()):
            with suppress(FileNotFoundError):
                inodes |= set(re.findall(r"socket:\[(\d+)\]", os.readlink(fd)))
        rows = [row.split() for name in ("tcp", "tcp6", "udp", "udp6") for row in
                Path(f"/proc/net/{name}").read_text().splitlines()[1:]]  # fmt: skip
        ours = [row for row in rows if row[9] in inodes]
        # 0A is the state of a socket that listens; 0100007F is 127.0.0.1.
        listening = [row[1] for row in ours if row[3] == "0A"]
        assert listening
        assert all(place.startswith("0100007F:") for place in listening)
        assert all(row[1].startswith("0100007F:") for row in ours)
    finally:
        agents.close()


def test_real_time_keeps_the_clock_and_its_recording_is_audited(tmp_path, capsys):
    found = scenario(3, 2.0, latency=0.04)
    path = fk.write_scenario(found, tmp_path / "live.toml")
    begun = time.monotonic()
    place = tmp_path / "live.mcap"
    assert main(["nodes", str(path), "--real-time", "1.0", "--record", str(place), "--json"]) == 0
    assert time.monotonic() - begun > 1.9
    said = json.loads(capsys.readouterr().out)
    assert said["status"] == "finished"
    assert said["seconds in a second"] == 1.0
    main(["audit", str(place), "--law", str(path), "--json"])
    report = json.loads(capsys.readouterr().out)
    assert report["samples"].startswith("81 from t = 0 to 2")
    assert threading.active_count() < 50


@pytest.mark.slow
def test_twelve_agents():
    found = scenario(12, 5.0, predict=True)
    assert same(run(found), fk.simulate(found, progress=False))
    assert same(run(found, code="c"), run(found, code="c", processes=False))
