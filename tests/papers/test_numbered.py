"""Every numbered statement of the papers' texts has a row, and every row with such a number is one of them."""

from __future__ import annotations

import re

import pytest

from flocking.papers import KEYS, paper
from flocking.papers.description import Paper
from flocking.papers.numbered import NUMBERED, index

COUNTS = {"olfati-saber-2003": 99, "tanner-2003-fixed": 26, "tanner-2003-dynamic": 33, "shi-2009": 45, "zhou-2015": 50}
"""How many numbered statements each text has."""


@pytest.mark.parametrize("key", KEYS)
def test_every_numbered_statement_has_a_row(key: str) -> None:
    found = index(key)
    assert len(found) == len(NUMBERED[key]) == COUNTS[key]
    assert [number for number, rows in found.items() if not rows] == []


@pytest.mark.parametrize("key", KEYS)
def test_no_row_has_a_number_that_the_text_has_not(key: str) -> None:
    kinds = {number.split()[0] for number in NUMBERED[key] if not number.startswith("(")}
    for row in paper(key).equations():
        for number in (row.number, *row.also):
            stated = re.match(r"\(\d+[ab]?\)$|(?:" + "|".join(map(re.escape, kinds)) + r") [IVX0-9.]*\d", number)
            assert stated is None or stated.group() in NUMBERED[key], number


@pytest.mark.parametrize("key", KEYS)
def test_a_row_is_of_the_kind_that_its_number_says(key: str) -> None:
    for number, rows in index(key).items():
        kind = "figure" if number.startswith("Fig.") else number.split()[0].lower()
        for row in rows:
            if row.number == number and not number.startswith("("):
                assert row.kind == ("remark" if kind == "note" else kind), number


def test_a_missing_row_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [row for row in paper("zhou-2015").equations() if row.number not in ("(17)", "Fig. 4")]
    monkeypatch.setattr(Paper, "equations", lambda _: rows)
    assert [number for number, found in index("zhou-2015").items() if not found] == ["(17)", "Fig. 4"]


def test_parts_belong_to_their_statement_and_no_other() -> None:
    found = index("olfati-saber-2003")
    assert [row.number for row in found["Proposition 1"]] == ["Proposition 1 i)", "Proposition 1 ii)"]
    assert [row.number for row in index("shi-2009")["Fig. 1"]] == ["Fig. 1"]
    assert [row.number for row in index("tanner-2003-dynamic")["(8)"]] == ["Corollary VI.4"]
