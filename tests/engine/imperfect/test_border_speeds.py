"""How fast agents cross the border of a view that turns, and the range of an obstacle, as it is recorded."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.imperfect.range_crossings import ObstacleRanges
from flocking.engine.imperfect.turning_views import MovingView
from flocking.engine.imperfect.view_switches import View

HALF = 0.7
"""Half angle of the view."""


def leaving(heading, turning, d, w):
    """How fast another one leaves the view of the first agent of a group, and its relative speed."""
    rows = np.array([[heading, turning]], dtype=np.float64)
    view = MovingView(rows, np.array([np.cos(HALF)]), np.array([5.0]))
    return view.border_speed(0, np.asarray(d), np.asarray(w))


@pytest.mark.parametrize("seed", range(5))
def test_the_turn_counts_in_the_speed_and_in_what_it_is_compared_with(seed):
    rng = np.random.default_rng(seed)
    heading, turning, w = 2.0 * rng.normal(size=2), rng.normal(size=2), rng.normal(size=2)
    bearing = np.arctan2(heading[1], heading[0]) + HALF
    d = 1.3 * np.array([np.cos(bearing), np.sin(bearing)])

    def inside(t):
        away, ahead = d + t * w, heading + t * turning
        return away @ ahead / np.linalg.norm(ahead) - np.cos(HALF) * np.linalg.norm(away)

    speed, relative = leaving(heading, turning, d, w)
    assert speed == pytest.approx((inside(-1e-5) - inside(1e-5)) / 2e-5, rel=1e-7, abs=1e-8)
    rate = (heading[0] * turning[1] - heading[1] * turning[0]) / (heading @ heading)
    assert relative == pytest.approx(np.linalg.norm(w) + 1.3 * abs(rate), rel=1e-12)
    # Who only looks longer along the same direction does not turn.
    assert leaving(heading, 3.0 * heading, d, w)[1] == np.sqrt(w @ w)


def test_at_rest_and_at_the_radius_the_speed_is_that_of_the_distance():
    w = np.array([0.5, 0.0])
    for heading, distance in (([0.0, 0.0], 1.0), ([0.0, 0.0], 5.0), ([1.0, 0.0], 5.0)):
        assert leaving(heading, [0.2, 1.0], distance * np.array([0.6, 0.8]), w) == pytest.approx((0.3, 0.5), rel=1e-15)


def test_a_meeting_is_recorded_with_the_number_of_its_obstacle_and_whether_it_is_tangential():
    """Balls and walls are groups of their own; numbers are those of the law, along a wall no speed is left."""
    obstacles = [fk.Wall([0.0, -2.0], [0.0, 1.0]), fk.Ball([4.0, 0.3], 1.0), fk.Wall([0.0, 5.0], [0.6, -0.8])]
    avoid = fk.Avoid(obstacles, range=1.5, gamma_agents=False)
    ranges = ObstacleRanges(fk.Law(fk.Proximity(1.0), [avoid]), np.zeros((1, 2)), 0.0)
    places = [(g, o) for g, group in enumerate(ranges.groups) for o in range(len(group.obstacles))]

    def rows(p):
        found = [ranges.record(0.0, 0, g, o, (np.zeros(2), np.array(p))) for g, o in places]
        return {number: (speed, slow) for _, _, number, _, _, speed, slow, *_ in found}

    along, down = rows([2.0, 0.0]), rows([0.0, -2.0])
    assert set(along) == {0, 1, 2}
    assert along[0] == (0.0, True)
    assert along[2] == (pytest.approx(1.2), False)
    assert down[0] == (pytest.approx(-2.0), False)
    assert down[2] == (pytest.approx(1.6), False)
    across = np.array([4.0, 0.3]) / np.hypot(4.0, 0.3)
    assert along[1] == (pytest.approx(-2.0 * across[0]), False)


def test_others_leave_a_constant_view_through_its_radius_or_a_side():
    view = View(np.array([[1.0, 0.0]]), np.array([np.cos(HALF)]), np.array([5.0]))
    w = np.array([0.5, 0.3])
    for distance, bearing in ((5.0, 0.3), (1.3, HALF)):
        along, across = np.array([np.cos(bearing), np.sin(bearing)]), np.array([-np.sin(bearing), np.cos(bearing)])
        # Beyond the side the margin d.h - c |d| falls with what is across the bearing alone.
        expected = w @ along if distance == 5.0 else np.sin(HALF) * (w @ across)
        speed, relative = view.border_speed(0, distance * along, w)
        assert speed == pytest.approx(expected, rel=1e-12)
        assert relative == pytest.approx(np.hypot(*w), rel=1e-15)
