"""Structural nets: realizations, energies, defect factors, votes, rigidity and conformations."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.graphs.distance_graphs import pair_distances
from flocking.papers.olfati_saber_2003 import conformations
from flocking.papers.olfati_saber_2003 import structural_nets as structure
from flocking.study.linearisation import linearise
from flocking.study.nets import rigidity

D, R = 7.0, 8.4
PSI = fk.structural_potential(D)


def hexagons(n: int = 19, scale: float = 1.0) -> np.ndarray:
    return fk.start.hexagonal(n, spacing=D * scale, seed=0).q


def test_phi_alpha_has_the_printed_form() -> None:
    a, b = 1.0, 5.0
    c = abs(a - b) / (2 * np.sqrt(a * b))
    z = np.linspace(-D, 3, 50)
    phi = (a + b) / 2 * (z + c) / np.sqrt(1 + (z + c) ** 2) + (a - b) / 2
    np.testing.assert_allclose(PSI.slope(z + D), phi, atol=1e-13)
    assert abs(float(PSI.slope(D))) < 1e-15
    assert abs(float(PSI.slope(0.0))) < b


def test_realization() -> None:
    q = hexagons()
    assert structure.is_realization(q, D, R)
    assert not structure.is_realization(1.001 * q, D, R)
    assert not structure.is_realization(q, D, np.sqrt(3) * D)
    assert structure.is_realization(np.random.default_rng(0).permutation(q), D, R)  # Lemma 2


def test_defect_of_a_realization_is_zero_and_grows_with_strain() -> None:
    graph = fk.Smooth(R, D / R)
    none = structure.defect(graph, PSI, fk.State(hexagons()))
    assert none.factor == pytest.approx(0.0, abs=1e-9)
    assert none.links == 42
    one, two = (structure.defect(graph, PSI, fk.State(hexagons(scale=s))).normalized for s in (0.99, 0.97))
    assert 0 < one < two
    assert structure.is_quasi_realization([structure.defect(graph, PSI, fk.State(hexagons(scale=0.999)))] * 3)
    assert not structure.is_quasi_realization([structure.defect(graph, PSI, fk.State(hexagons(scale=0.8)))] * 3)


def test_defect_pieces_by_hand() -> None:
    """Two agents: V = psi, grad V = (-phi, phi), one link, h_0 = psi(r)."""
    found = structure.defect(fk.Proximity(R), PSI, fk.State([[0.0, 0.0], [6.0, 0.0]]), weight=0.5)
    psi, phi = float(PSI(6.0)), float(PSI.slope(6.0))
    assert found.factor == pytest.approx(psi + 0.5 * 2 * phi**2)
    assert found.normalized == pytest.approx(found.factor / float(PSI(R)))


def test_structural_energy_is_the_ledgers() -> None:
    """H_s of (27) is the energy the engines keep in the frame of the centre of mass."""
    rng = np.random.default_rng(1)
    state = fk.State(rng.uniform(0, 15, (9, 2)), rng.normal(size=(9, 2)))
    for graph in (fk.Smooth(R, D / R), fk.Proximity(R)):
        pieces = structure.structural_energy(graph, PSI, state)
        law = fk.Law(graph, [fk.Gradient(PSI), fk.Consensus()])
        found = fk.evaluate(law, state, energy=fk.Energy("centre of mass"))
        assert pieces.potential == pytest.approx(found.storage)
        assert pieces.relative_kinetic == pytest.approx(found.kinetic)
        assert pieces.total == pytest.approx(found.storage + found.kinetic)


def test_votes_give_the_undamped_control() -> None:
    rng = np.random.default_rng(2)
    particles, loose = rng.uniform(0, 16, (10, 2)), hexagons(7, 1.1) + 0.3 * rng.normal(size=(7, 2))
    q = np.concatenate([particles, loose + 50.0])
    graph = fk.Proximity(R)
    weights = structure.vote_weights(graph, PSI, fk.State(q))
    u = fk.control(fk.Law(graph, [fk.Gradient(PSI)]), fk.State(q))
    cases = set()
    for i in range(17):
        found = structure.vote(weights, q, i)
        cases.add(found.case)
        np.testing.assert_allclose(found.control, u[i], atol=1e-12)
        if found.case != 3:
            assert (found.total > 0) == (found.case == 1)
            assert float(found.control @ (found.average - q[i])) * found.total > 0
    assert cases >= {1, 2}


def test_vote_of_two_equal_groups() -> None:
    """Case iii: S = 0, and the agent moves along the difference of both averages."""
    q = np.array([[0.0, 0.0], [6.0, 1.0], [-2.0, 8.0], [1.0, 1.0]])
    weights = np.zeros((4, 4))
    weights[0] = [0.0, 0.7, -0.7, 0.0]
    found = structure.vote(weights, q, 0)
    assert found.case == 3
    np.testing.assert_allclose(found.control, weights[0] @ q, atol=1e-14)
    np.testing.assert_allclose(found.average_positive, q[1])
    np.testing.assert_allclose(found.average_negative, q[2])
    assert structure.vote(np.zeros((4, 4)), q, 0).control.tolist() == [0.0, 0.0]


def links_of(q: np.ndarray, radius: float) -> np.ndarray:
    return pair_distances(q) <= radius


def test_rigidity_of_known_frameworks() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    cycle = links_of(square, 1.1)
    assert rigidity.degrees_of_freedom(square, cycle) == 1
    braced = cycle.copy()
    braced[0, 2] = braced[2, 0] = True
    assert rigidity.is_rigid(square, braced)
    assert rigidity.rank(square, braced) == 5
    assert rigidity.is_rigid(hexagons(), links_of(hexagons(), R))
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
    assert rigidity.is_rigid(corners, links_of(corners, 3.0))
    cube = np.array(list(itertools.product([0.0, 1.0], repeat=3)))
    assert rigidity.degrees_of_freedom(cube, links_of(cube, 1.1)) == 6
    flat = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    assert not rigidity.is_rigid(flat, ~np.eye(3, dtype=bool))
    assert rigidity.is_rigid(flat[:2], ~np.eye(2, dtype=bool))
    assert rigidity.degrees_of_freedom(flat[:1], np.zeros((1, 1), dtype=bool)) == 0


def test_planarity_and_faces() -> None:
    q = hexagons(7)
    links = links_of(q, R)
    assert rigidity.crossing_links(q, links) == 0
    assert len(rigidity.faces(q, links)) == 6
    assert rigidity.triangle_share(q, links) == 1.0
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    complete = ~np.eye(4, dtype=bool)
    assert rigidity.crossing_links(square, complete) == 1
    assert rigidity.is_planar_graph(complete)
    assert not rigidity.is_planar_graph(~np.eye(5, dtype=bool))
    with pytest.raises(InvalidInput, match="cross"):
        rigidity.faces(square, complete)
    tailed = np.vstack([square, [[2.0, 0.0]]])
    links = links_of(tailed, 1.1)
    assert [len(f) for f in rigidity.faces(tailed, links)] == [4]
    assert rigidity.triangle_share(tailed, links) == 0.0


@pytest.mark.parametrize("ratio", [1.01, 1.2, 1.41, 1.42, 1.7, 1.8, 1.95, 3.0])
def test_every_conformation_is_a_realization_with_its_graph(ratio: float) -> None:
    import networkx

    for n in (1, 2, 3, 4):
        found = conformations.conformations(n, ratio)
        graphs = []
        for each in found:
            q = each.placed(2.5, ratio)
            assert structure.is_realization(q, 2.5, 2.5 * ratio), each.name
            np.testing.assert_array_equal(pair_distances(q) <= 2.5 * ratio, each.links)
            graphs.append(rigidity.as_networkx(each.links))
        for one, two in itertools.combinations(graphs, 2):
            assert not networkx.is_isomorphic(one, two)
        assert len(found) <= conformations.upper_bound(n)


def test_numbers_of_conformations() -> None:
    """Remark 3 prints 1, 2, 4, 9 for 1 < k < sqrt 2; the last is 10."""
    assert [conformations.count(n, 1.2) for n in (1, 2, 3, 4)] == [1, 2, 4, 10]
    assert conformations.count(4, np.sqrt(2)) == 9
    assert conformations.count(4, 1.7) == 9
    assert conformations.count(4, 1.75) == 7
    assert [conformations.upper_bound(n) for n in (1, 2, 3, 4)] == [1, 2, 8, 64]
    with pytest.raises(InvalidInput, match="ratio"):
        conformations.count(4, 1.0)
    with pytest.raises(InvalidInput, match="at most 4"):
        conformations.count(5, 1.2)


def widest_gap(edges: tuple[tuple[int, int], ...], seed: int) -> float:
    """Largest gap random search finds for the non-neighbours of a graph on 4 agents."""
    from scipy.optimize import minimize

    linked = set(edges)
    others = [pair for pair in itertools.combinations(range(4), 2) if pair not in linked]
    rng = np.random.default_rng(seed)
    best = 0.0
    for _ in range(12):
        x0 = np.append(rng.normal(size=8), 1.0)
        bounds = [(-6, 6)] * 8 + [(0, 4)]

        def length(x: np.ndarray, i: int, j: int) -> float:
            return float(((x[2 * i : 2 * i + 2] - x[2 * j : 2 * j + 2]) ** 2).sum())

        rules = [{"type": "eq", "fun": lambda x, i=i, j=j: length(x, i, j) - 1} for i, j in edges]
        rules += [{"type": "ineq", "fun": lambda x, i=i, j=j: length(x, i, j) - x[8] ** 2} for i, j in others]
        found = minimize(lambda x: -x[8], x0, bounds=bounds, constraints=rules, method="SLSQP")
        if found.success and all(abs(length(found.x, i, j) - 1) < 1e-6 for i, j in edges):
            best = max(best, float(found.x[8]))
    return best


def test_limits_of_the_tight_conformations() -> None:
    """No placement keeps a larger gap than the listed one: the limits are those of a numerical search."""
    tight = [c for c in conformations.conformations(4, 1.01) if np.isfinite(c.limit) and c.limit < 2]
    assert len(tight) == 4
    for each in tight:
        assert widest_gap(each.edges, 0) == pytest.approx(each.limit, abs=1e-4), each.name


def test_linearisation_of_a_hexagon() -> None:
    law = fk.Law(fk.Smooth(R, D / R), [fk.Gradient(PSI), fk.Consensus()])
    found = linearise(law, fk.State(hexagons(7)))
    assert found.force < 1e-9
    assert found.asymmetry < 1e-6
    assert found.zero_modes() == 3
    assert found.eigenvalues.real.max() < 1e-4
    # The slope of the smooth potential jumps at its zero only in third order: compare the exact stiffness.
    q, curvature = hexagons(7), float(PSI.curvature(D))
    R0 = rigidity.rigidity_matrix(q, links_of(q, R)) / D
    np.testing.assert_allclose(found.stiffness, curvature * R0.T @ R0, atol=1e-4)


def test_linearisation_of_a_square_has_a_soft_mode() -> None:
    square = D * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    law = fk.Law(fk.Proximity(R), [fk.Gradient(PSI), fk.Track(fk.Sink([0.0, 0.0]), velocity_gain=2.0)])
    found = linearise(law, fk.State(square), agents=fk.Agents(masses=2.0, damping=0.5))
    assert found.zero_modes() == 4
    np.testing.assert_allclose(found.damping, 2.5 * np.eye(8), atol=1e-8)
    slow = np.sort(found.eigenvalues.real)[-4:]
    np.testing.assert_allclose(slow, 0.0, atol=1e-3)
    with pytest.raises(InvalidInput, match="order"):
        linearise(law, fk.State(square), agents=fk.Agents(order=1))


def tree_links(n: int, rng: np.random.Generator) -> np.ndarray:
    links = np.zeros((n, n), dtype=bool)
    for k in range(1, n):
        j = rng.integers(k)
        links[k, j] = links[j, k] = True
    return links


def test_trees_have_no_bounded_face() -> None:
    """Euler: faces = links - agents + components + 1, of which one is outside."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        q, links = rng.normal(size=(3, 2)), tree_links(3, rng)
        assert rigidity.faces(q, links) == []


