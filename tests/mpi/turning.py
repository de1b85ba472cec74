"""Groups that cross the borders of ranks: they turn about the origin, or fly through space that repeats."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import sympy

import flocking as fk
from flocking.arrays import Array

RATE = 2 * np.pi
"""Rate at which groups turn: once in a unit of time, in which an agent crosses a line through the origin twice."""


@dataclass(frozen=True)
class Turn(fk.BodyTerm):
    """A force under which agents turn about the origin in the plane of the first and the last axis: swirl J q - pull q.

    Parameters
    ----------
    swirl
        Force across the position: the rate times the damping, so that damping stops no agent that turns.
    pull
        Force to the origin: the square of the rate times the mass.
    """

    swirl: float | Array = 0.0
    pull: float | Array = 0.0

    @property
    def parameters(self):
        return {"swirl": self.swirl, "pull": self.pull}

    @property
    def structure(self):
        return ("Turn",)

    def force(self, x):
        swirl, pull = x.parameter("swirl"), x.parameter("pull")
        a, *between, b = x.q
        return [-swirl * b - pull * a, *[sympy.Integer(0) for _ in between], swirl * a - pull * b]

    def storage(self, x):
        return x.parameter("pull") * (x.q[0] ** 2 + x.q[-1] ** 2) / 2

    def balance(self, x):
        swirl, pull = x.parameter("swirl"), x.parameter("pull")
        a, b = x.q[0], x.q[-1]
        across = swirl * (a * (x.p[-1] - x.frame_p[-1]) - b * (x.p[0] - x.frame_p[0]))
        return sympy.Integer(0), across + pull * (a * x.frame_p[0] + b * x.frame_p[-1])


def turning(law, state, agents=None, *, drag=0.0):
    """A law with a term that lets its agents turn, and the state in which they do.

    Parameters
    ----------
    law, state, agents
        The law, a state about the origin, and the agents.
    drag
        Velocity gain of the law's own terms.
    """
    agents = agents or fk.Agents()
    if agents.order == 1:
        return fk.Law(law.graph, [*law.terms, Turn(RATE, 0.0)]), state
    undamped = any(isinstance(term, fk.Compensate) for term in law.terms)
    swirl = RATE * (drag + (0.0 if undamped else np.asarray(agents.damping)))
    pull = RATE**2 * np.asarray(agents.masses)
    if state.dimension == 2 and np.ndim(pull) == 0 and np.all(swirl == 0):
        # A part of the library, so that runs can be stored.
        term = fk.Track(fk.Sink(np.zeros(2)), position_gain=float(pull), velocity_gain=0.0)
    else:
        term = Turn(*(x if np.ndim(x) else float(x) for x in (swirl, pull)))
    p = state.p.copy()
    p[:, 0] -= RATE * state.q[:, -1]
    p[:, -1] += RATE * state.q[:, 0]
    return fk.Law(law.graph, [*law.terms, term]), fk.State(state.q, p, state.t)


def lattice_in_box(counts, side, speed, flight):
    """A square lattice that fills a box that repeats and flies through it.

    Parameters
    ----------
    counts, side
        Agents along each axis, and the distance between them.
    speed
        Standard deviation of the velocities.
    flight
        Lengths of the box that the group flies along each axis in a unit of time.
    """
    rng, lengths = np.random.default_rng(5), side * np.array(counts)
    places = np.stack(np.meshgrid(*[np.arange(k) for k in counts], indexing="ij"), axis=-1).reshape(-1, len(counts))
    q = side * (places + 0.5 + rng.uniform(-0.015, 0.015, places.shape))
    return fk.State(q, speed * rng.normal(size=q.shape) + flight * lengths), fk.Periodic(lengths.tolist())
