"""Shapes, rotations and colours of agents as arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import PerAgent
from flocking.model.checks import NO_LESS, Array
from flocking.model.graphs.connectivity import components
from flocking.model.state import State

Bytes = NDArray[np.uint8]

COLORINGS = ("speed", "heading", "flock", "energy")
HIGHLIGHT = (255, 0, 200)
"""Colour of chosen agents, red, green and blue: magenta stands out on a light and on a dark background."""

RAMPS = {
    False: np.array([(68, 1, 84), (59, 82, 139), (33, 145, 140), (110, 170, 50), (240, 150, 0)], dtype=np.float64),
    True: np.array([(125, 110, 225), (85, 150, 225), (60, 185, 175), (125, 215, 99), (253, 231, 37)], dtype=float),
}  # fmt: skip
"""From slow to fast, or low to high, on a light and on a dark background: lightness rises, and all contrast with it."""

_FLOCKS = np.array(
    [(0, 114, 178), (230, 159, 0), (0, 158, 115), (213, 94, 0), (204, 121, 167), (86, 180, 233), (150, 150, 0)],
    dtype=np.uint8,
)
"""Colours that are distinct for colour-blind readers (Okabe and Ito)."""


def in_space(q: Array, shift: Array | None = None) -> NDArray[np.float32]:
    """Points of any dimension as points of space, shape (N, 3), moved by ``shift`` before they lose digits."""
    found = np.zeros((len(q), 3))
    found[:, : min(3, q.shape[1])] = q[:, :3]
    return np.asarray(found if shift is None else found + shift, dtype=np.float32)


def dart(dimension: int) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Vertices and faces of an agent of length 1 that points along the first axis: flat in the plane, else a cone."""
    if dimension <= 2:
        points = np.array([(0.6, 0, 0), (-0.4, 0.32, 0), (-0.22, 0, 0), (-0.4, -0.32, 0)], dtype=np.float32)
        return points, np.array([(0, 1, 2), (0, 2, 3)], dtype=np.uint32)
    sides = 7
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.full(sides, -0.4), 0.3 * np.cos(angle), 0.3 * np.sin(angle)], axis=1)
    points = np.concatenate([[(0.6, 0, 0), (-0.4, 0, 0)], ring]).astype(np.float32)
    faces = [face for k in range(sides) for face in ((0, 2 + k, 2 + (k + 1) % sides), (1, 2 + (k + 1) % sides, 2 + k))]
    return points, np.array(faces, dtype=np.uint32)


def turns(p: Array, before: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
    """Quaternions (w, x, y, z) that turn the first axis into the directions of ``p``, shape (N, 4).

    Agents at rest have the rotations ``before``.
    """
    v = in_space(p).astype(np.float64)
    speed = np.linalg.norm(v, axis=1)
    moving = speed > 1e-9 * max(float(speed.max(initial=0.0)), NO_LESS)
    d = np.where(moving[:, None], v / np.where(moving, speed, 1.0)[:, None], (1.0, 0.0, 0.0))
    found = np.stack([1 + d[:, 0], np.zeros(len(d)), -d[:, 2], d[:, 1]], axis=1)
    size = np.linalg.norm(found, axis=1, keepdims=True)
    opposite = size[:, 0] < 1e-6
    found = np.where(opposite[:, None], (0.0, 0.0, 0.0, 1.0), found / np.where(opposite[:, None], 1.0, size))
    if before is not None and len(before) == len(found):
        found[~moving] = before[~moving]
    return np.asarray(found, dtype=np.float32)


def ramp(values: Array, low: float, high: float, dark: bool = False) -> Bytes:
    """Colours of a ramp, shape (N, 3).

    Parameters
    ----------
    values
        Numbers, shape (N,).
    dark
        Whether the background is dark.
    """
    stops = RAMPS[dark]
    x = np.clip((values - low) / (high - low), 0.0, 1.0) if high > low else np.full(len(values), 0.5)
    position = np.nan_to_num(x) * (len(stops) - 1)
    k = np.minimum(position.astype(np.intp), len(stops) - 2)
    part = (position - k)[:, None]
    return np.asarray((1 - part) * stops[k] + part * stops[k + 1], dtype=np.uint8)


def wheel(angle: Array) -> Bytes:
    """Colours of angles, shape (N, 3); opposite directions get opposite hues.

    Parameters
    ----------
    angle
        Radians, shape (N,).
    """
    shifts = np.array([0.0, -2 * np.pi / 3, 2 * np.pi / 3])
    return np.asarray(40 + 87.5 * (1 + np.cos(angle[:, None] + shifts)), dtype=np.uint8)


def colors(state: State, kind: str, fastest: float, energies: PerAgent | None = None, dark: bool = False) -> Bytes:
    """One colour per agent, shape (N, 3).

    Parameters
    ----------
    state
        The state.
    kind
        One of `COLORINGS`.
    fastest
        Speed of the brightest colour.
    energies
        Potential of each agent, for ``"energy"``.
    dark
        Whether the background is dark.
    """
    if kind == "heading":
        return wheel(np.arctan2(state.p[:, 1], state.p[:, 0]) if state.dimension > 1 else np.zeros(state.n))
    if kind == "flock" and state.links is not None:
        return _FLOCKS[components(state.links) % len(_FLOCKS)]
    if kind == "energy" and energies is not None and len(energies) == state.n:
        return ramp(energies, float(np.min(energies)), float(np.max(energies)), dark)
    return ramp(np.linalg.norm(state.p, axis=1), 0.0, fastest, dark)


def link_segments(state: State, points: NDArray[np.float32], budget: int) -> tuple[NDArray[np.float32], int]:
    """Ends of the links, shape (L, 2, 3), at most ``budget`` of them evenly chosen; and how many there are.

    Parameters
    ----------
    state
        The state.
    points
        Where its agents are drawn, shape (N, 3).
    budget
        Most links.
    """
    if state.links is None:
        return np.zeros((0, 2, 3), dtype=np.float32), 0
    i, j = np.nonzero(state.links)
    once = (i < j) | ~state.links[j, i]
    i, j = i[once], j[once]
    count = len(i)
    if count > budget:
        chosen = np.linspace(0, count - 1, budget).astype(np.intp)
        i, j = i[chosen], j[chosen]
    return np.stack([points[i], points[j]], axis=1), count


def spacing(q: Array) -> float:
    """Typical distance to the nearest neighbour; 1 for a single agent."""
    if len(q) < 2:
        return 1.0
    from scipy.spatial import cKDTree

    some = q[:: max(1, len(q) // 2000)]
    distance = np.asarray(cKDTree(q).query(some, k=2)[0])[:, 1]
    return float(np.median(distance)) or 1.0
