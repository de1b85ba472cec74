"""Large groups from the command line: the engine that is chosen, its options, progress, Ctrl-C and going on."""

from __future__ import annotations

import json
import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.apps import cli
from flocking.errors import StorageError
from tests.bodies import Actuated, Heavy

LARGE = """
name = "large"
t_end = 0.2
frames = 5
graph = {kind = "proximity", radius = 1.2}
terms = [{kind = "gradient", formula = "k*(r - d)**2", parameters = {k = 1, d = 1}}, {kind = "consensus"}]
start = {draw = "hexagonal", n = 2500, spacing = 0.9, noise = 0.05, speed = 1.0, seed = 1}
"""
ENDLESS = LARGE.replace("t_end = 0.2\nframes = 5", "t_end = 1e4\nframes = 1001")
PROGRESS = re.compile(r"large: .*[0-9.e+]+ agent-steps/s")
COMMAND = [sys.executable, "-m", "flocking"]


@pytest.fixture
def large(tmp_path: Path) -> Path:
    file = tmp_path / "large.toml"
    file.write_text(LARGE)
    return file


def call(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    code = cli.main([str(word) for word in words])
    shown = capsys.readouterr()
    assert "Traceback" not in shown.out + shown.err
    return code, shown.out, shown.err


def test_a_large_group_is_run_told_of_saved_and_read_again(
    large: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, text, _ = call(capsys, "run", large, "--out", tmp_path / "run", "--step", "0.01", "--threads", "2")
    assert code == 0
    assert "tiles, step 0.01 (verlet), float64, 20 steps" in text
    run = fk.read_run(tmp_path / "run")
    expected = fk.simulate(fk.read_scenario(large), engine="tiles", step=0.01, observe=True, progress=False)
    assert run.q.tobytes() == expected.q.tobytes()
    flocks, share = run.observables["flocks"][-1], run.observables["density"][-1]
    assert re.search(rf"flocks at the end +{flocks}, the largest with {100 * share:.6g} % of the agents\n", text)
    assert max(map(len, text.splitlines())) <= 100
    assert "not recorded" in text
    for command in ("info", "resume"):
        code, again, _ = call(capsys, command, tmp_path / "run")
        assert code == 0
        assert [line for line in again.splitlines() if line.startswith(("status", "flocks", "energy"))] == [
            line for line in text.splitlines() if line.startswith(("status", "flocks", "energy"))
        ]


def test_every_option_of_the_engine_is_reached(large: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--scheme", "rk4", "--precision", "float32", "--no-frames", "--memory", "0.5", "--step", "0.02")
    code, text, _ = call(capsys, "run", large, *options, "--json")
    found = json.loads(text)
    assert code == 0
    assert (found["frames"], found["time"]) == (0, 0.2)
    assert found["provenance"]["scheme"] == "rk4"
    assert found["provenance"]["precision"] == "float32"
    assert found["observed"]["flocks"] == found["flocks"]
    code, text, _ = call(capsys, "run", large, "--no-observe", "--step", "0.02", "--json")
    assert "observed" not in json.loads(text)
    assert json.loads(text)["frames"] == 5
    code, _, err = call(capsys, "run", large, "--memory", "1e-5")
    assert code == 2
    assert "neighbour lists would take" in err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--scheme", "euler"], "scheme must be one of verlet, damped, rk4"),
        (["--precision", "half"], "precision must be one of float64, float32"),
        (["--threads", "0"], "threads"),
        (["--step", "-1"], "step"),
        (["--step", "0.01", "-o", "step=0.02"], "step must be given once"),
        (["--engine", "exact", "--scheme", "rk4"], "scheme is only an option of --engine tiles"),
    ],
)
def test_wrong_options_are_refused(
    large: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    code, _, err = call(capsys, "run", large, *words)
    assert code == 2
    assert said in err


def test_the_engine_is_chosen_by_size(large: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)])
    engines = {}
    for n in (2000, 2001):
        scenario = fk.Scenario(law, fk.start.hexagonal(n, spacing=2.0, seed=1), t_end=0.01, frames=1)
        engines[n] = fk.simulate(scenario, progress=False).provenance["engine"]
    assert engines == {2000: "exact", 2001: "tiles"}
    assert fk.start(scenario.with_(agents=fk.Agents(order=1))).engine == "tiles"
    assert fk.start(scenario.with_(agents=Actuated())).engine == "tiles"
    assert fk.start(scenario.with_(agents=Heavy())).engine == "exact", (
        "what the tiled engine cannot run is left to the exact one"
    )
    large.write_text(LARGE.replace("n = 2500", "n = 30000"))
    code, _, err = call(capsys, "run", large, "--engine", "exact")
    assert code == 2
    assert "must be another one for more than 20000 agents" in err


