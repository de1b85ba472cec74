"""Links of cones: pairs whose headings differ little enough, within a radius. Headings stay as they are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.imperfect.pair_polynomials import Paths
from flocking.engine.imperfect.pair_switches import pair_events, radial_speed
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.views import Cone


class ConeView(NamedTuple):
    """The cones of one graph.

    Parameters
    ----------
    allowed
        Pairs whose headings differ little enough, shape (N, N).
    radii
        Radius of each agent, shape (N,).
    closed
        Whether agents at the radius are linked.
    mutual
        Whether both agents of a pair sense each other, so that (i, j) with i < j stands for both.
    """

    allowed: Links
    radii: Array
    closed: bool
    mutual: bool

    def border_speed(self, agent: int, d: Array, w: Array) -> tuple[float, float]:
        """How fast the distance from an ``agent`` grows at its radius, and the relative speed.

        Parameters
        ----------
        d, w
            Position and velocity of another one relative to the agent, shape (m,).
        """
        return radial_speed(d.tolist(), w.tolist())

    def seen(self, agents: Indices | slice, offset: Array) -> Links:
        """What ``agents`` see at each ``offset`` from them, shape (agents, N, m), as shape (agents, N)."""
        distance, radii = np.sqrt((offset**2).sum(axis=-1)), self.radii[agents][:, None]
        within = distance <= radii if self.closed else distance < radii
        return np.asarray(within & self.allowed[agents])

    def margins(self, i: Indices, j: Indices, offset: Array) -> Array:
        """How far ``j``, at each ``offset`` from agents ``i``, shape (k, m), are from the border; negative outside."""
        inside = self.radii[i] - np.sqrt((offset**2).sum(axis=-1))
        return np.where(self.allowed[i, j], inside, -np.inf)

    def events(self, paths: Paths, length: Array, changed: Links, near: Links, size: float) -> Array:
        """Rows (time, i, j) of all changes of what agents see until the motion of either one changes, in order of time.

        Parameters
        ----------
        paths, length, changed, size
            As for `flocking.engine.imperfect.pair_switches.pair_events`.
        near
            What is seen now, shape (N, N).
        """
        ways, radii = np.array([1 if self.mutual else 2]), self.radii[None]
        rows = pair_events(paths, length, changed, near[None], ways, radii, radii, size)
        i, j = rows[:, 1].astype(np.int64), rows[:, 2].astype(np.int64)
        return np.asarray(rows[self.allowed[i, j], :3])


def cone_view(graph: Cone | SmoothCone, headings: Array | None, n: int) -> ConeView:
    """The cones of a graph.

    Parameters
    ----------
    graph
        The graph.
    headings
        Headings of the agents.
    n
        Their number.
    """
    radii = np.broadcast_to(np.asarray(graph.radius, dtype=np.float64), n).copy()
    return ConeView(graph.allowed(headings), radii, isinstance(graph, Cone), not graph.directed)
