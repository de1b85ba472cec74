"""What each part of a body changes of a force: small shares are shares, and rounding is none."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.imperfect.body_shares import BodyShares


@pytest.mark.parametrize(("less", "share"), [(1e-3, 1e-3), (1e-6, 1e-6), (1e-10, 1e-10), (1e-15, 0.0)])
def test_what_a_largest_speed_takes_away_is_a_share_unless_it_is_rounding(less, share):
    shares = BodyShares(fk.Limited(fk.PointMass(), speed=1.0), 2, 2)
    desired = np.array([[1.0, 0.0], [0.0, 0.5]])
    found = shares.at(0.5, desired, None, desired - np.array([[less, 0.0], [0.0, 0.0]]))
    assert shares.names == ("limits",)
    assert found[0] == pytest.approx(np.array([[-share, 0.0], [0.0, 0.0]]), rel=1e-4, abs=0.0)


def test_limits_act_before_the_lag_and_a_largest_speed_last():
    """Of a desired force of 3 a limit leaves 2, of which a lagged force of 1.5 has been reached, and 1.2 acts."""
    body = fk.Limited(fk.Limited(fk.Lagged(fk.PointMass(), 0.1), force=2.0), speed=1.0)
    shares = BodyShares(body, 1, 2)
    found = shares.at(0.5, np.array([[3.0, 0.0]]), np.array([[1.5, 0.0]]), np.array([[1.2, 0.0]]))
    assert shares.names == ("limits", "lag")
    assert found[:, 0, 0] == pytest.approx([-1.0 - 0.3, -0.5], rel=1e-12)