@pytest.mark.parametrize("scale", [1e-200, 1e-9, 1.0, 1e9, 1e200])
@pytest.mark.parametrize("shift", [0.0, 1e3, 1e8])
def test_faces_are_the_same_in_any_unit_and_anywhere(scale: float, shift: float) -> None:
    two = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.8], [2.0, 0.1], [5.0, 5.0], [6.0, 5.0], [5.5, 5.8]])
    links = np.zeros((7, 7), dtype=bool)
    for i, j in [(0, 1), (1, 2), (0, 2), (1, 3), (2, 3), (4, 5), (5, 6), (4, 6)]:
        links[i, j] = links[j, i] = True
    q = scale * (two + shift)
    assert rigidity.crossing_links(q, links) == 0
    assert sorted(map(sorted, rigidity.faces(q, links))) == [[0, 1, 2], [1, 2, 3], [4, 5, 6]]
    assert rigidity.triangle_share(q, links) == 1.0
    crossed = links.copy()
    crossed[0, 3] = crossed[3, 0] = True
    assert rigidity.crossing_links(q, crossed) == 1


def test_nets_that_are_not_in_the_plane_have_no_crossings() -> None:
    links = ~np.eye(4, dtype=bool)
    for m in (1, 3):
        q = np.random.default_rng(m).normal(size=(4, m))
        for measure in (rigidity.crossing_links, rigidity.faces, rigidity.triangle_share):
            with pytest.raises(InvalidInput, match="in the plane"):
                measure(q, links)


