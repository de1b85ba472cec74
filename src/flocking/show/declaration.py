"""Declarations of figures of papers: a number, a caption, and a drawing function of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Unpack

from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.potentials.potential import Potential
from flocking.show import curves, plane, series
from flocking.show.sheet import panel, sheet
from flocking.show.style import COLUMN, PAGE, figure_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

Draw = Callable[..., "Picture"]
"""Function that draws a figure from a run, or from the runs of several scenarios."""


@dataclass(frozen=True)
class Figure:
    """A figure of a paper.

    Parameters
    ----------
    number
        Its number in the paper, for example ``"4"`` or ``"7a"``.
    caption
        Its caption.
    draw
        Draws it from a run, and from the runs of the scenarios ``beside``, in this order.
    scenario
        Name of the paper's scenario it shows. Empty for drawings that show no run.
    beside
        Names of further scenarios it shows.
    seen
        What was seen in it by its authors, beside what is known of the paper's figure; for the pages.

    Raises
    ------
    InvalidInput
        If number or caption is not a string, or ``draw`` is not callable.
    """

    number: str
    caption: str
    draw: Draw
    scenario: str = ""
    beside: tuple[str, ...] = ()
    seen: str = ""

    def __post_init__(self) -> None:
        for name in ("number", "caption"):
            value = getattr(self, name)
            if not isinstance(value, str) or not value.strip():
                raise InvalidInput("Figure", name, "must be a text that is not empty", value)
        if not callable(self.draw):
            raise InvalidInput("Figure", "draw", "must be a function of a run", self.draw, "Use snapshot(time).")

    def scenarios(self, otherwise: str) -> tuple[str, ...]:
        """Names of the scenarios it is drawn from.

        Parameters
        ----------
        otherwise
            Name of the scenario for drawings that show no run.
        """
        return (self.scenario or otherwise, *self.beside)


Figures = Mapping[int, Figure] | Mapping[str, Figure]
"""Figures by number, an integer or a string."""


def snapshot(time: float | None = None, **options: Unpack[plane.NetOptions]) -> Draw:
    """The net at one time, by default the last; options are those of `flocking.show.plane.net`."""
    return lambda run: figure_of(plane.net(run, time=time, **options))


def snapshots(times: Sequence[float], columns: int = 2, **options: object) -> Draw:
    """The net at several times on one sheet with a number of ``columns``, in row order."""
    chosen = tuple(float(t) for t in times)
    return lambda run: sheet([panel(plane.net, run, time=t, **options) for t in chosen], columns=columns)


def velocities(axis: int | Sequence[int] = (0, 1), **options: object) -> Draw:
    """Velocity components over time, one panel per axis."""
    return _per_axis(series.velocities, axis, options)


def positions(axis: int | Sequence[int] = (0, 1), **options: object) -> Draw:
    """Position components over time, one panel per axis."""
    return _per_axis(series.positions, axis, options)


def velocity_errors(axis: int | Sequence[int] = (0, 1), **options: object) -> Draw:
    """Velocity errors over time, one panel per axis."""
    return _per_axis(series.velocity_errors, axis, options)


def potential(psi: Potential, **options: Unpack[curves.PotentialOptions]) -> Draw:
    """The potential ``psi`` and its slope; options are those of `flocking.show.curves.potential`."""
    return lambda run: figure_of(curves.potential(psi, **options))


def initial(**options: Unpack[plane.NetOptions]) -> Draw:
    """The net at the first frame."""
    return lambda run: figure_of(plane.net(run, frame=0, **options))


def final(**options: Unpack[plane.NetOptions]) -> Draw:
    """The net at the last frame."""
    return lambda run: figure_of(plane.net(run, frame=-1, **options))


def paths_and_final(**options: Unpack[plane.NetOptions]) -> Draw:
    """The net at the last frame with the paths as dotted lines."""
    look: plane.NetOptions = {"trails": True, **options}
    return lambda run: figure_of(plane.net(run, frame=-1, **look))


def _per_axis(function: Callable[..., object], axis: int | Sequence[int], options: Mapping[str, object]) -> Draw:
    numbers = (axis,) if isinstance(axis, int) else tuple(axis)

    def draw(run: Run) -> Picture:
        return sheet(
            [panel(function, run, k, **options) for k in numbers], columns=len(numbers),
            width=PAGE if len(numbers) > 1 else COLUMN, ratio=0.75,
        )  # fmt: skip

    return draw


def drawn_figure(known: Figures, number: int | str, run: Run, *beside: Run) -> Picture:
    """Draw one of a paper's figures from a run, or from runs of all scenarios it shows.

    Parameters
    ----------
    known
        Figures by number.
    number
        Number of the figure.
    run
        A run of the scenario the figure shows.
    beside
        Runs of the further scenarios it shows.

    Raises
    ------
    InvalidInput
        If there is no such figure, or it shows another number of scenarios.
    """
    for name, shown in known.items():
        if str(name) == str(number):
            if len(beside) != len(shown.beside):
                names = " and ".join([shown.scenario or "any scenario", *shown.beside])
                rule = f"must be a run of each of {names}" if shown.beside else f"must be one run, of {names}"
                given = ", ".join(r.scenario.name or "a run without a name" for r in (run, *beside))
                raise InvalidInput("figure", "run", rule, given, "Give the runs one after the other.")
            return shown.draw(run, *beside)
    raise InvalidInput("figure", "number", f"must be one of {', '.join(map(str, known))}", number)
