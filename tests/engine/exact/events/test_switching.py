"""Switches: none is missed, ties fall at one instant, kinks are guards, sliding and barriers are told."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import Chattering, LinkLost, NotFinite
from tests.engine.exact.groups import BARRIER, SPRING, flight, simulate, spring, zhou


@pytest.mark.parametrize("seed", range(4))
def test_pairs_in_free_flight_cross_when_geometry_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, radius, t_end = 12, 0.5, 10.0
    q, p = rng.uniform(-4, 4, (n, 2)), rng.normal(size=(n, 2)) * 2
    run = simulate(spring(fk.Proximity(radius), gain=0.0, k=0.0), flight(q, p), t_end)
    expected: list[tuple[float, int, int]] = []
    for i in range(n):
        for j in range(i + 1, n):
            d, v = q[j] - q[i], p[j] - p[i]
            root = (d @ v) ** 2 - (v @ v) * (d @ d - radius**2)
            if root > 0:
                times = (-(d @ v) + np.array([-1, 1]) * np.sqrt(root)) / (v @ v)
                expected += [(t, i, j) for t in times if 0 < t < t_end]
    expected.sort()
    assert len(expected) >= 1, "a start without encounters tests nothing"
    assert [(int(s["i"]), int(s["j"])) for s in run.switches] == [(i, j) for _, i, j in expected]
    np.testing.assert_allclose(run.switches["time"], [t for t, _, _ in expected], atol=1e-9)
    # Far fewer steps than it takes to sample each encounter: most open and close within one step.
    assert run.provenance["steps"] < 10 * len(expected) + 50


def test_switches_of_a_symmetric_group_fall_at_one_instant() -> None:
    angles = 2 * np.pi * np.arange(6) / 6
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    run = simulate(spring(fk.Proximity(1.0), gain=0.5), fk.State(3 * ring, -ring), 3.0)
    sides = run.switches[:6]
    assert {(int(s["i"]), int(s["j"])) for s in sides} == {(k, (k + 1) % 6) for k in range(5)} | {(0, 5)}
    np.testing.assert_allclose(sides["time"], 2.0, atol=1e-9)
    assert np.abs(run.residual).max() < 1e-7


def test_a_grazing_crossing_is_flagged() -> None:
    law = spring(fk.Proximity(1.0), gain=0.0, k=0.0)
    grazing = simulate(law, flight([[0, 0], [-1, 1.0 - 1e-14 * 30]], [[0, 0], [1, 0]]), 2.0)
    inside = simulate(law, flight([[0, 0], [-1, 1.0 - 1e-13 * 30]], [[0, 0], [1, 0]]), 2.0)
    crossing = simulate(law, flight([[0, 0], [-1, 0.9]], [[0, 0], [1, 0]]), 2.0)
    outside = simulate(law, flight([[0, 0], [-1, 1.0 + 1e-9]], [[0, 0], [1, 0]]), 2.0)
    assert len(outside.switches) == 0
    assert len(grazing.switches) in (0, 2)
    assert len(inside.switches) == 2
    assert np.abs(inside.switches["speed"]).max() < 1e-5
    assert not crossing.switches["tangential"].any()
    slow = simulate(law, flight([[0, 0], [1, 0]], [[0, 0], [1e-9, 1.0]]), 0.5)
    assert slow.switches["tangential"].tolist() == [True] * len(slow.switches)
    assert len(slow.switches) == 1 or slow.links[0].any() == slow.links[-1].any()


def test_kinks_of_a_piecewise_formula_are_located() -> None:
    psi = fk.Potential("where(r < a, k*r**2/2, k*a*(r - a/2))", k=1.0, a=1.0)
    law = fk.Law(fk.Fixed(2, ((0, 1),)), [fk.Gradient(psi)])
    run = simulate(law, flight([[0, 0], [2.0, 0]], [[0, 0], [0, 0]]), 1.5)
    assert run.switches["kind"].tolist() == ["kink"]
    # Both accelerate by 1: the distance 2 - t^2 falls to 1 at t = 1, with speed 2.
    assert run.switches["time"][0] == pytest.approx(1.0, abs=1e-9)
    assert run.switches["speed"][0] == pytest.approx(-2.0, abs=1e-8)
    assert np.abs(run.residual).max() < 1e-8
    assert not run.trace["jumped"].any()


def test_a_potential_whose_pieces_do_not_meet_jumps_the_energy_not_the_ledger() -> None:
    psi = fk.Potential("where(r < a, k*r**2/2, k*a*(r - a/2))", k=1.0, a=1.0)
    torn = fk.Potential("where(r < a, k*r**2/2, b)", k=1.0, a=1.0, b=3.0)
    law = fk.Law(fk.Fixed(2, ((0, 1),)), [fk.Gradient(torn)])
    run = simulate(law, flight([[0, 0], [0.5, 0]], [[0, 0], [2.0, 0]]), 2.0)
    assert run.switches["kind"].tolist() == ["kink"]
    assert run.trace["jumped"][-1] == pytest.approx(2.5)
    assert np.abs(run.residual).max() < 1e-7
    assert run.provenance["steps"] < 30
    assert psi(1.0) == 0.5


def test_sliding_is_told() -> None:
    # Repelled inside the radius, pulled together outside it by the other spring: the pair cannot leave the radius.
    law = fk.Law(
        fk.Fixed(2, ((0, 1),)), [fk.Gradient(SPRING), fk.Consensus(1.0), fk.Gradient(SPRING, over=fk.Proximity(1.0))]
    )
    push = fk.Law(
        law.graph,
        [
            fk.Gradient(SPRING),
            fk.Consensus(8.0),
            fk.Gradient(SPRING.with_parameters(k=-3.0), over=fk.Proximity(1.0)),
        ],
    )
    assert simulate(law, flight([[0, 0], [2.0, 0]], [[0, 0], [0, 0]]), 1.0).finished
    for order in (1, 2):
        with pytest.raises(Chattering) as error:
            simulate(
                push, flight([[0, 0], [2.0, 0]], [[0, 0], [0, 0]]), 50.0, agents=fk.Agents(order=order), frames=2001
            )
        run = error.value.run
        assert run is not None
        assert error.value.agents == (0, 1)
        assert run.switches["kind"][0] == "appear"
        assert len(run.t) > 1
        last = run.state(-1)
        assert np.linalg.norm(last.q[1] - last.q[0]) == pytest.approx(1.0, abs=0.5)


@pytest.mark.parametrize(("k", "speed"), [(1e-6, 3.0), (1e-9, 30.0)])
def test_agents_on_a_line_do_not_pass_through_each_other(k: float, speed: float) -> None:
    # The weaker one is felt for 1e-12 of the way only: error control alone steps over it.
    law = fk.Law(fk.Fixed(2, ((0, 1),)), [fk.Gradient(fk.Potential("k/r", k=k))])
    run = simulate(law, flight([[0.0], [5.0]], [[0.0], [-speed]]), 12.0 / speed)
    assert (run.q[:, 1, 0] > run.q[:, 0, 0]).all()
    # They exchange velocities; at the turning point all relative kinetic energy, v^2/4, is stored.
    np.testing.assert_allclose(run.p[-1, :, 0], [-speed, 0.0], atol=1e-5)
    assert run.closest.distance == pytest.approx(4 * k / speed**2, rel=1e-3)


@pytest.mark.parametrize("fine", [False, True])
def test_two_agents_that_see_each_other_cross_a_border_of_pieces_once(fine: bool) -> None:
    """Both directions of a pair have a row, at one time; nothing is open because of it, in either loop."""
    pieces = fk.Potential("where(r < 0.8, (r - 0.8)**2, where(r < 1.3, 0, (r - 1.3)**2))")
    law = fk.Law(fk.PerAgentRadii([1.8, 2.1, 1.9], closed=False), [fk.Gradient(pieces)])
    begin = flight([[0.0, 0.0], [1.7, 0.1], [0.3, 1.6]], [[0.4, 0.3], [-0.8, 0.1], [0.0, -0.9]])
    run = fk.simulate(fk.Scenario(law, begin, 3.0), engine="exact", fine=fine, progress=False)
    kinks = run.switches[run.switches["kind"] == "kink"]
    assert len(kinks) >= 8
    for time in set(kinks["time"].tolist()):
        rows = [(int(row["i"]), int(row["j"])) for row in kinks[kinks["time"] == time]]
        assert len(set(rows)) == len(rows)
        assert {(j, i) for i, j in rows} == set(rows)
    apart = np.diff(sorted(set(kinks["time"].tolist())))
    assert apart.min() > 1e-3
    assert run.accuracy is not None
    assert run.accuracy.known_until == np.inf
    assert len(run.accuracy.doubts) == 0


@pytest.mark.parametrize("fine", [False, True])
def test_a_border_of_pieces_at_a_radius_is_crossed_with_the_link(fine: bool) -> None:
    """Agent 0 sees to 0.9, where pieces meet, and agent 1 to 1.5; with hysteresis a link appears there."""
    pieces = fk.Potential("where(r < 0.9, (r - 0.9)**2 + 0.2, 0.4*(r - 0.9)**2)")
    begin = flight([[0.0, 0.0], [0.6, 0.0]], [[0.0, 0.0], [2.0, 0.1]])
    radii = fk.PerAgentRadii([0.9, 1.5], closed=False)
    runs = []
    for start in (begin, flight([[0.0, 0.0], [1.4, 0.0]], [[0.0, 0.0], [-2.0, 0.1]])):
        made = fk.Scenario(fk.Law(radii, [fk.Gradient(pieces)]), start, 0.4, frames=5)
        run = fk.simulate(made, engine="exact", fine=fine, progress=False)
        runs.append([(str(row["kind"]), int(row["i"])) for row in run.switches])
        assert run.accuracy is not None
        assert run.accuracy.known_until == np.inf
    assert set(runs[0]) == {("break", 0), ("kink", 0), ("kink", 1)}
    assert set(runs[1]) <= {("appear", 0), ("kink", 0), ("kink", 1)}
    assert [len(rows) for rows in runs] in ([3, 2], [3, 3])
    law = fk.Law(fk.Hysteresis(1.5, 0.6), [fk.Gradient(pieces)])
    gap = fk.Scenario(law, flight([[0.0, 0.0], [1.6, 0.0]], [[0.0, 0.0], [-2.0, 0.0]]), 0.5, frames=5)
    run = fk.simulate(gap, engine="exact", fine=fine, progress=False)
    assert [str(kind) for kind in run.switches["kind"]] == ["appear"]


def test_a_barrier_at_the_radius_holds_its_links_or_says_that_it_lost_one() -> None:
    law = zhou(gain=0.0)
    begin = flight([[0, 0], [2.0, 0]], [[-30, 0], [30, 0]])
    run = simulate(law, begin, 0.5)
    assert len(run.switches) == 0
    # All relative kinetic energy is stored where the distance turns: psi(r) = 900 + psi(2).
    far = float(np.linalg.norm(run.q[:, 1] - run.q[:, 0], axis=1).max())
    assert float(BARRIER(far)) <= 901.0 * (1 + 1e-9)
    beyond = fk.State(np.array([[0.0, 0], [4.5, 0]]), links=np.array([[False, True], [True, False]]))
    with pytest.raises(LinkLost) as error:
        simulate(law, beyond, 1.0)
    assert error.value.agents == (0, 1)
    assert error.value.run is not None
    assert len(error.value.run.t) >= 1


def test_a_link_that_appears_with_infinite_energy_is_told() -> None:
    begin = flight([[0, 0], [5.0, 0]], [[1, 0], [-1, 0]])
    with pytest.raises(NotFinite, match="gap") as error:
        simulate(zhou(gap=0.0), begin, 2.0)
    assert error.value.time == pytest.approx(0.5, abs=1e-6)
    assert error.value.run is not None
    assert error.value.run.switches["kind"].tolist() == ["appear"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [14, 18, 22, 24, 38])
def test_pairs_that_creep_past_their_distance_switch_only_the_way_they_move(seed: int) -> None:
    """They do so slower than the positions of a step err, by which alone they would go to and fro and seem to slide."""
    from flocking.papers import olfati_saber_2003

    run = fk.simulate(olfati_saber_2003.scenarios()["olfati-saber-2003-smooth"](seed), progress=False)
    assert run.finished
    speeds, kinds = run.switches["speed"], run.switches["kind"]
    assert {"appear", "break"} <= set(kinds.tolist())
    assert (speeds[kinds == "break"] >= 0).all()
    assert (speeds[kinds == "appear"] <= 0).all()
