"""A film of the lab says what it does not show as it was, and a stored run what is not known of its earlier moments."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import pytest

import flocking as fk
from flocking.apps.lab.experiment.clock import Clock
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.live.messages import stored_message
from flocking.apps.lab.panels.saved_files import BEGUN_ANEW, REBUILT
from flocking.apps.lab.scene.filming import Film
from tests.apps.lab.experiment.test_stored_runs_and_logs import lab as lab
from tests.apps.lab.experiment.test_stored_runs_and_logs import obey

CORNERS = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
LEADER, GAIN = ["law", "terms", 1, "leader"], ["law", "terms", 1, "velocity_gain"]


def led() -> fk.Scenario:
    terms = [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Track(fk.Sink([2.0, 0.0]), 0.1, 0.5)]
    return fk.Scenario(fk.Law(fk.Fixed.complete(3), terms), fk.State(CORNERS), t_end=5.0, name="led")


@pytest.fixture
def filmed() -> Any:
    clock = Clock([Experiment(led())])
    film = Film(clock)
    film._done.set()
    film._thread.join()

    def after(t: float, *events: dict[str, object]) -> Film:
        for event in events:
            clock.experiments[0].apply(event)
        clock.experiments[0].advance(t)
        film._take(clock._look())
        return film

    return after


def test_a_film_says_that_a_leader_was_moved_while_it_was_recorded(filmed: Any) -> None:
    assert not filmed(0.1).rebuilt
    assert not filmed(0.2, {"kind": "set", "path": GAIN, "value": 1.0}).rebuilt
    assert filmed(0.3, {"kind": "move", "path": LEADER, "to": [5.0, 5.0]}).rebuilt


def test_a_film_says_where_it_begins_anew_and_then_nothing_of_what_is_not_in_it(filmed: Any) -> None:
    assert not filmed(0.1, {"kind": "move", "path": LEADER, "to": [5.0, 5.0]}).begun_anew
    made = filmed(0.2, {"kind": "kill", "agents": [0]})
    assert made.begun_anew
    assert not made.rebuilt
    assert [state.n for state in made._states] == [2]


def test_what_a_film_does_not_show_is_said_beside_its_name(lab: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Film, "write", lambda self, path, look: Path(f"{path}.gif"))
    for rebuilt, begun_anew in ((False, False), (True, False), (True, True)):
        lab.files.start_film()
        lab.files._film.rebuilt, lab.files._film.begun_anew = rebuilt, begun_anew
        lab.files._film._done.set()
        answer = next(m for m in obey(lab, kind="save film", color="speed").messages if m["kind"] == "answer")
        assert (REBUILT in answer["message"], BEGUN_ANEW in answer["message"]) == (rebuilt, begun_anew)


def test_a_stored_run_whose_law_was_changed_says_of_when_its_leaders_are() -> None:
    session = fk.start(led())
    session.advance(1.0)
    law = fk.Law(fk.Fixed.complete(3), [led().law.terms[0], fk.Track(fk.Sink([5.0, 5.0]), 0.1, 0.5)])
    session.replace(law=law)
    session.advance(2.0)
    assert "obstacles and leaders" in cast(str, stored_message(session.run())["note"])
    session = fk.start(led())
    session.advance(1.0)
    assert stored_message(session.run())["note"] == ""
