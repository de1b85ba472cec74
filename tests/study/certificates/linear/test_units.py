"""Certificates of linear laws in other units: the same outcome, and bounds that differ by the units alone."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.formula.intervals import Interval
from flocking.study.certificates.consensus_certificates import LinearConsensus
from flocking.study.certificates.linear.directed_modes import DirectedModes
from flocking.study.certificates.linear.lossy_lattice import LossyLattice
from flocking.study.certificates.linear.near_equilibrium import NearEquilibrium
from flocking.study.certificates.sampled_consensus import SampledConsensus

TRIANGLE = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.9]])
PERIOD = 0.125
PATH = fk.Fixed(3, ((0, 1), (1, 2)))


def lossy(potential: str, graph: fk.Graph, unit: float) -> fk.Scenario:
    """Three agents that lose messages, where what lasts 1 in the unit of time lasts ``unit``."""
    terms = [fk.Gradient(fk.Potential(f"({potential})/{unit**2!r}")), fk.Consensus(1.0 / unit)]
    messages = fk.Messages(PERIOD * unit, loss=0.2, expires=PERIOD * unit)
    return fk.Scenario(
        fk.Law(graph, terms), fk.State(TRIANGLE, 0.0 * TRIANGLE), t_end=unit, frames=2,
        control=fk.Held(PERIOD * unit), information=messages,
    )  # fmt: skip


def test_lost_messages_have_the_same_growth_in_any_unit_of_time():
    worlds = [SampledConsensus(LinearConsensus(lossy("r**2/2", PATH, unit))) for unit in (1.0, 2.0**20)]
    assert all(world.holds for world in worlds)
    usual, other = (world.recursion(world.period).growth() for world in worlds)
    assert usual[0] < usual[1] < 1.0
    assert np.allclose(usual, other, rtol=1e-9)


def test_a_lattice_that_loses_messages_has_the_same_bounds_in_any_unit_of_time():
    usual, other = (NearEquilibrium(lossy("(r - 1)**2", fk.Proximity(1.8), unit)) for unit in (1.0, 2.0**20))
    rate, scaled = usual.rate(), other.rate()
    assert np.allclose([rate.lo, rate.hi], [scaled.lo * 2.0**20, scaled.hi * 2.0**20], rtol=1e-9)
    growth, same = LossyLattice(usual).growth, LossyLattice(other).growth
    # Bounds are narrowed by halves until little of the rate is left.
    assert abs(growth[0] - same[0]) < 1e-9
    assert abs(growth[1] - same[1]) < 0.02 * (1.0 - growth[1])


@pytest.mark.parametrize("unit", [2.0**-40, 1.0, 2.0**30])
def test_a_critically_damped_mode_has_its_rate_in_any_unit_of_time(unit):
    """The double root of s^2 + 2 s + 1, in discs about its eigenvalue."""
    modes = DirectedModes(np.array([1.0 + 0.0j]), np.array([1e-13]), Interval.of(unit**-2), Interval.of(2.0 / unit))
    rate = modes.rate()
    assert 0.9999 < rate.lo * unit <= 1.0 <= rate.hi * unit < 1.0001
