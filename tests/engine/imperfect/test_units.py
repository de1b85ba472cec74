"""A motion is the same in every unit of length, time and mass: only its numbers change."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flocking as fk

WORLDS = {
    "exact": lambda length, time: {},
    "delayed": lambda length, time: {"information": fk.Delayed(0.1 * time)},
    "sampled": lambda length, time: {"control": fk.Held(0.1 * time), "information": fk.Messages(0.1 * time)},
}
"""What is imperfect beside the engine that computes it, in units of ``length`` and ``time``."""

UNITS = [
    (1e-3, 1.0, 1.0), (1e-6, 1.0, 1.0), (1e-12, 1.0, 1.0), (1e9, 1.0, 1.0), (1.0, 1e-6, 1.0), (1.0, 1e6, 1.0),
    (1.0, 1.0, 1e-9), (1e-9, 1e-6, 1e-15),
]  # fmt: skip
"""Lengths, times and masses that are called 1."""


def motion(engine, length=1.0, time=1.0, mass=1.0, *, rest=False, body=fk.PointMass):
    """A run of eight agents with switching links, in given units."""
    rng = np.random.default_rng(0)
    q, p = rng.uniform(0, 5, (8, 2)) * length, rng.normal(size=(8, 2)) * length / time * (not rest)
    stiff, drag = 1.5 * mass / time**2, 0.4 * mass / time
    if body is fk.SingleIntegrator:
        # What pulls is a velocity there, not a force.
        stiff, drag = 1.5 / time, 0.0
    terms = [fk.Gradient(fk.Potential("k*(r - d)**2/2", k=stiff, d=length)), *[fk.Consensus(drag)] * (drag > 0.0)]
    agents = fk.SingleIntegrator() if body is fk.SingleIntegrator else fk.PointMass(masses=mass)
    start = fk.State(q, p if body is fk.PointMass else np.zeros_like(q))
    scenario = fk.Scenario(
        fk.Law(fk.Proximity(3.0 * length), terms), start, t_end=6.0 * time, frames=7, agents=agents,
        **WORLDS[engine](length, time),
    )  # fmt: skip
    return fk.simulate(scenario, engine=engine, progress=False)


@cache
def in_ones(engine):
    """The motion in units of 1."""
    return motion(engine)


@pytest.mark.parametrize(
    ("engine", "length", "time", "mass"),
    [("exact", *unit) for unit in UNITS]
    + [(engine, *unit) for engine in ("delayed", "sampled") for unit in UNITS[1::3]],
)
def test_positions_velocities_and_links_are_those_of_other_units(engine, length, time, mass):
    """Errors of 1e-9 of the group accumulate over the run: tenfold here, see `Scenario.tolerance`."""
    whole, run = in_ones(engine), motion(engine, length, time, mass)
    assert np.abs(run.q / length - whole.q).max() < 1e-8
    assert np.abs(run.p * time / length - whole.p).max() < 1e-8
    assert len(run.switches) == len(whole.switches) > 10


@pytest.mark.parametrize(("length", "time"), [(1e-6, 1.0), (1e-12, 1.0), (1e-9, 1e-6), (1.0, 1e6)])
@pytest.mark.parametrize("body", [fk.PointMass, fk.SingleIntegrator])
def test_a_group_at_rest_has_the_size_of_its_distances(body, length, time):
    whole, run = motion("exact", rest=True, body=body), motion("exact", length, time, rest=True, body=body)
    assert np.abs(run.q / length - whole.q).max() < 1e-7


@pytest.mark.parametrize("length", [1e-6, 1e-12])
def test_the_ledger_closes_as_it_does_in_other_units(length):
    whole, run = motion("exact"), motion("exact", length)
    scale = max(float(np.abs(whole.trace[name]).max()) for name in ("energy", "dissipated"))
    for name in ("energy", "kinetic", "work", "dissipated", "jumped"):
        assert abs(run.trace[name][-1] / length**2 - whole.trace[name][-1]) < 1e-8 * scale


@pytest.mark.parametrize("gap", [1e-3, 1e-12])
@pytest.mark.parametrize("offset", [0.0, 1000.0])
def test_agents_almost_in_one_place_at_rest_fly_apart(gap, offset):
    """Their distances say nothing of the size of the motion; it is computed as it is from one place of others."""
    q = np.array([[0.0, 0.0], [gap, 0.0], [0.0, 2.0 * gap]]) + offset
    law = fk.Law(fk.Proximity(5.0), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(0.4)])
    run = fk.simulate(fk.Scenario(law, fk.State(q, 0.0 * q), t_end=10.0, frames=2), engine="exact", progress=False)
    distances = np.linalg.norm(run.q[-1] - np.roll(run.q[-1], 1, axis=0), axis=1)
    assert np.abs(distances - 1.0).max() < 0.1


@pytest.mark.parametrize("length", [1.0, 1e-6, 1e-9])
@pytest.mark.parametrize("jump", [0.0, 0.5])
def test_jumps_of_potentials_are_in_the_ledger_in_every_unit(length, jump):
    """Two agents leave each other through a distance where the potential jumps, or where its slope does."""
    formula = "where(r < b, (r - b)**2 + J, 0)"
    psi = fk.Potential(formula, b=2.0 * length, J=jump * length**2)
    start = fk.State(np.array([[0.0, 0.0], [1.0, 0.0]]) * length, np.array([[-1.0, 0.0], [1.0, 0.0]]) * length)
    scenario = fk.Scenario(fk.Law(fk.Complete(), [fk.Gradient(psi)]), start, t_end=3.0, frames=4)
    run = fk.simulate(scenario, engine="exact", progress=False)
    trace = run.trace
    assert trace["jumped"][-1] == pytest.approx(-jump * length**2, abs=1e-9 * length**2)
    gap = trace["energy"][-1] - trace["energy"][0] - trace["jumped"][-1] + trace["dissipated"][-1]
    assert abs(gap) < 1e-8 * length**2
    assert np.linalg.norm(run.q[-1, 0] - run.q[-1, 1]) > 2.0 * length


@pytest.mark.parametrize(("length", "time"), [(1.0, 1e-6), (1e-9, 1e-6), (1e-6, 1.0)])
def test_limits_begin_and_end_at_the_same_times_in_every_unit(length, time):
    """Agents in a row with a largest speed, which begins and ends to act in motion."""

    def moved(length, time):
        q = np.array([[0.0, 0.0], [2.5, 0.1], [4.6, -0.2]]) * length
        psi = fk.Potential("k*(r - d)**2/2", k=2.0 / time**2, d=length)
        body = fk.Limited(fk.PointMass(damping=0.1 / time), speed=length / time)
        law = fk.Law(fk.Complete(), [fk.Gradient(psi)])
        scenario = fk.Scenario(law, fk.State(q, 0.0 * q), t_end=6.0 * time, frames=25, agents=body)
        return fk.simulate(scenario, engine="exact", progress=False)

    whole, run = moved(1.0, 1.0), moved(length, time)
    speeds = np.linalg.norm(whole.p, axis=2)
    assert (speeds > 1.0 - 1e-9).any()
    assert (speeds[8:] < 0.9).any()
    assert np.abs(run.q / length - whole.q).max() < 1e-7
