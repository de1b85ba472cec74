"""The laws on which the cluster engine is held against the others, each in two and three dimensions."""

from __future__ import annotations

import numpy as np

import flocking as fk
from flocking.model.potentials.structural_potential import structural_potential
from flocking.papers.shi_2009 import system as shi
from flocking.papers.tanner_2003_dynamic import system as tanner

SPACING = 7.0
RADIUS = 8.4
PAIR_STYLES = {"engine": "lammps", "forces": "pair styles"}
"""A run by the pair styles of LAMMPS, which these laws can be expressed by."""


def _alpha(weighting="energy", a=1.0, b=5.0):
    return [fk.Gradient(structural_potential(SPACING, a, b), weighting=weighting), fk.Consensus(1.0)]


def _smooth():
    return fk.Smooth(RADIUS, SPACING / RADIUS)


def _axes(dimension, *values):
    return np.array([*values, 0.5, 0.25, 0.125][:dimension])


def _navigation(dimension):
    return fk.Track(fk.Velocity(_axes(dimension, 2.0, 0.0)), velocity_gain=10.0)


def _obstacles(dimension):
    leader = fk.Velocity(_axes(dimension, 2.0, 0.0))
    wall = fk.Wall(_axes(dimension, 0.0, -25.0), _axes(dimension, 0.2, 1.0))
    moving = fk.Velocity(_axes(dimension, -1.0, 0.3), start=_axes(dimension, 20.0, 4.0))
    balls = [
        fk.Ball(_axes(dimension, 5.0, 6.0), 8.0),
        fk.Ball(_axes(dimension, -15.0, -8.0), 3.0),
        fk.Ball(moving, 4.0),
    ]
    return fk.Avoid([*balls, wall], leader, range=4.2)


def law(name, dimension, n):
    """Law and agents of a name."""
    rng = np.random.default_rng(7)
    agents = fk.Agents()
    if name == "olfati-saber (34)":
        return fk.Law(fk.Proximity(RADIUS, closed=True), _alpha()), agents
    if name == "olfati-saber (35)":
        return fk.Law(_smooth(), _alpha()), agents
    if name == "olfati-saber (36)":
        return fk.Law(_smooth(), _alpha("force")), agents
    if name == "olfati-saber (50)":
        sink = fk.Track(fk.Sink(_axes(dimension, 3.0, -2.0)), position_gain=1.0, velocity_gain=5.0)
        return fk.Law(_smooth(), [*_alpha(a=50.0, b=250.0), sink]), agents
    if name == "olfati-saber (58)":
        return fk.Law(_smooth(), [*_alpha(), _navigation(dimension), _obstacles(dimension)]), agents
    if name == "olfati-saber (66)":
        leader = fk.Velocity(_axes(dimension, 2.0, 0.0))
        shared = fk.Track(leader, position_gain=0.5, velocity_gain=2.0, shared=True, saturated=True)
        return fk.Law(_smooth(), [*_alpha(), shared]), fk.Agents(masses=rng.uniform(0.5, 2.0, n))
    if name == "tanner II (5)":
        return fk.Law(
            fk.Proximity(RADIUS), [fk.Gradient(fk.Potential("s*s/r**2 + log(r**2)", s=5.0)), fk.Consensus(1.0)]
        ), agents
    if name == "shi (4)":
        agents = fk.Agents(masses=rng.uniform(0.5, 1.0, n), damping=rng.uniform(0.0, 1.0, n))
        leader = fk.Path(["sin(t)", "cos(t)", "1/5*exp(-t)"][:dimension])
        informed = rng.uniform(0.0, 1.0, n) * (rng.random(n) < 0.5)
        track = fk.Track(leader, 0.3, informed, rng.uniform(0.0, 1.0, n), per_mass=True)
        psi = shi.potential(a=2.0, b=50.0, R=RADIUS)
        return fk.Law(
            fk.Proximity(RADIUS, closed=True), [fk.Gradient(psi), fk.Consensus(0.7), track, fk.Compensate()]
        ), agents
    if name == "two graphs":
        near = fk.Proximity(6.0)
        psi = fk.Potential("(r - 4)**2/2")
        return fk.Law(
            fk.Proximity(RADIUS), [*_alpha(), fk.Gradient(psi, over=near), fk.Consensus(0.5, over=near)]
        ), agents
    if name == "own potential":
        # Both pieces have the same value at 4: engines of fixed steps have no ledger of potentials that jump.
        near = "tanh(r - 4) + sinh(r/4) - sinh(1) + 2*atan(4) + cosh(4/5) - exp(-4) + 8"
        text = f"where(r < 4, {near}, atan(r) * abs(r - 6) + cosh(r/5) - exp(-r) + r**1.5)"
        return fk.Law(fk.Smooth(RADIUS, 0.5, "quintic"), [fk.Gradient(fk.Potential(text))]), fk.Agents(damping=0.3)
    raise KeyError(name)


NAMES = (
    "olfati-saber (34)", "olfati-saber (35)", "olfati-saber (36)", "olfati-saber (50)", "olfati-saber (58)",
    "olfati-saber (66)", "tanner II (5)", "shi (4)", "two graphs", "own potential",
)  # fmt: skip


def start(dimension, n=300, seed=3, speed=1.0, t=0.0):
    """A disturbed lattice about the origin: no two agents closer than half the spacing."""
    rng = np.random.default_rng(seed)
    each = int(np.ceil(n ** (1 / dimension)))
    points = np.stack(np.meshgrid(*[np.arange(each)] * dimension), axis=-1).reshape(-1, dimension)[:n]
    q = 0.8 * SPACING * (points - points.mean(axis=0)) + 0.1 * SPACING * rng.uniform(-1.0, 1.0, (n, dimension))
    return fk.State(q, speed * rng.normal(size=(n, dimension)), t)


__all__ = ["NAMES", "law", "start", "tanner"]
