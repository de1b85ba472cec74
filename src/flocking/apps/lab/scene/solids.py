"""Obstacles and leaders as bodies that can be drawn and dragged, and beta- and gamma-agents."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.apps.lab.scene.glyphs import in_space
from flocking.model.checks import NO_LESS, Array
from flocking.model.law import Scenario
from flocking.model.leaders_and_obstacles.obstacles import Ball, Obstacle, Wall
from flocking.model.parts.structure import Step
from flocking.model.state import State
from flocking.model.terms.avoidance import Avoid, ObstacleTerm

OUTLINE = 48
"""Corners of the polygon that stands for a round outline: its sides differ from a circle by 0.2 % of the radius."""
RINGS = 8
"""Rings of the mesh of a sphere: the edges of its faces differ from it by 2 % of the radius."""
WALL_DEPTH = 0.03
"""Thickness of a drawn wall in its extent."""

MOVERS = {"Ball": "centre", "Wall": "point", "ConvexPolygon": "motion"}
"""The field of each obstacle that holds the leader it moves with."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A body of the scene.

    Parameters
    ----------
    kind
        ``"obstacle"`` or ``"leader"``.
    path
        Path of the leader it moves with in the scenario; empty when it cannot be moved.
    position
        Where it is, shape (3,).
    vertices, faces
        Its shape around that place; a leader's has size 1.
    dimension
        Its dimension.
    shape
        Key that changes when it must be drawn again.
    """

    kind: str
    path: tuple[Step, ...]
    position: Array
    vertices: NDArray[np.floating]
    faces: NDArray[np.uint32]
    dimension: int
    shape: tuple[object, ...]


def solids(scenario: Scenario, t: float) -> list[Solid]:
    """Obstacles and leaders of a scenario at time ``t``. Other shapes are drawn by their outline."""
    found = []
    seen: set[int] = set()
    for k, term in enumerate(scenario.law.terms):
        path = ("law", "terms", k)
        if isinstance(term, ObstacleTerm):
            for j, obstacle in enumerate(term.obstacles):
                if obstacle.dimension <= 3:
                    found.append(_obstacle(obstacle, (*path, "obstacles", j), t))
        leader = getattr(term, "leader", None)
        if leader is not None and id(leader) not in seen and leader.dimension <= 3 and not isinstance(term, Avoid):
            seen.add(id(leader))
            place = leader.at(t)[0]
            if np.isfinite(place).all():
                vertices, faces = _sphere(1.0)
                shape = ("leader", leader.dimension)
                found.append(
                    Solid("leader", (*path, "leader"), in_space(place[None])[0].astype(float), vertices, faces,
                          leader.dimension, shape)
                )  # fmt: skip
    return found


def _obstacle(obstacle: Obstacle, path: tuple[Step, ...], t: float) -> Solid:
    field = MOVERS.get(type(obstacle).__name__)
    mover = obstacle.mover
    place = mover.at(t)[0] if mover is not None else np.zeros(obstacle.dimension)
    if isinstance(obstacle, Ball) and obstacle.dimension == 3:
        vertices, faces = _sphere(obstacle.radius)
    elif isinstance(obstacle, Wall):
        vertices, faces = _slab(obstacle)
    else:
        vertices, faces = _fan(in_space(obstacle.outline(OUTLINE, t) - place).astype(np.float64))
    movable = (*path, field) if field is not None and mover is not None else ()
    shape = (type(obstacle).__name__, vertices.tobytes())
    return Solid(
        "obstacle", movable, in_space(place[None])[0].astype(float), vertices, faces, obstacle.dimension, shape
    )


def _fan(outline: Array) -> tuple[Array, NDArray[np.uint32]]:
    """A flat body from its outline."""
    count = len(outline)
    faces = [(0, 1 + k, 1 + (k + 1) % count) for k in range(count)]
    return np.round(np.concatenate([outline.mean(axis=0)[None], outline]), 9), np.array(faces, dtype=np.uint32)


def _slab(wall: Wall) -> tuple[Array, NDArray[np.uint32]]:
    """The face of a wall with a strip behind it."""
    normal = in_space(wall.normal[None])[0].astype(float)
    along = np.cross(normal, (0.0, 0.0, 1.0)) if wall.dimension < 3 or abs(normal[2]) < 0.9 else np.array([1.0, 0, 0])
    along /= np.linalg.norm(along)
    second = -normal * WALL_DEPTH if wall.dimension < 3 else np.cross(normal, along)
    corners = [along, -along] if wall.dimension < 3 else [along - second, -along - second]
    points = np.array([*corners, corners[1] + (1 + (wall.dimension == 3)) * second, corners[0]
                       + (1 + (wall.dimension == 3)) * second])  # fmt: skip
    return wall.extent * points, np.array([(0, 1, 2), (0, 2, 3)], dtype=np.uint32)


def _sphere(radius: float) -> tuple[Array, NDArray[np.uint32]]:
    """A ball of rings."""
    across = np.pi * np.arange(1, RINGS) / RINGS
    around = 2 * np.pi * np.arange(2 * RINGS) / (2 * RINGS)
    rings = np.stack([np.outer(np.sin(across), np.cos(around)), np.outer(np.sin(across), np.sin(around)),
                      np.outer(np.cos(across), np.ones_like(around))], axis=2)  # fmt: skip
    points = np.concatenate([rings.reshape(-1, 3), [(0, 0, 1), (0, 0, -1)]])
    n, top = 2 * RINGS, len(points) - 2
    faces = []
    for k in range(n):
        faces += [(top, k, (k + 1) % n), (top + 1, top - n + (k + 1) % n, top - n + k)]
        for ring in range(RINGS - 2):
            a, b = ring * n + k, ring * n + (k + 1) % n
            faces += [(a, a + n, b), (b, a + n, b + n)]
    return radius * points, np.array(faces, dtype=np.uint32)


def virtual_agents(scenario: Scenario, state: State) -> Array:
    """Beta-agents, on obstacles within range of an agent, and gamma-agents inside them; shape (K, 3)."""
    found = [np.zeros((0, 3))]
    for term in scenario.law.terms:
        if not isinstance(term, ObstacleTerm):
            continue
        for obstacle in term.obstacles:
            near = obstacle.distance(state.q, state.t) < term.range
            if not near.any():
                continue
            found.append(in_space(obstacle.project(state.q[near], state.t)).astype(np.float64))
            if isinstance(term, Avoid) and term.gamma_agents and term.leader is not None and obstacle.mover is not None:
                velocity = term.leader.at(state.t)[1]
                ahead = term.offset * velocity / max(float(np.linalg.norm(velocity)), NO_LESS)
                found.append(in_space((obstacle.mover.at(state.t)[0] + ahead)[None]).astype(np.float64))
    return np.concatenate(found)
