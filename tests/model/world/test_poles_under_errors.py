"""Potentials with poles under noise and rounding: what is warned of, what a failed run names, and what a floor does."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import flocking as fk
from flocking.errors import NotFinite, SuspectInput
from flocking.study.margins.worlds import world_in_words

START = fk.State([[0.0, 0.0], [1.5, 0.0], [0.7, 1.2]], np.zeros((3, 2)))
SINGULAR = fk.Potential("1/r + 1/(3 - r)")
FLOOR = fk.Potential("where(r < 0.5, 3 - 4*r**2, where(r < 2.5, 1/r, 0.4 + 0.032*(6.25 - r**2)))")
"""1/r from 0.5 to 2.5, continued by psi(d) + psi'(d) (r**2 - d**2)/(2 d) on both sides: by 2 - 4 (r**2 - 1/4) below."""


def scenario(potential: fk.Potential, graph: fk.Graph | None = None, **known: object) -> fk.Scenario:
    law = fk.Law(graph or fk.Proximity(3.0), [fk.Gradient(potential), fk.Consensus(1.0)])
    return fk.Scenario(law, START, t_end=1.0, frames=3, control=fk.Held(0.1), information=fk.Messages(0.1, **known))


@pytest.mark.parametrize(
    ("known", "errors"),
    [({"noise": 0.3}, "noise of 0.3 in positions"), ({"resolution": 1.0}, "positions rounded to 1")],
)
def test_errors_of_positions_and_poles_are_named_together(known: dict[str, object], errors: str) -> None:
    with pytest.warns(SuspectInput, match="pole") as found:
        case = scenario(SINGULAR, **known)
    assert len(found) == 1
    said = str(found[0].message)
    assert f"with {errors} known distances may come arbitrarily near the poles at 0 and 3 of {SINGULAR!r}" in said
    assert "psi(d) + psi'(d) (r**2 - d**2)/(2 d)" in said
    assert found[0].filename == __file__
    assert case.unbounded_forces
    assert case.unbounded_forces in said


@pytest.mark.parametrize(
    ("potential", "radius", "poles"),
    [("1/r", 2.0, "the pole at 0 of"), ("1/r + 1/(3 - r)", 2.5, "the pole at 0 of"), ("-log(3 - r)", 3.0, "at 3 of")],
)
def test_only_poles_within_the_radius_count(potential: str, radius: float, poles: str) -> None:
    with pytest.warns(SuspectInput):
        assert poles in scenario(fk.Potential(potential), fk.Proximity(radius), noise=0.1).unbounded_forces


def test_nothing_is_warned_of_without_poles_or_without_errors_of_positions() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cases = [
            scenario(FLOOR, noise=0.3), scenario(FLOOR, resolution=1.0), scenario(SINGULAR, delay=0.1, loss=0.2),
            scenario(SINGULAR, noise=fk.WhiteNoise(0.0, 0.3)), scenario(SINGULAR, velocity_resolution=0.1),
        ]  # fmt: skip
    assert not any(case.unbounded_forces for case in cases)


def test_a_run_that_fails_at_a_pole_names_potential_and_rounding() -> None:
    with pytest.warns(SuspectInput):
        case = scenario(SINGULAR, resolution=1.0, self_known="measured").with_(
            start=fk.State([[0.1, 0.0], [0.4, 0.0], [5.0, 0.0]], np.zeros((3, 2)))
        )
    with pytest.raises(NotFinite, match=r"infinite or NaN: with positions rounded to 1 .*the poles at 0 and 3"):
        fk.simulate(case.with_(t_end=2.0))


def test_the_floor_of_the_message_keeps_value_and_slope_and_bounds_the_force() -> None:
    inverse, stated = fk.Potential("1/r"), fk.Potential("where(r < 0.1, 15 - 500*r**2, 1/r)")
    for case, at in ((stated, 0.1), (FLOOR, 0.5), (FLOOR, 2.5)):
        for side in (at * (1 - 1e-12), at * (1 + 1e-12)):
            assert float(case(side)) == pytest.approx(float(inverse(side)), rel=1e-9)
            assert float(case.slope(side)) == pytest.approx(float(inverse.slope(side)), rel=1e-9)
    assert np.abs(stated.slope(np.linspace(0.0, 5.0, 1001))).max() <= 100.0 * (1 + 1e-9)
    assert float(stated.slope(0.0)) == 0.0


def test_with_a_floor_runs_with_noise_and_rounding_end() -> None:
    for known in ({"noise": 0.3}, {"resolution": 1.0, "self_known": "measured"}):
        assert fk.simulate(scenario(FLOOR, **known)).finished


def test_tables_of_margins_say_what_levels_rest_on() -> None:
    for potential, expected in ((SINGULAR, True), (FLOOR, False)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            said = world_in_words(scenario(potential, noise=0.3))
        assert ("rests on the distances that were drawn" in said) == expected
        assert said.startswith("messages every 0.1, noise of 0.3")
