"""Obstacles and agents that are fast for the length of a step: crossings are found once each, when they should be."""

from __future__ import annotations

from collections.abc import Iterator

import mpmath
import numpy as np
import pytest

import flocking as fk
from flocking.model.leaders_and_obstacles.leaders import Leader, Path

RANGE, RADIUS, DURATION = 0.2, 0.5, 10.0
REACH = mpmath.mpf(RADIUS) + mpmath.mpf(RANGE)
WORLDS = {"exact": {}, "sampled": {"control": fk.Held(1.0)}, "delayed": {"information": fk.Delayed(0.5)}}


@pytest.fixture(autouse=True)
def _forty_digits() -> Iterator[None]:
    with mpmath.workdps(40):
        yield


def blind(obstacle: fk.Obstacle) -> fk.Law:
    """An obstacle without a force."""
    term = fk.Avoid([obstacle], range=RANGE, repulsion_gain=0.0, damping_gain=0.0, gamma_agents=False)
    return fk.Law(fk.Proximity(0.7), [term])


def off(found: np.ndarray, expected: list[mpmath.mpf]) -> np.ndarray:
    """By how much switches are late; there are as many as expected."""
    assert len(found) == len(expected)
    return np.array([abs(float(mpmath.mpf(float(t)) - x)) for t, x in zip(found["time"], expected, strict=True)])


def agrees(obstacle: fk.Obstacle, world: str, expected: list[mpmath.mpf]) -> bool:
    """Whether an agent that rests beside the origin gets in and out of the range of an obstacle when it should."""
    start = fk.State([[0.0, 0.1]], [[0.0, 0.0]])
    scenario = fk.Scenario(blind(obstacle), start, t_end=DURATION, frames=11)
    found = fk.simulate(scenario.with_(**WORLDS[world]), progress=False).switches
    late = off(found, expected)
    # Rounding of the place of the obstacle is not in the error.
    return bool((late <= (1.1 * found["time_error"] if world == "exact" else 1e-8)).all())


def swinging(speed: float) -> Leader:
    """A place that goes to and fro, by twice the speed, from (-2, 0.1)."""
    return Path(["a*sin(t)", "0"], [-2.0, 0.1], a=speed)


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("speed", [1e1, 1e3, 1e5, 1e7])
def test_a_ball_that_swings_is_met_as_often_as_it_passes(world: str, speed: float) -> None:
    first = [mpmath.acos(1 - x / mpmath.mpf(speed)) for x in (2 - REACH, 2 + REACH)]
    turn = 2 * mpmath.pi
    expected = [*first, *(turn - t for t in first[::-1]), *(turn + t for t in first)]
    assert agrees(fk.Ball(swinging(speed), RADIUS), world, expected)


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("speed", [1e1, 1e3, 1e5, 1e7])
def test_a_wall_that_swings_is_met_once_at_each_passage(world: str, speed: float) -> None:
    first = mpmath.acos(1 - (2 - mpmath.mpf(RANGE)) / mpmath.mpf(speed))
    assert agrees(fk.Wall(swinging(speed), [1.0, 0.0]), world, [first, 2 * mpmath.pi - first, 2 * mpmath.pi + first])


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("speed", [1.0, 1e1, 1e3, 1e5, 1e7])
def test_a_ball_on_a_straight_line_is_met_and_left(world: str, speed: float) -> None:
    begin = -5.03 * speed
    middle, half = -mpmath.mpf(begin) / mpmath.mpf(speed), REACH / mpmath.mpf(speed)
    assert agrees(fk.Ball(fk.Velocity([speed, 0.0], [begin, 0.1]), RADIUS), world, [middle - half, middle + half])


@pytest.mark.parametrize("speed", [1.0, 1e1, 1e3, 1e5, 1e7])
@pytest.mark.parametrize("aside", [0.0, 0.3])
def test_agents_that_come_from_far_away_in_one_step_meet_when_they_should(speed: float, aside: float) -> None:
    """Squares of their distance keep no digit of the radius there."""
    begin = -5.03 * speed
    start = fk.State([[begin, 0.0], [0.0, aside]], [[speed, 0.0], [0.0, 0.0]])
    law = fk.Law(fk.Proximity(0.7), [fk.Consensus(1e-30)])
    found = fk.simulate(fk.Scenario(law, start, t_end=DURATION, frames=11), progress=False).switches
    half = mpmath.sqrt(mpmath.mpf(0.7) ** 2 - mpmath.mpf(aside) ** 2)
    late = off(found, [(-mpmath.mpf(begin) + side * half) / mpmath.mpf(speed) for side in (-1, 1)])
    assert (late <= found["time_error"]).all()
    assert late[1] <= 1e-13


@pytest.mark.parametrize("speed", [1.0, 1e1, 1e3, 1e5])
def test_an_agent_that_comes_from_far_away_meets_a_ball_when_it_should(speed: float) -> None:
    begin = -5.03 * speed
    start = fk.State([[begin, 0.0]], [[speed, 0.0]])
    scenario = fk.Scenario(blind(fk.Ball([0.0, 0.3], RADIUS)), start, t_end=DURATION, frames=11)
    found = fk.simulate(scenario, progress=False).switches
    half = mpmath.sqrt(REACH**2 - mpmath.mpf(0.3) ** 2)
    late = off(found, [(-mpmath.mpf(begin) + side * half) / mpmath.mpf(speed) for side in (-1, 1)])
    assert (late <= found["time_error"]).all()
    assert late[1] <= 2e-13


@pytest.mark.parametrize("steps", ["blocks of steps", "single steps"])
@pytest.mark.parametrize("seed", range(3))
def test_flights_past_each_other_cross_within_the_stated_errors(
    seed: int, steps: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steps reach far beyond the crossing that they are cut at."""
    if steps == "single steps":
        monkeypatch.setattr("flocking.engine.exact.session.take_block", lambda *_, **__: None)
    rng = np.random.default_rng(seed)
    for _ in range(12):
        span, speed = 10.0 ** rng.uniform(0, 7), 10.0 ** rng.uniform(-1, 4)
        reach, t_end = 10.0 ** rng.uniform(-1, 1), 2 * span / speed
        aside = rng.uniform(0, 0.9) * reach
        flight = fk.State([[-span, aside], [0.0, 0.0]], [[speed, 0.0], [0.0, 0.0]])
        scenario = fk.Scenario(fk.Law(fk.Proximity(reach), [fk.Consensus(1e-30)]), flight, t_end=t_end)
        found = fk.simulate(scenario, progress=False).switches
        half = mpmath.sqrt(mpmath.mpf(reach) ** 2 - mpmath.mpf(aside) ** 2)
        expected = [(mpmath.mpf(span) + side * half) / mpmath.mpf(speed) for side in (-1, 1)]
        expected = [t for t in expected if 0 < t < t_end]
        assert (off(found, expected) <= found["time_error"]).all(), (span, speed, reach)
