"""A gain that is one per cent off shows, at every size and precision; what is right gives no alarm."""

from functools import partial

import numpy as np
import pytest

import flocking as fk
from flocking.engine.fixed_step.law_gaps import is_due
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.errors import LawNotObeyed
from flocking.study.claims.claim import Verdict
from tests.engine.tiles.laws import STRUCTURAL


def saber(gain=1.0, consensus=1.0):
    psi = fk.Potential(STRUCTURAL, a=gain, b=5 * gain, c=4 / np.sqrt(20), d=1.0)
    return fk.Law(fk.Proximity(1.2), [fk.Gradient(psi), fk.Consensus(consensus)])


def zhou(gain=1.0, consensus=1.0):
    psi = fk.Potential("k*(1/r + 1/(R - r))", k=gain, R=4.0)
    return fk.Law(fk.Hysteresis(radius=4.0, gap=0.3), [fk.Gradient(psi), fk.Consensus(consensus)])


LAWS = {"saber": (saber, 0.9, 0.05), "zhou": (zhou, 2.6, 0.05)}


def scenario(name, n, seed=1, steps=4, step=0.005):
    law, spacing, noise = LAWS[name]
    start = fk.start.hexagonal(n, spacing=spacing, noise=noise, speed=0.3, seed=seed)
    return fk.Scenario(law(), start, t_end=steps * step, frames=2)


def test_forces_are_looked_at_more_and_more_rarely():
    assert [k for k in range(1, 5000) if is_due(k)] == [1, 4, 16, 64, 256, 1024, 2048, 3072, 4096]


@pytest.mark.parametrize("scheme", ["verlet", "damped", "rk4"])
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_number_that_the_kernel_has_wrong_by_one_per_cent_stops_the_run(scheme, precision):
    """Forces and books are then wrong alike: a ledger alone cannot see it."""
    for name in LAWS:
        options = TilesOptions(step=0.005, scheme=scheme, precision=precision)
        for number in range(3):
            session = TilesSession(scenario(name, 300), options)
            wrong = session._particles.parameters.P.copy()
            wrong[number] *= 1.01
            session._particles._set_parameters = lambda *_: None
            session._particles.parameters.P = wrong
            with pytest.raises(LawNotObeyed, match="declared law"):
                session.advance(0.02)


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_plant_with_a_gain_one_per_cent_off_fails_the_ledger(precision):
    for name in LAWS:
        made = scenario(name, 300)
        for gains in ((1.01, 1.0), (1.0, 1.01)):
            plant = LAWS[name][0](*gains)
            run = fk.simulate(made, engine="tiles", plant=plant, step=0.005, precision=precision, progress=False)
            assert run.finished
            found = fk.audit(run)["ledger"]
            assert found.verdict == Verdict.FAILS
            assert "differs from the declared law" in found.note
        run = fk.simulate(made, engine="tiles", plant=made.law, step=0.005, precision=precision, progress=False)
        assert fk.audit(run)["ledger"].verdict == Verdict.HOLDS
        assert run.provenance["law_checks"] == 2


@pytest.mark.parametrize("part", ["kick", "drift"])
def test_steps_that_are_one_per_cent_off_show(part, monkeypatch):
    from flocking.engine.tiles.particles import particle_arrays as particles

    original = particles.ParticleArrays.move

    def wrong(self, t, **how):
        if how["drift"] != 0:
            how[part] *= 1.01
        original(self, t, **how)

    monkeypatch.setattr(particles.ParticleArrays, "move", wrong)
    with pytest.raises(LawNotObeyed):
        fk.simulate(scenario("saber", 300), engine="tiles", step=0.005, progress=False)


