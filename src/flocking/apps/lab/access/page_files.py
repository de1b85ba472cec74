"""The files of the page, read from this package."""

from __future__ import annotations

from importlib.resources import files

from flocking.apps.lab.access.web_server import Content

KINDS = {
    ".html": "text/html; charset=utf-8", ".css": "text/css; charset=utf-8", ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}  # fmt: skip
"""Media types of the files by the ends of their names."""


def page_files() -> dict[str, Content]:
    """Files of the page by their paths on the server; the page itself is ``"/"``."""
    found = {}
    for file in files("flocking.apps.lab").joinpath("site").iterdir():
        kind = KINDS.get("." + file.name.rpartition(".")[2])
        if kind is not None:
            found["/" if file.name == "index.html" else f"/{file.name}"] = Content(kind, file.read_bytes())
    font = files("flocking.formula.markup.font").joinpath("stix-two-math-subset.woff").read_bytes()
    found["/mathematics.woff"] = Content("font/woff", font)
    return found
