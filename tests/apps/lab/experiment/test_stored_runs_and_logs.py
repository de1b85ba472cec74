"""While a stored run is shown the live one is not changed unseen, and saved files are what the page says they are."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import pytest

import flocking as fk
from flocking.apps.lab.access.web_server import WebServer
from flocking.apps.lab.experiment.clock import Clock
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.live.hub import Tab
from flocking.apps.lab.live.lab import Lab
from flocking.apps.lab.live.orders import Orders
from tests.apps.lab.conftest import ten
from tests.apps.lab.tabs import wait


class Told:
    """A page that collects what it is told."""

    looking: float | None = None

    def __init__(self) -> None:
        self.messages: list[Any] = []

    def tell(self, message: Any) -> None:
        self.messages.append(message)

    @property
    def refusals(self) -> list[str]:
        return [m["message"] for m in self.messages if m["kind"] == "refused"]


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    made = Lab(cast(WebServer, None), ten(), folder=tmp_path)
    made.clock.begin()
    yield made
    made.clock.close()


def obey(lab: Lab, **order: object) -> Told:
    told = Told()
    Orders(lab).obey(cast(Tab, told), dict(order))
    lab.clock.do(lambda: None)
    return told


def test_of_two_compared_runs_none_goes_on_when_the_other_has_failed() -> None:
    """The time of a page is that of both: after 1/2, when those of the first have met, that of the second stays too."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("-k/r**2", k=1.0))])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]])
    first = Experiment(fk.Scenario(law, start, t_end=10.0))
    free = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("-k/r**2", k=0.0))])
    clock = Clock([first, Experiment(fk.Scenario(free, start, t_end=10.0))], speed=4.0)
    clock.begin()
    try:
        clock.play()
        wait(lambda: bool(clock.frame.failure), "the first has failed")
        for _ in range(3):
            clock.play()
            wait(lambda: not clock.playing, "it stands still")
            clock.do(lambda: None)
        clock.step(1.0)
        clock.do(lambda: None)
        wait(lambda: not clock.running, "it stands still")
        assert clock.experiments[1].time == pytest.approx(first.time, abs=0.3)
    finally:
        clock.close()


KICK = {"kind": "kick", "agents": [0], "velocity": [1.0, 0.0]}


def test_orders_for_the_live_run_are_refused_while_a_stored_one_is_shown(lab: Lab, tmp_path: Path) -> None:
    run = fk.simulate(ten().with_(t_end=0.2, frames=3), progress=False)
    fk.write_run(run, tmp_path / "kept")
    assert obey(lab, kind="open run", name="kept").refusals == []
    for order in (
        {"kind": "play"}, {"kind": "step", "duration": 0.1}, {"kind": "event", "event": KICK}, {"kind": "restart"},
        {"kind": "set", "path": ["law", "terms", 1, "gain"], "value": 2.0}, {"kind": "branch", "t": 0.0},
    ):  # fmt: skip
        told = obey(lab, **order)
        assert len(told.refusals) == 1, order
        assert "a stored run is shown" in told.refusals[0]
    assert not lab.clock.running
    assert lab.experiment.untouched
    assert obey(lab, kind="close run").refusals == []
    assert obey(lab, kind="event", event=KICK).refusals == []
    assert not lab.experiment.untouched


def test_a_stored_run_without_frames_is_refused_and_the_live_one_stays(lab: Lab, tmp_path: Path) -> None:
    fk.simulate(ten().with_(t_end=0.1), engine="tiles", save=tmp_path / "bare", keep_frames=False, progress=False)
    told = obey(lab, kind="open run", name="bare")
    assert len(told.refusals) == 1
    assert "must hold frames" in told.refusals[0]
    assert lab.past.stored is None


def test_a_log_that_is_not_complete_is_neither_saved_nor_said_to_replay(lab: Lab, tmp_path: Path) -> None:
    obey(lab, kind="event", event=KICK)
    assert "replays the interventions" in lab.files.save_scenario()
    assert len(list(tmp_path.glob("*.events.json"))) == 1
    lab.experiment.complete = False
    note = lab.files.save_scenario()
    assert "replays" not in note
    assert "not complete" in note
    assert len(list(tmp_path.glob("*.events.json"))) == 1
    assert len(list(tmp_path.glob("*.toml"))) == 2
