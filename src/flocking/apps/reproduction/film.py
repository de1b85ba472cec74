"""The film of a paper beside the report."""

from __future__ import annotations

from pathlib import Path

from flocking.engine.runs.run import Run

SIZE = 3.6
"""Side of a film in inches: 360 pixels at 100 for each inch."""

FILM = "film"
SECONDS = 5.0
"""Length of the film."""
RATE = 10
"""Pictures in a second; few, for the size of the report."""


def write_film(run: Run, folder: Path) -> Path:
    """Write a film of fixed length of a run: MP4 where ffmpeg is installed, else GIF.

    Parameters
    ----------
    run
        A run of at least two frames.
    folder
        Where ``film.mp4`` or ``film.gif`` goes; the other one, of an earlier run, is removed.
    """
    from flocking.show.animate import animate

    written = animate(
        run,
        folder / FILM,
        fps=RATE,
        seconds=SECONDS,
        follow=True,
        size=SIZE,
        dpi=100,
        trails=False,
        progress=False,
    )
    for suffix in {".mp4", ".gif"} - {written.suffix}:
        written.with_suffix(suffix).unlink(missing_ok=True)
    return written


def film_in(folder: Path) -> Path | None:
    """The film in a folder, or None."""
    return next((film for film in (folder / f"{FILM}.mp4", folder / f"{FILM}.gif") if film.exists()), None)
