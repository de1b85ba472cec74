"""Observations of a group at one moment, for all engines."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Indices, Reals
from flocking.model.observables import order_of, spread_of


def observation(
    t: float, p: Reals, flock_sizes: Indices, links: int, *, mean: float, deviation: float, closest: float
) -> tuple[float, ...]:
    """A row of `flocking.engine.runs.run.OBSERVED_FIELDS`.

    Parameters
    ----------
    flock_sizes
        Number of agents of each flock.
    links
        Number of ordered linked pairs.
    mean, deviation
        Mean length of a link and standard deviation of the lengths; NaN where there is no link.
    closest
        Smallest distance of linked agents; infinite where there is no link.
    """
    n, speed = len(p), np.sqrt((p**2).sum(axis=1))
    # Links between agents at one place all have the same length, 0.
    defect = deviation / mean if mean else 0.0
    return (
        t, order_of(p), float(speed.mean()), spread_of(p), len(flock_sizes), float(flock_sizes.max()) / n, links / n,
        mean, defect, closest,
    )  # fmt: skip
