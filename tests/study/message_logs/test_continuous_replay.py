"""The second computation of messages under continuous control: it agrees with right runs, and names what is wrong."""

import dataclasses
import re

import numpy as np
import pytest

import flocking as fk
from flocking.engine.delayed.delayed_law import DelayedLaw
from flocking.engine.delayed.messages.instants import MessageInstants
from flocking.engine.delayed.messages.message_states import MessageStates
from flocking.engine.imperfect.messages.knowledge import NEVER, Knowledge
from flocking.errors import InvalidInput
from tests.engine.delayed.test_messages import LAW, random_world

LATE = 60_000_000
"""Nanoseconds by which a broken receiver is ahead or behind."""


def ran(scenario):
    session = fk.start(scenario, "delayed")
    session.advance(scenario.t_end)
    return session.run()


def world(t_end=0.4, **parts):
    """Three agents that hear from each other late, with losses, noise, rounding and ages."""
    rng = np.random.default_rng(3)
    start = fk.State(rng.uniform(0, 2.2, (3, 2)), 2.0 * rng.normal(size=(3, 2)))
    given = {
        "delay": 0.03, "jitter": 0.03, "loss": fk.GilbertElliott(0.2, 0.5), "noise": fk.WhiteNoise(0.02, 0.05),
        "resolution": 0.01, "expires": 0.11, "seed": 2,
    }  # fmt: skip
    information = fk.Messages(0.05, phase=[0.0, 0.01, 0.02], **(given | parts))
    return fk.Scenario(LAW, start, t_end=t_end, frames=4, information=information)


@pytest.fixture(scope="module")
def whole():
    """A run of the declared world."""
    return ran(world())


def test_it_agrees_with_right_runs(whole):
    found = fk.replay(whole)
    assert found.agrees, str(found)
    assert found.acts == len(whole.log.ticks) > 20
    assert found.undecided <= 2
    assert fk.replay(whole.until(0.3)).agrees
    other = ran(world(predict=True, self_known="measured", t_end=0.2))
    assert fk.replay(other).agrees
    assert (other.log.uses[:, 0] == -1).any()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_it_agrees_with_random_worlds(seed):
    found = fk.replay(ran(random_world(seed)[0].with_(tolerance=1e-9)))
    assert found.agrees, str(found)


@pytest.mark.slow
def test_it_knows_bodies_leaders_schedules_and_obstacles():
    track = fk.Track(fk.Velocity([1.0, 0.0]), fk.Schedule([0.2, 0.37], [1.0, 2.0, 0.5]), 0.5)
    avoid = fk.Avoid([fk.Ball([2.5, 1.0], 0.5)], range=1.0, gamma_agents=False)
    law = fk.Law(fk.Proximity(1.8), [*LAW.terms, track, avoid])
    bodies = (
        fk.Limited(fk.PointMass(damping=0.3), force=2.0), fk.Lagged(fk.PointMass(), 0.2),
        fk.Disturbed(fk.PointMass(), 0.1, 0.05),
    )  # fmt: skip
    for agents in bodies:
        run = ran(world(t_end=0.4).with_(law=law, agents=agents))
        found = fk.replay(run)
        assert found.agrees, str(found)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bodies", "m"),
    [
        (fk.Unicycle(0.2), 2), (fk.Limited(fk.PointMass(), speed=1.0), 2), (fk.Quadrotor(), 3),
        (fk.Mixture((fk.PointMass(), fk.Lagged(fk.PointMass(), 0.2)), [0, 1, 1]), 2),
        (fk.Limited(fk.SingleIntegrator(), speed=0.5), 2),
    ],
)  # fmt: skip
def test_it_integrates_every_body_again(bodies, m):
    rng = np.random.default_rng(1)
    p = 0.5 * rng.normal(size=(3, m)) if bodies.order == 2 else np.zeros((3, m))
    made = world(t_end=0.3, predict=True).with_(start=fk.State(rng.uniform(0, 2.2, (3, m)), p), agents=bodies)
    run = ran(made)
    found = fk.replay(run)
    assert found.agrees, str(found)
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)


def early(patch):
    """A message is used before it arrives."""
    arrivals = Knowledge._arrivals
    patch.setattr(Knowledge, "_arrivals", lambda *given: arrivals(*given) - LATE)


def older(patch):
    """A message is used later than it arrives."""
    arrivals = Knowledge._arrivals

    def late(*given):
        found = arrivals(*given)
        return np.where(found < NEVER, found + LATE, found)

    patch.setattr(Knowledge, "_arrivals", late)


def lost(patch):
    """A lost message is used."""
    patch.setattr(Knowledge, "_lost", lambda self, messages, sender, receiver, k: np.zeros(len(k), dtype=bool))


def forgotten_late(patch):
    """A sample is used beyond its age."""
    patch.setattr(MessageInstants, "_age", None)


