"""Random worlds against a second implementation, which shares no code with the engine but the random numbers."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.sampled.session import SampledSession
from tests.engine.sampled.plain_world import PlainWorld


def random_world(seed, space=None, *, limited=False, late=False):
    """A scenario with random imperfections, and its second implementation; ``late`` gives each agent its latency."""
    rng = np.random.default_rng(seed)
    n, radius, gap = int(rng.integers(3, 8)), 2.0, 0.3
    stiff = 1.5
    law = fk.Law(fk.Hysteresis(radius, gap), [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=stiff)), fk.Consensus(0.8)])
    start = fk.State(rng.uniform(0, 3, (n, 2)), rng.normal(size=(n, 2)))

    def maybe(value, otherwise):
        return value if rng.random() < 0.6 else otherwise

    losses = [fk.Bernoulli(0.3), fk.Bernoulli(0.4, paired=True), fk.GilbertElliott(0.3, 0.5, 0.05, 0.9),
              fk.DistanceLoss(2.0), None]  # fmt: skip
    noises = [fk.WhiteNoise(0.02, 0.05), fk.OrnsteinUhlenbeck(0.05, 0.02, 0.3), None]
    step = float(rng.choice([0.05, 0.1]))
    information = fk.Messages(
        maybe(step, rng.uniform(0.03, 0.12, n)), phase=maybe(0.0, rng.uniform(0, 0.05, n)),
        delay=maybe(0.0, float(rng.choice([0.02, 0.1]))), jitter=maybe(0.0, 0.07),
        loss=losses[rng.integers(len(losses))], noise=noises[rng.integers(len(noises))],
        resolution=maybe(0.0, 0.01), velocity_resolution=maybe(0.0, 0.01), expires=maybe(None, 0.2),
        predict=bool(rng.random() < 0.5), self_known=str(rng.choice(["true", "measured"])), seed=seed,
    )  # fmt: skip
    control = fk.Held(
        maybe(step, rng.uniform(0.03, 0.12, n)), phase=maybe(0.0, rng.uniform(0, 0.05, n)),
        latency=maybe(0.0, float(rng.choice([0.03, 0.13]))),
    )  # fmt: skip
    if late:
        # Several agents have none, and forces of different ticks begin together.
        latency = step * rng.integers(0, 4, n) if rng.random() < 0.6 else rng.uniform(0.0, 0.2, n)
        control = fk.Held(control.period, phase=control.phase, latency=latency)
    scenario = fk.Scenario(
        law, start, t_end=2.0, frames=5, information=information, control=control,
        agents=fk.Agents(masses=maybe(1.0, rng.uniform(0.5, 2.0, n))), space=space or fk.Open(),
    )  # fmt: skip
    if limited:
        scenario = scenario.with_(agents=fk.Limited(scenario.agents, force=rng.uniform(0.1, 1.0, n)))
    return scenario, PlainWorld(scenario, lambda r: stiff * (r - 1), 0.8, radius - gap, radius)


def check(seed, space=None, *, limited=False, late=False):
    """The engine and the second implementation agree; the run, and that implementation."""
    scenario, plain = random_world(seed, space, limited=limited, late=late)
    session = fk.start(scenario)
    session.advance(scenario.t_end)
    plain.run(scenario.t_end)
    run = session.run()
    assert np.abs(run.q[-1] - plain.q).max() < 1e-9
    assert np.abs(run.p[-1] - plain.p).max() < 1e-9
    assert (session.known_links[0] == plain.links).all()
    others = ~np.eye(run.n, dtype=bool)
    assert (session.knowledge.newest[others] == np.array(plain.used)[others]).all()
    assert np.abs(run.residual).max() <= 1e-11 * max(1.0, run.turnover) + run.fidelity.ledger.size
    return run, plain


@pytest.mark.parametrize("seed", range(12))
def test_random_worlds(seed):
    check(seed)


@pytest.mark.parametrize(
    "seed", [*range(300, 306), *(pytest.param(k, marks=pytest.mark.slow) for k in range(306, 346))]
)
def test_random_worlds_in_which_each_agent_has_its_latency(seed):
    check(seed, limited=seed % 2 == 1, late=True)


@pytest.mark.parametrize(
    "seed", [200, pytest.param(201, marks=pytest.mark.slow), pytest.param(203, marks=pytest.mark.slow)]
)
def test_random_worlds_of_limited_bodies(seed):
    run, plain = check(seed, limited=True)
    # The limit acted somewhere and not everywhere.
    sizes = np.linalg.norm(run.log.forces, axis=1) > np.array(plain.most)[run.log.ticks[:, 1]]
    assert 0 < sizes.sum() < len(sizes)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12, 112))
def test_100_more_random_worlds(seed):
    check(seed)


def world_of_ties(seed):
    """A scenario at the edges of its range whose times are multiples of 0.05, so that much falls on one instant."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))

    def one_of(*values):
        return values[rng.integers(len(values))]

    def time(low, high):
        return 0.05 * float(rng.integers(low, high + 1))

    def each(low, high):
        return time(low, high) if rng.random() < 0.5 else 0.05 * rng.integers(low, high + 1, n)

    law = fk.Law(fk.Hysteresis(2.0, 0.3), [fk.Gradient(fk.Potential("1.5*(r - 1)**2/2")), fk.Consensus(0.8)])
    start = fk.State(rng.uniform(0, 3, (n, 2)), rng.normal(size=(n, 2)), one_of(0.0, 1.7, -3.3))
    losses = (None, 0.0, 1.0, 0.5, fk.GilbertElliott(1.0, 1.0), fk.GilbertElliott(0.9, 0.8, 0.2, 1.0, True),
              fk.DistanceLoss(1.5, paired=True))  # fmt: skip
    information = fk.Messages(
        each(1, 4), phase=each(0, 3), delay=time(0, 6), jitter=one_of(0.0, time(1, 8)), loss=one_of(*losses),
        noise=one_of(None, fk.OrnsteinUhlenbeck(0.05, 0.02, 0.3)), resolution=one_of(0.0, 0.25),
        expires=one_of(None, time(1, 6)), predict=bool(rng.random() < 0.5),
        self_known=str(one_of("true", "measured")), seed=seed,
    )  # fmt: skip
    control = fk.Held(each(1, 5), phase=each(0, 4), latency=each(0, 6))
    t_end = start.t + one_of(1.0, 1.03, 0.97)
    return fk.Scenario(law, start, t_end=t_end, frames=3, information=information, control=control)


