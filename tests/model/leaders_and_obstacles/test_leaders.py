from __future__ import annotations

import math
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

import flocking as fk
from flocking.errors import FormulaError, InvalidInput

LEADERS = {
    "sink": fk.Sink([1.0, -2.0]),
    "velocity": fk.Velocity([0.3, -0.7], start=[1, 2], start_time=0.5),
    "velocity 3": fk.Velocity([0.3, -0.7, 2.0]),
    "circle": fk.Path(["sin(t)", "cos(t)"], start=[3, -1], start_time=0.25),
    "parameters": fk.Path(["a*sin(w*t)", "exp(-b*t)"], a=2, w=3, b=0.4),
    "polynomial": fk.Path(["t^2 - 1", "3", "t"], start=[0, 1, 2]),
    "still": fk.Path(["0", "t - t"], start=[1, 2]),
    "line": fk.Path(["t*exp(-t)"]),
    "waves": fk.Path(["t^2*exp(-b*t)*sin(w*t + c)", "cos(3*t)^3*sin(2*t)", "cosh(t)*(1 + t)^2"], b=0.3, w=1.7, c=0.4),
    "no closed form": fk.Path(["exp(-t^2)", "1/(1 + t^2)"], start=[1, -1], start_time=-0.5),
}  # fmt: skip


@pytest.mark.parametrize("name", LEADERS)
@given(t=st.floats(-2, 5))
def test_velocity_and_acceleration_are_the_derivatives(name, t):
    leader, h = LEADERS[name], 1e-5
    (q0, v0, _), (q1, v1, a1), (q2, v2, _) = (leader.at(x) for x in (t - h, t, t + h))
    assert (q2 - q0) / (2 * h) == pytest.approx(v1, rel=1e-6, abs=1e-8)
    assert (v2 - v0) / (2 * h) == pytest.approx(a1, rel=1e-6, abs=1e-8)
    assert q1.shape == v1.shape == a1.shape == (leader.dimension,)


@pytest.mark.parametrize("name", LEADERS)
def test_position_is_the_integral_of_the_velocity(name):
    from scipy.integrate import quad

    leader = LEADERS[name]
    begin = getattr(leader, "start_time", 0.0)
    start = np.asarray(getattr(leader, "point", getattr(leader, "start", None)))
    assert leader.at(begin)[0] == pytest.approx(start, abs=1e-12)
    for axis in range(leader.dimension):
        moved = quad(lambda s, axis=axis: leader.at(s)[1][axis], begin, 3.0)[0]
        assert leader.at(3.0)[0][axis] == pytest.approx(start[axis] + moved, abs=1e-9)


@pytest.mark.parametrize("name", LEADERS)
def test_forms_in_the_table_are_found(name):
    assert LEADERS[name].closed_form == (name != "no closed form")


@pytest.mark.parametrize("begin", [-3.0, 0.0])
def test_quadrature_gives_the_error_function(begin):
    from scipy.special import erf

    leader = fk.Path(["exp(-t^2)"], start=[2.0], start_time=begin)
    for t in (-2.0, 0.5, 4.0, 1000.0):
        moved = np.sqrt(np.pi) / 2 * (erf(t) - erf(begin))
        assert leader.at(t)[0][0] == pytest.approx(2.0 + moved, abs=1e-12)


def test_equal_frequencies_are_no_division_by_zero():
    leader = fk.Path(["sin(a*t)*sin(b*t)"], a=2.0, b=2.0)
    assert not leader.closed_form
    assert leader.at(1.5)[0][0] == pytest.approx(0.75 - np.sin(6.0) / 8, abs=1e-12)


@pytest.mark.parametrize(
    "formula",
    [
        "exp(sin(t)*log(2 + t^2))/(1 + t^4 + tanh(t))",
        "(1 + t + sin(t) + exp(-t))^40",
        "exp(t^2)*sin(t^3)",
        "*".join(f"(t + sin({k}*t))" for k in range(1, 30)),
        "sin(" * 12 + "t" + ")" * 12,
    ],
)
def test_looking_for_a_closed_form_is_quick(formula):
    begin = time.process_time()
    assert not fk.Path([formula]).closed_form
    assert time.process_time() - begin < 10.0


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: fk.Sink([np.nan, 0]), "point must be finite"),
        (lambda: fk.Sink(3.0), "point must have 1 axes"),
        (lambda: fk.Velocity([1, 2], start=[1]), "start must have 2 coordinates"),
        (lambda: fk.Velocity([1, np.inf]), "value must be finite"),
        (lambda: fk.Velocity([1, 2], start_time=np.nan), "start_time must be finite"),
        (lambda: fk.Velocity([1, 2], start_time="x"), "start_time must be a number"),
        (lambda: fk.Path([]), "one formula per axis"),
        (lambda: fk.Path("sin(t)"), "must have one formula per axis"),
        (lambda: fk.Path(["sin(t)"], start=[1, 2]), "start must have 1 coordinates"),
        (lambda: fk.Path(["sin(t)"], start_time=np.nan), "start_time must be finite"),
        (lambda: fk.Path(["a*t"]), "Path: a must be both used in a formula and given a value"),
        (lambda: fk.Path(["t"], a=1), "Path: a must be both used"),
        (lambda: fk.Path(["start_0*t"], start_0=1), "nor begin with start_"),
        (lambda: fk.Path(["velocity*t"], parameters={"velocity": 1}), "velocity must not be velocity or start"),
        (lambda: fk.Path(["start*t"], parameters={"start": 1}), "start must not be velocity or start"),
        (lambda: fk.Path(["a*t"], a=np.nan), "a must be finite"),
        (lambda: fk.Path(["t.real"]), "Attribute"),
        (lambda: fk.Path([3]), "must be text"),
    ],
)
def test_bad_input_is_explained(make, words):
    with pytest.raises((InvalidInput, FormulaError), match=words):
        make()


