"""Every row of the equation table: its test passes, and goes red when its object is off by 1 %."""

from __future__ import annotations

import importlib

import pytest

from flocking.papers import KEYS, STANDARD_KEYS, paper
from flocking.papers.equation_table import KINDS, Demonstration, Fault, Row
from tests.papers.homes import HOMES
from tests.papers.transcriptions.rows import ROWS, examine, goes_red, identity

DEAR_ROWS = {
    "cucker-smale-2007 Theorem (beta < 1/2)",
    "olfati-saber-2006 Theorem (Algorithm 2)",
    "olfati-saber-2006 Algorithm 1",
    "olfati-saber-2006 network simulator",
    "olfati-saber-2006 metrics",
    "olfati-saber-2006 centre",
    "vicsek-1995 Fig. 2a",
}
"""Rows of standard laws that take seconds of processor time each; those of the five papers are in the default suite."""

ALONE = sorted(set(HOMES) - {row.home for row in ROWS if identity(row) not in DEAR_ROWS})
"""Checks of homes that no row of the default suite makes."""

DEAR_HOMES = {
    "flocking.papers.cucker_smale_2007.theorems.claims",
    "flocking.papers.olfati_saber_2006.closed_forms.centre_motion",
    "flocking.papers.olfati_saber_2006.theorems.claims",
}
"""Those of them that take seconds of processor time each: their rows make them in the slow tier."""

DRAWN = {"olfati_saber_2003", "shi_2009", "tanner_2003_dynamic", "tanner_2003_fixed", "zhou_2015"}
"""Packages whose figures have no check of their own: the rows look at what each of them shows."""


def by_tier(row: Row) -> object:
    return pytest.param(row, marks=pytest.mark.slow if identity(row) in DEAR_ROWS else (), id=identity(row))


@pytest.mark.parametrize("row", [by_tier(row) for row in ROWS])
def test_row(row: Row) -> None:
    """It passes for the paper's number, and goes red when that is off by one per cent; see `statement`."""
    examine(row)


@pytest.mark.parametrize("home", [home for home in ALONE if home not in DEAR_HOMES])
def test_a_home_of_no_quick_row_is_whole(home: str) -> None:
    HOMES[home]()


def test_every_home_but_figures_has_a_check() -> None:
    assert {row.home for row in ROWS} - set(HOMES) == {f"flocking.papers.{name}.pictures.figures" for name in DRAWN}
    assert set(ALONE) > DEAR_HOMES


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS, ids=identity)
def test_rows_that_judge_whole_runs_go_red(row: Row) -> None:
    goes_red(row)


@pytest.mark.parametrize("row", ROWS, ids=identity)
def test_row_is_complete(row: Row) -> None:
    assert row.kind in KINDS
    module, _, name = row.home.rpartition(".")
    while True:
        try:
            found = importlib.import_module(module)
            break
        except ModuleNotFoundError:
            module, _, outer = module.rpartition(".")
            name = f"{outer}.{name}"
    for part in name.split("."):
        found = getattr(found, part)
    verdict, shown = row.verdict()
    assert verdict is row.fault, "a demonstration that refutes nothing"
    assert (shown is not None) == (row.demonstration is not None)
    assert (verdict is not Fault.FALSE) or shown is not None


def test_numbers_are_unique_within_a_paper() -> None:
    names = [identity(row) for row in ROWS]
    assert len(names) == len(set(names))
    assert set(names) >= DEAR_ROWS


def _made(kind: str = "equation", **fields) -> Row:
    return Row("paper", "(1)", kind, "title", "home", float, **fields)


def _shown(true: float) -> Demonstration:
    return Demonstration(1.0, true, 0.1, "example")


def test_a_reading_alone_is_an_ambiguity_and_accuses_nobody() -> None:
    assert _made(reading="so").fault is Fault.READING
    assert _made().fault is Fault.NONE


def test_a_false_statement_needs_its_counter_example() -> None:
    with pytest.raises(ValueError, match="counter-example"):
        _made(reading="so", fault=Fault.FALSE)
    with pytest.raises(ValueError, match="reading"):
        _made(fault=Fault.MISPRINT)


def test_what_is_not_printed_is_a_question_of_our_own_and_has_no_fault() -> None:
    own = _made(kind="consequence", note="so")
    assert own.verdict() == (Fault.OWN, None)
    assert own.as_dict()["verdict"] == "not printed"
    for given in ({"reading": "so"}, {"demonstration": lambda: _shown(2.0)}):
        with pytest.raises(ValueError, match="not printed"):
            _made(kind="consequence", **given)
    with pytest.raises(ValueError, match="fault"):
        _made(fault=Fault.OWN, reading="so")


def test_a_note_finds_no_fault() -> None:
    assert _made(note="so").verdict() == (Fault.NONE, None)
    assert _made(note="so").as_dict()["note"] == "so"


def test_a_counter_example_that_refutes_nothing_is_no_more_than_a_reading() -> None:
    wrong = {"reading": "so", "fault": Fault.FALSE}
    assert _made(**wrong, demonstration=lambda: _shown(2.0)).verdict()[0] is Fault.FALSE
    assert _made(**wrong, demonstration=lambda: _shown(1.05)).verdict() == (Fault.READING, None)


def test_a_text_that_was_not_at_hand_is_cited_never_printed() -> None:
    for key in STANDARD_KEYS:
        verdicts = {row.verdict()[0] for row in paper(key).equations()}
        assert Fault.CITED in verdicts
        assert verdicts <= {Fault.CITED, Fault.OWN, Fault.READING}
    for key in KEYS:
        assert all(row.fault is not Fault.CITED for row in paper(key).equations())
    assert _made(fault=Fault.CITED).as_dict()["verdict"] == "as commonly cited"
    assert _made(fault=Fault.CITED, reading="so").fault is Fault.READING
