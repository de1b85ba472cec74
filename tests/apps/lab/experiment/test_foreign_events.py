"""Logs of events, and events, that others made: refused in one sentence, or replayed with a word on how far it is."""

import re
import warnings

import pytest

from flocking.apps.lab.access.confinement import Folder
from flocking.apps.lab.experiment import experiment as room
from flocking.apps.lab.experiment.events import EventLog
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.live.openings import Openings
from flocking.engine.driver import waits
from flocking.errors import InvalidInput
from tests.apps.lab.test_experiment import disturbed, led


@pytest.mark.parametrize("name", ["end", "time"])
@pytest.mark.parametrize(
    "text", ["NaN", "Infinity", "-Infinity", "1e400", "9" * 400, "9" * 100_000, '"1"', "[]", "true", "null"]
)
def test_times_of_a_log_are_finite_numbers(tmp_path, name, text):
    """An event at an infinite time kept a replay running without end; NaN as its end left nothing to replay."""
    path = disturbed().log.write(tmp_path / "log.json")
    said = re.sub(rf'"{name}": [-+.e0-9]+', lambda _: f'"{name}": {text}', path.read_text(), count=1)
    assert said != path.read_text()
    path.write_text(said)
    with pytest.raises(InvalidInput):
        EventLog.read(path)


@pytest.mark.parametrize(
    "event",
    [
        {"kind": []}, {"kind": {}}, {"kind": None}, {"kind": "add", "q": [[0, 0]] * 9, "p": [[0, 0]] * 9},
        {"kind": "add", "n": 10**12, "seed": 1}, {"kind": "kill", "agents": [10**400]}, {"kind": "kill", "agents": "x"},
        {"kind": "kick", "agents": [0], "velocity": [[1, 2], [3]]}, {"kind": "kick", "agents": [0], "speed": 10**400},
        {"kind": "set", "path": [10**400], "value": 1}, {"kind": "set", "path": [[]], "value": 1},
        {"kind": "set", "path": "", "value": 1}, {"kind": "set", "path": ["__class__"], "value": 1},
    ],
)  # fmt: skip
def test_what_is_no_event_is_refused(event):
    made = Experiment(led())
    made.advance(0.05)
    before = made.state
    with pytest.raises(InvalidInput):
        made.apply(event)
    assert made.state.q.tobytes() == before.q.tobytes()


@pytest.mark.parametrize(
    ("event", "name"),
    [
        ({"kind": "kick", "agents": [0], "velocity": [1e308, 0]}, "velocity"),
        ({"kind": "kick", "agents": [0], "speed": 1e308, "seed": 1}, "speed"),
        ({"kind": "place", "agent": 0, "to": [0, -1e308]}, "to"),
        ({"kind": "shift", "agents": [0], "by": [1e308, 0]}, "by"),
        ({"kind": "add", "q": [1e308, 0], "p": [0, 0]}, "q"), ({"kind": "add", "q": [9, 9], "p": [0, 1e308]}, "p"),
    ],
)  # fmt: skip
def test_numbers_of_an_event_have_finite_squares(event, name):
    """They ended in warnings of NumPy, and in a sentence on a state that nobody had given."""
    made = Experiment(led())
    made.advance(0.05)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InvalidInput, match=f"lab: {name} must be"):
            made.apply(event)


@pytest.mark.parametrize("name", ["end", "time"])
def test_a_log_ends_at_times_that_an_experiment_can_reach(tmp_path, name):
    """A replay to the time 1e300 went on without end, and without a word."""
    path = disturbed().log.write(tmp_path / "log.json")
    path.write_text(re.sub(rf'"{name}": [-+.e0-9]+', f'"{name}": 1e300', path.read_text(), count=1))
    with pytest.raises(InvalidInput, match=f"lab: {name} must lie within"):
        EventLog.read(path)


def test_a_replay_says_how_far_it_is(tmp_path, monkeypatch, capsys):
    for name in ("QUIET_SECONDS", "LINE_SECONDS", "TICK_SECONDS"):
        monkeypatch.setattr(waits, name, 0.01)
    monkeypatch.setattr(room, "REPLAY_SECONDS", 0.01)
    path = disturbed().log.write(tmp_path / "log.json")
    Openings(str(path), Folder(tmp_path)).first()
    assert re.search(r"lab: replaying a log, t = [.0-9]+ of [.0-9]+, \d", capsys.readouterr().err)
