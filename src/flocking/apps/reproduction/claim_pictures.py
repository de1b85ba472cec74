"""The picture that shows the subject of a claim, drawn from a run."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from flocking.engine.runs.run import Run
from flocking.study.claims.claim import Claim
from flocking.study.claims.subjects import Subject

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CAPTIONS: dict[str, str] = {
    Subject.LEDGER: "The energy ledger, and below it the residual.",
    Subject.SPREAD: "Deviation of the velocities from their mean.",
    Subject.LEADER: "Velocity of the centre of mass minus the leader's.",
    Subject.VELOCITIES: "Velocities along x.",
    Subject.CONNECTIVITY: "Algebraic connectivity and number of flocks.",
    Subject.LINKS: "Links, and the times at which they appeared and broke where the run records these.",
    Subject.CLOSEST: "Distance of the closest pair, with the closest approaches that the run records.",
    Subject.NET: "The net in the last frame, with the paths of the agents in open space.",
}
"""Caption of each picture, by the subject of claims."""

LONGEST_STEM = 60
"""Characters of a scenario's name in the name of a file: file systems take 255 bytes, up to 4 a character."""


def picture_of(claim: Claim, numbers: Iterable[str] = ()) -> str:
    """Name of the picture beside a claim: ``figure-N`` where its source names one, else a key of `CAPTIONS`.

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
    return str(claim.about.subject)


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


def picture_stem(scenario: str, picture: str) -> str:
    """Name of the file of a picture without its ending; the scenario's own may be any text, such as a path.

    Parameters
    ----------
    scenario
        Name of the scenario.
    picture
        A key of `CAPTIONS`.
    """
    words = re.sub(r"[^\w.-]+", "-", scenario)[:LONGEST_STEM]
    return f"{words}-{picture}"


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
        for file in save(draw_picture(name, run), folder / picture_stem(run.scenario.name, name), ("svg",))
    ]
