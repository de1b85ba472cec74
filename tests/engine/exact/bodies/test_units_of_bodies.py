"""Lagged agents and ledgers in small units: as accurate as in usual ones."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.exact.barriers import least_energy, relative_gap

PLACES = np.array([[0.0, 0.0], [1.0, 0.2], [0.3, 1.1]])
VELOCITIES = np.array([[0.1, 0.0], [0.0, -0.2], [0.1, 0.1]])


def ends(unit: float, tolerance: float) -> np.ndarray:
    """Places at the end, over the unit of length."""
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("r**2/2 + a**2*log(r/a)/10", a=unit)), fk.Consensus(0.3)])
    made = fk.Scenario(
        law, fk.State(PLACES * unit, VELOCITIES * unit), t_end=4.0, frames=2, tolerance=tolerance,
        agents=fk.Lagged(fk.PointMass(), 0.3),
    )  # fmt: skip
    return fk.simulate(made, progress=False).q[-1] / unit


def test_lagged_agents_are_as_accurate_in_small_units():
    best = ends(1.0, 1e-12)
    assert np.abs(ends(2.0**-40, 1e-9) - best).max() < 1e-9


@pytest.mark.parametrize(("kept", "least"), [(1e-9, 1.0), (3e-7, 1.0), (1e-29, 1e-20)])
def test_energies_count_as_at_least_1_but_in_small_units(kept, least):
    found = least_energy(kept, 1e-9)
    assert found == pytest.approx(least)
    # A fifth of the energy that is missing is a large gap, however small the unit.
    assert relative_gap(0.8 * least, 0.0, least, 0.0, 0.0, 0.0, found) == pytest.approx(0.2)
