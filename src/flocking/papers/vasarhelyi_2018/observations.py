"""What is observed of flocks over seeds: the order parameters of each run after the first minute."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from flocking.engine.runs.run import Run
from flocking.model.checks import Array
from flocking.papers.stored_observations import Observations, observe
from flocking.papers.vasarhelyi_2018 import system
from flocking.papers.vasarhelyi_2018.parameters import NAMES, OrderParameters, order_parameters

OBSERVED = (system.KEY, system.PROGRAM, system.OPTIMIZED, system.OBSTACLES)
"""Scenarios whose order parameters are observed."""

SETTLED = 60.0
"""Time in seconds after which order parameters are averaged."""


def late(t: Array, found: OrderParameters, name: str) -> Array:
    """Values of an order parameter after the first minute.

    Parameters
    ----------
    t
        Times of the frames, shape (F,).
    found
        Order parameters at the frames.
    name
        Name of the order parameter.
    """
    return np.asarray(np.asarray(getattr(found, name))[(t - t[0]) >= SETTLED])


def observed(name: str = system.KEY, seeds: Sequence[int] = range(8)) -> Observations:
    """Run a scenario with several seeds: means of the order parameters of each run after the first minute.

    Parameters
    ----------
    name
        Name of the scenario, one of `OBSERVED`.
    seeds
        The seeds.
    """
    return observe(name, seeds)


def quantities(run: Run) -> dict[str, float]:
    """Means of the order parameters of a run after the first minute: NaN where one is not defined.

    Parameters
    ----------
    run
        The run.
    """
    found, t = order_parameters(run), np.asarray(run.t)
    with warnings.catch_warnings():
        # The mean of nothing is NaN, which shows it.
        warnings.simplefilter("ignore", RuntimeWarning)
        return {name: float(np.nanmean(late(t, found, name))) for name in NAMES}
