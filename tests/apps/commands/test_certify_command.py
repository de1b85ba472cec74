"""`flocking certify`: a table, JSON, and errors in one sentence."""

from __future__ import annotations

import json

from flocking.apps.cli import main


def test_a_scenario_of_a_paper_is_certified(capsys):
    assert main(["certify", "zhou-2015", "--hypotheses"]) == 0
    shown = capsys.readouterr().out
    assert "closest_approach" in shown
    assert "granted" in shown
    assert "hypothesis" in shown
    assert "Tanner, Jadbabaie, Pappas 2003" in shown


def test_json_holds_the_ends_of_every_bound(capsys):
    assert main(["certify", "zhou-2015", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    by_key = {c["key"]: c for c in found["certificates"]}
    bound = by_key["closest_approach"]["bound"]
    assert 0 < bound["lower"] <= bound["upper"] < 4
    assert by_key["decay_rate"]["outcome"] == "not applicable"
    assert by_key["decay_rate"]["bound"] is None


def test_an_unknown_scenario_is_one_sentence(capsys):
    assert main(["certify", "zhou-2051"]) == 2
    assert "flocking list" in capsys.readouterr().err
