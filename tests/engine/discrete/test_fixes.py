"""Agents that know themselves and others by fixes, and follow desired velocities, beside what equations' checks try."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import flocking as fk
from flocking.engine.discrete.cell_pairs import CellPairs
from flocking.errors import LawNotObeyed, UnsupportedLaw
from flocking.model.terms.braking import braking_distance, braking_speed

system = fk.papers.vasarhelyi_2018.system


def flock(agents=20, duration=3.0, **changes):
    return system.flock(agents, seed=3, duration=duration).with_(**changes)


@given(st.floats(0.0, 100.0), st.floats(0.1, 10.0), st.floats(0.1, 3.0))
def test_the_braking_curve_and_its_inverse(speed, acceleration, slope):
    distance = braking_distance(speed, acceleration, slope)
    assert braking_speed(distance, acceleration, slope) == pytest.approx(speed, rel=1e-9, abs=1e-9)
    meet = acceleration / slope**2
    below, above = (braking_speed(meet * x, acceleration, slope) for x in (1 - 1e-9, 1 + 1e-9))
    assert above - below == pytest.approx(2e-9 * meet * slope, rel=0.1)


def test_who_brakes_by_the_curve_stops_at_its_end():
    """Followed by dx/dt = -D(x): constant deceleration a, then an exponential approach with the rate p."""
    x, h = 40.0, 1e-4
    path = []
    for _ in range(200_000):
        path.append(x)
        x -= h * float(braking_speed(x, 2.5, 0.4))
    speeds = braking_speed(np.array(path), 2.5, 0.4)
    slowing = -np.diff(speeds)[speeds[:-1] > 6.3] / h
    assert_allclose(slowing, 2.5, rtol=1e-3)
    late = speeds[:-1] < 6.2
    assert_allclose(-np.diff(speeds)[late] / h, 0.4 * speeds[:-1][late], rtol=1e-3)
    assert 0.0 < path[-1] < 0.5


def test_runs_go_on_with_the_same_bits_and_are_stored(tmp_path):
    made = flock()
    whole = fk.simulate(made, progress=False, save=tmp_path / "run")
    for until in (1.2, 1.73):
        part = fk.start(made)
        part.advance(until)
        again = part.moment()()
        again.advance(made.t_end)
        assert fk.first_difference(again.run(), whole) is None
    assert fk.first_difference(fk.read_run(tmp_path / "run"), whole) is None
    fk.write_scenario(made, tmp_path / "flock.toml")
    assert fk.first_difference(fk.simulate(fk.read_scenario(tmp_path / "flock.toml"), progress=False), whole) is None
    assert whole.provenance["law_checks"] == 2
    assert whole.provenance["law_gap"] == 0.0
    assert "1 late within 100" in whole.provenance["world"]


def test_a_crafted_checkpoint_is_refused():
    session = fk.start(flock())
    session.advance(1.0)
    numbers, arrays = session.pack()
    for name in ("ahead", "heard", "errors"):
        assert name in arrays
        session.memory.__dict__[name] = None
    assert set(session.pack()[1]) == set(arrays) - {"ahead", "heard", "errors"}
    assert numbers


def test_a_neighbour_that_the_cell_list_loses_is_noticed(monkeypatch):
    right = CellPairs.near

    def lost(self, q):
        i, j, r = right(self, q)
        kept = r > r.min()
        return i[kept], j[kept], r[kept]

    monkeypatch.setattr(CellPairs, "near", lost)
    with pytest.raises(LawNotObeyed):
        fk.simulate(flock(), progress=False)


def test_nobody_beyond_the_range_is_heard():
    near, far = (fk.State([[0.0, 0.0], [x, 0.0]], [[4.0, 0.0], [-4.0, 1.0]]) for x in (99.0, 101.0))
    law = fk.Law(fk.Proximity(1.0), [fk.BrakingAlignment(1.0, 0.0, 200.0, 1.0, 1.0, range=300.0)])
    for begin, turns in ((near, True), (far, False)):
        made = fk.Scenario(law, begin, t_end=0.2, frames=2, agents=fk.VelocityUnit(1.0, speed=9.0),
                           information=fk.Fixes(0.2, range=100.0), control=fk.Held(0.2))  # fmt: skip
        p = fk.simulate(made, progress=False).p
        # Without a desired velocity agents come to rest along their own direction.
        assert (abs(p[1, 0, 1]) > 0.0) == turns


def test_frames_between_ticks_are_on_the_straight_line():
    run = fk.simulate(flock(duration=1.0, frames=[0.2, 0.25, 0.4], t_end=0.4), progress=False)
    assert_allclose(run.q[1], run.q[0] + 0.25 * (run.q[2] - run.q[0]), atol=1e-12)


def test_errors_of_fixes_have_their_stationary_variances():
    fixes = fk.Fixes(0.2, diffusion=0.5, damping=2.0, stiffness=3.0, seed=1)
    errors, squares = np.zeros((4000, 4)), np.zeros(4)
    for sample in range(200):
        errors = fixes.next_errors(errors, sample)
        if sample >= 100:
            squares += (errors**2).mean(axis=0) / 100
    position, velocity = fk.papers.vasarhelyi_2018.error_variances(0.2, 0.5, 2.0, 3.0)
    assert_allclose(squares, [position, position, velocity, velocity], rtol=0.05)


@pytest.mark.parametrize(
    ("part", "word"),
    [
        (lambda: fk.Fixes(0.2, delay=0.3), "delay must be a multiple"), (lambda: fk.Fixes(0.0), "period"),
        (lambda: fk.Fixes(0.2, damping=9.2, stiffness=9.0), "damping must leave"),
        (lambda: fk.Fixes(0.2, diffusion=0.5), "damping must be positive where diffusion is"),
        (lambda: fk.VelocityUnit(0.0), "time_constant"), (lambda: fk.VelocityUnit(1.0, fixed=True), "speed must be"),
        (lambda: fk.VelocityUnit(1.0, substeps=0), "substeps"), (lambda: fk.LinearRepulsion(0.0, 1.0, 1.0), "slope"),
        (lambda: fk.BrakingAlignment(-1.0, 0.0, 1.0, 1.0, 1.0, 1.0), "gain"), (lambda: fk.SelfPropulsion(0.0), "speed"),
        (lambda: fk.ShillWalls(1.0, 1.0, 0.0, 1.0), "acceleration"),
        (lambda: flock(law=fk.Law(fk.Proximity(1.0), [fk.ShillDisc([0.0], 1.0, 1.0, 1.0, 1.0)])), "2 coordinates"),
        (lambda: flock(control=fk.Held(0.2, phase=0.1)), "without a phase"),
    ],
)  # fmt: skip
def test_wrong_numbers_are_refused(part, word):
    with pytest.raises(fk.InvalidInput, match=word):
        part()


def test_what_is_not_run_is_refused():
    with pytest.raises(UnsupportedLaw, match="period of the control"):
        fk.simulate(flock(control=fk.Held(0.1)), progress=False)
    law = fk.Law(fk.Proximity(1.0), [fk.SelfPropulsion(1.0), fk.Consensus(1.0)])
    with pytest.raises(UnsupportedLaw, match="steering terms alone"):
        fk.simulate(flock(law=law), progress=False)
    point = {"agents": fk.PointMass(), "control": fk.Held(0.2)}
    plain = fk.Scenario(fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)]), flock().start, t_end=1.0, **point)
    with pytest.raises(UnsupportedLaw, match="does not run information=Fixes"):
        fk.simulate(plain.with_(information=fk.Fixes(0.2)), engine="sampled", progress=False)


def test_errors_are_refused_where_they_grow_and_nowhere_else():
    """By the eigenvalues of x' = x + T v', v' = v - T (s x + b v)."""
    rng = np.random.default_rng(0)
    refused = 0
    for period, damping, stiffness in zip(
        rng.uniform(0.05, 1.0, 200), rng.uniform(0.01, 5.0, 200), rng.uniform(0.01, 8.0, 200), strict=True
    ):
        step = np.array([
            [1.0 - period**2 * stiffness, period * (1.0 - period * damping)],
            [-period * stiffness, 1.0 - period * damping],
        ])  # fmt: skip
        grows = np.abs(np.linalg.eigvals(step)).max() >= 1.0
        refused += grows
        if grows:
            with pytest.raises(fk.InvalidInput, match="damping must leave errors bounded"):
                fk.Fixes(period, diffusion=0.1, damping=damping, stiffness=stiffness)
        else:
            fk.Fixes(period, diffusion=0.1, damping=damping, stiffness=stiffness)
    assert 20 < refused < 180


