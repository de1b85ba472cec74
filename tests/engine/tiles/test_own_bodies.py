"""Bodies of users and mixtures in fixed steps, against the exact engine as steps become short."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import sympy

import flocking as fk
from flocking.arrays import Array
from flocking.engine.driver.registry import engine_named
from flocking.engine.tiles.engine import ENGINE
from flocking.engine.tiles.options import TilesOptions
from flocking.errors import LawNotObeyed, UnsupportedLaw
from tests.bodies import Actuated, Heavy
from tests.engine.tiles.test_bodies import VARIED, N, errors, scenario


@dataclass(frozen=True, eq=False)
class Drifting(fk.Body):
    """A point mass in a wind that depends on place, time and a number of its own."""

    masses: float | Array = 1.0
    damping: float | Array = 0.0
    wind: float | Array = 1.0
    order = 2
    columns = (fk.Column("phase", 1),)
    parameters = property(lambda self: {"wind": self.wind})

    def lets(self, x):
        wave = sympy.sin(x.q[0] / 3 + 2 * x.t)
        return {"push": x.parameter("wind") * wave * sympy.exp(-(x.columns["phase"][0] ** 2))}

    def rates(self, x):
        return {
            "p": [(u - x.damping * v + x.let("push")) / x.mass for u, v in zip(x.u, x.p, strict=True)],
            "phase": [sympy.tanh(x.q[1]) - x.columns["phase"][0]],
        }


@dataclass(frozen=True, eq=False)
class Sticky(Actuated):
    """One with something that acts only at times."""

    def held(self, dimension):
        return ("stuck",)


@dataclass(frozen=True, eq=False)
class Rounded(Actuated):
    """One whose rates need a function that kernels do not have."""

    def rates(self, x):
        return super().rates(x) | {"force": [sympy.floor(u) - f for u, f in zip(x.u, x.columns["force"], strict=True)]}


OWN = {
    "actuated": Actuated(VARIED, 0.1, 0.3 * VARIED),
    "in a wind": Drifting(VARIED, 0.1, 0.5 * VARIED),
    "a mixture": fk.Mixture((fk.PointMass(), fk.Unicycle(0.3), Actuated()), [0, 1, 2] * (N // 3)),
}


@pytest.mark.parametrize("name", OWN)
def test_bodies_of_users_are_of_order_four(name):
    found, departed = errors(OWN[name])
    assert found[-1, 0] < 1e-6
    assert np.log2(found[0, 0] / found[1, 0]) > 3.3
    assert np.log2(found[0, 2] / found[1, 2]) > 3.3
    assert departed > 1.0
    assert found[-1, 1] <= 1e-6 * departed


def test_a_limit_stands_before_a_mixture():
    bodies = fk.Limited(OWN["a mixture"], force=4.0)
    found, departed = errors(bodies)
    free, _ = errors(bodies.body)
    assert found[-1, 0] < 1e-4 < found[0, 0] * 100
    assert found[-1, 1] <= 1e-4 * departed


def test_the_automatic_step_resolves_what_bodies_add():
    """A force that follows within tau needs steps of 0.15 tau where that is the fastest rate."""
    taus = np.array([0.05, 0.005, 0.0005])
    steps = [ENGINE.open(scenario(Actuated(time_constant=tau)), TilesOptions()).step for tau in taus]
    assert steps[0] == pytest.approx(0.005), "a hundredth of the run"
    assert np.array(steps[1:]) == pytest.approx(0.15 * taus[1:], rel=0.05)


@pytest.mark.parametrize("name", ["actuated", "in a wind"])
def test_kernels_that_misread_a_body_of_users_are_found(name, monkeypatch):
    session = ENGINE.open(scenario(OWN[name]), TilesOptions(step=0.01))
    particles, row = session._particles, {"actuated": "time_constant", "in a wind": "wind"}[name]
    slot = particles.spec.layout.slot("bodies", row)
    take = particles._set_parameters

    def wrong(scenario, t):
        take(scenario, t)
        numbers = particles.parameters.P if slot[0] == "P" else particles.parameters.A
        numbers[int(slot[1:])] *= 1.01

    monkeypatch.setattr(particles, "_set_parameters", wrong)
    with pytest.raises(LawNotObeyed, match=type(OWN[name]).__name__):
        session.advance(1.0)


@pytest.mark.parametrize(("kind", "why"), [
    (Heavy, "Heavy agents, whose kinetic energy is another one than that of points"),
    (Sticky, "Sticky agents, of which something acts only at times"),
])  # fmt: skip
def test_what_rates_alone_do_not_state_is_refused(kind, why):
    assert why in engine_named("tiles").why_not(scenario(kind()))
    assert why in engine_named("tiles").why_not(scenario(fk.Limited(kind(), force=1.0)))


def test_functions_that_kernels_do_not_have_are_refused():
    with pytest.raises(UnsupportedLaw, match="no form of the function floor"):
        fk.simulate(scenario(Rounded()), engine="tiles", step=0.01, progress=False)


def test_held_control_and_ranks_refuse_them_by_name():
    held = scenario(OWN["actuated"], control=fk.Held(0.1))
    assert "Actuated agents under held control" in engine_named("tiles").why_not(held)
    assert "Actuated agents on ranks" in engine_named("lammps").why_not(scenario(OWN["actuated"]))
