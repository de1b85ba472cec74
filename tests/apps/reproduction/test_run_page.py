"""`flocking audit RUN --html FILE`: any run gets a page of its own, from the pieces of the report."""

from __future__ import annotations

import re

import numpy as np
import pytest

import flocking as fk
from flocking.apps.reproduction.run_page import write_run_page
from flocking.model.typesetting.law_formulas import law_latex
from flocking.model.typesetting.law_html import formula_html
from flocking.study.claims.audit import Report
from tests.apps.reproduction.test_report import read


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own") / "my-run"
    law = fk.Law(fk.Hysteresis(radius=4, gap=0.3), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(0.8)])
    scenario = fk.Scenario(law, fk.start.box(5, side=2, speed=1, seed=1), t_end=2, frames=21)
    fk.simulate(scenario, save=folder)
    return folder


def test_a_users_run_gets_a_page_with_law_claims_pictures_and_provenance(stored, tmp_path, capsys):
    from flocking.apps.cli import main

    page = tmp_path / "page.html"
    assert main(["audit", str(stored), "--html", str(page)]) in (0, 1)
    assert f"The page: {page}" in capsys.readouterr().out
    text, tags = read(page)
    run = fk.read_run(stored)
    assert tags.open == []
    assert "<h1>my-run</h1>" in text
    assert formula_html(law_latex(run.scenario.law)) in text
    report = fk.audit(run)
    for result in report.results:
        assert f'id="{run.scenario.name}-claim-{result.claim.key}"' in text
        assert str(result.verdict) in text
    assert text.count("<figure>") >= 5
    assert "Certificates</h4>" in text or "Nothing is guaranteed" in text
    assert "stored run" in text
    assert run.provenance["numpy"] in text
    assert all(link.startswith(("data:", "#")) for link in tags.links)
    assert {link[1:] for link in tags.links if link.startswith("#")} <= set(tags.names)


def test_a_claim_that_the_run_leaves_open_is_not_framed_and_a_wrong_one_is(stored, tmp_path, monkeypatch):
    from dataclasses import replace

    from flocking.study.claims.claim import Verdict

    # Pictures and certificates take long and are looked at above.
    monkeypatch.setattr("flocking.apps.reproduction.run_page._draw", lambda report, folder: [])
    monkeypatch.setattr("flocking.apps.reproduction.run_page.certificates_table", lambda run: "")
    report = fk.audit(fk.read_run(stored))
    first = report.results[0]
    for verdict, framed in ((Verdict.NOT_YET, False), (Verdict.HOLDS, False), (Verdict.FAILS, True)):
        changed = Report(report.run, (replace(first, verdict=verdict), *report.results[1:]))
        text, _ = read(write_run_page(changed, tmp_path / "page.html"))
        card = re.search(rf'<article class="([^"]+)" id="[^"]*-claim-{first.claim.key}">', text).group(1)
        assert ("unexpected" in card) == framed


def test_samples_without_a_law_get_a_page_without_one(tmp_path):
    from flocking.apps.cli import main

    t, angle = np.linspace(0.0, 1.0, 21), np.array([0.0, 2.0, 4.0])
    rows = [f"{s},{i},{np.cos(a) + s},{np.sin(a)}" for s in t for i, a in enumerate(angle)]
    file, page = tmp_path / "data.csv", tmp_path / "page.html"
    file.write_text("\n".join(["t,id,x,y", *rows]) + "\n")
    assert main(["audit", str(file), "--html", str(page)]) in (0, 1)
    text, _ = read(page)
    assert "Law and start" not in text
    assert "none declared" in text
    assert "data.csv" in text


def test_a_page_that_cannot_be_written_is_one_line(stored, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("flocking.apps.reproduction.run_page._draw", lambda report, folder: [])
    from flocking.apps.cli import main

    assert main(["audit", str(stored), "--html", str(tmp_path)]) == 2
    told = capsys.readouterr().err.strip()
    assert "Traceback" not in told
    assert str(tmp_path) in told


def test_a_run_without_frames_gets_a_page_that_says_so(tmp_path, capsys):
    from flocking.apps.cli import main

    law = fk.Law(fk.Hysteresis(radius=4, gap=0.3), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(0.8)])
    scenario = fk.Scenario(law, fk.start.box(5, side=2, speed=1, seed=1), t_end=0.2, frames=3)
    fk.simulate(scenario, engine="tiles", save=tmp_path / "bare", keep_frames=False, observe=True, progress=False)
    page = tmp_path / "page.html"
    assert main(["audit", str(tmp_path / "bare"), "--html", str(page)]) in (0, 1)
    text, tags = read(page)
    assert tags.open == []
    assert "5 agents, no frames" in text
    assert "No picture could be drawn of" in text
    assert "Certificates</h4>" in text
    assert "<td class='count' data-name='switches'>not recorded</td>" in text
    capsys.readouterr()


@pytest.mark.parametrize("name", ["../../outside", "a/b", "x" * 180])
def test_pictures_of_a_run_stay_in_their_folder_and_reach_its_page_whatever_its_name_is(stored, tmp_path, name):
    from flocking.apps.reproduction.claim_pictures import draw_pictures

    run = fk.read_run(stored)
    named = fk.simulate(run.scenario.with_(name=name, t_end=0.1, frames=3), progress=False)
    inner = tmp_path / "one" / "two"
    inner.mkdir(parents=True)
    (made,) = draw_pictures(named, ("net",), inner)
    assert made.parent == inner
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [made]
    closest = tuple(result for result in fk.audit(named).results if result.claim.key == "all-apart")
    text, _ = read(write_run_page(Report(named, closest), tmp_path / "page.html"))
    assert text.count("<figure>") == 1
    assert "No picture could be drawn" not in text
