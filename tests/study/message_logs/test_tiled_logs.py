"""The log of the tiled engine: that of `sampled`; a second computation catches broken samples, links and forces."""

import re

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver import session_writer as saving
from flocking.engine.driver.session_writer import SessionWriter
from flocking.engine.tiles.held import log_room
from flocking.engine.tiles.held.held_particles import HeldParticles
from flocking.engine.tiles.held.log_room import expected_log_bytes
from flocking.engine.tiles.held.messages import SampleStore
from flocking.engine.tiles.held.used_samples import UsedSamples
from flocking.study.departed_energy.departed import departed_causes
from tests.study.message_logs.test_replay import world

LATE = 60_000_000
"""Nanoseconds by which a broken receiver is ahead: more than a period, so that another sample is used."""

LOSS = fk.Messages(
    0.05, delay=0.03, jitter=0.02, loss=fk.Bernoulli(0.3), noise=fk.OrnsteinUhlenbeck(0.02, 0.05, 0.3),
    resolution=0.01, expires=0.22, self_known="measured", seed=2,
)  # fmt: skip


MANY = fk.start.hexagonal(2001, spacing=1.9, seed=0)


def in_tiles(scenario, **options):
    return fk.simulate(scenario, engine="tiles", step=0.005, progress=False, **options)


def same_log(one, other):
    """Whether two logs name the same acts and samples, and forces as near as rounding lets them be."""
    assert (one.ticks == other.ticks).all()
    assert (one.uses == other.uses).all()
    assert np.abs(one.forces - other.forces).max() < 1e-9


def made(**parts):
    return world(**{"information": LOSS, "control": fk.Held(np.array([0.04, 0.045, 0.05, 0.055, 0.06]), phase=0.01,
                                                           latency=0.03), **parts})  # fmt: skip


@pytest.fixture(scope="module")
def whole():
    return in_tiles(made())


def test_it_is_that_of_sampled_and_a_second_computation_agrees(whole):
    other = fk.simulate(made(), engine="sampled", progress=False)
    same_log(whole.log, other.log)
    found = fk.replay(whole)
    assert found.agrees, str(found)
    assert found.acts == len(whole.log.ticks) > 90
    assert found.entries == len(whole.log.uses) > 300
    for frame in range(len(whole.t)):
        assert (whole.known_links_at(frame) == other.known_links_at(frame)).all()
    assert len({whole.known_links_at(frame).tobytes() for frame in range(len(whole.t))}) > 3


def early(patch):
    """A message is used before it arrives."""
    news = SampleStore.news
    patch.setattr(SampleStore, "news", lambda self, now, *given: news(self, now + LATE, *given))


def older(patch):
    """Not the newest message is used."""
    news = SampleStore.news
    patch.setattr(SampleStore, "news", lambda self, now, *given: news(self, max(now - LATE, 0), *given))


def lost(patch):
    """A lost message is used."""
    news = SampleStore.news
    patch.setattr(SampleStore, "news", lambda self, *given: news(self, *given)._replace(loss=np.zeros(1)))


def forgotten_late(patch):
    """A sample is used beyond its age."""
    news = SampleStore.news

    def ageless(self, *given):
        found = news(self, *given)
        return found._replace(fresh=found.fresh + np.uint32(2), start=1)

    patch.setattr(SampleStore, "news", ageless)


def stale(patch):
    """A link is kept that is to break."""
    act = HeldParticles.act

    def kept(self, *given):
        limits = self.radii.limits[0]
        self.radii.limits[0] = limits * np.where(np.arange(len(limits)) == np.argmax(limits), 1.3, 1.0)
        act(self, *given)
        self.radii.limits[0] = limits

    patch.setattr(HeldParticles, "act", kept)


def noise_twice(patch):
    """Noise is added twice."""
    taken = SampleStore._taken

    def twice(self, taking):
        return taken(self, taking._replace(sizes=taking.sizes * np.array([2.0, 2.0, 1.0, 1.0])))

    patch.setattr(SampleStore, "_taken", twice)


def limited_before(patch):
    """What the body can do limits forces before they are held, and so what is logged."""
    act = HeldParticles.act

    def clipped(self, *given):
        act(self, *given)
        np.clip(self.desired, -0.7, 0.7, out=self.desired)

    patch.setattr(HeldParticles, "act", clipped)


def wrong_number(patch):
    """The kernel uses one sample and the log names the one before."""
    used = UsedSamples.entries

    def shifted(self, *given):
        counts, uses = used(self, *given)
        return counts, np.where((uses[:, :1] == 0) & (uses[:, 2:] > 3) & (np.arange(3) == 2), uses - 1, uses)

    patch.setattr(UsedSamples, "entries", shifted)


