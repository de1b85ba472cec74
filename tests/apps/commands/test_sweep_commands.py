"""The sweep command: what it prints, writes and answers."""

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from flocking.apps.cli import main
from flocking.study.confidence_intervals import CAVEAT

FILE = """
name = "speeds"
scenario = "tanner-2003-dynamic"
seeds = 2
measures = ["connected", "closest"]
[grid]
speed = [0.5, 1.0]
"""


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "speeds.toml"
    path.write_text(FILE)
    return path


def test_a_file_is_run_written_and_summed_up(file, tmp_path, capsys):
    assert main(["sweep", str(file), "--workers", "1"]) == 0
    shown = capsys.readouterr().out
    assert "speeds: means with 95 % intervals" in shown
    assert "4 of 4 runs, 0 failed" in shown
    folder = tmp_path / "out" / "sweeps" / "speeds"
    assert {p.name for p in folder.iterdir()} == {"results", "runs.csv", "runs.parquet", "summary.csv"}
    assert len((folder / "runs.csv").read_text().splitlines()) == 5
    before = (folder / "runs.csv").read_bytes()
    assert main(["sweep", str(file), "--workers", "1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["runs"], found["done"], found["failed"], found["status"]) == (4, 4, 0, "finished")
    assert [row["speed"] for row in found["summary"]] == [0.5, 1.0]
    assert (folder / "runs.csv").read_bytes() == before


def test_a_sweep_without_a_grid_and_one_of_drawn_points(file, tmp_path, capsys):
    file.write_text(FILE.split("[grid]")[0])
    assert main(["sweep", str(file), "--workers", "1"]) == 0
    assert "2 of 2 runs, 0 failed" in capsys.readouterr().out
    drawn = '[sample]\nmethod = "latin"\ncount = 2\nranges = {speed = {low = 0.5, high = 2.0}}\n'
    file.write_text(FILE.split("[grid]")[0].replace("speeds", "drawn") + drawn)
    assert main(["sweep", str(file), "--workers", "1"]) == 0
    lines = (tmp_path / "out" / "sweeps" / "drawn" / "summary.csv").read_text().splitlines()
    assert lines[0].startswith("speed,sample,connected,connected_low")
    assert len(lines) == 3


def test_an_interrupt_after_the_last_run_is_one(file, capsys, monkeypatch):
    def stop(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("flocking.study.sweeps.worker_pool.WorkerPool.leave", stop)
    assert main(["sweep", str(file), "--workers", "1", "--json"]) == 130
    shown = capsys.readouterr()
    assert json.loads(shown.out)["status"] == "interrupted"
    assert "interrupted; 4 of 4 runs are stored" in shown.err
    assert main(["sweep", str(file), "--workers", "1"]) == 0


def test_means_of_a_part_of_the_runs_say_so(file, capsys, monkeypatch):
    """Of a sweep that was interrupted runs that take long are rarer among those made."""
    from flocking.papers.studies import running

    whole = running.run_file
    told = "means and intervals are of the runs made so far; those that take long are more likely to be missing"
    assert main(["sweep", str(file), "--workers", "1"]) == 0
    assert told not in capsys.readouterr().out

    def part(*args, **options):
        table = whole(*args, **options)
        return dataclasses.replace(table, rows={k: table.rows[k] for k in (0, 2)}, status="interrupted")

    monkeypatch.setattr(running, "run_file", part)
    assert main(["sweep", str(file), "--workers", "1"]) == 130
    assert told in capsys.readouterr().out


def test_a_file_that_changed_is_not_mixed_with_its_earlier_results(file, capsys):
    assert main(["sweep", str(file), "--workers", "1"]) == 0
    file.write_text(FILE.replace("1.0]", "2.0]"))
    assert main(["sweep", str(file), "--workers", "1"]) == 2
    assert "plan.grid.speed: stored [0.5, 1.0], asked for [0.5, 2.0]" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["absent.toml"], "cannot be read"),
        (["tanner-conectivity"], "Did you mean 'tanner-connectivity'?"),
        (["speeds.toml", "--level", "95"], "must be below 1"),
        (["speeds.toml", "--most-runs", "3"], "must make at most 3 runs; got 4. Pass --most-runs 4 if"),
        (["speeds.toml", "--workers", "0"], "at least 1"),
        (["speeds.toml", "--out", "speeds.toml"], "speeds.toml"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(file, words, told, capsys):
    assert main(["sweep", *words]) == 2
    shown = capsys.readouterr().err
    assert told in shown
    assert "Traceback" not in shown


def test_runs_that_fail_are_counted_and_change_the_exit_code(file, capsys):
    file.write_text(FILE.replace("seeds = 2", "seeds = 1").replace('"closest"', '"following_time"'))
    assert main(["sweep", str(file), "--workers", "1"]) == 1
    shown = capsys.readouterr().out
    assert "2 failed" in shown
    assert "needs a law with a leader" in shown


def test_ctrl_c_says_what_is_kept_and_the_same_command_goes_on(file, tmp_path, capsys):
    """A terminal sends SIGINT to the workers too."""
    file.write_text(FILE.replace("seeds = 2", "seeds = 12"))
    command = [sys.executable, "-m", "flocking", "sweep", str(file), "--workers", "2"]
    running = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    rows = tmp_path / "out" / "sweeps" / "speeds" / "results" / "rows"
    deadline = time.monotonic() + 600
    while len(list(rows.glob("*.json"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.01)
    os.killpg(running.pid, signal.SIGINT)
    _, errors = running.communicate(timeout=600)
    assert running.returncode == 130, errors
    assert "of 24 runs are stored in" in errors
    assert "the same command continues" in errors
    assert "Traceback" not in errors
    kept = {path.name: path.read_bytes() for path in rows.iterdir()}
    assert len(kept) >= 2
    assert main(["sweep", str(file), "--workers", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["done"] == 24
    assert {name: (rows / name).read_bytes() for name in kept} == kept


def test_means_of_too_few_runs_say_that_they_have_no_interval(file, tmp_path, capsys):
    assert main(["sweep", str(file), "--workers", "1"]) == 0
    shown = capsys.readouterr().out
    assert "(no interval)" in shown
    assert "no 95 % interval of closest: 2 values, 8 needed" in shown
    assert main(["sweep", str(file), "--workers", "1", "--json"]) == 0
    for row in json.loads(capsys.readouterr().out)["summary"]:
        assert (row["closest_low"], row["closest_high"]) == (None, None)
        assert row["closest_interval"] == "none: 2 values, 8 needed"
        assert row["connected_interval"] == "Clopper-Pearson"
        assert 0 <= row["connected_low"] < row["connected_high"] <= 1
    head, *lines = (tmp_path / "out" / "sweeps" / "speeds" / "summary.csv").read_text().splitlines()
    assert "closest_interval" in head.split(",")
    assert all('"none: 2 values, 8 needed"' in line for line in lines)


SLOW = """
seeds = {seeds}
measures = ["convergence_time", "velocity_spread"]
[scenario]
t_end = 2
terms = [{{kind = "consensus", gain = 1.0}}]
graph = {{kind = "proximity", radius = 2.0}}
start = {{draw = "box", n = 4, side = 4.0, speed = 1.0, seed = 0}}
[grid]
"terms[0].gain" = [1.0, 2.5]
"""


def test_means_of_the_runs_that_got_there_say_so(file, tmp_path, capsys):
    file.write_text(SLOW.format(seeds=10))
    assert main(["sweep", str(file), "--workers", "1"]) == 0
    shown = capsys.readouterr().out
    lines = (tmp_path / "out" / "sweeps" / "speeds" / "runs.csv").read_text().splitlines()
    column = lines[0].split(",").index("convergence_time")
    late = [line.split(",")[column] == "nan" for line in lines[1:]]
    assert 0 < sum(late) < 20
    at_most = max(sum(late[:10]), sum(late[10:]))
    words = f"{sum(late)} of 20 have none, at one point {at_most} of 10"
    assert f"means of convergence_time are of the runs that have a value: {words}" in shown
    assert "means of velocity_spread are" not in shown


def test_intervals_of_means_stand_beside_what_they_miss(file, capsys):
    """The words of the documentation are in the table and in JSON; shares have exact intervals, and none of it."""
    text = SLOW.format(seeds=10).replace('"convergence_time"', '"connected"')
    file.write_text(text)
    assert main(["sweep", str(file), "--workers", "1"]) == 0
    shown = capsys.readouterr().out
    assert f"intervals of means of velocity_spread {CAVEAT}" in shown
    assert main(["sweep", str(file), "--workers", "1", "--json"]) == 0
    caveats = json.loads(capsys.readouterr().out)["caveats"]
    assert list(caveats) == ["velocity_spread"]
    assert CAVEAT in caveats["velocity_spread"]
    page = (Path(__file__).parents[3] / "docs" / "sweeps.md").read_text()
    for number in ("58 %", "88 %"):
        assert number in CAVEAT
        assert number in page


def test_means_without_an_interval_have_no_such_words(file, capsys):
    file.write_text(SLOW.format(seeds=3))
    assert main(["sweep", str(file), "--workers", "1"]) == 0
    assert CAVEAT not in capsys.readouterr().out


@pytest.mark.parametrize(("mean", "low", "high", "share", "shown"), [
    (0.9996, 0.99841, 0.99996, True, "0.9996"),
    (1.0, 0.9963, 1.0, True, "1"),
    (0.5, 0.18709, 0.81291, True, "0.5"),
    (100000.1, 100000.05, 100000.2, False, "100000.1"),
    (3.21e-8, 3.2001e-8, 3.2199e-8, False, "3.21e-08"),
    (-2.0, -3.0049, -1.0, False, "-2"),
    (0.0, 0.0, 0.0, False, "0"),
])  # fmt: skip
def test_means_and_their_intervals_are_told_apart_and_rounded_outwards(mean, low, high, share, shown):
    from flocking.apps.commands.sweep_commands import _cell

    text = _cell({"m": mean, "m_low": low, "m_high": high}, "m", share, True)
    middle, _, ends = text.partition(" (")
    first, last = ends.rstrip(")").split(", ")
    assert float(first) <= low
    assert float(last) >= high
    assert middle == shown
    assert float(first) == pytest.approx(low, abs=0.02 * (high - low) + 1e-300)
    assert float(last) == pytest.approx(high, abs=0.02 * (high - low) + 1e-300)
