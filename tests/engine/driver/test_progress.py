"""How far a run has come is told in lines where there is no terminal, and not at all for short runs."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver import notebook_line
from flocking.engine.driver.progress import Progress, stops
from flocking.engine.driver.run_progress import Progress as Runs


def scenario():
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)])
    return fk.Scenario(law, fk.start.box(4, side=2.0, seed=1), t_end=50.0, frames=6, name="four")


def test_lines_tell_time_speed_and_what_is_left(clock, capsys):
    with Progress(True, scenario()) as bar:
        bar.show(0.0, 0)
        for second in range(1, 31):
            clock.now = 100.0 + second
            bar.show(second, 1000 * second)
    said = capsys.readouterr().err.splitlines()
    assert said == [
        "four: t = 2 of 50 (4 %), 1e+03 agent-steps/s, about 48 s left",
        "four: t = 12 of 50 (24 %), 1e+03 agent-steps/s, about 38 s left",
        "four: t = 22 of 50 (44 %), 1e+03 agent-steps/s, about 28 s left",
    ]


def test_what_is_left_of_a_run_that_goes_on_counts_from_where_it_went_on(clock, capsys):
    with Progress(True, scenario()) as bar:
        bar.show(40.0, 0)
        clock.now = 110.0
        bar.show(45.0, 50)
    assert capsys.readouterr().err == "four: t = 45 of 50 (90 %), 5 agent-steps/s, about 10 s left\n"


@pytest.mark.parametrize(("wanted", "seconds"), [(True, 1.9), (False, 100.0)])
def test_short_and_unwatched_runs_say_nothing(clock, capsys, wanted, seconds):
    with Progress(wanted, scenario()) as bar:
        clock.now += seconds
        bar.show(25.0, 1000)
    assert capsys.readouterr().err == ""


def test_stops_end_at_the_end_and_include_frames_where_asked():
    made = scenario().with_(frames=[0.0, 0.123, 50.0])
    assert stops(made, 49.9, often=False) == [50.0]
    seldom, often = stops(made, 0.0, often=False), stops(made, 0.0, often=True)
    assert 0.123 not in seldom
    assert sorted({*seldom, 0.123}) == often
    assert (np.diff(often) > 0).all()


def test_below_a_cell_of_a_notebook_one_line_is_written_over(clock, monkeypatch, capsys):
    said = []

    class Handle:
        def update(self, data, raw):
            said[-1] = data["text/plain"]

    def display(data, raw, display_id):
        said.append(data["text/plain"])
        return Handle()

    monkeypatch.setattr(notebook_line, "in_notebook", lambda: True)
    monkeypatch.setattr(notebook_line, "import_module", lambda name: SimpleNamespace(display=display))
    monkeypatch.setattr(notebook_line, "time", clock)
    with Progress(True, scenario()) as bar:
        bar.show(0.0, 0)
        clock.now += 1.9
        bar.show(1.0, 10)
        assert said == []
        for second, t in ((2.0, 10.0), (0.1, 11.0), (2.0, 20.0)):
            clock.now += second
            bar.show(t, 1000)
    assert len(said) == 1
    assert said[0].startswith("four: t = 20 of 50 (40 %)")
    said.clear()
    runs = Runs(True, 10, 2)
    runs._begin = clock.now - 4.0
    with runs as bar:
        bar.advance(4, 1)
    assert said == ["runs: 6 of 10, 1 failed, about 4 s left"]
    assert capsys.readouterr().err == ""