@pytest.mark.parametrize("share", [0.5, 1.0, 1.9, 2.0, 2.1, 10.0])
def test_steps_under_which_a_velocity_would_swing_ever_further_are_refused(share):
    """By s' = s + h/tau (v - s): differences from v are multiplied by 1 - h/tau."""
    law = fk.Law(fk.Proximity(1.0), [fk.SelfPropulsion(1.0)])
    start = fk.State([[0.0, 0.0], [9.0, 0.0]], [[0.5, 0.0], [0.5, 0.0]])
    body = fk.VelocityUnit([1.0, 0.01 / share], substeps=20)
    made = {"agents": body, "control": fk.Held(0.2), "frames": 2}
    if share < 2.0:
        run = fk.simulate(fk.Scenario(law, start, 0.2, **made), progress=False)
        assert_allclose(run.p[1, 1, 0], 1.0 - 0.5 * (1.0 - share) ** 20, atol=1e-12)
    else:
        with pytest.raises(fk.InvalidInput, match="substeps must be more than 10 "):
            fk.Scenario(law, start, 0.2, **{**made, "agents": fk.VelocityUnit([1.0, 0.01], substeps=10)})
        with pytest.raises(fk.InvalidInput, match="VelocityUnit: substeps must be more than"):
            fk.Scenario(law, start, 0.2, **made)


