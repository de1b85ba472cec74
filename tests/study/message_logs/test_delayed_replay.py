"""Known links of runs with delayed knowledge: logged where they switch, and computed again from the frames."""

import dataclasses
import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flocking as fk
from flocking.engine.delayed.delayed_law import DelayedLaw
from flocking.engine.delayed.session import DelayedSession
from flocking.engine.delayed.stepping import DelayedSteps
from flocking.engine.driver import session_writer as saving
from flocking.engine.driver.session_writer import SessionWriter
from flocking.engine.runs.message_log import DELAYED
from flocking.errors import UnsupportedLaw
from flocking.study.message_logs.recorded_motion import RecordedMotion

N = 6
PAIRS = np.random.default_rng(1).uniform(0.05, 0.4, (N, N))


def late(own):
    """A delay for every pair."""
    found = PAIRS.copy()
    np.fill_diagonal(found, own)
    return found


KINDS = {
    "one": fk.Delayed(0.2), "one, own too": fk.Delayed(0.2, self_delayed=True), "pairs": fk.Delayed(late(0.0)),
    "pairs, own too": fk.Delayed(late(0.25), self_delayed=True),
}  # fmt: skip


def made(information=KINDS["one"], *, frames=81, t_end=3.0, order=2, seed=3, **parts):
    law = fk.Law(fk.Hysteresis(2.0, 0.3), [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=0.5)), fk.Consensus(0.1)])
    rng = np.random.default_rng(seed)
    start = fk.State(rng.uniform(0, 3, (N, 2)), 1.5 * rng.normal(size=(N, 2)))
    if order == 1:
        law, start = fk.Law(fk.Hysteresis(2.0, 0.3), [fk.Gradient(fk.Potential("(r - 1)**2/4"))]), fk.State(start.q)
        parts["agents"] = fk.SingleIntegrator()
    return fk.Scenario(law, start, t_end=t_end, frames=frames, information=information, **parts)


def simulated(*given, **parts):
    return fk.simulate(made(*given, **parts), progress=False)


@pytest.fixture(scope="module")
def whole():
    return simulated()


def test_known_links_at_frames_are_those_of_the_session_then(whole):
    session, differ = fk.start(made(), "delayed"), 0
    assert (whole.known_links_at(0) == session.known_links).all()
    for frame in range(1, len(whole.t)):
        session.advance(float(whole.t[frame]))
        known = whole.known_links_at(frame)
        # A step may end beyond a frame, and switch only then what the next one begins with.
        assert (known == session.known_links).all()
        differ += int((known[0] != whole.links_at(frame)).sum())
    assert differ > 20
    assert set(whole.log.uses[:, 2].tolist()) == {DELAYED}


def test_two_agents_that_part_are_neighbours_a_delay_longer():
    """They part at a speed of 2 from a distance of 1, beyond 1.8 at 0.4; each knows the other 0.1 late, itself not.

    Agent 0 rests: it knows a distance of 1 + 2 (t - 0.1), which is 1.8 at 0.5. Agent 1 moves and knows itself: 1 + 2 t.
    """
    law = fk.Law(fk.Proximity(1.8), [fk.Consensus(1e-12)])
    start = fk.State([[0.0], [1.0]], [[0.0], [2.0]])
    scenario = fk.Scenario(law, start, t_end=1.0, frames=11, information=fk.Delayed(0.1))
    run = fk.simulate(scenario, progress=False)
    assert run.log.ticks[:, 1].tolist() == [0, 1, 1, 0]
    assert run.log.ticks[2:, 0] == pytest.approx([4e8, 5e8], abs=1e3)
    assert [bool(run.known_links_at(k)[0, 0, 1]) for k in range(11)] == [k <= 5 for k in range(11)]
    assert fk.replay(run).agrees


@pytest.mark.parametrize(
    "name", [x if x in ("one", "pairs, own too") else pytest.param(x, marks=pytest.mark.slow) for x in KINDS]
)
def test_it_agrees_with_right_runs_of_any_number_of_frames(name):
    for frames, judged in ((2, 0.2), (81, 0.9)):
        run = simulated(KINDS[name], frames=frames, t_end=1.0 if KINDS[name].of_pairs else 3.0)
        found = fk.replay(run)
        assert found.agrees, str(found)
        assert found.acts == len(run.log.ticks) >= 10
        assert found.undecided < (1.0 - judged) * (found.acts + N * frames)


def test_order_1_periodic_space_obstacles_gains_and_further_graphs_agree():
    leader = fk.Velocity([1.0, 0.0])
    track = fk.Track(leader, fk.Schedule([0.5, 0.77], [1.0, 2.0, 0.5]), 0.5)
    pairs = [fk.Gradient(fk.Potential("(1 - r/R)**2", R=1.8)), fk.Consensus(1.0, over=fk.Complete())]
    led = made().with_(law=fk.Law(fk.Proximity(1.8), [*pairs, track]))
    near = fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)])
    for scenario in (made(order=1), led, made().with_(law=near, space=fk.Periodic([3.0, 3.0]))):
        found = fk.replay(fk.simulate(scenario, progress=False))
        assert found.agrees, str(found)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_random_starts_agree(seed):
    for information in KINDS.values():
        found = fk.replay(simulated(information, seed=seed))
        assert found.agrees, str(found)


