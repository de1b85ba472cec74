"""The report stands alone: one file, nothing fetched; every claim beside its picture, every figure and erratum."""

from __future__ import annotations

import base64
import json
import re
from html.parser import HTMLParser

import pytest

import flocking as fk
from flocking.apps.reproduction.claim_pictures import CAPTIONS, picture_of
from flocking.apps.reproduction.reproduce import reproduce
from flocking.formula.markup.text_formulas import set_text
from flocking.papers import ALL_KEYS, paper
from flocking.show.animate import ffmpeg
from flocking.study.claims.subjects import Subject


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
        self.names: list[str] = []
        self.beside: dict[str, str] = {}
        self.shown = ""

    def handle_starttag(self, tag, attrs):
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)
        found = dict(attrs)
        self.links += [value for name, value in attrs if name in ("src", "href") and value]
        self.names += [found["id"]] if "id" in found else []
        if found.get("class") == "beside":
            self.shown = ""
        elif tag == "img":
            self.shown = found.get("src", "")
        elif tag == "article":
            self.beside[found["id"]] = self.shown

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def read(path):
    text = path.read_text(encoding="utf-8")
    tags = Tags()
    tags.feed(text)
    return text, tags


def test_certificates_stand_beside_what_the_runs_show(folder):
    out, found = folder
    text, _ = read(out / "report.html")
    for run in found.runs.values():
        for each in fk.certify(run.scenario).granted:
            assert set_text(each.statement) in text
    assert '<td data-name="kept">yes</td>' in text
    assert '<td data-name="kept">no</td>' not in text


def test_every_claim_and_erratum_is_in_the_report(folder):
    out, found = folder
    text, _ = read(out / "report.html")
    claims = json.loads((out / "claims.json").read_text(encoding="utf-8"))
    assert found.as_expected
    assert len(claims) == sum(len(j) for j in found.judgements.values()) > 15
    for row in claims:
        assert set_text(row["statement"]) in text
        assert row["seeds"]["tried"] == 5
        assert row["paper"] == "tanner-2003-fixed"
        assert row["scenario"].startswith(row["paper"])
    for row in json.loads((out / "errata.json").read_text(encoding="utf-8"))["tanner-2003-fixed"]:
        assert set_text(row["number"], letters=False) in text
        assert set_text(row["title"]) in text
        assert row["verdict"] in ("false statement", "misprint", "ambiguity or missing value")


def test_the_contents_name_all_authors_of_a_paper(folder):
    text, _ = read(folder[0] / "report.html")
    assert ">Tanner, Jadbabaie and Pappas 2003: " in text


def test_the_report_is_well_formed_and_asks_for_nothing(folder):
    out, _ = folder
    text, tags = read(out / "report.html")
    assert tags.open == []
    assert all(link.startswith(("data:", "#")) for link in tags.links)
    assert not re.search(r"(?:https?:)?//[a-z]", re.sub(r"data:[^\"]+", "", text))
    assert len(tags.names) == len(set(tags.names))
    assert {link[1:] for link in tags.links if link.startswith("#")} <= set(tags.names)
    claimed = len(list((out / "tanner-2003-fixed" / "claims").iterdir()))
    assert text.count("<figure>") == 7 + 1 + claimed


def test_every_claim_stands_beside_the_picture_of_its_subject(folder):
    out, found = folder
    _, tags = read(out / "report.html")
    for name, judgements in found.judgements.items():
        for judgement in judgements:
            file = out / "tanner-2003-fixed" / "claims" / f"{name}-{picture_of(judgement.claim)}.svg"
            drawn = base64.b64decode(tags.beside[f"{name}-claim-{judgement.claim.key}"].split(",")[1])
            assert drawn == file.read_bytes()
    collisions, speeds = (tags.beside[f"tanner-2003-fixed-claim-{key}"] for key in ("all-apart", "velocities-agree"))
    assert collisions != speeds


def test_claims_that_name_a_figure_stand_beside_it():
    module = paper("olfati-saber-2003")
    split = next(c for c in module.claims("olfati-saber-2003") if c.key == "split")
    assert picture_of(split, ["7", "8"]) == "figure-8"
    assert picture_of(split, ["7"]) == "connectivity"


def test_a_caption_names_the_seeds_of_all_runs_that_are_drawn():
    from types import SimpleNamespace

    from flocking.apps.reproduction.report import figures_of, seeds_of

    module = paper("shi-2009")
    runs = {name: SimpleNamespace(scenario=SimpleNamespace(seed=k)) for k, name in enumerate(module.scenarios())}
    numbers = [str(runs[f"shi-2009-{name}"].scenario.seed) for name in ("velocity-only", "position")]
    figures = module.figures()
    assert seeds_of(figures[7], runs) == f" Seed {numbers[0]}."
    assert seeds_of(figures[9], runs) == f" Seeds {numbers[0]} and {numbers[1]}."
    assert seeds_of(figures[1], runs) == "", "a potential shows no run"
    assert {"7", "9"} <= set(figures_of(module, "shi-2009-velocity-only"))
    assert {"8", "9"} <= set(figures_of(module, "shi-2009-position"))


