"""Films as files that a notebook plays, and the progress of drawing them."""

from __future__ import annotations

import base64
from html import escape
from pathlib import Path

from flocking.engine.driver.waits import Wait

LARGEST_SHOWN = 30_000_000
"""Bytes of a film that is embedded in a notebook; a larger one is named."""


class Film(type(Path())):  # type: ignore[misc]
    """Path of a film, which a notebook plays."""

    def _repr_html_(self) -> str:
        """The film itself, unless it is large or gone."""
        path = Path(self)
        if not path.is_file() or path.stat().st_size > LARGEST_SHOWN:
            return f"<code>{escape(str(path))}</code>"
        data = base64.b64encode(path.read_bytes()).decode()
        if path.suffix == ".gif":
            return f'<img src="data:image/gif;base64,{data}" alt="film of a run">'
        return f'<video src="data:video/mp4;base64,{data}" controls loop muted playsinline></video>'


class Pictures(Wait):
    """Counts the pictures of a film.

    Parameters
    ----------
    shown
        Whether to show anything.
    total
        Number of pictures.
    """

    def __init__(self, shown: bool, total: int) -> None:
        super().__init__("film", total, unit="pictures", shown=shown)