@pytest.mark.parametrize(
    ("q", "expected"),
    [
        # Three in a row in space, all linked: the middle one may leave the row in 2 directions.
        ([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]], 2),
        # The same in the plane: in 1 direction; on a line nothing.
        ([[0.0, 0], [1, 0], [2, 0]], 1),
        ([[0.0], [1], [2]], 0),
        # A pair at one place may part in any direction: its links have no direction.
        ([[0.1, 0.7], [0.1, 0.7]], 2),
        ([[0.1, 0.7]] * 3, 4),
        ([[1.0, 1, 1], [1, 1, 1]], 3),
        ([[0.0, 0, 0], [1, 0, 0]], 0),
        ([[0.0, 0]], 0),
    ],
)
def test_degrees_of_freedom_of_points_in_special_places(q, expected: int) -> None:
    linked = ~np.eye(len(q), dtype=bool)
    for scale in (1e-9, 1.0, 1e9):
        assert rigidity.degrees_of_freedom(scale * np.array(q), linked) == expected


def test_rigid_motions_are_translations_and_rotations_in_any_unit() -> None:
    rng = np.random.default_rng(2)
    for m, general in ((1, 1), (2, 3), (3, 6)):
        for scale, shift in ((1.0, 0.0), (1e-9, 0.0), (1e9, 0.0), (1.0, 1e4)):
            q = scale * (rng.normal(size=(5, m)) + shift)
            basis = rigidity.rigid_motions(q)
            assert basis.shape == (5 * m, general)
            np.testing.assert_allclose(basis.T @ basis, np.eye(general), atol=1e-12)
            # They change no length.
            matrix = rigidity.rigidity_matrix(q, ~np.eye(5, dtype=bool))
            assert np.abs(matrix @ basis).max() <= 1e-10 * np.abs(matrix).max()


