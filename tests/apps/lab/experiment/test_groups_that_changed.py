"""Agents are removed or added, and recorded moments looked at: what is done and said is of the agents meant."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.access.web_server import WebServer
from flocking.apps.lab.experiment.clock import Clock
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.live.hub import Tab
from flocking.apps.lab.live.lab import Lab
from flocking.apps.lab.live.measuring import Measuring, _numbers
from flocking.apps.lab.live.orders import Orders
from flocking.apps.lab.panels.measures import ShownVerdict
from flocking.study.claims import general_claims as general
from flocking.study.claims.claim import Claim
from flocking.study.claims.subjects import Witness
from tests.apps.lab.experiment.test_stored_runs_and_logs import Told, obey

CORNERS = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
KILL = {"kind": "kill", "agents": [0]}
ADD = {"kind": "add", "q": [0.5, 0.5], "p": [0.0, 0.0]}
KICK = {"kind": "kick", "agents": [2], "velocity": [3.0, 0.0]}


def weighted() -> fk.Scenario:
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(1.0)])
    return fk.Scenario(law, fk.State(CORNERS), t_end=5.0, bodies=fk.PointMass(masses=[1.0, 2.0, 3.0]), name="weighted")


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    made = Lab(cast(WebServer, None), weighted(), folder=tmp_path)
    made.clock.begin()
    yield made
    made.clock.close()


def masses(experiment: Experiment) -> list[float]:
    return cast("list[float]", np.asarray(experiment.scenario.agents.masses).tolist())


def test_numbers_of_agents_stay_with_them_at_a_restart_after_one_was_removed_and_another_added() -> None:
    made = Experiment(weighted())
    made.advance(0.1)
    made.apply(KILL)
    made.apply(ADD)
    assert masses(made) == [2.0, 3.0, 2.0]
    again = Lab.restarted(made)
    assert masses(again) == [1.0, 2.0, 3.0]
    assert again.state.q.tolist() == CORNERS


def test_settings_are_kept_again_once_a_removal_is_undone() -> None:
    made = Experiment(weighted())
    made.save_moment()
    made.apply(KILL)
    assert made.regrouped
    made.go_back()
    assert not made.regrouped
    made.apply({"kind": "set", "path": ["law", "terms", 1, "gain"], "value": 0.25})
    assert Lab.restarted(made).scenario.law.terms[1].gain == 0.25


def test_a_branch_from_before_a_removal_has_the_whole_group() -> None:
    made = Experiment(weighted())
    made.advance(0.1)
    made.apply(KILL)
    made.advance(0.2)
    assert not made.branch(0.05).regrouped
    assert made.branch(0.2).members == made.members == (1, 2)


@pytest.mark.parametrize(("events", "told"), [((KILL, ADD), 1), ((KICK,), 0)])
def test_a_page_is_told_where_a_run_begins_anew_without_its_settings(lab: Lab, events: Any, told: int) -> None:
    page = Told()
    lab.hub.tabs.add(cast(Tab, page))
    for event in events:
        lab.apply(event)
    lab.restart()
    lab.clock.do(lambda: None)
    assert sum(m["kind"] == "told" for m in page.messages) == told


def test_a_verdict_of_the_motion_before_names_agents_by_their_present_numbers() -> None:
    clock = Clock([Experiment(weighted())])
    clock.begin()
    measuring = Measuring(clock, lambda: None)
    try:
        claim = Claim("apart", "own", "No two agents meet.", general.all_apart)
        measuring.verdicts = [ShownVerdict(claim, "fails", "", Witness(0.0, (0, 1, 2)))]
        measuring.timeline.judge("apart", 0.0, "fails", 0.0, -1.0)
        measuring._judged_members = clock.frame.members[0]
        shown = lambda: cast("list[dict[str, Any]]", measuring.content()["claims"])[0]["agents"]  # noqa: E731
        assert shown() == [0, 1, 2]
        for event, left in ((KILL, [0, 1]), (ADD, [0, 1]), (KILL, [0])):
            clock.do(lambda now=event: clock.experiments[0].apply(now))
            clock._show()
            assert shown() == left
    finally:
        clock.close()


@pytest.mark.parametrize("event", [KILL, KICK, ADD, {"kind": "obstacle", "centre": [9.0, 0.0], "radius": 1.0}])
def test_nothing_is_done_to_the_present_at_a_place_of_a_recorded_moment(lab: Lab, event: Any) -> None:
    page = Told()
    page.looking = 0.0
    Orders(lab).obey(cast(Tab, page), {"kind": "event", "event": event})
    assert len(page.refusals) == 1
    assert "a recorded moment is shown'. Go to the present first" in page.refusals[0]
    assert lab.experiment.untouched
    assert obey(lab, kind="event", event=event).refusals == []
    assert not lab.experiment.untouched


def test_what_the_second_of_two_runs_refuses_is_done_to_none(tmp_path: Path) -> None:
    law = fk.Law(fk.Hysteresis(4.0, 0.5), [fk.Consensus(1.0)])
    lab = Lab(cast(WebServer, None), fk.Scenario(law, fk.State(CORNERS), t_end=5.0), folder=tmp_path)
    lab.clock.begin()
    try:
        lab.compare(["law", "graph", "radius"], 1.0)
        with pytest.raises(fk.InvalidInput, match="gap must be smaller than the radius, 1"):
            lab.apply({"kind": "set", "path": ["law", "graph", "gap"], "value": 2.0})
        assert [each.scenario.law.graph.gap for each in lab.clock.experiments] == [0.5, 0.5]
        assert lab.clock.experiments[0].untouched
    finally:
        lab.clock.close()


@pytest.mark.parametrize("at", [0.0, 0.5])
def test_what_an_intervention_itself_changes_is_not_counted_since_it(at: float) -> None:
    clock = Clock([made := Experiment(weighted())])
    made.advance(at)
    made.apply(KICK)
    first = clock._look()
    made.apply(KICK)
    for frame in (first, clock._look()):
        assert _numbers(frame, 0)["jumped"] == 0.0
    made.advance(at + 0.5)
    found = _numbers(clock._look(), 0)
    assert found["jumped"] == 0.0
    assert abs(found["residual"]) < 1e-6


def test_reset_opens_a_file_as_it_was_opened(tmp_path: Path) -> None:
    """A seed of a scenario is for the record: that of its draws may be another."""
    (tmp_path / "two.toml").write_text(
        "t_end = 5.0\nseed = 7\nterms = [{kind = 'consensus', gain = 1.0}]\n"
        "graph = {kind = 'proximity', radius = 3.0}\n"
        "start = {draw = 'box', n = 3, side = 2.0, speed = 1.0, seed = 2}\n"
    )
    lab = Lab(cast(WebServer, None), str(tmp_path / "two.toml"), folder=tmp_path)
    lab.clock.begin()
    try:
        first = lab.experiment.state.q
        assert obey(lab, kind="reset").refusals == []
        assert np.array_equal(lab.experiment.state.q, first)
        assert obey(lab, kind="load", name=lab.name, seed=3).refusals == []
        other = lab.experiment.state.q
        assert not np.array_equal(other, first)
        assert obey(lab, kind="reset").refusals == []
        assert np.array_equal(lab.experiment.state.q, other)
    finally:
        lab.clock.close()
