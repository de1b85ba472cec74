"""Settings that a page shows or takes over are those that hold."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import numpy as np

import flocking as fk
from flocking.apps.lab.access.web_server import WebServer
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.live.lab import Lab
from flocking.apps.lab.panels.controls import law_content, values_of


def own_gains() -> fk.Scenario:
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Compensate()])
    start = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    return fk.Scenario(law, start, t_end=5.0, agents=fk.PointMass(masses=[1.0, 2.0, 3.0], damping=[0.1, 0.2, 0.3]))


def factor(made: Experiment, name: str) -> float:
    shown = [
        s for section in law_content(made.scenario, made.state, made.base)["sections"] for s in section["settings"]
    ]
    told = {tuple(path): value for path, value in values_of(made.scenario, made.base)}
    found = next(s for s in shown if s["path"] == ["agents", name])
    assert found["kind"] == "factor"
    assert told["agents", name] == found["value"]
    return found["value"]


def test_the_slider_of_a_factor_shows_the_factor_that_holds() -> None:
    made = Experiment(own_gains())
    assert factor(made, "masses") == 1.0
    made.apply({"kind": "scale", "path": ["agents", "masses"], "value": 2.5})
    assert np.array_equal(made.scenario.agents.masses, [2.5, 5.0, 7.5])
    assert factor(made, "masses") == 2.5
    assert factor(made, "damping") == 1.0
    made.apply({"kind": "scale", "path": ["agents", "damping"], "value": 0.0})
    assert factor(made, "damping") == 0.0
    made.go_back()
    assert factor(made, "masses") == factor(made, "damping") == 1.0


def test_a_restart_keeps_the_settings_of_messages() -> None:
    law = fk.Law(fk.Fixed.complete(2), [fk.Consensus(1.0)])
    world = {"control": fk.Held(0.1), "information": fk.Messages(0.1, delay=0.05)}
    made = Experiment(fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=5.0, **world))
    made.advance(0.3)
    made.apply({"kind": "set", "path": ["information", "delay"], "value": 0.2})
    made.apply({"kind": "set", "path": ["information", "loss"], "value": 0.25})
    again = Lab.restarted(made)
    assert again.scenario.information.delay == 0.2
    assert again.scenario.information.loss.probability == 0.25


def test_the_second_of_two_runs_names_the_number_in_which_it_differs(tmp_path: Path) -> None:
    law = fk.Law(fk.Fixed.complete(2), [fk.Consensus(1.0), fk.Track(fk.Velocity([1.0, 0.5]), 0.1, 0.5)])
    world = {"control": fk.Held(0.1), "information": fk.Messages(0.1)}
    scenario = fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=5.0, **world)
    lab = Lab(cast(WebServer, None), scenario, folder=tmp_path)
    lab.clock.begin()
    try:
        for path, value, words in (
            (["law", "terms", 0, "gain"], 0.25, "gain = 0.25"), (["information", "loss"], 0.3, "loss = 0.3"),
            (["law", "terms", 1, "leader", "value", 1], 2.0, "value y = 2"),
        ):  # fmt: skip
            lab.compare(path, value)
            assert lab._scenario_message()["second"] == words
    finally:
        lab.clock.close()
