"""Poles of a leader's velocity are found before a run, by name and time; finite velocities are left alone."""

import numpy as np
import pytest

import flocking as fk
from flocking.model.leaders_and_obstacles.unbounded_velocities import unbounded_at


@pytest.mark.parametrize(
    ("velocity", "t"),
    [
        ("1/(2.5 - t)", 2.5), ("1/(t - 2.5)**2", 2.5), ("1/(t - 3.14159)", 3.14159), ("sqrt(2 - t)", 2.0),
        ("1/sqrt(abs(t - 2))", 2.0), ("tan(t)", np.pi / 2), ("log(t)", 0.0), ("1/t", 0.0), ("1/(5 - t)", 5.0),
        ("log(abs(t - 1.7))", 1.7), ("where(t < 2, t, 1/(t - 2.1))", 2.1), ("1/(t - 2.5) + 1/(t - 1.3)", 1.3),
        ("1e-4/(t - 1.1)", 1.1), ("(t - 1.23456789)**-3", 1.23456789),
    ],
)  # fmt: skip
def test_poles_are_found(velocity, t):
    found = unbounded_at(fk.Path(["1", velocity]), 0.0, 5.0)
    assert found == pytest.approx(t, abs=1e-7)


@pytest.mark.parametrize(
    "velocity",
    [
        "sin(t)", "sqrt(t)", "sin(t - 2.5)/(t - 2.5)", "1/((t - 2)**2 + 1e-6)", "where(t < 2, t, 1/(t - 1))",
        "abs(t - 1)**0.5", "exp(t**4)", "1/(6 - t)", "where(sin(50*t) > 0, 1, -1)", "atan(1/(t - 2.1))",
        "tanh(1e6*(t - 2))", "1/(t + 0.001)", "log(abs(t - 1.7) + 1e-5)",
    ],
)  # fmt: skip
def test_finite_velocities_are_left_alone(velocity):
    assert unbounded_at(fk.Path([velocity, "0"]), 0.0, 5.0) is None


def test_times_outside_the_run_do_not_count():
    path = fk.Path(["1/(2.5 - t)", "0"])
    assert unbounded_at(path, 0.0, 2.4) is None
    assert unbounded_at(path, 2.6, 9.0) is None
    assert unbounded_at(path, 1e3, 1e6) is None
    assert unbounded_at(fk.Sink([1.0, 2.0]), 0.0, 1e9) is None


@pytest.mark.parametrize("world", [{}, {"control": fk.Held(0.1)}, {"information": fk.Delayed(0.1)}])
def test_runs_name_the_leader_and_the_time_before_they_begin(world):
    path = fk.Path(["1/(2.5 - t)", "0"])
    law = fk.Law(fk.Fixed.complete(3), [fk.Consensus(0.4), fk.Track(path, 0.0, 1.0, 0.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    with pytest.raises(fk.InvalidInput, match=r"Path: velocity must be real and finite .* at t = 2\.5"):
        fk.start(fk.Scenario(law, start, t_end=5.0, frames=6, **world))


def test_the_leader_of_the_energy_is_looked_at_too():
    law = fk.Law(fk.Fixed.complete(2), [fk.Consensus(0.4)])
    energy = fk.Energy("leader", fk.Path(["tan(t)", "0"]))
    with pytest.raises(fk.InvalidInput, match=r"at t = 1\.5708"):
        fk.start(fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=5.0, frames=6, energy=energy))
