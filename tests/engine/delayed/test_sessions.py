"""Sessions of delayed knowledge: pieces, resuming, links, space, and what is refused."""

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput, SimulationError, UnsupportedLaw

LAW = fk.Law(fk.Hysteresis(4, 0.3), [fk.Gradient(fk.Potential("(r - 2)**2")), fk.Consensus(1.0)])


def scenario(law=LAW, t_end=1.5, **parts):
    start = fk.start.box(8, side=6, speed=2, seed=1, connected_under=LAW.graph)
    return fk.Scenario(law, start, t_end=t_end, frames=16, **{"information": fk.Delayed(0.08), **parts})


def same(a, b):
    return (
        fk.first_difference(a, b) is None and (a.trace == b.trace).all() and a.closest_linked == b.closest_linked
        and np.array_equal(a.switches["time"], b.switches["time"])
    )  # fmt: skip


def check_going_on(made, whole, times, folder):
    """Sessions that go on from moments at some times, and a run that is stored, have the bits of the whole run."""
    for at in times:
        early = fk.start(made)
        early.advance(at)
        again = early.moment()()
        again.advance(made.t_end)
        assert same(again.run(), whole)
    stored = fk.simulate(made, save=folder / "run", progress=False)
    assert same(fk.read_run(folder / "run"), stored)


@pytest.mark.parametrize("late", [False, True])
def test_pieces_moments_and_stored_runs_give_the_same_bits(late, tmp_path):
    made = scenario(information=fk.Delayed(0.08, self_delayed=late))
    whole = fk.simulate(made, progress=False)
    assert whole.fidelity.engine == "delayed"
    assert whole.provenance["world"] == f"{'everybody' if late else 'neighbours'} known 0.08 late"
    assert len(whole.switches) > 3
    session = fk.start(made)
    for t in np.linspace(0.01, 1.5, 23):
        session.advance(float(t))
    assert same(session.run(), whole)
    check_going_on(made, whole, (0.0, 0.03, 0.7123), tmp_path)
    fk.write_scenario(made, tmp_path / "world.toml")
    assert same(fk.simulate(fk.read_scenario(tmp_path / "world.toml"), progress=False), whole)


def test_links_follow_what_agents_know_and_the_truth_is_recorded_beside():
    """Two agents part at speed 1: the link breaks for the receiver tau after it breaks in truth."""
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("0*r"))])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]])
    session = fk.start(fk.Scenario(law, start, t_end=3.0, information=fk.Delayed(0.5)))
    for t, known, true in (
        (0.99, (True, True), True), (1.01, (True, False), False), (1.49, (True, False), False),
        (1.51, (False, False), False),
    ):  # fmt: skip
        session.advance(t)
        # Agent 0 rests and sees the other late; agent 1 moves and knows where it is itself.
        assert (session.known_links[0, 0, 1], session.known_links[0, 1, 0]) == known
        assert session.state.links[0, 1] == true
    (switch,) = session.run().switches
    assert switch["time"] == pytest.approx(1.0, abs=1e-12)


def test_what_was_before_the_start_is_a_straight_line():
    """Known distances at the start are those of a line through the past, which the link rule reads."""
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [2.5, 0.0]], [[0.0, 0.0], [1.0, 0.0]])
    session = fk.start(fk.Scenario(law, start, t_end=1.0, information=fk.Delayed(1.0)))
    assert session.known_links[0].tolist() == [[False, True], [False, False]]
    assert not session.state.links.any()
    assert session.accelerations() == pytest.approx(np.array([[1.0, 0.0], [0.0, 0.0]]))


def test_periodic_space_gives_what_open_space_gives_where_no_image_is_near():
    start = fk.State([[0.1, 0.0], [9.9, 0.3], [0.8, 0.9]], [[0.3, 0.0], [-0.2, 0.1], [0.0, -0.4]])
    shifted = fk.State([[10.1, 0.0], [9.9, 0.3], [10.8, 0.9]], start.p)
    made = fk.Scenario(LAW, start, t_end=3.0, frames=4, information=fk.Delayed(0.2), space=fk.Periodic([10.0, 10.0]))
    around = fk.simulate(made, progress=False)
    plain = fk.simulate(made.with_(start=shifted, space=fk.Open()), progress=False)
    assert np.abs((around.q - plain.q) - [[10.0, 0.0], [0.0, 0.0], [10.0, 0.0]] * np.array(-1.0)).max() < 1e-9
    assert np.abs(around.residual).max() < 1e-9


