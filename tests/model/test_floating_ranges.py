"""Formulas reach compiled code as they are written: algebra may not turn finite values into infinite ones."""

from __future__ import annotations

import ast
from pathlib import Path

import mpmath
import numpy as np
import pytest
from mpmath import cos, cosh, exp, sin

import flocking as fk
from flocking.formula.identities import is_zero, nothing_or_itself

SOURCES = Path(fk.__file__).parent
ALGEBRA = {
    "expand", "simplify", "powsimp", "powdenest", "together", "factor", "cancel", "collect", "nsimplify", "trigsimp",
    "logcombine", "radsimp", "ratsimp", "apart", "expand_mul", "expand_power_exp", "expand_log", "separatevars",
}  # fmt: skip
PLACES_OF_ALGEBRA = {
    # cancels a task of asyncio: no algebra
    "apps/lab/live/hub.py",
    # finds zeros and drops every other result
    "formula/identities.py",
    # expands polynomials of masked functions
    "model/leaders_and_obstacles/leader_positions.py",
    # decides what kind of function a leader's acceleration is, and encloses exact numbers of it in intervals
    "study/certificates/linear/leader_errors.py",
    # decides whether rates of a user's body are what the body states, and keeps the difference for nothing else
    "engine/kernels/stated_motions.py",
    # decides whether the pieces of a potential meet, and keeps the difference for nothing else
    "study/certificates/pieces.py",
}


def test_algebra_stays_where_its_results_reach_no_compiled_code():
    found = {}
    for path in SOURCES.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in ALGEBRA:
                found.setdefault(path.relative_to(SOURCES).as_posix(), set()).add(node.func.attr)
    assert set(found) == PLACES_OF_ALGEBRA


def group(terms, **more):
    law = fk.Law(fk.Proximity(2.0), terms)
    return fk.Scenario(law, fk.State([[0.0, 0], [1, 0.5]], [[0.0, 1], [0.5, 0]]), 20.0, frames=21, **more)


@pytest.mark.parametrize(("size", "width"), [(1.0, 0.5), (1e-6, 0.5), (1e4, 0.5), (3.0, 0.2), (1.0, 40.0)])
def test_a_bell_of_velocity_ends_no_run(size, width):
    from scipy.special import erf

    leader = fk.Path(["a*exp(-((t - 5)/w)**2)", "0"], a=size, w=width)
    scenario = group([fk.Consensus(1.0), fk.Track(leader, 1.0, 1.0)], energy=fk.Energy("leader", leader))
    run = fk.simulate(scenario, progress=False)
    assert run.status == "finished"
    trace = run.trace
    residual = trace["energy"] - trace["energy"][0] + trace["dissipated"] - trace["supplied"]
    assert np.abs(residual).max() < 1e-6 * max(1.0, np.abs(trace["supplied"]).max(), np.abs(trace["energy"]).max())
    moved = size * width * np.sqrt(np.pi) / 2 * (erf(15 / width) + erf(5 / width))
    assert leader.at(20.0)[0][0] == pytest.approx(moved, rel=1e-9)


@pytest.mark.parametrize("energy", ["lab", "leader", "centre of mass"])
@pytest.mark.parametrize("order", [1, 2])
def test_the_ledger_of_a_bell_is_finite_at_all_times(energy, order):
    leader = fk.Path(["a*exp(-((t - 5)/w)**2)", "0"], a=2.0, w=0.5)
    other = fk.Energy(energy, leader if energy == "leader" else None)
    law = fk.Law(fk.Proximity(2.0), [fk.Track(leader, 0.0, 1.0, 1.0)])
    for t in (0.0, 5.0, 18.0, 40.0, 1e3, 1e6):
        state = fk.State([[0.0, 0], [1, 0.5]], [[0.0, 1], [0.5, 0]], t)
        found = fk.evaluate(law, state, agents=fk.Agents(order=order), energy=other)
        assert np.isfinite([found.supply, found.dissipation, found.storage, *found.u.ravel()]).all(), t


