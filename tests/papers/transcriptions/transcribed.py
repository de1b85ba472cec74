"""The papers' formulas typed once more, plainly, for the tests alone: nothing here comes from the library."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp


def near(found, expected, tolerance=1e-9) -> None:
    assert_allclose(found, expected, rtol=tolerance, atol=tolerance * 1e-2)


def random_agents(n=5, spread=1.5, seed=7):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, 2)) * spread, rng.normal(size=(n, 2))


def neighbours_of(edges, n):
    found = {i: set() for i in range(n)}
    for i, j in edges:
        found[i].add(j)
        found[j].add(i)
    return found


def connected(neighbours) -> bool:
    reached, todo = {0}, [0]
    while todo:
        for j in neighbours[todo.pop()]:
            if j not in reached:
                reached.add(j)
                todo.append(j)
    return len(reached) == len(neighbours)


def close_pairs(q, radius):
    n = len(q)
    return neighbours_of([(i, j) for i in range(n) for j in range(i) if math.dist(q[i], q[j]) < radius], n)


def tanner(r):
    """Tanner II, Fig. 2 formula and its slope."""
    return 1 / r**2 + math.log(r**2)


def tanner_slope(r):
    return -2 / r**3 + 2 / r


def zhou(d, r=4.0):
    """Zhou (9) and its slope."""
    return 1 / d + 1 / (r - d)


def zhou_slope(d, r=4.0):
    return -1 / d**2 + 1 / (r - d) ** 2


def potential_force(q, neighbours, slope):
    """-sum_j grad_{r_i} V_ij, agent by agent."""
    u = np.zeros_like(q)
    for i in neighbours:
        for j in neighbours[i]:
            r = math.dist(q[i], q[j])
            for k in range(2):
                u[i, k] -= slope(r) * (q[i, k] - q[j, k]) / r
    return u


def alignment(p, neighbours):
    """-sum_j (v_i - v_j), agent by agent."""
    u = np.zeros_like(p)
    for i in neighbours:
        for j in neighbours[i]:
            u[i] -= p[i] - p[j]
    return u


def potential_sums(q, neighbours, value):
    return [sum(value(math.dist(q[i], q[j])) for j in neighbours[i]) for i in neighbours]


def laplacian_form(p, neighbours):
    """v^T (L x I) v by the Laplacian's entries."""
    n = len(p)
    L = np.zeros((n, n))
    for i in neighbours:
        L[i, i] = len(neighbours[i])
        for j in neighbours[i]:
            L[i, j] = -1
    return sum(p[i, k] * L[i, j] * p[j, k] for k in range(2) for i in range(n) for j in range(n))


def ball_start(seed, n=10, radius=2.5, speed=1.0, range_of_sight=None):
    """Positions uniform in a disc, any direction and a speed in [0, 1); redrawn until connected where asked."""
    rng = np.random.default_rng(seed)

    def directions():
        x = rng.normal(size=(n, 2))
        return x / np.sqrt((x**2).sum(axis=1))[:, None]

    while True:
        q = directions() * radius * np.sqrt(rng.random((n, 1)))
        if range_of_sight is None or connected(close_pairs(q, range_of_sight)):
            return q, directions() * speed * rng.random((n, 1))


def box_start(seed, n=10, side=8.0, speed=4.0, range_of_sight=4.0):
    """Positions uniform in a square, both velocity components uniform; redrawn until connected."""
    rng = np.random.default_rng(seed)
    while True:
        q = side * rng.random((n, 2))
        if connected(close_pairs(q, range_of_sight)):
            return q, speed * rng.random((n, 2))


def random_edges(seed, n=10, chance=0.3):
    """G(n, chance), redrawn until connected."""
    rng = np.random.default_rng(seed)
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n)]
    while True:
        edges = [e for e, x in zip(pairs, rng.random(len(pairs)), strict=True) if x < chance]
        if connected(neighbours_of(edges, n)):
            return edges


