"""Obstacles: distance, projection and boundary velocity against closed forms, brute force and differences."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.leaders_and_obstacles.obstacles import Obstacle

MOTION = fk.Velocity([1.0, 0.5], start=[3.0, 4.0])
WOBBLE = fk.Path(["sin(t)", "w*cos(t)"], start=[1.0, 1.0], w=0.7)
CORNERS = [[0.0, 0.0], [4.0, 0.0], [5.0, 2.0], [1.0, 3.0]]
BODIES = {
    "ball": fk.Ball([3.0, 4.0], 2.0),
    "moving ball": fk.Ball(MOTION, 2.0),
    "wobbling ball": fk.Ball(WOBBLE, 1.5),
    "wall": fk.Wall([1.0, 0.0], [1.0, 2.0]),
    "moving wall": fk.Wall(MOTION, [1.0, 2.0]),
    "polygon": fk.ConvexPolygon(CORNERS, 0.5),
    "moving polygon": fk.ConvexPolygon(CORNERS[::-1], 0.5, MOTION),
}


def points(count: int = 300) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    return rng.normal(size=(count, 2)) * 4 + 2, rng.normal(size=(count, 2))


@pytest.mark.parametrize("name", BODIES)
def test_boundary_velocity_is_the_rate_of_the_projection(name: str) -> None:
    body, (q, p), t, h = BODIES[name], points(), 0.7, 1e-6
    found = body.at(q, p, t)
    outside = found["distance"] > 1e-3
    assert outside.sum() > 30
    rate = (body.project(q + h * p, t + h) - body.project(q - h * p, t - h)) / (2 * h)
    near_border = np.abs(rate - found["boundary"]).max(axis=1) > 1e-6
    # A difference may straddle the border between an edge and a corner.
    assert (near_border & outside).sum() <= (1 if "polygon" in name else 0)


@pytest.mark.parametrize("name", BODIES)
def test_projection_is_on_the_boundary_and_nearest(name: str) -> None:
    body, (q, _), t = BODIES[name], points(), 0.7
    found = body.at(q, t=t)
    np.testing.assert_allclose(np.linalg.norm(found["normal"], axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(body.distance(found["projection"], t)[found["distance"] > 0], 0.0, atol=1e-12)
    line = body.outline(20_000, t)
    np.testing.assert_allclose(body.distance(line, t), 0.0, atol=1e-12)
    if "wall" not in name:
        nearest = np.sqrt(((q[:, None] - line[None]) ** 2).sum(axis=-1)).min(axis=1)
        np.testing.assert_allclose(np.abs(found["distance"]), nearest, atol=4e-4)
    np.testing.assert_array_equal(body.contains(q, t), found["distance"] <= 0)
    assert body.contains(q, t).any()


def test_55_to_57_outside_a_ball() -> None:
    """The paper's closed forms of projection and boundary velocity, against the derived ones."""
    centre, radius = np.array([3.0, 4.0]), 2.0
    body, (q, p) = fk.Ball(centre, radius), points()
    outside = ~body.contains(q)
    q, p = q[outside], p[outside]
    found = body.at(q, p)
    gap = np.linalg.norm(found["projection"] - q, axis=1, keepdims=True)
    s = radius / (radius + gap)
    np.testing.assert_allclose(found["projection"], s * q + (1 - s) * centre, rtol=1e-12)  # (55)
    n = (found["projection"] - q) / gap
    rate = radius * (p * n).sum(axis=1, keepdims=True) / (radius + gap) ** 2  # (57)
    np.testing.assert_allclose(found["boundary"], s * p - radius * (rate / s) * n, atol=1e-12)  # (56)
    np.testing.assert_allclose(found["boundary"], s * (p - n * (n * p).sum(axis=1, keepdims=True)), atol=1e-12)


@pytest.mark.parametrize("name", BODIES)
def test_inside_is_finite_and_meets_the_outside_at_the_boundary(name: str) -> None:
    body, t, eps = BODIES[name], 0.3, 1e-7
    edge = body.outline(60, t)
    normal = body.at(edge, t=t)["normal"]
    p = np.tile([0.7, -1.1], (60, 1))
    inner, outer = (body.at(edge + s * eps * normal, p, t)["boundary"] for s in (-1, 1))
    np.testing.assert_allclose(inner, outer, atol=1e-5)


def test_centre_of_a_ball() -> None:
    found = fk.Ball([1.0, 2.0, 3.0], 0.5).at(np.array([[1.0, 2.0, 3.0]]), np.array([[1.0, 0.0, 0.0]]))
    assert found["distance"][0] == -0.5
    assert all(np.isfinite(v).all() for v in found.values())


def test_moving_wall_pushes_its_boundary() -> None:
    body = fk.Wall(fk.Velocity([2.0, 0.0]), [1.0, 0.0])
    np.testing.assert_allclose(body.at(np.array([[5.0, 1.0]]), np.array([[0.0, 3.0]]))["boundary"], [[2.0, 3.0]])


def test_in_space() -> None:
    body = fk.Ball([0.0, 0.0, 0.0], 1.0)
    np.testing.assert_allclose(body.project(np.array([[0.0, 3.0, 4.0]])), [[0.0, 0.6, 0.8]])
    np.testing.assert_allclose(fk.Wall([0, 0, 1.0], [0, 0, 2.0]).distance(np.array([[5.0, 5.0, 4.0]])), [3.0])


def test_errors() -> None:
    with pytest.raises(InvalidInput, match="radius"):
        fk.Ball([0.0, 0.0], 0.0)
    with pytest.raises(InvalidInput, match="normal"):
        fk.Wall([0.0, 0.0], [0.0, 0.0])
    with pytest.raises(InvalidInput, match="rounding"):
        fk.ConvexPolygon(CORNERS, 0.0)
    for bad in ([[0, 0], [1, 0], [2, 0]], [[0, 0], [2, 0], [0, 2], [2, 2]], [[0, 0], [4, 0], [1, 1], [0, 4]]):
        with pytest.raises(InvalidInput, match="convex"):
            fk.ConvexPolygon(bad, 0.1)
    closed = fk.Ball(fk.Path(["exp(sin(t))", "0"]), 1.0)
    with pytest.raises(InvalidInput, match="closed form"):
        closed.distance(np.zeros((1, 2)))


def test_an_obstacle_states_its_distance_alone() -> None:
    """A new body needs no more than its signed distance: an upright cylinder."""

    class Cylinder(Obstacle):
        @property
        def dimension(self) -> int:
            return 3

        @property
        def parameters(self) -> dict[str, float]:
            return {"radius": 2.0}

        @property
        def structure(self) -> tuple[object, ...]:
            return ("cylinder",)

        def signed_distance(self, q, t, parameter):  # type: ignore[no-untyped-def]
            import sympy

            from flocking.model.leaders_and_obstacles.obstacles import Piece

            return [Piece(sympy.sqrt(q[0] ** 2 + q[1] ** 2) - parameter("radius"))]

        def outline(self, count: int = 100, t: float = 0.0) -> np.ndarray:
            return np.zeros((count, 3))

    found = Cylinder().at(np.array([[0.0, 5.0, 7.0]]), np.array([[1.0, 1.0, 1.0]]))
    np.testing.assert_allclose(found["projection"], [[0.0, 2.0, 7.0]], atol=1e-12)
    np.testing.assert_allclose(found["boundary"], [[0.4, 0.0, 1.0]], atol=1e-12)