BURST = fk.Path(["100*exp(-((t - 0.53)/0.001)^2)", "where(t < 0.5, t, 3*t^2)"])
"""A burst that nine samples of [0, 1] do not meet."""


@pytest.mark.parametrize("leader", [*LEADERS.values(), BURST], ids=[*LEADERS, "burst"])
@given(begin=st.floats(-2, 5), length=st.floats(0, 1))
def test_no_speed_exceeds_its_bound(leader, begin, length):
    bound = leader.speed_bound(begin, begin + length)
    assert np.isfinite(bound)
    fastest = max(float(np.linalg.norm(leader.velocity_at(t))) for t in np.linspace(begin, begin + length, 33))
    assert fastest <= bound


def test_a_bound_of_the_speed_holds_between_samples_and_is_close_to_the_speed():
    samples = [np.linalg.norm(BURST.velocity_at(t)) for t in np.linspace(0, 1, 9)]
    assert 1.5 * max(samples) < np.linalg.norm(BURST.velocity_at(0.53)) <= BURST.speed_bound(0, 1)
    assert 1.0 <= LEADERS["circle"].speed_bound(2.0, 2.01) < 1.001
    assert fk.Velocity([3.0, 4.0]).speed_bound(0, 1) == pytest.approx(5.0, rel=1e-9)


def test_a_speed_without_bound_has_an_infinite_one():
    assert fk.Path(["1/(t - 0.5)"], start_time=1.0).speed_bound(0.0, 1.0) == np.inf
    many = " + ".join(f"where(t < {k}, t, {k + 1}*t)" for k in range(20))
    assert fk.Path([many]).speed_bound(0.0, 1.0) == np.inf


@pytest.mark.parametrize(
    ("condition", "jump"),
    [
        ("t < 0.4", 0.4),
        pytest.param("t < 17.3", 17.3, marks=pytest.mark.slow),
        pytest.param("t^2 - 9 < 0", 3.0, marks=pytest.mark.slow),
        pytest.param("exp(t/10) < 5", 10 * math.log(5), marks=pytest.mark.slow),
    ],
)
def test_a_position_is_right_where_the_velocity_jumps(condition, jump):
    """Quadrature does not see a jump near the end of a piece, and states 1e-12 for what is wrong by 1e-3."""
    leader = fk.Path([f"where({condition}, 1, 2)", f"where({condition}, 0, exp(-t^2))"])
    times = np.random.default_rng(0).uniform(jump, 102.0, 100)
    found = leader.along([*times, jump / 2])[0]
    assert np.abs(found[:-1, 0] - (2 * times - jump)).max() < 1e-9
    tail = np.array([math.sqrt(math.pi) / 2 * (math.erf(t) - math.erf(jump)) for t in times])
    assert np.abs(found[:-1, 1] - tail).max() < 1e-9
    assert found[-1].tolist() == pytest.approx([jump / 2, 0.0], abs=1e-12)


def test_a_position_before_the_start_is_right_where_the_velocity_jumps():
    leader = fk.Path(["where(t < 0.4, 1, exp(-t^2))"], start_time=5.0)
    tail = math.sqrt(math.pi) / 2 * (math.erf(5.0) - math.erf(0.4))
    assert leader.at(-1.5)[0][0] == pytest.approx(-(tail + 1.9), abs=1e-9)


@pytest.mark.parametrize(("length", "time"), [(1.0, 1.0), (2.0**-40, 1.0), (1.0, 2.0**-30), (2.0**40, 2.0**-30)])
def test_a_position_without_closed_form_is_right_in_all_units(length, time):
    """Velocities v exp(-w t) where sin(5 w t) >= 0, and v sqrt|cos(w t)|."""
    formulas = ["v*where(sin(5*w*t) < 0, 0, 1)*exp(-w*t)", "v*sqrt(abs(cos(w*t)))"]
    found = fk.Path(formulas, v=length / time, w=1 / time).at(7.3 * time)[0] / length
    edges = [math.pi / 5 * k for k in range(12)]
    on = sum(math.exp(-a) - math.exp(-b) for a, b in zip(edges[::2], edges[1::2], strict=True))
    # The integral of sqrt(sin t) from 0 to pi is 2.3962804694711844, sqrt(pi) gamma(3/4)/gamma(5/4).
    rest = quad(lambda s: math.sqrt(math.sin(s)), 0.0, 7.3 - 1.5 * math.pi, epsabs=1e-13)[0]
    assert found[0] == pytest.approx(on, abs=1e-9)
    assert found[1] == pytest.approx(2.3962804694711844 * 1.5 + rest, abs=1e-9)
