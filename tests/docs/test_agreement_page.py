"""The page on how far the engines agree has the text of the program that writes it, and a row for each of its laws."""

from __future__ import annotations

from pathlib import Path

from benchmarks import agreement

PAGE = Path(__file__).parents[2] / "docs" / "engine_agreement.md"


def test_the_page_is_what_its_program_writes():
    text = PAGE.read_text()
    lines = [line for line in text.splitlines() if line.startswith("| ")][1:]
    rows = [tuple(cell.strip() for cell in line[2:-2].split(" | ")) for line in lines]
    assert agreement.page(rows) == text
    assert [row[:2] for row in rows] == [
        (name, f"{dimension}-D") for name in (*agreement.NAMES, *agreement.REFUSED) for dimension in (2, 3)
    ]
