"""The energy of Zhou's simulations between switches, and the bounds (13)-(18), (30), (31)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flocking.model.checks import Array
from flocking.model.graphs.distance_graphs import pair_distances
from flocking.papers.examples import shown
from flocking.papers.zhou_2015 import bounds, system
from flocking.papers.zhou_2015.examples import alone, led, new_links_of
from flocking.study.evidence import Evidence


@dataclass(frozen=True, eq=False)
class Phases:
    """The energy of a run between switches, and its bounds.

    Parameters
    ----------
    energies
        Q or U at the steps of [t_(k-1), t_k), one array for every k from 1 on; the first of each is Q(t_(k-1)).
    new
        Numbers n_k of links that are new at t_1, t_2, ...
    linked
        Least and largest distance of a linked pair over the frames.
    bound
        Q_max or U_max with a scaled eps.
    price
        The potential psi(r - eps) of a new link.
    most
        M for a hundred agents, their number scaled.
    """

    energies: tuple[Array, ...]
    new: tuple[int, ...]
    linked: tuple[float, float]
    bound: float
    price: float
    most: int


def phases_of(scale: float, *, leader: bool = False) -> Phases:
    """The simulation between switches, with Q_max for a scaled eps.

    Parameters
    ----------
    leader
        Whether there is the virtual leader.
    """
    run = shown(led if leader else alone)
    jumped, energy = run.trace["jumped"], run.trace["energy"]
    parts = np.split(energy, np.flatnonzero(np.diff(jumped)) + 1)
    history = [links for _, links in Evidence(run).link_history]
    new = tuple(int((after & ~before).sum()) // 2 for before, after in pairwise(history))
    lengths = [pair_distances(q)[run.links_at(k)] for k, q in enumerate(run.q)]
    radius = system.RADIUS - system.GAP * scale
    bound = bounds.largest_energy(float(energy[0]), run.n, system.potential(), radius)
    spread = min(float(x.min()) for x in lengths), max(float(x.max()) for x in lengths)
    return Phases(tuple(parts), new, spread, bound, float(system.potential()(radius)), new_links_of(scale))


def led_phases_of(scale: float) -> Phases:
    """The same with the virtual leader, whose energy is U."""
    return phases_of(scale, leader=True)
