"""Leaders whose velocity jumps, has a kink, or is at rest but for a short pulse, against closed forms."""

from __future__ import annotations

from math import erf, exp, pi, sqrt

import numpy as np
import pytest

import flocking as fk
from flocking.model.leaders_and_obstacles.sudden_velocities import sudden_times

SUDDEN = 3.3


def followed(velocity: str, tolerance: float, **numbers: float) -> fk.Run:
    """An agent that takes over a leader's velocity: dp/dt = v - p."""
    law = fk.Law(fk.Fixed(1, []), [fk.Track(fk.Path([velocity, "0*t"], **numbers), velocity_gain=1.0)])
    scenario = fk.Scenario(law, fk.State([[0.0, 0.0]]), 10.0, frames=21, tolerance=tolerance)
    return fk.simulate(scenario, engine="exact", progress=False)


def off(run: fk.Run, expected: list[float]) -> np.ndarray:
    """Errors of the velocities at the frames over those that the run states."""
    assert run.accuracy is not None
    return np.asarray(np.abs(run.p[:, 0, 0] - expected) / (run.accuracy.frames[:, 1] + 1e-12))


@pytest.mark.parametrize("width", [0.1, 1e-3, 1e-6])
def test_no_step_jumps_over_a_pulse(width: float) -> None:
    """The convolution of a Gauss function with exp(-t)."""
    s, w = 5.1, width
    run = followed("exp(-((t - s)/w)**2)/w", 1e-9, s=s, w=w)
    size = sqrt(pi) / 2
    expected = [
        size * exp(s - t + w * w / 4) * (erf((t - s) / w - w / 2) + erf(s / w + w / 2)) if t > s - 20 * w else 0.0
        for t in run.t.tolist()
    ]
    assert max(expected) > 1.0
    assert (off(run, expected) <= 1.0).all()


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-8])
def test_steps_end_where_a_velocity_jumps_or_has_a_kink(tolerance: float) -> None:
    jump = followed("where(t < s, 0, 1)", tolerance, s=SUDDEN)
    assert (off(jump, [1.0 - exp(SUDDEN - t) if t > SUDDEN else 0.0 for t in jump.t.tolist()]) <= 1.0).all()
    kink = followed("where(t < s, 0, t - s)", tolerance, s=SUDDEN)
    expected = [t - SUDDEN - 1.0 + exp(SUDDEN - t) if t > SUDDEN else 0.0 for t in kink.t.tolist()]
    assert (off(kink, expected) <= 1.0).all()
    # The root of a square has the kink of the absolute value.
    root = followed("(t - s + sqrt((t - s)^2))/2", tolerance, s=SUDDEN)
    assert (off(root, expected) <= 1.0).all()
    for run in (jump, kink, root):
        assert np.abs(run.trace["time"] - SUDDEN).min() < 1e-12


def test_only_sudden_changes_end_steps() -> None:
    def times(*velocity: str, end: float = 20.0) -> tuple[float, ...]:
        return sudden_times(fk.Path(velocity), 0.0, end)

    assert (
        times("sin(t)", "cos(2*t)")
        == times("sin(t)/sqrt(2 - cos(t))", "0*t")
        == times("exp(-t)", "tanh(t - 10)")
        == times("t**2", "1/(1 + t)")
        == ()
    )
    assert times("abs(t - 2)", "where(t < 7, 1, 2)") == pytest.approx((2.0, 7.0), rel=1e-14)
    assert sudden_times(fk.Velocity([1.0, 0.0]), 0.0, 1.0) == sudden_times(fk.Sink([1.0, 0.0]), 0.0, 1.0) == ()
    assert min(abs(t - 4.0) for t in times("exp(-((t - 4)/0.01)**2)", "0*t")) < 0.01


