"""Data of curves: fine samples of the solution if a run has them, else its frames."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Reals
from flocking.engine.runs.run import FineSamples, Run

BINS = 800
"""Number of columns of a curve; at most four points are drawn in each."""


def motion_of(run: Run) -> FineSamples:
    """Times, positions and velocities for curves.

    Parameters
    ----------
    run
        The run. With ``simulate(..., fine=True)`` it contains several samples of every step, so that no extremum of the
        solution is missed; otherwise only its frames are available.
    """
    return run.fine if run.fine is not None else FineSamples(run.t, run.q, run.p)


def thinned(t: Array, values: Reals) -> tuple[Array, Reals]:
    """The visible points of a curve: the first, lowest, highest and last of each column.

    Parameters
    ----------
    t
        Times, ascending, shape (K,).
    values
        Values, shape (K,).

    Returns
    -------
    tuple of Array
        The chosen times and values; their picture equals that of all points.
    """
    if len(t) <= 4 * BINS or not np.isfinite(values).all():
        return t, values
    column = np.minimum((BINS * (t - t[0]) / (t[-1] - t[0])).astype(np.intp), BINS - 1)
    first = np.flatnonzero(np.diff(column, prepend=-1))
    last = np.append(first[1:], len(t)) - 1
    by_value = np.lexsort((values, column))
    chosen = np.unique(np.concatenate([first, last, by_value[first], by_value[last]]))
    return t[chosen], values[chosen]


def thinned_path(points: Reals, step: float) -> Reals:
    """Points of a path at least ``step`` apart, with both ends; shape (K, m) to (k, m).

    Parameters
    ----------
    points
        Points along the path.
    step
        Smallest distance of two returned points, except for the last.
    """
    if len(points) < 3:
        return points
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    chosen = np.flatnonzero(np.diff(np.floor(way / step), prepend=-1.0))
    return np.asarray(points[np.union1d(chosen, [len(points) - 1])])
