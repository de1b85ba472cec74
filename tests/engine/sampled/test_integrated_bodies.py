"""Bodies that are integrated between ticks: against other integrators, closed forms and limits, and as sessions."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import flocking as fk
from flocking.apps.cli import main
from flocking.engine.adaptive_steps.stepper import Stepper
from flocking.engine.driver.nodes import simulate_nodes
from flocking.engine.runs.message_log import MessageLog
from flocking.engine.sampled.integrated.motion import IntegratedMotion
from flocking.engine.sampled.integrated.session import HOW
from flocking.errors import UnsupportedLaw
from flocking.model.bodies.quadrotors import AXES
from flocking.study.evidence.repetitions import repetitions_of
from tests.engine.sampled.plain_flight import G, PlainFlight, at_rest, flown
from tests.engine.sampled.test_sessions import same

K, GAIN = 0.1, 0.1
LAW = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=K)), fk.Consensus(GAIN)])
START = fk.State([[0.0, 0.0, 0.0], [2.0, 1.0, 0.5]], [[0.3, -0.2, 0.1], [0.0, 0.4, 0.0]])
RADIUS, GAP = 2.0, 0.3
FLOCK = fk.Law(fk.Hysteresis(RADIUS, GAP), LAW.terms)
WORLD = {
    "control": fk.Held([0.1, 0.1, 0.12], phase=[0.0, 0.02, 0.0], latency=0.03),
    "information": fk.Messages(
        0.1, phase=[0.0, 0.0, 0.05], delay=0.02, jitter=0.05, loss=0.2, noise=fk.WhiteNoise(0.01, 0.01), seed=4
    ),
}  # fmt: skip


def aircraft(t_end=1.5, **parts):
    given = {"frames": 16, "bodies": fk.Quadrotor(), "control": fk.Held(0.1)}
    return fk.Scenario(LAW, START, t_end, **{**given, **parts})


def flock(t_end=0.6, **parts):
    places = [[0.0, 0.0, 0.0], [1.6, 0.0, 0.1], [0.3, 1.75, 0.0]]
    speeds = [[0.4, 0.1, 0.0], [-0.3, 0.2, 0.1], [0.2, -0.5, 0.0]]
    columns = {name: np.array([R[:, k] for R in LEANING]) for k, name in enumerate(AXES)}
    given = {"frames": 13, "bodies": fk.Quadrotor(), **WORLD}
    return fk.Scenario(FLOCK, fk.State(places, speeds, columns=columns), t_end, **{**given, **parts})


def tilted(angle, axis):
    """Axes that are turned by an angle about an axis (Rodrigues)."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    turn = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * turn + (1 - np.cos(angle)) * turn @ turn


LEANING = [tilted(0.8, [1.0, 0.3, 0.0]), np.eye(3), tilted(0.5, [0.0, 1.0, 1.0])]


def numbers_of(run, k, i):
    """Those of one aircraft in a frame, in the order of the second implementation."""
    R = np.stack([run.columns[name][k, i] for name in AXES], axis=1)
    others = [run.columns[name][k, i] for name in ("spin", "command", "command_rate")]
    return np.concatenate([run.q[k, i], run.p[k, i], R.ravel(), *others])