@pytest.mark.parametrize("velocity", ["where(t < s, 0, 3)", "where(t <= s, 0, 3)", "where(t > s, 3, 0)"])
def test_jumps_of_a_velocity_are_jumps_of_the_energy_in_its_frame(velocity):
    """An agent of velocity p behind a leader whose velocity jumps from 0 to 3, dp/dt = v - p: ((p - 3)^2 - p^2)/2.

    At whatever time of the run, its first and last one included, and whether it is before the jump or after it there.
    """
    length = 2.0
    for begin in (0.0, 1.5, -3.3, 1e5):
        for share in (0.0, 0.35, 1.0):
            at, end = begin + share * length, begin + length
            leader = fk.Path([velocity, "0"], start_time=begin, s=at)
            law = fk.Law(fk.Fixed(1, []), [fk.Track(leader, velocity_gain=1.0)])
            start = fk.State([[0.0, 0.0]], [[1.0, 0.0]], begin)
            scenario = fk.Scenario(law, start, end, frames=5, energy=fk.Energy(frame="leader", leader=leader))
            run = fk.simulate(scenario, engine="exact", progress=False)
            # A jump after the end, or one that has come to pass at the start, is none of the run.
            first, last = (float(leader.velocity_at(t)[0]) for t in (begin, end))
            p = exp(-share * length)
            expected = ((p - 3.0) ** 2 - p**2) / 2.0 if first != last else 0.0
            assert run.trace["jumped"][-1] == pytest.approx(expected, abs=1e-7)
            assert np.abs(run.residual).max() < 1e-7
            assert run.trace["time"][-1] == run.t[-1] == end
            assert fk.audit(run)["ledger"].verdict == "holds"


@pytest.mark.parametrize("begin", [0.0, 1.5])
def test_gains_that_change_at_the_very_end_are_in_its_energy(begin):
    """The last frame is held against the ledger: 4/2 |q|^2 is stored of an agent at rest that was held by nothing."""
    track = fk.Track(fk.Sink([0.0, 0.0]), fk.Schedule([begin + 2.0], [0.0, 4.0]), 0.0)
    scenario = fk.Scenario(fk.Law(fk.Fixed(1, []), [track]), fk.State([[1.0, 0.0]], t=begin), begin + 2.0, frames=3)
    run = fk.simulate(scenario, engine="exact", progress=False)
    assert run.trace["jumped"][-1] == run.trace["energy"][-1] == pytest.approx(2.0)
    assert run.trace["time"][-1] == run.t[-1] == begin + 2.0
    assert fk.audit(run)["ledger"].verdict == "holds"


@pytest.mark.parametrize(("velocity", "when"), [("where(t <= s, 0, 3)", 1.0), ("where(t < s, 0, 3)", 1.0 - 2.0**-53)])
@pytest.mark.parametrize("what", ["law", "state", "nothing"])
def test_a_session_is_changed_just_before_a_jump(velocity, when, what):
    """The first moment after it is the next number: the jump counts once, under the law in force."""
    leader = fk.Path([velocity, "0"], start_time=0.0, s=1.0)
    law, other = (fk.Law(fk.Fixed(1, []), [fk.Track(leader, velocity_gain=k)]) for k in (1.0, 1.5))
    made = fk.Scenario(
        law, fk.State([[0.0, 0.0]], [[1.0, 0.0]]), 2.0, frames=5, energy=fk.Energy(frame="leader", leader=leader)
    )
    session = fk.start(made, engine="exact")
    session.advance(when)
    if what == "law":
        session.replace(law=other)
    if what == "state":
        session.replace(state=fk.State([[0.5, 0.0]], [[1.0, 0.0]], when))
    session.advance(2.0)
    p = exp(-1.0)
    # A state that is given adds what it has more of energy than the one before, under a leader at speed 3 by then.
    given = ((1.0 - 3.0) ** 2 - (p - 3.0) ** 2) / 2.0 if what == "state" else 0.0
    run = session.run()
    assert run.trace["jumped"][-1] == pytest.approx(((p - 3.0) ** 2 - p**2) / 2.0 + given, abs=1e-7)
    assert np.abs(run.residual).max() < 1e-7


