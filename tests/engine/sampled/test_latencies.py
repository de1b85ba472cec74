"""Latencies of each agent, against one latency of all, a closed form, and a stored run."""

import tomllib

import numpy as np
import pytest

import flocking as fk
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.protocol.session import Stored
from flocking.engine.protocol.waiting_forces import put
from flocking.engine.sampled.session import SampledSession
from flocking.errors import InvalidInput
from tests.engine.sampled.test_independent import random_world

BODIES = {
    "points": fk.PointMass(damping=0.3),
    "order 1": fk.SingleIntegrator(),
    "a chain": fk.Limited(fk.Disturbed(fk.Lagged(fk.PointMass(), 0.1), 0.3, 0.07, 3), force=2.0),
    "integrated": fk.Lagged(fk.Limited(fk.PointMass(), force=1.5), 0.1),
}


def made(latency, body=BODIES["points"], **world):
    law = fk.Law(fk.Hysteresis(3.0, 0.3), [fk.Gradient(fk.Potential("(r - 2)**2")), *_velocities(body)])
    start = fk.start.box(6, side=4, speed=1.0, seed=2)
    return fk.Scenario(
        law, start, t_end=1.0, frames=5, bodies=body, control=fk.Held(0.05, phase=0.01, latency=latency), **world
    )


def _velocities(body):
    return [] if body.order == 1 else [fk.Consensus(0.5)]


@pytest.mark.parametrize("heard", [{}, {"information": fk.Messages(0.05, delay=0.02, loss=0.2)}], ids=["", "messages"])
@pytest.mark.parametrize("latency", [0.0, 0.07])
@pytest.mark.parametrize("body", [BODIES[name] for name in ("points", "order 1", "a chain")])
def test_equal_latencies_give_the_bits_of_one(body, latency, heard):
    one, each = (fk.simulate(made(x, body, **heard), progress=False) for x in (latency, [latency] * 6))
    assert fk.first_difference(one, each) is None
    assert (one.trace == each.trace).all()


def test_one_agent_that_is_called_back_late():
    """x'' = -k x sampled at ticks, each force acting a latency later: the recursion over ticks, in closed form.

    Two agents on a line, linked by a spring, of which the second is so heavy that it stays: the first has half a period
    of latency, the second none.
    """
    period, late, k = 0.2, 0.05, 3.0
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("k*r**2/2", k=k))])
    start = fk.State([[1.0], [0.0]], [[0.0], [0.0]])
    scenario = fk.Scenario(
        law, start, t_end=4.0, frames=21, agents=fk.PointMass([1.0, 1e30]),
        control=fk.Held(period, latency=[late, 0.0]),
    )  # fmt: skip
    x, v, u, expected = 1.0, 0.0, 0.0, [1.0]
    for _ in range(20):
        new = -k * x
        for s, a in ((late, u), (period - late, new)):
            x, v = x + v * s + a * s * s / 2, v + a * s
        u = new
        expected.append(x)
    run = fk.simulate(scenario, progress=False)
    assert run.q[:, 0, 0] == pytest.approx(expected, abs=1e-12)
    assert abs(expected[-1]) > 0.1


def test_before_its_latency_has_passed_an_agent_applies_no_force():
    control = fk.Held(0.5, phase=[0.0, 0.3], latency=[0.4, 0.1])
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2"))])
    session = fk.start(fk.Scenario(law, fk.State([[0.0], [2.0]]), t_end=1, control=control))
    for t, first, second in ((0.39, 0.0, 0.0), (0.401, 2.0, -2.0), (0.85, 2.0, -2.0)):
        session.advance(t)
        assert session.accelerations()[:, 0] == pytest.approx([first, second], abs=1e-9)


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_runs_are_resumed_and_computed_a_second_time(body, tmp_path):
    scenario = made(0.05 * np.arange(6) / 2, body, information=fk.Messages(0.05, delay=0.02))
    whole = fk.simulate(scenario, save=tmp_path / "run", progress=False)
    session = fk.start(scenario)
    session.advance(0.4321)
    again = session.moment()()
    again.advance(1.0)
    assert fk.first_difference(again.run(), whole) is None
    assert fk.replay(whole).agrees
    assert (fk.read_run(tmp_path / "run").scenario.control.latency == scenario.control.latency).all()


