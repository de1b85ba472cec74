"""Work in slices of wall time: it changes no number, ends in time, and says so where steps have shrunk to nothing."""

import signal
import time

import numpy as np
import pytest

import flocking as fk
from flocking.engine.adaptive_steps.step_lengths import RECENT, Shrunk, StepLengths, most_strained
from flocking.engine.exact.session import ExactSession
from flocking.errors import StepTooSmall


def scenario(sign=1.0, start_time=0.0, t_end=2.0, frames=2):
    """Zhou's law, its sign flipped by -1: linked pairs are then pulled to the pole at R."""
    from flocking.papers import zhou_2015

    found = zhou_2015.scenario(seed=0, duration=20.0)
    psi = fk.Potential("k*(1/r + 1/(R - r))", k=sign, R=4.0)
    start = fk.State(found.start.q, found.start.p, start_time)
    law = fk.Law(found.law.graph, [fk.Gradient(psi), *found.law.terms[1:]])
    return found.with_(law=law, start=start, t_end=start_time + t_end, frames=frames)


def collapsing(t_end=20.0):
    return scenario(-1.0, t_end=t_end)


def nearest_the_pole(state):
    """The linked pair that is nearest to the pole: nothing else feels so large a force."""
    r = np.linalg.norm(state.q[:, None] - state.q[None], axis=2)
    r[~state.links] = 0.0
    return tuple(sorted(int(x) for x in np.unravel_index(r.argmax(), r.shape)))


@pytest.fixture(scope="module")
def stuck():
    """A session that was advanced to the end of its scenario for a quarter of a second, again and again."""
    session = ExactSession(collapsing())
    session.advance(0.004)
    end = time.monotonic() + 60
    longest = 0.0
    while session.shrunk is None:
        begin = time.process_time()
        session.advance(20.0, seconds=0.25)
        longest = max(longest, time.process_time() - begin)
        assert time.monotonic() < end, "the steps did not shrink"
    return session, longest


def test_a_slice_ends_while_steps_shrink(stuck):
    session, longest = stuck
    assert session.time < 0.01
    assert longest < 3.0  # a quarter of a second and the last step
    begin = session.steps
    session.advance(20.0, seconds=0.0)
    assert session.steps == begin + 1


def test_who_made_the_steps_shrink_is_named(stuck):
    session, _ = stuck
    found = session.shrunk
    assert found.agents == nearest_the_pole(session.state)
    assert found.step < 20.0 / 1e9
    assert found.step >= session._segment.t1 - session._segment.t0 > 0.0
    i, j = found.agents
    assert str(found) == f"steps have shrunk to {found.step:.2g}, agents {i} and {j}"


def test_single_short_steps_are_no_collapse():
    lengths = StepLengths(1.0)
    for k in range(4 * RECENT):
        lengths.add(1e-12 if k % 10 else 0.1)
    assert lengths.shrunk_to is None
    assert lengths.usual
    for _ in range(RECENT):
        lengths.add(1e-5)
    assert not lengths.usual
    for _ in range(RECENT):
        assert lengths.shrunk_to is None
        lengths.add(1e-12)
    assert lengths.shrunk_to == 1e-12
    lengths.add(0.1)
    assert lengths.shrunk_to is None


def test_agents_are_named_by_their_errors():
    assert most_strained(np.array([0.1, 3.0, 0.0, 2.0])) == (1, 3)
    assert most_strained(np.array([0.1, np.nan, 2.0])) == (1,)
    assert most_strained(np.zeros(3)) == ()
    assert most_strained(np.ones(9)) == (0, 1, 2, 3)
    assert str(Shrunk(1e-19, (3,))) == "steps have shrunk to 1e-19, agent 3"
    assert str(Shrunk(1e-19)) == "steps have shrunk to 1e-19"


def in_slices(session, to, seconds):
    ends = []
    while session.time < to:
        session.advance(to, seconds=seconds)
        ends.append(session.time)
    assert ends == sorted(set(ends))
    return len(ends)


