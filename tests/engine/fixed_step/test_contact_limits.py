"""Limits of pair formulas where two agents coincide."""

import numpy as np
import pytest
import sympy

import flocking as fk
from flocking.formula.contact import ENDLESS, defined_at_contact, limit_at_contact

r = sympy.Symbol("r", positive=True)
k = sympy.Symbol("P0", real=True)


@pytest.mark.parametrize(
    ("formula", "limit"),
    [
        (k * (r - 2) ** 2, 4 * k), (sympy.sin(k * r) / r, k), ((1 - sympy.cos(r)) / r**2, sympy.Rational(1, 2)),
        (r * sympy.log(r), 0), (sympy.exp(-1 / r), 0), (1 / r - sympy.cos(r) / r, 0),
        (1 / r, None), (sympy.log(r), None),
        (sympy.exp(sympy.exp(sympy.exp(1 / r))), None), (sympy.exp(-sympy.exp(sympy.exp(1 / r))), 0),
        (1 / sympy.sqrt(r), None), (sympy.log(r) ** 2 + k, None), (sympy.sqrt(r - 1), None),
        (sympy.Piecewise((k * sympy.sin(r) / r, r < 1), (0, True)), k),
        (sympy.sinh(64) - sympy.log(r / 3) ** 3, None),
        (sympy.tanh(k) * sympy.sin(r) / r, sympy.tanh(k)), (sympy.sin(r * sympy.exp(k)) / r, sympy.exp(k)),
        ((sympy.sin(r) - r) / r**9 + (1 / sympy.Integer(6)) / r**6 - sympy.Rational(1, 120) / r**4
         + sympy.Rational(1, 5040) / r**2, sympy.Rational(1, 362880)),
        (sympy.Piecewise((1, r < 1), (0, True)) * sympy.sin(r) / r, 1),
    ],
)  # fmt: skip
def test_limits(formula, limit):
    assert limit_at_contact(formula, r) == limit


def test_functions_of_parameters_alone_are_not_looked_into(monkeypatch):
    """SymPy looked for relations among them for 20 s and more, and need not be asked about a logarithm at all."""
    asked, limit = [], sympy.limit
    monkeypatch.setattr(sympy, "limit", lambda e, *rest: asked.append(e) or limit(e, *rest))
    psi = fk.Potential("sinh(16*(R/2 + where(r < r, 0.5, 2))) - log(r/3)**3", R=4.0)
    assert limit_at_contact(psi.symbolic()[1], psi.symbolic()[0]) is None
    assert not asked
    assert limit_at_contact(sympy.sinh(k) * sympy.sin(r * sympy.exp(k)) / r, r) == sympy.sinh(k) * sympy.exp(k)
    assert not asked[0].has(k)


def test_a_branch_without_a_limit_is_endless_where_it_holds():
    found = limit_at_contact(sympy.Piecewise((sympy.log(r), r < k), (r, True)), r)
    assert found.subs(k, 1) == sympy.Symbol(ENDLESS, real=True)
    assert found.subs(k, -1) == 0


def test_only_what_cannot_be_evaluated_at_contact_is_changed():
    regular, singular = k * (r - 2) ** 2, 1 / r
    assert defined_at_contact(regular, r) is regular
    assert defined_at_contact(singular, r) is singular
    assert defined_at_contact(sympy.sin(r) / r, r).subs(r, sympy.Float(0)) == 1


@pytest.mark.parametrize("graph", [fk.Proximity(2.0), fk.Smooth(2.0, 0.3)])
def test_the_reference_and_the_exact_engine_take_the_limit(graph):
    """sin(r)/r is 1 where agents meet, and its slope 0."""
    law = fk.Law(graph, [fk.Gradient(fk.Potential("sin(r)/r"))])
    state = fk.State([[0.0, 0.0], [0.0, 0.0], [0.5, 0.0]], [[0.0, 1.0], [0.0, -1.0], [0.0, 0.0]])
    told = fk.evaluate(law, state)
    assert np.isfinite(told.u).all()
    near = fk.evaluate(law, fk.State(state.q + [[0, 1e-7], [0, 0], [0, 0]], state.p))
    assert told.storage == pytest.approx(near.storage, abs=1e-6)
    run = fk.simulate(fk.Scenario(law, state, t_end=0.2, frames=2), progress=False)
    assert run.trace["energy"][0] == pytest.approx(told.storage + told.kinetic, rel=1e-14)
    assert np.abs(run.residual).max() < 1e-8
