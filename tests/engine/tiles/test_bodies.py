"""Limited, lagged and disturbed bodies and unicycles in fixed steps, against the exact engine as steps become short."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.checkpoint import pack
from flocking.engine.driver.registry import engine_named
from flocking.engine.tiles.engine import ENGINE
from flocking.engine.tiles.law_check import LawCheck
from flocking.engine.tiles.options import TilesOptions
from flocking.errors import InvalidInput, LawNotObeyed, NotFinite, UnsupportedLaw
from tests.engine.storage.stored_runs import unpack

N = 60
VARIED = np.linspace(0.5, 1.5, N)
START = fk.start.box(N, side=10, speed=1, seed=3)
LAW = fk.Law(fk.Proximity(50.0), [fk.Gradient(fk.Potential("(r - 2)**2/20")), fk.Consensus(0.05)])
STEPS = (0.01, 0.005, 0.0025)

SMOOTH = {
    "lagged": fk.Lagged(fk.PointMass(VARIED, 0.3), VARIED),
    "lagged order 1": fk.Lagged(fk.SingleIntegrator(), 0.2),
    "gusts": fk.Disturbed(fk.PointMass(), 0.3, 0.05),
    "wind": fk.Lagged(fk.Disturbed(fk.PointMass(damping=0.2), 0.3 * VARIED, 0.05), 0.2),
    "unicycles": fk.Unicycle(VARIED),
}
LIMITED = {
    "limited": fk.Limited(fk.PointMass(VARIED, 0.3), force=5 * VARIED),
    "limited by axis": fk.Limited(fk.PointMass(), force=4.0, shape="box"),
    "limited order 1": fk.Limited(fk.SingleIntegrator(), speed=2.0),
    "limited rate": fk.Limited(fk.Lagged(fk.PointMass(), 0.2), force=4.0, rate=20.0),
    "limited behind a lag": fk.Lagged(fk.Limited(fk.PointMass(), force=4.0), 0.2),
    "a chain": fk.Limited(
        fk.Disturbed(fk.Lagged(fk.Disturbed(fk.Unicycle(0.1, damping=0.1), 0.2, 0.04, seed=5), 0.3), 0.1, 0.05),
        force=5.0,
    ),
}


def scenario(bodies, start=START, law=LAW, **more):
    return fk.Scenario(law, start, bodies=bodies, **{"t_end": 0.5, "frames": 4} | more)


def errors(bodies):
    """Largest errors of states, columns and the work that departed, and the largest residual, for each step."""
    held = scenario(bodies)
    exact = fk.simulate(held, engine="exact", progress=False)
    found = []
    for h in STEPS:
        run = fk.simulate(held, engine="tiles", step=h, progress=False)
        assert set(run.columns) == {column.name for column in bodies.columns}
        pairs = [(run.q, exact.q), (run.p, exact.p), *((run.columns[c], exact.columns[c]) for c in exact.columns)]
        state = max(np.abs(mine - theirs).max() for mine, theirs in pairs)
        if bodies.order == 1:
            found.append((state, 0.0, 0.0))
            continue
        off = abs(run.trace["departed"][-1] - exact.trace["departed"][-1])
        found.append((state, off, np.abs(run.residual).max()))
    return np.array(found), abs(exact.trace["departed"][-1])


@pytest.mark.parametrize("name", SMOOTH)
def test_smooth_bodies_are_of_order_four(name):
    found, departed = errors(SMOOTH[name])
    assert found[-1, 0] < 1e-6
    assert np.log2(found[0, 0] / found[1, 0]) > 3.3
    if SMOOTH[name].order == 2:
        assert found[-1, 1] <= 1e-7 * departed
        assert np.log2(found[0, 2] / found[1, 2]) > 3.3


FEW = {"limited", "limited order 1", "a chain"}
"""Those that the default tests try."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in FEW else pytest.mark.slow) for name in LIMITED]
)
def test_limited_bodies_approach_the_located_limits(name):
    """Kinks lie within steps: the state is of order 2, the ledger, integrated by the same passes, of order 4."""
    found, departed = errors(LIMITED[name])
    assert found[-1, 0] < 1e-3
    assert np.log2(found[0, 0] / found[-1, 0]) / 2 > 1.2
    free = fk.simulate(scenario(LIMITED[name].body), engine="exact", progress=False)
    bound = fk.simulate(scenario(LIMITED[name]), engine="exact", progress=False)
    assert np.abs(free.q - bound.q).max() > 100 * found[-1, 0] or "a chain" in name
    if LIMITED[name].order == 2:
        assert found[-1, 1] <= 1e-4 * departed
        assert np.log2(found[0, 2] / found[1, 2]) > 3.3


