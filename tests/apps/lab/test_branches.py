"""Going on from an earlier time: the same bits as the run had then, and the run itself unchanged."""

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.experiment import experiment as experiments
from flocking.apps.lab.experiment.experiment import Experiment
from tests.apps.lab.conftest import ten

GAIN = ["law", "terms", 1, "gain"]


def disturbed() -> Experiment:
    """An experiment with moments, interventions and agents that go."""
    made = Experiment(ten())
    made.advance(0.3)
    made.save_moment()
    made.advance(0.5)
    made.apply({"kind": "set", "path": GAIN, "value": 0.4})
    made.advance(0.8)
    made.save_moment()
    made.apply({"kind": "kick", "agents": [1], "velocity": [0.5, -0.25]})
    made.advance(1.1)
    made.apply({"kind": "kill", "agents": [3]})
    made.advance(1.5)
    made.save_moment()
    made.advance(1.8)
    return made


@pytest.mark.parametrize("t", [0.0, 0.2, 0.3, 0.5, 0.7, 0.8, 1.0, 1.1, 1.4, 1.5, 1.8])
def test_a_branch_has_the_bits_of_the_run_at_that_time(t: float) -> None:
    made = disturbed()
    session, entries = made.session, list(made.log.entries)
    found = made.branch(t)
    again = Experiment(ten())
    for time, event in entries:
        if time <= t:
            again.advance(time)
            again.apply(event)
    again.advance(t)
    assert found.time == again.time == t
    assert np.array_equal(found.state.q, again.state.q)
    assert np.array_equal(found.state.p, again.state.p)
    assert np.array_equal(found.state.links, again.state.links)
    assert found.log.entries == [entry for entry in entries if entry[0] <= t]
    assert (made.session, made.time, made.log.entries) == (session, 1.8, entries)
    # Both go on by themselves.
    found.advance(2.0)
    again.advance(2.0)
    assert np.array_equal(found.state.q, again.state.q)
    assert made.time == 1.8


def test_a_branch_begins_at_the_last_moment_before(monkeypatch: pytest.MonkeyPatch) -> None:
    made = disturbed()
    began = []
    before = experiments._advance_to

    def watched(experiment, to, proceed):
        began.append(experiment.time)
        before(experiment, to, proceed)

    monkeypatch.setattr(experiments, "_advance_to", watched)
    made.branch(1.7)
    assert began == [1.5]


@pytest.mark.parametrize("t", [-0.1, 1.9, float("nan")])
def test_a_time_outside_the_run_is_refused(t: float) -> None:
    with pytest.raises(fk.InvalidInput, match=r"must lie between 0 and 1\.8"):
        disturbed().branch(t)


def test_a_branch_can_be_cancelled_and_needs_a_complete_log() -> None:
    made = disturbed()
    with pytest.raises(fk.InvalidInput, match="cancelled"):
        made.branch(1.0, lambda: False)
    made.complete = False
    with pytest.raises(fk.InvalidInput, match="log holds all events"):
        made.branch(1.0)


def test_moments_stay_few_and_the_last_two_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(experiments, "MOST_MOMENTS", 6)
    made = Experiment(ten())
    times = []
    for k in range(1, 30):
        made.advance(0.01 * k)
        made.save_moment()
        times.append(made.time)
        assert len(made._moments) <= 6
        assert [m[3] for m in made._moments[-2:]] == times[-2:]
    assert made._moments[0][3] < 0.1


def test_an_agent_is_put_at_another_place_with_the_links_of_its_graph() -> None:
    made = Experiment(ten())
    q = made.state.q.copy()
    far = [float(q[:, 0].max()) + 50.0, 0.0]
    made.apply({"kind": "place", "agent": 2, "to": far})
    assert made.state.q[2].tolist() == far
    assert not made.state.links[2].any()
    assert np.array_equal(np.delete(made.state.q, 2, axis=0), np.delete(q, 2, axis=0))
    for event in ({"agent": 10, "to": far}, {"agent": 0, "to": [1.0]}, {"agent": 0, "to": [float("nan"), 0.0]}):
        with pytest.raises(fk.InvalidInput):
            made.apply({"kind": "place", **event})