def test_aircraft_fly_as_the_published_equations_say_from_tick_to_tick():
    """One of them begins nearly upside down, so that its rotors idle, and turns."""
    R = [tilted(2.3, [1.0, 0.5, 0.2]), np.eye(3)]
    spin = np.array([[3.0, -2.0, 1.0], [0.0, 0.0, 0.5]])
    columns = {name: np.array([x[:, k] for x in R]) for k, name in enumerate(AXES)} | {"spin": spin}
    made = aircraft(1.0, frames=21).with_(start=fk.State(START.q, START.p, columns=columns))
    run = fk.simulate(made, progress=False)
    assert run.fidelity.engine == "sampled"
    lift = [x[20] + 0.028 * G for x in (numbers_of(run, k, 0) for k in range(21))]
    assert min(lift) > 0.0
    assert run.columns["axis_3"][0, 0, 2] < 0.0 < run.columns["axis_3"][-1, 0, 2]
    y = [at_rest(START.q[i], START.p[i], R[i], spin[i]) for i in (0, 1)]
    for k in range(21):
        for i in (0, 1):
            assert np.abs(numbers_of(run, k, i) - y[i]).max() < 1e-8 * (1.0 + np.abs(y[i]).max())
        if k % 2 == 0:
            d, v = y[1][:3] - y[0][:3], y[1][3:6] - y[0][3:6]
            r = np.linalg.norm(d)
            u = K * (r - 1) * d / r + GAIN * v
        y = [flown(y[0], u, 0.05), flown(y[1], -u, 0.05)]
    assert np.abs(run.residual).max() < 1e-8 * max(1.0, run.turnover)
    assert abs(run.trace["departed"][-1]) > 1e-3


def test_a_flock_with_messages_flies_as_plain_queues_say():
    made = flock()
    session = fk.start(made)
    session.advance(made.t_end)
    run = session.run()
    plain = PlainFlight(made, lambda r: K * (r - 1), GAIN, RADIUS - GAP, RADIUS, LEANING)
    plain.run(made.t_end)
    assert np.abs(run.q[-1] - plain.q).max() < 1e-8
    assert np.abs(run.p[-1] - plain.p).max() < 1e-8
    assert (session.known_links[0] == plain.links).all()
    others = ~np.eye(3, dtype=bool)
    assert (session.knowledge.newest[others] == np.array(plain.used)[others]).all()
    assert {"appear", "break"} & set(run.switches["kind"])


def test_true_links_and_closest_approaches_are_those_of_the_motion():
    run = fk.simulate(flock(1.2, frames=1201), progress=False)
    away = np.linalg.norm(run.q[:, :, None] - run.q[:, None], axis=-1)
    linked = away[0] < RADIUS
    for k in range(len(run.t)):
        linked = np.where(linked, away[k] < RADIUS, away[k] < RADIUS - GAP)
        np.fill_diagonal(linked, False)
        near = np.abs(np.where(linked, away[k] - RADIUS, away[k] - RADIUS + GAP)) < 2e-3
        assert ((run.links[k] == linked) | near).all()
        linked = run.links[k]
    for row in run.switches:
        fine = run.q[:, row["i"]] - run.q[:, row["j"]]
        at = [np.interp(row["time"], run.t, fine[:, c]) for c in range(3)]
        level = RADIUS if row["kind"] == "break" else RADIUS - GAP
        assert np.linalg.norm(at) == pytest.approx(level, abs=1e-5)
    assert len(run.switches) > 0
    least = away[:, *np.triu_indices(3, 1)].min()
    assert run.closest.distance == pytest.approx(least, abs=1e-4)
    assert run.closest.distance <= least + 1e-12


def test_short_periods_tend_to_continuous_control():
    ideal = fk.simulate(aircraft(1.0, control=fk.Continuous(), tolerance=1e-11), progress=False)
    gaps = []
    for period in (0.02, 0.01):
        run = fk.simulate(aircraft(1.0, control=fk.Held(period)), progress=False)
        names = ("axis_3", "spin", "command")
        both = [(run.q, ideal.q), (run.p, ideal.p), *((run.columns[x], ideal.columns[x]) for x in names)]
        gaps.append([np.abs(a[-1] - b[-1]).max() for a, b in both])
    assert np.log2(np.array(gaps[0]) / gaps[1]) == pytest.approx(np.ones(5), abs=0.25)


def test_aircraft_that_want_nothing_hover():
    law = fk.Law(LAW.graph, [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=0.0))])
    made = fk.Scenario(law, fk.State(START.q), 2.0, frames=5, bodies=fk.Quadrotor(), control=fk.Held(0.1))
    run = fk.simulate(made, progress=False)
    assert np.abs(run.q - START.q).max() < 1e-14
    assert np.abs(run.columns["spin"]).max() < 1e-14


