"""Linearisation by differences whose steps have the units of the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
import sympy

import flocking as fk
from flocking.model.terms.symbols import BodySymbols
from flocking.study.linearisation import linearise


@dataclass(frozen=True)
class Resistance(fk.BodyTerm):
    """-c |p|^2 p."""

    factor: float
    parameters = property(lambda self: {"factor": self.factor})
    structure = ("Resistance",)

    def force(self, x: BodySymbols) -> Sequence[sympy.Expr]:
        square = sum((v**2 for v in x.p), sympy.Integer(0))
        return [-x.parameter("factor") * square * v for v in x.p]


@pytest.mark.parametrize("speed", [1e-9, 1.0, 1e9])
def test_damping_in_any_unit_of_speed(speed: float) -> None:
    """u = -c |p|^2 p: the damping is 3 c v^2 along the velocity and c v^2 across it."""
    law = fk.Law(fk.Complete(), [Resistance(1.0 / speed**2)])
    found = linearise(law, fk.State([[0.0, 0.0]], [[speed, 0.0]]))
    np.testing.assert_allclose(found.damping, [[3.0, 0.0], [0.0, 1.0]], atol=1e-8)


@pytest.mark.parametrize("length", [1e-9, 1.0, 1e9])
def test_a_lone_agent_at_an_obstacle_in_any_unit_of_length(length: float) -> None:
    """The repulsion (r - d)^2/2 of a wall, nearer than the onset of the bump: its stiffness across the wall is 1."""
    wall = fk.Wall(np.array([0.0, 0.0]), np.array([1.0, 0.0]))
    psi = fk.Potential("(r - d)**2/2", d=length)
    avoid = fk.Avoid(
        [wall], range=4 * length, onset=0.9, repulsion=psi, repulsion_gain=1.0, damping_gain=0.0, gamma_agents=False
    )
    found = linearise(fk.Law(fk.Complete(), [avoid]), fk.State([[0.5 * length, 0.0]]))
    np.testing.assert_allclose(found.stiffness, [[1.0, 0.0], [0.0, 0.0]], atol=1e-6)
