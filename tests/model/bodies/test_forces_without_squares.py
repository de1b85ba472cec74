"""Forces whose squares are no floating-point numbers are scaled back as others are, or end a run: none becomes zero."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import FlockingError, InvalidInput, NotFinite, StepTooSmall

BODIES = {
    "points": fk.Limited(fk.PointMass(), force=1.0),
    "lagged": fk.Limited(fk.Lagged(fk.PointMass(), 0.1), force=1.0),
    "first order": fk.Limited(fk.SingleIntegrator(), speed=1.0),
}


def scenario(pull: float, bodies: fk.Body, **world: object) -> fk.Scenario:
    """Two agents that pull at each other along the diagonal."""
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("k*r", k=pull))])
    start = fk.State([[0.0, 0.0], [1.0, 1.0]])
    return fk.Scenario(law, start, t_end=0.1, frames=2, bodies=bodies, **world)


def moved(pull: float, bodies: fk.Body, *, held: bool, **options: object) -> np.ndarray:
    world = {"control": fk.Held(0.1)} if held else {}
    return fk.simulate(scenario(pull, bodies, **world), progress=False, **options).q[-1, 0]


@pytest.mark.parametrize("name", BODIES)
def test_a_held_force_is_scaled_back_whatever_its_size(name):
    tiled = {"engine": "tiles", "step": 0.01, "ledger": False}
    for options in ({"engine": "sampled"}, tiled):
        usual = moved(10.0, BODIES[name], held=True, **options)
        assert usual[0] > 1e-4
        for pull in (1e160, 1e300):
            np.testing.assert_allclose(moved(pull, BODIES[name], held=True, **options), usual, rtol=1e-9)


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize(
    ("engine", "pull"), [("exact", 1e160), ("tiles", 1e160), ("tiles 32", 1e22), ("delayed", 1e160)]
)
def test_a_continuous_force_without_a_square_ends_the_run(name, engine, pull):
    """Numbers of single precision end at 3e38."""
    options: dict[str, object] = {"engine": engine.split()[0]}
    if engine.startswith("tiles"):
        options |= {"step": 0.01, "ledger": False, "precision": "float32" if engine.endswith("32") else "float64"}
    world = {"information": fk.Delayed(0.01)} if engine == "delayed" else {}
    with pytest.raises(FlockingError):
        fk.simulate(scenario(pull, BODIES[name], **world), progress=False, **options)


def test_the_agent_and_the_limit_are_named():
    with pytest.raises(NotFinite, match=r"the limit 'force' of agent 0 .* square is no number"):
        fk.simulate(scenario(1e160, BODIES["points"]), engine="exact", progress=False)


@pytest.mark.parametrize("engine", ["exact", "tiles"])
def test_quadrotors_do_not_ignore_a_force_without_a_square(engine):
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("k*r", k=1e160))])
    start = fk.State([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
    with pytest.raises(FlockingError):
        fk.simulate(fk.Scenario(law, start, t_end=0.01, frames=2, bodies=fk.Quadrotor()), engine=engine, progress=False)


@pytest.mark.parametrize("value", [1e160, [1.0, 1e200]])
@pytest.mark.parametrize("name", ["force", "speed"])
def test_limits_without_squares_are_refused(name, value):
    with pytest.raises(InvalidInput, match=f"Limited: {name} must be at most 1e"):
        fk.Limited(fk.PointMass(), **{name: value})


@pytest.mark.parametrize("engine", ["exact", "delayed"])
def test_a_first_step_without_a_length_is_refused_in_words(engine):
    """Slopes of 1e149 have squares, and in units of the tolerance they have none: the guess of a first step is zero."""
    world = {"information": fk.Delayed(0.01)} if engine == "delayed" else {}
    with pytest.raises(StepTooSmall, match="no first step is short enough"):
        fk.simulate(scenario(1.0, fk.Lagged(fk.PointMass(), 1e-149), **world), engine=engine, progress=False)


def test_lags_and_gusts_without_squares_are_refused_by_name():
    for shortest in (1e-320, np.array([0.1, 1e-151])):
        with pytest.raises(InvalidInput, match=r"Lagged: time_constant must be at least 1e-150; got .* Leave out"):
            fk.Lagged(fk.PointMass(), shortest)
    for largest in (1e141, np.array([0.0, 1.7e308])):
        with pytest.raises(InvalidInput, match=r"Disturbed: sigma must be at most 1e\+140; got .* Choose other units"):
            fk.Disturbed(fk.PointMass(), largest, 0.1)
