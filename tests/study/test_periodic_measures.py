"""Measures of one state in space that repeats: explicit images and covering boxes are the judge."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import flocking as fk
from flocking.apps.commands.run_summary import facts, summary
from flocking.engine.storage.export_formats import observable_table
from flocking.model.graphs.connectivity import components
from flocking.model.graphs.distance_graphs import pair_distances
from flocking.model.observables import closest_pair, link_length_deviation
from flocking.model.potentials.bumps import BUMPS
from flocking.show.group_series import connectivity
from flocking.study.claims.conclusions.limits import switching_stops
from flocking.study.evidence import Evidence
from flocking.study.linearisation import linearise
from flocking.study.nets.matrices import adjacency
from flocking.study.nets.winding import winding
from flocking.study.potentials.equilibrium import Equilibrium
from flocking.study.potentials.state_energy import agent_energies, total_energy

LENGTHS = (5.0, 6.0)
SPACE = fk.Periodic(LENGTHS)
PSI = fk.Potential("k*(1 - r/R)**3", k=2.0, R=2.0)
LAW = fk.Law(fk.Proximity(2.0), [fk.Gradient(PSI), fk.Consensus(0.5)])
COPIES = 7
"""Boxes side by side along an axis: more than any path over twelve links of at most 2 can go round."""


def state(n=12, seed=0, lengths=LENGTHS):
    rng = np.random.default_rng(seed)
    sides = np.where(np.isfinite(lengths), lengths, 5.0)
    far = np.where(np.isfinite(lengths), sides, 0.0) * rng.integers(-2, 3, size=(n, 2))
    return fk.State(rng.random((n, 2)) * sides + far, rng.normal(size=(n, 2)))


def cover(q, radius, lengths):
    """Along which axes each agent is joined to an image of itself, in many boxes side by side."""
    cells = list(product(*(range(COPIES) if np.isfinite(x) else (0,) for x in lengths)))
    sides = np.where(np.isfinite(lengths), lengths, 0.0)
    places = np.concatenate([np.mod(q, np.where(sides > 0, sides, np.inf)) + np.array(c) * sides for c in cells])
    whole = fk.Periodic([COPIES * x for x in lengths])
    labels = components(pair_distances(places, whole) < radius).reshape(len(cells), len(q))
    joined = labels == labels[0]
    return np.array([[bool(joined[[c[k] > 0 for c in cells], i].any()) for k in range(2)] for i in range(len(q))])


@pytest.mark.parametrize("lengths", [LENGTHS, (5.0, np.inf), (np.inf, 4.2)])
def test_a_flock_winds_where_it_reaches_an_image_of_itself(lengths):
    space = fk.Periodic(lengths)
    kinds = set()
    for seed in range(25):
        q = state(12, seed, lengths).q
        links = pair_distances(q, space) < 1.7
        found = winding(links, q, space)
        assert np.array_equal(found[components(links)], cover(q, 1.7, lengths))
        kinds |= set(map(tuple, found.tolist()))
    assert (False, False) in kinds
    assert len(kinds) >= 2


def rows_at_rest():
    """Five agents in a row around the box, two beside each other, one alone."""
    q = np.array([*([1.0 * k, 0.3] for k in range(5)), [0.5, 2.3], [1.5, 2.3], [3.5, 3.4]])
    law = fk.Law(fk.Proximity(1.05), [fk.Consensus(1.0)])
    return fk.Scenario(law, fk.State(q), t_end=0.2, frames=3, space=fk.Periodic([5.0, 4.2]))


def test_the_summary_of_a_run_names_the_flocks_that_wind():
    run = fk.simulate(rows_at_rest(), progress=False)
    found = summary(run)
    assert found["flocks"] == 3
    assert found["winding"] == [{"agents": 5, "axes": [0]}]
    assert dict(facts(found))["of them wind around space"] == "5 agents around axis 0"
    apart = rows_at_rest().with_(start=fk.State(run.q[0] * [0.9, 1.0]))
    assert dict(facts(summary(fk.simulate(apart, progress=False))))["of them wind around space"] == "none"
    free = fk.simulate(rows_at_rest().with_(space=fk.Open()), progress=False)
    assert "of them wind around space" not in dict(facts(summary(free)))


def test_the_picture_of_flocks_counts_those_that_wind():
    axes = connectivity(fk.simulate(rows_at_rest(), progress=False))
    lines = {line.get_gid(): list(line.get_ydata()) for each in axes.figure.axes for line in each.lines}
    assert lines["flocks"] == [3, 3, 3]
    assert lines["winding"] == [1, 1, 1]
    free = connectivity(fk.simulate(rows_at_rest().with_(space=fk.Open()), progress=False))
    assert "winding" not in {line.get_gid() for each in free.figure.axes for line in each.lines}


def test_a_row_around_the_box_winds_along_its_axis_alone_and_nothing_winds_in_open_space():
    q = np.array([[1.0 * k, 0.3] for k in range(5)])
    links = pair_distances(q, SPACE) < 1.5
    assert fk.winding(links, q, SPACE).tolist() == [[True, False]]
    links[0, 4] = links[4, 0] = False
    assert winding(links, q, SPACE).tolist() == [[False, False]]
    assert winding(np.ones((5, 5), dtype=bool), q, fk.Open()).tolist() == [[False, False]]


@pytest.mark.parametrize(
    ("links", "q", "space", "words"),
    [
        (np.zeros((2, 2)), np.zeros((2, 2)), fk.Periodic([1.0, 1.0, 1.0]), "space lengths must be 2"),
        (np.zeros((3, 3)), np.zeros((2, 2)), SPACE, r"links must have shape \(2, 2\)"),
        ([[0, 1], [1]], np.zeros((2, 2)), SPACE, r"links must have shape \(2, 2\)"),
        (np.zeros((2, 2)), np.full((2, 2), np.nan), SPACE, "q must be finite"),
    ],
)
def test_what_cannot_wind_is_refused_in_a_sentence(links, q, space, words):
    with pytest.raises(fk.InvalidInput, match=words):
        fk.winding(links, q, space)


def test_positions_may_be_lists():
    assert fk.winding([[0, 1], [1, 0]], [[0.0, 0.0], [1.0, 0.0]], fk.Periodic([9.0, None])).tolist() == [[False, False]]


def test_the_closest_pair_may_be_across_the_border():
    for seed in range(10):
        for lengths in (LENGTHS, (5.0, np.inf)):
            s, space = state(9, seed, lengths), fk.Periodic(lengths)
            distances = pair_distances(s.q, space)
            found, pair = closest_pair(s, space)
            assert found == pytest.approx(distances.min(), abs=1e-12)
            assert distances[pair] == pytest.approx(found, abs=1e-12)
            assert closest_pair(s)[0] > found or closest_pair(s)[0] == pytest.approx(found)


def energy_of(q):
    """Sum of psi over explicit images of unordered pairs."""
    total = 0.0
    for i, j in product(range(len(q)), repeat=2):
        if i < j:
            d = np.mod(q[j] - q[i], LENGTHS)
            r = min(np.linalg.norm(d - np.array(c) * LENGTHS) for c in product((0, 1), repeat=2))
            total += float(PSI(np.array(r))) if r < 2.0 else 0.0
    return total


def test_energies_forces_and_stiffness_are_those_of_all_images():
    s = state(12, 3)
    kinetic = 0.5 * float((s.p**2).sum())
    assert total_energy(LAW, s, space=SPACE) == pytest.approx(energy_of(s.q) + kinetic)
    assert agent_energies(LAW, s, space=SPACE).sum() == pytest.approx(2 * energy_of(s.q))
    found = Equilibrium(LAW, s, SPACE)
    moved = np.zeros_like(s.q)
    for i, k in product(range(s.n), range(2)):
        shift = np.zeros_like(s.q)
        shift[i, k] = 1e-6
        moved[i, k] = -(energy_of(s.q + shift) - energy_of(s.q - shift)) / 2e-6
    assert np.abs(found.forces - moved).max() < 1e-6
    stiffness = linearise(LAW, s, space=SPACE).stiffness
    assert np.abs(stiffness - found.hessian).max() < 1e-5 * np.abs(found.hessian).max()
    assert np.abs(stiffness - linearise(LAW, s).stiffness).max() > 0.1


def test_a_run_is_measured_and_exported_in_its_space():
    scenario = fk.Scenario(LAW, state(8, 4), 0.2, frames=3, space=SPACE)
    run = fk.simulate(scenario, progress=False)
    e = Evidence(run)
    expected = Equilibrium(LAW, e.state(-1), SPACE).forces
    assert np.array_equal(e.equilibrium.forces, expected)
    assert np.abs(expected).max() > 0
    table = observable_table(run)
    for k in range(3):
        assert table["closest_pair"][k] == pytest.approx(pair_distances(run.q[k], SPACE).min())


def test_agents_that_fly_apart_in_a_box_have_not_switched_for_the_last_time():
    start = fk.State([[0.0, 0.0], [1.5, 2.5]], [[0.0, 0.0], [1.0, 0.3]])
    far = fk.Scenario(fk.Law(fk.Proximity(1.0), [fk.Consensus(0.0)]), start, 0.5, frames=20)
    open_space, box = (fk.simulate(far.with_(space=s), progress=False) for s in (fk.Open(), fk.Periodic([9.0, 9.0])))
    assert not len(box.switches)
    assert not switching_stops(Evidence(open_space)).unsettled
    assert switching_stops(Evidence(box)).unsettled == "agents still move past each other"


def test_a_scenario_in_space_that_repeats_has_no_rotation_among_its_symmetries():
    scenario = fk.Scenario(LAW, state(), 1.0)
    assert "rotation" in scenario.symmetries
    assert scenario.with_(space=SPACE).symmetries == LAW.symmetries - {"rotation"}


def test_the_adjacency_matrix_has_weights_of_nearest_images():
    s, graph = state(9, 4), fk.Smooth(2.0, 0.4)
    found = adjacency(graph, s.q, space=SPACE)
    for i, j in product(range(9), repeat=2):
        d = np.mod(s.q[j] - s.q[i], LENGTHS)
        r = min(np.linalg.norm(d - np.array(c) * LENGTHS) for c in product((0, 1), repeat=2))
        assert found[i, j] == pytest.approx(float(BUMPS["cosine"](r / 2.0, 0.4)) if i != j else 0.0, abs=1e-12)
    assert (found > 0).sum() > (adjacency(graph, s.q) > 0).sum()
    given = np.zeros((9, 9), dtype=bool)
    given[0, 1] = True
    assert (adjacency(fk.Proximity(1.0), s.q, links=given, space=SPACE) == given).all()
    with pytest.raises(fk.InvalidInput, match="must be open"):
        adjacency(fk.FieldOfView(2.0, 1.0), s.q, np.zeros(9), space=SPACE)


NEAR = fk.State([[0.0, 0.0], [1.0, 0.0]])
WIDE = fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("r**2"))])
LOOKING = fk.Law(fk.Proximity(1.0), [fk.Cohesion(1.0, 3.0)])
PURSUING = fk.Law(fk.Proximity(1.0), [fk.Track(fk.Sink([0.0, 0.0]), 1.0, 1.0)])
AGENT = fk.Agent([0.0, 0.0], [0.0, 0.0])


@pytest.mark.parametrize(
    "function",
    [
        lambda law, space: fk.control(law, NEAR, space=space), lambda law, space: fk.evaluate(law, NEAR, space=space),
        lambda law, space: fk.total_energy(law, NEAR, space=space),
        lambda law, space: fk.control_of(law, AGENT, [fk.Agent([1.0, 0.0], [0.0, 0.0])], space=space),
        lambda law, space: fk.Scenario(law, NEAR, 1.0, space=space),
    ],
    ids=["control", "evaluate", "total_energy", "control_of", "Scenario"],
)  # fmt: skip
@pytest.mark.parametrize(
    ("law", "space", "words"),
    [
        (WIDE, fk.Periodic([6.0, 6.0]), "more than twice the largest radius of Proximity"),
        (WIDE, fk.Periodic([None, 5.0]), "more than twice the largest radius of Proximity"),
        (WIDE, fk.Periodic([9.0, 9.0, 9.0]), "lengths must be 2"),
        (WIDE, fk.Periodic([9.0]), "lengths must be 2"),
        (fk.Law(fk.Complete(), WIDE.terms), fk.Periodic([9.0, 9.0]), "must be open for Complete"),
        (PURSUING, fk.Periodic([9.0, 9.0]), "must be open for Track"),
    ],
)
def test_forces_in_space_that_repeats_have_the_conditions_of_scenarios(function, law, space, words):
    """A neighbour with several images within reach counted once, with a word nowhere."""
    with pytest.raises(fk.InvalidInput, match=words):
        function(law, space)


@pytest.mark.parametrize("lengths", [[6.0, 6.0], [5.0, None]])
def test_steering_sees_one_image_of_another(lengths):
    with pytest.raises(fk.InvalidInput, match="more than twice the reach of Cohesion"):
        fk.control(LOOKING, NEAR, space=fk.Periodic(lengths))
    assert fk.control(LOOKING, NEAR, space=fk.Periodic([6.1, 6.1])).tolist() == [[1.0, 0.0], [-1.0, 0.0]]


@pytest.mark.parametrize("lengths", [[9.0], [9.0, 9.0, 9.0]])
@pytest.mark.parametrize(
    "function",
    [
        lambda space: space.displacement(np.ones((4, 2))), lambda space: space.wrapped(np.ones((4, 2))),
        lambda space: closest_pair(NEAR, space), lambda space: pair_distances(NEAR.q, space),
        lambda space: link_length_deviation(NEAR.q, ~np.eye(2, dtype=bool), space),
    ],
    ids=["displacement", "wrapped", "closest_pair", "pair_distances", "link_length_deviation"],
)  # fmt: skip
def test_space_has_one_length_for_each_axis(function, lengths):
    """With too few lengths the other axes were taken for endless ones."""
    with pytest.raises(fk.InvalidInput, match="Periodic: lengths must be 2, one for each axis"):
        function(fk.Periodic(lengths))
