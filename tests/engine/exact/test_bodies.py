"""Bodies with columns of their own: an independent integration, the ledger, stored runs and snapshots."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flocking as fk
from flocking.engine.exact.session import ExactSession
from flocking.papers import paper
from flocking.study.claims.claim import Verdict
from flocking.study.linearisation import linearise
from flocking.study.mutants import MUTATIONS
from flocking.study.trajectory import run_from_samples
from tests.bodies import Actuated

N = 6
MASSES = np.linspace(1.0, 2.0, N)
DAMPING = 0.1
LAW = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(1.0)])


def scenario(time_constant=0.2, t_end=5.0, energy="lab"):
    return fk.Scenario(
        LAW, fk.start.box(N, side=3.0, speed=1.0, seed=1), t_end, frames=11, energy=fk.Energy(energy),
        bodies=Actuated(MASSES, DAMPING, time_constant),
    )  # fmt: skip


def solved(run, time_constant):
    """Positions, velocities and forces at the end, by another integrator over the links of the run."""
    start, m, T = run.scenario.start, MASSES[:, None], np.broadcast_to(time_constant, N)[:, None]
    links, y, t0 = run.links[0], np.concatenate([start.q, start.p, start.columns["force"]]), 0.0
    for stop in [*sorted(set(run.switches["time"])), run.scenario.t_end]:

        def slope(t, y, links=links):
            q, p, f = y.reshape(3, N, 2)
            u = fk.control(LAW, fk.State(q, p, t, links))
            return np.concatenate([p, (f - DAMPING * p) / m, (u - f) / T]).ravel()

        y = solve_ivp(slope, (t0, stop), y.ravel(), rtol=1e-11, atol=1e-12).y[:, -1]
        t0, links = stop, links.copy()
        for row in run.switches[run.switches["time"] == stop]:
            links[row["i"], row["j"]] = links[row["j"], row["i"]] = row["kind"] == "appear"
    return y.reshape(3, N, 2)


@pytest.mark.parametrize("time_constant", [0.2, np.linspace(0.1, 0.4, N)], ids=["same", "each"])
def test_a_declared_body_moves_as_another_integrator_says(time_constant):
    run = fk.simulate(scenario(time_constant))
    assert len(run.switches) > 2
    expected = solved(run, time_constant)
    found = np.array([run.q[-1], run.p[-1], run.columns["force"][-1]])
    assert np.abs(found - expected).max() < 1e-8


@pytest.mark.parametrize("energy", ["lab", "centre of mass"])
def test_the_ledger_counts_what_the_body_adds(energy):
    run = fk.simulate(scenario(energy=energy))
    assert np.abs(run.residual).max() < 1e-8 * run.turnover
    # Without the departure the ledger would miss this much.
    assert np.abs(run.trace["departed"]).max() > 0.1


def test_the_reference_says_the_same_of_a_state():
    run = fk.simulate(scenario())
    state, row = run.state(0), run.trace[0]
    said = fk.evaluate(LAW, state, agents=run.scenario.agents)
    assert said.storage + said.kinetic == pytest.approx(row["energy"], rel=1e-12)
    # The first steps of the ledger have the powers of the first state as slopes.
    step = run.trace[1]["time"]
    assert run.trace[1]["departed"] / step == pytest.approx(said.departure, rel=0.2)
    assert run.trace[1]["supplied"] / step == pytest.approx(said.supply, abs=1e-9)


def test_without_a_lag_it_is_a_point_mass():
    lagging = [fk.simulate(scenario(tau, 1.0)) for tau in (1e-2, 5e-3)]
    ideal = fk.simulate(scenario(t_end=1.0).with_(bodies=fk.PointMass(MASSES, DAMPING)))
    far, near = (np.abs(run.q[-1] - ideal.q[-1]).max() for run in lagging)
    # First order in the time constant, and half of it halves the difference.
    assert near < far < 0.1
    assert far / near == pytest.approx(2.0, rel=0.1)


def test_stored_runs_keep_the_columns(tmp_path):
    run = fk.simulate(scenario(), save=tmp_path / "run")
    again = fk.read_run(tmp_path / "run", scenario=scenario())
    assert again.columns["force"].tobytes() == run.columns["force"].tobytes() != b""
    assert fk.first_difference(run, again) is None
    fk.write_run(again, tmp_path / "copy")
    copied = fk.read_run(tmp_path / "copy", scenario=scenario())
    assert copied.columns["force"].tobytes() == run.columns["force"].tobytes()


def test_sessions_go_on_with_the_same_bits():
    whole = fk.simulate(scenario())
    session = ExactSession(scenario())
    session.advance(2.3)
    other = ExactSession.resume(session.snapshot())
    other.advance(5.0)
    run = other.run()
    assert run.columns["force"].tobytes() == whole.columns["force"].tobytes()
    assert fk.first_difference(run, whole) is None


def test_a_new_state_keeps_the_columns_it_leaves_out():
    session = ExactSession(scenario())
    session.advance(1.0)
    before = session.state
    session.replace(state=fk.State(before.q, 0.5 * before.p, before.t, before.links))
    assert session.state.columns["force"] == pytest.approx(before.columns["force"], abs=1e-12)
    session.advance(2.0)


def test_runs_that_differ_in_a_column_alone_differ():
    run = fk.simulate(scenario(t_end=0.5))
    force = run.columns["force"].copy()
    force[3, 2, 0] = np.nextafter(force[3, 2, 0], np.inf)
    found = fk.first_difference(run, replace(run, columns={"force": force}))
    assert (found.what, found.time, found.agent) == ("column 'force'", run.t[3], 2)
    assert fk.first_difference(run, replace(run, columns={})).what == "columns of the agents"


def test_exports_hold_the_columns(tmp_path):
    run = fk.simulate(scenario(t_end=0.5))
    fk.export_run(run, tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as file:
        assert file["column_force"].tobytes() == run.columns["force"].tobytes()
    fk.export_run(run, tmp_path / "run.xyz")
    lines = (tmp_path / "run.xyz").read_text().splitlines()
    assert ":velo:R:3:force:R:2 " in lines[1]
    last = np.array([[float(x) for x in line.split()[1:]] for line in lines[-N:]])
    assert np.array_equal(last[:, 6:], run.columns["force"][-1])


def test_a_stored_run_without_its_columns_is_refused(tmp_path):
    fk.simulate(scenario(t_end=0.5), save=tmp_path / "run")
    plain = fk.Scenario(LAW, fk.State(scenario().start.q, scenario().start.p), 0.5, frames=11)
    with pytest.raises(fk.StorageError, match="the scenario is not that of the run: its parts differ"):
        fk.read_run(tmp_path / "run", scenario=plain)
    fk.simulate(plain, save=tmp_path / "plain")
    with pytest.raises(fk.InvalidInput, match="stores its own, which is another"):
        fk.read_run(tmp_path / "plain", scenario=scenario(t_end=0.5))


def test_frames_that_are_dropped_take_their_columns_along():
    recorder = ExactSession(scenario()).records
    recorder.keep_no_frames()
    assert recorder.columns == []


def test_what_holds_for_point_masses_alone_is_not_said_of_others():
    run = fk.simulate(paper("zhou-2015").scenarios()["zhou-2015"](0).with_(bodies=Actuated(), t_end=0.1, frames=3))
    report = fk.audit(run)
    asked = [x for x in report.results if x.verdict is not Verdict.NOT_APPLICABLE]
    assert len(asked) > 3
    assert {x.verdict for x in asked} == {Verdict.HYPOTHESIS_NOT_MET}
    assert all("Actuated" in x.note for x in asked)
    momentum = next(x for x in fk.audit(fk.simulate(scenario(t_end=0.5))).results if x.claim.key == "momentum")
    assert momentum.verdict is Verdict.NOT_APPLICABLE
    for refused in (
        lambda: run_from_samples(run.scenario, run.t, run.q, run.p),
        lambda: linearise(LAW, run.state(0), agents=run.scenario.agents),
        lambda: MUTATIONS["wrong mass"](run.scenario),
    ):
        with pytest.raises(fk.InvalidInput):
            refused()
