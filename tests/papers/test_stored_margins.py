"""Stored tables of margins: what they hold, what they are computed from, and where they are shown."""

from html import escape

import pytest

import flocking as fk
from flocking.apps.cli import main
from flocking.apps.commands import margin_command
from flocking.apps.reproduction.report_margins import margins_table
from flocking.papers import KEYS, shi_2009
from flocking.papers.margins import VARIED
from flocking.papers.stored_margins import CONNECTED_SEEDS, PLANS, as_text, is_stored, stored_margins
from flocking.study.claims.claim import Verdict
from flocking.study.claims.general_claims import stays_connected
from flocking.study.evidence import Evidence
from flocking.study.margins.brackets import Count


def test_all_papers_have_a_plan():
    assert tuple(PLANS) == KEYS


@pytest.mark.parametrize("key", PLANS)
def test_every_paper_has_a_table_of_its_plan(key):
    assert is_stored(key)
    plan, table = PLANS[key], stored_margins(key)
    assert table.scenario == key
    assert table.status in ("finished", f"{plan.most_runs} runs did not suffice")
    assert table.runs <= plan.most_runs
    assert table.seeds == plan.chosen_seeds
    assert {one.name for one in table.varied} | set(table.refused) == set(VARIED) == set(plan.levels)
    for one in table.varied:
        assert set(plan.levels[one.name]) <= set(one.levels)
        totals = {count.total for counts in one.counts.values() for count in counts.values()}
        assert max(totals) <= len(plan.chosen_seeds)
    assert table.shown_ideally
    assert "flocking" in table.provenance


def test_a_level_of_a_stored_table_is_that_of_the_present_code():
    """Five runs at the longest period, and five ideal ones, which tell whose hypothesis is met."""
    stored = stored_margins("zhou-2015")
    again = fk.margins("zhou-2015", "period", levels={"period": [1.0]}, seeds=5, width=0.99, workers=1, progress=False)
    (theirs,) = [one for one in stored.varied if one.name == "period"]
    (ours,) = again.varied
    assert again.ideal == stored.ideal
    assert {key: counts[1.0] for key, counts in ours.counts.items()} == {
        key: counts[1.0] for key, counts in theirs.counts.items()
    }


@pytest.mark.parametrize("key", PLANS)
def test_the_report_shows_every_row_with_its_runs(key):
    table, page = stored_margins(key), margins_table(key)
    assert page.count("<tr>") == len(table.cells) + 1
    assert f"Observed on {table.runs} runs" in page
    assert "not proven" in page
    assert escape(PLANS[key].reason) in page


def test_seeds_of_shi_are_the_first_whose_graph_stays_connected():
    """Up to t = 3 six of the first 17 do; of these forces of seed 9 have not settled by the paper's end."""
    found = []
    for seed in range(max(CONNECTED_SEEDS) + 1):
        run = fk.simulate(shi_2009.scenario(seed=seed).with_(t_end=3.0, frames=31), progress=False)
        measure = stays_connected(Evidence(run))
        found += [seed] if measure.margin > 0 else []
    assert tuple(seed for seed in found if seed != 9) == CONNECTED_SEEDS
    ideal = stored_margins("shi-2009").ideal
    assert ideal["tracks"] == ideal["stationary"] == ideal["apart"] == Count(len(CONNECTED_SEEDS))
    end = fk.simulate(shi_2009.scenario(seed=9), progress=False)
    assert fk.audit(end)["stationary"].verdict != Verdict.HOLDS


def test_other_papers_have_none():
    assert margins_table("vicsek-1995") == ""
    with pytest.raises(fk.InvalidInput, match=r"must be of .*zhou-2015"):
        stored_margins("vicsek-1995")


def test_the_command_says_which_tables_are_as_stored(tmp_path, monkeypatch, capsys):
    """Computed tables stand in for runs: one as stored, one that differs."""
    from dataclasses import replace

    from flocking.papers import stored_margins as module

    whole = stored_margins("zhou-2015")
    monkeypatch.setattr(module, "PLANS", {"zhou-2015": PLANS["zhou-2015"]})
    made = [whole, replace(whole, varied=())]
    monkeypatch.setattr(module, "computed_margins", lambda key, **_: made.pop(0))
    words = ["margins", "--papers", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    assert (tmp_path / "out" / "zhou-2015" / "margins.json").read_text(encoding="utf-8") == as_text(whole)
    assert main(words) == margin_command.DIFFERENT
    shown = capsys.readouterr().out
    assert shown.splitlines()[0].startswith(f"zhou-2015: {whole.runs} runs, as stored")
    assert f"{whole.runs} runs, not as stored" in shown.splitlines()[1]
    assert main(["margins", "zhou-2015", "--papers"]) == 2
    assert main(["margins"]) == 2