def sooner(patch):
    """Agents know each other earlier than is declared."""
    new = DelayedSteps._new_delays

    def halved(self, scenario):
        return new(self, scenario.with_(information=fk.Delayed(0.5 * scenario.information.tau)))

    patch.setattr(DelayedSteps, "_new_delays", halved)


def stale(patch):
    """A link is kept that is to break."""
    switches = DelayedSteps._known_switches

    def appearing(self, segment):
        rows = switches(self, segment)
        i, j, graph = rows[:, 1:].astype(int).T
        return rows[~self.known_links[graph, i, j]]

    patch.setattr(DelayedSteps, "_known_switches", appearing)


def by_true_links(patch):
    """Links follow the true distances."""
    patch.setattr(DelayedSteps, "_known_switches", lambda self, segment: np.zeros((0, 4)))
    note = DelayedSession._note

    def true(self, seconds):
        self.known_links = self.links.copy()
        self._relink_known()
        note(self, seconds)

    patch.setattr(DelayedSession, "_note", true)


def another_law(patch):
    """Forces are not those of the law."""
    forces = DelayedLaw.forces
    patch.setattr(DelayedLaw, "forces", lambda *given: 1.0001 * forces(*given))


def wrong_name(patch):
    """The log names another neighbour than the one that is used."""
    note = DelayedSession._note

    def other(self, seconds):
        before = len(self.records.log.uses)
        note(self, seconds)
        rows = self.records.log.uses.since(0)
        rows[before:, 1] = (rows[before:, 1] + 1) % N

    patch.setattr(DelayedSession, "_note", other)


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        (sooner, "at a distance, as it knew it"), (stale, "was a neighbour under graph 0 at a distance"),
        (by_true_links, "at a distance, as it knew it"), (another_law, "its force is logged as"),
        (wrong_name, "its force is logged as|is not at a distance|another agent a delay ago"),
    ],
)  # fmt: skip
def test_broken_knowledge_is_caught(monkeypatch, broken, words):
    broken(monkeypatch)
    found = fk.replay(simulated())
    assert not found.agrees
    assert any(re.search(words, w.what) for w in found.wrong), str(found)


def test_entries_acts_and_frames_that_were_changed_are_named(whole):
    log = whole.log
    row = int(np.flatnonzero(log.ticks[:, 0] > 0)[0])
    uses = log.uses.copy()
    uses[5, 2] = -2
    ticks = log.ticks.copy()
    ticks[row:, 0] += 30_000_000
    short = dataclasses.replace(log, ticks=log.ticks[1:], forces=log.forces[1:], uses=log.uses[log.ticks[0, 2] :])
    for changed, words in (
        (dataclasses.replace(whole, log=dataclasses.replace(log, uses=uses)), r"\(entry 5\): it names something else"),
        (dataclasses.replace(whole, log=dataclasses.replace(log, ticks=ticks)), "at a distance, as it knew it"),
        (dataclasses.replace(whole, log=short), "agent 0: nothing is logged"),
    ):
        assert re.search(words, str(fk.replay(changed)))


def test_errors_of_interpolation_are_within_their_estimates():
    """A motion by SciPy whose force jumps once, at any time between two frames, and one that is smooth."""
    rng = np.random.default_rng(0)
    run = simulated(frames=31)
    t, fine = np.linspace(0.0, 3.0, 31), np.sort(rng.uniform(0.3, 2.7, 400))
    for jump in (0.0, *rng.uniform(1.0, 2.0, 5)):
        parts = []
        for begin, end in ((0.0, jump), (jump, 3.0)):
            if end > begin:
                state = parts[-1](begin) if parts else np.array([0.0, 1.0])
                push = 2.0 * (begin == jump and jump > 0.0)
                slope = lambda s, y, push=push: [y[1], -4.0 * y[0] + push]  # noqa: E731
                parts.append(solve_ivp(slope, (begin, end), state, rtol=1e-11, atol=1e-12, dense_output=True).sol)

        def true(times, parts=parts, jump=jump):
            return np.where(times < jump, parts[0](times), parts[-1](times))

        frames = true(t)
        q, p = (np.repeat(x[:, None, None], N, axis=1) * np.ones(2) for x in frames)
        found = RecordedMotion(dataclasses.replace(run, q=q, p=p)).at(fine, np.zeros(400, dtype=int))
        for value, exact, error in ((found.q, true(fine)[0], found.off_q), (found.p, true(fine)[1], found.off_p)):
            off = np.abs(value[:, 0] - exact) * np.sqrt(2.0)
            assert (off <= error + 1e-8).all()
            # The estimate is of use: where nothing jumps it is not far above the error.
            assert jump or np.median(error) < 30.0 * np.median(off) + 1e-8


