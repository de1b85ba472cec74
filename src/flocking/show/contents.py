"""Contents of a drawn figure as data: limits, labels, lines, dots, arrows and areas of every panel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from flocking.errors import InvalidInput
from flocking.model.checks import Array

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Mark:
    """Something drawn in data coordinates.

    Parameters
    ----------
    kind
        ``"line"``, ``"dots"``, ``"arrows"`` or ``"area"``. Each line of a collection is a separate mark.
    name
        Its group (gid), for example ``"agents"`` or ``"links"``; ``"pointer"`` for the arrow of an
        annotation; empty if it has none.
    label
        Its text in the legend; empty if it has none.
    points
        Points of a line or outline, positions of dots, bases of arrows, shape (K, 2).
    way
        From base to tip of every arrow, shape (K, 2); empty for other marks.
    color
        Its first colour, ``#rrggbb``; empty if it has none.
    style
        ``"-"`` for solid lines and marks without lines, else ``"--"``, ``":"``, ``"-."`` or ``"None"``.
    """

    kind: str
    name: str
    label: str
    points: Array
    way: Array
    color: str
    style: str


@dataclass(frozen=True, eq=False)
class PanelContents:
    """One set of axes.

    Parameters
    ----------
    title, letter
        Title at the centre and at the left.
    horizontal, vertical
        Labels of the axes.
    horizontal_limits, vertical_limits
        Limits of the axes.
    even
        Whether both axes have the same unit.
    legend
        Texts of the legend.
    notes
        Texts with their positions in data coordinates; None for a position in other coordinates.
    marks
        All drawn marks.
    """

    title: str
    letter: str
    horizontal: str
    vertical: str
    horizontal_limits: tuple[float, float]
    vertical_limits: tuple[float, float]
    even: bool
    legend: tuple[str, ...]
    notes: tuple[tuple[str, tuple[float, float] | None], ...]
    marks: tuple[Mark, ...]

    def of(self, name: str, kind: str = "") -> list[Mark]:
        """Marks of a group, and of a kind if one is given."""
        return [m for m in self.marks if m.name == name and kind in ("", m.kind)]

    def named(self, label: str) -> Mark:
        """The mark with this text in the legend.

        Parameters
        ----------
        label
            Text in the legend.

        Raises
        ------
        InvalidInput
            If no mark or more than one has it.
        """
        found = [m for m in self.marks if m.label == label]
        if len(found) != 1:
            raise InvalidInput("PanelContents", "label", "must be that of one mark", label)
        return found[0]


def contents(figure: Figure, stretched: float = 1.0) -> tuple[PanelContents, ...]:
    """Contents of all two-dimensional axes, in the order of their creation.

    Parameters
    ----------
    figure
        A drawn figure.
    stretched
        Factor on all horizontal values.
    """
    return tuple(_panel(axes, stretched) for axes in figure.axes if axes.name != "3d")


def _panel(axes: Axes, stretched: float) -> PanelContents:
    unit = np.array([stretched, 1.0])
    low, high = (float(x) * stretched for x in axes.get_xlim())
    bottom, top = (float(x) for x in axes.get_ylim())
    legend = axes.get_legend()
    return PanelContents(
        title=axes.get_title(),
        letter=axes.get_title(loc="left"),
        horizontal=axes.get_xlabel(),
        vertical=axes.get_ylabel(),
        horizontal_limits=(low, high),
        vertical_limits=(bottom, top),
        even=axes.get_aspect() in (1.0, "equal"),
        legend=tuple(t.get_text() for t in legend.get_texts()) if legend is not None else (),
        notes=tuple(_notes(axes, stretched)),
        marks=tuple(mark for artist in axes.get_children() for mark in _marks(artist, axes, unit)),
    )


def _notes(axes: Axes, stretched: float) -> Iterator[tuple[str, tuple[float, float] | None]]:
    for note in axes.texts:
        if not note.get_text():
            continue
        place = getattr(note, "xy", None) if getattr(note, "xycoords", None) == "data" else None
        yield note.get_text(), None if place is None else (float(place[0]) * stretched, float(place[1]))


def _marks(artist: Artist, axes: Axes, unit: Array) -> Iterator[Mark]:
    from matplotlib.collections import LineCollection, PathCollection
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon
    from matplotlib.quiver import Quiver
    from matplotlib.text import Annotation

    name, text = artist.get_gid() or "", artist.get_label()
    label = "" if text is None or str(text).startswith("_") else str(text)
    none = np.empty((0, 2))
    if isinstance(artist, Line2D):
        points = np.stack([np.asarray(x, dtype=np.float64) for x in artist.get_data()], axis=1)
        if artist.get_transform() == axes.get_yaxis_transform(which="grid"):
            points = points * [np.nan, 1.0]
        elif artist.get_transform() == axes.get_xaxis_transform(which="grid"):
            points = points * [1.0, np.nan]
        yield Mark("line", name, label, points * unit, none, _hex(artist.get_color()), artist.get_linestyle())
    elif isinstance(artist, Quiver):
        way = np.stack([np.asarray(artist.U), np.asarray(artist.V)], axis=1)
        yield Mark("arrows", name, label, np.asarray(artist.XY) * unit, way * unit, _first(artist.get_facecolor()), "-")
    elif isinstance(artist, LineCollection):
        colors, styles = artist.get_colors(), artist.get_linestyle()
        for k, segment in enumerate(artist.get_segments()):
            style = "-" if styles[k % len(styles)][1] is None else ":"
            color = _first(colors[k % len(colors) :])
            yield Mark("line", name, label, np.asarray(segment) * unit, none, color, style)
    elif isinstance(artist, PathCollection):
        places = np.ma.getdata(artist.get_offsets())
        yield Mark("dots", name, label, np.asarray(places) * unit, none, _first(artist.get_facecolor()), "-")
    elif isinstance(artist, Annotation) and artist.arrow_patch is not None and artist.anncoords == "data":
        base, tip = np.array([artist.xyann]), np.array([artist.xy])
        yield Mark("arrows", "pointer", label, base * unit, (tip - base) * unit, "", "-")
    elif isinstance(artist, Polygon):
        yield Mark("area", name, label, np.asarray(artist.get_xy()) * unit, none, _hex(artist.get_facecolor()), "-")


def _hex(color: object) -> str:
    from matplotlib.colors import to_hex

    return str(to_hex(color))


def _first(colors: ArrayLike) -> str:
    rows = np.asarray(colors)
    return _hex(rows[0]) if len(rows) else ""
