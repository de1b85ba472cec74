"""Space that repeats, in the exact engine and the reference: explicit images are the judge."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pytest

import flocking as fk
from flocking.engine.exact.session import ExactSession
from flocking.errors import InvalidInput
from flocking.model.serial import from_data, to_data
from flocking.show.plane import net
from flocking.study.evidence import Evidence
from flocking.study.scenario_files.scenario_file import parse_scenario, scenario_to_text

LENGTHS = (6.0, 7.0)
SOFT = fk.Potential("k*(1 - r/R)**2", k=3.0, R=2.0)
IDLE = fk.Consensus(0.0)


def group(n=8, seed=0, speed=2.0, lengths=LENGTHS) -> fk.State:
    rng = np.random.default_rng(seed)
    return fk.State(rng.random((n, len(lengths))) * lengths, rng.normal(size=(n, len(lengths))) * speed)


def periodic(graph, terms, start, t_end=2.0, lengths=LENGTHS, **fields) -> fk.Scenario:
    return fk.Scenario(
        fk.Law(graph, terms), start, t_end, frames=fields.pop("frames", 5), space=fk.Periodic(lengths), **fields
    )


def run(scenario: fk.Scenario) -> fk.Run:
    return fk.simulate(scenario, progress=False)


def images(lengths, reach):
    """Vectors of the lattice, ``reach`` lengths each way; none along an axis without end."""
    axes = [range(-reach, reach + 1) if np.isfinite(x) else (0,) for x in lengths]
    return [np.array([0.0 if n == 0 else n * x for n, x in zip(cell, lengths, strict=True)]) for cell in product(*axes)]


def times_at(d, v, radius):
    """When |d + v t| = radius: (time, whether outwards)."""
    a, b, c = v @ v, d @ v, d @ d - radius**2
    if a == 0 or b * b <= a * c:
        return []
    root = np.sqrt(b * b - a * c)
    return [((-b - root) / a, False), ((-b + root) / a, True)]


def free_switches(start, t_end, lengths, appear, leave):
    """Every switch of agents that move on straight lines, each image of each pair by itself."""
    found = []
    for i, j in combinations(range(start.n), 2):
        events = []
        linked = False
        for shift in images(lengths, 9):
            d, v = start.q[j] - start.q[i] + shift, start.p[j] - start.p[i]
            linked |= bool(d @ d < leave**2)
            events += [(t, "break") for t, outwards in times_at(d, v, leave) if outwards]
            events += [(t, "appear") for t, outwards in times_at(d, v, appear) if not outwards]
        for t, kind in sorted(e for e in events if 0.0 < e[0] <= t_end):
            if (kind == "break") == linked:
                linked = not linked
                found.append((t, i, j, kind))
    return sorted(found)


@pytest.mark.parametrize("lengths", [LENGTHS, (5.0, np.inf), (4.5, 5.5, 6.5)], ids=["both", "one axis", "three"])
@pytest.mark.parametrize("gap", [0.0, 0.4])
def test_no_switch_is_missed_however_fast_agents_cross_the_box(lengths, gap):
    finite = tuple(x if np.isfinite(x) else 5.0 for x in lengths)
    start = group(6, seed=3, speed=4.0, lengths=finite)
    # The first agents cross several boxes within one step of the integrator.
    start = fk.State(start.q, start.p * np.array([6.0, 1, 1, 1, 1, 1])[:, None])
    found = run(periodic(fk.Hysteresis(2.0, gap), [IDLE], start, 1.0, lengths))
    expected = free_switches(start, 1.0, lengths, 2.0 - gap, 2.0)
    assert len(expected) > 10
    switches = found.switches
    assert [(int(s["i"]), int(s["j"]), str(s["kind"])) for s in switches] == [e[1:] for e in expected]
    assert np.abs(switches["time"] - [e[0] for e in expected]).max() < 1e-9
    assert ((switches["speed"] > 0) == (switches["kind"] == "break")).all()


def test_the_closest_approach_is_that_of_all_images():
    for seed in range(4):
        start = group(5, seed=seed, speed=5.0)
        found = run(periodic(fk.Proximity(0.9), [IDLE], start, 1.0))
        best = {True: np.inf, False: np.inf}
        for i, j in combinations(range(start.n), 2):
            for shift in images(LENGTHS, 9):
                d, v = start.q[j] - start.q[i] + shift, start.p[j] - start.p[i]
                t = np.clip(-(d @ v) / (v @ v), 0.0, 1.0)
                r = float(np.linalg.norm(d + t * v))
                # Inside the radius a pair is linked; outside it comes as close as its ends, or the radius.
                best[r < 0.9] = min(best[r < 0.9], r)
        assert found.closest_linked.distance == pytest.approx(best[True], abs=1e-9)


def forces(q, p, lengths, radius, gain):
    """Forces of the soft potential and consensus, summed over explicit images."""
    shifts = np.array(list(images(lengths, 4)))
    d = (q[None, :] - q[:, None])[:, :, None] + shifts
    r = np.linalg.norm(d, axis=3)
    near = (r > 0) & (r < radius) & ~np.eye(len(q), dtype=bool)[:, :, None]
    along = np.where(near, -2 * SOFT.parameters["k"] / radius * (1 - r / radius) / np.where(near, r, 1.0), 0.0)
    drag = gain * near.sum(axis=2)[:, :, None] * (p[None, :] - p[:, None])
    return (along[..., None] * d).sum(axis=(1, 2)) + drag.sum(axis=1)


def test_the_reference_sums_over_explicit_images():
    start = group(10, seed=5)
    start = fk.State(start.q + 2 * np.array(LENGTHS) * (np.arange(10) % 3)[:, None] / 2 * 2 / 2, start.p)
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(SOFT), fk.Consensus(0.3)])
    found = fk.control(law, start, space=fk.Periodic(LENGTHS))
    assert np.abs(found - forces(start.q, start.p, LENGTHS, 2.0, 0.3)).max() < 1e-12
    assert np.abs(found - fk.control(law, start)).max() > 0.1


def test_the_motion_is_that_of_small_steps_over_explicit_images():
    start = group(8, seed=1)
    found = run(periodic(fk.Proximity(2.0), [fk.Gradient(SOFT)], start, 1.0, frames=2))
    q, p, h = start.q.copy(), start.p.copy(), 2e-3
    for _ in range(500):
        p = p + h / 2 * forces(q, p, LENGTHS, 2.0, 0.0)
        q = q + h * p
        p = p + h / 2 * forces(q, p, LENGTHS, 2.0, 0.0)
    assert np.abs(found.q[-1] - q).max() < 2e-5
    assert np.abs(found.p[-1] - p).max() < 2e-5


LAWS = {
    "switching": (fk.Proximity(2.0), [fk.Gradient(SOFT), fk.Consensus(0.3)]),
    "memory": (fk.Hysteresis(2.5, 0.3), [fk.Gradient(fk.Potential("1/r + 1/(R - r)", R=2.5)), fk.Consensus(0.3)]),
    "smooth": (fk.Smooth(2.0, 0.3), [fk.Gradient(SOFT), fk.Consensus(0.5)]),
}


@pytest.mark.parametrize("name", LAWS)
def test_momentum_is_kept_and_the_ledger_closes(name):
    scenario = periodic(*LAWS[name], group())
    found = run(scenario)
    trace = found.trace
    left = trace["energy"] - trace["energy"][0] + trace["dissipated"] - trace["supplied"] - trace["jumped"]
    assert found.status == "finished"
    assert np.abs(left).max() < 1e-6
    assert np.abs(found.p.sum(axis=1) - found.p[0].sum(axis=0)).max() < 1e-12


def test_the_motion_is_the_same_wherever_it_begins():
    """By any vector for all, and by a vector of the lattice for each agent; to the tolerance of the integrator."""
    graph, terms = LAWS["smooth"]
    first = run(periodic(graph, terms, group()))
    rng = np.random.default_rng(7)
    for moved in (np.array([0.37, -51.3]), rng.integers(-3, 4, size=(8, 2)) * np.array(LENGTHS)):
        start = group()
        start = fk.State(start.q + moved, start.p)
        found = run(periodic(graph, terms, start))
        assert np.abs(found.q - moved - first.q).max() < 1e-7
        assert len(found.switches) == len(first.switches)


def test_a_box_that_nobody_crosses_changes_no_bit_of_links_and_forces():
    graph, terms = LAWS["switching"]
    start = group(6, speed=0.5)
    near, wide = (
        run(fk.Scenario(fk.Law(graph, terms), start, 1.0)),
        run(periodic(graph, terms, start, 1.0, (99.0, 99.0))),
    )
    assert near.switches["time"] == pytest.approx(wide.switches["time"], abs=1e-8)
    assert np.abs(near.q[-1] - wide.q[-1]).max() < 1e-7
    assert np.array_equal(
        fk.control(fk.Law(graph, terms), start),
        fk.control(fk.Law(graph, terms), start, space=fk.Periodic((99.0, 99.0))),
    )


def test_differences_go_to_the_nearest_image_and_ties_are_opposite():
    space = fk.Periodic((4.0, None))
    d = np.array([[2.0, 9.0], [-2.0, 9.0], [5.0, -9.0], [-6.0, 1.0], [1.9, 0.0]])
    assert space.displacement(d).tolist() == [[-2.0, 9.0], [2.0, 9.0], [1.0, -9.0], [2.0, 1.0], [1.9, 0.0]]
    assert np.array_equal(space.displacement(-d), -space.displacement(d))
    assert space.wrapped(np.array([[-1.0, -1.0], [9.0, 3.0], [-1e-20, 0.0]])).tolist() == [[3, -1], [1, 3], [0, 0]]


REFUSED = {
    "all pairs": (fk.Fixed.complete(8), [IDLE], "Fixed"),
    "radius": (fk.Proximity(3.0), [IDLE], "more than twice"),
    "view": (fk.FieldOfView(2.0, 1.0), [IDLE], "FieldOfView"),
    "point": (fk.Proximity(2.0), [IDLE, fk.Track(fk.Sink([0.0, 0.0]), 1.0)], "Track"),
    "leader": (fk.Proximity(2.0), [IDLE, fk.Track(fk.Velocity([1.0, 0.0]), 0.5, 0.5)], "Track"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_meaning_across_images_is_refused_by_name(name):
    graph, terms, words = REFUSED[name]
    with pytest.raises(InvalidInput, match=words):
        periodic(graph, terms, group(), agents=fk.Agents(headings=np.zeros(8)))


def test_a_velocity_may_be_followed():
    scenario = periodic(fk.Proximity(2.0), [fk.Track(fk.Velocity([1.0, 0.0]), 0.0, 0.7)], group(), 20.0)
    assert np.abs(run(scenario).p[-1] - [1.0, 0.0]).max() < 1e-4


def test_lengths_are_checked():
    for wrong in ([], [0.0, 1.0], [-1.0, 2.0], [np.nan, 1.0], [None, None], 3.0, "ab"):
        with pytest.raises(InvalidInput, match="lengths"):
            fk.Periodic(wrong)
    with pytest.raises(InvalidInput, match="one for each axis"):
        periodic(fk.Proximity(1.0), [IDLE], group(), lengths=(9.0, 9.0, 9.0))


def test_two_agents_at_images_of_one_point_are_refused_under_a_singular_potential():
    psi = fk.Potential("1/r + 1/(R - r)", R=2.5)
    with pytest.raises(InvalidInput, match="same point"):
        periodic(fk.Proximity(2.5), [fk.Gradient(psi)], fk.State([[1.0, 1.0], [7.0, -6.0]]))


def test_files_and_stored_runs_keep_the_box(tmp_path):
    scenario = periodic(*LAWS["memory"], group(), lengths=(6.0, np.inf))
    assert from_data(to_data(scenario)).space == scenario.space
    text = scenario_to_text(scenario)
    assert parse_scenario(text).space == scenario.space
    assert scenario_to_text(parse_scenario(text)) == text
    whole = fk.simulate(scenario, save=tmp_path / "whole", progress=False)
    assert np.array_equal(fk.read_run(tmp_path / "whole").q, whole.q)
    assert fk.read_run(tmp_path / "whole").scenario.space == scenario.space


def test_a_session_that_is_packed_goes_on_with_the_same_bits():
    scenario = periodic(*LAWS["memory"], group())
    straight = ExactSession(scenario)
    straight.advance(2.0)
    halted = ExactSession(scenario)
    halted.advance(0.9)
    again = ExactSession.resume(halted.snapshot())
    again.advance(2.0)
    assert np.array_equal(again.state.q, straight.state.q)


def test_evidence_measures_rates_of_distances_across_the_seam():
    start = fk.State([[0.1, 1.0], [5.9, 1.0]], [[1.0, 0.0], [-1.0, 0.0]])
    evidence = Evidence(run(periodic(fk.Proximity(2.0), [IDLE], start, 0.1, frames=2)))
    assert evidence.distance_rate == pytest.approx(2.0)
    assert evidence.links_at(0)[0, 1]


def test_pictures_draw_agents_in_the_box_and_links_in_halves():
    start = fk.State([[0.1, 1.0], [17.9, -6.0]], np.zeros((2, 2)))
    axes = net(run(periodic(fk.Proximity(2.0), [IDLE], start, 0.1, frames=2)), frame=0)
    links = next(c for c in axes.collections if c.get_gid() == "links")
    ends = np.array(links.get_segments()).reshape(-1, 4)
    assert np.allclose(ends, [[0.1, 1, 0, 1], [5.9, 1, 6, 1]])


def test_exports_say_the_box(tmp_path):
    start = fk.State([[0.1, 1.0], [17.9, -6.0]], np.zeros((2, 2)))
    fk.export_run(run(periodic(fk.Proximity(2.0), [IDLE], start, 0.1, frames=2)), tmp_path / "run.xyz")
    text = (tmp_path / "run.xyz").read_text()
    assert 'Lattice="6.0 0.0 0.0 0.0 7.0 0.0 0.0 0.0 0.0" pbc="T T F"' in text
