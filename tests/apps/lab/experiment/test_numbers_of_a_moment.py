"""Numbers that the lab shows of one moment, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.panels.agent_forces import agent_content
from flocking.apps.lab.panels.measures import measured


def test_forces_of_an_agent_are_those_of_the_nearest_images() -> None:
    """A spring of length 1 between agents 3 apart, and 1.5 across the edge of a space of 4.5: 0.5 outwards."""
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("(r - 1)**2/2"))])
    start = fk.State([[0.0, 0.0], [3.0, 0.0]], links=~np.eye(2, dtype=bool))
    found = agent_content(fk.Scenario(law, start, t_end=1.0, space=fk.Periodic([4.5, 9.0])), start, 0)
    assert found["forces"] == [{"term": "Gradient", "force": [pytest.approx(-0.5), pytest.approx(0.0)]}]


def test_connectivity_of_one_way_links_is_that_of_the_net_without_directions() -> None:
    """A directed ring of three is a triangle, whose second eigenvalue is 3."""
    ring = fk.State(np.eye(3), links=np.roll(np.eye(3, dtype=bool), 1, axis=1))
    assert measured(ring, 0.0)["connectivity"] == pytest.approx(3.0)