def test_a_largest_speed_is_exceeded_by_a_step_at_most():
    bodies = fk.Limited(fk.PointMass(), speed=2.5)
    exact = fk.simulate(scenario(bodies), engine="exact", progress=False)
    over, off = [], []
    for h in (0.01, 0.000625):
        run = fk.simulate(scenario(bodies, frames=30), engine="tiles", step=h, progress=False)
        over.append(np.linalg.norm(run.p, axis=-1).max() - 2.5)
        off.append(np.abs(run.q[-1] - exact.q[-1]).max())
        assert np.abs(run.residual[-1]) < 1e-3 * abs(run.trace["departed"][-1])
    assert 0.0 <= over[1] < 0.15 * over[0] < 0.15
    assert off[1] < 0.2 * off[0]


def test_the_unlimited_body_moves_as_the_point():
    """A limit that never acts changes no bit, the ledger departs by exactly nothing."""
    point = fk.simulate(scenario(fk.PointMass()), engine="tiles", scheme="rk4", step=0.01, progress=False)
    run = fk.simulate(scenario(fk.Limited(fk.PointMass(), force=1e6)), engine="tiles", step=0.01, progress=False)
    assert (run.q == point.q).all()
    assert not run.trace["departed"].any()
    assert (run.trace["energy"] == point.trace["energy"]).all()


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("name", ["limited", "wind", "a chain"])
def test_pieces_threads_and_resuming_give_the_same_bits(name, precision):
    n = 2200
    law = fk.Law(fk.Hysteresis(2.5, gap=0.5), [fk.Gradient(fk.Potential("(r - 2)**2")), fk.Consensus(0.5)])
    start = fk.start.hexagonal(n, spacing=1.9, noise=0.2, speed=1.0, seed=1)
    bodies = {
        "limited": fk.Limited(fk.PointMass(), force=np.linspace(0.2, 1.0, n)),
        "wind": fk.Lagged(fk.Disturbed(fk.PointMass(), 0.3, 0.05), np.linspace(0.1, 0.3, n)),
        "a chain": fk.Limited(fk.Lagged(fk.Disturbed(fk.Unicycle(0.1), 0.2, 0.04), 0.3), force=1.0),
    }[name]
    held = scenario(bodies, start, law, t_end=0.5)
    whole = fk.simulate(held, engine="tiles", step=0.01, threads=1, precision=precision, progress=False)
    assert whole.provenance["rebuilds"] > 2
    session = ENGINE.open(held, TilesOptions(step=0.01, threads=2, precision=precision))
    session.advance(0.113)
    session.advance(0.31)
    again = session.moment()()
    again.advance(0.5)
    cut = again.run()
    assert all((cut.columns[c] == whole.columns[c]).all() for c in whole.columns)
    assert (cut.q == whole.q).all()
    assert (cut.trace == whole.trace).all()


@pytest.mark.parametrize("control", [fk.Continuous(), fk.Held(0.1, latency=0.05)], ids=["continuous", "held"])
def test_a_run_goes_on_from_its_checkpoint(control, tmp_path):
    bodies = fk.Lagged(fk.Disturbed(fk.Unicycle(0.2), 0.3, 0.05), 0.2)
    held = scenario(bodies, control=control)
    session = ENGINE.open(held, TilesOptions(step=0.01))
    session.advance(0.17)
    again = unpack(pack(session), session.run("unfinished"), None, tmp_path)
    for each in (session, again):
        each.advance(0.5)
    one, two = session.state, again.state
    assert (one.q == two.q).all()
    assert all((one.columns[c] == two.columns[c]).all() for c in ("applied", "heading"))
    assert pack(session) == pack(again)


@pytest.mark.parametrize(("name", "row"), [("limited", "force"), ("lagged", "time_constant"), ("gusts", "sigma")])
def test_kernels_that_misread_a_body_are_found(name, row, monkeypatch):
    """A number of the body that reaches the kernel one per cent too large."""
    bodies = {**SMOOTH, **LIMITED}[name]
    session = ENGINE.open(scenario(bodies), TilesOptions(step=0.01))
    particles = session._particles
    slot = particles.spec.layout.slot("bodies", row)
    take = particles._set_parameters

    def wrong(scenario, t):
        take(scenario, t)
        numbers = particles.parameters.P if slot[0] == "P" else particles.parameters.A
        numbers[int(slot[1:])] *= 1.01

    monkeypatch.setattr(particles, "_set_parameters", wrong)
    with pytest.raises(LawNotObeyed, match=type(bodies).__name__):
        session.advance(1.0)