def test_every_subject_has_a_picture_and_a_claim():
    spoken_of = {
        c.about.subject for key in ALL_KEYS for name in paper(key).scenarios() for c in paper(key).claims(name)
    }
    assert set(CAPTIONS) == set(Subject) == spoken_of


def test_laws_are_typeset_with_start_potential_and_all_values(folder):
    from flocking.model.typesetting.law_formulas import law_latex
    from flocking.model.typesetting.law_html import formula_html, start_words

    out, found = folder
    text, tags = read(out / "report.html")
    module = paper("tanner-2003-fixed")
    for name, run in found.runs.items():
        section = text.split(f'id="scenario-{name}"')[1].split('<details class="folds"')[0]
        assert formula_html(law_latex(run.scenario.law)) in section
        assert start_words(run.scenario) in section
        assert section.count("<math display") >= 4, "law, potential, slope and the motion of the agents"
        assert section.split("<h3>")[1].startswith(module.title_of(name))
        assert f"#scenario-{name}" in tags.links, "the contents lead to it"
    bare = re.sub(r"<annotation.*?</annotation>|<(style|script).*?</\1>|data:[^\"]+", "", text, flags=re.DOTALL)
    assert not re.search(r"[A-Za-z]\^|_\{", bare)


def test_errata_of_each_kind_are_counted_apart(folder):
    from collections import Counter

    out, found = folder
    text, _ = read(out / "report.html")
    kinds = Counter(row["verdict"] for row in found.errata["tanner-2003-fixed"])
    shown = dict(re.findall(r'<td class="count" data-name="([^"]+)">(\d+)</td>', text))
    assert shown["false statements"] == str(kinds["false statement"])
    assert shown["misprints"] == str(kinds["misprint"])
    assert shown["ambiguous or missing"] == str(kinds["ambiguity or missing value"])


def test_provenance_names_software_seeds_and_every_drawn_run(folder):
    out, found = folder
    text, _ = read(out / "report.html")
    told = text.split('id="provenance"')[1]
    for words in ("numpy", "sympy", "matplotlib", "python", "system", "written", "--seeds 5 --first-seed 0"):
        assert words in told
    for run in found.runs.values():
        assert f"<td class='count' data-name='steps'>{run.provenance['steps']}</td>" in told


def test_figures_are_written_as_svg_and_png_with_a_film(folder):
    out, _ = folder
    names = {path.name for path in (out / "tanner-2003-fixed").iterdir()}
    assert {f"figure-{k}.{kind}" for k in range(2, 9) for kind in ("svg", "png")} <= names
    assert ("film.mp4" if ffmpeg() else "film.gif") in names
    text, _ = read(out / "report.html")
    assert ("<video" in text) == bool(ffmpeg())


def test_a_film_of_another_kind_does_not_stay_behind(folder, tmp_path, monkeypatch):
    from flocking.apps.reproduction.film import film_in, write_film

    _, found = folder
    run = found.runs["tanner-2003-fixed"]
    (tmp_path / "film.mp4").write_bytes(b"old")
    monkeypatch.setattr("flocking.show.animate.ffmpeg", lambda: None)
    monkeypatch.setattr("flocking.apps.reproduction.film.SECONDS", 0.2)
    assert write_film(run, tmp_path) == film_in(tmp_path) == tmp_path / "film.gif"
    assert [path.name for path in tmp_path.iterdir()] == ["film.gif"]
    assert film_in(tmp_path / "none") is None


def test_what_is_not_as_expected_is_framed_and_what_fails_is_listed_first(folder, tmp_path):
    from dataclasses import replace

    from flocking.apps.reproduction.report import write_report
    from flocking.study.claims.claim import Verdict
    from flocking.study.claims.judgement import Judgement

    out, found = folder
    name, judged = next(iter(found.judgements.items()))
    wrong = Judgement(replace(judged[0].claim, expected=Verdict.FAILS), judged[0].results)
    changed = replace(found, judgements={**found.judgements, name: [wrong, *judged[1:]]}, figures=[])
    path = write_report(changed, {"tanner-2003-fixed": paper("tanner-2003-fixed")}, tmp_path)
    text, _ = read(path)
    assert f'unexpected" id="{name}-claim-{wrong.claim.key}"' in text
    assert "1 claim differs from" in text
    right, _ = read(out / "report.html")
    assert 'unexpected" id=' not in right
    assert (
        "Every claim with an expected verdict has the verdict that follows from its proof or counter-example" in right
    )
    top = right.split("Contents</h2>")[0]
    failing = [j.claim.statement for j in judged if j.verdict == Verdict.FAILS]
    assert failing
    assert all(set_text(statement) in top for statement in failing)
    assert set_text(judged[0].claim.statement) not in top


def _seeds_told(page):
    """What stands right before the words on seeds, without tags."""
    return re.sub(r"<[^>]*>", " ", page.split("seeds a scenario")[0])[-20:]


