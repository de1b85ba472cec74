"""What every paper offers under the same name, and how it refuses what it does not have."""

from __future__ import annotations

from pathlib import Path

import pytest

import flocking as fk
from flocking.papers import ALL_KEYS, paper
from flocking.papers.equation_table import Fault, fault_counts
from flocking.papers.studies.shipped import STUDIES
from flocking.study.claims.claim import Origin

LAST = {
    "olfati-saber-2003": 9, "tanner-2003-fixed": 8, "tanner-2003-dynamic": 7, "zhou-2015": 14, "shi-2009": 12,
    "olfati-saber-2006": "E", "cucker-smale-2007": "C", "vicsek-1995": 3, "reynolds-1987": 2, "vasarhelyi-2018": 3,
}  # fmt: skip


@pytest.mark.parametrize("key", ALL_KEYS)
def test_a_paper_has_the_common_names(key: str) -> None:
    described, package = paper(key), getattr(fk.papers, key.replace("-", "_"))
    for name in ("scenario", "scenarios", "claims", "figure", "figures", "equations", "errata"):
        assert callable(getattr(package, name)), name
        assert getattr(package, name) == getattr(described, name), name
    assert (
        described.key, described.title, described.authors, described.year,
    ) == (package.KEY, package.TITLE, package.AUTHORS, package.YEAR)  # fmt: skip
    assert described.key == key
    for part in (described.authors, described.title, described.venue, str(described.year)):
        assert part
        assert part in described.citation


def test_a_short_citation_names_up_to_three_authors():
    shorts = {key: paper(key).short_citation for key in ALL_KEYS}
    assert shorts["olfati-saber-2003"] == "Olfati-Saber 2003"
    assert shorts["cucker-smale-2007"] == "Cucker and Smale 2007"
    assert shorts["shi-2009"] == "Shi, Wang and Chu 2009"
    assert shorts["vicsek-1995"] == "Vicsek and others 1995"


@pytest.mark.parametrize("key", ALL_KEYS)
def test_a_paper_gives_the_names_of_its_package_and_no_others(key: str) -> None:
    assert key == paper(key).system.KEY
    with pytest.raises(AttributeError, match=f"'{key}' has no attribute 'nothing'"):
        paper(key).nothing  # noqa: B018


def test_every_study_belongs_to_one_paper() -> None:
    assert sorted(name for key in ALL_KEYS for name in paper(key).studies) == sorted(STUDIES)


@pytest.mark.parametrize("key", ALL_KEYS)
def test_errata_are_the_rows_that_are_wrong(key: str) -> None:
    wrong = {f"{r.number}: {r.title}" for r in paper(key).equations() if r.fault in (Fault.FALSE, Fault.MISPRINT)}
    assert wrong == {erratum.statement for erratum in paper(key).errata()}


def test_the_readme_counts_faults_of_every_kind() -> None:
    text = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    table = text[text.index("| paper | false statements |") :].split("\n\n")[0].splitlines()[2:]
    counted = []
    for key in ALL_KEYS:
        module = paper(key)
        faults = fault_counts(module.equations())
        asked = sum(c.origin is Origin.OWN for name in module.scenarios() for c in module.claims(name))
        counted.append([faults[Fault.FALSE], faults[Fault.MISPRINT], faults[Fault.READING], faults[Fault.OWN] + asked])
    assert [[int(cell) for cell in line.split("|")[2:6]] for line in table] == counted


@pytest.mark.parametrize("key", ALL_KEYS)
def test_every_row_that_is_not_as_printed_says_why(key: str) -> None:
    silent = [r.number for r in paper(key).equations() if r.demonstration is not None and not r.reading]
    assert not silent


@pytest.mark.parametrize("key", ALL_KEYS)
@pytest.mark.parametrize("beyond", [0, 1])
def test_a_figure_the_paper_lacks_is_refused(key: str, beyond: int) -> None:
    last = LAST[key]
    number = (last + 1 if isinstance(last, int) else f"{last}0") if beyond else 0
    with pytest.raises(fk.InvalidInput, match="figure"):
        paper(key).scenario(figure=number)
    paper(key).scenario(figure=LAST[key])


def test_a_scenario_shi_lacks_is_refused() -> None:
    with pytest.raises(fk.InvalidInput, match="name"):
        fk.papers.shi_2009.scenario(name="shi-2010")


def test_the_theorems_of_one_conclusion_have_one_verdict() -> None:
    rows = {r.number: r for r in fk.papers.shi_2009.equations()}
    kept = [rows[f"Theorem {k}"] for k in (1, 2, 4, 5)]
    assert all(row.verdict()[0] is Fault.FALSE and row.reading for row in kept)
    assert rows["depth of (3)"].verdict()[0] == "not printed"
