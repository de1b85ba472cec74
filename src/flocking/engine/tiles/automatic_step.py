"""Choice of the time step from a sample of the listed pairs."""

from __future__ import annotations

import numpy as np

from flocking.engine.fixed_step.automatic_step import SAMPLE, SampledPairs, largest_step, resolving_step
from flocking.engine.tiles.neighbours.listed_pairs import tile_pairs
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays
from flocking.model.law import Scenario

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
    return largest_step(scenario, sampled, scheme, moving)


def resolves(particles: ParticleArrays, scenario: Scenario, scheme: str) -> float:
    """The largest step that resolves the forces at the start, regardless of the length of the run and of speeds.

    Parameters
    ----------
    scheme
        Name of the integrator.
    """
    sampled = [_sampled(particles, number, FEW) for number in range(len(particles.lists))]
    return resolving_step(scenario, sampled, scheme, across=False)


def _sampled(particles: ParticleArrays, number: int, agents: int = SAMPLE) -> SampledPairs | None:
    lists, m = particles.lists[number], particles.m
    if lists is None:
        return None
    i, j = tile_pairs(lists, range(0, particles.tiles, max(1, particles.n // agents)), particles.n)

    distance = particles.distances(i, j)
    speed = np.sqrt(((particles.X[m:, j] - particles.X[m:, i]).astype(np.float64) ** 2).sum(axis=0))
    inside = distance < (particles.radii.cutoffs[number] or np.inf)
    return SampledPairs(i[inside], distance[inside], speed[inside])
