"""Bodies that are integrated between ticks: against other integrators, closed forms and limits, and as sessions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.linalg import expm

import flocking as fk
from flocking.engine.driver.nodes import simulate_nodes
from flocking.engine.sampled.integrated.motion import IntegratedMotion
from flocking.engine.sampled.integrated.session import HOW, IntegratedSession
from flocking.errors import UnsupportedLaw
from flocking.model.bodies.quadrotors import AXES
from flocking.study.evidence.repetitions import repetitions_of
from tests.engine.sampled.plain_flight import G, PlainFlight, at_rest, flown
from tests.engine.sampled.test_independent import random_world
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


@pytest.mark.parametrize("seed", [3, pytest.param(7, marks=pytest.mark.slow), pytest.param(9, marks=pytest.mark.slow)])
def test_steps_agree_with_the_closed_form_of_points(seed):
    """The same session moves point masses in random worlds of messages as the second implementation does."""
    made, plain = random_world(seed)
    session = IntegratedSession(made)
    session.advance(made.t_end)
    plain.run(made.t_end)
    run = session.run()
    assert np.abs(run.q[-1] - plain.q).max() < 1e-8
    assert (session.known_links[0] == plain.links).all()
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover)


def test_steps_agree_with_the_closed_form_of_bodies():
    """Lags, limits, gusts and headings by the steps, and by the closed forms of the same engine."""
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [6.0, 2.0]], [[0.0, 0.0], [-1.0, 0.5]])
    body = fk.Disturbed(fk.Unicycle(0.2, 1.5, 0.4), 0.3, 0.07, 5)
    body = fk.Limited(fk.Limited(fk.Lagged(body, 0.1), rate=20.0), force=3.0)
    world = {"control": fk.Held(0.1, latency=0.03), "information": fk.Messages(0.1, delay=0.05, loss=0.2, seed=3)}
    made = fk.Scenario(law, start, 1.0, frames=11, bodies=fk.Disturbed(body, 0.2, 0.04, 9), **world)
    session = IntegratedSession(made)
    session.advance(1.0)
    one, other = session.run(), fk.simulate(made, progress=False)
    assert np.abs(one.q - other.q).max() < 1e-8
    assert all(np.abs(one.columns[name] - other.columns[name]).max() < 1e-7 for name in ("applied", "heading"))
    assert one.trace["departed"][-1] == pytest.approx(other.trace["departed"][-1], abs=1e-7)
    assert np.abs(one.residual).max() <= 1e-9 * max(1.0, one.turnover)


@pytest.mark.parametrize("order", [1, 2])
def test_a_limit_behind_a_lag_acts_between_ticks(order):
    """A lagged force f tends to u as exp(-t/tau); what acts is f, or its limit: integrals by elementary functions."""
    tau, most, T = 0.4, 0.8, 0.3
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("2*r"))])
    inner = fk.Limited(fk.SingleIntegrator(), speed=most) if order == 1 else fk.Limited(fk.PointMass(), force=most)
    bodies = fk.Lagged(inner, tau)
    made = fk.Scenario(law, fk.State([[0.0], [9.0]]), T, frames=4, bodies=bodies, control=fk.Held(T))
    run = fk.simulate(made, progress=False)
    # f = 2 (1 - exp(-t/tau)) reaches the limit at s.
    s = -tau * math.log(1.0 - most / 2.0)
    assert 0.0 < s < T

    def once(t):
        """The integral of what acts, and the integral of that."""
        x = min(t, s)
        first = 2.0 * (x - tau * (1.0 - math.exp(-x / tau)))
        second = x * x - 2.0 * tau * x + 2.0 * tau**2 * (1.0 - math.exp(-x / tau))
        late = max(t - s, 0.0)
        return first + most * late, second + first * late + most * late**2 / 2

    for k, t in enumerate(run.t):
        first, second = once(float(t))
        assert run.q[k, 0, 0] == pytest.approx(first if order == 1 else second, abs=1e-9)
        assert run.columns["applied"][k, 0, 0] == pytest.approx(2.0 * (1.0 - math.exp(-t / tau)), abs=1e-9)
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)
    assert fk.replay(run).agrees


def test_a_mixture_with_a_lag_moves_as_its_linear_equations_say():
    """Agent 0 is a point mass and agent 1 lags: the exponential of the matrix of (x, v, f) of each."""
    tau, T = 0.2, 0.1
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
    bodies = fk.Mixture((fk.PointMass(2.0), fk.Lagged(fk.PointMass(), tau)), [0, 1])
    made = fk.Scenario(law, fk.State([[0.0], [3.0]], [[0.5], [0.0]]), 1.0, frames=11, bodies=bodies, control=fk.Held(T))
    run = fk.simulate(made, progress=False)
    lagged = expm(T * np.array([[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, -1 / tau, 1 / tau], [0, 0, 0, 0]]))
    x, v, y = 0.0, 0.5, np.array([3.0, 0.0, 0.0])
    for k in range(11):
        assert [*run.q[k, :, 0], *run.p[k, :, 0]] == pytest.approx([x, y[0], v, y[1]], abs=1e-9)
        assert run.columns["applied"][k, :, 0] == pytest.approx([0.0, y[2]], abs=1e-9)
        u = (y[0] - x) + (y[1] - v)
        x, v, y = x + T * v + T * T * u / 4, v + T * u / 2, (lagged @ [*y, -u])[:3]
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)


@dataclass(frozen=True, eq=False)
class Car(fk.Body):
    """Moves ahead at a speed, and turns towards the velocity that the law wants: h' = k (h x u) x h."""

    speed: float = 1.0
    turning: float = 2.0
    order = 1
    columns = (fk.Column("ahead"),)
    parameters = property(lambda self: {"speed": self.speed, "turning": self.turning})

    def rates(self, x):
        h, k = x.columns["ahead"], x.parameter("turning")
        turn = k * (h[0] * x.u[1] - h[1] * x.u[0])
        return {"q": [x.parameter("speed") * c for c in h], "ahead": [-turn * h[1], turn * h[0]]}

    def start(self, column, q, p):
        return np.tile([1.0, 0.0], (len(q), 1))