def test_stored_and_cut_runs_have_the_same_bits(tmp_path):
    ideal = fk.simulate(flock(), progress=False)
    session = fk.start(flock())
    for t in np.linspace(0.013, 0.6, 17):
        session.advance(float(t))
        session = session.moment()()
    assert same(session.run(), ideal)
    assert ideal.provenance["motion"] == HOW
    stored = fk.simulate(flock(), save=tmp_path / "run", progress=False)
    again = fk.read_run(tmp_path / "run")
    assert same(again, stored)
    assert same(again, ideal)
    assert again.log.ticks.tolist() == ideal.log.ticks.tolist()
    fk.write_scenario(flock(), tmp_path / "world.toml")
    assert same(fk.simulate(fk.read_scenario(tmp_path / "world.toml"), progress=False), ideal)


def test_aircraft_meet_gusts_and_obstacles():
    """Gusts change between ticks; an agent is within range of a ball while its distance from it is below the range."""
    avoid = fk.Avoid([fk.Ball([1.0, 0.5, 0.0], 0.3)], range=0.9, gamma_agents=False, repulsion_gain=0.05)
    made = flock(1.0, frames=201, bodies=fk.Disturbed(fk.Quadrotor(), 0.01, 0.07, 5)).with_(
        law=fk.Law(FLOCK.graph, [*FLOCK.terms, avoid])
    )
    run = fk.simulate(made, progress=False)
    met = run.switches[run.switches["kind"] == "obstacle"]
    assert len(met) > 0
    away = np.linalg.norm(run.q - [1.0, 0.5, 0.0], axis=-1) - 0.3
    for i in range(3):
        crossed = np.flatnonzero(np.diff(away[:, i] < 0.9))
        times = met["time"][met["i"] == i]
        assert len(times) == len(crossed)
        assert np.abs(np.interp(times, run.t, away[:, i]) - 0.9).max(initial=0.0) < 1e-4
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)
    calm = fk.simulate(made.with_(bodies=fk.Quadrotor()), progress=False)
    assert np.abs(run.q[-1] - calm.q[-1]).max() > 1e-3
    session = fk.start(made)
    session.advance(0.47)
    again = session.moment()()
    again.advance(1.0)
    assert same(again.run(), run)
    found = fk.replay(run.until(0.3))
    assert found.agrees, str(found)


LEADER = fk.Velocity([0.5, 0.0, 0.0])
FOLLOWED = fk.Law(FLOCK.graph, [*FLOCK.terms, fk.Track(LEADER, 0.05, fk.Schedule([0.13], [0.1, 0.2])), fk.Compensate()])


@pytest.mark.parametrize(
    "parts",
    [
        {"bodies": fk.Mixture((fk.PointMass(0.03, 0.01), fk.Quadrotor(), fk.Limited(fk.Quadrotor(0.05), force=0.1)),
                              [0, 1, 2]), "start": fk.State(flock().start.q, flock().start.p)},
        {"law": FOLLOWED, "energy": fk.Energy(frame="leader", leader=LEADER), "bodies": fk.Quadrotor(damping=0.02)},
        {"space": fk.Periodic([8.0, 8.0, 8.0]), "energy": fk.Energy(frame="centre of mass")},
    ],
    ids=["mixture", "leader", "periodic"],
)  # fmt: skip
def test_ledgers_balance_and_logs_agree_in_other_worlds(parts):
    run = fk.simulate(flock(0.4).with_(**parts), progress=False)
    assert np.isfinite(run.q).all()
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)
    found = fk.replay(run)
    assert found.agrees, str(found)


def test_a_step_that_is_interrupted_is_taken_again(monkeypatch):
    """Ctrl-C within a step leaves a session that goes on, and is saved, with the same bits."""
    ideal = fk.simulate(flock(), progress=False)
    session, step, calls = fk.start(flock()), Stepper.step, []

    def interrupted(self, *given):
        calls.append(self)
        if len(calls) in (4, 11):
            raise KeyboardInterrupt
        return step(self, *given)

    monkeypatch.setattr(Stepper, "step", interrupted)
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            session.advance(0.6)
        session = session.moment()()
    session.advance(0.6)
    assert same(session.run(), ideal)


