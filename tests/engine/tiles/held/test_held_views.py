"""Fields of view under held control and with messages in the tiled engine, against the engine of events."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

import flocking as fk
from flocking.engine.tiles.held.session import HeldTilesSession
from flocking.engine.tiles.options import TilesOptions

N = 30
HEARD = {"period": 0.1, "delay": 0.03, "loss": fk.Bernoulli(0.3), "expires": 0.4}
EACH = np.arange(N)


def _headings(m):
    return np.linspace(-3.0, 3.0, N) if m == 2 else Rotation.random(N, rng=2).as_matrix()


def _scenario(m=2, body=fk.PointMass, radius=2.5, half_angle=1.2, column="", columns=(), **world):
    rng = np.random.default_rng(7)
    law = fk.Law(
        fk.FieldOfView(radius, half_angle, column),
        [fk.Gradient(fk.Potential("k*(r-1)**2/2", k=0.3)), fk.Consensus(0.5)],
    )
    start = fk.State(rng.uniform(-3, 3, (N, m)), rng.normal(size=(N, m)), columns=dict(columns))
    return fk.Scenario(
        law,
        start,
        t_end=1.0,
        agents=body(headings=None if column else _headings(m)),
        frames=5,
        **({"control": fk.Held(0.1)} | world),
    )


def _robots(of=lambda body: body, **world):
    """Unicycles that look along their headings, with masses and damping, and ``of`` between them and their forces."""
    angles = np.linspace(-3.0, 3.0, N)

    def body(headings):
        return of(fk.Unicycle(np.linspace(0.2, 0.5, N), np.linspace(1.0, 2.0, N), 0.1))

    heading = {"heading": np.stack([np.cos(angles), np.sin(angles)], axis=1)}
    return _scenario(body=body, column="heading", columns=heading, **world)


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
    "robots look ahead, late": lambda: _robots(control=fk.Held(0.1, latency=0.02)),
    "robots each by itself, in gusts": lambda: _robots(
        lambda body: fk.Disturbed(body, 0.3, 0.04, 5), half_angle=np.linspace(0.4, np.pi, N),
        control=fk.Held(np.where(EACH % 2, 0.1, 0.2), phase=0.02 * (EACH % 3)),
    ),
    "robots lag, messages lost, own places measured": lambda: _robots(
        lambda body: fk.Limited(fk.Lagged(body, 0.1), force=2.0),
        information=fk.Messages(**HEARD, noise=fk.WhiteNoise(0.02, 0.02), self_known="measured"),
    ),
    "messages lost, predicted": lambda: _scenario(half_angle=2.2, information=fk.Messages(**HEARD, predict=True)),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_motions_and_links_are_those_of_the_other_engine(name):
    made = CASES[name]()
    exact = fk.simulate(made, engine="sampled", progress=False)
    run = fk.simulate(made, engine="tiles", step=0.002, progress=False)
    # The other engine integrates robots that look ahead.
    exactly = 1e-7 if "robots" in name else 1e-9
    assert np.abs(run.q - exact.q).max() < exactly
    assert np.abs(run.p - exact.p).max() < exactly
    assert (run.links == exact.links).all()
    assert (run.links[0] != run.links[-1]).any()
    # A switch of a true link counts from the step after it.
    size = np.abs(exact.trace["energy"]).max() + 1.0
    for each in ("energy", "dissipated", "supplied", "jumped", "departed"):
        assert abs(run.trace[each][-1] - exact.trace[each][-1]) < 5e-3 * size, each


@pytest.mark.parametrize("name", ["messages lost, predicted", "robots look ahead, late"])
def test_what_agents_used_is_computed_again_as_declared(name):
    run = fk.simulate(CASES[name](), engine="tiles", step=0.02, progress=False)
    assert "all as declared" in str(fk.replay(run))


@pytest.mark.parametrize("name", [each for each in CASES if "own places measured" in each and "lag" in each])
def test_stored_runs_go_on_bit_for_bit(name):
    made = CASES[name]()
    whole = fk.simulate(made, engine="tiles", step=0.01, progress=False)
    session = HeldTilesSession(made, TilesOptions(step=0.01))
    session.advance(0.43)
    again = session.moment()()
    again.advance(made.t_end)
    run = again.run()
    assert np.array_equal(run.q, whole.q)
    assert np.array_equal(run.links, whole.links)
    assert all(np.array_equal(run.trace[each], whole.trace[each]) for each in run.trace.dtype.names)


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_links_and_flocks_between_steps_are_those_of_the_headings_then(precision):
    made = _robots(control=fk.Held(0.2)).with_(frames=14)
    options = {"engine": "tiles", "step": 0.05, "precision": precision, "progress": False}
    run = fk.simulate(made, **options)
    observed = fk.simulate(made, observe=True, keep_frames=False, **options).observables
    for k in range(14):
        seen = made.law.graph.start_links(run.q[k], run.columns["heading"][k])
        # In single precision a pair may be on the border.
        assert np.abs(seen.astype(int) - run.links[k]).sum() <= (0 if precision == "float64" else 2)
        # Flocks are of agents of whom one sees the other.
        assert observed["flocks"][k] == connected_components(run.links[k], directed=False)[0]
        assert observed["neighbours"][k] == pytest.approx(run.links[k].sum() / N, abs=1e-12)
