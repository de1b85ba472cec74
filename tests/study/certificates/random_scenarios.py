"""Random scenarios of all kinds that certificates speak of, of which many share the structure of their law.

Scenario k of a kind is the same in every call. Its structure, drawn from k modulo `STRUCTURES`, fixes formulas, terms,
graph and dimension, so that compiled code serves many scenarios; its numbers, places and number of agents are its own.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

import flocking as fk
from tests.study.certificates import lattice_scenarios, linear_scenarios
from tests.study.certificates.draws import STRUCTURES, coefficients_of, gain_of, number_of, places_of

POTENTIALS = (
    ("a/r + b*r**2", 1.0), ("a*exp(-r) + b*r**2", 1.0), ("a*log(r**2) + b/r**2", 1.0), ("b*r**2", 1.0),
    ("a*(r - 1)**2*exp(-r)", 1.0), ("where(r < 1, a*(r - 1)**2, b*(r - 1)**2)", 1.0),
    ("-a*exp(-r**2) + b*abs(r - 1)", 1.0),
    ("a/r - b/r**2 + r", 0.2),
)  # fmt: skip
"""Formulas, and the share of the drawn numbers that they take: the last is not bounded from below."""


def _pair_law(shape: Generator, rng: Generator, n: int) -> tuple[fk.Graph, list[object]]:
    drawn = coefficients_of(shape, rng)
    radius = float(drawn.uniform(1.5, 5.0))
    a, b = float(drawn.uniform(0.05, 4.0)), float(drawn.uniform(0.05, 4.0))
    way = int(shape.integers(7))
    if way == 0:
        barrier = fk.Potential("a/r + b/(R - r)", a=a, b=b, R=radius)
        return fk.Hysteresis(radius, float(drawn.uniform(0.01, 0.6) * radius)), [fk.Gradient(barrier)]
    formula, share = POTENTIALS[int(shape.integers(len(POTENTIALS)))]
    shared = (("a", share * a), ("b", share * b))
    numbers = {name: x for name, x in shared if f"{name}*" in formula or f"{name}/" in formula}
    gradient = fk.Gradient(fk.Potential(formula, **numbers))
    if way == 1:
        return fk.Hysteresis(radius, float(drawn.uniform(0.0, 0.6) * radius)), [gradient]
    if way == 2:
        return fk.Proximity(radius), [gradient]
    if way == 3:
        return fk.Complete(), [gradient]
    if way == 4:
        soft = fk.Potential("a*exp(-r) + b*r**2/4", a=a, b=b)
        return fk.Smooth(radius, float(drawn.uniform(0.1, 0.9))), [fk.Gradient(soft)]
    edges = [(i, j) for i in range(n) for j in range(i + 1, n) if rng.random() < 0.7]
    return fk.Fixed(n, tuple(edges)), [gradient]


def _leader(shape: Generator, rng: Generator, m: int) -> fk.Leader:
    way = int(shape.integers(4))
    if way == 0:
        return fk.Sink(rng.normal(size=m))
    if way == 1:
        return fk.Velocity(rng.normal(size=m), start=rng.normal(size=m))
    if way == 2:
        return fk.Path([*["cos(t)", "sin(2*t)", "t/2"][:m]])
    return fk.Path([*["where(t < 0.4, 1, 2)", "0", "0"][:m]])


def _energetic(shape: Generator, rng: Generator) -> fk.Scenario:
    n, m = number_of(rng), int(shape.choice([1, 2, 2, 3]))
    graph, terms = _pair_law(shape, rng, n)
    first = shape.random() < 0.15
    q = places_of(rng, n, m, float(rng.uniform(1.0, 6.0)))
    p = rng.normal(size=(n, m)) * float(rng.choice([0.0, 0.1, 1.0, 3.0])) + rng.normal(size=m)
    masses = rng.uniform(0.2, 3.0, n) if rng.random() < 0.4 else float(rng.uniform(0.5, 2.0))
    bodies: object
    if first:
        p, bodies = np.zeros((n, m)), fk.SingleIntegrator(masses)
    else:
        if shape.random() < 0.75:
            over = fk.Proximity(2.0) if shape.random() < 0.15 else None
            terms.append(fk.Consensus(gain_of(rng), over=over))
        damped = shape.random() < 0.2
        damping = float(rng.uniform(0.01, 2.0)) if damped else 0.0
        if damped and shape.random() < 0.4:
            terms.append(fk.Compensate())
        if shape.random() < 0.35:
            knows = float(shape.integers(2))
            gains = rng.uniform(0, 2, n) if rng.random() < 0.3 else gain_of(rng)
            leader, per_mass = _leader(shape, rng, m), bool(shape.random() < 0.3)
            terms.append(fk.Track(leader, gains, gain_of(rng), knows, per_mass=per_mass))
        bodies = fk.PointMass(masses, damping)
        if shape.random() < 0.1:
            bodies = fk.Limited(bodies, force=float(10 ** rng.uniform(0, 2)), speed=float(10 ** rng.uniform(0, 1)))
    world: dict[str, object] = {}
    way = shape.random()
    if way < 0.04 and not first:
        world["control"] = fk.Held(float(rng.uniform(0.02, 0.2)))
    elif way < 0.08:
        world["information"] = fk.Delayed(float(rng.uniform(0.1, 0.5)))
    elif way < 0.1 and not first and isinstance(bodies, fk.PointMass):
        bodies = fk.Disturbed(bodies, 0.5, 0.1)
    begin = float(rng.choice([0.0, 0.0, -3.0, 100.0]))
    end = begin + float(rng.uniform(0.2, 1.2) if n < 10 else rng.uniform(0.1, 0.3))
    return fk.Scenario(fk.Law(graph, terms), fk.State(q, p, begin), t_end=end, frames=5, bodies=bodies, **world)


def _aligning(shape: Generator, rng: Generator) -> fk.Scenario:
    n, m = number_of(rng), int(shape.integers(1, 4))
    terms: list[object] = [fk.CuckerSmale(gain_of(rng) / n, float(rng.uniform(0, 2)), float(10 ** rng.uniform(-1, 1)))]
    if shape.random() < 0.3:
        terms.append(fk.Consensus(float(rng.uniform(0.0, 0.3))))
    p = rng.normal(size=(n, m)) * float(10 ** rng.uniform(-2, 0.5))
    graph = fk.Complete() if shape.random() < 0.6 else fk.Fixed.complete(n)
    start = fk.State(places_of(rng, n, m, 3.0), p)
    bodies = fk.PointMass(float(10 ** rng.uniform(-1, 1)))
    return fk.Scenario(fk.Law(graph, terms), start, t_end=float(rng.uniform(0.5, 8)), frames=21, bodies=bodies)


def _filtered(shape: Generator, rng: Generator) -> fk.Scenario:
    n, m = int(rng.choice([2, 2, 3, 4, 6])), int(shape.integers(1, 4))
    most = rng.uniform(0.5, 5.0, n)
    period = float(10 ** rng.uniform(-1.7, 0))
    form, obstacles = str(rng.choice(["sampled", "stopping", "stopping", "continuous"])), ()
    q, p = rng.normal(size=(n, m)) * 2.0 * n ** (1 / m), rng.normal(size=(n, m)) * float(rng.uniform(0, 2))
    if form == "stopping" and m == 2 and rng.random() < 0.5:
        # Aside of all that moves to begin with: agents are pushed against it by each other.
        obstacles = (fk.Ball([0.0, 1.5 + float(q[:, 1].max())], 0.5), fk.Wall([0.0, -6.0], [0.1, 1.0]))
    control = fk.SafetyFilter(
        period, distance=0.5, acceleration=most, gain=float(10 ** rng.uniform(-1, 1.5)), form=form,
        obstacles=obstacles, clearance=0.1 if obstacles else None,
    )  # fmt: skip
    law = fk.Law(fk.Fixed.complete(n), [fk.Gradient(fk.Potential("a*r**2/2", a=float(10 ** rng.uniform(-1, 1.5))))])
    bodies = fk.PointMass(rng.uniform(0.5, 2.0, n))
    # A frame at every tick, between which agents move on parabolas.
    ticks = int(min(6.0 / period, 60))
    return fk.Scenario(
        law, fk.State(q, p), t_end=ticks * period, frames=ticks + 1, control=control, bodies=bodies
    )  # fmt: skip


def _obstructed(shape: Generator, rng: Generator) -> fk.Scenario:
    n = int(rng.integers(1, 6))
    obstacles = (fk.Ball([0.0, 0.0], float(rng.uniform(0.3, 1.0))), fk.Wall([-4.0, 0.0], [1.0, 0.2]))
    avoid = fk.Avoid(
        obstacles[: int(shape.integers(1, 3))], range=float(rng.uniform(0.8, 1.6)),
        repulsion_gain=float(10 ** rng.uniform(0.5, 2)), damping_gain=float(rng.choice([0.0, 1.0])),
        repulsion=fk.Potential("(r - d)**2/2", d=float(rng.uniform(1.6, 3.0))), gamma_agents=False,
        fading_damping=bool(shape.random() < 0.5),
    )  # fmt: skip
    graph = fk.Proximity(float(rng.uniform(0.5, 3))) if shape.random() < 0.5 else fk.Complete()
    terms: list[object] = [fk.Gradient(fk.Potential("a*r**2/2", a=float(rng.uniform(0.0, 1.0)))), avoid]
    if shape.random() < 0.5:
        terms.append(fk.Consensus(gain_of(rng)))
    if shape.random() < 0.4:
        terms.append(fk.Track(fk.Sink([0.3, 0.0]), 0.3, float(rng.uniform(0, 1))))
    angles = rng.uniform(0, 2 * np.pi, n)
    q = np.column_stack([np.cos(angles), np.sin(angles)]) * rng.uniform(1.2, 2.8, n)[:, None]
    p = rng.normal(size=(n, 2)) * float(rng.uniform(0, 3))
    bodies = fk.PointMass(rng.uniform(0.5, 2, n), float(rng.choice([0.0, 0.3])))
    return fk.Scenario(fk.Law(graph, terms), fk.State(q, p), t_end=2.0, frames=21, bodies=bodies)


def _braking(shape: Generator, rng: Generator) -> fk.Scenario:
    """Agents with a largest force that brake to rest, and are slowed by nothing else."""
    n, m = int(rng.integers(1, 5)), int(shape.integers(1, 4))
    most = rng.uniform(0.5, 3.0, n) if rng.random() < 0.5 else float(rng.uniform(0.5, 3.0))
    bodies = fk.Limited(fk.PointMass(rng.uniform(0.5, 2.0, n)), force=most)
    rest = fk.Track(fk.Velocity(np.zeros(m)), 0.0, float(10 ** rng.uniform(1, 2.5)))
    p = rng.normal(size=(n, m)) * float(rng.uniform(0.1, 2.0))
    q = rng.normal(size=(n, m)) * 3.0
    law = fk.Law(fk.Complete(), [fk.Consensus(0.0), rest])
    return fk.Scenario(law, fk.State(q, p), t_end=20.0, frames=3, bodies=bodies)


def _led(shape: Generator, rng: Generator) -> fk.Scenario:
    """A group that follows a leader with the same gains per mass."""
    n, m = number_of(rng), int(shape.choice([2, 3]))
    graph: fk.Graph = fk.Proximity(float(rng.uniform(1, 3))) if shape.random() < 0.5 else fk.Complete()
    terms: list[object] = [
        fk.Gradient(fk.Potential("a*exp(-r**2)", a=float(coefficients_of(shape, rng).uniform(0, 2)))),
        fk.Consensus(0.3),
    ]
    way, knows = int(shape.integers(4)), float(shape.integers(2))
    leader = (
        fk.Sink(rng.normal(size=m)), fk.Velocity(rng.normal(size=m)), fk.Path([*["cos(t)", "sin(t)", "0"][:m]]),
        fk.Path([*["t**2/4", "t", "0"][:m]]),
    )[way]  # fmt: skip
    place = float(rng.uniform(0, 2)) if shape.random() < 0.6 else 0.0
    terms.append(fk.Track(leader, place, float(rng.uniform(0.1, 2)), knows, per_mass=True))
    q, p = rng.normal(size=(n, m)) * 2.0, rng.normal(size=(n, m))
    bodies = fk.PointMass(rng.uniform(0.5, 2.0, n))
    return fk.Scenario(fk.Law(graph, terms), fk.State(q, p), t_end=float(rng.uniform(0.5, 4)), frames=5, bodies=bodies)


MAKERS: dict[str, Callable[[Generator, Generator], fk.Scenario]] = {
    "energetic": _energetic, "aligning": _aligning, "filtered": _filtered, "obstructed": _obstructed,
    "braking": _braking, "led": _led, **linear_scenarios.MAKERS, **lattice_scenarios.MAKERS,
}  # fmt: skip
"""Kinds of scenarios, by the kind of theorem that speaks of them."""

NUMBERS = {
    "energetic": 5000, "aligning": 4000, "filtered": 1500, "obstructed": 400, "braking": 300, "led": 2500,
    "agreeing": 3000, "sampled": 1500, "delayed": 450, "lossy": 150, "noisy": 100, "directed": 1000,
    "linearised": 100,
}  # fmt: skip
"""Scenarios of each kind, 20,000 together."""


def random_scenario(kind: str, number: int) -> fk.Scenario:
    """The scenario of a kind and a number."""
    seed = list(MAKERS).index(kind)
    shape = np.random.default_rng([number % STRUCTURES, seed, 21])
    return MAKERS[kind](shape, np.random.default_rng([number, seed, 2121]))