def test_logs_are_computed_again_and_mutants_are_caught(monkeypatch):
    run = fk.simulate(flock(), progress=False)
    found = fk.replay(run)
    assert found.agrees, str(found)
    assert found.undecided == 0
    assert fk.departed_causes(run).causes["body"].any()
    exert = IntegratedMotion.exert
    monkeypatch.setattr(IntegratedMotion, "exert", lambda self, time, agents, force=None, beside=None: exert(
        self, time, agents, None if force is None else 1.0001 * force))  # fmt: skip
    assert "from where the logged forces lead" in str(fk.replay(fk.simulate(flock(), progress=False)))


def test_the_error_of_a_motion_is_estimated_by_smaller_tolerances():
    run = fk.simulate(flock(), progress=False)
    assert run.fidelity.ledger.kind == "tolerance"
    assert math.isnan(run.closest.error)
    found = repetitions_of(run)
    assert len(found.runs) == 2
    assert 0.0 < found.share < 1e-8
    assert "the last with 0.01 of the tolerance" in found.note


def test_laws_and_messages_may_change_on_the_way():
    session = fk.start(flock())
    session.advance(0.25)
    before = session.state
    stiff = fk.Law(FLOCK.graph, [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=0.2)), fk.Consensus(GAIN)])
    session.replace(law=stiff)
    session.replace_information(fk.Messages(0.1, phase=[0.0, 0.0, 0.05], delay=0.04, seed=5))
    assert np.array_equal(session.state.q, before.q)
    session.advance(0.4)
    again = session.moment()()
    session.advance(0.6)
    again.advance(0.6)
    assert same(session.run(), again.run())
    assert session.run().fidelity.changed
    assert np.abs(session.run().residual).max() <= 1e-8 * max(1.0, session.run().turnover)


def test_a_largest_speed_of_points_beside_aircraft_is_refused():
    bodies = fk.Mixture((fk.Limited(fk.PointMass(), speed=1.0), fk.Quadrotor()), [0, 1])
    with pytest.raises(UnsupportedLaw, match="Leave the speed out"):
        fk.start(aircraft(bodies=bodies), "sampled")


def test_processes_of_agents_refuse_bodies_without_a_closed_form():
    with pytest.raises(UnsupportedLaw, match="moves bodies in closed form"):
        simulate_nodes(aircraft(), processes=False)


def test_the_summary_of_a_run_says_how_bodies_moved(tmp_path, capsys):
    fk.simulate(flock(), save=tmp_path / "run", progress=False)
    assert main(["info", str(tmp_path / "run")]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert f"motion {HOW}" in text


@pytest.mark.parametrize(("part", "words"), [("forces", "its force is logged as"), ("uses", "sample")])
def test_logs_that_were_changed_are_caught(part, words):
    run = fk.simulate(flock(), progress=False)
    log = {name: np.array(getattr(run.log, name)) for name in ("ticks", "forces", "uses")}
    if part == "forces":
        log["forces"][5] *= 1.001
    else:
        log["uses"][10, 2] += 1
    found = fk.replay(dataclasses.replace(run, log=MessageLog(**log)))
    assert any(words in wrong.what for wrong in found.wrong)


@pytest.mark.parametrize("seed", [0, 3, 6])
def test_replays_let_limits_of_several_agents_begin_one_after_another(seed):
    """Replays went on for ever where a limit was at its border but for rounding, or missed that of another agent."""
    rng = np.random.default_rng(seed)
    start = fk.State(1.5 * rng.normal(size=(3, 2)), rng.normal(size=(3, 2)))
    law = fk.Law(fk.Fixed.complete(3), [fk.Consensus(1.0)])
    bodies = fk.Lagged(fk.Limited(fk.PointMass(), force=1.0), 0.2)
    run = fk.simulate(fk.Scenario(law, start, 0.3, frames=2, bodies=bodies, control=fk.Held(0.1)), progress=False)
    found = fk.replay(run)
    assert found.agrees, str(found)
