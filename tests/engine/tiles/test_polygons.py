"""Polygons in the tiled engine: the choice between edges, corners and inside is made without branches."""

from __future__ import annotations

import numpy as np

import flocking as fk
from tests.engine.tiles.laws import accelerations
from tests.engine.tiles.test_forces import assert_close

CORNERS = np.array([[0.0, 0.0], [4.0, 0.5], [3.0, 3.0], [0.5, 2.5]])


def test_polygons_push_as_they_do_in_the_reference():
    shapes = [fk.ConvexPolygon(CORNERS, 0.3), fk.ConvexPolygon(CORNERS + [8.0, 1.0], 0.2)]
    avoid = fk.Avoid(shapes, fk.Velocity([1.0, 0.0]), range=1.5, repulsion_gain=20.0)
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.structural_potential(0.8)), fk.Consensus(1.0), avoid])
    rng = np.random.default_rng(4)
    q = rng.uniform([-3.0, -3.0], [14.0, 6.0], (300, 2))
    state = fk.State(q, rng.normal(size=q.shape))
    found, expected, scale = accelerations(law, state)
    near = [shape.distance(q, 0.0) for shape in shapes]
    assert min((d <= 1.5).sum() for d in near) > 20
    assert min((d < 0).sum() for d in near) > 3
    assert_close(found, expected, scale + 50.0)
