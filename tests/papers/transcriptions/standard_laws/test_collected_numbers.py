"""The numbers of the standard laws as they were collected, each in the folder of its paper."""

from __future__ import annotations

import math

import pytest

from flocking.papers import paper


def test_olfati_saber_2006():
    x = paper("olfati-saber-2006").system
    assert pytest.approx((7.0, 8.4, 4.2, 5.04)) == (x.DISTANCE, x.RADIUS, x.OBSTACLE_DISTANCE, x.OBSTACLE_RADIUS)
    assert (x.EPSILON, x.ATTRACTION, x.REPULSION, x.ALPHA_ONSET, x.BETA_ONSET) == (0.1, 5.0, 5.0, 0.2, 0.9)
    assert (x.AGENTS, x.FRAGMENT_AGENTS, x.SPACE_AGENTS, x.NETWORK_AGENTS) == (150, 40, 50, 50)
    assert (x.START_DEVIATION**2, x.START_VELOCITIES) == (2500.0, (-2.0, -1.0))
    split = zip([100, 110, 120, 130, 150, 160], [20, 60, 40, -20, 40, 0], [10, 4, 2, 5, 5, 3], strict=True)
    assert tuple(split) == x.SPLIT_OBSTACLES
    assert x.SQUEEZE_OBSTACLES == ((150, 30, 25), (150, 100, 25))
    assert x.FIRM_GAINS == (1.0, 300.0, 1.2)
    assert (x.GAINS, x.NETWORK_OBSTACLES) == ((1.0, 4.5, 1.2), ((75, 10, 10), (75, 50, 10)))
    assert (x.NETWORK_GOAL, x.NETWORK_VELOCITY) == ((60, 25), (4, 0))
    assert (x.NETWORK_STEP, x.NETWORK_DURATION) == (0.2, 50.0)


def test_cucker_smale_2007():
    found = paper("cucker-smale-2007")
    x, forms = found.system, found.closed_forms
    assert (x.MEETING, x.LEAVING) == (1.2, 1.7)
    assert forms.final_distance(0.0, x.MEETING) == pytest.approx(2.572151622, abs=5e-10)
    assert forms.final_speed(0.0, x.LEAVING) == pytest.approx(1.7 - math.pi / 2, rel=1e-12)
    # lambda = 1: monotone up to 1/e, stable below pi/2.
    assert x.MONOTONE_LATE < 1 / math.e < x.LATE < math.pi / 2 < x.TOO_LATE
    assert forms.delay_limits(1.0) == pytest.approx((1 / math.e, math.pi / 2), rel=1e-12)
    exponents = [found.scenario(name=name).law.terms[0].exponent for name in (x.KEY, x.CRITICAL, x.SHARP, x.PAIR)]
    assert exponents == [0.4, 0.5, 1.0, 1.0]
    two = found.scenario(name=x.PAIR)
    assert (two.start.n, two.start.n * two.law.terms[0].gain, two.law.terms[0].scale) == (2, 1.0, 1.0)


def test_vicsek_1995():
    x = paper("vicsek-1995").system
    assert (x.SPEED, x.RADIUS, x.STEP, x.AGENTS) == (0.03, 1.0, 1.0, 300)
    assert list(x.FIGURE_1.values()) == [(7.0, 2.0), (25.0, 0.1), (5.0, 0.1)]
    assert x.FIGURE_2 == ((40, 3.1), (100, 5.0), (400, 10.0), (4000, 31.6), (10000, 50.0))
    assert (x.LATER_SPEED, x.LATER_DENSITY) == (0.5, 2.0)
    noises = {name: x.scenario(name=name).agents.noise for name in (x.MIDDLE, x.PHASES, x.BANDS, x.FLUCTUATIONS)}
    assert list(noises.values()) == [3.5, 0.618, 0.6, 0.4]


def test_reynolds_1987():
    x = paper("reynolds-1987").system
    assert (x.BOIDS, x.FORCE, x.SPEED, x.START_RADIUS, x.WORLD) == (200, 27.0, 9.0, 20.0, 50.0)
    assert pytest.approx(2.7) == x.START_SPEED
    assert (x.SEPARATION, x.ALIGNMENT, x.COHESION) == ((12.0, 5.0, -0.707), (8.0, 7.5, 0.7), (8.0, 9.0, -0.15))
    assert (x.BODY, x.NEAR) == (0.5, 1.5)
    assert (x.BIRD_SPEED, x.COHERE, x.SEPARATE, x.MATCH, x.BIRD_SEPARATION) == (1.0, 0.03, 0.015, 0.05, 1.0)
    assert {x.SMALL: (200, 100.0, 5.0), x.LARGE: (400, 150.0, 15.0)} == x.BIRDS
    assert x.UPDATES == 100
    *_, back = x.scenario().law.terms
    assert (back.radius, back.speed) == (50.0, 9.0)
    assert [(t.weight, t.radius, t.cosine, t.near) for t in x.scenario().law.terms[:3]] == [
        (12.0, 5.0, -0.707, 1.5), (8.0, 7.5, 0.7, 1.5), (8.0, 9.0, -0.15, 1.5)]  # fmt: skip


def test_vasarhelyi_2018():
    x = paper("vasarhelyi-2018").system
    assert (x.FLOCK_SPEED, x.LARGEST_SPEED, x.AGENTS, x.DURATION, x.HALF_WIDTH) == (4.0, 8.0, 100, 600.0, 230.0)
    file = x.FILE
    assert (file.repulsion_radius, file.repulsion_slope, file.repulsion_speed) == (25.6668, 0.4, 6.19664)
    assert (file.friction_acceleration, file.friction_slope, file.friction_slack) == (2.5, 0.4, 0.5)
    assert (file.friction_radius - file.repulsion_radius, file.friction_gain) == pytest.approx((10.0, 0.023802))
    assert (file.shill_speed, file.shill_acceleration, file.shill_slope, file.shill_offset) == (6.52174, 2.5, 0.4, 0.0)
    assert (x.TIME_CONSTANT, x.ACCELERATION, x.RANGE, x.DELAY, x.REFRESH) == (1.0, 6.0, 100.0, 1.0, 0.2)
    assert (x.POSITION_NOISE, x.PROCESS_NOISE, x.STEP, x.COLLISION_RADIUS) == (0.005, 0.2, 0.01, 3.0)
