"""info, export and diff, as a shell sees them."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

import flocking as fk
from flocking.apps.cli import main
from flocking.apps.commands.run_commands import _where_stored
from flocking.apps.commands.run_summary import facts, summary
from flocking.engine.storage.run_writer import RunWriter
from flocking.engine.storage.stored_runs import write_run
from tests.engine.storage.stored_runs import finished


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(finished(), tmp_path_factory.mktemp("runs") / "run")


def test_info(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(folder)]) == 0
    shown = capsys.readouterr().out
    assert "ten agents" in shown
    assert "finished" in shown
    assert "can be resumed" not in shown
    assert main(["info", str(folder), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["frames"], found["stored"]["frames"], found["stored"]["commits"]) == (21, 21, 1)
    assert found["stored"]["bytes"] > 10_000


def test_info_of_an_unfinished_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    RunWriter.create(tmp_path / "run", finished().scenario).close()
    assert main(["info", str(tmp_path / "run")]) == 0
    shown = capsys.readouterr().out
    assert "unfinished" in shown
    assert "flocking resume" in shown


def test_info_of_no_run_and_of_a_damaged_one(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(tmp_path)]) == 2
    assert "not a run" in capsys.readouterr().err
    write_run(finished(), tmp_path / "run")
    next(p for p in (tmp_path / "run" / "position" / "c").rglob("*") if p.is_file()).unlink()
    assert main(["info", str(tmp_path / "run")]) == 2
    assert "damaged" in capsys.readouterr().err


def test_export(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(folder), "--to", "gsd"]) == 0
    assert Path(capsys.readouterr().out.strip()) == folder.with_name("run.gsd")
    assert fk.read_start(folder.with_name("run.gsd")).q.tobytes() == finished().q[-1].tobytes()
    assert main(["export", str(folder), "--to", "csv", "--out", str(tmp_path / "table.csv")]) == 0
    assert (tmp_path / "table.csv").read_text().startswith("time,")
    assert main(["export", str(folder), "--to", "mp3"]) == 2
    assert "must be one of gsd" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--step", "--seed"])
def test_an_option_that_would_do_nothing_is_refused(
    option: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(folder), "--to", "csv", option, "1"]) == 2
    assert f"{option} must be absent for a saved run" in capsys.readouterr().err
    assert not folder.with_name("run.csv").exists()


def test_diff(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["diff", str(folder), str(folder)]) == 0
    assert "equal" in capsys.readouterr().out
    q = finished().q.copy()
    q[3, 7, 0] += 1e-12
    other = write_run(dataclasses.replace(finished(), q=q), tmp_path / "other")
    assert main(["diff", str(folder), str(other)]) == 1
    assert "position of agent 7" in capsys.readouterr().out
    assert main(["diff", str(folder), str(other), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["equal"], found["first_difference"]["agent"]) == (False, 7)
    capsys.readouterr()
    assert main(["diff", str(folder), str(other), "--tolerance", "1e-9"]) == 0
    assert capsys.readouterr().out == "The runs are equal within 1e-09.\n"
    assert main(["diff", str(folder), str(other), "--tolerance", "1e-9", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"equal": True, "tolerance": 1e-9, "first_difference": None}
    assert main(["diff", str(folder), str(tmp_path / "none")]) == 2


def test_the_name_of_the_cache_folder_is_printed_without_control_characters(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path / "a\x1b[2J\u202e"))
    assert main(["cache"]) == 0
    said = capsys.readouterr().out
    assert all(line.isprintable() for line in said.splitlines())
    assert "a\\x1b[2J\\u202e" in said


def test_times_of_a_late_run_and_shares_are_not_rounded_away() -> None:
    """Ten million agents without one are not all; a run of seconds that begins years after zero ends when it ends."""
    late = dataclasses.replace(finished(), t=finished().t + 1e9)
    late = dataclasses.replace(late, scenario=late.scenario.with_(
        start=fk.State(late.q[0], late.p[0], 1e9), t_end=1e9 + 2.0
    ))  # fmt: skip
    found = summary(late)
    assert dict(facts(found))["time reached"] == "1000000002"
    found |= {"flocks": 2, "observed": {"density": 1.0 - 1e-8}}
    assert dict(facts(found))["flocks at the end"] == "2, the largest with 99.9999 % of the agents"
    found["observed"] = {"density": 1.0}
    assert "100 %" in dict(facts(found))["flocks at the end"]


def test_a_run_that_has_only_begun_is_compared_and_drawn_in_sentences(tmp_path, capsys) -> None:
    folder = tmp_path / "run"
    RunWriter.create(folder, finished().scenario).close()
    assert main(["diff", str(folder), str(folder)]) == 0
    for kind in ("energy", "links"):
        assert main(["plot", str(folder), "--kind", kind]) == 2
    assert main(["export", str(folder), "--to", "csv"]) == 0
    said = capsys.readouterr().err
    assert "the run did not reach its end (unfinished); written without frames." in said


def test_what_is_drawn_and_written_of_a_cut_run_is_said(tmp_path, capsys) -> None:
    whole = finished()
    part = {name: getattr(whole, name)[:5] for name in ("t", "q", "p", "links")}
    cut = dataclasses.replace(whole, status="interrupted at t = 0.4", accuracy=None, **part)
    write_run(cut, tmp_path / "cut")
    for words in (["plot"], ["export", "--to", "xyz"]):
        assert main([words[0], str(tmp_path / "cut"), *words[1:]]) == 0
        assert "did not reach its end (interrupted at t = 0.4); " in (said := capsys.readouterr().err)
        assert "up to t = 0.4 of 2." in said
    write_run(whole, tmp_path / "whole")
    assert main(["plot", str(tmp_path / "whole")]) == 0
    assert "did not reach" not in capsys.readouterr().err


def test_numbers_that_are_not_known_are_null_in_json(tmp_path, capsys) -> None:
    trace = finished().trace.copy()
    trace["departed"][-1] = float("nan")
    write_run(dataclasses.replace(finished(), trace=trace), tmp_path / "run")
    assert main(["info", str(tmp_path / "run"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["ledger_residual"] is None


def test_frames_within_one_step_may_be_missing_from_what_is_stored(tmp_path: Path) -> None:
    stopped = dataclasses.replace(finished(), status="interrupted at t = 2")
    write_run(stopped.cut(20), tmp_path / "run")
    frames, last = len(stopped.t), stopped.t[19]
    said = f"holds it up to its last commit, with 20 of {frames} frames, until t = {last:.4g}; "
    assert said in _where_stored(stopped, tmp_path / "run")
    write_run(stopped, tmp_path / "whole")
    assert "holds it; " in _where_stored(stopped, tmp_path / "whole")