def test_the_departure_of_a_delay_is_what_the_law_does_not_say():
    """A flock that late neighbours brake loses energy that no term of the law takes."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.State(np.zeros((2, 2)), [[5.0, 0.0]] * 2)
    run = fk.simulate(fk.Scenario(law, start, t_end=2.0, information=fk.Delayed(0.1)), progress=False)
    change = run.trace["energy"][-1] - run.trace["energy"][0]
    assert run.trace["dissipated"][-1] == pytest.approx(0.0, abs=1e-12)
    assert run.trace["departed"][-1] == pytest.approx(change, abs=1e-9)
    assert change < -0.1


def test_a_link_that_would_switch_without_end_is_named():
    """An agent of order 1 is pulled out of a link and pushed back by nothing but the link itself."""
    law = fk.Law(
        fk.Proximity(2.0),
        [fk.Gradient(fk.Potential("-r**2")), fk.Track(fk.Velocity([0.0, 0.0]), position_gain=1.0)],
    )
    start = fk.State([[0.0, 0.0], [1.5, 0.0]])
    made = fk.Scenario(law, start, t_end=5.0, bodies=fk.SingleIntegrator(), information=fk.Delayed(0.2))
    with pytest.raises(SimulationError, match="switch without end") as error:
        fk.simulate(made, progress=False)
    assert len(error.value.agents) == 2
    assert error.value.run is not None


@pytest.mark.slow
def test_a_pole_that_is_met_ends_the_run_with_its_time():
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("-1/r"))])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]])
    with pytest.raises(SimulationError) as error:
        fk.simulate(fk.Scenario(law, start, t_end=5.0, information=fk.Delayed(0.1)), progress=False)
    assert 0.3 < error.value.time < 2.0
    assert error.value.run is not None


def test_agents_that_were_in_one_place_a_delay_before_the_start_are_refused():
    law = fk.Law(fk.Proximity(4.0), [fk.Gradient(fk.Potential("1/r"))])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[5.0, 0.0], [5.0, 0.0]])
    with pytest.raises(InvalidInput, match="finite forces by the states that agents have"):
        fk.start(fk.Scenario(law, start, t_end=1.0, information=fk.Delayed(0.2)))


@pytest.mark.parametrize("engine", ["exact", "sampled", "tiles", "lammps"])
def test_other_engines_refuse_by_name(engine):
    control = fk.Held(0.1) if engine == "sampled" else fk.Continuous()
    with pytest.raises(UnsupportedLaw, match=r"information=Delayed\(...\): it would be left out"):
        fk.start(scenario(control=control), engine=engine)


def test_what_is_not_known_is_refused_by_name():
    with pytest.raises(UnsupportedLaw, match=r"needs information=Delayed"):
        fk.start(scenario(information=fk.Instant()), engine="delayed")
    with pytest.raises(UnsupportedLaw, match=r"control=Held\(...\)"):
        fk.start(scenario(control=fk.Held(0.1)), engine="delayed")
    with pytest.raises(UnsupportedLaw, match="runs no plant"):
        fk.start(scenario(), "delayed", plant=LAW)
    with pytest.raises(InvalidInput, match="Steps are no longer than the delay"):
        fk.start(scenario(information=fk.Delayed(1e-9)))
    for wrong in (-0.1, float("inf"), "0.1", True):
        with pytest.raises(InvalidInput, match=r"Delayed: tau"):
            fk.Delayed(wrong)
    with pytest.raises(InvalidInput, match=r"Delayed: self_delayed"):
        fk.Delayed(0.1, self_delayed=1)


def test_scheduled_gains_act_as_in_the_ideal_world_where_nobody_looks_at_others():
    leader = fk.Velocity([1.0, 0.0], start_time=3.0)
    track = fk.Track(leader, fk.Schedule([3.5, 3.73], [0.0, 2.0, 0.5]), fk.Schedule([3.5], [0.5, 3.0]))
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("0*r")), track])
    start = fk.State([[0.0, 0.0], [1.0, 2.0]], [[0.0, 0.0], [0.0, 1.0]], 3.0)
    ideal = fk.Scenario(law, start, t_end=4.5, frames=16, energy=fk.Energy("leader", leader))
    made = ideal.with_(information=fk.Delayed(0.1))
    late, plain = fk.simulate(made, progress=False), fk.simulate(ideal, progress=False)
    assert (late.fidelity.engine, plain.fidelity.engine) == ("delayed", "exact")
    assert np.abs(late.q - plain.q).max() < 1e-8
    assert late.trace["jumped"][-1] == pytest.approx(plain.trace["jumped"][-1], abs=1e-8)
    assert abs(late.trace["jumped"][-1]) > 0.1
    assert np.abs(late.residual).max() < 1e-8
    for at in (3.4, 3.5, 3.6, 3.9):
        session = fk.start(made)
        session.advance(at)
        again = session.moment()()
        again.advance(4.5)
        assert same(again.run(), late)


def test_a_change_of_gains_comes_back_with_the_delay():
    """Agent 1 is sent off at 1 by its own gain; agent 0 feels it from 1.3 on, to the accuracy of the run."""
    gains = fk.Schedule([1.0], [[0.0, 0.0], [0.0, 1.0]])
    track = fk.Track(fk.Velocity([1.0, 0.0]), 0.0, gains)
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Consensus(0.7), track])
    made = fk.Scenario(law, fk.State(np.zeros((2, 2))), t_end=1.6, frames=33, information=fk.Delayed(0.3))
    run = fk.simulate(made, progress=False)
    s = np.maximum(run.t - 1.0, 0.0)
    # Until 1.6 agent 1 sees agent 0 at rest: p1' = (1 - p1) - 0.7 p1; then p0' = 0.7 (p1(t - 0.3) - p0).
    assert np.abs(run.p[:, 1, 0] - (1 - np.exp(-1.7 * s)) / 1.7).max() < 1e-8
    w = np.maximum(run.t - 1.3, 0.0)
    expected = 0.7 / 1.7 * ((1 - np.exp(-0.7 * w)) / 0.7 + np.exp(-1.7 * w) - np.exp(-0.7 * w))
    assert np.abs(run.p[:, 0, 0] - expected).max() < 1e-8
    assert not run.p[run.t <= 1.3, 0, 0].any()


def test_errors_of_approaches_are_not_stated_where_they_are_not_known():
    """Steps have errors that nothing bounds over a run: a claim of the closest approach stays open."""
    run = fk.simulate(scenario(), progress=False)
    assert np.isfinite(run.closest_linked.distance)
    assert np.isnan(run.closest_linked.error)