def test_the_summary_tells_the_fewest_and_the_most_seeds_of_a_scenario(folder):
    from dataclasses import replace

    from flocking.apps.reproduction.report import _summary
    from flocking.study.claims.judgement import Judgement

    _, found = folder
    papers = {"tanner-2003-fixed": paper("tanner-2003-fixed")}
    assert " to " not in _seeds_told(_summary(found, papers))
    assert "5" in _seeds_told(_summary(found, papers))
    name, (first, *others) = next(iter(found.judgements.items()))
    fewer = replace(found, judgements={**found.judgements, name: [Judgement(first.claim, first.results[:3]), *others]})
    assert "3 to 5" in _seeds_told(_summary(fewer, papers))


def test_too_few_seeds_are_named_as_the_reason(folder, tmp_path):
    from dataclasses import replace

    from flocking.apps.reproduction.report import write_report
    from flocking.study.claims.judgement import Judgement

    _, found = folder
    few = {name: [Judgement(j.claim, j.results[:1]) for j in judged] for name, judged in found.judgements.items()}
    modules = {"tanner-2003-fixed": paper("tanner-2003-fixed")}
    text, _ = read(write_report(replace(found, judgements=few, figures=[]), modules, tmp_path))
    assert "untested: fewer than five seeds met" in text
    assert "No claim differs from" in text
    assert 'unexpected" id=' not in text, "what is left open contradicts nothing"


def test_one_seed_that_refutes_a_proved_claim_is_framed_though_one_is_too_few(folder, tmp_path):
    from dataclasses import replace

    from flocking.apps.reproduction.report import write_report
    from flocking.study.claims.claim import Verdict
    from flocking.study.claims.judgement import Judgement

    _, found = folder
    few = {name: [Judgement(j.claim, j.results[:1]) for j in judged] for name, judged in found.judgements.items()}
    name, judged = next(iter(few.items()))
    proved = next(j for j in judged if j.has_expected and j.results[0].verdict == Verdict.HOLDS)
    refuted = Judgement(proved.claim, (replace(proved.results[0], verdict=Verdict.FAILS),))
    assert refuted.verdict == Verdict.UNTESTED
    changed = {**few, name: [refuted if j is proved else j for j in judged]}
    modules = {"tanner-2003-fixed": paper("tanner-2003-fixed")}
    text, _ = read(write_report(replace(found, judgements=changed, figures=[]), modules, tmp_path))
    assert "1 claim differs from" in text
    assert text.count('unexpected" id=') == 1
    assert f'unexpected" id="{name}-claim-{proved.claim.key}"' in text


def test_what_was_measured_is_typeset(folder):
    text, _ = read(folder[0] / "report.html")
    words = re.sub("<math.*?</math>", "", text.split("Contents</h2>")[1].split("Provenance</h2>")[0], flags=re.DOTALL)
    measured = re.findall(r'<p class="small">(?:held|margin)(.*?)</p>', words)
    assert len(measured) > 10
    assert [line for line in measured if re.search(r"[0-9]e[-+]?[0-9]|[A-Za-z]_[A-Za-z]", line)] == []


def test_a_counter_example_decides_and_further_seeds_are_drawn(folder):
    _, found = folder
    by_key = {j.claim.key: j for j in found.judgements["tanner-2003-fixed"]}
    minimal = by_key["minimal"]
    assert minimal.verdict == "fails"
    assert minimal.counterexample.verdict == "fails"
    # Most seeds are no counter-example: a universal sentence is not confirmed by them.
    assert minimal.held >= 3
    assert by_key["local-minimum"].verdict == "observed"


def test_further_seeds_are_drawn_until_five_meet_a_hypothesis(monkeypatch):
    from flocking.apps.reproduction import reproduce as reproduction
    from flocking.study.claims.claim import Verdict

    def met_by_every_third(task):
        claims = paper(task.key).claims(task.name)
        verdict = Verdict.HOLDS if task.seed % 3 == 0 else Verdict.HYPOTHESIS_NOT_MET
        return [(c.key, str(verdict), 1.0, 0.0, "") for c in claims if task.claim in ("", c.key)], None

    monkeypatch.setattr(reproduction, "examine", met_by_every_third)
    found = reproduce(["tanner-2003-dynamic"], seeds=5, first_seed=1, workers=1, progress=False)
    (judged,) = found.judgements.values()
    # Of 1 to 15 the multiples of three are five.
    assert {j.tried for j in judged} == {15}
    assert {j.met for j in judged} == {5}


def test_where_no_seed_meets_a_hypothesis_the_draw_ends(monkeypatch):
    from flocking.apps.reproduction import reproduce as reproduction

    def never_met(task):
        claims = paper(task.key).claims(task.name)
        return [(c.key, "hypothesis not met", -1.0, 0.0, "") for c in claims if task.claim in ("", c.key)], None

    monkeypatch.setattr(reproduction, "examine", never_met)
    found = reproduce(["tanner-2003-dynamic"], seeds=5, workers=1, progress=False)
    (judged,) = found.judgements.values()
    assert {j.tried for j in judged} == {5 * reproduction.FURTHER}
    assert found.untested