def steps_stored(folder: Path) -> int:
    """Steps at the last commit of a run on disk; 0 where there is none yet."""
    try:
        return int(fk.read_run(folder).provenance.get("steps", 0))
    except StorageError:
        return 0


def test_ctrl_c_keeps_all_and_says_how_to_go_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = tmp_path / "endless.toml", tmp_path / "run"
    file.write_text(ENDLESS)
    command = [*COMMAND, "run", str(file), "--out", str(out), "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        limit = time.monotonic() + 600
        while steps_stored(out) == 0 and time.monotonic() < limit:
            assert process.poll() is None, process.communicate()[1]
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        text, err = process.communicate(timeout=600)
    finally:
        process.kill()
    assert process.returncode == 130, err
    assert f"{out} holds it; 'flocking resume {out}' continues it." in err
    found, stored = json.loads(text), fk.read_run(out)
    assert stored.provenance["steps"] == found["provenance"]["steps"] > 0
    code, shown, _ = call(capsys, "info", out)
    assert code == 0
    assert "yes, with 'flocking resume'" in shown


def plain(text: str) -> str:
    """Text without what moves a terminal's cursor."""
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text)


def test_progress_shows_speed_and_time_left(tmp_path: Path) -> None:
    """On a terminal: a bar with agent-steps a second, gone when the run is over."""
    file = tmp_path / "endless.toml"
    file.write_text(ENDLESS)
    master, slave = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100"}
    process = subprocess.Popen(
        [*COMMAND, "run", str(file)], stdin=slave, stdout=slave, stderr=slave, env=environment, close_fds=True
    )
    os.close(slave)
    shown = ""
    try:
        limit = time.monotonic() + 600
        while time.monotonic() < limit and not PROGRESS.search(plain(shown)):
            if select.select([master], [], [], 1.0)[0]:
                shown += os.read(master, 65536).decode(errors="replace")
        process.send_signal(signal.SIGINT)
        while process.poll() is None or select.select([master], [], [], 0.2)[0]:
            if select.select([master], [], [], 0.2)[0]:
                try:
                    shown += os.read(master, 65536).decode(errors="replace")
                except OSError:
                    break
    finally:
        process.kill()
        os.close(master)
    assert PROGRESS.search(plain(shown)), shown[-2000:]
    assert "without --out nothing is stored." in plain(shown)
    assert process.wait() == 130


def test_frames_beyond_memory_are_refused_with_the_way_out(large: Path, capsys: pytest.CaptureFixture[str]) -> None:
    large.write_text(LARGE.replace("frames = 5", "frames = 100001"))
    large.write_text(large.read_text().replace("n = 2500", "n = 25000"))
    code, _, err = call(capsys, "run", large)
    assert code == 2
    assert "--out" in err


def test_a_step_too_large_is_said_with_the_step_that_would_do(
    large: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stiff = LARGE.replace("k = 1,", "k = 3000,").replace("t_end = 0.2", "t_end = 2")
    large.write_text(stiff)
    code, text, err = call(capsys, "run", large, "--step", "0.05", "--out", tmp_path / "run", "--json")
    assert code == 1
    assert "is too large" in err
    found = re.search(r"A step of ([0-9.e-]+) would do", err)
    assert found
    assert json.loads(text)["status"].startswith("The time step 0.05 is too large")
    assert fk.read_run(tmp_path / "run").status == json.loads(text)["status"]
    assert np.isfinite(fk.read_run(tmp_path / "run").q).all()
