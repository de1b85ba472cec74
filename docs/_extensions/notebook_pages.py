"""Runs the code of tutorials when they are read, shows what it shows, and offers each as a notebook."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from notebooks import TUTORIALS, cells_of, executed, page_of, write_notebook

FOLDER = "computed/notebooks"


def show(app: Any, name: str, source: list[str]) -> None:
    """Replace the source of a tutorial by that with what its code shows."""
    if name not in TUTORIALS:
        return
    docs = Path(app.srcdir)
    with TemporaryDirectory() as folder:
        cells = executed(cells_of(source[0]), Path(folder))
    write_notebook(docs / f"{name}.md", cells, docs / FOLDER / f"{name}.ipynb")

    def picture(number: int, data: bytes) -> str:
        (docs / FOLDER / f"{name}-{number}.png").write_bytes(data)
        return f"{FOLDER}/{name}-{number}.png"

    note = (
        f"This page is a notebook, too: {{download}}`{name}.ipynb <{FOLDER}/{name}.ipynb>`. What its code shows was "
        "computed when the page was built; the notebook holds it, and opens without a network.\n"
    )
    source[0] = page_of(cells, picture, note)


def setup(app: Any) -> dict[str, Any]:
    """Register with Sphinx."""
    app.connect("source-read", show)
    return {"parallel_read_safe": False}