@pytest.mark.parametrize(("name", "said"), [("pairs", "energy"), ("dissipated", "dissipated power")])
def test_sums_of_the_ledger_that_are_one_per_cent_off_show_though_the_motion_is_right(name, said, monkeypatch):
    from flocking.engine.tiles.kernels.tile_sums import SUMS
    from flocking.engine.tiles.particles import particle_arrays as particles

    original = particles.ParticleArrays.move

    def wrong(self, t, **how):
        original(self, t, **how)
        self.results.sums[:, SUMS.index(name)] *= 1.01

    monkeypatch.setattr(particles.ParticleArrays, "move", wrong)
    with pytest.raises(LawNotObeyed, match=f"declared law: the {said} is off by"):
        fk.simulate(scenario("saber", 300), engine="tiles", step=0.005, progress=False)


def test_a_plant_over_other_graphs_is_refused():
    other = fk.Law(fk.Proximity(1.3), saber().terms)
    with pytest.raises(fk.InvalidInput, match="graphs of the declared law"):
        fk.simulate(scenario("saber", 20), engine="tiles", plant=other, progress=False)


def test_a_planted_run_goes_on_bit_for_bit():
    made = scenario("saber", 100)
    plant = saber(1.0, 1.01)
    whole = TilesSession(made, TilesOptions(step=0.005), plant=plant)
    part = TilesSession(made, TilesOptions(step=0.005), plant=plant)
    part.advance(0.01)
    again = TilesSession.resume(part.snapshot())
    for session in (whole, again):
        session.advance(0.02)
    assert whole.state.p.tobytes() == again.state.p.tobytes()
    assert whole.law_gaps == again.law_gaps
    right = TilesSession(made, TilesOptions(step=0.005))
    right.advance(0.02)
    assert np.abs(right.state.p - whole.state.p).max() > 1e-6


def test_powers_that_cancel_give_no_alarm():
    """The supply of this law is zero by algebra, term against term: what is left of it is rounding alone."""
    leader = fk.Path(["sin(t)", "cos(t)"], start=[0.0, 0.0])
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0), fk.Track(leader, 0.0, 1.0, 1.0, per_mass=True)])
    start = fk.start.box(20, side=4.0, speed=1.0, seed=2)
    for t in (0.0, np.pi / 2):
        moving = fk.Scenario(
            law, fk.State(start.q, start.p, t), t + 0.02, frames=2, energy=fk.Energy("leader", leader),
            agents=fk.Agents(np.linspace(0.5, 2.0, 20)),
        )  # fmt: skip
        run = fk.simulate(moving, engine="tiles", step=0.005)
        assert run.provenance["law_gap"] <= max(run.provenance["law_gap_allowed"], 1e-12)


@pytest.mark.parametrize("n", [1, 2])
def test_supplies_of_agents_of_order_1_that_cancel_give_no_alarm(n):
    q = np.random.default_rng(n).uniform(0.0, 3.0, (n, 2))
    pursuit = fk.Track(fk.Sink([0.68, -0.13]), position_gain=0.78, velocity_gain=0.67)
    scenario = fk.Scenario(
        fk.Law(fk.Proximity(2.0), [pursuit]), fk.State(q), t_end=0.02, frames=2, agents=fk.SingleIntegrator()
    )
    run = fk.simulate(scenario, engine="tiles", step=5e-4, threads=1, progress=False)
    rate = np.exp(-0.78 * 0.02)
    assert run.q[-1] == pytest.approx(np.array([0.68, -0.13]) + rate * (q - [0.68, -0.13]), rel=1e-12)


@pytest.mark.parametrize("m", [2, 3])
def test_the_supply_of_two_agents_about_their_centre_of_mass_gives_no_alarm(m):
    """Unequal gains: of two equal masses the powers beyond dissipation are equal and opposite."""
    rng = np.random.default_rng(3)
    start = fk.State(rng.normal(size=(2, m)), rng.normal(size=(2, m)))
    law = fk.Law(fk.Proximity(9.0), [fk.Consensus([1.0, 2.0])])
    scenario = fk.Scenario(law, start, t_end=0.02, frames=2, energy=fk.Energy("centre of mass"))
    run = fk.simulate(scenario, engine="tiles", scheme="rk4", step=1e-3, threads=1, progress=False)
    # The difference of the velocities falls at the rate 3.
    kinetic = 0.25 * ((start.p[1] - start.p[0]) ** 2).sum() * np.exp(-6.0 * run.t)
    assert run.trace["energy"][[0, -1]] == pytest.approx(kinetic, rel=1e-9)
    assert np.abs(run.trace["supplied"]).max() < 1e-14


