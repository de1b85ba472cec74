"""Positions handed to an obstacle are many points of its own dimension, or refused."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk

BALL = fk.Ball([0.0, 0.0], 1.0)


@pytest.mark.parametrize("q", [[2.0, 0.0], [[2.0, 0.0, 0.0]], 2.0, [[[2.0, 0.0]]], [[np.nan, 0.0]]])
def test_other_shapes_are_refused(q) -> None:
    for look in (BALL.distance, BALL.project, BALL.contains, BALL.at):
        with pytest.raises(fk.InvalidInput, match="Ball"):
            look(q)
    with pytest.raises(fk.InvalidInput, match="Ball"):
        BALL.at([[2.0, 0.0]], [[1.0, 0.0, 0.0]])


def test_points_as_lists_will_do() -> None:
    assert BALL.distance([[3.0, 0.0], [0.0, 0.5]]).tolist() == [2.0, -0.5]
