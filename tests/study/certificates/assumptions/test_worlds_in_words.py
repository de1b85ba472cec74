"""What holds under continuous control and exact knowledge alone says so, also where another world is declared."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk

FIRST = {"bodies": fk.SingleIntegrator()}
SPRING = fk.Gradient(fk.Potential("r**2/2"))
LATTICE = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("a/r + r**2", a=2.0)), fk.Consensus(1.0)])
PAIR = fk.State([[0.0, 0.3], [1.7, 0.0]], np.zeros((2, 2)))
RING = fk.Fixed(3, ((0, 1), (1, 2), (2, 0)), directed=True)
THREE = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], np.zeros((3, 2)))
SETTINGS = {
    "a lattice of order 1": fk.Scenario(LATTICE, PAIR, t_end=10.0, **FIRST),
    "a lattice of order 2": fk.Scenario(LATTICE, PAIR, t_end=10.0),
    "agreement of order 1": fk.Scenario(fk.Law(fk.Complete(), [SPRING]), THREE, t_end=10.0, **FIRST),
    "agreement of order 2": fk.Scenario(fk.Law(fk.Complete(), [SPRING, fk.Consensus(1.0)]), THREE, t_end=10.0),
    "a directed ring": fk.Scenario(fk.Law(RING, [SPRING]), THREE, t_end=10.0, **FIRST),
}


@pytest.mark.parametrize("name", SETTINGS)
def test_a_statement_of_another_world_than_the_declared_one_names_that_world(name):
    """Control that acts 5 late makes all of these groups swing ever wider."""
    found = fk.certify(SETTINGS[name].with_(control=fk.Held(0.1, latency=5.0))).granted
    assert found
    for certificate in found:
        words = certificate.statement.lower()
        if certificate.key.endswith("in_world"):
            continue  # of the declared world
        if "period" in certificate.key or certificate.key == "equilibrium_loss":
            assert "at the same times and without latency" in words, certificate.key
        else:
            assert "in the ideal world" in words or "under continuous control" in words, certificate.key


def test_a_lattice_swings_ever_wider_where_its_ideal_deformations_decay():
    """The stiffness of the pair is 12: control held for 0.18 is longer than 2/12, up to which deformations fall."""
    pull = fk.Law(fk.Complete(), LATTICE.terms[:1])
    near = fk.State([[0.0, 0.0], [1.0 + 1e-6, 0.0]])
    held = fk.Scenario(pull, near, t_end=9.0, frames=2, control=fk.Held(0.18), **FIRST)
    assert "in the ideal world" in fk.certify(held)["equilibrium_decay_rate"].statement
    q = fk.simulate(held, progress=False).q
    assert abs(np.linalg.norm(q[-1, 1] - q[-1, 0]) - 1.0) > 1e-3  # 1.16 at every tick, of which there are 50
