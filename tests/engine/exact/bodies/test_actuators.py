"""Actuators with a lag and with limits: closed forms, a second implementation, the ledger, files and saved sessions."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import flocking as fk
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.engine.exact.barriers import nearest_to_barrier
from flocking.engine.exact.session import ExactSession
from flocking.errors import LinkLost
from flocking.model.serial import from_data, to_data
from flocking.study.scenario_files.scenario_file import parse_scenario, scenario_to_text
from tests.bodies import Actuated

N = 3
FORCES = fk.Law(fk.Fixed.complete(N), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(0.5)])
FLOW = fk.Law(fk.Fixed.complete(N), [fk.Gradient(fk.Potential("(r - 1)**2"))])
START = fk.State([[0.0, 0.0], [2.0, 0.3], [-0.4, 1.5]], [[1.0, 0.0], [0.0, -1.0], [0.5, 0.5]])


def run_of(body, law=None, t_end=2.0, **fields):
    law = law or (FLOW if body.order == 1 else FORCES)
    return fk.simulate(fk.Scenario(law, START, t_end, frames=5, bodies=body, tolerance=1e-11, **fields), progress=False)


def pair(force, speeds, body, *, gap=1.0, t_end=1.0, tolerance=1e-11):
    """Two agents on a line that pull (positive) or push each other with a constant force."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("c*r", c=force))])
    start = fk.State([[0.0, 0.0], [gap, 0.0]], [[speeds[0], 0.0], [speeds[1], 0.0]])
    return fk.simulate(fk.Scenario(law, start, t_end, frames=9, bodies=body, tolerance=tolerance), progress=False)


def test_the_step_response_of_a_lag():
    tau, t = 0.3, np.linspace(0, 1.0, 9)
    run = pair(1.0, (0.0, 0.0), fk.Lagged(fk.PointMass(), tau), gap=3.0)
    fade = 1 - np.exp(-t / tau)
    for name, found, expected in (
        ("force", run.columns["applied"][:, 0, 0], fade),
        ("speed", run.p[:, 0, 0], t - tau * fade),
        ("place", run.q[:, 0, 0], t**2 / 2 - tau * t + tau**2 * fade),
    ):
        assert found == pytest.approx(expected, abs=1e-10), name


def test_the_step_response_of_a_lagged_velocity():
    tau, t = 0.3, np.linspace(0, 1.0, 9)
    run = pair(1.0, (0.0, 0.0), fk.Lagged(fk.SingleIntegrator(), tau), gap=3.0)
    assert run.q[:, 0, 0] == pytest.approx(t - tau * (1 - np.exp(-t / tau)), abs=1e-10)
    # The energy c r falls by c times the way; without a lag it would fall by c |u| t on either side.
    assert run.trace["departed"][-1] == pytest.approx(2 * tau * (1 - np.exp(-1 / tau)), abs=1e-10)


@pytest.mark.parametrize("margin", [0.999, 1.001])
def test_two_bodies_can_stop_if_and_only_if_the_gap_is_long_enough(margin):
    """Closing at w over the gap g, they stop iff w^2 <= 2 (a_1 + a_2) g, where a is the largest force over the mass."""
    masses, forces, gap = np.array([1.0, 2.0]), np.array([0.5, 1.4]), 0.8
    reach = (forces / masses).sum()
    closing = margin * np.sqrt(2 * reach * gap)
    run = pair(
        -50.0, (0.7 * closing, -0.3 * closing), fk.Limited(fk.PointMass(masses), force=forces), gap=gap,
        t_end=0.9995 * closing / reach,
    )  # fmt: skip
    distance = run.q[:, 1, 0] - run.q[:, 0, 0]
    stops = gap - closing * run.t + reach * run.t**2 / 2
    met = margin > 1
    before = run.t < (closing - np.sqrt(max(closing**2 - 2 * reach * gap, 0.0))) / reach if met else run.t >= 0.0
    assert distance[before] == pytest.approx(stops[before], abs=1e-9)
    assert (distance.min() < 0.0) == met


