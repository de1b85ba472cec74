"""Closest approaches on polynomials: whose links count, and errors of rounding that cover what was rounded."""

import math
from fractions import Fraction

import numpy as np
import pytest

import flocking as fk
from flocking.engine.imperfect.pair_polynomials import as_closest, closest_pairs, paths_in

NONE = np.array([[np.inf, np.nan, -1.0, -1.0]] * 2)


def passing(away=0.0):
    """Two agents that pass each other at a distance of 0.3 or so, on straight lines, from the time 5 on."""
    q = np.array([[away, 0.1], [away + 3.0, 0.4]])
    p = np.array([[1.0, 0.0], [-1.0, 0.01]])
    return paths_in(fk.Open(), np.array([q, p]), 5.0)


@pytest.mark.parametrize(("i", "j"), [(0, 1), (1, 0)])
def test_a_pair_of_which_either_one_sees_the_other_is_linked(i, j):
    linked = np.zeros((2, 2), dtype=bool)
    linked[i, j] = True
    found = closest_pairs(passing(), 3.0, linked, 2.0, NONE)
    assert found[0, 2:].tolist() == [0.0, 1.0]
    assert math.isinf(found[1, 0])
    # They are beside each other 1.5 later.
    assert found[0, 1] == pytest.approx(2.0 + 1.5, abs=0.01)


@pytest.mark.parametrize("away", [0.0, 1e6, 1e9])
def test_the_error_of_a_closest_approach_covers_rounding_and_is_of_its_size(away):
    """Of two straight lines the least distance is known in exact arithmetic."""
    paths = passing(away)
    found = closest_pairs(paths, 3.0, np.zeros((2, 2), dtype=bool), 0.0, NONE)
    _, free = as_closest(paths, found, 5.0, rounding_alone=True)
    d, w = ([Fraction(float(b)) - Fraction(float(a)) for a, b in zip(*x, strict=True)] for x in paths.S)
    cross, speed = d[0] * w[1] - d[1] * w[0], w[0] ** 2 + w[1] ** 2
    exact = abs(float(cross)) / math.sqrt(float(speed))
    assert abs(free.distance - exact) <= free.error + 4e-16 * exact
    assert 4.0 * np.finfo(float).eps * (away + 3.0) <= free.error <= 1e-12 * (away + 3.0)
    assert math.isnan(as_closest(paths, found, 5.0, rounding_alone=False)[1].error)


@pytest.mark.parametrize("m", [1, 2, 3])
@pytest.mark.parametrize("span", [0.01, 0.5])
def test_rows_of_far_pairs_are_passed_over_in_open_space(m, span):
    """A box so large that nobody has an image in reach is looked at pair by pair, with links in one direction too."""
    n, rng = 37, np.random.default_rng(5)
    for _ in range(40):
        S, linked = 3.0 * rng.normal(size=(4, n, m)), rng.random((n, n)) < 0.3
        so_far = np.array([[rng.choice([0.01, 1.0, np.inf]), 0.0, -1.0, -1.0] for _ in range(2)])
        spaces = fk.Open(), fk.Periodic([1e9] * m)
        rows, pairs = (closest_pairs(paths_in(space, S, 0.0), span, linked, 0.0, so_far) for space in spaces)
        assert rows.tobytes() == pairs.tobytes()
