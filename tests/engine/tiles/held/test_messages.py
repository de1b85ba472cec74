"""Messages in the tiled engine: the same draws, messages, links and motion as the engine `sampled` and a plain one."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.registry import chosen_engine
from flocking.engine.sampled.engine import ENGINE as SAMPLED
from flocking.engine.sampled.session import SampledOptions
from flocking.engine.tiles.engine import ENGINE
from flocking.engine.tiles.held.past_speeds import Speeds
from flocking.engine.tiles.kernels.heard_samples import BAD, BEST, KNOWN
from flocking.engine.tiles.neighbours.neighbour_lists import LINKED, NUMBER, WIDTH
from flocking.engine.tiles.options import TilesOptions
from flocking.engine.tiles.simd.counter_random import open_unit, philox_words
from flocking.engine.tiles.simd.vectors import load, store
from flocking.errors import InvalidInput
from flocking.formula.native.functions import native
from flocking.model.world.random_numbers import Purpose, philox, uniform
from tests.engine.sampled.plain_world import PlainWorld

STEP = 0.01
PSI = fk.Potential("(r - 2)**2")


@native
def _drawn(k, purpose, i, j, key, key2, words, units):  # type: ignore[no-untyped-def]
    a, b, c, d = philox_words(load(k, 0), np.uint64(purpose), load(i, 0), load(j, 0), np.uint64(key), np.uint64(key2))
    store(words[0], 0, a)
    store(words[1], 0, b)
    store(words[2], 0, c)
    store(words[3], 0, d)
    store(units, 0, open_unit(a, b))


def test_draws_are_those_of_the_world_bit_for_bit():
    rng = np.random.default_rng(0)
    k, i, j = rng.integers(0, 2**32, (3, 16), dtype=np.uint64)
    seed = 2**62 + 12345
    words, units = np.zeros((4, 16), np.uint64), np.zeros(16)
    purpose = np.uint64(int(Purpose.LOSS) << 24)
    _drawn(k, int(purpose), i, j, seed & 0xFFFFFFFF, seed >> 32, words, units)
    assert (words == np.array(philox((k, purpose, i, j), (seed & 0xFFFFFFFF, seed >> 32)))).all()
    assert (units == uniform(seed, Purpose.LOSS, i, j, k)).all()


def used_by(session, n):
    """Newest sample that each agent has of each other, -1 for the start, -2 if not listed; and known links."""
    particles = session._particles
    lists, ids = particles.known[0], particles.ids
    found = np.full((n, n), -2)
    links = np.zeros((n, n), dtype=bool)
    heard = (particles.used[0] & np.uint32(BEST)).reshape(-1, WIDTH)
    for tile in range(particles.tiles):
        for row in range(lists.first[tile], lists.first[tile] + lists.count[tile]):
            for lane in range(WIDTH):
                i, entry = tile * WIDTH + lane, lists.rows[row, lane]
                j = int(entry & NUMBER)
                if i >= n or i == j:
                    continue
                a, b = ids[i], ids[j]
                found[a, b] = int(heard[row, lane]) - 1 if heard.size else -1
                links[a, b] = entry & LINKED
    return found, links


def random_world(seed, space=None):
    """A scenario with random imperfections at whole steps, and its plain second implementation."""
    rng = np.random.default_rng(seed)
    # Multiples of the resolution never differ by a radius: 200.3^2 and 170.3^2 are no whole numbers.
    n, radius, gap, stiff = int(rng.integers(3, 20)), 2.003, 0.3, 1.5
    law = fk.Law(fk.Hysteresis(radius, gap), [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=stiff)), fk.Consensus(0.8)])
    start = fk.State(rng.uniform(0, 4, (n, 2)), rng.normal(size=(n, 2)))

    def maybe(value, otherwise):
        return value if rng.random() < 0.6 else otherwise

    losses = [fk.Bernoulli(0.3), fk.Bernoulli(0.4, paired=True), fk.GilbertElliott(0.3, 0.5, 0.05, 0.9),
              fk.GilbertElliott(0.9, 0.8, 0.1, 0.9, paired=True), fk.DistanceLoss(2.0), None]  # fmt: skip
    noises = [fk.WhiteNoise(0.02, 0.05), fk.OrnsteinUhlenbeck(0.05, 0.02, 0.3), None]
    steps = lambda low, high, size=None: STEP * rng.integers(low, high, size)  # noqa: E731
    loss = losses[rng.integers(len(losses))]
    alike = isinstance(loss, fk.DistanceLoss)
    information = fk.Messages(
        maybe(0.1, 0.05 if alike else steps(3, 12, n)), phase=maybe(0.0, 0.02 if alike else steps(0, 5, n)),
        delay=maybe(0.0, float(rng.choice([0.023, 0.1]))), jitter=maybe(0.0, 0.07),
        loss=loss, noise=noises[rng.integers(len(noises))],
        resolution=maybe(0.0, 0.01), velocity_resolution=maybe(0.0, 0.01),
        expires=float(rng.choice([0.2, 0.35])) if loss is not None else maybe(None, 0.2),
        predict=bool(rng.random() < 0.5), self_known=str(rng.choice(["true", "measured"])), seed=seed,
    )  # fmt: skip
    control = fk.Held(
        maybe(0.1, steps(3, 12, n)),
        phase=maybe(0.0, steps(0, 5, n)),
        latency=maybe(0.0, float(rng.choice([0.03, 0.13]))),
    )
    scenario = fk.Scenario(
        law, start, t_end=2.0, frames=5, information=information, control=control,
        agents=fk.Agents(masses=maybe(1.0, rng.uniform(0.5, 2.0, n))), space=space or fk.Open(),
    )  # fmt: skip
    return scenario, PlainWorld(scenario, lambda r: stiff * (r - 1), 0.8, radius - gap, radius)


def check(seed, space=None):
    """The engine, `sampled` and the plain implementation agree on motion, messages and links."""
    scenario, plain = random_world(seed, space)
    session = ENGINE.open(scenario, TilesOptions(step=STEP))
    other = SAMPLED.open(scenario, SampledOptions())
    plain.run(scenario.t_end)
    for each in (session, other):
        each.advance(scenario.t_end)
    run, exact = session.run(), other.run()
    assert np.abs(run.q - exact.q).max() < 1e-9
    assert np.abs(run.p - exact.p).max() < 1e-9
    assert np.abs(run.q[-1] - plain.q).max() < 1e-9
    assert (run.log.ticks == exact.log.ticks).all()
    assert (run.log.uses == exact.log.uses).all()
    used, links = used_by(session, run.n)
    assert (links == other.known_links[0]).all()
    assert (links == np.array(plain.links)).all()
    listed = used > -2
    assert listed[links].all()
    if session._particles.used[0].size:
        # An agent's entries are renewed when others of its tile act: then it has what it will use when it acts.
        # Lists that were built after the last tick have not been searched.
        listed &= used >= 0
        newest, info = np.array(plain.used), scenario.information
        schedule = info.schedule(run.n)
        if info.expires is not None:
            # The search stops at samples that have expired.
            listed &= (
                np.where(newest < 0, 0, schedule.phase + newest * schedule.period) * 1e-9 > run.t[-1] - info.expires
            )
        assert (used[listed] >= newest[listed]).all()
        if not np.ndim(scenario.control.period) and not np.ndim(scenario.control.phase):
            assert (used[listed] == newest[listed]).all()
    return run


def test_a_random_world():
    check(0)


@pytest.mark.slow
@pytest.mark.parametrize("space", [None, fk.Periodic([5.0, 6.0])], ids=["open", "periodic"])
@pytest.mark.parametrize("seed", range(1, 102))
def test_many_random_worlds(seed, space):
    check(seed, space)


CHANNELS = [
    fk.GilbertElliott(0.2, 0.5), fk.GilbertElliott(0.7, 0.6), fk.GilbertElliott(1.0, 1.0),
    fk.GilbertElliott(0.1, 0.2, 0.1, 0.8), fk.GilbertElliott(0.3, 0.5, paired=True), fk.DistanceLoss(2.5),
    fk.DistanceLoss(2.5, exponent=3.0, floor=0.1), fk.Bernoulli(0.3),
]  # fmt: skip
"""Channels that redraw or keep their state, flip it, leave it each time; losses of other forms."""


@pytest.mark.parametrize("loss", CHANNELS, ids=lambda loss: f"{type(loss).__name__} {loss.summary}")
@pytest.mark.parametrize("period", [0.1, 0.2, 0.05])
def test_what_is_kept_of_losses_changes_nothing(loss, period):
    """Of one, two and half a sample for each act: the messages used, and the motion, are those of `sampled`."""
    law = fk.Law(fk.Hysteresis(2.5, gap=0.3), [fk.Gradient(PSI), fk.Consensus(0.5)])
    start = fk.start.box(30, side=7, speed=1.0, seed=2)
    information = fk.Messages(0.1, loss=loss, expires=0.5, seed=9)
    made = fk.Scenario(law, start, t_end=2.31, frames=4, control=fk.Held(period), information=information)
    session = ENGINE.open(made, TilesOptions(step=STEP, ledger=False))
    other = SAMPLED.open(made, SampledOptions())
    kept = seen = 0
    for t in (0.41, 0.61, 0.81, 1.01, 1.37, 1.61, 1.81, 2.01, made.t_end):
        session.advance(t)
        other.advance(t)
        assert np.abs(session.state.q - other.state.q).max() < 1e-10
        used, links = used_by(session, 30)
        assert (links == other.known_links[0]).all()
        newest = other.knowledge.newest
        young = np.where(newest < 0, 0, newest) * 0.1 > t - 0.5
        listed = (used > 0) & young
        assert (used[listed] == newest[listed]).all()
        seen += int(listed.sum())
        flags = session._particles.used[0]
        kept += int((flags & np.uint32(KNOWN) > 0).sum())
        assert not (flags & np.uint32(BAD) > 0)[flags & np.uint32(KNOWN) == 0].any()
    # Lists that were built since the last tick have nothing beside their entries.
    assert seen > 500
    assert (kept > 0) == isinstance(loss, fk.GilbertElliott)


@pytest.mark.parametrize("loss", [None, fk.Bernoulli(0.3), fk.GilbertElliott(0.2, 0.5), fk.DistanceLoss(2.5)])
@pytest.mark.parametrize(("jitter", "tick"), [(0.07, 0.05), (0.12, 0.1), (0.23, 0.1)])
def test_late_messages_are_looked_for_until_even_the_latest_would_be_there(loss, jitter, tick):
    """The messages used, links and motion are those of `sampled`, within a period and over two of them.

    At every other of the more frequent ticks one sample is new, whose message may be there or not.
    """
    law = fk.Law(fk.Hysteresis(2.5, gap=0.3), [fk.Gradient(PSI), fk.Consensus(0.5)])
    information = fk.Messages(0.1, delay=0.02, jitter=jitter, loss=loss, expires=0.6, seed=9)
    made = fk.Scenario(
        law, fk.start.box(30, side=7, speed=1.0, seed=2), t_end=1.61, frames=2, control=fk.Held(tick),
        information=information,
    )  # fmt: skip
    session, other = ENGINE.open(made, TilesOptions(step=STEP, ledger=False)), SAMPLED.open(made, SampledOptions())
    late = seen = 0
    for t in np.arange(0.51 - tick, 1.6, 0.1):
        session.advance(t)
        other.advance(t)
        assert np.abs(session.state.q - other.state.q).max() < 1e-10
        used, links = used_by(session, 30)
        assert (links == other.known_links[0]).all()
        newest = other.knowledge.newest
        listed = (used > 0) & (np.where(newest < 0, 0, newest) * 0.1 > t - 0.6)
        assert (used[listed] == newest[listed]).all()
        late += int((used[listed] < used.max()).sum())
        seen += int(listed.sum())
    assert seen > 500
    assert late > 100


@pytest.mark.parametrize("loss", CHANNELS[:5], ids=lambda loss: loss.summary)
def test_a_sample_that_had_expired_before_anybody_looked_leaves_the_state_of_its_channel_open(loss):
    """At some ticks the newest sample is too old to be looked at; the state of a channel is then not that before it."""
    law = fk.Law(fk.Hysteresis(2.5, gap=0.3), [fk.Gradient(PSI), fk.Consensus(0.5)])
    information = fk.Messages(0.1, delay=0.04, loss=loss, expires=0.08, seed=9)
    start = fk.start.box(30, side=7, speed=1.0, seed=2)
    made = fk.Scenario(law, start, t_end=8.0, frames=9, control=fk.Held(0.07), information=information)
    run = fk.simulate(made, engine="tiles", step=STEP, ledger=False, progress=False)
    exact = fk.simulate(made, engine="sampled", progress=False)
    assert np.abs(run.q - exact.q).max() < 1e-9
    assert (run.log.ticks == exact.log.ticks).all()
    assert (run.log.uses == exact.log.uses).all()
    heard = exact.log.uses[:, 2] > 0
    assert heard.sum() > 900
    acts_without = (exact.log.ticks[:, 2] == 0).mean()
    assert 0.3 < acts_without < 0.9


def large_world(**changes):
    start = fk.start.hexagonal(2200, spacing=1.9, noise=0.2, speed=1.0, seed=1)
    law = fk.Law(fk.Hysteresis(2.5, gap=0.5), [fk.Gradient(PSI), fk.Consensus(1.0)])
    world = {
        "delay": 0.03, "jitter": 0.05, "loss": fk.GilbertElliott(0.1, 0.4), "expires": 0.3,
        "noise": fk.OrnsteinUhlenbeck(0.01, 0.01, 0.5), "resolution": 0.001, "predict": True, "seed": 5,
    } | changes  # fmt: skip
    return fk.Scenario(law, start, t_end=0.6, frames=4, control=fk.Held(0.1), information=fk.Messages(0.05, **world))


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_pieces_threads_and_resuming_give_the_same_bits(precision):
    world = large_world()
    whole = fk.simulate(world, engine="tiles", step=STEP, threads=1, precision=precision, progress=False)
    session = ENGINE.open(world, TilesOptions(step=STEP, threads=2, precision=precision))
    session.advance(0.123)
    session.advance(0.3)
    again = session.moment()()
    again.advance(0.6)
    cut = again.run()
    assert (cut.q == whole.q).all()
    assert (cut.p == whole.p).all()
    assert (cut.trace == whole.trace).all()
    assert again._particles.search.rebuilds > 2
    if precision == "float32":
        fine = fk.simulate(world, engine="tiles", step=STEP, progress=False)
        assert np.abs(fine.q[1] - whole.q[1]).max() < 1e-3


def test_single_precision_stays_near():
    quiet = large_world(loss=None, noise=None, resolution=0.0, jitter=0.0)
    runs = [fk.simulate(quiet, engine="tiles", step=STEP, precision=x, progress=False) for x in ("float64", "float32")]
    assert np.median(np.abs(runs[0].q[-1] - runs[1].q[-1])) < 1e-4


@pytest.mark.parametrize(("changes", "said"), [
    ({"loss": 0.2}, "expires must be given"),
    ({"loss": fk.DistanceLoss(2.0), "expires": 0.3, "phase": 0.01 * (np.arange(2200) % 5)}, "must be that of all"),
    ({"loss": 0.2, "expires": 1e6}, "few enough samples"),
])  # fmt: skip
def test_messages_that_need_more_memory_are_refused_by_name(changes, said):
    world = large_world(**({"loss": None, "expires": None} | changes))
    with pytest.raises(InvalidInput, match=f"Messages.*{said}"):
        ENGINE.open(world, TilesOptions(step=STEP))


def test_more_samples_than_kernels_number_are_refused():
    made = large_world().with_(information=fk.Messages(1e-6, expires=1e-5), control=fk.Held(1e-6), t_end=1073.0)
    ENGINE.check(made)
    with pytest.raises(InvalidInput, match=r"fewer than 1,073,741,824 samples until t_end"):
        ENGINE.check(made.with_(t_end=1074.0))


def test_large_groups_with_messages_choose_it():
    assert chosen_engine(large_world(), "auto") == "tiles"


def test_lists_are_built_anew_before_anybody_is_missed():
    """Speeds that grow after the lists were built: the width that was enough then is not."""
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(PSI), fk.Track(fk.Velocity([30.0, 0.0]), 0.0, 2.0)])
    start = fk.start.box(60, side=10, speed=0.1, seed=2)
    world = {"control": fk.Held(0.1), "information": fk.Messages(0.1, delay=0.3)}
    scenario = fk.Scenario(law, start, t_end=2.0, frames=5, **world)
    exact = fk.simulate(scenario, engine="sampled", progress=False)
    run = fk.simulate(scenario, engine="tiles", step=0.01, progress=False)
    assert np.abs(run.q - exact.q).max() < 1e-9


def test_speeds_of_the_past_bound_what_samples_are_off():
    speeds = Speeds()
    still, moving = np.zeros(2), np.array([3.0, 4.0])
    for now, frame, top in ((0, still, 2.0), (10, still, 1.0), (20, moving, 0.5)):
        speeds.add(now, frame, top, now - 15)
    assert speeds.bound(predict=False) == 5.5
    assert speeds.bound(predict=True) == 2.0 * 1.0 + 2.0 * 5.0
    speeds.add(40, moving, 0.25, 25)
    assert speeds.bound(predict=False) == 5.25


@pytest.mark.parametrize("late", [{"jitter": 0.07}, {"loss": fk.Bernoulli(0.5), "expires": 0.3}], ids=["late", "lost"])
def test_agents_of_every_tile_hear_for_themselves_where_all_are_linked(late):
    """All tiles share the list of a complete graph: 40 agents are in three of them."""
    law = fk.Law(fk.Complete(), [fk.CuckerSmale(1.0, 0.5)])
    start = fk.start.box(40, side=10, speed=1, seed=3)
    world = {"control": fk.Held(0.05), "information": fk.Messages(0.05, delay=0.013, seed=5, **late)}
    made = fk.Scenario(law, start, t_end=0.8, frames=3, **world)
    run, other = (fk.simulate(made, engine=engine, progress=False) for engine in ("tiles", "sampled"))
    assert (run.log.uses == other.log.uses).all()
    assert max(np.abs(run.q - other.q).max(), np.abs(run.p - other.p).max()) < 1e-9


def test_a_long_time_of_expiry_changes_nothing_that_is_likely():
    """Losses without expiry, in the other engine, against samples that are kept for twenty periods: 0.2**20 a tick."""
    law = fk.Law(fk.Proximity(2.5), [fk.Gradient(PSI), fk.Consensus(1.0)])
    start = fk.start.box(40, side=8, speed=1, seed=3)
    runs = []
    for engine, expires in (("sampled", None), ("tiles", 2.0)):
        told = fk.Messages(0.1, delay=0.02, loss=0.2, expires=expires, seed=5)
        held = fk.Scenario(law, start, t_end=3.0, frames=5, control=fk.Held(0.1), information=told)
        runs.append(fk.simulate(held, engine=engine, progress=False))
    assert np.abs(runs[0].q - runs[1].q).max() < 1e-9
    assert (runs[0].links == runs[1].links).all()


def test_agents_that_act_at_every_step_have_narrower_lists_and_the_same_motion():
    """Where every step draws for every pair the skin that is chosen is narrower; motion is that of a given one."""
    law = fk.Law(fk.Proximity(2.5), [fk.Gradient(PSI), fk.Consensus(0.5)])
    start = fk.start.hexagonal(600, spacing=2.0, noise=0.2, speed=1.0, seed=2)

    def session(period, **options):
        information = fk.Messages(period, loss=fk.Bernoulli(0.3), expires=5 * period, seed=9)
        made = fk.Scenario(law, start, t_end=0.3, frames=2, control=fk.Held(period), information=information)
        return ENGINE.open(made, TilesOptions(step=STEP, **options))

    often, seldom = session(STEP), session(10 * STEP, ledger_at="ticks")
    given = session(STEP, skin=0.9)
    for each in (often, seldom, given):
        each.advance(0.3)
    assert often._particles.displacement.skin < 0.8 * seldom._particles.displacement.skin
    assert np.abs(often.state.q - given.state.q).max() < 1e-11
