"""The size of energies that may cancel: what rounding of a law's energy is relative to, in every unit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.engine.runs.run import Run
from flocking.model.checks import Array
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.potentials.potential import Potential
from flocking.model.terms.pair_terms import Gradient

LOOKED_AT = 5
"""Frames that are looked at, evenly chosen, the first and the last among them: sizes change little along a motion."""

MOST_DISTANCES = 1_000_000
"""Distances of a frame, a bound on time: of larger groups some agents stand for all."""


def energy_size(run: Run) -> float:
    """Sum over links of |psi| + |psi'| (r + |q|) + |psi''| r^2, largest over frames: the terms that cancel in energies.

    A potential may vanish where its terms do not, as (r - d)^2/2 at r = d: its rounding is a share of psi'' r^2, and
    that of the distance works by the slope. Potentials of other terms than `Gradient` are not looked at.

    Parameters
    ----------
    run
        The run; frames without finite numbers count as 0.
    """
    terms = [(term.potential, term.over) for term in run.scenario.law.pair_terms if isinstance(term, Gradient)]
    if not terms or not len(run.q):
        return 0.0
    frames = np.unique(np.linspace(0, len(run.q) - 1, LOOKED_AT).round().astype(np.int64))
    return max(_at_frame(run, int(frame), terms) for frame in frames)


def _at_frame(run: Run, frame: int, terms: list[tuple[Potential, Graph | None]]) -> float:
    q, n = np.asarray(run.q[frame], dtype=np.float64), run.n
    if not np.isfinite(q).all():
        return 0.0
    chosen = np.unique(np.linspace(0, n - 1, min(n, max(1, MOST_DISTANCES // n))).round().astype(np.int64))
    apart = run.scenario.space.displacement(q[None] - q[chosen, None])
    r = np.sqrt((apart**2).sum(axis=2))
    found, largest = 0.0, float(np.abs(q).max())
    for potential, over in terms:
        linked = _linked(run, frame, chosen, r, over)
        linked[np.arange(len(chosen)), chosen] = False
        found += float(_sizes(potential, r[linked], largest).sum())
    # Every pair counts twice.
    return 0.5 * found * n / len(chosen)


def _linked(run: Run, frame: int, chosen: NDArray[np.int64], r: Array, over: Graph | None) -> NDArray[np.bool_]:
    """Which agents the chosen ones are linked to: by the frame where it has links, else by distance alone."""
    graph = over or run.scenario.law.graph
    if over is None and run.links.shape == (len(run.q), run.n, run.n):
        return np.array(run.links[frame][chosen], dtype=bool)
    if not graph.moves:
        return np.ones(r.shape, dtype=bool)
    radius = np.broadcast_to(np.asarray(graph.break_radius, dtype=np.float64), run.n)[chosen]
    return np.asarray(r <= radius[:, None])


def _sizes(potential: Potential, r: Array, largest: float) -> Array:
    with np.errstate(all="ignore"):
        found = (
            np.abs(potential(r)) + np.abs(potential.slope(r)) * (r + largest) + np.abs(potential.curvature(r)) * r**2
        )
    return np.asarray(np.where(np.isfinite(found), found, 0.0))
