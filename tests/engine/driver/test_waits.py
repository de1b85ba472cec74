"""Work that takes longer than two seconds says how far it is, wherever it is watched from."""

from __future__ import annotations

import io
import re
import sys
import time

import numpy as np
import pytest

import flocking as fk
from flocking.apps.cli import main
from flocking.engine.driver import waits
from flocking.engine.driver.waits import Wait, counted, stage


@pytest.fixture
def at_once(monkeypatch):
    """Every wait shows itself from the first moment on."""
    monkeypatch.setattr(waits, "QUIET_SECONDS", 0.0)
    monkeypatch.setattr(waits, "LINE_SECONDS", 0.0)


def said(capsys) -> list[str]:
    return capsys.readouterr().err.splitlines()


def test_nothing_is_said_for_two_seconds_then_a_line_and_one_every_ten_seconds(clock, capsys):
    with Wait("films", 40, unit="pictures") as wait:
        for second in range(1, 33):
            clock.now = 100.0 + second
            wait.count()
    assert said(capsys) == [
        "films: 2 of 40 pictures, about 38 s left",
        "films: 12 of 40 pictures, about 28 s left",
        "films: 22 of 40 pictures, about 18 s left",
        "films: 32 of 40 pictures, about 8 s left",
    ]


def test_pieces_are_named_and_pieces_of_pieces_are_not_counted(clock, capsys, monkeypatch):
    monkeypatch.setattr(waits, "LINE_SECONDS", 0.0)

    def judge() -> None:
        stage("reading")
        for _ in counted(("x", "y", "z"), "details"):
            clock.now += 1.0

    with Wait("audit"):
        clock.now += 3.0
        stage("reading the run")
        for _ in counted(("speed", "links"), "claims"):
            judge()
        stage("writing")
    lines = said(capsys)
    assert lines[0] == "audit: reading the run, 3 s so far"
    assert "audit: 0 of 2 claims, speed, 3 s so far" in lines
    assert "audit: 1 of 2 claims, links, 6 s so far" in lines
    assert lines[-1] == "audit: writing, 9 s so far"
    assert not any("details" in line or "reading," in line for line in lines)


def test_without_an_open_wait_pieces_are_gone_through_in_silence(clock, capsys):
    clock.now += 100.0
    stage("alone")
    assert list(counted((3, 1, 2), "numbers")) == [3, 1, 2]
    with Wait("quiet", shown=False):
        clock.now += 100.0
        stage("alone")
        assert list(counted((3, 1), "numbers")) == [3, 1]
    assert said(capsys) == []


def test_a_wait_within_a_wait_speaks_alone_and_then_gives_back(clock, capsys, monkeypatch):
    monkeypatch.setattr(waits, "LINE_SECONDS", 0.0)
    with Wait("outer") as outer:
        clock.now += 3.0
        outer.stage("one")
        with Wait("inner") as inner:
            outer.stage("two")
            clock.now += 3.0
            inner.stage("three")
        with Wait("unseen", shown=False):
            stage("four")
    assert [line.split(",")[0] for line in said(capsys)] == ["outer: one", "inner: three", "outer: four"]


def test_a_single_long_step_is_told_while_it_lasts(capsys, monkeypatch):
    monkeypatch.setattr(waits, "QUIET_SECONDS", 0.05)
    monkeypatch.setattr(waits, "TICK_SECONDS", 0.01)
    text = io.StringIO()
    monkeypatch.setattr(sys, "stderr", text)
    end = time.monotonic() + 30.0
    with Wait("check"):
        stage("one long step")
        while not text.getvalue() and time.monotonic() < end:
            time.sleep(0.01)
    assert re.fullmatch(r"check: one long step, \d s so far\n", text.getvalue())


def test_a_closed_standard_error_does_not_end_the_work(at_once, monkeypatch):
    closed = io.StringIO()
    closed.close()
    monkeypatch.setattr(sys, "stderr", closed)
    with Wait("work", 3) as wait:
        wait.count()
        wait.count()
    assert wait.done == 2


class Terminal(io.StringIO):
    """A terminal of 80 columns."""

    def isatty(self) -> bool:
        return True


def test_on_a_terminal_a_bar_stays_within_a_line_and_goes_away(at_once, monkeypatch):
    terminal, out = Terminal(), io.StringIO()
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(sys, "stdout", out)
    with Wait("reproduce", 10, unit="runs and pictures") as wait:
        wait.count(4, "a note that is far too long for what is left of a line of eighty characters, much too long")
        print("a result")
    shown = terminal.getvalue()
    assert "4 of 10" in shown
    lines = [re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", line) for line in re.split(r"[\r\n]", shown)]
    assert max(map(len, lines)) <= 80
    # Results go to standard output, whatever the bar does.
    assert out.getvalue() == "a result\n"


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)])
    scenario = fk.Scenario(law, fk.start.box(4, side=2.0, seed=1), t_end=1.0, frames=12, name="four")
    folder = tmp_path_factory.mktemp("waits") / "four"
    fk.simulate(scenario, save=folder, progress=False)
    return folder


COMMANDS = {
    "audit as a page": ("audit {run} --html {new}/page.html", "audit: 1 of "),
    "audit of samples": ("audit {new}/samples.csv --json", "audit: "),
    "certify": ("certify {new}/four.toml --json", "certify: "),
    "check": ("check 1/r+r**2 --json", "check: "),
    "plot": ("plot {run} --kind energy --out {new}/energy.png", "plot: drawing energy"),
    "export": ("export {run} --to npz --out {new}/four.npz", "export: writing npz"),
    "info": ("info {run} --json", "info: "),
    "diff": ("diff {run} {run} --json", "diff: "),
    "animate": ("animate {run} --out {new}/four.gif", "film: "),
    "animate a file": ("animate {new}/four.toml --out {new}/two.gif", "four: "),
    "run": ("run {new}/four.toml --json", "four: "),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_that_may_take_long_speaks_on_standard_error_alone(name, stored, tmp_path, capsys, at_once):
    words, line = COMMANDS[name]
    run = fk.read_run(stored)
    table = [(t, k, *run.q[f, k]) for f, t in enumerate(run.t) for k in range(run.n)]
    np.savetxt(tmp_path / "samples.csv", table, delimiter=",", header="t,id,x,y", comments="")
    fk.write_scenario(run.scenario, tmp_path / "four.toml")
    main([word.format(run=stored, new=tmp_path) for word in words.split()])
    shown = capsys.readouterr()
    assert any(text.startswith(line) for text in shown.err.splitlines()), shown.err
    assert not re.search(r"so far|of \d+ pictures", shown.out)
    if "--json" in words:
        assert shown.out.startswith("{")


def test_reproduction_and_mutants_count_their_runs(tmp_path, capsys, at_once, monkeypatch):
    from flocking.papers import mutation

    monkeypatch.setattr(mutation, "catch", lambda name: name)
    assert mutation.table(lambda: ("a", "b")) == ["a", "b"]
    assert "mutants: 1 of 2 mutants, b, 0 s so far" in said(capsys)
    from flocking.apps.reproduction import reproduce

    monkeypatch.setattr(reproduce, "examine", lambda task: ([], None))
    monkeypatch.setattr(reproduce._Found, "judgements", lambda *_: [])
    reproduce.reproduce(("tanner-2003-fixed",), seeds=1, workers=1)
    assert any(re.match(r"reproduce: 1 of \d+ runs and pictures", line) for line in said(capsys))