def test_wrong_controls_are_found(monkeypatch):
    session = ENGINE.open(scenario(LIMITED["limited"]), TilesOptions(step=0.01))
    before = LawCheck._compared

    def wrong(self, particles, state, places, force, *rest, **more):
        return before(self, particles, state, places, force * 1.01, *rest, **more)

    monkeypatch.setattr(LawCheck, "_compared", wrong)
    with pytest.raises(LawNotObeyed, match="declared law"):
        session.advance(1.0)


@pytest.mark.parametrize("bodies", [fk.Quadrotor(), fk.Limited(fk.Quadrotor(), force=1.0)], ids=["alone", "limited"])
def test_quadrotors_are_refused_by_name(bodies):
    held = scenario(bodies, fk.start.box(N, side=10, speed=1, seed=3, dimension=3))
    assert "Quadrotor" in engine_named("tiles").why_not(held)
    with pytest.raises(UnsupportedLaw, match="Quadrotor agents, of which something acts only at times"):
        fk.simulate(held, engine="tiles", progress=False)


def test_other_schemes_and_plants_are_refused():
    held = scenario(fk.Limited(fk.PointMass(), force=1.0))
    with pytest.raises(InvalidInput, match="must be 'rk4' for Limited agents"):
        fk.simulate(held, engine="tiles", scheme="verlet", progress=False)
    with pytest.raises(UnsupportedLaw, match="plants of points alone"):
        fk.simulate(held, engine="tiles", plant=fk.Law(fk.Proximity(50.0), [fk.Consensus(1.0)]), progress=False)


@pytest.mark.parametrize("ledger", [True, False])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_headings_that_a_step_is_too_long_for_end_the_run(ledger):
    fast = scenario(fk.Unicycle(0.05), fk.State(START.q, 100 * START.p), t_end=0.3)
    with pytest.raises(NotFinite, match=r"Further columns became infinite or NaN\. Lower the step"):
        fk.simulate(fast, engine="tiles", step=0.01, ledger=ledger, progress=False)


def test_lammps_refuses_by_name_what_tiles_refuse():
    held = scenario(fk.Limited(fk.PointMass(), force=1.0)).with_(control=fk.Held(0.1))
    assert engine_named("lammps").why_not(held) == ""
    why = engine_named("lammps").why_not(held.with_(bodies=fk.Lagged(held.agents, 0.2)))
    assert why.startswith("engine='lammps' runs the kernels of the tiled engine. The tiled engine cannot run Lagged")


@pytest.mark.parametrize("begin", [0.0, 1e7, 1e8, 1.7e9, -1.7e9])
def test_gusts_change_at_their_times_however_late_a_run_begins(begin):
    """Seconds of an epoch: a nanosecond is less than the rounding of such times, and no gust lasts for two periods."""
    body = fk.Disturbed(fk.PointMass(), 1.0, period=0.125, seed=3)
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)])
    start = fk.State(np.zeros((1, 2)), np.zeros((1, 2)), begin)
    scenario = fk.Scenario(law, start, t_end=begin + 1.0, frames=9, agents=body)
    run = fk.simulate(scenario, engine="tiles", step=0.01, progress=False)
    pushes = np.diff(run.p[:, 0], axis=0)
    expected = np.concatenate([body.gust(k, 1, 2) for k in range(8)]) * 0.125
    assert pushes == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("begin", [1e8, 1.7e9])
def test_gusts_of_a_tenth_of_a_second_change_in_time_too(begin):
    """No such time is a binary fraction: velocities differ from those of a run from 0 by the rounding of times."""
    body = fk.Disturbed(fk.PointMass(), 1.0, period=0.1, seed=3)
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)])
    late, early = (
        fk.simulate(
            fk.Scenario(law, fk.State(np.zeros((1, 2)), np.zeros((1, 2)), t), t_end=t + 1.0, frames=11, agents=body),
            engine="tiles", step=0.01, progress=False,
        )
        for t in (begin, 0.0)
    )  # fmt: skip
    assert np.abs(late.p - early.p).max() < 1e-5
