from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import flocking as fk
from flocking.errors import FormulaError, InvalidInput
from flocking.model.potentials.poles import poles
from flocking.study.scenario_files.scenario_file import parse_scenario, scenario_to_text

TANNER = fk.Potential("1/r^2 + log(r^2)")
ZHOU = fk.Potential("1/r + 1/(R - r)", R=4)
SHI = fk.Potential(
    "where(r^2 <= b/a, a*log(r^2) + b/r^2, where(r <= R, a*(1 + log(b/a)) + "
    "cos((1 + (r^2 - b/a)/(R^2 - b/a))*pi) + 1, a*(1 + log(b/a)) + 2))",
    a=1, b=1.5, R=3,
)  # fmt: skip
LENNARD = fk.Potential("4*e*((s/r)^12 - (s/r)^6)", e=0.7, s=1.1)
POTENTIALS = {
    "tanner": TANNER, "zhou": ZHOU, "shi": SHI, "lennard-jones": LENNARD,
    "spring": fk.Potential("k*(r - d)^2/2", k=3, d=1.2), "abs": fk.Potential("abs(r - 1.3)"),
    "constant": fk.Potential("7"), "wave": fk.Potential("sin(3*r)/r"), "cut": TANNER.cut(2.5),
    "capped": TANNER.capped(2.5), "shifted": TANNER.shifted(2.5), "smoothed": TANNER.smoothed(3, 1.5),
    "twice capped": TANNER.capped(2.5).capped(2), "zhou smoothed": ZHOU.smoothed(3, 2),
    "all": LENNARD.shifted(2).capped(2).smoothed(1.9, 1.4).cut(1.8),
}  # fmt: skip


@pytest.mark.parametrize("name", POTENTIALS)
def test_slope_and_curvature_are_the_derivatives(name):
    psi = POTENTIALS[name]
    r = np.linspace(0.31, 3.7, 173)
    h = 1e-6
    for kink in psi.kinks():
        r = r[abs(r - kink) > 10 * h]
    slope = (psi(r + h) - psi(r - h)) / (2 * h)
    assert psi.slope(r) == pytest.approx(slope, rel=2e-6, abs=1e-7)
    curvature = (psi.slope(r + h) - psi.slope(r - h)) / (2 * h)
    assert psi.curvature(r) == pytest.approx(curvature, rel=2e-6, abs=1e-7)


@pytest.mark.parametrize("name", POTENTIALS)
def test_equality_hash_pickle_and_copy(name):
    psi = POTENTIALS[name]
    for twin in (pickle.loads(pickle.dumps(psi)), copy.deepcopy(psi), fk.Potential(psi.formula, **psi.parameters)):
        assert twin == psi
        assert hash(twin) == hash(psi)
        assert twin(1.234) == psi(1.234)
    assert psi != fk.Potential("1/r^3")


@pytest.mark.parametrize("name", POTENTIALS)
def test_latex_is_written(name):
    psi = POTENTIALS[name]
    assert psi.latex()
    assert psi.slope_latex()
    assert all(parameter.split("_")[0] in psi.latex() for parameter in psi.parameters)


def test_latex_of_a_known_formula():
    assert ZHOU.latex() == r"\frac{1}{R - r} + \frac{1}{r}"
    assert ZHOU.slope_latex() == r"\frac{1}{\left(R - r\right)^{2}} - \frac{1}{r^{2}}"


def test_values_at_known_points():
    assert TANNER(1.0) == 1.0
    assert TANNER.slope(1.0) == 0.0
    assert ZHOU([1.0, 2.0]).tolist() == [1 + 1 / 3, 1.0]
    assert np.isinf(ZHOU(0.0))
    assert np.isinf(ZHOU(4.0))
    assert POTENTIALS["constant"](np.ones((2, 3))).shape == (2, 3)


@given(st.floats(0.5, 5), st.floats(0.2, 6))
def test_wrappers_do_what_they_say(radius, r):
    value = float(TANNER(r))
    assert TANNER.cut(radius)(r) == pytest.approx(value if r < radius else 0.0)
    assert TANNER.capped(radius)(r) == pytest.approx(value if r < radius else float(TANNER(radius)))
    assert TANNER.shifted(radius)(r) == pytest.approx(value - float(TANNER(radius)))
    smooth = TANNER.smoothed(radius, radius / 2)
    bump = np.clip((r - radius / 2) / (radius / 2), 0, 1)
    assert smooth(r) == pytest.approx(value * (1 + np.cos(np.pi * bump)) / 2, abs=1e-12)


def test_wrapping_twice_keeps_both_radii():
    twice = TANNER.capped(3).capped(2)
    assert twice(2.5) == TANNER(2.0)
    assert TANNER.capped(2).capped(3)(2.5) == TANNER(2.0)
    assert TANNER.cut(2).cut(3)(2.5) == 0


