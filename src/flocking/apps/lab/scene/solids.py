"""Obstacles and leaders as shapes that can be drawn and dragged, and beta- and gamma-agents."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.apps.lab.scene.points import in_space
from flocking.model.checks import NO_LESS, Array
from flocking.model.law import Scenario
from flocking.model.leaders_and_obstacles.leaders import Leader, Sink
from flocking.model.leaders_and_obstacles.obstacles import Ball, Obstacle, Wall
from flocking.model.parts.structure import Step
from flocking.model.state import State
from flocking.model.terms.avoidance import Avoid, ObstacleTerm

UPRIGHT = 0.9
"""Component of a unit normal from which on another axis is used: the cross product is longer than 0.4 either way."""

OUTLINE = 48
"""Corners of the polygon that stands for a round outline: its sides differ from a circle by 0.2 % of the radius."""
WALL_DEPTH = 0.03
"""Thickness of a drawn wall in its extent."""

MOVERS = {"Ball": "centre", "Wall": "point", "ConvexPolygon": "motion"}
"""The field of each obstacle that holds the leader it moves with."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A shape of the scene.

    Parameters
    ----------
    kind
        ``"obstacle"`` or ``"leader"``.
    path
        Path of the leader it moves with in the scenario; empty when it cannot be moved.
    part
        Path of the obstacle or leader itself.
    position
        Where it is, shape (3,).
    outline
        Corners of its outline around that place, shape (K, 3); empty for balls in space and for leaders.
    radius
        Radius of a ball in space; 0 for other shapes.
    name
        What it is called on a page.
    """

    kind: str
    path: tuple[Step, ...]
    part: tuple[Step, ...]
    position: Array
    outline: Array
    radius: float
    name: str


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
                here = (*path, "leader")
                found.append(Solid("leader", here, here, _space(place), np.zeros((0, 3)), 0.0, _leader_name(leader)))
    return found


def _leader_name(leader: Leader) -> str:
    """What a leader is called: a sink stays where it is."""
    return "sink" if isinstance(leader, Sink) else "leader"


def _space(place: Array) -> Array:
    return np.asarray(in_space(place[None])[0], dtype=np.float64)


def _obstacle(obstacle: Obstacle, path: tuple[Step, ...], t: float) -> Solid:
    field = MOVERS.get(type(obstacle).__name__)
    mover = obstacle.mover
    place = mover.at(t)[0] if mover is not None else np.zeros(obstacle.dimension)
    movable = (*path, field) if field is not None and mover is not None else ()
    outline, radius = np.zeros((0, 3)), 0.0
    if isinstance(obstacle, Ball) and obstacle.dimension == 3:
        radius = float(obstacle.radius)
    elif isinstance(obstacle, Wall):
        outline = _slab(obstacle)
    else:
        outline = in_space(obstacle.outline(OUTLINE, t) - place).astype(np.float64)
    return Solid("obstacle", movable, path, _space(place), outline, radius, "obstacle")


def _slab(wall: Wall) -> Array:
    """Corners of the face of a wall with a strip behind it; in space, of its face."""
    normal = in_space(wall.normal[None])[0].astype(float)
    along = (
        np.cross(normal, (0.0, 0.0, 1.0)) if wall.dimension < 3 or abs(normal[2]) < UPRIGHT else np.array([1.0, 0, 0])
    )
    along /= np.linalg.norm(along)
    if wall.dimension < 3:
        behind = -normal * WALL_DEPTH
        corners = [along, -along, behind - along, behind + along]
    else:
        second = np.cross(normal, along)
        corners = [along + second, second - along, -along - second, along - second]
    shape: Array = wall.extent * np.array(corners)
    return shape


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