@pytest.mark.parametrize("name", ["radii", "view", "radii with links", "smooth", "uniform"])
def test_the_gradient_of_the_defect_is_that_of_its_potential(name: str) -> None:
    """By differences of V, which has half of either link of a pair: of directed nets the forces are another thing."""
    rng = np.random.default_rng(5)
    q = 6.0 * rng.uniform(-1, 1, (6, 2))
    headings = rng.uniform(-3, 3, 6) if name == "view" else None
    links = rng.random((6, 6)) < 0.4 if "links" in name else None
    if links is not None:
        np.fill_diagonal(links, False)
    radii = fk.PerAgentRadii(rng.uniform(5.0, 12.0, 6))
    graph = {"view": fk.FieldOfView(R, 1.2), "smooth": fk.Smooth(R, 0.7), "uniform": fk.Proximity(R)}.get(name, radii)
    state = fk.State(q, links=links)
    found = structure.defect(graph, PSI, state, headings=headings)

    def stored(x: np.ndarray) -> float:
        moved = fk.State(x.reshape(q.shape), links=links)
        return structure.structural_energy(graph, PSI, moved, headings).potential

    step = 1e-6 * np.eye(q.size)
    slopes = [(stored(q.ravel() + d) - stored(q.ravel() - d)) / 2e-6 for d in step]
    assert found.links > 3
    np.testing.assert_allclose(found.gradient_square, np.square(slopes).sum(), rtol=1e-6)


