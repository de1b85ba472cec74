"""Waves of the density of a group on a torus: the bands of ordered groups near the transition (Chate et al. 2008)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.model.checks import Array

WAVES = 4
"""Largest wave number along an axis in the search for bands."""

STRIPS = 60
"""Strips of a profile of the density across a wave."""


@dataclass(frozen=True)
class Waves:
    """The strongest wave of the density of a group, and the profile across it: bands, where there are any.

    Parameters
    ----------
    side, noise, updates, seed, noise_kind
        As of `Point`.
    wave
        Whole numbers of wave lengths along each axis.
    strength
        |sum over agents of exp(i k q)|^2/N at this wave; 1 on average for independent places.
    across
        |cos| of the angle between the mean velocity and the normal of the wave fronts.
    order
        v_a.
    profile
        Density in `STRIPS` strips across the wave, in units of the mean density.
    local
        v_a of the agents of each strip.
    """

    side: float
    noise: float
    updates: int
    seed: int
    noise_kind: str
    wave: tuple[int, int]
    strength: float
    across: float
    order: float
    profile: tuple[float, ...]
    local: tuple[float, ...]


def waves_of(q: Array, u: Array, side: float) -> tuple[tuple[int, int], float, float, float, Array, Array]:
    """Wave, strength, across, order, profile and local of `Waves` for one state.

    Parameters
    ----------
    q, u
        Positions, and unit vectors of the velocities, shape (N, 2).
    side
        L.
    """
    q, u = np.asarray(q, dtype=np.float64), np.asarray(u, dtype=np.float64)

    def strength_of(wave: tuple[int, int]) -> float:
        phase = (2.0 * np.pi / side) * (wave[0] * q[:, 0] + wave[1] * q[:, 1])
        return float(np.cos(phase).sum() ** 2 + np.sin(phase).sum() ** 2) / len(q)

    waves = [(a, b) for a in range(WAVES + 1) for b in range(-WAVES if a else 1, WAVES + 1)]
    best = max(waves, key=strength_of)
    mean = u.mean(axis=0)
    order = float(np.linalg.norm(mean))
    normal = np.asarray(best) / np.linalg.norm(best)
    strip = ((q @ np.asarray(best) / side % 1.0) * STRIPS).astype(np.int64) % STRIPS
    count = np.bincount(strip, minlength=STRIPS)
    sums = np.stack([np.bincount(strip, u[:, k], minlength=STRIPS) for k in range(2)], axis=1)
    local = np.linalg.norm(sums, axis=1) / np.maximum(count, 1)
    across = abs(float(mean @ normal)) / max(order, 1e-300)
    return best, strength_of(best), across, order, count * STRIPS / len(q), local
