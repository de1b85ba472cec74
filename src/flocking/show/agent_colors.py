"""Colours of the agents of a net: uniform, by flock, by speed or by heading."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

import numpy as np

from flocking.arrays import Links, Reals
from flocking.errors import InvalidInput
from flocking.model.graphs.connectivity import components
from flocking.show.style import BLUE, GREEN, GREY, ORANGE, PALETTE, PURPLE, VERMILION, theme

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap

CHOICES = ("plain", "flock", "speed", "heading")


class _Look(TypedDict, total=False):
    s: float
    linewidths: float
    gid: str
    depthshade: bool
    zorder: float


class LineLook(TypedDict, total=False):
    """How lines of links, paths and directions look, as arguments of `LineCollection`."""

    colors: str
    linewidths: float
    linestyles: list[tuple[float, tuple[float, float]]]
    alpha: float
    zorder: float
    gid: str


class DotLook(TypedDict):
    """How the mark of a leader looks, as arguments of `scatter`."""

    marker: str
    s: float
    color: str
    edgecolors: str
    linewidths: float
    gid: str


def net_colors(
    axes: Axes, q: Reals, p: Reals, links: Links | None, choice: str, size: float, fastest: float | None = None
) -> None:
    """Draw the agents' dots in the colours of ``choice``, with a colour bar for numerical values.

    Parameters
    ----------
    axes
        Axes to draw on.
    q, p
        Positions and velocities, shape (N, 2) or (N, 3).
    links
        Link matrix, shape (N, N), or None.
    choice
        One of `CHOICES`.
    size
        Area of a dot in square points.
    fastest
        Speed at the end of the colours; that of the fastest agent when absent.

    Raises
    ------
    InvalidInput
        If the choice is unknown, or flocks are requested without links.
    """
    if choice not in CHOICES:
        raise InvalidInput("net", "color", f"must be one of {', '.join(CHOICES)}", choice)
    look: _Look = {"s": size, "linewidths": 0, "gid": "agents"}
    if axes.name == "3d":
        look["depthshade"] = False
    else:
        look["zorder"] = 2
    places = dict(zip(("xs", "ys", "zs") if axes.name == "3d" else ("x", "y"), q.T, strict=True))
    if choice == "plain":
        axes.scatter(**places, color=theme().agent, **look)
    elif choice == "flock":
        axes.scatter(**places, c=flock_colors(links), **look)
    elif choice == "speed":
        speed = np.sqrt((p**2).sum(axis=1))
        most = float(speed.max() if fastest is None else fastest) or 1.0
        dots = axes.scatter(**places, c=speed, cmap="viridis", vmin=0.0, vmax=most, **look)
        if is_new_scale(axes, f"speeds up to {most!r}"):
            axes.figure.colorbar(dots, ax=axes, label="speed", shrink=0.8, pad=0.02)
    else:
        heading = np.arctan2(p[:, 1], p[:, 0])
        dots = axes.scatter(**places, c=heading, cmap=_wheel(), vmin=-np.pi, vmax=np.pi, **look)
        if is_new_scale(axes, "headings"):
            bar = axes.figure.colorbar(dots, ax=axes, label="heading", shrink=0.8, pad=0.02)
            bar.set_ticks([-np.pi, 0.0, np.pi], labels=[r"$-\pi$", "$0$", r"$\pi$"])


def is_new_scale(axes: Axes, scale: str) -> bool:
    """Whether axes have no bar of this scale beside them; those of a film, drawn again and again, keep theirs."""
    found = getattr(axes, "_flocking_scale", "")
    setattr(axes, "_flocking_scale", scale)  # noqa: B010  axes have no place for it that a type checker knows
    return found != scale


def _wheel() -> Colormap:
    """A cyclic colour map whose hues are all visible on a light background."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("heading", [BLUE, GREEN, ORANGE, VERMILION, PURPLE, BLUE])


def flock_colors(links: Links | None) -> list[str]:
    """One colour per agent: flocks by size, largest first; single agents are grey.

    Raises
    ------
    InvalidInput
        If there are no links.
    """
    if links is None:
        raise InvalidInput("net", "color", "can be 'flock' only if links are known", None, "Draw a run.")
    labels = components(links)
    sizes = np.bincount(labels)
    place = np.empty(len(sizes), dtype=np.intp)
    place[np.argsort(-sizes, kind="stable")] = np.arange(len(sizes))
    return [PALETTE[place[k] % len(PALETTE)] if sizes[k] > 1 else GREY for k in labels]
