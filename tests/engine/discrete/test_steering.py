"""Steering terms, and agents that act one after another, against loops agent by agent."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import flocking as fk
from flocking.engine.discrete.cell_pairs import CellPairs
from flocking.engine.reference.steering import everyone, seen_by
from flocking.errors import LawNotObeyed, UnsupportedLaw
from flocking.model.world.random_numbers import Purpose, uniform
from tests.papers.transcriptions.standard_laws import reynolds as by_hand

system = fk.papers.reynolds_1987.system
STEP = 0.1


def boids(n=25, update="forward", t_end=1.0, **changes):
    start = fk.start.ball(n, radius=7.0, speed=6.0, dimension=3, seed=1)
    parts = {"agents": fk.Impulsive(force=27.0, speed=9.0, update=update), "control": fk.Held(STEP),
             "frames": round(t_end / STEP) + 1, **changes}  # fmt: skip
    return fk.Scenario(system.boid_law(), start, t_end=t_end, **parts)


def test_boids_that_act_together_follow_the_program():
    run = fk.simulate(boids(), progress=False)
    q, p = run.q[0].tolist(), run.p[0].tolist()
    for k in range(len(run.t)):
        assert_allclose(run.q[k], q, atol=1e-11)
        assert_allclose(run.p[k], p, atol=1e-11)
        p = [by_hand.steered(q, p, i, STEP) for i in range(25)]
        q = [by_hand.plus(a, by_hand.times(STEP, b)) for a, b in zip(q, p, strict=True)]
    assert run.provenance["law_checks"] == 2
    assert run.provenance["law_gap"] == 0.0


def test_boids_that_act_in_the_order_of_their_numbers_follow_the_program():
    run = fk.simulate(boids(update="sequential"), progress=False)
    q, p = run.q[0].tolist(), run.p[0].tolist()
    for k in range(len(run.t)):
        assert_allclose(run.q[k], q, atol=1e-11)
        assert_allclose(run.p[k], p, atol=1e-11)
        q, p = by_hand.sequential(q, p, STEP)


def test_birds_act_in_a_new_random_order_at_every_update():
    run = fk.simulate(system.birds(40, 20.0, 5.0, seed=6, updates=6), progress=False)
    q, p, orders = run.q[0].tolist(), run.p[0].tolist(), set()
    for k in range(7):
        assert_allclose(run.q[k], q, atol=1e-11)
        assert_allclose(run.p[k], p, atol=1e-11)
        order = np.argsort(uniform(6, Purpose.TURN, np.arange(40), 0, k))
        orders.add(tuple(order))
        q, p = by_hand.activated(q, p, order, 20.0, 5.0)
    assert len(orders) == 7
    # 16 agents at the first and the fourth tick.
    assert run.provenance["law_checks"] == 32


def test_in_the_middle_of_an_update_agents_are_on_their_straight_ways():
    whole = fk.simulate(boids(update="sequential", t_end=0.2, frames=[0.1, 0.15, 0.2]), progress=False)
    assert_allclose(whole.q[1], 0.5 * (whole.q[0] + whole.q[2]), atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([2, 3]), st.booleans())
def test_the_cell_list_and_all_pairs_give_the_same_forces(seed, m, torus):
    rng = np.random.default_rng(seed)
    q, p = rng.random((20, m)) * 6.0, rng.normal(size=(20, m))
    space = fk.Periodic([6.0] * m) if torus else fk.Open()
    terms = (fk.Separation(1.0, 2.0, -0.5, 0.3, exponent=1.5), fk.Alignment(2.0, 2.5, 0.2, total="mean"),
             fk.Cohesion(0.5, 2.9, 0.6, total="sum"))  # fmt: skip
    far = 2.9
    i, j, _ = CellPairs(space, far * (1 + 1e-9), 20).near(q)
    listed, found = seen_by(np.arange(20), (i, j), q, p, space), np.arange(20)
    compared = seen_by(found, everyone(found, q, far, space), q, p, space)
    for term in terms:
        assert np.array_equal(term.steer(listed), term.steer(compared))


def test_a_neighbour_that_the_cell_list_loses_is_noticed(monkeypatch):
    right = CellPairs.near

    def lost(self, q):
        i, j, r = right(self, q)
        return i[1:], j[1:], r[1:]

    monkeypatch.setattr(CellPairs, "near", lost)
    for update in ("forward", "sequential"):
        with pytest.raises(LawNotObeyed):
            fk.simulate(boids(update=update), progress=False)


def test_a_run_goes_on_with_the_same_bits(tmp_path):
    made = boids(update="shuffled", t_end=0.6)
    whole = fk.simulate(made, progress=False, save=tmp_path / "run")
    for until in (0.3, 0.35):
        part = fk.start(made)
        part.advance(until)
        again = part.moment()()
        again.advance(made.t_end)
        assert fk.first_difference(again.run(), whole) is None
    assert fk.first_difference(fk.read_run(tmp_path / "run"), whole) is None


def test_who_is_at_rest_sees_all_around_and_has_no_heading():
    q = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.5]])
    p = np.array([[0.0, 0.0], [0.0, 2.0], [3.0, 0.0]])
    state = fk.State(q, p)

    def force(term):
        return fk.control(fk.Law(fk.Proximity(3.0), [term]), state)[0]

    assert_allclose(force(fk.Cohesion(1.0, 3.0, 0.99, total="sum")), [0.0, 0.5])
    assert_allclose(force(fk.Alignment(1.0, 3.0, total="sum")), [1.0, 1.0])
    assert_allclose(force(fk.Alignment(1.0, 3.0, total="mean", compared="velocities")), [1.5, 1.0])
    together = fk.State(np.zeros((2, 2)), p[:2])
    assert_allclose(fk.control(fk.Law(fk.Proximity(3.0), [fk.Separation(1.0, 3.0)]), together), 0.0)


@pytest.mark.parametrize(
    ("part", "changes", "word"),
    [
        (fk.Separation, {"weight": -1.0}, "weight"), (fk.Separation, {"radius": 0.0}, "radius"),
        (fk.Cohesion, {"cosine": 1.0}, "cosine"), (fk.Alignment, {"near": 3.0}, "near"),
        (fk.Cohesion, {"total": "median"}, "total"), (fk.Alignment, {"compared": "speeds"}, "compared"),
        (fk.Separation, {"among": 2.0}, "among"), (fk.Separation, {"exponent": -1.0}, "exponent"),
    ],
)  # fmt: skip
def test_wrong_numbers_are_refused(part, changes, word):
    with pytest.raises(fk.InvalidInput, match=f"{part.__name__}: {word}"):
        part(**{"weight": 1.0, "radius": 2.0, **changes})
    with pytest.raises(fk.InvalidInput, match="TurnBack: speed"):
        fk.TurnBack(1.0, 0.0)


def test_what_states_no_formulas_is_refused_where_it_would_be_left_out():
    made = boids()
    with pytest.raises(fk.InvalidInput, match="in discrete time under Separation"):
        made.with_(agents=fk.PointMass(), control=fk.Continuous())
    with pytest.raises(UnsupportedLaw, match="discrete time"):
        fk.simulate(made, engine="tiles", progress=False)
    with pytest.raises(UnsupportedLaw, match="states no formulas"):
        fk.Controller(made.law, 0, agents=25, dimension=3)
    flat = fk.State(made.start.q, made.start.p)
    with pytest.raises(fk.InvalidInput, match="acts about a place"):
        fk.Scenario(made.law, flat, t_end=1.0, agents=made.agents, control=made.control, space=fk.Periodic([99.0] * 3))
    law = fk.Law(fk.Proximity(1.0), [fk.Cohesion(1.0, 5.0)])
    with pytest.raises(fk.InvalidInput, match="twice the reach of Cohesion, 5"):
        fk.Scenario(law, flat, t_end=1.0, agents=made.agents, control=made.control, space=fk.Periodic([10.0] * 3))


def test_turns_need_one_tick_and_steering_terms_alone():
    made = boids(update="sequential")
    with pytest.raises(fk.InvalidInput, match="the same for all agents"):
        made.with_(control=fk.Held(np.linspace(0.1, 0.2, 25)))
    law = fk.Law(fk.Proximity(2.0), [fk.Cohesion(1.0, 2.0), fk.Consensus(1.0)])
    with pytest.raises(UnsupportedLaw, match="steering terms alone"):
        fk.simulate(made.with_(law=law), progress=False)
    with pytest.raises(fk.InvalidInput, match="'shuffled'"):
        fk.Impulsive(update="random")


def test_steering_terms_in_files(tmp_path):
    made = system.birds(6, 20.0, 5.0, seed=2, updates=2)
    fk.write_scenario(made, tmp_path / "birds.toml")
    assert fk.read_scenario(tmp_path / "birds.toml").law == made.law
    boid = boids()
    fk.write_scenario(boid, tmp_path / "boids.toml")
    read = fk.read_scenario(tmp_path / "boids.toml")
    assert read.law == boid.law
    assert read.agents.update == "forward"
    assert replace(read.agents, update="sequential").in_turn


@pytest.mark.filterwarnings("ignore::flocking.errors.SuspectInput")
@pytest.mark.parametrize("update", ["forward", "sequential"])
@pytest.mark.parametrize("space", [fk.Open(), fk.Periodic([5.0, 5.0, np.inf, 6.0])])
def test_agents_steer_in_more_dimensions_than_a_cell_list_has(update, space):
    rng = np.random.default_rng(4)
    start = fk.State(rng.uniform(-3.0, 8.0, (9, 4)), rng.normal(size=(9, 4)))
    law = fk.Law(fk.Proximity(2.0), [fk.Cohesion(1.0, 2.4, total="sum")])
    body, control = fk.Impulsive(update=update), fk.Held(0.5)
    run = fk.simulate(fk.Scenario(law, start, 1.0, agents=body, control=control, frames=3, space=space), progress=False)
    sides = np.array([5.0, 5.0, np.inf, 6.0]) if space.lengths else np.full(4, np.inf)
    q, p = start.q.copy(), start.p.copy()
    for k in range(3):
        assert_allclose(run.q[k], q, atol=1e-12)
        old_q, old_p = q.copy(), p.copy()
        for i in range(9):
            seen_q = q if update == "sequential" else old_q
            d = seen_q - seen_q[i]
            d = np.where(np.isfinite(sides), d - np.where(np.isfinite(sides), sides, 1.0) * np.round(d / sides), d)
            near = np.linalg.norm(d, axis=1) < 2.4
            p[i] = old_p[i] + 0.5 * d[near].sum(axis=0)
            q[i] = old_q[i] + 0.5 * p[i]


@pytest.mark.filterwarnings("ignore::flocking.errors.SuspectInput")
def test_too_many_agents_in_more_dimensions_are_refused_in_a_sentence(monkeypatch):
    from flocking.engine.discrete import law_in_force

    monkeypatch.setattr(law_in_force, "MOST_DENSE", 8)
    start = fk.State(np.zeros((9, 4)), np.ones((9, 4)))
    law = fk.Law(fk.Proximity(2.0), [fk.Cohesion(1.0, 2.4)])
    with pytest.raises(fk.InvalidInput, match="more than 8 agents that steer in more than 3 dimensions"):
        fk.simulate(fk.Scenario(law, start, 1.0, agents=fk.Impulsive(), control=fk.Held(0.5)), progress=False)