def test_there_is_no_normalized_defect_by_an_energy_that_is_not_positive_and_finite() -> None:
    state = fk.State([[0.0, 0.0], [3.0, 0.0]])
    barrier = structure.defect(fk.Hysteresis(4.0, 0.1), fk.Potential("1/r + 1/(R - r)", R=4.0), state)
    assert barrier.factor > 1.0
    assert np.isnan(barrier.normalized)
    assert not structure.is_quasi_realization([barrier] * 3)
    for formula in ("(r - 1)**2*(4 - r)", "1/r**12 - 1/r**6"):
        found = structure.defect(fk.Proximity(4.0), fk.Potential(formula), state)
        assert np.isnan(found.normalized)
    with pytest.raises(InvalidInput, match="one defect or more"):
        structure.is_quasi_realization([])


def test_agents_at_one_place_have_no_vote() -> None:
    with pytest.raises(InvalidInput, match="agents 0 and 2 at one place"):
        structure.vote_weights(fk.Proximity(R), PSI, fk.State([[1.0, 1.0], [4.0, 0.0], [1.0, 1.0]]))


@pytest.mark.parametrize("length", [1e-9, 1.0, 1e6])
def test_stiffness_by_differences_in_any_unit_of_length(length: float) -> None:
    """Two linked agents at the minimum of a potential: the nonzero stiffness is twice its curvature."""
    psi = fk.Potential("(d/r)**2 + log((r/d)**2)", d=length)
    law = fk.Law(fk.Proximity(2 * length), [fk.Gradient(psi)])
    found = linearise(law, fk.State([[0.0, 0.0], [length, 0.0]]))
    curvature = 4.0 / length**2
    np.testing.assert_allclose(np.linalg.eigvalsh(found.stiffness)[-1], 2 * curvature, rtol=1e-8)
    assert found.zero_modes() == 3
    with pytest.raises(InvalidInput, match="step must be greater than 0"):
        linearise(law, fk.State([[0.0, 0.0], [length, 0.0]]), step=0.0)


def test_velocities_that_agree_to_rounding_do_not_differ() -> None:
    from flocking.papers.olfati_saber_2003.rigid_motion import converse_conditions

    q = [[0.0, 0.0], [5.0, 0.0], [2.0, 3.0]]
    together = fk.State(q, [[1.0, 0.2], [1.0, 0.2 + 2**-54], [1.0, 0.2]])
    assert converse_conditions(fk.Proximity(R), together) == (True, True, True)
    turning = fk.State(q, [[0.0, 0.0], [0.0, 5.0], [-3.0, 2.0]])
    assert converse_conditions(fk.Proximity(R), turning)[2] is False


def test_votes_that_are_no_numbers_are_refused() -> None:
    for wrong in (np.nan, -np.inf):
        weights = np.array([[0.0, wrong, 1.0], [wrong, 0.0, 1.0], [1.0, 1.0, 0.0]])
        with pytest.raises(InvalidInput, match="must be finite"):
            structure.vote(weights, np.zeros((3, 2)), 0)


@pytest.mark.parametrize("far", [2.0, 1e5, 1e9, 1e150])
def test_lengths_of_very_different_sizes_hide_no_link(far: float) -> None:
    """A small triangle held at two of its corners by a large one: its short links are links like the long ones."""
    q = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.9], [far, 0.0], [0.0, far]])
    links = np.zeros((5, 5), dtype=bool)
    for i, j in ((0, 1), (0, 2), (1, 2), (0, 3), (0, 4), (3, 4), (1, 4)):
        links[i, j] = links[j, i] = True
    assert rigidity.degrees_of_freedom(q, links) == 0
    links[1, 2] = links[2, 1] = False
    assert rigidity.degrees_of_freedom(q, links) == 1
