"""Tutorials are notebooks: their code runs, and what it shows is on the page and in the file, which needs no other."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
TUTORIALS = (
    "quick_start", "formula_to_verdict", "writing_laws", "own_parts", "from_theorem_to_radio", "before_the_run",
    "audit_data",
)  # fmt: skip


@pytest.mark.parametrize("name", TUTORIALS)
def test_a_tutorial_runs_and_its_notebook_holds_what_it_shows(notebooks, name, tmp_path):
    page = DOCS / f"{name}.md"
    cells = notebooks.executed(notebooks.cells_of(page.read_text()), tmp_path)
    assert sum(cell.code for cell in cells) == page.read_text().count("```python")
    assert any(cell.printed for cell in cells), "real output"
    assert any(cell.picture for cell in cells), "a picture"
    file = notebooks.write_notebook(page, cells, tmp_path / "out" / f"{name}.ipynb")
    found = json.loads(file.read_text())
    assert (found["nbformat"], found["nbformat_minor"]) == (4, 5)
    assert len({cell["id"] for cell in found["cells"]}) == len(found["cells"])
    code = [cell for cell in found["cells"] if cell["cell_type"] == "code"]
    assert [cell["source"] for cell in code] == [cell.text for cell in cells if cell.code]
    for cell, mine in zip(code, [cell for cell in cells if cell.code], strict=True):
        streams = "".join(out["text"] for out in cell["outputs"] if out["output_type"] == "stream")
        assert streams == mine.printed
    text = "".join(cell["source"] for cell in found["cells"] if cell["cell_type"] == "markdown")
    assert not re.search(r"\{[a-z]+\}`|```\{", text), "no markup that notebooks do not know"
    for image in re.findall(r"attachment:([^)]+)", text):
        assert any(image in cell.get("attachments", {}) for cell in found["cells"])


def test_what_code_shows_stands_below_it_on_the_page(notebooks, tmp_path):
    text = "# Title\n\nWords.\n\n```python\nprint(6 * 7)\n```\n\nMore.\n\n```python\n[1, 2]\n```\n"
    cells = notebooks.executed(notebooks.cells_of(text), tmp_path)
    page = notebooks.page_of(cells, lambda *_: "", "A note.")
    assert page.startswith("# Title\n\nA note.\n\nWords.")
    assert "print(6 * 7)\n```\n\n```{code-block} text\n:class: shown\n\n42\n```\n\nMore." in page
    assert "\n\n[1, 2]\n```\n" in page


def test_a_tutorial_whose_code_fails_does_not_become_a_page(notebooks, tmp_path):
    with pytest.raises(ZeroDivisionError):
        notebooks.executed(notebooks.cells_of("# A\n\n```python\n1 / 0\n```\n"), tmp_path)


def test_the_pages_listed_as_tutorials_are_these(notebooks):
    assert notebooks.TUTORIALS == TUTORIALS
    listed = (DOCS / "index.md").read_text().split(":caption: Tutorials")[1].split("```")[0]
    assert [word for word in listed.split() if not word.startswith((":", "1", "gallery"))] == list(TUTORIALS)
