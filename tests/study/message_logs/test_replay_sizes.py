"""Forces that are weak, places far from the origin, and small units: what a second computation does not see is open."""

import dataclasses

import numpy as np
import pytest

import flocking as fk
from flocking.study.message_logs.integrated_motion import IntegratedForcedMotion

WORLDS = {
    "held": {"control": fk.Held(0.05), "information": fk.Messages(0.05, delay=0.03, loss=0.2, seed=2)},
    "held, present known": {"control": fk.Held(0.05)},
    "messages": {"information": fk.Messages(0.05, delay=0.03, loss=0.2, seed=2)},
    "delayed": {"information": fk.Delayed(0.07)},
}


def scenario(world, *, length=1.0, away=0.0, gain=1.0, order=2, graph=None):
    """Five agents within 3 lengths of each other, ``away`` lengths from the origin."""
    rng = np.random.default_rng(3)
    terms = [fk.Gradient(fk.Potential("k*(r - d)**2/2", k=1.5 * gain, d=length))]
    if order == 2:
        terms.append(fk.Consensus(0.8 * gain))
    speeds = 2.0 * length * rng.normal(size=(5, 2)) if order == 2 else np.zeros((5, 2))
    start = fk.State(length * (away + rng.uniform(0, 3, (5, 2))), speeds)
    agents = fk.PointMass() if order == 2 else fk.SingleIntegrator()
    law = fk.Law(graph or fk.Complete(), terms)
    return fk.Scenario(law, start, t_end=0.3, frames=13, agents=agents, **WORLDS[world])


def ran(made):
    return fk.simulate(made, progress=False)


def stronger(run):
    """Forces of the second half of the log are 1 % stronger than those of the law."""
    forces = run.log.forces.copy()
    forces[len(forces) // 2 :] *= 1.01
    return dataclasses.replace(run, log=dataclasses.replace(run.log, forces=forces))


def wider(run):
    """From the middle on, agents are 1 % further from the centre."""
    q = run.q.copy()
    centre = q[0].mean(axis=0)
    q[6:] = centre + 1.01 * (q[6:] - centre)
    return dataclasses.replace(run, q=q)


@pytest.mark.parametrize("world", ["held", "held, present known"])
@pytest.mark.parametrize(
    "sizes", [{"gain": 1e-8}, {"away": 1e9}, {"away": 1e9, "order": 1}, {"length": 1e-9, "gain": 1e-6}], ids=str
)
def test_under_held_control_one_per_cent_is_seen(world, sizes):
    run = ran(scenario(world, **sizes))
    found = fk.replay(run)
    assert found.agrees, str(found)
    assert found.undecided == 0
    assert not fk.replay(stronger(run)).agrees
    assert not fk.replay(wider(run)).agrees
    plant = ran(scenario(world, **(sizes | {"gain": 1.01 * sizes.get("gain", 1.0)})))
    assert not fk.replay(dataclasses.replace(plant, scenario=run.scenario)).agrees


@pytest.mark.parametrize(("world", "length"), [("messages", 1e-9), ("delayed", 1e-8)])
def test_what_errors_of_steps_hide_is_open(world, length):
    """Tolerances of these engines are absolute: such lengths are not resolved by them, by more or by less."""
    run = ran(scenario(world, length=length))
    assert fk.replay(run).agrees
    plant = ran(scenario(world, length=length, gain=1.01))
    changed = [stronger(run), dataclasses.replace(plant, scenario=run.scenario)]
    for wrong in [*changed, *([wider(run)] if world == "messages" else [])]:
        found = fk.replay(wrong)
        assert not found.agrees or found.undecided >= 3, str(found)


def test_a_place_is_judged_in_large_units_as_in_others():
    """What agents go in a nanosecond is a length of the run, and no share of lengths."""
    run = ran(scenario("messages", length=1e6).with_(t_end=0.035, frames=2))
    found = fk.replay(run)
    assert found.agrees, str(found)
    assert found.undecided == 0
    q, p = run.q.copy(), run.p.copy()
    q[1, 2, 1] += 10.0
    p[1, 3, 1] += 10.0
    assert not fk.replay(dataclasses.replace(run, q=q)).agrees
    assert not fk.replay(dataclasses.replace(run, p=p)).agrees


@pytest.mark.parametrize("world", ["messages", "delayed"])
def test_weak_forces_are_judged(world):
    run = ran(scenario(world, gain=1e-8))
    found = fk.replay(run)
    assert found.agrees, str(found)
    assert found.undecided == 0
    assert not fk.replay(stronger(run)).agrees


def test_a_wrong_weak_force_is_named_in_digits_that_show_it():
    run = ran(scenario("held", gain=1e-8))
    assert "[0.0, 0.0]" not in str(fk.replay(stronger(run)))


@pytest.mark.parametrize("away", [1e7, 1e9])
def test_far_from_the_origin_the_second_integration_takes_no_endless_steps(away, monkeypatch):
    """Forces are rounded as positions are, by more than the tolerance of steps at the origin."""
    run = ran(scenario("messages", away=away))
    steps = []
    stretch = IntegratedForcedMotion._stretch

    def counted(self, begin, end, y):
        steps.append(self._steps)
        assert self._steps < 5_000
        return stretch(self, begin, end, y)

    monkeypatch.setattr(IntegratedForcedMotion, "_stretch", counted)
    found = fk.replay(run)
    assert found.agrees, str(found)
    assert len(steps) > 10
    wrong = fk.replay(stronger(run))
    assert not wrong.agrees or wrong.undecided >= 3


@pytest.mark.parametrize(
    "agents", [fk.Lagged(fk.PointMass(), 0.2), fk.Limited(fk.Lagged(fk.PointMass(), 0.2), speed=9.0)]
)
@pytest.mark.parametrize("frame", [6, -1])
def test_lagged_forces_at_frames_are_compared(agents, frame):
    run = ran(scenario("held").with_(agents=agents))
    assert fk.replay(run).agrees
    columns = {name: values.copy() for name, values in run.columns.items()}
    columns["applied"][frame] *= 1.01
    assert not fk.replay(dataclasses.replace(run, columns=columns)).agrees