def _radius(particles):
    particles.radii.limits[0][:2] *= 1.05


def _view(particles):
    particles.radii.views[0][0] *= 1.1


def _neighbour(particles):
    """An agent of the first tile has its own number in place of its first neighbour."""
    require = particles.require_lists

    def wrong(h):
        require(h)
        lists = particles.lists[0]
        for lane in range(16):
            lists.rows[lists.first[0], lane] = lane

    particles.require_lists = wrong


def of_a_moving_group(terms, order, n=2000):
    """Agents that all but follow their leader: what is left of velocities about the mean is small."""
    start = fk.start.hexagonal(n, spacing=7.0, noise=0.1, speed=1e-3, seed=1)
    start = fk.State(start.q + 300.0, start.p + 9.97 if order == 2 else None)
    body = fk.PointMass(np.linspace(1, 2, n)) if order == 2 else fk.SingleIntegrator(np.linspace(1, 2, n))
    law = fk.Law(fk.Proximity(8.4), terms)
    return fk.Scenario(law, start, t_end=0.02, frames=2, energy=fk.Energy("centre of mass"), agents=body)


LEADER = fk.Velocity([9.97, 9.97])
MOVING = {
    "about the centre of mass": lambda: of_a_moving_group([fk.Consensus(1.0), fk.Track(LEADER, 0.0, 0.3)], 2),
    "of the centre of mass": lambda: of_a_moving_group(
        [fk.Consensus(1.0), fk.Track(LEADER, 1e-3, 0.3, shared=True)], 2
    ),
    "of order 1": lambda: of_a_moving_group(
        [fk.Gradient(fk.Potential("(r - 7)**2/2")), fk.Track(LEADER, position_gain=1e-3)], 1
    ),
}


@pytest.mark.parametrize("name", MOVING)
@pytest.mark.parametrize(("share", "alarm"), [(0.25, False), (1e6, True)])
def test_means_may_be_off_by_the_rounding_of_their_sums_and_no_more(name, share, alarm, monkeypatch):
    """Numbers that are added one after the other may be off by their number of units of rounding."""
    made = MOVING[name]()
    fill = ParticleArrays.fill_means

    def less_exact(self, rows, out):
        fill(self, rows, out)
        out *= 1.0 + share * self.n * np.finfo(float).eps

    monkeypatch.setattr(ParticleArrays, "fill_means", less_exact)
    run = partial(fk.simulate, made, engine="tiles", step=0.005, progress=False)
    if alarm:
        with pytest.raises(LawNotObeyed, match="declared law"):
            run()
    else:
        assert run().fidelity.law.checks == 2


@pytest.mark.parametrize("scheme", ["verlet", "damped", "rk4"])
@pytest.mark.parametrize("fault", [_radius, _view, _neighbour])
def test_links_that_are_not_those_of_the_graph_stop_the_run(scheme, fault):
    """With Runge-Kutta steps forces are held against the law over the links of the engine: these are judged apart."""
    start = fk.start.hexagonal(300, spacing=0.9, noise=0.15, speed=0.3, seed=2)
    graph = fk.FieldOfView(1.5, 1.1, "p") if fault is _view else fk.Proximity(1.5)
    law = fk.Law(graph, [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=0.3)), fk.Consensus(0.4)])
    session = TilesSession(fk.Scenario(law, start, t_end=1.0, frames=2), TilesOptions(step=0.005, scheme=scheme))
    fault(session._particles)
    with pytest.raises(LawNotObeyed, match=r"declared law"):
        session.advance(0.4)
