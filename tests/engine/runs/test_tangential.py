"""Which crossings count as tangential does not depend on the unit of speed."""

from __future__ import annotations

import pytest

from flocking.engine.runs.run import is_tangential


@pytest.mark.parametrize("unit", [1e-20, 1e-13, 1.0, 1e13])
def test_a_crossing_is_tangential_by_its_share_of_the_relative_speed(unit):
    assert is_tangential(1e-7 * unit, unit)
    assert is_tangential(-1e-7 * unit, unit)
    assert not is_tangential(1e-5 * unit, unit)


def test_agents_at_rest_do_not_cross():
    assert is_tangential(0.0, 0.0)
