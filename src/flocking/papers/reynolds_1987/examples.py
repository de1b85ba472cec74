"""Objects of the equation table of Reynolds; each depends on a factor that is 1 for the program."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.engine.reference.control import control
from flocking.model import starts
from flocking.model.bodies.discrete_bodies import Impulsive
from flocking.model.checks import Array
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.terms.steering import Alignment, Cohesion, Separation, Steering, TurnBack
from flocking.model.world.control import Held
from flocking.papers.reynolds_1987 import observations, rules, system, theorems
from flocking.study.claims.audit import audit
from flocking.study.claims.claim import Verdict

FEW = 12
"""Agents of the examples."""


def few(scale: float = 1.0) -> State:
    """Twelve boids close enough to see each other, velocities of several lengths.

    Parameters
    ----------
    scale
        Factor of their distances.
    """
    found = starts.ball(FEW, radius=6.0, speed=5.0, dimension=3, seed=2)
    return State(scale * found.q, found.p)


def _desired(term: Steering, state: State | None = None) -> Array:
    return control(Law(Proximity(9.0), (term,)), few() if state is None else state)


def cone_of(scale: float) -> Array:
    """Sums of the vectors to those seen in the cone of alignment by each boid, the radius scaled."""
    _, radius, cosine = system.ALIGNMENT
    many = starts.ball(40, radius=7.0, speed=5.0, dimension=3, seed=5)
    return _desired(Cohesion(1.0, scale * radius, cosine, system.NEAR * scale, total="sum"), many)


def separation_of(scale: float) -> Array:
    """Separation of the boids, its weight scaled."""
    weight, radius, cosine = system.SEPARATION
    return _desired(Separation(scale * weight, radius, cosine, system.NEAR))


def alignment_of(scale: float) -> Array:
    """Alignment of the boids, its weight scaled."""
    weight, radius, cosine = system.ALIGNMENT
    return _desired(Alignment(scale * weight, radius, cosine, system.NEAR))


def cohesion_of(scale: float) -> Array:
    """Cohesion of the boids, its weight scaled."""
    weight, radius, cosine = system.COHESION
    return _desired(Cohesion(scale * weight, radius, cosine, system.NEAR))


def turn_of(scale: float) -> Array:
    """The turn back of boids on both sides of its radius, the largest speed scaled."""
    begin = few()
    return _desired(TurnBack(4.0, scale * 3.0), State(begin.q, begin.p))


def boid_force_of(scale: float) -> Array:
    """Sum of all steering forces of the boids, the force scaled."""
    return scale * rules.boid_force(few())


def _short(state: State, force: float = system.FORCE, speed: float = system.SPEED, update: str = "forward") -> Scenario:
    body = Impulsive(force=force, speed=speed, update=update)
    return Scenario(system.boid_law(), state, t_end=0.2, frames=2, agents=body, control=Held(0.2))


def limits_of(scale: float) -> Array:
    """Velocities after one update of 0.2, whose force and speed are limited, both limits scaled."""
    run = simulate(_short(few(), force=scale * 10.0, speed=scale * 5.5), progress=False)
    return np.asarray(run.p[1])


def places_of(scale: float) -> Array:
    """Positions after one update, the time between updates scaled."""
    made = system.boids(agents=FEW, step=0.05 * scale, duration=2.0)
    run = simulate(made, progress=False)
    return np.asarray(run.q[1])


def in_turn_of(scale: float) -> Array:
    """Velocities of boids that act one after another, after one update, the velocities of the start scaled."""
    begin = few()
    scenario = _short(State(begin.q, scale * begin.p), update="sequential")
    found = rules.next_state(scenario, scenario.start.q, scenario.start.p, 0)[1]
    assert np.allclose(found, simulate(scenario, progress=False).p[1], atol=1e-9)
    return found


def settings_of(scale: float) -> tuple[float, ...]:
    """Numbers of the start and the body of the boids, the force and the speeds scaled."""
    made = system.scenario()
    body = made.agents
    assert isinstance(body, Impulsive)
    speeds = np.linalg.norm(made.start.p, axis=1)
    assert body.force is not None
    assert body.speed is not None
    return (
        float(made.start.n), scale * float(np.max(body.force)), scale * float(np.max(body.speed)),
        scale * float(speeds.max()), scale * float(speeds.min()),
        float(np.linalg.norm(made.start.q, axis=1).max() < 20.0),
    )  # fmt: skip


def bird_force_of(scale: float) -> Array:
    """What birds add to their velocities, the force scaled."""
    begin = starts.box(30, side=12.0, speed=1.0, velocities="sphere", seed=3)
    return scale * rules.bird_force(begin, 12.0, 4.0)


def birds_of(scale: float) -> Array:
    """Velocities after the first update of eight birds that act in random order, the side scaled."""
    made = system.birds(8, 9.0 * scale, 3.5, seed=4, updates=1)
    return np.asarray(simulate(made, progress=False).p[1])


def compared_of(scale: float) -> list[tuple[float, ...]]:
    """Birds, side, vision and updates of the two settings, sides scaled."""
    found: list[tuple[float, ...]] = []
    for name in system.BIRDS:
        made = system.scenario(name=name)
        radius = float(np.max(np.asarray(made.law.graph.break_radius)))
        found.append((float(made.start.n), scale * made.space.lengths[0], radius, made.t_end))
    return found


def observed_of(scale: float) -> tuple[float, float, float]:
    """Polarisation, nearest distance and groups of three boids in two groups, distances scaled."""
    q = scale * np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [30.0, 0.0, 0.0]])
    p = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
    made = Scenario(system.boid_law(), State(q, p), t_end=0.1, frames=1,
                    agents=Impulsive(), control=Held(0.1))  # fmt: skip
    order, nearest, groups = observations.measured(simulate(made, progress=False))
    return float(order[0]), float(nearest[0]), float(groups[0])


def judgements_of(scale: float) -> dict[str, Verdict]:
    """Verdicts of what follows from the definition about a run whose velocities are declared to be scaled."""
    run = simulate(system.boids(agents=20, duration=2.0), progress=False)
    run = replace(run, p=run.p * scale)
    found = {r.claim.key: r.verdict for r in audit(run, theorems.claims()).results}
    return {key: found[key] for key in ("new-velocity", "rule", "speed", "force")}
