"""Colours of lattice orientation, which make grains visible: hue by direction, dark where there is no lattice."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flocking.model.checks import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LIGHTNESS, CHROMA = 0.72, 0.118
"""Lightness and chroma of a perfect lattice in Oklab: the largest chroma that exists for every hue."""
TURN = 0.08
"""Hue of a lattice along x, as a fraction of the circle."""

RING_POINTS = 361
"""Points of the ring of colours, a degree apart."""

_TO_CUBES = np.array(
    [
        [1.0, 0.3963377774, 0.2158037573],
        [1.0, -0.1055613458, -0.0638541728],
        [1.0, -0.0894841775, -1.2914855480],
    ]
)
_TO_LIGHT = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)
"""Conversion from Oklab to linear sRGB (Ottosson 2020)."""


def lattice_colors(order: NDArray[np.complex128]) -> Array:
    """Colours of hexatic orders, shape (..., 3): hue from the direction of the lattice, brightness from its quality.

    Hues are perceptually uniform and equally bright.

    Parameters
    ----------
    order
        Hexatic orders, any shape, see `flocking.study.hexatic_order.hexatic`.
    """
    quality = np.clip(np.abs(order), 0.0, 1.0) ** 1.5
    angle = np.angle(order) + 2 * np.pi * TURN
    parts = np.stack([LIGHTNESS * quality, CHROMA * quality * np.cos(angle), CHROMA * quality * np.sin(angle)], axis=-1)
    light = np.clip((parts @ _TO_CUBES.T) ** 3 @ _TO_LIGHT.T, 0.0, 1.0)
    return np.asarray(np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055))


def wheel(axes: Axes, color: str) -> Axes:
    """Draw the legend of hues in a corner of axes: a row of a lattice along each direction.

    Parameters
    ----------
    axes
        The axes.
    color
        Colour of the text.
    """
    from matplotlib.collections import PolyCollection

    inset = axes.inset_axes((0.015, 0.015, 0.2, 0.2))
    angle = np.linspace(0.0, 2 * np.pi, RING_POINTS)
    middle = 0.5 * (angle[1:] + angle[:-1])
    ring = np.stack([np.stack([s * np.cos(angle), s * np.sin(angle)], axis=1) for s in (0.62, 1.0)])
    pieces = np.stack([ring[0, :-1], ring[1, :-1], ring[1, 1:], ring[0, 1:]], axis=1)
    inset.add_collection(PolyCollection(list(pieces), facecolors=lattice_colors(np.exp(6j * middle)), gid="wheel"))
    inset.set(xlim=(-1.1, 1.1), ylim=(-1.1, 1.1), aspect="equal")
    inset.axis("off")
    inset.text(0.0, 0.0, "lattice\nrows", ha="center", va="center", fontsize=5.5, color=color)
    return inset
