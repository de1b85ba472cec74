"""The report stands alone: one file, nothing fetched, every claim, figure and erratum in it."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser

import pytest

from flocking.apps.reproduction import reproduce


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("report")
    found = reproduce(["tanner-2003-fixed"], seeds=5, out=out, workers=1, progress=False)
    return out, found


class Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.links: list[str] = []

    def handle_starttag(self, tag, attrs):
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)
        self.links += [value for name, value in attrs if name in ("src", "href") and value]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_every_claim_and_erratum_is_in_the_report(folder):
    out, found = folder
    text = (out / "report.html").read_text(encoding="utf-8")
    claims = json.loads((out / "claims.json").read_text(encoding="utf-8"))
    assert found.as_expected
    assert len(claims) == sum(len(j) for j in found.judgements.values()) > 15
    for row in claims:
        assert row["statement"].replace("'", "&#x27;").replace('"', "&quot;").replace(">", "&gt;") in text
        assert row["seeds"]["tried"] == 5
        assert row["paper"] == "tanner-2003-fixed"
        assert row["scenario"].startswith(row["paper"])
    for row in json.loads((out / "errata.json").read_text(encoding="utf-8"))["tanner-2003-fixed"]:
        assert row["number"] in text
        assert row["verdict"] == "wrong"


def test_the_report_is_well_formed_and_asks_for_nothing(folder):
    out, _ = folder
    text = (out / "report.html").read_text(encoding="utf-8")
    tags = Tags()
    tags.feed(text)
    assert tags.open == []
    assert all(link.startswith(("data:", "#")) for link in tags.links)
    assert not re.search(r"(?:https?:)?//[a-z]", re.sub(r"data:[^\"]+", "", text))
    assert "<math" in text
    assert len(re.findall(r"<figure>", text)) == 8


def test_figures_are_written_as_svg_and_png_with_a_film(folder):
    out, _ = folder
    names = {path.name for path in (out / "tanner-2003-fixed").iterdir()}
    assert {f"figure-{k}.{kind}" for k in range(2, 9) for kind in ("svg", "png")} <= names
    assert "film.gif" in names


def test_what_is_not_as_expected_is_framed(folder, tmp_path):
    from dataclasses import replace

    from flocking.apps.report import write_report
    from flocking.papers import paper
    from flocking.study.audit import Judgement
    from flocking.study.claims import Verdict

    out, found = folder
    name, judged = next(iter(found.judgements.items()))
    wrong = Judgement(replace(judged[0].claim, expected=Verdict.FAILS), judged[0].results)
    changed = replace(found, judgements={**found.judgements, name: [wrong, *judged[1:]]}, figures=[])
    path = write_report(changed, {"tanner-2003-fixed": paper("tanner-2003-fixed")}, tmp_path)
    text = path.read_text(encoding="utf-8")
    assert 'class="odd"' in text
    assert "1 claims came out other than" in text
    assert 'class="odd"' not in (out / "report.html").read_text(encoding="utf-8")