def test_wrapping_leaves_parameters_of_any_name_alone():
    odd = fk.Potential("PSI/r + cap + PSI_AT_cap*r", PSI=2, cap=3, PSI_AT_cap=5)
    wrapped = odd.capped(4)
    assert wrapped(2.0) == odd(2.0)
    assert wrapped(9.0) == odd(4.0)
    assert wrapped.kinks() == (4.0,)


def test_smoothing_hides_a_singularity_beyond_it():
    assert ZHOU.smoothed(3, 2)([4.0, 5.0]).tolist() == [0, 0]


@pytest.mark.parametrize("unit", [1e-12, 1e-9, 1.0, 1e9])
def test_kinks_and_poles_are_found_in_every_unit(unit):
    """Borders and poles that are roots of no polynomial: x^5 - x = 1 and x = cos(x) for x = r/unit."""
    kink = fk.Potential("where((r/u)^5 - r/u < 1, r, 2)", u=unit)
    assert kink.kinks() == (pytest.approx(1.1673039782614187 * unit, rel=1e-14),)
    pole = fk.Potential("1/(cos(r/u) - r/u)^2", u=unit)
    assert poles(pole) == (pytest.approx(0.7390851332151607 * unit, rel=1e-14),)


def test_kinks():
    assert TANNER.kinks() == ()
    assert SHI.kinks() == (pytest.approx(1.5**0.5), 3.0)
    assert SHI.with_parameters(R=2.5).kinks()[1] == 2.5
    assert fk.Potential("abs(r - 1.5)").kinks() == (1.5,)
    assert fk.Potential("where(r^5 - r < 1, r, 2)").kinks() == (pytest.approx(1.1673039782614187, rel=1e-14),)
    assert fk.Potential("where(r^2 + b < 0, r, 2)", b=1).kinks() == ()
    assert fk.Potential("where(b*r < 0, r, 2)", b=0).kinks() == ()
    assert fk.Potential("where(b < 3, r, 2)", b=0).kinks() == ()
    sines = fk.Potential("where(sin(r) < 0, r, 2)").kinks()
    assert sines[:3] == pytest.approx([np.pi, 2 * np.pi, 3 * np.pi])
    assert len(sines) == 64
    assert fk.Potential("where(log(r) < b, where(exp(r) < 2, 1, r), 3)", b=1.0).kinks() == pytest.approx(
        [np.log(2), np.e], rel=1e-14
    )


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: fk.Potential("1/r + R"), "uses 'R', which has no value"),
        (lambda: fk.Potential("1/r", R=3), "is not in the formula"),
        (lambda: fk.Potential("1/r", r=3), "is the distance"),
        (lambda: fk.Potential("formula*r", parameters={"formula": 2.0}), "must not have a parameter called formula"),
        (lambda: fk.Potential("R/r", R=float("nan")), "R must be finite"),
        (lambda: fk.Potential("R/r", R="3"), "R must be a number"),
        (lambda: fk.Potential("R/r", R=True), "R must be a number"),
        (lambda: fk.Potential("r.real"), "Attribute"),
        (lambda: TANNER.cut(-1), "radius must be greater than 0"),
        (lambda: TANNER.capped(0), "radius must be greater than 0"),
        (lambda: TANNER.shifted(np.inf), "distance must be finite"),
        (lambda: TANNER.smoothed(1, 2), "onset must be less than 1"),
    ],
)
def test_bad_input_is_explained(make, words):
    with pytest.raises((FormulaError, InvalidInput), match=words):
        make()


def test_parameters_cannot_be_changed_in_place():
    with pytest.raises(TypeError):
        ZHOU.parameters["R"] = 5  # type: ignore[index]
    assert ZHOU.with_parameters(R=5).parameters["R"] == 5
    assert "R=4)" in repr(ZHOU)
    assert "R=4.000000125)" in repr(ZHOU.with_parameters(R=4.000000125))


def test_a_parameter_may_be_called_self(tmp_path):
    psi, path = fk.Potential("self*r", self=2.0), fk.Path(["self*t"], self=2.0)
    assert float(psi(3.0)) == 6.0
    assert path.at(1.0)[1].tolist() == [2.0]
    scenario = fk.Scenario(fk.Law(fk.Complete(), [fk.Gradient(psi)]), fk.State([[0.0], [1.0]]), t_end=0.1)
    fk.write_scenario(scenario, tmp_path / "self.toml")
    assert fk.read_scenario(tmp_path / "self.toml").law == scenario.law