@pytest.mark.parametrize("velocity", ["where(t < s, 0, 3)", "where(t <= s, 0, 3)"])
@pytest.mark.parametrize("pause", [(), (2.0,), (2.5, 3.7, 9.0), (1.0, 2.0 + 2.0**-51)])
def test_sessions_that_go_on_beyond_the_end_see_jumps_there(velocity, pause):
    """The end of the scenario, 2, and of stretches of time beyond it, 6 and 14, are no special times of a leader."""
    for jump in (2.0, 2.0 + 2.0**-51, 2.3, 6.0, 14.5):
        leader = fk.Path([velocity, "0"], s=jump)
        law = fk.Law(fk.Fixed(1, []), [fk.Track(leader, velocity_gain=1.0)])
        frame = fk.Energy(frame="leader", leader=leader)
        scenario = fk.Scenario(law, fk.State([[0.0, 0.0]], [[1.0, 0.0]]), 2.0, frames=3, energy=frame)
        session = fk.start(scenario, engine="exact")
        for time in pause:
            session.advance(time)
        session.advance(20.0)
        p = exp(-jump)
        run = session.run()
        assert run.trace["jumped"][-1] == pytest.approx(((p - 3.0) ** 2 - p**2) / 2.0, abs=1e-7)
        assert np.abs(run.residual).max() < 1e-7
        assert session.state.p[0, 0] == pytest.approx(3.0 + (p - 3.0) * exp(jump - 20.0), abs=1e-8)


@pytest.mark.parametrize("velocity", ["where(t < s, 0, 3)", "exp(-((t - s)/1e-5)**2)"])
def test_pauses_change_no_bit_beyond_the_end(velocity):
    leader = fk.Path([velocity, "0"], s=7.3)
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Track(leader, velocity_gain=1.0)])
    start = fk.State([[0.0, 0.0], [1.5, 0.2]], [[1.0, 0.0], [0.0, 0.3]])
    scenario = fk.Scenario(law, start, 2.0, frames=3, agents=fk.Disturbed(fk.PointMass(), 0.1, 0.5))
    ends = []
    for pauses in ((), (2.0,), (1.0, 5.9, 6.0), (3.0, 7.29, 7.31)):
        session = fk.start(scenario, engine="exact")
        for time in pauses:
            session.advance(time)
        session.advance(9.0)
        ends.append(session.state)
    for end in ends[1:]:
        np.testing.assert_array_equal(end.q, ends[0].q)
        np.testing.assert_array_equal(end.p, ends[0].p)


def test_jumps_of_a_leader_that_only_the_energy_looks_at_are_jumps_of_the_energy():
    """Agents at rest behind a leader whose velocity jumps from 0 to 3: 9/2 each."""
    leader = fk.Path(["where(t < 1.2, 0, 3)", "0"])
    law = fk.Law(fk.Fixed(2, []), [fk.Consensus(1.0)])
    frame = fk.Energy(frame="leader", leader=leader)
    scenario = fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]]), 2.0, frames=3, energy=frame)
    run = fk.simulate(scenario, engine="exact", progress=False)
    assert run.trace["jumped"][-1] == pytest.approx(9.0)
    assert np.abs(run.residual).max() < 1e-9
    assert fk.audit(run)["ledger"].verdict == "holds"


def test_gains_of_the_declared_law_change_in_the_ledger_of_another_plant():
    """4/2 |q|^2 is stored from then on of an agent at rest that nothing moves: all of it is a jump."""
    law, plant = (
        fk.Law(fk.Fixed(1, []), [fk.Track(fk.Sink([0.0, 0.0]), gain, 0.0)])
        for gain in (fk.Schedule([1.2], [0.0, 4.0]), 0.0)
    )
    scenario = fk.Scenario(law, fk.State([[1.0, 0.0]]), 2.0, frames=3)
    run = fk.simulate(scenario, engine="exact", plant=plant, progress=False)
    assert run.trace["jumped"][-1] == pytest.approx(2.0)
    assert np.abs(run.residual).max() < 1e-9


@pytest.mark.parametrize("engine", ["exact", "delayed"])
def test_a_gust_begins_at_the_end_of_the_scenario_too(engine):
    """A session that goes on beyond it moves as one whose scenario ends later."""
    world = {"information": fk.Messages(0.5)} if engine == "delayed" else {}
    ends = []
    for end, pauses in ((4.0, ()), (2.0, ()), (2.0, (2.0,)), (2.0, (1.0, 2.0, 2.7))):
        law = fk.Law(fk.Fixed(1, []), [fk.Consensus(1.0)])
        bodies = fk.Disturbed(fk.PointMass(), 1.0, 0.5, seed=1)
        scenario = fk.Scenario(law, fk.State([[0.0, 0.0]]), end, frames=3, agents=bodies, **world)
        session = fk.start(scenario, engine=engine)
        for time in pauses:
            session.advance(time)
        session.advance(3.3)
        ends.append(session.state.q)
    np.testing.assert_allclose(ends, [ends[0]] * 4, atol=1e-12)
