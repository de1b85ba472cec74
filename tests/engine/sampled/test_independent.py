"""Random worlds against a second implementation, which shares no code with the engine but the random numbers."""

import numpy as np
import pytest

import flocking as fk
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