@pytest.mark.parametrize("in_blocks", [True, False])
def test_worlds_of_ties_in_which_messages_overtake_are_lost_or_expire_on_their_way(monkeypatch, in_blocks):
    monkeypatch.setattr(SampledSession, "in_blocks", in_blocks)
    for seed in range(30):
        scenario = world_of_ties(seed)
        plain = PlainWorld(scenario, lambda r: 1.5 * (r - 1), 0.8, 1.7, 2.0)
        session = fk.start(scenario)
        session.advance(scenario.t_end)
        plain.run(scenario.t_end - scenario.start.t)
        assert np.abs(session.run().q[-1] - plain.q).max() < 1e-9, seed
        assert (session.known_links[0] == plain.links).all(), seed
        others = ~np.eye(plain.n, dtype=bool)
        assert (session.knowledge.newest[others] == np.array(plain.used)[others]).all(), seed


@pytest.mark.parametrize("control", [fk.Held(0.1), fk.Continuous()])
def test_samples_that_were_lost_are_not_asked_about_again(control):
    """Of 2 agents that hear each other never again, and of a third one always: work does not grow with its square."""
    asked = []

    class ToOneAnother(fk.Bernoulli):
        def lost(self, seed, sender, receiver, sample, distance=None):
            asked.append(len(sender))
            return (sender < 2) & (receiver < 2)

    law = fk.Law(fk.Fixed.complete(3), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0.1, 0.0], [0.0, 0.2], [0.0, 0.0]])
    information = fk.Messages(0.1, delay=0.03, jitter=0.04, loss=ToOneAnother(0.5))
    fk.simulate(fk.Scenario(law, start, t_end=10.0, frames=2, control=control, information=information))
    # 100 samples of 3 agents for 2 others each; under continuous control their arrivals are sought beforehand too.
    assert sum(asked) <= 3 * 600