def test_bodies_of_ones_own_move_between_ticks():
    """The angle between ahead and a held u falls by tan(a/2) = tan(a0/2) exp(-k |u| t); places by Gauss's rule."""
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("0.7*r"))])
    made = fk.Scenario(law, fk.State([[0.0, 0.0], [0.5, 3.0]]), 1.2, frames=7, bodies=Car(), control=fk.Held(0.4))
    run = fk.simulate(made, progress=False)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    q, angle = np.array([[0.0, 0.0], [0.5, 3.0]]), np.zeros(2)
    for k in range(7):
        assert np.abs(run.q[k] - q).max() < 1e-8
        assert np.abs(run.columns["ahead"][k] - np.stack([np.cos(angle), np.sin(angle)], axis=1)).max() < 1e-8
        if k % 2 == 0:
            d = (q[1] - q[0]) / np.linalg.norm(q[1] - q[0])
            wanted = np.arctan2([d[1], -d[1]], [d[0], -d[0]])

        def after(t, angle=angle, wanted=wanted):
            off = (angle - wanted + np.pi) % (2 * np.pi) - np.pi
            return wanted + 2 * np.arctan(np.tan(off / 2) * np.exp(-2.0 * 0.7 * t))

        at = [after(0.1 * (1 + x)) for x in nodes]
        q = q + 0.1 * sum(w * np.stack([np.cos(a), np.sin(a)], axis=1) for w, a in zip(weights, at, strict=True))
        angle = after(0.2)
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)
    assert fk.replay(run).agrees


@dataclass(frozen=True, eq=False)
class Heavy(fk.Body):
    """A point whose moving parts double its kinetic energy, and with it its inertia."""

    order = 2

    def rates(self, x):
        return {"p": [u / (2 * x.mass) for u in x.u]}

    def kinetic(self, x, relative):
        return x.mass * sum(w**2 for w in relative)


def test_energies_of_ones_own_balance():
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(0.3)])
    start = fk.State([[0.0, 0.0], [2.0, 0.0]], [[0.0, 0.5], [0.0, -0.5]])
    run = fk.simulate(fk.Scenario(law, start, 2.0, frames=5, bodies=Heavy(), control=fk.Held(0.1)), progress=False)
    double = fk.simulate(
        fk.Scenario(law, start, 2.0, frames=5, bodies=fk.PointMass(2.0), control=fk.Held(0.1)), progress=False
    )
    assert np.abs(run.q - double.q).max() < 1e-9
    assert np.abs(run.trace["kinetic"][-1] - double.trace["kinetic"][-1]) < 1e-8
    assert run.trace["departed"][-1] == pytest.approx(double.trace["departed"][-1], abs=1e-8)
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover)


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
    found = fk.replay(run.until(0.5))
    assert found.agrees, str(found)


def test_logs_are_computed_again_and_mutants_are_caught(monkeypatch):
    run = fk.simulate(flock(), progress=False)
    found = fk.replay(run)
    assert found.agrees, str(found)
    assert found.undecided == 0
    with pytest.raises(UnsupportedLaw, match="change at ticks alone"):
        fk.departed_causes(run)
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
    assert np.abs(session.run().residual).max() <= 1e-8 * max(1.0, session.run().turnover)


@pytest.mark.parametrize(
    ("bodies", "words"),
    [
        (fk.Limited(fk.Quadrotor(), speed=1.0), "largest speed, for which motions must be in closed form"),
        (fk.Mixture((fk.Limited(fk.PointMass(), speed=1.0), fk.Quadrotor()), [0, 1]), "Leave the speed out"),
        (fk.Limited(fk.Lagged(fk.PointMass(), 0.1), speed=2.0), "a limit of what a lagged body exerts would act"),
    ],
)
def test_largest_speeds_are_refused(bodies, words):
    with pytest.raises(UnsupportedLaw, match=words):
        fk.start(aircraft(bodies=bodies), "sampled")


def test_processes_of_agents_refuse_bodies_without_a_closed_form():
    with pytest.raises(UnsupportedLaw, match="moves bodies in closed form"):
        simulate_nodes(aircraft(), processes=False)
