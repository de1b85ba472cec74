"""Potentials that a page may put into a law: they depend on the distance, and are finite where pairs can be linked."""

from __future__ import annotations

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import NO_LESS
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.potentials.potential import Potential
from flocking.model.state import State
from flocking.study.potentials.potential_shape import Shape, same, shape_of

POINTS = 240
"""Distances at which a curve is drawn: one for each pixel and a half of its width on the page."""
SLIDER_POINTS = 128
"""Distances at which a potential is looked at while a slider moves."""
ZOOMS = 4
"""Times that a peak is zoomed in, each by a factor of 32: to about a millionth of the first spacing."""
POLE = 1e3
"""Growth of a peak that is a pole: one of order 1 grows by 32 in each zoom, a smooth peak not at all."""
FAR = 2.0
"""Range of a potential over a graph that links at every distance, in extents of the group."""


def reach_of(graph: Graph, state: State) -> float:
    """Largest distance of linked pairs over a ``graph``; where it has none, `FAR` times the extent of the group."""
    radius = float(np.max(np.asarray(graph.break_radius)))
    if np.isfinite(radius):
        return radius
    return FAR * max(float(np.ptp(state.q, axis=0).max()), 1.0)


def check_range(psi: Potential, reach: float) -> Shape:
    """The shape of a potential that may be used up to the distance ``reach``.

    Parameters
    ----------
    psi
        The potential.

    Raises
    ------
    InvalidInput
        When it does not depend on the distance, has no real value somewhere, or is infinite between 0 and ``reach``.
    """
    _check_values(psi, reach)
    shape = shape_of(psi, reach)
    for place in shape.breaks:
        sides = [limit for side in (place.left, place.right) for limit in side[:2]]
        if place.at < reach and not same(place.at, reach) and any(x.kind == "infinite" for x in sides):
            raise InvalidInput(
                "Potential", "formula", f"must be finite at all distances below {reach:.6g}, where pairs are linked",
                f"{psi.formula.text}, which is infinite at r = {place.at:.6g}",
                "Move the pole to the radius of the graph, or beyond it.",
            )  # fmt: skip
    return shape


def _check_values(psi: Potential, reach: float) -> None:
    if "r" not in psi.formula.names:
        raise InvalidInput(
            "Potential", "formula", "must depend on the distance r, or there is no force", psi.formula.text,
            "Other names are parameters: each has a slider.",
        )  # fmt: skip
    inside = np.linspace(0.0, reach, POINTS + 1)[1:-1]
    values = psi(inside)
    if np.isnan(values).any():
        at = float(inside[np.isnan(values)][0])
        raise InvalidInput(
            "Potential", "formula", f"must be a real number at all distances below {reach:.6g}",
            f"{psi.formula.text}, which is none at r = {at:.4g}",
        )  # fmt: skip


def check_quickly(psi: Potential, reach: float) -> None:
    """Check by values alone, while one types or moves a slider: a pole is a peak that grows as it is zoomed in.

    Parameters
    ----------
    psi
        The potential.
    reach
        Largest distance.

    Raises
    ------
    InvalidInput
        When it does not depend on the distance, has no real value somewhere, or is infinite below ``reach``.
    """
    _check_values(psi, reach)
    near = 10.0 ** -np.arange(2.0, 10.0)
    even = np.linspace(0.0, 1.0, SLIDER_POINTS + 2)[1:-1]
    # Closer to the ends, where poles are allowed, so that one just inside is distinguished from one at the end.
    inside = reach * np.unique(np.concatenate([even, near, 1.0 - near]))
    size = np.abs(psi(inside))
    peaks = np.flatnonzero((size[1:-1] >= size[:-2]) & (size[1:-1] >= size[2:])) + 1
    for k in [*np.flatnonzero(~np.isfinite(size[1:-1]))[:1] + 1, *peaks]:
        at, height = _zoomed(psi, float(inside[k - 1]), float(inside[k + 1]))
        if not np.isfinite(height) or height > POLE * max(float(size[k]), NO_LESS):
            raise InvalidInput(
                "Potential", "formula", f"must be finite at all distances below {reach:.6g}, where pairs are linked",
                f"{psi!r}, which is not at r = {at:.4g}", "Move the pole to the radius of the graph, or beyond it.",
            )  # fmt: skip


def _zoomed(psi: Potential, low: float, high: float) -> tuple[float, float]:
    """Where the size of a potential is largest between two distances, zoomed in, and how large it is."""
    at = height = 0.0
    for _ in range(ZOOMS):
        r = np.linspace(low, high, SLIDER_POINTS)
        size = np.abs(psi(r))
        k = int(np.argmax(np.where(np.isfinite(size), size, np.inf)))
        at, height = float(r[k]), float(size[k])
        width = 2 * (high - low) / SLIDER_POINTS
        low, high = max(low, at - width), min(high, at + width)
    return at, height


def curves(psi: Potential, reach: float) -> dict[str, list[float | None]]:
    """The potential and its slope, the force that attracts, at distances up to ``reach``; None where it is not finite.

    Parameters
    ----------
    psi
        The potential.
    """
    r = np.linspace(0.0, reach, POINTS + 1)[1:]
    return {"r": _plain(r), "psi": _plain(psi(r)), "force": _plain(psi.slope(r))}


def _plain(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[float | None]:
    return [float(f"{x:.6g}") if np.isfinite(x) else None for x in values]
