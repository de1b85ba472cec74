"""Numbers beyond what formulas and double precision hold are refused by name, and JSON holds no infinity."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.formula.intervals import Interval
from flocking.study.certificates.certificate import GRANTED, Certificate, Enclosure, decided
from flocking.study.certificates.enclosed_matrices import norm_bound

START = fk.State([[0.0, 0], [1, 0], [0, 1]], [[0.0, 0.1], [0, 0], [0.2, 0]])


def keys_of(scenario: fk.Scenario) -> list[str]:
    return [c.key for c in fk.certify(scenario)]


@pytest.mark.parametrize("number", [1e101, 1e-200, 1e300])
@pytest.mark.parametrize("formula", ["a*r**2", "a/r + r**2"])
@pytest.mark.parametrize("bodies", [fk.PointMass(), fk.SingleIntegrator()])
def test_coefficients_beyond_exact_numbers_are_refused_by_name(number, formula, bodies):
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential(formula, a=number))])
    scenario = fk.Scenario(law, START, t_end=1.0, bodies=bodies)
    found = fk.certify(scenario)
    assert "below 1e100" in found["largest_energy"].reason
    assert found["largest_energy"].outcome == "refused"
    ordinary = fk.Law(law.graph, [fk.Gradient(fk.Potential(formula, a=1.0))])
    assert [c.key for c in found] == keys_of(scenario.with_(law=ordinary))
    assert not any(c.granted for c in found if c.key.startswith(("equilibrium", "decay", "delay")))
    # What does not ask for the formula is said all the same.
    assert found["steady_drift"].granted == isinstance(bodies, fk.PointMass)


def test_a_repulsion_of_obstacles_beyond_exact_numbers_is_refused_by_name():
    avoid = fk.Avoid([fk.Ball([5.0, 0.0], 1.0)], range=1.0, repulsion=fk.Potential("a/r", a=1e101), gamma_agents=False)
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("r**2")), avoid])
    found = fk.certify(fk.Scenario(law, START, t_end=1.0))
    assert "below 1e100" in found["obstacles_not_entered"].reason


def test_energies_beyond_double_precision_are_not_promised():
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("r**2"))])
    found = fk.certify(fk.Scenario(law, replace(START, p=1e200 * START.p), t_end=1.0))
    assert found["largest_energy"].outcome == "refused"
    assert "the energy is finite" in found["largest_energy"].reason
    assert all(c.safe_bound is None or np.isfinite(c.safe_bound) for c in found)
    json.dumps(found.as_dict(), allow_nan=False)


def test_a_bound_is_granted_where_the_ends_that_are_relied_on_are_finite():
    assert decided("x", "", (), bound=Enclosure(-np.inf, 1.0)).granted
    assert decided("x", "", (), bound=Enclosure(1.0, np.inf), side="at least").granted
    for side, bound in (("at most", (0.0, np.inf)), ("at least", (-np.inf, 0.0)), ("is", (0.0, np.inf))):
        refused = decided("x", "", (), bound=Interval.of(*bound), side=side)
        assert not refused.granted
        assert refused.bound is None
    assert not decided("x", "", (), bound=Enclosure(0.0, np.nan)).granted


def test_json_has_null_for_an_infinite_end():
    one = Certificate("x", "", "", (), GRANTED, bound=Enclosure(-np.inf, 2.0))
    text = json.dumps(one.as_dict(), allow_nan=False)
    assert json.loads(text)["bound"] == {"lower": None, "upper": 2.0}


@pytest.mark.filterwarnings("error")
def test_a_bound_that_overflows_is_infinite_without_a_warning():
    assert norm_bound(np.full((2, 2), 1e200)) == np.inf
    assert norm_bound(np.full((2, 2), 1e307)) == np.inf
    assert norm_bound(np.full((2, 2), 1e100)) == pytest.approx(2e100)
