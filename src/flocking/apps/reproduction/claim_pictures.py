"""Which picture shows what a claim speaks of, and how it is drawn from the run of seed 0."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from flocking.engine.runs.run import Run
from flocking.study.claims.claim import Claim

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CAPTIONS = {
    "ledger": "The energy ledger, and below it what it leaves unexplained.",
    "spread": "How far velocities are from their mean.",
    "leader": "Velocity of the centre of mass minus the leader's.",
    "velocities": "Velocities along x.",
    "connectivity": "Algebraic connectivity and number of flocks.",
    "links": "Links, and when they were made and lost.",
    "closest": "Distance of the closest pair, with its certified minima.",
    "net": "The net at the end, with the paths that led there.",
}
"""What each picture shows."""

SPEAKS_OF = {
    "ledger": (
        "energy", "energy-falls", "energy-bound", "energy-per-link", "energy-continuous", "J-falls", "J-continuous",
        "H_s-continuous", "jumps", "flocking", "decreasing",
    ),
    "spread": ("velocities-agree", "agree", "no-flocking"),
    "leader": ("tracks", "no-tracking", "steady-error", "centre", "mean-velocity", "velocities-follow"),
    "velocities": ("velocities", "headings", "momentum", "speed-bound"),
    "connectivity": ("connected", "split", "rejoin"),
    "links": ("links-kept", "new-links", "switching-stops", "transversal"),
    "closest": ("apart", "apart-by", "all-apart", "linked-apart", "unlinked-apart"),
}  # fmt: skip
"""Claims by the picture that shows their subject; the net shows all others."""


def picture_of(claim: Claim, numbers: Iterable[str] = ()) -> str:
    """Name of the picture a claim stands beside: ``figure-N`` where its source names one of them, else a key above.

    Parameters
    ----------
    claim
        The claim.
    numbers
        Numbers of the paper's figures that are drawn from the same run.
    """
    named = re.findall(r"Fig\. (\w+)", claim.source)
    for number in numbers:
        if str(number) in named:
            return f"figure-{number}"
    return next((name for name, keys in SPEAKS_OF.items() if claim.key in keys), "net")


def draw_picture(name: str, run: Run) -> Figure:
    """Draw one of the pictures.

    Parameters
    ----------
    name
        A key of `CAPTIONS`.
    run
        The run.
    """
    from flocking.show import series
    from flocking.show.plot import plot
    from flocking.show.style import figure_of

    if name == "leader":
        return figure_of(series.centre_errors(run))
    if name == "velocities":
        return plot(run, "velocities", axis=0)
    if name == "net":
        return plot(run, "net", trails=True)
    return plot(run, "energy" if name == "ledger" else name)


def draw_pictures(run: Run, names: Iterable[str], folder: Path) -> list[Path]:
    """Draw several, as SVG files named after the scenario and the picture; return the files.

    Parameters
    ----------
    names
        Keys of `CAPTIONS`.
    """
    from flocking.show.style import save

    return [
        file
        for name in names
        for file in save(draw_picture(name, run), folder / f"{run.scenario.name}-{name}", ("svg",))
    ]
