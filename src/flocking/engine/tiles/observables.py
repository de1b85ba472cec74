"""Observables of a group at one time, computed from its tiles with memory of order N."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Indices, Reals
from flocking.engine.runs.observation import observation
from flocking.engine.runs.run import OBSERVED_FIELDS as OBSERVED_FIELDS
from flocking.engine.tiles.neighbours.nearest_image import to_nearest
from flocking.engine.tiles.neighbours.neighbour_lists import LINKED, NUMBER
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays
from flocking.formula.native.functions import native
from flocking.model.graphs.views import VELOCITY


def _root(parent: NDArray[np.int32], i: int | np.int64) -> int | np.int64:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@native
def _survey(agents, p, n, box, rows, first, count, remembered, limit, each, views, parent):  # type: ignore[no-untyped-def]
    """Join linked agents; returns the number of links, one length, the sums of what others exceed it by and of the
    squares of that, and the smallest square of a length.
    """
    links = 0
    typical = 0.0
    lengths = 0.0
    squares = 0.0
    least = np.inf
    m, constant = agents.shape[1] // 2, views.shape[0] > 1
    for i in range(n):
        parent[i] = i
    for i in range(n):
        tile, lane = i // 16, i % 16
        bound = each[i] if each.shape[0] > 1 else limit
        for row in range(first[tile], first[tile] + count[tile]):
            entry = rows[row, lane]
            j = np.int64(entry & NUMBER)
            if j == i:
                continue
            s = 0.0
            ahead = 0.0
            speed = 1.0 if constant else 0.0
            for k in range(m):
                d = np.float64(agents[j, k]) - np.float64(agents[i, k])
                if box.shape[0]:
                    d = np.float64(to_nearest(d, box, k, m))
                s += d * d
                if views.shape[0]:
                    heading = np.float64(views[k + 1, i] if constant else p[i, k])
                    ahead += d * heading
                    speed += 0.0 if constant else heading * heading
            if remembered:
                if entry < LINKED:
                    continue
            elif s >= bound or (views.shape[0] > 0 and ahead * abs(ahead) < views[0, i] * s * speed):
                continue
            length = np.sqrt(s)
            if links == 0:
                typical = length
            links += 1
            # Beside a length of the same size the squares of nearly equal lengths do not cancel.
            lengths += length - typical
            squares += (length - typical) * (length - typical)
            least = min(least, s)
            a, b = _root(parent, i), _root(parent, j)
            if a != b:
                parent[max(a, b)] = min(a, b)
    for i in range(n):
        parent[i] = _root(parent, i)
    return links, typical, lengths, squares, least


def _flock_sizes(particles: ParticleArrays, p: Reals) -> tuple[Indices, tuple[int, float, float, float, float]]:
    """Sizes of the flocks under the law's graph, and what `_survey` returns; for ``p`` see `observe`."""
    n = particles.n
    lists = particles.lists[0]
    assert lists is not None
    parent = np.empty(n, np.int32)
    particles.turn_views()
    looks = particles.spec.graphs[0].view == VELOCITY
    velocities = np.ascontiguousarray(p[particles.ids[:n]] if looks else np.zeros((0, 1)), dtype=np.float64)
    counted = _survey(
        particles.agents,
        velocities,
        n,
        particles.search.box,
        lists.rows,
        lists.first,
        lists.count,
        not particles.radii.follow_state(0),
        particles.radii.limits[0][0],
        particles.radii.each[0],
        particles.radii.views[0],
        parent,
    )
    sizes = np.bincount(parent)
    return sizes[sizes > 0], counted


def observe(particles: ParticleArrays, t: float, p: Reals) -> tuple[float, ...]:
    """One row of `OBSERVED_FIELDS`; ``p``: velocities, shape (N, m). The lists must be valid."""
    sizes, (links, typical, lengths, squares, least) = _flock_sizes(particles, p)
    more = lengths / links if links else np.nan
    mean = typical + more
    deviation = float(np.sqrt(max(squares / links - more**2, 0.0))) if links else np.nan
    return observation(t, p, sizes, links, mean=mean, deviation=deviation, closest=float(np.sqrt(least)))
