"""Random worlds against a second implementation on SciPy's integrator, which shares no code with the engine."""

import numpy as np
import pytest

import flocking as fk
from tests.engine.delayed.plain_delays import PlainDelays


def random_world(seed):
    """A scenario with a random delay, and its second implementation."""
    rng = np.random.default_rng(seed)
    n, radius, gap, stiff = int(rng.integers(3, 7)), 2.0, 0.3, 1.5
    order = int(rng.integers(1, 3))
    law = fk.Law(fk.Hysteresis(radius, gap), [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=stiff)), fk.Consensus(0.8)])
    start = fk.State(rng.uniform(0, 3, (n, 2)), rng.normal(size=(n, 2)) if order == 2 else np.zeros((n, 2)))
    bodies = fk.SingleIntegrator()
    if order == 2:
        bodies = fk.PointMass(masses=rng.uniform(0.5, 2.0, n), damping=float(rng.choice([0.0, 0.4])))
    information = fk.Delayed(float(rng.uniform(0.03, 0.4)), self_delayed=bool(rng.random() < 0.5))
    scenario = fk.Scenario(law, start, t_end=2.0, frames=5, information=information, bodies=bodies,
                           tolerance=1e-10)  # fmt: skip
    gain = 0.8 if order == 2 else 0.0
    return scenario, PlainDelays(scenario, lambda r: stiff * (r - 1), gain)


def check(seed):
    """The engine and the second implementation agree; how often a known link switched."""
    scenario, plain = random_world(seed)
    session = fk.start(scenario)
    start = session.known_links.copy()
    assert (start[0] == plain.links).all()
    session.advance(scenario.t_end)
    q, p, switches = plain.run(scenario.t_end)
    run = session.run()
    assert run.fidelity.engine == "delayed"
    assert np.abs(run.q[-1] - q).max() < 1e-8
    assert np.abs(run.p[-1] - p).max() < 1e-8
    assert (session.known_links[0] == plain.links).all()
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover)
    return switches


def test_random_worlds():
    assert sum(check(seed) for seed in range(8)) > 8


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8, 112))
def test_104_more_random_worlds(seed):
    check(seed)