FORMS = {
    "late": ("exp(-(t - 1000))", lambda t: -exp(1000 - t), 1000.0, [1000.5, 1010.0, 2000.0]),
    "early": ("exp(-(t + 700))*exp(t)", lambda t: t * exp(-700), 0.0, [1.0, 100.0]),
    "narrow": ("exp((t - 1000000)/w)", lambda t: exp((t - 10**6) * 1000) / 1000, 999999.99, [999999.995, 1e6]),
    "slow": ("exp(1e-9*t)", lambda t: 10**9 * exp(t / 10**9), 0.0, [1e-3, 1.0, 1e4]),
    "slow wave": ("sin(1e-9*t + 1)", lambda t: -(10**9) * cos(t / 10**9 + 1), 0.0, [1e-3, 1.0, 1e4]),
    "far wave": ("cos(3*(t - 100000))^2", lambda t: t / 2 + sin(6 * (t - 10**5)) / 12, 99999.0, [1e5, 100001.0]),
    "far power": ("(t - 1000000)^3", lambda t: (t - 10**6) ** 4 / 4, 999999.0, [999999.5, 1000001.5]),
    "far product": (
        "(t - 1000000)*(1 + cos(t - 1000000))",
        lambda t: (t - 10**6) ** 2 / 2 + cos(t - 10**6) + (t - 10**6) * sin(t - 10**6),
        999999.0,
        [999999.5, 1000001.5],
    ),
    "two lines": (
        "(t - 1000)*(2*t - 2001)^2",
        lambda t: (t - 1000) ** 4 - 4 * (t - 1000) ** 3 / 3 + (t - 1000) ** 2 / 2,
        999.0,
        [999.5, 1001.0],
    ),
    "damped": (
        "(t - 500)^2*exp(-2*(t - 500))",
        lambda t: -exp(-2 * (t - 500)) * (2 * (t - 500) ** 2 + 2 * (t - 500) + 1) / 4,
        500.0,
        [500.1, 503.0, 600.0],
    ),
    "steep": ("sinh(50*(t - 3))", lambda t: cosh(50 * (t - 3)) / 50, 0.0, [1.0, 6.5]),
}  # fmt: skip
"""Velocity, an integral of it, the start time, and times to look at."""


@pytest.mark.parametrize("name", FORMS)
def test_positions_in_closed_form_keep_their_digits(name):
    formula, integral, begin, times = FORMS[name]
    leader = fk.Path([formula], start_time=begin, **({"w": 0.001} if name == "narrow" else {}))
    assert leader.closed_form
    with mpmath.workdps(60):
        for t in times:
            truth = integral(mpmath.mpf(t)) - integral(mpmath.mpf(begin))
            found = mpmath.mpf(float(leader.at(t)[0][0]))
            assert abs(found - truth) < 1e-12 * abs(truth) + 1e-13 * (name == "damped"), (t, found, truth)


def test_numbers_in_an_exponent_stay_in_it():
    leader = fk.Path(["exp((t - 1000000)/0.001)"], start_time=999999.99)
    assert leader.at(1e6)[1][0] == 1.0
    psi = fk.Potential("exp(-(r - 900.5)/0.001)")
    assert psi(900.5) == 1.0
    assert psi.slope(900.5) == pytest.approx(-1000.0, rel=1e-9)


def test_zeros_are_found_and_all_else_stays_as_written():
    import sympy

    t, w = sympy.symbols("t w", real=True)
    bell = sympy.exp(-(((t - 5) / w) ** 2))
    assert nothing_or_itself(bell - 2 * bell) == -bell
    assert nothing_or_itself((t + w) ** 2 - t**2 - 2 * t * w - w**2) == 0
    assert nothing_or_itself(sympy.sin(t) ** 2 + sympy.cos(t) ** 2 - 1) == 0
    almost = t * (1 + sympy.Rational(1, 10**15)) - t
    assert not is_zero(almost)
    assert not is_zero(sympy.Piecewise((t, t > 0), (0, True)))


def test_a_parameter_reaches_the_algebra_with_all_its_digits():
    import sympy

    value = 0.1 + 3 * 2.0**-56
    r = sympy.Symbol("r", positive=True)
    assert fk.Potential("k*r", k=value).expression(r) / r == sympy.Rational(value)


@pytest.mark.parametrize("weighting", ["energy", "force"])
def test_forces_of_steep_exponentials_are_finite(weighting):
    psi = fk.Potential("a*exp(-((r - c)/w)**2) + exp(-k*(r - 1))", a=2.0, c=1.4, w=0.02, k=300.0)
    law = fk.Law(fk.Smooth(2.0, 0.5), [fk.Gradient(psi, weighting=weighting)])
    for r in (1e-3, 0.5, 1.0, 1.39, 1.4, 1.7, 1.999):
        found = fk.evaluate(law, fk.State([[0.0], [r]], [[1.0], [-1.0]]))
        assert np.isfinite([found.supply, found.storage, *found.u.ravel()]).all(), r