def same(a, b):
    for name in ("t", "q", "p", "links", "switches", "trace"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name
    assert a.closest_linked == b.closest_linked
    assert np.array_equal(a.accuracy.frames, b.accuracy.frames)
    assert np.array_equal(a.accuracy.doubts, b.accuracy.doubts)
    assert a.accuracy.largest == b.accuracy.largest


@pytest.mark.parametrize("start_time", [0.0, 1e6 + 0.1])
def test_how_a_run_is_sliced_changes_no_number(start_time):
    chosen = scenario(start_time=start_time, frames=41)
    whole, sliced, now_and_then = (ExactSession(chosen) for _ in range(3))
    whole.advance(chosen.t_end)
    count = in_slices(sliced, chosen.t_end, 0.0)
    assert count >= whole.steps > 20  # every step was a slice of its own
    in_slices(now_and_then, chosen.t_end, 0.002)
    assert len(whole.records.switches) > 0
    same(whole.run(), sliced.run())
    same(whole.run(), now_and_then.run())
    assert whole.steps == sliced.steps


def test_a_slice_ends_where_it_can_be_gone_to_again():
    """Time at the end of a slice leads another session to the same state, far from t = 0 as well."""
    chosen = scenario(start_time=1e6 + 0.1)
    session = ExactSession(chosen)
    for _ in range(20):
        session.advance(chosen.t_end, seconds=0.0)
        other = ExactSession(chosen)
        other.advance(session.time)
        assert np.array_equal(other.state.q, session.state.q)
        assert other.steps == session.steps
        assert session.time_is_exact


def test_where_steps_are_shorter_than_times_can_tell_a_slice_ends_all_the_same():
    chosen = scenario(-1.0, start_time=2.0**30, t_end=20.0)
    session = ExactSession(chosen)
    session.advance(2.0**30 + 0.004)
    end = time.monotonic() + 60
    while session.shrunk is None:
        session.advance(chosen.t_end, seconds=0.05)
        assert time.monotonic() < end
    session.advance(chosen.t_end, seconds=0.0)
    assert not session.time_is_exact
    # Not a state that the polynomial of a step gives outside of it.
    q = session._origin.outwards(0.0, *session._dynamics.split(session._segment.coefficients[0])[:2])[0]
    assert session.state.q == pytest.approx(q, rel=1e-12)
    assert np.isfinite(session.run().q).all()


def test_a_snapshot_between_slices_goes_on_bit_for_bit():
    chosen = scenario(frames=11)
    whole, other = ExactSession(chosen), ExactSession(chosen)
    whole.advance(chosen.t_end)
    while other.time < chosen.t_end:
        other.advance(chosen.t_end, seconds=0.01)
        other = ExactSession.resume(other.snapshot())
    same(whole.run(), other.run())


class Told:
    """Presses Ctrl-C as soon as a run says that its steps have shrunk."""

    def __init__(self, monkeypatch):
        from flocking.engine.driver.progress import Progress

        self.pressed, self.said = 0.0, ""
        before = Progress.show

        def show(bar, t, agent_steps, note=""):
            before(bar, t, agent_steps, note)
            if note and not self.pressed:
                self.said, self.pressed = note, time.process_time()
                signal.raise_signal(signal.SIGINT)

        monkeypatch.setattr(Progress, "show", show)


def test_ctrl_c_is_answered_while_steps_shrink(monkeypatch, capsys):
    told = Told(monkeypatch)
    monkeypatch.setattr("flocking.engine.driver.waits.LINE_SECONDS", 0.0)
    monkeypatch.setattr("flocking.engine.driver.waits.QUIET_SECONDS", 0.0)
    run = fk.simulate(collapsing())
    assert time.process_time() - told.pressed < 3.0
    assert run.status.startswith("interrupted at t = 0.00")
    assert np.isfinite(run.q).all()
    assert told.said in capsys.readouterr().err
    assert told.said.startswith("steps have shrunk to")
    assert "agents" in told.said


def test_an_interrupt_within_a_step_leaves_the_session_whole(monkeypatch):
    from flocking.engine import interruption
    from flocking.engine.exact.blocks import block

    # Many native calls, between which interrupts are noted.
    monkeypatch.setattr(block, "MOST_STEPS", 8)
    chosen = scenario(frames=11)
    whole, other = ExactSession(chosen), ExactSession(chosen)
    whole.advance(chosen.t_end)
    draw = np.random.default_rng(0)

    def check():
        if draw.random() < 0.9:
            raise interruption.Noted

    monkeypatch.setattr(interruption, "check", check)
    stopped = 0
    while other.time < chosen.t_end:
        try:
            other.advance(chosen.t_end)
        except interruption.Noted:
            stopped += 1
    assert stopped > 20
    same(whole.run(), other.run())


def test_the_error_of_a_singularity_names_the_step_and_the_agents():
    psi = fk.Potential("-k/r**2", k=1.0)
    start = fk.State([[9.0, 9.0], [0.0, 0.0], [1.0, 0.0]])
    with pytest.raises(StepTooSmall, match=r"shrank to \d.*e-\d+.*agents \[1, 2\]") as found:
        fk.simulate(fk.Scenario(fk.Law(fk.Fixed.complete(3), [fk.Gradient(psi)]), start, t_end=10.0), progress=False)
    assert found.value.agents == (1, 2)
