"""Sections 2 and 3 of Olfati-Saber 2003, typed once more, held against the objects of his equation table."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.testing import assert_allclose

D, R, K0, PHI = 7.0, 8.4, 5 / 6, 0.6
GAP = 1.005 * R
SIX = [(0.0, 0.0), (GAP, 0.0), (3.0, 4.0), (GAP + 2, 6.0), (-5.0, 5.5), (2.0, -6.5)]
RADII = [8.4, 4.0, 7.0, 7.5, 3.0, 6.8]
HEADINGS = [0.0, 0.2, 0.603, 0.9, 1.4, -0.5]
CLOSE = [(0.0, 0.0), (7.5, 0.0), (3.5, 6.8), (11.0, 6.6), (-4.1, 6.2), (3.0, -7.2)]
THETA = [0.3, -1.0, 2.0, 0.7, -0.4, 1.1]
LINE = [(0.0, 0.0), (3.0, 0.0), (6.0, 0.0), (6.0 + GAP, 0.0), (12.0 + GAP, 0.0)]


def dist(x, y):
    return math.sqrt(sum((a - b) ** 2 for a, b in zip(x, y, strict=True)))


def matrix(n, rule):
    return np.array([[float(i != j and rule(i, j)) for j in range(n)] for i in range(n)])


def rho(z, k0=K0):
    if z <= k0:
        return 1.0
    return 0.5 * (1 + math.cos(math.pi * (z - k0) / (1 - k0))) if z < 1 else 0.0


def d_rho(z, k0=K0):
    return -0.5 * math.pi / (1 - k0) * math.sin(math.pi * (z - k0) / (1 - k0)) if k0 < z < 1 else 0.0


def directed():
    return matrix(6, lambda i, j: dist(SIX[i], SIX[j]) <= RADII[i])


def uniform():
    return matrix(6, lambda i, j: dist(SIX[i], SIX[j]) <= R)


def ball(found):
    assert found.tolist() == [False] + [dist(SIX[0], x) <= R for x in SIX[1:]]


def adjacency(expected):
    return lambda found: assert_allclose(found, expected(), rtol=1e-12, atol=1e-15)


def neighbours(found):
    assert found == [[j for j in range(6) if directed()[i, j]] for i in range(6)]


def undirected(pair):
    same, other = pair
    assert (same == same.T).all()
    assert (other != other.T).any()


def fig_1(found):
    near = [False] + [dist(SIX[0], x) <= R for x in SIX[1:]]
    assert found["shell"].tolist() == near
    bearing = [abs(math.atan2(y, x)) <= math.pi / 3 for x, y in SIX]
    assert found["view"][0].tolist() == [a and b for a, b in zip(near, bearing, strict=True)]
    assert (found["view"] != found["view"].T).any()


def cone(found):
    expected = matrix(6, lambda i, j: dist(SIX[i], SIX[j]) <= R and abs(HEADINGS[j] - HEADINGS[i]) <= PHI)
    assert (found == expected).all()
    assert (found == found.T).all()


def own_cones(found):
    opening = [PHI * x for x in (1.0, 0.5, 1.0, 1.2, 0.8, 2.0)]
    inside = matrix(6, lambda i, j: dist(SIX[i], SIX[j]) <= RADII[i] and abs(HEADINGS[j] - HEADINGS[i]) <= opening[i])
    assert (found == inside).all()
    assert (found != found.T).any()


def attitudes(triple):
    q, rotation, net = triple
    limit = (1 - math.cos(1.0)) / 1.005
    gap = [[0.5 * np.trace(np.eye(3) - rotation[j].T @ rotation[i]) for j in range(5)] for i in range(5)]
    assert (net == matrix(5, lambda i, j: dist(q[i], q[j]) <= R and gap[i][j] <= limit)).all()
    assert 0 < net.sum() < 20


def flocks(found):
    # Who sees whom, by each agent's own radius: 0-1, 1-2 and 3-4.
    assert found == [[0, 1, 2], [3, 4]]


def density(found):
    together = [i for i in range(5) if LINE[i][0] <= 6.0]
    assert_allclose(found, max(len(together), 5 - len(together)) / 5)


def quasi(pair):
    assert_allclose(pair[0], 19 / 20)
    assert pair[1] is True


def degrees(pair):
    net = directed()
    assert_allclose(pair[0], [sum(net[j][i] for j in range(6)) for i in range(6)])
    assert_allclose(pair[1], [sum(net[i][j] for j in range(6)) for i in range(6)])


def degree_matrix(found):
    assert_allclose(found, np.diag([sum(row) for row in directed()]))


def laplacian(found):
    net = directed()
    assert_allclose(found, [[sum(net[i]) if i == j else -net[i][j] for j in range(6)] for i in range(6)])


def balanced(pair):
    assert pair[0]
    assert_allclose(pair[1], 0.0, atol=1e-15)


def columns(triple):
    sums, into, out = triple
    net = directed()
    assert_allclose(into, net.sum(axis=0))
    assert_allclose(out, net.sum(axis=1))
    assert_allclose(sums, out - into)
    assert np.abs(sums).max() > 0


def omega():
    net = uniform()
    return [sum(net[i, j] * (THETA[j] - THETA[i]) for j in range(6)) for i in range(6)]


def first_order(pair):
    assert_allclose(pair[0], THETA)
    assert_allclose(pair[1], omega(), rtol=1e-4)


def two_nets(pair):
    assert (pair[0] == 0).all()
    assert pair[1].tolist() == [[0, 1], [1, 0]]


def two_laplacians(pair):
    assert (pair[0] == 0).all()
    assert pair[1].tolist() == [[1, -1], [-1, 1]]


POINTS = [-1.0, 0.0, 0.5, 0.83, 0.86, 0.9, 0.95, 0.99, 1.0, 1.5]


def bumps(found):
    assert set(found) == {"cosine", "quintic", "infinite"}
    for values, slopes in found.values():
        for z, value, slope in zip(POINTS, values, slopes, strict=True):
            if z <= K0:
                assert (value, slope) == (1.0, 0.0)
            elif z >= 1:
                assert (value, slope) == (0.0, 0.0)
            else:
                assert 0 < value < 1
                assert slope <= 0
    assert_allclose(found["cosine"][0], [rho(z) for z in POINTS], rtol=1e-9, atol=1e-15)
    assert_allclose(found["cosine"][1], [d_rho(z) for z in POINTS], rtol=1e-9, atol=1e-15)


def steepest(found):
    assert_allclose(found["cosine"], math.pi / 2 * 6, rtol=1e-9)
    assert_allclose(found["quintic"], 15 / 8 * 6, rtol=1e-6)
    assert_allclose(found["infinite"], 2 * 6, rtol=1e-6)


def fig_2(pair):
    assert_allclose(pair[0], [rho(z / 12) for z in range(15)], atol=1e-12)
    assert_allclose(pair[1], [d_rho(z / 12) for z in range(15)], atol=1e-12)


def smooth(found):
    expected = [[rho(dist(x, y) / R) if x != y else 0.0 for y in CLOSE] for x in CLOSE]
    assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    assert ((found > 0) & (found < 1)).any()


def smooth_cone(found):
    expected = [
        [rho(dist(CLOSE[i], CLOSE[j]) / R) * rho(abs(HEADINGS[j] - HEADINGS[i]) / PHI) * (i != j) for j in range(6)]
        for i in range(6)
    ]
    assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def smooth_laplacian(found):
    assert_allclose(found, rho(7.8 / R) * np.array([[1, -1], [-1, 1]]), rtol=1e-9)


# -- structural nets ------------------------------------------------------------------------------------


def structural(found):
    n, d, r, k0 = found
    assert (n, d) == (100, 7.0)
    assert_allclose([r, k0], [1.2 * d, d / r], rtol=1e-12)


def framework(found):
    assert_allclose(found, [[-7, 0, 7, 0, 0, 0], [0, 0, 0, -7, 0, 7]], atol=1e-12)


def links_of(q):
    return [(i, j) for i, j in itertools.combinations(range(len(q)), 2) if dist(q[i], q[j]) <= R * (1 + 1e-9)]


def realizes(pair):
    q, said = pair
    lengths = [dist(q[i], q[j]) for i, j in links_of(q)]
    assert len(lengths) > 0
    assert_allclose(lengths, D, rtol=1e-9)
    assert said


def polygon(triple):
    q, links, said = triple
    realizes((q, said))
    assert (links.sum(axis=1) == 2).all()
    assert len(links_of(q)) == 6


def reach(q):
    groups = [{i} for i in range(len(q))]
    for i, j in links_of(q):
        a, b = (next(g for g in groups if k in g) for k in (i, j))
        if a is not b:
            groups.remove(b)
            a |= b
    return groups


def alpha_flocks(found):
    assert len(found) == 10
    assert all(realized for realized, _ in found)
    # Of the six connected graphs on four nodes all but the complete one.
    assert sorted(count for _, count in found) == [1, 1, 1, 1, 1, 2, 2, 2, 3, 4]


def six(found):
    counts = []
    for q, links in found:
        pairs = links_of(q)
        assert_allclose([dist(q[i], q[j]) for i, j in pairs], D, rtol=1e-9)
        assert {(i, j) for i, j in zip(*np.nonzero(np.triu(links)), strict=True)} == set(pairs)
        counts.append((len(pairs), max(len(g) for g in reach(q)) / 4))
    assert counts == [(0, 0.25), (2, 0.5), (4, 1.0), (3, 1.0), (5, 1.0), (5, 1.0)]
    linked = [{(i + 1, j + 1) for i, j in links_of(q)} for q, _ in found]
    assert linked[1] == {(1, 2), (3, 4)}
    cycle = {(1, 2), (1, 3), (2, 4), (3, 4)}
    assert linked[2] == cycle
    assert linked[4] == cycle | {(1, 4)}
    assert linked[5] == cycle | {(2, 3)}


def graph_count(n):
    """Graphs on n nodes up to renumbering, by brute force."""
    pairs = list(itertools.combinations(range(n), 2))
    seen = set()
    for chosen in itertools.product((0, 1), repeat=len(pairs)):
        edges = {p for p, c in zip(pairs, chosen, strict=True) if c}
        renumbered = []
        for order in itertools.permutations(range(n)):
            renumbered.append(tuple(sorted(tuple(sorted((order[a], order[b]))) for a, b in edges)))
        seen.add(min(renumbered))
    return len(seen)


def counts(found):
    assert found == [graph_count(1), graph_count(2), graph_count(3), graph_count(4) - 1]


def counts_over_k(found):
    # Complete never; a square below sqrt 2; star and rhombus below sqrt 3; a tail below 1.932; chains below 2.
    tail = math.hypot(1 + math.sqrt(3) / 2, 0.5)
    limits = [math.sqrt(2), math.sqrt(3), math.sqrt(3), tail, 2.0, 2.0, *[math.inf] * 4]
    assert found == [sum(k < limit for limit in limits) for k in (1.2, 1.407, 1.5, 1.75, 1.94, 2.1)]


def bounded_counts(found):
    assert [f for f, _ in found] == [1, 2, 4, 10]
    assert [b for _, b in found] == [2 ** (n * (n - 1) // 2) for n in (1, 2, 3, 4)]
    assert all(f <= b for f, b in found)


CHECKS = {
    "(1)": ball,
    "(2)": adjacency(directed),
    "(3)": neighbours,
    "after (3)": undirected,
    "(4)": own_cones,
    "(5)": cone,
    "after (6)": cone,
    "Remark 1": attitudes,
    "(6)": attitudes,
    "Definition 1": flocks,
    "(7)": density,
    "quasi-flock": quasi,
    "(8)": adjacency(uniform),
    "(9)": degrees,
    "(10)": degree_matrix,
    "(11)": laplacian,
    "Proposition 1 i)": balanced,
    "Proposition 1 ii)": columns,
    "proof of Proposition 1 ii)": columns,
    "(12)": first_order,
    "(13)": lambda found: assert_allclose(found, omega(), rtol=1e-12),
    "(14)": two_nets,
    "(15)": two_laplacians,
    "(16)": bumps,
    "L_rho": steepest,
    "(17)": smooth,
    "(18)": smooth_cone,
    "(19)": smooth_laplacian,
    "Lemma 1": lambda found: assert_allclose(found, 0.0, atol=1e-15),
    "Remark 2": structural,
    "Note 1": framework,
    "(20)": realizes,
    "polygons": polygon,
    "Lemma 2": realizes,
    "Note 2": alpha_flocks,
    "Example 1": six,
    "Problem 1": counts_over_k,
    "Lemma 3": bounded_counts,
    "Remark 3": counts,
}