def acceleration(q, p, links, slope, pull=None):
    """Control law with unit weights for a matrix of links: sum_j (v_j - v_i) - sum_j grad psi, and a leader's pull."""
    d = q[None] - q[:, None]
    r = np.sqrt((d**2).sum(axis=2)) + np.eye(len(q))
    push = np.where(links, slope(r) / r, 0.0)
    u = (push[:, :, None] * d).sum(axis=1) + links @ p - links.sum(axis=1)[:, None] * p
    return u if pull is None else u - (p - np.asarray(pull))


EARLY = 5.0
"""Time until which links are looked for in short steps."""


class Motion:
    """Dense solution of one of the papers' systems, integrated here from the transcribed formulas."""

    def __init__(self, q, p, end, slope, rule, pull=None):
        self.pieces = []
        n = len(q)
        t, y = 0.0, np.concatenate([q.ravel(), p.ravel()])
        links, next_links, event = rule(q)
        while t < end:

            def rhs(_, y, links=links):
                a, b = y[: 2 * n].reshape(n, 2), y[2 * n :].reshape(n, 2)
                return np.concatenate([b.ravel(), acceleration(a, b, links, slope, pull).ravel()])

            def cross(_, y, links=links):
                return event(y[: 2 * n].reshape(n, 2), links)

            cross.terminal, cross.direction = True, -1
            # Links switch early, and often: later no step is bounded.
            early = event is not None and t < EARLY
            with np.errstate(all="ignore"):
                found = solve_ivp(
                    rhs, (t, min(end, EARLY) if early else end), y, "DOP853", rtol=1e-10, atol=1e-10,
                    dense_output=True, events=cross if event else None, max_step=0.02 if early else np.inf,
                )  # fmt: skip
            self.pieces.append((found.t[-1], found.sol, links))
            t, y = found.t[-1], found.y[:, -1]
            if found.status == 1:
                links = next_links(y[: 2 * n].reshape(n, 2), links)
        self.n = n

    def at(self, t):
        y = next(sol for end, sol, _ in self.pieces if t <= end or end == self.pieces[-1][0])(t)
        return y[: 2 * self.n].reshape(self.n, 2), y[2 * self.n :].reshape(self.n, 2)

    def links_at(self, t):
        """Link matrix at a time."""
        return next(links for end, _, links in self.pieces if t <= end or end == self.pieces[-1][0])


def gaps(q):
    d = np.sqrt(((q[None] - q[:, None]) ** 2).sum(axis=2))
    np.fill_diagonal(d, np.inf)
    return d


def radius_rule(enter, leave):
    """Links with memory: new ones below ``enter``, broken from ``leave`` on."""
    tiny = 1e-12

    def start(q):
        def step(q, links):
            d = gaps(q)
            return (links & (d < leave - tiny)) | (~links & (d < enter + tiny))

        def event(q, links):
            d = gaps(q)
            away = np.where(links, leave - d, d - enter)
            # A pair that has just switched sits at its threshold: look at it again once it has left.
            return float(np.min(np.where(np.isfinite(d), away, np.inf)) + 2 * tiny)

        return gaps(q) < leave, step, event

    return start


def fixed_rule(edges, n):
    links = np.zeros((n, n), dtype=bool)
    for i, j in edges:
        links[i, j] = links[j, i] = True
    return lambda q: (links, None, None)


@cache
def tanner_fixed_motion():
    q, p = ball_start(0)
    return Motion(q, p, 102.0, lambda r: -2 / r**3 + 2 / r, fixed_rule(random_edges(0), 10))


@cache
def tanner_dynamic_motion():
    q, p = ball_start(0, range_of_sight=2.0)
    return Motion(q, p, 102.0, lambda r: -2 / r**3 + 2 / r, radius_rule(2.0, 2.0))


@cache
def zhou_motion(leader=False):
    q, p = box_start(0)
    rule = radius_rule(3.9, 4.0)
    return Motion(q, p, 14.0, lambda d: -1 / d**2 + 1 / (4 - d) ** 2, rule, (3.0, 3.0) if leader else None)