def another_neighbour(patch):
    """The kernel uses one neighbour and the log does not name it."""
    used = UsedSamples.entries

    def fewer(self, agents, *given):
        counts, uses = used(self, agents, *given)
        last = np.cumsum(counts)[counts > 1] - 1
        return counts - (counts > 1), np.delete(uses, last, axis=0)

    patch.setattr(UsedSamples, "entries", fewer)


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        (early, "arrived only at|not taken yet"), (older, "was the newest that had arrived"), (lost, "which was lost"),
        (forgotten_late, "nothing young enough"), (stale, "no neighbour by what it knew"),
        (noise_twice, "its force is logged as"), (limited_before, "its force is logged as"),
        (wrong_number, "was the newest that had arrived"), (another_neighbour, "nothing of it was used"),
    ],
)  # fmt: skip
def test_broken_message_layers_are_caught(monkeypatch, broken, words):
    broken(monkeypatch)
    agents = fk.Limited(fk.PointMass(), force=1.0) if broken is limited_before else fk.PointMass()
    run = in_tiles(made().with_(agents=agents))
    found = fk.replay(run)
    assert not found.agrees
    assert any(re.search(words, w.what) for w in found.wrong), str(found)
    # The energy ledger sees none of them.
    assert np.abs(run.residual).max() <= run.fidelity.ledger.size * max(1.0, run.turnover)


BODIES = {
    "limited": fk.Limited(fk.PointMass(), force=1.0),
    "lagged": fk.Lagged(fk.PointMass(), 0.1),
    "gusts": fk.Disturbed(fk.PointMass(), 0.3, 0.1),
    "unicycle": fk.Unicycle(0.2),
    "order 1": fk.SingleIntegrator(),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BODIES)
def test_bodies_have_the_log_of_sampled(name):
    start = world().start
    if name == "order 1":
        start = fk.State(start.q)
    scenario = made().with_(agents=BODIES[name], start=start)
    run = in_tiles(scenario)
    same_log(run.log, fk.simulate(scenario, engine="sampled", progress=False).log)
    found = fk.replay(run)
    assert found.agrees, str(found)


@pytest.mark.slow
@pytest.mark.parametrize("information", [fk.Instant(), LOSS], ids=["instant", "messages"])
def test_graphs_without_forces_tiles_of_one_list_and_space_that_repeats(information):
    """Two graphs in three tiles: nothing acts over the first, all tiles share the list of the second."""
    law = fk.Law(fk.Hysteresis(1.8, 0.3), [fk.CuckerSmale(1.0, 0.5, over=fk.Complete())])
    near = fk.Law(fk.Hysteresis(1.8, 0.3), [fk.Consensus(1.0), fk.Gradient(fk.Potential("(r - 1)**2"))])
    start = fk.start.box(40, side=6, speed=1, seed=3)
    for made_of, space in ((law, fk.Open()), (near, fk.Periodic([6.0, 7.0]))):
        scenario = fk.Scenario(
            made_of, start, t_end=0.5, frames=3, control=fk.Held(0.05), information=information, space=space
        )
        run = in_tiles(scenario)
        same_log(run.log, fk.simulate(scenario, engine="sampled", progress=False).log)
        assert (run.log.uses[:, 0] == 0).sum() > 300
        found = fk.replay(run)
        assert found.agrees, str(found)


@pytest.mark.slow
def test_leaders_that_send_messages_are_logged():
    track = fk.Track(fk.Velocity([1.0, 0.0]), 0.0, 0.5)
    law = fk.Law(fk.Proximity(1.8), [fk.Consensus(1.0), track])
    told = fk.Messages(0.05, delay=0.03, jitter=0.04, leader=True, self_known="measured", predict=True)
    scenario = made(information=told).with_(law=law)
    run = in_tiles(scenario)
    same_log(run.log, fk.simulate(scenario, engine="sampled", progress=False).log)
    assert (run.log.uses[:, 0] == -2).sum() == len(run.log.ticks)
    assert fk.replay(run).agrees


def test_what_departed_is_split_as_that_of_sampled(whole):
    """Links are followed at steps, and the ledger, of which hold is the rest, is one of steps; others are equal."""
    found = departed_causes(whole)
    other = departed_causes(fk.simulate(made(), engine="sampled", progress=False))
    largest = max(np.abs(x).max() for x in other.causes.values())
    for name, share in found.causes.items():
        bound = {"links": 2e-3, "hold": 1e-2}.get(name, 1e-9)
        assert abs(share[-1] - other.causes[name][-1]) < bound * largest, name
    assert np.abs(found.causes["links"]).max() > 0.05 * largest
    assert np.allclose(sum(found.causes.values()), found.total)


