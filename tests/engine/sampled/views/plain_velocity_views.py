"""When agents that look along their velocities see each other, a second time: SciPy with an event for each pair."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

import flocking as fk
from flocking.arrays import Array
from tests.engine.sampled.views.test_views import PlainViews


class Group:
    """Point masses on a spring to whom they see, over views along velocities, under held control.

    Parameters
    ----------
    scenario
        What is simulated; its graph, period, masses, damping and start are read.
    stiff, rest, gain
        The force is ``stiff (r - rest)`` along the line to each neighbour, and ``gain`` times the relative velocity.
    """

    def __init__(self, scenario: fk.Scenario, stiff: float, rest: float, gain: float) -> None:
        graph, agents, n = scenario.law.graph, scenario.agents, scenario.start.n
        assert isinstance(graph, fk.FieldOfView)
        self.q, self.p, self.law = np.array(scenario.start.q), np.array(scenario.start.p), (stiff, rest, gain)
        self.radius, self.half = (np.broadcast_to(x, n) for x in (graph.radius, graph.half_angle))
        self.mass, self.drag = (np.broadcast_to(x, n)[:, None] for x in (agents.masses, agents.damping))
        self.period, self.end = float(np.max(scenario.control.period)), scenario.t_end
        self.switches: list[tuple[int, int, float, bool]] = []

    def inside(self, q: Array, p: Array) -> Array:
        """How far agent j is inside of the view of agent i, shape (N, N); agents at rest look all around."""
        d, speed = q[None] - q[:, None], np.linalg.norm(p, axis=1)
        r = np.linalg.norm(d, axis=2) + np.eye(len(q))
        ahead = np.einsum("ijk,ik->ij", d, p) / np.where(speed > 0.0, speed, 1.0)[:, None] / r
        wide = np.where((speed == 0.0) | (self.half == np.pi), 9.0, self.half)[:, None]
        found = np.minimum(self.radius[:, None] - r, wide - np.arccos(np.clip(ahead, -1.0, 1.0)))
        np.fill_diagonal(found, -1.0)
        return found

    def run(self) -> None:
        """Go on to the end; `switches` are of agents i and j: when, and whether j came into view."""
        t, n = 0.0, len(self.q)
        seen = self.inside(self.q, self.p) >= 0.0
        while t < self.end - 1e-12:
            to = min(t + self.period, self.end)
            d, w = self.q[None] - self.q[:, None], self.p[None] - self.p[:, None]
            r = np.linalg.norm(d, axis=2) + np.eye(n)
            stiff, rest, gain = self.law
            # Neighbours of a tick are those that are in view then.
            force = ((stiff * (r - rest) / r * seen)[..., None] * d + gain * seen[..., None] * w).sum(axis=1)

            def slope(s: float, y: Array, force: Array = force) -> Array:
                p = y.reshape(2, n, -1)[1]
                return np.stack([p, (force - self.drag * p) / self.mass]).ravel()

            pairs = [(i, j) for i in range(n) for j in range(n) if i != j]
            events = [lambda s, y, a=i, b=j: float(self.inside(*y.reshape(2, n, -1))[a, b]) for i, j in pairs]
            y = np.stack([self.q, self.p]).ravel()
            solved = solve_ivp(
                slope, (t, to), y, method="DOP853", rtol=1e-12, atol=1e-13, events=events, max_step=(to - t) / 50
            )
            for pair, times in zip(pairs, solved.t_events, strict=True):
                for at in times:
                    seen[pair] = not seen[pair]
                    self.switches.append((*pair, float(at), bool(seen[pair])))
            self.q, self.p = solved.y[:, -1].reshape(2, n, -1)
            t = to
        self.switches.sort()


class PlainVelocityViews(PlainViews):
    """The plain world of messages, where agents look along the velocity that they know to be theirs."""

    def act(self, i, t):
        p = self.p[i] if self.info.self_known == "true" else self.own[i][1]
        self.headings[i] = np.arctan2(p[1], p[0])
        return super().act(i, t)
