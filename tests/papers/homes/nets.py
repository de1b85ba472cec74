"""Graphs and nets, whole: neighbourhoods, adjacency, degrees, Laplacians, connectivity, agreement, conformations."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import sympy
from numpy.testing import assert_allclose, assert_array_equal

from flocking.errors import InvalidInput
from flocking.model.graphs.connectivity import is_connected
from flocking.model.graphs.distance_graphs import Fixed, Hysteresis, Proximity
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.smooth_graphs import PerAgentRadii, Smooth
from flocking.model.graphs.views import Cone, heading_gaps
from flocking.model.observables import density, flocks
from flocking.model.potentials.bumps import BUMPS
from flocking.papers.olfati_saber_2003 import conformations
from flocking.study.nets import matrices as nets
from flocking.study.nets.agreement import agree, agreement_law
from flocking.study.nets.rigidity import rigidity_matrix

RNG = np.random.default_rng(31)
Q = np.array([[0.0, 0.0], [3.0, 4.0], [5.0, 0.0], [4.0, -3.0], [-2.0, 1.0], [9.0, 9.0]])
RADII = np.array([5.0, 2.5, 6.0, 3.0, 5.5, 20.0])
THETA = np.array([0.0, 0.4, -0.3, 3.0, 0.5, -3.0])
OPENING = np.array([0.4, 0.3, 0.8, 0.2, 0.7, 1.0])
DIRECTED = np.array([[0, 1.5, 0, 2.0], [0, 0, 0.5, 0], [3.0, 0, 0, 0], [0, 0.25, 0, 0]])


def distance(i, j):
    return math.sqrt((Q[i][0] - Q[j][0]) ** 2 + (Q[i][1] - Q[j][1]) ** 2)


def table(rule, n=6):
    return np.array([[bool(i != j and rule(i, j)) for j in range(n)] for i in range(n)])


def per_agent_radii():
    graph = PerAgentRadii(RADII)
    assert_array_equal(graph.initial(Q), table(lambda i, j: distance(i, j) <= RADII[i]))
    assert_array_equal(PerAgentRadii(RADII, closed=False).initial(Q), table(lambda i, j: distance(i, j) < RADII[i]))
    assert graph.directed
    assert_array_equal(graph.appear_radius, RADII)
    assert_array_equal(graph.break_radius, RADII)


def proximity():
    # Agents 1, 2 and 3 are exactly 5 from the first.
    assert_array_equal(Proximity(5.0).initial(Q), table(lambda i, j: distance(i, j) < 5.0))
    assert_array_equal(Proximity(5.0, closed=True).initial(Q), table(lambda i, j: distance(i, j) <= 5.0))
    assert Proximity(5.0).appear_radius == Proximity(5.0).break_radius == 5.0
    assert not Proximity(5.0).directed


def hysteresis():
    graph = Hysteresis(4.0, 0.5)
    assert (graph.appear_radius, graph.break_radius) == (3.5, 4.0)
    for gap, start, kept, made in ((3.4, 1, 1, 1), (3.5, 1, 1, 0), (3.7, 1, 1, 0), (4.0, 0, 0, 0), (4.2, 0, 0, 0)):
        q = np.array([[0.0, 0.0], [gap, 0.0]])
        links, none = np.array([[False, True], [True, False]]), np.zeros((2, 2), dtype=bool)
        assert_array_equal(graph.initial(q), links if start else none)
        assert_array_equal(graph.update(q, links), links if kept else none)
        assert_array_equal(graph.update(q, none), links if made else none)


def fixed():
    ring = Fixed(4, ((0, 1), (1, 2), (2, 3), (3, 0)))
    neighbours = {(0, 1), (1, 2), (2, 3), (3, 0)}
    assert_array_equal(ring.initial(Q[:4]), table(lambda i, j: (i, j) in neighbours or (j, i) in neighbours, 4))
    assert not ring.directed
    arrows = Fixed(4, ((0, 1), (2, 1)), directed=True)
    assert_array_equal(arrows.initial(Q[:4]), table(lambda i, j: (i, j) in {(0, 1), (2, 1)}, 4))
    assert arrows.directed
    assert sorted(Fixed.complete(4).edges) == list(itertools.combinations(range(4), 2))
    for seed in range(5):
        rng = np.random.default_rng(seed)
        while True:
            drawn = [e for e, x in zip(itertools.combinations(range(5), 2), rng.random(10), strict=True) if x < 0.4]
            links = np.zeros((5, 5), dtype=bool)
            for i, j in drawn:
                links[i, j] = links[j, i] = True
            if np.linalg.matrix_power(links + np.eye(5), 5).all():
                break
        assert list(Fixed.random_connected(5, 0.4, seed).edges) == drawn


def cone():
    near = table(lambda i, j: distance(i, j) <= RADII[i])
    for each in (OPENING, 0.5):
        width = np.broadcast_to(each, 6)
        real = table(lambda i, j, w=width: abs(THETA[j] - THETA[i]) <= w[i])
        assert_array_equal(Cone(RADII, each).allowed(THETA), real)
        assert_array_equal(Cone(RADII, each).start_links(Q, THETA), real & near)
        assert Cone(RADII, each).directed
    assert not Cone(5.0, 0.5).directed
    assert Cone(5.0, OPENING).directed
    assert_array_equal(Cone(5.0, 9.0).start_links(Q, THETA), table(lambda i, j: distance(i, j) <= 5.0))
    wrapped = table(lambda i, j: abs(math.remainder(THETA[j] - THETA[i], 2 * math.pi)) <= 0.5)
    assert_array_equal(Cone(5.0, 0.5, "wrapped").allowed(THETA), wrapped)
    assert_array_equal(Cone(RADII, 0.5).appear_radius, RADII)
    assert_array_equal(Cone(RADII, 0.5).break_radius, RADII)
    views()


def views():
    """Differences of headings: real, wrapped, and of rotations in the plane and in space."""
    gap = THETA[None, :] - THETA[:, None]
    assert_allclose(heading_gaps(THETA, "real"), np.abs(gap))
    assert_allclose(heading_gaps(THETA, "wrapped"), np.abs([[math.remainder(x, 2 * math.pi) for x in r] for r in gap]))
    assert_allclose(heading_gaps(THETA, "rotation"), 1 - np.cos(gap), atol=1e-12)
    plane = np.array([[[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]] for a in THETA])
    assert_allclose(heading_gaps(plane, "rotation"), 1 - np.cos(gap), atol=1e-12)
    turns = []
    for seed in range(4):
        found = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
        turns.append(found * np.sign(np.linalg.det(found)))
    space = np.array(turns)
    expected = [[0.5 * np.trace(np.eye(3) - b.T @ a) for b in space] for a in space]
    assert_allclose(heading_gaps(space, "rotation"), expected, atol=1e-12)
    for seed in range(40):
        frame = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
        opposite = np.array([frame, frame * [-1.0, -1.0, 1.0]]) * np.linalg.det(frame)
        found = heading_gaps(opposite, "rotation")
        assert found.max() <= 2.0, "trace(I - R^T R)/2 is at most 2 in space, whatever the rounding"
        assert found.min() >= 0.0
    assert_allclose(heading_gaps(np.array([np.eye(4), -np.eye(4)]), "rotation"), [[0.0, 4.0], [4.0, 0.0]])
    # What is no rotation to nine digits is refused: a shear, another size, a mirror image.
    for off, refused in ((2e-9, True), (0.5e-9, False)):
        for wrong in ([[1.0, off], [0.0, 1.0]], [[1.0 + off / 2, 0.0], [0.0, 1.0]]):
            turned = np.array([np.eye(2), wrong])
            if not refused:
                assert_allclose(heading_gaps(turned, "rotation"), 0.0, atol=1e-8)
                continue
            with pytest.raises(InvalidInput, match="Agents: headings must be rotation matrices"):
                heading_gaps(turned, "rotation")
    with pytest.raises(InvalidInput, match="Agents: headings must be rotation matrices"):
        heading_gaps(np.array([np.eye(2), np.diag([1.0, -1.0])]), "rotation")
    with pytest.raises(InvalidInput, match="must be 'rotation'"):
        heading_gaps(plane, "real")


def rho(z, k0):
    if z <= k0:
        return 1.0
    return (1 + math.cos(math.pi * (z - k0) / (1 - k0))) / 2 if z < 1 else 0.0


def smooth():
    graph = Smooth(10.0, 0.6)
    assert_array_equal(graph.initial(Q), table(lambda i, j: distance(i, j) < 10.0))
    assert (graph.appear_radius, graph.break_radius, graph.kinks()) == (10.0, 10.0, (6.0,))
    assert graph.parameters == {"radius": 10.0, "onset": 0.6}
    assert graph.shape is BUMPS["cosine"]
    expected = [[rho(distance(i, j) / 10.0, 0.6) if i != j else 0.0 for j in range(6)] for i in range(6)]
    assert_allclose(nets.adjacency(graph, Q), expected, atol=1e-12)
    r = sympy.Symbol("r", positive=True)
    weight = graph.weight(r, lambda name: {"radius": sympy.Integer(10), "onset": sympy.Rational(3, 5)}[name])
    for x in (1.0, 5.9, 6.5, 8.0, 9.9, 10.5):
        assert_allclose(float(weight.subs(r, x)), rho(x / 10.0, 0.6), atol=1e-12)


def smooth_cone():
    graph = SmoothCone(10.0, 0.6, 0.9)
    near = table(lambda i, j: distance(i, j) < 10.0)
    alike = table(lambda i, j: abs(THETA[j] - THETA[i]) < 0.9)
    assert_array_equal(graph.allowed(THETA), alike)
    assert_array_equal(graph.start_links(Q, THETA), near & alike)
    assert_array_equal(graph.allowed(np.array([0.0, 0.9])), np.zeros((2, 2), dtype=bool))
    assert (graph.appear_radius, graph.break_radius, graph.kinks()) == (10.0, 10.0, (6.0,))
    expected = [
        [rho(distance(i, j) / 10, 0.6) * rho(abs(THETA[j] - THETA[i]) / 0.9, 0.6) * (i != j) for j in range(6)]
        for i in range(6)
    ]
    assert_allclose(nets.adjacency(graph, Q, THETA), expected, atol=1e-12)
    assert {x for row in expected for x in row if 0 < x < 1}


def adjacency():
    net = PerAgentRadii(RADII)
    seen = table(lambda i, j: distance(i, j) <= RADII[i]).astype(float)
    assert_array_equal(nets.adjacency(net, Q), seen)
    some = np.zeros((6, 6), dtype=bool)
    some[0, 3] = some[2, 1] = True
    assert_array_equal(nets.adjacency(net, Q, links=some), some.astype(float))
    smooth()
    smooth_cone()


def in_degree():
    assert_allclose(nets.in_degree(DIRECTED), [3.0, 1.75, 0.5, 2.0])
    assert_allclose(nets.out_degree(DIRECTED), [3.5, 0.5, 3.0, 0.25])
    assert_allclose(nets.in_degree((DIRECTED > 0).tolist()), [1, 2, 1, 1])


def degree_matrix():
    in_degree()
    assert_allclose(nets.degree_matrix(DIRECTED), np.diag([3.5, 0.5, 3.0, 0.25]))


def laplacian():
    expected = [[3.5, -1.5, 0, -2.0], [0, 0.5, -0.5, 0], [-3.0, 0, 3.0, 0], [0, -0.25, 0, 0.25]]
    assert_allclose(nets.laplacian(DIRECTED), expected)
    assert_allclose(nets.laplacian([[False, True], [True, False]]), [[1.0, -1.0], [-1.0, 1.0]])
    assert nets.laplacian(DIRECTED.tolist()).shape == (4, 4)


def is_balanced():
    cycle = np.roll(np.eye(5), 1, axis=1)
    assert nets.is_balanced(cycle)
    assert nets.is_balanced(cycle * 7.0 + cycle.T * 2.0)
    assert not nets.is_balanced(DIRECTED)
    bent = cycle.copy()
    bent[0, 1] += 1e-6
    assert not nets.is_balanced(bent)
    # Rounding grows with the weights.
    assert nets.is_balanced(bent * 1e-8 + cycle * 1e3)
    assert not nets.is_balanced(bent * 1e-2)
    bent[0, 1] = 1.0 + 3e-12
    assert not nets.is_balanced(bent)
    assert nets.is_balanced(bent, tolerance=4e-12)
    for size, gap, balanced in ((0.1, 1.05e-13, False), (0.1, 0.95e-13, True), (1e3, 0.9e-9, True), (1e3, 2e-9, False)):
        bent = size * cycle
        bent[0, 1] += gap
        assert nets.is_balanced(bent) is balanced


def flock_members():
    links = np.zeros((8, 8), dtype=bool)
    for i, j in ((6, 2), (2, 7), (1, 4), (3, 5)):
        links[i, j] = True
    found = [members.tolist() for members in nets.flock_members(links)]
    assert found == [[2, 6, 7], [1, 4], [3, 5], [0]]
    assert flocks(links) == 4
    assert_allclose(density(links), 3 / 8)
    assert flocks(np.zeros((3, 3), dtype=bool)) == 3
    assert_allclose(density(np.eye(4, k=1, dtype=bool)), 1.0)


def is_quasi_flock():
    def one_apart(n):
        links = np.ones((n, n), dtype=bool)
        links[-1, :] = links[:, -1] = False
        return links

    assert [nets.is_quasi_flock(one_apart(n)) for n in (9, 10, 11, 21)] == [False, True, True, True]
    assert not nets.is_quasi_flock(np.ones((5, 5), dtype=bool)), "a flock is none"
    assert nets.is_quasi_flock(one_apart(5), share=0.8)
    assert not nets.is_quasi_flock(one_apart(5), share=0.85)


def algebraic_connectivity():
    path = np.diag([1.0, 1.0, 1.0], 1) + np.diag([1.0, 1.0, 1.0], -1)
    assert_allclose(nets.algebraic_connectivity(path), 2 - math.sqrt(2))
    assert_allclose(nets.algebraic_connectivity(np.ones((5, 5)) - np.eye(5)), 5.0)
    assert_allclose(nets.algebraic_connectivity([[0.0, 0.3], [0.3, 0.0]]), 0.6)
    assert_allclose(nets.algebraic_connectivity(np.kron(np.eye(2), 1 - np.eye(3))), 0.0, atol=1e-12)
    for off, refused in ((0.9e-12, False), (1.1e-12, True), (0.5, True)):
        bent = np.array([[0.0, 3.0 * (1.0 - off)], [3.0, 0.0]])
        if refused:
            with pytest.raises(InvalidInput, match="symmetric"):
                nets.algebraic_connectivity(bent)
        else:
            assert_allclose(nets.algebraic_connectivity(bent), 6.0)


def connected():
    line = np.eye(6, k=1, dtype=bool)
    assert is_connected(line)
    assert is_connected(line.T)
    star = np.zeros((6, 6), dtype=bool)
    star[3] = True
    assert is_connected(star)
    for k in range(5):
        cut = line.copy()
        cut[k, k + 1] = False
        assert not is_connected(cut)
        assert not is_connected(cut | cut.T)
    assert is_connected(np.zeros((1, 1), dtype=bool))
    # Small groups are asked about in another way than those of more than 64 agents.
    for n in (9, 20, 63, 64, 65, 70):
        long = np.eye(n, k=1, dtype=bool)
        assert is_connected(long)
        for k in (0, n // 2, n - 2):
            cut = long.copy()
            cut[k, k + 1] = False
            assert not is_connected(cut)
    # Two agents see the third, who sees nobody.
    assert is_connected(np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]], dtype=bool))


def law_of_agreement():
    from flocking.engine.reference.control import evaluate
    from flocking.model.state import Agents, State

    theta = np.array([0.3, -1.0, 2.0, 0.7])
    one_way = DIRECTED > 0
    for links in (one_way, one_way | one_way.T):
        law = agreement_law(links)
        assert law.graph.directed == bool((links != links.T).any())
        found = evaluate(law, State(theta[:, None]), agents=Agents(order=1)).u[:, 0]
        assert_allclose(found, [sum(theta[j] - theta[i] for j in range(4) if links[i, j]) for i in range(4)])
    assert len(agreement_law(one_way | one_way.T).graph.edges) == 5


def agreement():
    theta, cycle = np.array([1.0, -2.0, 0.5, 3.0]), np.roll(np.eye(4), 1, axis=1)
    found = agree(theta, [DIRECTED, cycle, DIRECTED], [2.0, 2.5, 2.9, 2.9])
    now, expected = theta, [theta]
    for net, length in ((DIRECTED, 0.5), (cycle, 0.4)):
        term, total = now, now.copy()
        for k in range(1, 40):
            term = length / k * np.array([sum(net[i, j] * (term[j] - term[i]) for j in range(4)) for i in range(4)])
            total = total + term
        now = total
        expected.append(now)
    assert_allclose(found, [*expected, now], rtol=1e-10)


def rigidity():
    q = np.array([[0.0, 0.0], [2.0, 1.0], [-1.0, 3.0]])
    one_way = np.zeros((3, 3), dtype=bool)
    one_way[0, 1] = one_way[2, 1] = one_way[2, 0] = True
    expected = [[-2, -1, 2, 1, 0, 0], [1, -3, 0, 0, -1, 3], [0, 0, 3, -2, -3, 2]]
    assert_allclose(rigidity_matrix(q, one_way), expected)
    assert_allclose(rigidity_matrix(q, one_way | one_way.T), expected)


def shapes():
    """Every conformation keeps its lengths and gaps, up to its limit and no further; counts by brute force."""
    for n in range(1, 5):
        found = conformations.conformations(n, 1.2)
        for shape in found:
            q = shape.placed(1.0, 1.2)
            assert len(q) == n
            for i, j in itertools.combinations(range(n), 2):
                d = math.dist(q[i], q[j])
                assert (abs(d - 1) < 1e-9) if (i, j) in shape.edges else (d > 1.2)
        assert len({s.name for s in found}) == len(found)
    tail = math.hypot(1 + math.sqrt(3) / 2, 0.5)
    limits = {3: [2.0, *[math.inf] * 3], 4: [math.sqrt(2), *[math.sqrt(3)] * 2, tail, 2.0, 2.0, *[math.inf] * 4]}
    for n, known in limits.items():
        for k in (1.2, math.sqrt(2), 1.5, math.sqrt(3), 1.8, 1.95, 2.0, 2.1):
            expected = sum(k < limit - 1e-12 for limit in known)
            assert len(conformations.conformations(n, k)) == conformations.count(n, k) == expected
    assert [conformations.count(n, 3.0) for n in (1, 2)] == [1, 2]
    assert [conformations.upper_bound(n) for n in range(1, 9)] == [2 ** sum(range(n)) for n in range(1, 9)]


def refused_beyond_four():
    shapes()
    with pytest.raises(InvalidInput, match="at most 4"):
        conformations.conformations(5, 1.2)


MODEL, STUDY, SABER = "flocking.model", "flocking.study", "flocking.papers.olfati_saber_2003"
HOMES = {
    f"{MODEL}.graphs.smooth_graphs.PerAgentRadii": per_agent_radii,
    f"{MODEL}.graphs.smooth_graphs.Smooth": smooth,
    f"{MODEL}.graphs.distance_graphs.Proximity": proximity,
    f"{MODEL}.graphs.distance_graphs.Hysteresis": hysteresis,
    f"{MODEL}.graphs.distance_graphs.Fixed": fixed,
    f"{MODEL}.graphs.views.Cone": cone,
    f"{MODEL}.graphs.smooth_cones.SmoothCone": smooth_cone,
    f"{MODEL}.graphs.views.heading_gaps": views,
    f"{MODEL}.observables.density": flock_members,
    f"{MODEL}.observables.flocks": flock_members,
    f"{MODEL}.graphs.connectivity.is_connected": connected,
    f"{STUDY}.nets.matrices.adjacency": adjacency,
    f"{STUDY}.nets.matrices.in_degree": in_degree,
    f"{STUDY}.nets.matrices.degree_matrix": degree_matrix,
    f"{STUDY}.nets.matrices.laplacian": laplacian,
    f"{STUDY}.nets.matrices.is_balanced": is_balanced,
    f"{STUDY}.nets.matrices.flock_members": flock_members,
    f"{STUDY}.nets.matrices.is_quasi_flock": is_quasi_flock,
    f"{STUDY}.nets.matrices.algebraic_connectivity": algebraic_connectivity,
    f"{STUDY}.nets.agreement.agreement_law": law_of_agreement,
    f"{STUDY}.nets.agreement.agree": agreement,
    f"{STUDY}.nets.rigidity.rigidity_matrix": rigidity,
    f"{SABER}.conformations.conformations": refused_beyond_four,
    f"{SABER}.conformations.count": shapes,
    f"{SABER}.conformations.upper_bound": shapes,
}