def test_the_motion_does_not_depend_on_whether_there_is_a_log(whole):
    without = in_tiles(made(), log=False)
    assert without.log is None
    for name in ("q", "p", "links", "trace"):
        assert (getattr(without, name) == getattr(whole, name)).all()
    with pytest.raises(fk.InvalidInput, match=r"replay.*must have a log.*This run keeps none: log=False"):
        fk.replay(without)
    with pytest.raises(fk.InvalidInput, match=r"known_links_at.*This run keeps none: log=False"):
        without.known_links_at(0)


def test_saved_and_resumed_runs_have_the_same_log_to_the_bit(whole, tmp_path, monkeypatch):
    session = fk.start(made(), "tiles", step=0.005)
    session.advance(0.4321)
    session.run()
    again = session.moment()()
    again.advance(1.0)
    cut = again.run()
    keep, seen = SessionWriter.commit_if_due, []

    def stopped(self):
        keep(self)
        seen.append(self)
        if len(seen) == 8:
            raise KeyboardInterrupt

    monkeypatch.setattr(saving, "COMMIT_SECONDS", 0.0)
    monkeypatch.setattr(SessionWriter, "commit_if_due", stopped)
    part = in_tiles(made().with_(frames=41), save=tmp_path / "run")
    assert not part.finished
    assert 0 < len(part.log.ticks) < len(whole.log.ticks)
    assert fk.replay(fk.read_run(tmp_path / "run")).agrees
    monkeypatch.setattr(SessionWriter, "commit_if_due", keep)
    resumed = fk.resume(tmp_path / "run", progress=False)
    for run in (cut, resumed, fk.read_run(tmp_path / "run")):
        for name in ("ticks", "forces", "uses"):
            assert (getattr(run.log, name) == getattr(whole.log, name)).all()


def test_the_expected_size_is_that_of_a_log_whose_links_stay():
    """Agents on a line a unit apart with a common velocity, each linked with those within 2.5, or with all."""
    start = fk.State(np.stack([np.arange(300.0), np.zeros(300)], axis=1))
    for graph, apart in ((fk.Proximity(2.5), 4), (fk.Complete(), 299)):
        law = fk.Law(graph, [fk.Consensus(1.0)])
        scenario = fk.Scenario(law, start, t_end=0.5, control=fk.Held(0.1, phase=0.05))
        assert expected_log_bytes(scenario) == pytest.approx(300 * 5 * (3 + 2 + 3 * apart) * 8, rel=0.02)


def test_a_log_that_outgrows_its_memory_stops_the_run_in_words(monkeypatch):
    session = fk.start(made(), "tiles", step=0.005)
    monkeypatch.setattr(log_room, "MOST_LOG_BYTES", 5000)
    with pytest.raises(fk.SimulationError, match=r"The log of what agents used takes more than .* give log=False"):
        session.advance(1.0)


@pytest.mark.parametrize(
    ("options", "scenario", "said"),
    [
        ({"log": 1}, made(), "must be True or False, or left out"),
        ({"log": True, "precision": "float32"}, made(), "precision='float32'"),
        ({"log": True}, made().with_(control=fk.Continuous(), information=fk.Instant()), "under continuous control"),
        ({"log": True}, made(control=fk.Held(0.05)).with_(start=MANY), "2,001 agents"),
        ({"log": True}, made().with_(t_end=4e7), "at most 8 GiB of memory.*by the neighbours at the start"),
    ],
)  # fmt: skip
def test_logs_that_cannot_be_kept_are_refused_in_words(options, scenario, said):
    with pytest.raises(fk.InvalidInput, match=f"TilesOptions.*log.*{said}"):
        fk.start(scenario, "tiles", step=0.005, **options)


@pytest.mark.parametrize(
    ("options", "changes", "said"),
    [
        ({"precision": "float32"}, {}, "precision='float32'"),
        ({}, {"t_end": 3e6}, r"GiB by the neighbours at the start; log=True keeps it"),
    ],
)
def test_runs_that_keep_none_unasked_state_why(options, changes, said):
    run = fk.start(made().with_(**changes), "tiles", step=0.005, ledger=False, **options).run()
    assert run.log is None
    assert re.search(said, run.provenance["no log because"])
