"""The film of a paper that lies beside the report."""

from __future__ import annotations

from pathlib import Path

from flocking.engine.run import Run

FILM = "film.gif"
SECONDS = 5.0
RATE = 10


def write_film(run: Run, path: Path) -> Path:
    """Write a small film of a run, as long whatever the run's own time.

    Parameters
    ----------
    run
        A run of at least two frames.
    path
        File to write, ending in ``.gif``.
    """
    from flocking.show.animate import animate

    return animate(run, path, fps=RATE, seconds=SECONDS, follow=True, size=3.6, dpi=80, trails=False)