def test_a_log_that_forgets_whose_latency_it_is_is_wrong():
    """The second computation sees forces that act at another agent's time."""
    run = fk.simulate(made([0.0, 0.02, 0.04, 0.01, 0.06, 0.03]), progress=False)
    assert fk.replay(run).agrees
    turned = run.scenario.with_(control=fk.Held(0.05, phase=0.01, latency=[0.02, 0.0, 0.04, 0.01, 0.06, 0.03]))
    wrong = fk.replay(fk.simulate(turned, progress=False))
    assert wrong.agrees
    object.__setattr__(run, "scenario", turned)
    assert not fk.replay(run).agrees


def test_crafted_forces_that_wait_are_refused():
    scenario, _ = random_world(301, late=True)
    session = SampledSession(scenario)
    session.advance(0.97)
    numbers, arrays = session.pack()
    assert len(arrays["waiting_time"]) > 2
    stored = Stored(session.scenario, None, session.records.counts, lambda: session.run("unfinished"))
    SampledSession.unpack((numbers, dict(arrays)), stored, {})
    for name in ("waiting_time", "waiting_agent"):
        with pytest.raises(MalformedError, match=name):
            SampledSession.unpack((numbers, {**arrays, name: arrays[name][::-1]}), stored, {})


def test_forces_wait_in_the_order_of_their_times_and_agents():
    """In whatever order they come, against sorting."""
    rng, waiting, every = np.random.default_rng(0), [], []
    for _ in range(60):
        when, agents = int(rng.integers(8)), np.flatnonzero(rng.random(9) < 0.4)
        agents = np.array([a for a in agents if (when, a) not in {(t, b) for t, b, _ in every}], dtype=np.int64)
        force = rng.normal(size=(len(agents), 2))
        put(waiting, when, agents, force)
        every += [(when, int(a), tuple(u)) for a, u in zip(agents, force, strict=True)]
    found = [(t, int(a), tuple(u)) for t, who, what in waiting for a, u in zip(who, what, strict=True)]
    assert found == sorted(every)
    assert len({t for t, _, _ in waiting}) == len(waiting)


@pytest.mark.parametrize(
    ("latency", "said"),
    [
        ([0.1, -0.1], "Held: latency must be at least 0"), ([0.1, 0.2, 0.3], "Held: latency"), ([], "Held: latency"),
        ([0.0, 1e9], "Held: latency must be at most"), ([[0.1, 0.2]], "Held: latency"),
    ],
)  # fmt: skip
def test_wrong_latencies_are_refused_by_name(latency, said):
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2"))])
    with pytest.raises(InvalidInput, match=said):
        fk.Scenario(law, fk.State([[0.0], [2.0]]), t_end=1, control=fk.Held(0.1, latency=latency))


def test_the_file_of_a_scenario_names_them(tmp_path):
    scenario = made([0.0, 0.02, 0.04, 0.01, 0.06, 0.03])
    file = tmp_path / "a.toml"
    fk.write_scenario(scenario, file)
    assert tomllib.loads(file.read_text())["control"]["latency"] == [0.0, 0.02, 0.04, 0.01, 0.06, 0.03]
    assert (fk.read_scenario(file).control.latency == scenario.control.latency).all()


@pytest.mark.parametrize("latency", [0.02, [0.0, 0.02, 0.0, 0.0, 0.0, 0.0]])
def test_statements_without_latency_are_not_granted_with_that_of_one_agent(latency):
    """Of a period of held control, and of the filter: both are proven without any."""
    law = fk.Law(fk.Fixed.complete(6), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.State(np.random.default_rng(0).normal(size=(6, 2)))
    flow = fk.Scenario(law, start, t_end=1.0, agents=fk.SingleIntegrator(), control=fk.Held(0.01))
    assert fk.certify(flow)["period_in_world"].granted
    late = fk.certify(flow.with_(control=fk.Held(0.01, latency=latency)))["period_in_world"]
    assert not late.granted
    assert "latency" in str(late)