@pytest.mark.filterwarnings("ignore:State. q has shape")
@pytest.mark.parametrize("dimension", [2, 4])
def test_without_a_range_agents_are_heard_that_are_further_away_than_they_are_known_to_be(dimension):
    """As with a range beyond all of them: a fix that is late, or off, places another within reach of a term."""
    q, p = np.zeros((12, dimension)), np.zeros((12, dimension))
    q[:, 0], p[:, 0] = 4.0 * np.arange(12), np.linspace(0.5, 9.0, 12)
    law = fk.Law(fk.Proximity(1.0), [fk.SelfPropulsion(1.0), fk.LinearRepulsion(1.0, 12.0, 5.0)])
    made = fk.Scenario(law, fk.State(q, p), t_end=2.4, frames=13, agents=fk.VelocityUnit(1.0, speed=9.0),
                       control=fk.Held(0.2))  # fmt: skip
    errors = {"diffusion": 0.5, "damping": 2.0, "stiffness": 3.0}
    runs = [
        fk.simulate(made.with_(information=fk.Fixes(0.2, delay=0.6, range=far, **errors)), progress=False).q
        for far in (None, 1e9)
    ]
    assert_allclose(runs[0], runs[1], rtol=0.0, atol=0.0)


def test_the_fix_at_the_start_has_the_errors_of_one_step_and_others_are_known_exactly_then():
    fixes = fk.Fixes(0.2, delay=0.4, diffusion=0.5, damping=2.0, stiffness=3.0)
    start = flock().start
    exact = np.concatenate([start.q, start.p], axis=1)
    session = fk.start(flock(information=fixes))
    session.advance(0.1)
    heard = session.memory.heard
    assert_allclose(heard[1:], np.repeat(exact[None], 2, axis=0), rtol=0.0, atol=0.0)
    kicks = (heard[0] - exact)[:, 2:] / np.sqrt(2.0 * 2.0 * 0.2 * 0.5)
    assert_allclose((heard[0] - exact)[:, :2], 0.2 * (heard[0] - exact)[:, 2:], atol=1e-12)
    assert 0.5 < kicks.std() < 1.5


@pytest.mark.parametrize("desired", [1e3, 1e200])
def test_the_largest_acceleration_holds_for_velocities_whose_squares_overflow(desired):
    start = fk.State([[0.0, 0.0], [9.0, 0.0]], [[0.5, 0.0], [0.0, 0.5]])
    made = fk.Scenario(fk.Law(fk.Proximity(1.0), [fk.SelfPropulsion(desired)]), start, 0.2, frames=2,
                       agents=fk.VelocityUnit(1.0, acceleration=6.0), control=fk.Held(0.2))  # fmt: skip
    run = fk.simulate(made, progress=False)
    assert_allclose(run.p[1], [[0.5 + 0.2 * 6.0, 0.0], [0.0, 0.5 + 0.2 * 6.0]], atol=1e-12)