def test_a_bite_is_located():
    """The force r of a spring falls below the limit at a time that is known: before, the motion is a parabola."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.State([[0.0, 0.0], [2.0, 0.0]], np.zeros((2, 2)))
    bodies = fk.Limited(fk.PointMass(), force=1.0)
    run = fk.simulate(fk.Scenario(law, start, 1.5, frames=3, bodies=bodies, tolerance=1e-10), progress=False)
    # The distance 2 - t^2 is 1 at t = 1; from there it is a cosine.
    assert np.abs(run.trace["time"] - 1.0).min() < 1e-11
    left = run.t[-1] - 1.0
    w = np.sqrt(2.0)
    distance = run.q[-1, 1, 0] - run.q[-1, 0, 0]
    assert distance == pytest.approx(np.cos(w * left) - 2 / w * np.sin(w * left), abs=1e-9)


@pytest.mark.parametrize("speed", [4.0, 2.0])
def test_a_barrier_that_limits_do_not_hold_is_reached_at_a_known_time(speed, monkeypatch):
    """Held back by a constant force until then; the ledger, which grows without bound, does not stop the steps."""
    law = fk.Law(fk.Proximity(4.0), [fk.Gradient(fk.Potential("1000/(4 - r)"))])
    start = fk.State([[0.0, 0.0], [3.0, 0.0]], [[0.0, 0.0], [speed, 0.0]])
    session = fk.start(fk.Scenario(law, start, 0.5, bodies=fk.Limited(fk.PointMass(), force=2.0)))
    take = ExactSession._take_step

    def counted(self, tried):
        assert self.steps < 3000, "steps shrink without end"
        take(self, tried)

    monkeypatch.setattr(ExactSession, "_take_step", counted)
    # The gap of 1 closes at the relative speed, which falls by 4 in a unit of time.
    if speed**2 < 8.0:
        session.advance(0.5)
        apart = session.state.q[1, 0] - session.state.q[0, 0]
        assert apart == pytest.approx(3.0 + 0.5 * speed - 2.0 * 0.5**2, abs=1e-9)
        return
    with pytest.raises(LinkLost, match="limits of the bodies") as reached:
        session.advance(0.5)
    assert tuple(reached.value.agents) == (0, 1)
    assert reached.value.time == pytest.approx((speed - np.sqrt(speed**2 - 8.0)) / 4.0, abs=1e-7)


@pytest.mark.parametrize(("force", "named"), [(1.0, (0, 1)), (1e30, None)])
def test_limits_are_blamed_for_a_barrier_only_where_they_act(force, named):
    law = fk.Law(fk.Proximity(4.0), [fk.Gradient(fk.Potential("1/(4 - r)"))])
    start = fk.State([[0.0, 0.0], [4.0 - 1e-7, 0.0], [1.0, 9.0]], np.zeros((3, 2)))
    session = fk.start(fk.Scenario(law, start, 0.5, bodies=fk.Limited(fk.PointMass(), force=force)), engine="exact")
    assert nearest_to_barrier(session._dynamics, session._links, session._segment.coefficients[-1]) == named


def test_no_agent_gets_faster_than_its_limit():
    speed = np.array([0.8, 0.9, 1.2])
    for body in (fk.PointMass(), fk.Lagged(fk.PointMass(), 0.2)):
        start = fk.State(START.q, 0.2 * START.p)
        scenario = fk.Scenario(
            FORCES, start, 3.0, frames=301, bodies=fk.Limited(body, speed=speed), tolerance=1e-10
        )  # fmt: skip
        found = np.linalg.norm(fk.simulate(scenario, progress=False).p, axis=2)
        assert (found <= speed + 1e-9).all()
        # It acts: an agent rides at its largest speed for a while.
        assert (np.abs(found - speed) < 1e-8).sum() > 20


def test_a_force_that_is_never_reached_changes_nothing():
    free, limited = run_of(fk.PointMass()), run_of(fk.Limited(fk.PointMass(), force=1e6, speed=1e6))
    assert np.abs(free.q - limited.q).max() < 1e-9
    assert (limited.trace["departed"] == 0.0).all()


def clipped(u, most, shape="ball"):
    size = np.abs(u) if shape == "box" else np.linalg.norm(u, axis=1, keepdims=True)
    return u * np.minimum(1.0, most / np.maximum(size, 1e-300))


def integrated(law, order, motion, extra):
    """The end of a run by SciPy: ``motion`` gives the rates of velocity (or position) and of a further column."""
    blocks = order + extra
    start = np.concatenate([START.q, START.p, np.zeros((N, 2))][: 1 + (order == 2)] + [np.zeros((N, 2))] * extra)

    def slope(t, y):
        parts = list(y.reshape(blocks, N, 2))
        q, p = parts[0], parts[1] if order == 2 else np.zeros((N, 2))
        u = fk.control(law, fk.State(q, p, t))
        found = motion(u, p, parts[-1])
        return np.concatenate([*([p] if order == 2 else []), *found]).ravel()

    y = solve_ivp(slope, (0, 1.0), start.ravel(), rtol=1e-10, atol=1e-11, max_step=0.01, method="LSODA").y[:, -1]
    return y.reshape(blocks, N, 2)


positive = st.floats(0.2, 2.0)


@settings(max_examples=4, deadline=None)
@given(tau=st.tuples(positive, positive, positive), force=positive, rate=positive, damping=st.floats(0, 1))
@pytest.mark.parametrize("shape", ["ball", "box"])
def test_a_second_implementation_agrees(shape, tau, force, rate, damping):
    tau = np.array(tau)
    inside = fk.Lagged(fk.PointMass(np.array([1.0, 2.0, 0.5]), damping), tau)
    run = run_of(fk.Limited(inside, force=force, rate=rate, shape=shape), t_end=1.0)

    def motion(u, p, f):
        wanted = clipped(u, force, shape)
        return (f - damping * p) / np.array([[1.0], [2.0], [0.5]]), clipped((wanted - f) / tau[:, None], rate)

    expected = integrated(FORCES, 2, motion, 1)
    found = np.array([run.q[-1], run.p[-1], run.columns["applied"][-1]])
    assert np.abs(found - expected).max() < 1e-7
    assert np.abs(run.residual).max() < 1e-9 * max(1.0, run.turnover)


@settings(max_examples=4, deadline=None)
@given(speed=positive, tau=positive)
def test_a_second_implementation_agrees_for_order_1(speed, tau):
    for body, motion, extra in (
        (fk.Limited(fk.SingleIntegrator(), speed=speed), lambda u, p, f: (clipped(u, speed),), 0),
        (fk.Limited(fk.Lagged(fk.SingleIntegrator(), tau), speed=speed),
         lambda u, p, f: (clipped(f, speed), (u - f) / tau), 1),
    ):  # fmt: skip
        run = run_of(body, t_end=1.0)
        assert np.abs(run.q[-1] - integrated(FLOW, 1, motion, extra)[0]).max() < 1e-7
        assert np.abs(run.residual).max() < 1e-9 * max(1.0, run.turnover)


@pytest.mark.parametrize(
    "body",
    [
        fk.Lagged(fk.PointMass(), 0.3), fk.Limited(fk.PointMass(), force=0.5, speed=1.0),
        fk.Lagged(fk.SingleIntegrator(), 0.3), fk.Limited(fk.SingleIntegrator(), speed=0.4),
    ],
)  # fmt: skip
def test_the_ledger_has_what_departed(body):
    """Departed is the integral of m (a - a_wanted) . p, or of grad H . (q' - u): here by a rule of its own."""
    run = run_of(body, t_end=1.0)
    assert np.abs(run.residual).max() < 1e-9 * max(1.0, run.turnover)
    assert abs(run.trace["departed"][-1]) > 1e-2
    assert run.trace["supplied"] == pytest.approx(0.0, abs=1e-9)
    said = fk.evaluate(run.scenario.law, run.state(0), agents=body)
    step = run.trace[1]
    assert step["departed"] / step["time"] == pytest.approx(said.departure, rel=0.2, abs=1e-3)


@pytest.mark.parametrize("body", [fk.Lagged(fk.SingleIntegrator(), 0.3), fk.Limited(fk.SingleIntegrator(), speed=0.4)])
def test_the_ledger_of_order_1_closes_where_the_law_supplies_energy(body):
    law = fk.Law(
        FLOW.graph, [*FLOW.terms, fk.Track(fk.Path(["sin(t)", "0.3*t"]), position_gain=0.7, velocity_gain=0.5)]
    )
    run = run_of(body, law)
    assert np.abs(run.trace["supplied"]).max() > 1e-2
    assert np.abs(run.residual).max() < 1e-9 * max(1.0, run.turnover)
    state = run.state(2)
    said = fk.evaluate(law, state, agents=body)
    step = 1e-5
    ahead = fk.simulate(
        fk.Scenario(law, state, state.t + step, frames=2, bodies=body, tolerance=1e-12), progress=False
    )  # fmt: skip
    assert ahead.trace["departed"][-1] / step == pytest.approx(said.departure, rel=1e-3, abs=1e-6)
    assert ahead.trace["supplied"][-1] / step == pytest.approx(said.supply, rel=1e-3, abs=1e-6)


def test_what_departs_is_judged_by_the_energy_of_another_run():
    """A lag that departs from a law with no damping: what is missing from the energy of the ideal is what departed."""
    law = fk.Law(fk.Fixed.complete(N), [fk.Gradient(fk.Potential("(r - 1)**2"))])
    run = run_of(fk.Lagged(fk.PointMass(), 0.3), law)
    kinetic = 0.5 * (run.p[-1] ** 2).sum()
    distances = np.array([np.linalg.norm(run.q[-1, i] - run.q[-1, j]) for i, j in ((0, 1), (0, 2), (1, 2))])
    energy = kinetic + ((distances - 1) ** 2).sum()
    assert run.trace["departed"][-1] == pytest.approx(energy - run.trace["energy"][0], abs=1e-9)


CHAIN = fk.Limited(fk.Lagged(fk.PointMass(), [0.2, 0.3, 0.4]), force=1.0, rate=2.0, speed=[0.9, 1.0, 1.1])


def test_chains_go_through_files():
    scenario = fk.Scenario(FORCES, START, 1.0, bodies=CHAIN)
    data = json.loads(json.dumps(to_data(scenario)))
    again = parse_scenario(scenario_to_text(scenario))
    assert to_data(from_data(data)) == to_data(again) == to_data(scenario)
    assert again.agents.body.time_constant.tolist() == [0.2, 0.3, 0.4]


def test_stored_and_saved_runs_go_on_with_the_same_bits(tmp_path):
    scenario = fk.Scenario(FORCES, START, 2.0, frames=11, bodies=CHAIN)
    whole = fk.simulate(scenario, progress=False, save=tmp_path / "run")
    assert fk.first_difference(whole, fk.read_run(tmp_path / "run")) is None
    # At 0.7 limits act that the state alone does not tell.
    for stop in (0.3, 0.7, 1.2):
        session = ExactSession(scenario)
        session.advance(stop)
        packed = session.pack()
        other = ExactSession.resume(session.snapshot())
        acting = session.snapshot().limits
        assert acting.any()
        assert np.array_equal(other.snapshot().limits, acting)
        other.advance(2.0)
        assert fk.first_difference(other.run(), whole) is None
        assert packed[1]["limits"].shape == (3, N)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: fk.Lagged(fk.PointMass(), 0.0), "Lagged: time_constant must be greater than 0"),
        (lambda: fk.Lagged(3, 1.0), "Lagged: body must be a body"),
        (lambda: fk.Lagged(fk.Lagged(fk.PointMass(), 1.0), 1.0), "column of the same name"),
        (lambda: fk.Limited(fk.PointMass()), "Limited: force must be given where"),
        (lambda: fk.Limited(fk.PointMass(), force=-1.0), "Limited: force must be greater than 0"),
        (lambda: fk.Limited(fk.SingleIntegrator(), force=1.0), "must not be given for a body of order 1"),
        (lambda: fk.Limited(fk.PointMass(), rate=1.0), "for a lagged body alone.*A force that jumps"),
        (lambda: fk.Limited(fk.SingleIntegrator(), rate=1.0), "for a lagged body alone.*A velocity that jumps"),
        (lambda: fk.Limited(fk.PointMass(), force=1.0, shape="star"), "shape"),
        (lambda: fk.Scenario(FORCES, START, 1.0, bodies=fk.Limited(fk.PointMass(), force=[1.0, 2.0])), "force"),
    ],
)
def test_wrong_values_are_refused(make, says):
    with pytest.raises(fk.InvalidInput, match=says):
        make()


