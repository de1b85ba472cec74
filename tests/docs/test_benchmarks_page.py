"""The table of what was asked and measured: its last word follows from its numbers, these stand on other pages."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"


def rows(text: str) -> list[list[str]]:
    found = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")
    ]
    return [row for row in found if re.match(r"[<>]=", row[1])]


TABLE = rows((DOCS / "benchmarks.md").read_text())


def said(row: list[str]) -> bool:
    """Whether the measured number meets the one that was asked."""
    sign, asked, measured = row[1][:2], float(row[1][2:]), float(row[2])
    return measured >= asked if sign == ">=" else measured <= asked


@pytest.mark.parametrize("row", TABLE, ids=lambda row: row[0])
def test_reached_is_what_the_numbers_say(row: list[str]) -> None:
    assert row[3] == ("yes" if said(row) else "no")


def test_the_table_has_what_was_missed() -> None:
    assert len(TABLE) >= 20
    assert sum(row[3] == "no" for row in TABLE) >= 4


@pytest.mark.parametrize("row", [row for row in TABLE if row[4].startswith("{doc}")], ids=lambda row: row[0])
def test_a_number_stands_on_the_page_that_is_named(row: list[str]) -> None:
    page = re.fullmatch(r"\{doc\}`(\w+)`", row[4])
    assert page is not None
    assert re.search(rf"(?<![\d.]){re.escape(row[2])}(?![\d])", (DOCS / f"{page.group(1)}.md").read_text())


def test_ratios_beside_others_are_those_of_the_table() -> None:
    text = (DOCS / "beside_others.md").read_text()
    ratios = re.findall(r"\| (?:LAMMPS|JAX-MD|NumPy)[^|]*\| (\d+) \|", text)
    measured = [row[2] for row in TABLE if "LAMMPS, protocol" in row[0] or "JAX" in row[0] or "k-d" in row[0]]
    assert ratios == measured


def test_a_wrong_last_word_would_be_found() -> None:
    (row,) = rows("| a | >= 8 | 7.9 | yes | x |")
    assert not said(row)
