"""What is observed of runs over seeds: order, nearest distance and fragments, with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.engine.runs.run import Run
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import components
from flocking.model.graphs.distance_graphs import pair_distances
from flocking.model.observables import order_of
from flocking.papers.reynolds_1987 import system
from flocking.study.confidence_intervals import Interval, mean_interval

NAMES = ("polarisation", "nearest", "fragments")
"""Names of the quantities."""

OBSERVED = (system.KEY, system.SEQUENTIAL, system.SMALL, system.LARGE)
"""Scenarios whose quantities are observed."""


@dataclass(frozen=True, eq=False)
class Observed:
    """Quantities of several runs at the times of their frames.

    Parameters
    ----------
    t
        Times, shape (F,).
    polarisation, nearest
        Length of the mean heading, and smallest distance of two agents, shape (runs, F).
    fragments
        Number of groups whose members are linked by chains of agents within the range of cohesion, shape (runs, F).
    """

    t: Array
    polarisation: Array
    nearest: Array
    fragments: Array

    def at_end(self, name: str, level: float = 0.95) -> Interval:
        """Interval of the mean over runs of a quantity at the last frame.

        Parameters
        ----------
        name
            ``"polarisation"``, ``"nearest"`` or ``"fragments"``.
        level
            Level of confidence.
        """
        return mean_interval(np.asarray(getattr(self, name))[:, -1], level)


def measured(run: Run) -> tuple[Array, Array, Array]:
    """Polarisation, nearest distance and fragments at each frame of a run, shape (F,) each; empty without frames."""
    space, radius = run.scenario.space, float(np.max(np.asarray(run.scenario.law.graph.break_radius)))
    found = []
    for q, p in zip(run.q, run.p, strict=True):
        distances = pair_distances(q, space)
        found.append((order_of(p), float(distances.min()), float(components(distances < radius).max()) + 1.0))
    polarisation, nearest, fragments = np.array(found).reshape(-1, 3).T
    return polarisation, nearest, fragments


def observed(name: str = system.KEY, seeds: Sequence[int] = range(8)) -> Observed:
    """Run a scenario with several seeds.

    Parameters
    ----------
    name
        Name of the scenario.
    seeds
        The seeds.
    """
    return _observed(name, tuple(seeds))


@lru_cache(maxsize=4)
def _observed(name: str, seeds: tuple[int, ...]) -> Observed:
    return of_runs([simulate(system.scenario(name=name, seed=seed), progress=False) for seed in seeds])


def of_runs(runs: Sequence[Run]) -> Observed:
    """The quantities of runs of one scenario.

    Parameters
    ----------
    runs
        The runs, with frames at the same times.
    """
    columns = zip(*(measured(run) for run in runs), strict=True)
    return Observed(np.asarray(runs[0].t), *(np.array(column) for column in columns))


def quantities(run: Run) -> dict[str, float]:
    """Polarisation, nearest distance and fragments at the last frame of a run.

    Parameters
    ----------
    run
        The run, with a frame.
    """
    return {name: float(row[-1]) for name, row in zip(NAMES, measured(run), strict=True)}