def test_pair_styles_of_lammps_refuse_them_by_name():
    with pytest.raises(fk.FlockingError, match="Limited agents, only point masses"):
        fk.simulate(fk.Scenario(FORCES, START, 1.0, bodies=CHAIN), engine="lammps", forces="pair styles")


def test_verdicts_say_that_the_agents_are_not_ideal():
    found = {r.claim.key: r for r in fk.audit(run_of(CHAIN)).results}
    for key in ("ledger", "momentum", "energy-falls"):
        assert str(found[key].verdict) == "not applicable"
        assert "actuators lag by 0.4" in found[key].note


def test_a_plant_is_refused():
    scenario = fk.Scenario(FORCES, START, 1.0, bodies=CHAIN)
    with pytest.raises(fk.InvalidInput, match="bodies that depart"):
        ExactSession(scenario, plant=FORCES)
    assert not Actuated().ideal
    assert fk.PointMass().ideal


def test_the_lab_changes_a_chain_while_it_runs():
    experiment = Experiment(fk.Scenario(FORCES, START, 2.0, bodies=CHAIN))
    experiment.advance(0.5)
    experiment.apply({"kind": "set", "path": ["agents", "body", "time_constant"], "value": 0.4})
    assert experiment.scenario.agents.body.time_constant == 0.4
    before = experiment.state.columns["applied"]
    experiment.apply({"kind": "add", "q": [2.0, 2.0], "p": [0.0, 0.0]})
    assert np.abs(experiment.state.columns["applied"][:3] - before).max() < 1e-12
    assert experiment.scenario.agents.speed.shape == (4,)
    experiment.advance(0.8)
