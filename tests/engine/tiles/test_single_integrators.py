"""Agents of order 1 under the tiled engine: forces and ledger against brute force, motion against the exact engine."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.tiles.kernels.tile_sums import SUMS
from flocking.engine.tiles.particles import particle_arrays
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.errors import LawNotObeyed, StepTooLarge
from flocking.study.claims.claim import Verdict
from tests.engine.tiles.flow_laws import NAMES, Pull, laws
from tests.engine.tiles.laws import states, structural


def session_of(law, state, energy, **options):
    masses = np.random.default_rng(1).uniform(0.5, 2.0, state.n)
    scenario = fk.Scenario(law, state, t_end=state.t + 1, agents=fk.SingleIntegrator(masses), energy=energy, frames=1)
    return TilesSession(scenario, TilesOptions(step=0.01, **options))


QUICK = ("gradient and consensus", "hysteresis", "obstacles")
"""Laws that the default tests run in space and in single precision; all laws do in the slow ones."""


def cases(names, others):
    """Each law in the plane in double precision, and with each of the other settings; most of those are slow."""
    found = [(name, 2, "float64") for name in names]
    for m, precision in others:
        found += [(name, m, precision) for name in names if name in QUICK]
        found += [pytest.param(name, m, precision, marks=pytest.mark.slow) for name in names if name not in QUICK]
    return found


@pytest.mark.parametrize(("name", "m", "precision"), cases(NAMES, [(3, "float64"), (2, "float32")]))
def test_velocities_energies_and_powers_are_those_of_all_pairs(name, m, precision):
    n = 90
    law, energy = laws(n, m)[name]
    # No pair is next to the barrier of hysteresis, where rounding is a large share of what is left of the radius.
    state = states(n, m, seed=n, side=1.1)["lattice" if name == "hysteresis" else "random"]
    q = state.q if precision == "float64" else state.q.astype(np.float32).astype(np.float64)
    state = fk.State(q, state.p, t=0.3)
    session = session_of(law, state, energy, precision=precision)
    expected = fk.evaluate(law, state, agents=session.scenario.agents, energy=energy)
    share = 1e-11 if precision == "float64" else 3e-5
    assert expected.dissipation > 0
    found = session.accelerations()
    error = np.linalg.norm(found - expected.u, axis=1)
    size = expected.pair_force_sum + np.linalg.norm(expected.u, axis=1) + 1e-3
    assert (error <= share * size).all(), (error / size).max()
    sums = session._integrator.ledger_sums.sums
    unlinked = expected.storage - sums["pairs"] - sums["bodies"]
    assert abs(unlinked) <= share * (abs(sums["pairs"]) + abs(sums["bodies"]))
    assert sums["kinetic"] == 0.0
    powers = {"work": expected.dissipation, "dissipated": expected.dissipation, "supplied": expected.supply}
    scale = expected.dissipation + abs(expected.supply)
    for k, value in powers.items():
        assert sums[k] == pytest.approx(value, abs=share * scale), k
    assert set(sums) == set(SUMS)


def test_laws_that_supply_energy_are_among_them():
    n = 90
    state = fk.State(states(n, 2, seed=n, side=1.1)["random"].q, t=0.3)
    supplying = {
        name for name, (law, energy) in laws(n).items()
        if abs(fk.evaluate(law, state, agents=fk.SingleIntegrator(), energy=energy).supply) > 1e-3
    }  # fmt: skip
    assert {
        "gain of each agent", "radius of each agent", "directed", "leader", "frame of the leader", "obstacles",
        "weighted force, its energy supplied",
    } <= supplying  # fmt: skip
    assert not supplying & {"gradient and consensus", "hysteresis", "pieces", "two graphs", "weighted energy"}


PATH = fk.Path(["sin(t)", "0.5*cos(2*t)"])


def smooth(**changes):
    """A motion without switches, after a leader that moves, with agents that pull each other unevenly."""
    n = 12
    start = fk.start.box(n, side=4, seed=3)
    law = fk.Law(
        fk.Proximity(50.0),
        [
            fk.Gradient(structural()),
            Pull(np.linspace(0.02, 0.1, n)),
            fk.Track(PATH, position_gain=0.5, shared=True),
        ],
    )
    return fk.Scenario(law, start, t_end=1.0, frames=3, tolerance=1e-12, agents=fk.SingleIntegrator(), **changes)


@pytest.fixture(scope="module")
def truth():
    return fk.simulate(smooth(), progress=False)


def tiled(scenario, **options):
    return fk.simulate(scenario, engine="tiles", progress=False, **options)


@pytest.mark.parametrize(("scheme", "order", "step"), [("euler", 1, 0.005), ("rk4", 4, 0.04)])
def test_motion_and_ledger_have_the_order_of_the_scheme(truth, scheme, order, step):
    errors, residuals, books = [], [], []
    for h in (step, step / 2, step / 4):
        run = tiled(smooth(), step=h, scheme=scheme)
        assert run.t == pytest.approx(truth.t, abs=1e-14)
        assert (run.p == 0).all()
        assert run.provenance["scheme"] == scheme
        errors.append(np.abs(run.q - truth.q).max())
        residuals.append(np.abs(run.residual).max())
        last, exact = run.trace[-1], truth.trace[-1]
        books.append(max(abs(last[k] - exact[k]) for k in ("dissipated", "supplied")))
    for found in (errors, residuals, books):
        assert np.log2(found[0] / found[2]) / 2 == pytest.approx(order, abs=0.3)
    assert abs(truth.trace[-1]["supplied"]) > 0.1
    assert residuals[0] < 0.05 * run.turnover


@pytest.mark.parametrize(("scheme", "bound"), [("euler", 2e-3), ("rk4", 1e-9)])
def test_agreement_on_a_net_follows_its_closed_form(scheme, bound):
    """dq/dt = -L q, q(t) = exp(-L t) q(0): Olfati-Saber (12)-(13)."""
    n, t_end = 30, 1.0
    net = fk.Fixed.random_connected(n, 0.2, seed=1)
    law = fk.Law(net, [fk.Gradient(fk.Potential("0.5*r**2"))])
    start = fk.start.box(n, side=3.0, seed=2)
    links = net.initial(start.q)
    laplacian = np.diag(links.sum(axis=1)) - links.astype(float)
    value, vector = np.linalg.eigh(laplacian)
    expected = vector @ (np.exp(-value * t_end)[:, None] * (vector.T @ start.q))
    scenario = fk.Scenario(law, start, t_end=t_end, agents=fk.SingleIntegrator())
    run = tiled(scenario, scheme=scheme, step=0.002)
    assert np.abs(run.q[-1] - expected).max() < bound
    assert run.q[-1].mean(axis=0) == pytest.approx(start.q.mean(axis=0), abs=1e-12)
    # What is dissipated: the storage, half the sum over links of r^2, less what is left of it.
    stored = [0.5 * np.trace(q.T @ laplacian @ q) for q in (start.q, expected)]
    assert run.trace[-1]["dissipated"] == pytest.approx(stored[0] - stored[1], rel=0.03 if scheme == "euler" else 1e-7)


def test_rows_of_the_exact_engine_and_of_tiles_say_the_same_of_links_that_switch():
    """Energy jumps where links appear: both count it."""
    start = fk.start.box(40, side=7.0, seed=4)
    law = fk.Law(fk.Proximity(1.5), [fk.Gradient(structural())])
    scenario = fk.Scenario(law, start, t_end=0.5, frames=3, agents=fk.SingleIntegrator())
    exact, run = fk.simulate(scenario, progress=False), tiled(scenario, step=0.0005)
    assert exact.switches.size > 5
    assert np.abs(run.q - exact.q).max() < 2e-3
    assert abs(run.trace[-1]["jumped"]) > 0.1
    for k in ("energy", "dissipated", "jumped"):
        assert run.trace[-1][k] == pytest.approx(exact.trace[-1][k], abs=2e-2 * run.turnover)
    assert np.abs(run.residual).max() < 1e-6 * run.turnover


def test_single_precision_stays_within_its_rounding(truth):
    run = tiled(smooth(), step=0.02, precision="float32")
    assert np.abs(run.q - truth.q).max() < 3e-5
    assert np.abs(run.residual).max() < 1e-4 * run.turnover
    assert np.abs(run.q - truth.q).max() > 1e-9


def crowd(law=None, n=2500, dimension=2, t_end=0.2, **changes):
    start = fk.State(states(n, dimension, seed=2, side=0.8)["random"].q)
    law = law or fk.Law(fk.Proximity(1.2), [fk.Gradient(structural()), Pull(np.linspace(0.1, 0.5, n))])
    return fk.Scenario(law, start, t_end=t_end, frames=4, agents=fk.SingleIntegrator(), **changes)


@pytest.mark.parametrize("scheme", ["euler", "rk4"])
def test_threads_change_nothing(scheme):
    runs = [tiled(crowd(), step=0.01, scheme=scheme, threads=k, observe=True) for k in (1, 2, 5)]
    for other in runs[1:]:
        for name in ("q", "trace", "observables"):
            # Bytes: velocities of these agents are not numbers.
            assert getattr(runs[0], name).tobytes() == getattr(other, name).tobytes()
    assert runs[0].provenance["rebuilds"] > 2


@pytest.mark.parametrize("scheme", ["euler", "rk4"])
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_run_that_goes_on_has_the_same_bits(scheme, precision):
    n = 200
    start = fk.State(fk.start.hexagonal(n, spacing=0.9, noise=0.05, seed=2).q)
    law = fk.Law(fk.Hysteresis(radius=1.3, gap=0.1), [fk.Gradient(structural()), Pull(np.linspace(0.1, 0.5, n))])
    scenario = fk.Scenario(law, start, t_end=0.5, frames=11, agents=fk.SingleIntegrator())
    options = TilesOptions(step=0.002, scheme=scheme, precision=precision, threads=2)
    whole = TilesSession(scenario, options)
    whole.advance(0.5)
    first = TilesSession(scenario, options)
    first.advance(0.2011)
    looked, back = first.state, first.moment()
    first.advance(0.37)
    second = back()
    assert (second.state.q == looked.q).all()
    second.advance(0.5)
    one, two = whole.run(), second.run()
    for name in ("q", "p", "trace"):
        assert (getattr(one, name) == getattr(two, name)).all()
    assert whole.rebuilds == second.rebuilds > 1


def test_a_law_or_state_may_be_replaced_on_the_way():
    session = TilesSession(smooth(), TilesOptions(step=0.01))
    session.advance(0.3)
    law = fk.Law(fk.Proximity(50.0), [fk.Gradient(structural(2.0))])
    session.replace(law=law)
    state = session.state
    expected = fk.evaluate(law, state, agents=fk.SingleIntegrator())
    assert session.accelerations() == pytest.approx(expected.u, abs=1e-12)
    session.advance(0.5)
    moved = fk.State(session.state.q[::-1].copy(), t=session.time)
    session.replace(state=moved)
    session.advance(0.7)
    run = session.run()
    assert np.abs(run.residual).max() < 1e-4 * run.turnover
    other = fk.simulate(fk.Scenario(law, moved, t_end=0.7, agents=fk.SingleIntegrator()), progress=False)
    assert np.abs(session.state.q - other.q[-1]).max() < 1e-6


def test_schemes_are_those_of_the_order():
    with pytest.raises(fk.FlockingError, match=r"scheme must be one of rk4, euler for agents of order 1.*'verlet'"):
        tiled(smooth(), scheme="verlet")
    with pytest.raises(fk.FlockingError, match=r"scheme must be one of verlet, damped, rk4 for agents of order 2"):
        tiled(smooth().with_(agents=fk.PointMass()), scheme="euler")
    assert TilesSession(smooth()).options.scheme == "rk4"
    assert TilesSession(smooth().with_(agents=fk.PointMass())).options.scheme == "verlet"


LAWS_WITH_GAINS = {
    "gradient": lambda gain: fk.Law(fk.Proximity(1.2), [fk.Gradient(fk.Potential("0.5*k*(r - 1)**2", k=gain))]),
    "pull": lambda gain: fk.Law(fk.Proximity(1.2), [Pull(gain * np.linspace(0.5, 1.5, 300))]),
    "leader": lambda gain: fk.Law(
        fk.Proximity(1.2), [fk.Gradient(structural()), fk.Track(PATH, position_gain=gain)]
    ),
}  # fmt: skip


def lattice(law):
    start = fk.start.hexagonal(300, spacing=0.9, noise=0.05, seed=1)
    return fk.Scenario(law, fk.State(start.q), t_end=0.02, frames=2, agents=fk.SingleIntegrator())


@pytest.mark.parametrize("scheme", ["euler", "rk4"])
@pytest.mark.parametrize("precision", ["float64", pytest.param("float32", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", LAWS_WITH_GAINS)
def test_a_gain_one_per_cent_off_shows(name, precision, scheme):
    law = LAWS_WITH_GAINS[name]
    options = {"step": 0.005, "scheme": scheme, "precision": precision}
    run = tiled(lattice(law(1.0)), plant=law(1.01), **options)
    found = fk.audit(run)["ledger"]
    assert found.verdict == Verdict.FAILS
    assert "differs from the declared law" in found.note
    run = tiled(lattice(law(1.0)), plant=law(1.0), **options)
    assert fk.audit(run)["ledger"].verdict == Verdict.HOLDS
    assert run.provenance["law_checks"] == 2
    wrong, right = (TilesSession(lattice(law(gain)), TilesOptions(**options)) for gain in (1.01, 1.0))
    right._particles._set_parameters = lambda *_: None
    right._particles.parameters = wrong._particles.parameters
    with pytest.raises(LawNotObeyed, match="declared law"):
        right.advance(0.02)


@pytest.mark.parametrize("plant", ["gradient", "pull"])
def test_the_ledger_of_another_law_does_not_close(plant):
    """The plant is ten per cent off: the residual no longer shrinks with the step."""
    law = LAWS_WITH_GAINS[plant]
    honest, other = ([], [])
    for h in (0.005, 0.0025, 0.00125):
        for found, gain in ((honest, 1.0), (other, 1.1)):
            run = tiled(lattice(law(1.0)).with_(t_end=0.1), plant=law(gain), step=h, scheme="rk4")
            found.append(np.abs(run.residual).max() / run.turnover)
    assert honest[2] < 1e-8
    assert min(other) > 0.01
    assert other[2] == pytest.approx(other[0], rel=0.05)


def test_a_step_that_is_one_per_cent_too_long_shows(monkeypatch):
    original = particle_arrays.ParticleArrays.move

    def wrong(self, t, **how):
        if how["drift"] != 0:
            how["drift"] *= 1.01
        original(self, t, **how)

    monkeypatch.setattr(particle_arrays.ParticleArrays, "move", wrong)
    with pytest.raises(LawNotObeyed):
        tiled(lattice(LAWS_WITH_GAINS["gradient"](1.0)), step=0.005, scheme="euler")


@pytest.mark.parametrize(
    ("name", "m", "precision"), cases([name for name in NAMES if name != "hysteresis"], [(2, "float32")])
)
def test_honest_runs_give_no_alarm(name, m, precision):
    law, energy = laws(80, m)[name]
    start = fk.State(fk.start.hexagonal(80, spacing=0.95, noise=0.05, seed=3).q)
    masses = np.linspace(0.5, 2.0, 80)
    scenario = fk.Scenario(
        law, start, t_end=0.1, frames=2, agents=fk.SingleIntegrator(masses), energy=energy
    )  # fmt: skip
    for scheme in ("euler", "rk4"):
        run = tiled(scenario, scheme=scheme, precision=precision, step=0.0005)
        assert run.provenance["law_gap"] <= 0.5 * run.provenance["law_gap_allowed"] + 1e-12
        assert fk.audit(run)["ledger"].verdict == Verdict.HOLDS


@pytest.mark.parametrize(("scheme", "factor"), [("euler", 2.2), ("rk4", 3.0)])
def test_an_unstable_step_shows_with_a_ledger_and_without(scheme, factor):
    """Twelve agents that all pull each other: the rate of descent is 12."""
    law = fk.Law(fk.Fixed.complete(12), [fk.Gradient(fk.Potential("0.5*r**2"))])
    scenario = fk.Scenario(
        law, fk.start.box(12, side=3.0, seed=2), t_end=12.0, frames=4, agents=fk.SingleIntegrator()
    )  # fmt: skip
    for ledger in (True, False):
        with pytest.raises(StepTooLarge):
            tiled(scenario, scheme=scheme, step=factor / 12, ledger=ledger)
    assert tiled(scenario.with_(t_end=3.0), scheme=scheme, step=0.2 / 12, ledger=False).finished


def test_agents_that_set_out_from_rest_are_no_sign_of_instability():
    """What has no velocity before its first step must not look as if it had turned round."""
    law = fk.Law(fk.Fixed.complete(12), [fk.Gradient(fk.Potential("0.5*r**2"))])
    begin = fk.start.box(12, side=3.0, seed=2)
    scenario = fk.Scenario(law, begin, t_end=0.04, frames=2, agents=fk.SingleIntegrator())
    session = TilesSession(scenario, TilesOptions(scheme="euler", step=0.0005, ledger=False))
    session.advance(0.02)
    session.replace(state=fk.State(begin.q[::-1].copy()))
    session.advance(0.04)


@pytest.mark.parametrize("scheme", ["euler", "rk4"])
def test_an_automatic_step_closes_the_ledger(scheme):
    for name in ("gradient and consensus", "hysteresis", "pieces", "obstacles", "leader"):
        law, energy = laws(80)[name]
        begin = fk.State(fk.start.hexagonal(80, spacing=0.95, noise=0.02, seed=3).q)
        scenario = fk.Scenario(law, begin, t_end=0.02, frames=2, agents=fk.SingleIntegrator(), energy=energy)
        run = tiled(scenario, scheme=scheme)
        assert np.abs(run.residual).max() < 0.03 * run.turnover
