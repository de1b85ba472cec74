"""Tutorials as notebooks: their code is run when they are built, and what it shows is on the page and in the file."""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

TUTORIALS = (
    "quick_start", "formula_to_verdict", "writing_laws", "own_parts", "from_theorem_to_radio", "before_the_run",
    "audit_data",
)  # fmt: skip
"""Pages that are notebooks, too."""
CODE = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)
IMAGE = re.compile(r"^```\{image\} (\S+)\n((?::.*\n)*)```$", re.MULTILINE)
ROLE = re.compile(r"\{(?:doc|ref)\}`(?:([^`<]+?)\s*<[^`>]+>|([^`]+))`")
INCLUDE = re.compile(r"^```\{literalinclude\} (\S+)\n(?::.*\n)*```$", re.MULTILINE)


@dataclass(frozen=True)
class Cell:
    """A piece of a page: text, or code with what it shows.

    Parameters
    ----------
    text
        As it stands on the page.
    code
        Whether it is code.
    printed
        What it prints.
    shown
        Its last value as a notebook shows it, by media type; a picture is base64.
    """

    text: str
    code: bool = False
    printed: str = ""
    shown: tuple[tuple[str, str], ...] = ()

    @property
    def picture(self) -> bytes | None:
        """The picture that it shows, a PNG file."""
        data = dict(self.shown).get("image/png")
        return None if data is None else base64.b64decode(data)


def cells_of(page: str) -> list[Cell]:
    """The pieces of a page, in order."""
    found, at = [], 0
    for match in CODE.finditer(page):
        found += [Cell(page[at : match.start()].strip("\n")), Cell(match[1].strip("\n"), code=True)]
        at = match.end()
    found.append(Cell(page[at:].strip("\n")))
    return [cell for cell in found if cell.text]


def executed(cells: list[Cell], folder: Path) -> list[Cell]:
    """The cells with what their code shows, run one after the other in a folder."""
    names: dict[str, Any] = {"__name__": "__main__"}
    with contextlib.chdir(folder):
        return [_executed(cell, names) if cell.code else cell for cell in cells]


def _executed(cell: Cell, names: dict[str, Any]) -> Cell:
    tree, value, printed = ast.parse(cell.text), None, io.StringIO()
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, "<cell>", "exec"), names)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), "<cell>", "eval"), names)
        shown = () if value is None else tuple(_media(value))
    return replace(cell, printed=printed.getvalue(), shown=shown)


def _media(value: object) -> Iterator[tuple[str, str]]:
    yield "text/plain", repr(value)
    for kind, method in (("text/html", "_repr_html_"), ("image/png", "_repr_png_")):
        shown = getattr(value, method, lambda: None)()
        if shown is not None:
            yield kind, base64.b64encode(shown).decode() if isinstance(shown, bytes) else shown


def page_of(cells: list[Cell], picture: Callable[[int, bytes], str], note: str) -> str:
    """The page with what its code shows below each piece of code.

    Parameters
    ----------
    cells
        The cells.
    picture
        Stores the picture of a cell by its number, and gives the path that the page shows it from.
    note
        What stands below the title.
    """
    parts = []
    for k, cell in enumerate(cells):
        if not cell.code:
            title, _, rest = cell.text.partition("\n")
            parts.append(f"{title}\n\n{note}\n{rest}" if k == 0 else cell.text)
            continue
        parts.append(f"```python\n{cell.text}\n```")
        data, text = cell.picture, cell.printed.rstrip("\n")
        if data is not None:
            parts.append(f"```{{image}} {picture(k, data)}\n:alt: What the code above draws\n:class: drawn\n```")
        elif cell.shown:
            text = f"{text}\n{dict(cell.shown)['text/plain']}".strip("\n")
        if text:
            parts.append(f"```{{code-block}} text\n:class: shown\n\n{text}\n```")
    return "\n\n".join(parts) + "\n"


def notebook_of(cells: list[Cell], docs: Path, title_of: Callable[[str], str]) -> dict[str, Any]:
    """A notebook in Jupyter's format 4.5, which needs no other file and no network to be read.

    Parameters
    ----------
    cells
        The cells, executed.
    docs
        Folder of the pages, from which pictures are taken.
    title_of
        Title of another page, by its name.
    """
    found, count = [], 0
    for k, cell in enumerate(cells):
        entry: dict[str, Any] = {"id": f"cell-{k}", "metadata": {}}
        if cell.code:
            count += 1
            entry |= {"cell_type": "code", "execution_count": count, "source": cell.text, "outputs": []}
            if cell.printed:
                entry["outputs"].append({"output_type": "stream", "name": "stdout", "text": cell.printed})
            if cell.shown:
                data = {"output_type": "execute_result", "execution_count": count, "metadata": {}}
                entry["outputs"].append(data | {"data": dict(cell.shown)})
        else:
            text, pictures = _plain(cell.text, docs, title_of)
            entry |= {"cell_type": "markdown", "source": text} | ({"attachments": pictures} if pictures else {})
        found.append(entry)
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    metadata = {"kernelspec": kernel, "language_info": {"name": "python"}}
    return {"cells": found, "metadata": metadata, "nbformat": 4, "nbformat_minor": 5}


def _plain(text: str, docs: Path, title_of: Callable[[str], str]) -> tuple[str, dict[str, dict[str, str]]]:
    """The text of a page as notebooks read it, and the pictures that it holds."""
    pictures: dict[str, dict[str, str]] = {}

    def image(match: re.Match[str]) -> str:
        path = docs / match[1]
        alt = re.search(r":alt: (.*)", match[2])
        pictures[path.name] = {"image/png": base64.b64encode(path.read_bytes()).decode()}
        return f"![{alt[1] if alt else ''}](attachment:{path.name})"

    def role(match: re.Match[str]) -> str:
        return f"*{match[1] or title_of(match[2])}*"

    def included(match: re.Match[str]) -> str:
        return f"```python\n{(docs / match[1]).read_text()}```"

    return ROLE.sub(role, INCLUDE.sub(included, IMAGE.sub(image, text))), pictures


def title_in(docs: Path, name: str) -> str:
    """Title of a page or of a gallery's script."""
    if name.startswith("sphx_glr_gallery_"):
        script = docs.parent / "gallery" / name.removeprefix("sphx_glr_gallery_")
        return str(ast.get_docstring(ast.parse(script.read_text()))).splitlines()[0]
    return (docs / f"{name}.md").read_text().splitlines()[0].removeprefix("# ")


def write_notebook(page: Path, cells: list[Cell], target: Path) -> Path:
    """Write the notebook of a page.

    Parameters
    ----------
    page
        The page.
    cells
        Its cells, executed.
    target
        The file to write.
    """
    docs = page.parent
    notebook = notebook_of(cells, docs, lambda name: title_in(docs, name))
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n")
    return target
