"""Fields of view under held control and with messages in the tiled engine, against the engine of events."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flocking as fk
from flocking.engine.tiles.held.session import HeldTilesSession
from flocking.engine.tiles.options import TilesOptions

N = 30
HEARD = {"period": 0.1, "delay": 0.03, "loss": fk.Bernoulli(0.3), "expires": 0.4}
EACH = np.arange(N)


def _headings(m):
    return np.linspace(-3.0, 3.0, N) if m == 2 else Rotation.random(N, rng=2).as_matrix()


def _scenario(m=2, body=fk.PointMass, radius=2.5, half_angle=1.2, column="", **world):
    rng = np.random.default_rng(7)
    law = fk.Law(
        fk.FieldOfView(radius, half_angle, column),
        [fk.Gradient(fk.Potential("k*(r-1)**2/2", k=0.3)), fk.Consensus(0.5)],
    )
    start = fk.State(rng.uniform(-3, 3, (N, m)), rng.normal(size=(N, m)))
    return fk.Scenario(
        law,
        start,
        t_end=1.0,
        agents=body(headings=None if column else _headings(m)),
        frames=5,
        **({"control": fk.Held(0.1)} | world),
    )


CASES = {
    "points": lambda: _scenario(),
    "in space, late": lambda: _scenario(3, control=fk.Held(0.1, latency=0.02)),
    "each by itself": lambda: _scenario(
        radius=np.linspace(1.5, 3.0, N), half_angle=np.linspace(0.4, np.pi, N),
        control=fk.Held(np.where(EACH % 2, 0.1, 0.2), phase=0.02 * (EACH % 3)),
    ),
    "along velocities": lambda: _scenario(column="p", control=fk.Held(0.1, latency=0.02)),
    "along velocities, in space, own ones measured, lost": lambda: _scenario(
        3, half_angle=1.6, column="p",
        information=fk.Messages(**HEARD, noise=fk.WhiteNoise(0.02, 0.02), self_known="measured"),
    ),
    "order 1": lambda: _scenario(body=fk.SingleIntegrator),
    "lagged, messages lost, own places measured": lambda: _scenario(
        body=lambda headings: fk.Lagged(fk.PointMass(headings=headings), 0.1),
        information=fk.Messages(**HEARD, noise=fk.WhiteNoise(0.02, 0.02), self_known="measured"),
    ),
    "messages lost, predicted": lambda: _scenario(half_angle=2.2, information=fk.Messages(**HEARD, predict=True)),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_motions_and_links_are_those_of_the_other_engine(name):
    made = CASES[name]()
    exact = fk.simulate(made, engine="sampled", progress=False)
    run = fk.simulate(made, engine="tiles", step=0.002, progress=False)
    assert np.abs(run.q - exact.q).max() < 1e-9
    assert np.abs(run.p - exact.p).max() < 1e-9
    assert (run.links == exact.links).all()
    assert (run.links[0] != run.links[-1]).any()
    # A switch of a true link counts from the step after it.
    size = np.abs(exact.trace["energy"]).max() + 1.0
    for each in ("energy", "dissipated", "supplied", "jumped", "departed"):
        assert abs(run.trace[each][-1] - exact.trace[each][-1]) < 5e-3 * size, each


def test_what_agents_used_is_computed_again_as_declared():
    run = fk.simulate(CASES["messages lost, predicted"](), engine="tiles", step=0.02, progress=False)
    assert "all as declared" in str(fk.replay(run))


def test_stored_runs_go_on_bit_for_bit():
    made = CASES["lagged, messages lost, own places measured"]()
    whole = fk.simulate(made, engine="tiles", step=0.01, progress=False)
    session = HeldTilesSession(made, TilesOptions(step=0.01))
    session.advance(0.43)
    again = session.moment()()
    again.advance(made.t_end)
    run = again.run()
    assert np.array_equal(run.q, whole.q)
    assert np.array_equal(run.links, whole.links)
    assert all(np.array_equal(run.trace[each], whole.trace[each]) for each in run.trace.dtype.names)
