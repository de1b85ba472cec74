"""Stored summary of a million agents that become a flock, and its picture."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray
from flocking.engine.runs.run import Run
from flocking.model.checks import Array
from flocking.papers.olfati_saber_2003.system import DISTANCE, RADIUS
from flocking.papers.showcases.stored_summary import StoredSummary
from flocking.study.hexatic_order import hexatic, hexatic_map, largest_share

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAME = "flock-from-noise"
ALL, PATCH, CLOSE = 7600.0, 1260.0, 210.0
"""Sides of the three windows about the centre of the flock, each six times smaller than the one before."""
ALL_CELL, PATCH_CELL = 18.0, 5.0
"""Sides of the cells of the two larger windows."""
VIEWS = (5.0, 20.0, 40.0)
"""Earlier times at which the patch is drawn; all three windows are drawn at the end."""
GAP = 0.8 * DISTANCE
"""Distance from all agents beyond which an empty cell is a hole."""
HUES, GRADES = 48, 15
"""Numbers of levels in which direction and quality of the lattice are stored."""


def keep(run: Run) -> StoredSummary:
    """The summary of a run of the scenario.

    Parameters
    ----------
    run
        The run; it may have ended early.
    """
    facts: dict[str, object] = {"times": [float(t) for t in run.t]}
    arrays: dict[str, AnyArray] = {}
    rows: dict[str, list[float]] = {k: [] for k in ("order", "hexatic", "six", "flocks", "largest", "nearest_mean")}
    for frame, t in enumerate(run.t):
        q, p = run.q[frame], run.p[frame]
        order, neighbours = hexatic(q, RADIUS)
        count, share = largest_share(q, RADIUS)
        rows["order"].append(float(np.linalg.norm(p.mean(axis=0)) / max(np.linalg.norm(p, axis=1).mean(), 1e-300)))
        rows["hexatic"].append(float(np.abs(order).mean()))
        rows["six"].append(float((neighbours == 6).mean()))
        rows["flocks"].append(count)
        rows["largest"].append(share)
        rows["nearest_mean"].append(float(_nearest(q).mean()))
        last = frame == len(run.t) - 1
        if last or any(abs(t - view) < 1e-6 for view in VIEWS):
            arrays[f"patch_{t:g}"] = _map(q, order, PATCH, PATCH_CELL)
        if last:
            arrays["whole"] = _map(q, order, ALL, ALL_CELL)
            arrays |= _close(q, order, neighbours)
    return StoredSummary(facts | rows, arrays)


def draw(summary: StoredSummary) -> Figure:
    """One window at several times; at the end the entire flock, and single agents in the centre of the window.

    Parameters
    ----------
    summary
        Summary of the run.
    """
    from flocking.show.sheet import sheet

    end = summary.facts["times"][-1]
    patches = sorted(float(name.removeprefix("patch_")) for name in summary.arrays if name.startswith("patch_"))
    panels: list[Callable[[Axes], Axes]] = [
        _shades(summary, f"patch_{t:g}", PATCH, f"$t = {t:g}$", inner=CLOSE if t == end else 0.0) for t in patches
    ]
    panels += [
        _shades(summary, "whole", ALL, f"all, $t = {end:g}$", inner=PATCH),
        lambda axes: draw_close(summary, axes),
    ]
    return sheet(panels, columns=2, width=7.2, ratio=1.0)


def draw_close(summary: StoredSummary, axes: Axes) -> Axes:
    """Single agents in the smallest window: hue by direction; rings if there are not six neighbours.

    Parameters
    ----------
    summary
        Summary of the run.
    """
    from matplotlib.collections import LineCollection

    from flocking.show.lattice_orientation import lattice_colors
    from flocking.study.hexatic_order import neighbour_pairs

    place = CLOSE * 1.2 * (summary.arrays["close_place"] / 65535.0 - 0.5)
    order, count = uncoded(summary.arrays["close_order"]), summary.arrays["close_count"]
    pairs = neighbour_pairs(place, RADIUS)
    axes.set_facecolor("black")
    axes.add_collection(LineCollection(list(place[pairs] / RADIUS), colors="0.45", linewidths=0.4, gid="links"))
    size = 22.0
    x, y = place.T / RADIUS
    axes.scatter(x, y, c=lattice_colors(order / np.maximum(np.abs(order), 1e-9)), s=size, lw=0, zorder=2)
    for wrong, color in ((count < 6, "white"), (count > 6, "#FFD400")):
        axes.scatter(
            x[wrong], y[wrong], facecolors="none", edgecolors=color, s=size * 1.5, lw=0.9, zorder=3
        )  # fmt: skip
    half = CLOSE / 2 / RADIUS
    axes.set(xlim=(-half, half), ylim=(-half, half), aspect="equal", xlabel="$x/r$", ylabel="$y/r$")
    axes.set_title(f"single agents, $t = {summary.facts['times'][-1]:g}$")
    return axes


def coded(order: NDArray[np.complex128]) -> NDArray[np.uint16]:
    """Hexatic orders as one integer each: quality level times the number of directions, plus the direction.

    Parameters
    ----------
    order
        Hexatic order of each agent, shape (N,).
    """
    grade = np.rint(GRADES * np.clip(np.abs(order), 0.0, 1.0)).astype(np.uint16)
    hue = np.floor((np.angle(order) / (2 * np.pi) % 1.0) * HUES).astype(np.uint16) % HUES
    return np.where(grade > 0, grade * HUES + hue, 0).astype(np.uint16)


def uncoded(codes: NDArray[np.uint16]) -> NDArray[np.complex128]:
    """Inverse of `coded`, up to its rounding.

    Parameters
    ----------
    codes
        Shape (N,).
    """
    codes = codes.astype(np.int64)
    return np.asarray((codes // HUES) / GRADES * np.exp(2j * np.pi * (codes % HUES + 0.5) / HUES))


def _map(q: Array, order: NDArray[np.complex128], side: float, cell: float) -> NDArray[np.uint16]:
    cells = round(side / cell)
    low = q.mean(axis=0) - side / 2
    return coded(hexatic_map(q, order, low=low, cell=cell, shape=(cells, cells), reach=GAP))


def _close(q: Array, order: NDArray[np.complex128], neighbours: NDArray[np.int64]) -> dict[str, AnyArray]:
    # A margin around the window, so that links at its border are drawn.
    share = (q - q.mean(axis=0)) / (1.2 * CLOSE) + 0.5
    inside = ((share >= 0) & (share < 1)).all(axis=1)
    return {
        "close_place": np.rint(65535 * share[inside]).astype(np.uint16),
        "close_order": coded(order[inside]),
        "close_count": neighbours[inside].astype(np.uint8),
    }


def _nearest(q: Array) -> Array:
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(q).query(q, k=2)[0])[:, 1]


def _shades(summary: StoredSummary, name: str, side: float, title: str, inner: float = 0.0) -> Callable[[Axes], Axes]:
    """A panel of a map, with a square around the next smaller window."""
    from flocking.show.lattice_orientation import lattice_colors, wheel

    def drawn(axes: Axes) -> Axes:
        half, small = side / 2 / RADIUS, inner / 2 / RADIUS
        colors = lattice_colors(uncoded(summary.arrays[name]))
        axes.set_facecolor("black")
        axes.imshow(
            colors, origin="lower", extent=(-half, half, -half, half), gid="lattice", interpolation="antialiased"
        )
        if inner:
            axes.plot(*np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]).T * small, color="white", lw=1.0)
        if name == "whole":
            wheel(axes, "white")
        axes.set(xlim=(-half, half), ylim=(-half, half), aspect="equal", xlabel="$x/r$", ylabel="$y/r$", title=title)
        return axes

    return drawn
