"""Choice of the time step from a sample of the listed pairs."""

from __future__ import annotations

import numpy as np

from flocking.engine.fixed_step.automatic_step import PERIODS, SAMPLE, SampledPairs, largest_step, resolving_step
from flocking.engine.fixed_step.energy_rounding import energy_rounding
from flocking.engine.fixed_step.supported_bodies import is_known
from flocking.engine.tiles.body_check import BodyCheck
from flocking.engine.tiles.neighbours.listed_pairs import tile_pairs
from flocking.engine.tiles.particles.displacement import ROUNDINGS
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays
from flocking.model.law import Law, Scenario

FEW = 400
"""Agents sampled where a given step is only tested for gross instability, which needs no accurate estimate."""


def choose(particles: ParticleArrays, scenario: Scenario, scheme: str) -> float:
    """The largest step that resolves the start, from a sample of agents spread evenly over the sorted order.

    Parameters
    ----------
    scheme
        Name of the integrator.
    """
    sampled = [_sampled(particles, number) for number in range(len(particles.lists))]
    moving = particles.X[particles.m :, : particles.n].T.astype(np.float64) if particles.spec.order == 1 else None
    limit = largest_step(scenario, sampled, scheme, moving)
    return limit if is_known(scenario.agents) else min(limit, _body_step(particles, scenario))


def _body_step(particles: ParticleArrays, scenario: Scenario) -> float:
    """The largest step that resolves what bodies of other kinds than those of the library add at the start."""
    t = scenario.start.t
    particles.move(t, keep=0.0, kick=1.0, drift=0.0, exponential_damping=0.0, hold=True)
    places = np.arange(0, particles.n, max(1, particles.n // SAMPLE))
    rate = BodyCheck(scenario, float(np.finfo(particles.dtype).eps)).fastest_rate(particles, places, t)
    return PERIODS / rate if rate > 0 else np.inf


def resolves(particles: ParticleArrays, scenario: Scenario, scheme: str) -> float:
    """The largest step that resolves the forces at the start, regardless of the length of the run and of speeds.

    Parameters
    ----------
    scheme
        Name of the integrator.
    """
    sampled = [_sampled(particles, number, FEW) for number in range(len(particles.lists))]
    return resolving_step(scenario, sampled, scheme, across=False)


def energy_doubt(particles: ParticleArrays, law: Law) -> float:
    """Estimated change of the stored energy of all pairs by the rounding of positions, from a sample of tiles."""
    sampled = [_sampled(particles, number, FEW) for number in range(len(particles.lists))]
    blur = ROUNDINGS * float(np.finfo(particles.dtype).eps) * float(np.abs(particles.X[: particles.m]).max(initial=0.0))
    # A rank of many may have no tile.
    times = particles.tiles / max(len(_tiles(particles, FEW)), 1)
    own = np.array([times * energy_rounding(law, sampled, blur)])
    return float(particles.group_sum(own)[0])


def _tiles(particles: ParticleArrays, agents: int) -> range:
    """Tiles of a sample."""
    return range(0, particles.tiles, max(1, particles.n // agents))


def _sampled(particles: ParticleArrays, number: int, agents: int = SAMPLE) -> SampledPairs | None:
    lists, m = particles.lists[number], particles.m
    if lists is None:
        return None
    i, j = tile_pairs(lists, _tiles(particles, agents), particles.n)
    distance = particles.distances(i, j)
    speed = np.sqrt(((particles.X[m:, j] - particles.X[m:, i]).astype(np.float64) ** 2).sum(axis=0))
    inside = distance < (particles.radii.cutoffs[number] or np.inf)
    first, second = (particles.ids[x[inside]].astype(np.int64) for x in (i, j))
    return SampledPairs(first, second, distance[inside], speed[inside])