def test_errors_of_interpolation_of_agents_of_order_1_are_within_their_estimates_near_frames_too():
    """Frames hold no velocities of theirs: near a frame the error grows with the time from it, not with its square."""
    run = simulated(order=1, frames=31)
    t, fine = np.linspace(0.0, 3.0, 31), np.random.default_rng(0).uniform(0.1, 2.9, 400)
    fine = np.concatenate([fine, t[1:-1] + 1e-3, t[1:-1] - 1e-3])

    def true(times):
        return np.sin(3.0 * times)[:, None, None] * np.ones((N, 2))

    recorded = RecordedMotion(dataclasses.replace(run, q=true(t), p=np.zeros((31, N, 2))))
    found = recorded.at(fine, np.zeros(len(fine), dtype=int))
    off = np.linalg.norm(found.q - true(fine)[:, 0], axis=-1)
    assert (off <= found.off_q + 1e-12).all()
    assert np.median(found.off_q) < 100.0 * np.median(off)


def test_saved_and_resumed_runs_have_the_same_log_to_the_bit(tmp_path, monkeypatch):
    scenario = made(frames=13, t_end=1.2)
    whole, session = fk.simulate(scenario, progress=False), fk.start(scenario, "delayed")
    session.advance(0.61234)
    again = session.moment()()
    again.advance(1.2)
    keep, seen = SessionWriter.commit_if_due, []

    def stopped(self):
        keep(self)
        seen.append(self)
        if len(seen) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(saving, "COMMIT_SECONDS", 0.0)
    monkeypatch.setattr(SessionWriter, "commit_if_due", stopped)
    part = fk.simulate(scenario, save=tmp_path / "run", progress=False)
    assert not part.finished
    assert fk.replay(fk.read_run(tmp_path / "run")).agrees
    monkeypatch.setattr(SessionWriter, "commit_if_due", keep)
    resumed = fk.resume(tmp_path / "run", progress=False)
    for run in (again.run(), resumed, fk.read_run(tmp_path / "run")):
        for name in ("ticks", "forces", "uses"):
            assert (getattr(run.log, name) == getattr(whole.log, name)).all()


def test_a_run_that_an_earlier_version_began_goes_on_without_a_log():
    session = fk.start(made(), "delayed")
    session.advance(1.0)
    session.records.log = None
    again = session.moment()()
    again.advance(3.0)
    run = again.run()
    assert run.log is None
    with pytest.raises(fk.InvalidInput, match=r"known_links_at.*an earlier version, which kept none, began it"):
        run.known_links_at(0)


def test_known_links_after_graphs_were_replaced():
    session = fk.start(made(), "delayed")
    session.advance(1.0)
    pair = fk.Gradient(fk.Potential("(r - 1)**2/2"))
    session.replace(law=fk.Law(fk.Proximity(1.5), [pair, fk.Consensus(0.2, over=fk.Complete())]))
    again = session.moment()()
    for each in (session, again):
        each.advance(3.0)
        run = each.run()
        known = run.known_links_at(len(run.t) - 1)
        assert known.shape == (2, N, N)
        assert (known == each.known_links).all()
        with pytest.raises(fk.InvalidInput, match="when graphs of the law were replaced"):
            run.known_links_at(10)
        with pytest.raises(UnsupportedLaw, match="changed while it went on"):
            fk.replay(run)


@pytest.mark.parametrize("frames", [2, tuple(np.linspace(1.0, 3.0, 41))], ids=["two", "late"])
def test_what_frames_do_not_show_is_left_open(frames):
    """Between two frames, or before the first one, nothing bounds where agents were: no act of that time is judged."""
    run = simulated(frames=frames)
    found = fk.replay(run)
    seconds = run.log.ticks[:, 0] * 1e-9
    dark = (seconds > 0.0) & (seconds < (3.0 if frames == 2 else 1.0))
    assert found.agrees, str(found)
    assert dark.sum() > 5
    # At the last of two frames, too, agents know each other from between them.
    assert found.undecided >= dark.sum() + (N if frames == 2 else 0)
    # What is known at the start is known exactly: of a neighbour that is left out there the distance tells.
    log = run.log
    first = int(np.flatnonzero(log.ticks[:, 2] > 0)[0])
    ticks = log.ticks.copy()
    ticks[first, 2] -= 1
    uses = np.delete(log.uses, int(log.firsts[first]), axis=0)
    short = dataclasses.replace(run, log=dataclasses.replace(log, ticks=ticks, uses=uses))
    assert "under graph 0 is not at a distance" in str(fk.replay(short))