def stale(patch):
    """Links that are to switch between two messages do so with the next one alone."""
    patch.setattr(MessageStates, "switches", lambda *given: np.zeros((0, 4)))


def kept(patch):
    """A link is kept that is to break at an instant."""
    relink = Knowledge.relink

    def as_before(self, known, *rules):
        before = self.links.copy()
        relink(self, known, *rules)
        self.links[:, known.agents] |= before[:, known.agents]

    patch.setattr(Knowledge, "relink", as_before)


def noise_twice(patch):
    """Noise is added twice."""
    measure = Knowledge.measure

    def twice(self, agents, *given):
        numbers = self.taken[agents]
        measure(self, agents, *given)
        self.samples.rows[numbers % len(self.samples.rows), agents, 2:] += 0.05 * self.errors[agents, 2:]

    patch.setattr(Knowledge, "measure", twice)


def another_law(patch):
    """Forces are not those of the law."""
    forces = DelayedLaw.forces
    patch.setattr(DelayedLaw, "forces", lambda *given: 1.0001 * forces(*given))


def moved_on(patch):
    """Samples are moved on though they are to be held: links do not follow, forces do."""
    states = MessageStates.states

    def moved(self, seconds, *given):
        own, known = states(self, seconds, *given)
        known = known.copy()
        known[:, :2] += 0.1 * known[:, 2:]
        return own, known

    patch.setattr(MessageStates, "states", moved)


BROKEN = [
    (early, "arrived only at|not taken yet"), (lost, "which was lost"), (forgotten_late, "nothing young enough"),
    (stale, "its link with agent . was to"), (another_law, "its force is logged as"),
]  # fmt: skip
MORE = [
    (older, "was the newest that had arrived"), (kept, "no neighbour by what it knew|nothing young enough"),
    (noise_twice, "its force is logged as"), (moved_on, "its force is logged as"),
]  # fmt: skip


@pytest.mark.parametrize(("broken", "words"), [*BROKEN, *(pytest.param(*x, marks=pytest.mark.slow) for x in MORE)])
def test_broken_message_layers_are_caught(monkeypatch, broken, words):
    broken(monkeypatch)
    run = ran(world(t_end=0.2))
    found = fk.replay(run)
    assert not found.agrees
    assert any(re.search(words, w.what) for w in found.wrong), str(found)
    # The energy ledger does not see any of it.
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)


def test_entries_that_were_changed_or_left_out_are_named(whole):
    log = whole.log
    uses = log.uses.copy()
    row = 20
    uses[row, 2] += 1
    found = fk.replay(dataclasses.replace(whole, log=dataclasses.replace(log, uses=uses)))
    act = int(np.searchsorted(log.firsts, row, side="right")) - 1
    assert row in {w.entry for w in found.wrong}
    assert found.wrong[0].time == pytest.approx(log.ticks[act, 0] * 1e-9)
    gone = int(np.flatnonzero(log.ticks[:, 0] > 0)[5])
    keep = np.arange(len(log.ticks)) != gone
    entries = np.repeat(keep, log.ticks[:, 2])
    short = dataclasses.replace(log, ticks=log.ticks[keep], forces=log.forces[keep], uses=log.uses[entries])
    found = fk.replay(dataclasses.replace(whole, log=short))
    assert any(w.agent == log.ticks[gone, 1] for w in found.wrong)


def test_a_motion_that_does_not_follow_from_the_log_is_named(whole):
    q = whole.q.copy()
    q[2, 1] += 1e-4
    found = fk.replay(dataclasses.replace(whole, q=q))
    assert any("from where the logged forces lead" in w.what and w.agent == 1 for w in found.wrong)


@pytest.mark.parametrize(("moved", "size"), [("p", 1e9), ("p", 1e300), ("q", 1e14)])
def test_large_numbers_in_a_frame_do_not_widen_what_they_are_compared_within(whole, moved, size):
    forged = {name: getattr(whole, name).copy() for name in ("q", "p")}
    forged["q"][-1, 1] += 0.1
    forged[moved][-1, 2, 1] = size
    found = fk.replay(dataclasses.replace(whole, **forged))
    assert not found.agrees
    assert found.undecided <= 2


def test_links_by_what_agents_knew_are_those_of_the_log(whole):
    session = fk.start(whole.scenario)
    session.advance(float(whole.t[2]))
    frame = 2
    there = session._states.points.there
    assert (whole.known_links_at(frame) == (session.known_links & there)).all()


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(("name", "said"), [("t", "times"), ("q", "positions"), ("p", "velocities")])
def test_numbers_that_are_not_finite_are_refused_by_name(whole, name, said, number):
    forged = getattr(whole, name).copy()
    forged[-1, ...] = number
    with pytest.raises(InvalidInput, match=f"run must have finite {said}"):
        fk.replay(dataclasses.replace(whole, **{name: forged}))