@pytest.mark.parametrize("name", ["velocity", "start", "start_time", "parameters"])
def test_names_of_fields_of_other_parts_are_names_of_parameters(name):
    psi = fk.Potential(f"{name}*r", parameters={name: 2.0})
    again = pickle.loads(pickle.dumps(psi))
    assert again == psi
    assert float(again.with_parameters(**{name: 3.0})(2.0)) == 6.0
    scenario = fk.Scenario(fk.Law(fk.Complete(), [fk.Gradient(psi)]), fk.State([[0.0], [1.0]]), t_end=0.1)
    assert parse_scenario(scenario_to_text(scenario)).law == scenario.law


SQUARES = {
    "sqrt((r - 1)**2)": (1, 1.0),
    "((r - R)**2)**0.5": (1, 2.0),
    "((r - 1)**2)**(3/2)": (3, 1.0),
    "sqrt((r - 1)**2/1)": (1, 1.0),
    "sqrt(sqrt((r - 1)**4))": (1, 1.0),
    "exp(log((r - 1)**2)/2)": (1, 1.0),
}
"""Roots of squares: the power of |r - a| that each is, and a."""


@pytest.mark.parametrize("text", SQUARES)
def test_the_root_of_a_square_is_an_absolute_value_with_its_kink(text):
    power, at = SQUARES[text]
    psi = fk.Potential(text, **({"R": 2.0} if "R" in text else {}))
    r = np.array([0.25, 0.75, 1.5, 3.0])
    side = np.sign(r - at)
    assert psi(r) == pytest.approx(np.abs(r - at) ** power, rel=1e-14)
    assert psi.slope(r) == pytest.approx(power * side * np.abs(r - at) ** (power - 1), rel=1e-14)
    assert psi.curvature(r) == pytest.approx(power * (power - 1) * np.abs(r - at) ** max(power - 2, 0), rel=1e-14)
    assert psi.kinks() == pytest.approx((at,))


@pytest.mark.parametrize("power", [2.0, 3.0, 4.5])
def test_powers_with_a_parameter_have_derivatives_where_their_base_is_zero(power):
    psi = fk.Potential("abs(r - a)**k", k=power, a=1.25)
    r = np.array([0.75, 1.25, 2.25])
    away = np.abs(r - 1.25)
    assert psi.slope(r) == pytest.approx(np.sign(r - 1.25) * power * away ** (power - 1), rel=1e-14, abs=0.0)
    assert psi.curvature(r) == pytest.approx(power * (power - 1) * away ** (power - 2), rel=1e-14, abs=0.0)


def test_a_start_at_the_rest_length_of_a_potential_with_a_parameter_as_exponent_has_a_force():
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("(r - 1)**k", k=2))])
    force = fk.evaluate(law, fk.State([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]])).u[:, 0]
    assert force == pytest.approx([4.0, 2.0, -6.0], rel=1e-15)


@pytest.mark.parametrize(
    ("formula", "numbers", "at", "slope", "curvature"),
    [
        ("(r - d)**n", {"d": 1.0, "n": 0.0}, 1.0, 0.0, 0.0), ("(r - d)**n", {"d": 1.0, "n": 1.0}, 1.0, 1.0, 0.0),
        ("(r - d)**n", {"d": 1.0, "n": 2.0}, 1.0, 0.0, 2.0), ("r**n", {"n": 0.0}, 0.0, 0.0, 0.0),
        ("r**n", {"n": 1.0}, 0.0, 1.0, 0.0), ("r*(r**2 - 1)**(k*n)", {"k": 1.0, "n": 1.0}, 1.0, 2.0, 6.0),
    ],
)  # fmt: skip
def test_powers_of_zero_and_one_have_slopes_where_their_base_is_zero(formula, numbers, at, slope, curvature):
    """n b**(n - 1) is no 0 times infinity there; beside it the parameter counts as before."""
    psi = fk.Potential(formula, **numbers)
    assert float(psi.slope(at)) == slope
    assert float(psi.curvature(at)) == curvature
    assert psi.slope([at, at + 1.0]).tolist()[1] == psi.slope(at + 1.0)


@pytest.mark.parametrize("engine", ["exact", "sampled", "tiles"])
def test_a_power_of_zero_is_no_silent_force_where_its_base_is_zero(engine):
    """Kernels keep the parameter: agents at that distance have no finite force, and a run says so."""
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("(r - d)**n", d=1.0, n=0.0))])
    control = {"control": fk.Held(0.1)} if engine == "sampled" else {}
    start = fk.State([[0.0, 0.0], [1.0, 0.0]])
    with pytest.raises(fk.FlockingError, match=r"finite|NaN"):
        fk.simulate(fk.Scenario(law, start, t_end=0.2, frames=2, **control), engine=engine, progress=False)


def test_a_condition_on_a_positive_distance_holds_at_contact():
    assert float(fk.Potential("where(r > 0, r + 2, 5)").at_contact) == 2.0
