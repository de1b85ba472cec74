"""The judge itself: closed forms, conservation laws, and another arithmetic."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import mpmath
import numpy as np
import pytest

import flocking as fk
from tests.validation.draws import draw, generator
from tests.validation.judge.formulas import derivative, parsed
from tests.validation.judge.motion import CompilerMissing, Follow, Judge, Links, PairPart, Piece, Problem
from tests.validation.laws import FAMILIES
from tests.validation.truths import value_of

PAIR = (Links(fixed=((0, 1),)),)


def pair_problem(parts, *, distance=1.0, speed=0.0, across=0.0, end=1.0, graphs=PAIR, **more) -> Problem:
    """Two agents on the x axis that separate at ``speed`` and pass at ``across``."""
    q = np.array([[-distance / 2, 0.0], [distance / 2, 0.0]])
    p = np.array([[-speed / 2, -across / 2], [speed / 2, across / 2]])
    return Problem(q, p, 0.0, end, np.linspace(0, end, 5), graphs, parts, **more)


def exact(value: np.longdouble) -> mpmath.mpf:
    """The same number in mpmath."""
    high = float(value)
    return mpmath.mpf(high) + mpmath.mpf(float(value - np.longdouble(high)))


def offset(motion) -> np.ndarray:
    """Offset of the second agent from the first at the end."""
    return motion.q[-1, 1] - motion.q[-1, 0]


def test_it_shares_no_code_with_the_library() -> None:
    for path in (Path(__file__).parent / "judge").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [x.name for x in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not any(name.startswith("flocking") for name in names), path


def test_without_a_compiler_it_says_what_to_install(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(CompilerMissing, match="install gcc"):
        Judge(tmp_path)


def test_a_straight_flight_meets_the_radius_when_it_must(judge: Judge) -> None:
    flight = PairPart((Piece(drag="c"),), {"c": 0.0})
    problem = pair_problem((flight,), distance=8.0, speed=-2.0, across=0.5, end=8.0, graphs=(Links(2.0, 2.0),))
    motion = judge.motion(problem)
    # (8 - 2 t)^2 + (t/2)^2 = 4
    roots = [float((16 + s * np.sqrt(np.longdouble(256 - 4.25 * 60))) / np.longdouble(4.25)) for s in (-1, 1)]
    assert [x.kind for x in motion.switches] == ["appear", "break"]
    np.testing.assert_allclose([x.time for x in motion.switches], roots, rtol=4e-16)
    nearest = 4.0 / np.sqrt(4.25)
    assert motion.closest_linked.distance == pytest.approx(nearest, rel=4e-16)


def test_with_hysteresis_a_link_breaks_farther_out_than_it_appears(judge: Judge) -> None:
    flight = PairPart((Piece(drag="c"),), {"c": 0.0})
    problem = pair_problem((flight,), distance=8.0, speed=-2.0, across=0.5, end=8.0, graphs=(Links(1.945, 2.5),))
    motion = judge.motion(problem)
    # (8 - 2 t)^2 + (t/2)^2 = r^2; the first, 1.945, is just above the closest approach, 1.9403
    wide = np.longdouble
    first, last = (
        float((16 + s * np.sqrt(256 - wide(4.25) * (64 - wide(r) ** 2))) / wide(4.25))
        for s, r in ((-1, 1.945), (1, 2.5))
    )
    assert [x.kind for x in motion.switches] == ["appear", "break"]
    np.testing.assert_allclose([x.time for x in motion.switches], [first, last], rtol=1e-15)


@pytest.mark.parametrize("digits", [18, 30])
def test_a_spring_crosses_its_radius_in_closed_form(judges, digits: int) -> None:
    k, d, speed, radius = 1.0, 2.0, np.sqrt(2), 3 - 1e-6
    spring = PairPart((Piece("k*(r - d)**2/2"),), {"k": k, "d": d}, graph=1)
    problem = pair_problem((spring,), distance=d, speed=speed, end=30.0, graphs=(Links(radius, radius), PAIR[0]))
    motion = judges[digits].motion(problem)
    with mpmath.workdps(40):
        omega = mpmath.sqrt(2)
        first = mpmath.asin((mpmath.mpf(radius) - 2) * omega / mpmath.mpf(float(speed))) / omega
        turns = [first + 2 * mpmath.pi * k / omega for k in range(7)]
        backs = [mpmath.pi / omega - first + 2 * mpmath.pi * k / omega for k in range(7)]
        end = 2 + mpmath.mpf(float(speed)) / omega * mpmath.sin(30 * omega)
        places = [exact(motion.q[-1, i, 0]) + exact(motion.rest[-1, 0, i, 0]) for i in range(2)]
        found = places[1] - places[0]
        assert abs(found - end) < (1e-17 if digits == 18 else 1e-30)
    assert [x.kind for x in motion.switches] == ["break", "appear"] * 7
    # A shallow crossing multiplies the error of positions by the inverse of its speed, 700.
    np.testing.assert_allclose([x.time for x in motion.switches[::2]], [float(x) for x in turns], rtol=0, atol=2e-14)
    np.testing.assert_allclose([x.time for x in motion.switches[1::2]], [float(x) for x in backs], rtol=0, atol=2e-14)


@pytest.mark.parametrize(("digits", "error"), [(18, 1e-16), (30, 1e-28)])
def test_an_ellipse_closes(judges, digits: int, error: float) -> None:
    """Two bodies under -1/r (Kepler): the period is 2 pi sqrt(a^3/2)."""
    speed = 1.0
    # 1/a = 2/r - v^2/2
    period = float(2 * np.pi * np.sqrt((2 / 3) ** 3 / 2))
    problem = pair_problem((PairPart((Piece("-1/r"),)),), across=speed, end=period)
    motion = judges[digits].motion(problem)
    with mpmath.workdps(40):
        missed = float(2 * mpmath.pi * mpmath.sqrt((mpmath.mpf(2) / 3) ** 3 / 2) - mpmath.mpf(period))
    # What is left of the period is flown with the speed and bent by the force, 2, at the start.
    ends = offset(motion) + np.longdouble(missed) * np.array([0, speed])
    if digits == 30:
        ends = ends + (motion.rest[-1, 0, 1] - motion.rest[-1, 0, 0])
    assert np.abs(ends - [1.0, 0.0]).max() < max(error, missed**2 * 2)


def test_consensus_decays_exponentially(judge: Judge) -> None:
    motion = judge.motion(pair_problem((PairPart((Piece(drag="c"),), {"c": 0.7}),), speed=2.0, end=3.0))
    decayed = 2.0 * np.exp(-np.longdouble(2) * np.longdouble(0.7) * 3)
    assert abs((motion.p[-1, 1] - motion.p[-1, 0])[0] - decayed) < 1e-18


def test_a_leader_is_followed_in_closed_form(judge: Judge) -> None:
    """v' = -h (v - sin t) from rest: v = (h^2 sin t - h cos t + h exp(-h t))/(1 + h^2)."""
    h = 0.5
    follow = Follow(("sin(w*t)", "cos(w*t)"), {"w": 1.0}, (0.0, 0.0), np.zeros(2), np.full(2, h), np.zeros(2))
    motion = judge.motion(pair_problem((PairPart((Piece("0*r"),)),), end=4.0, follow=follow))
    t = np.longdouble(4.0)
    expected = (h**2 * np.sin(t) - h * np.cos(t) + h * np.exp(-h * t)) / (1 + h**2)
    np.testing.assert_allclose(motion.p[-1, :, 0], [expected] * 2, rtol=0, atol=1e-18)


def test_a_tangency_is_decided_at_twelve_digits(judge: Judge) -> None:
    flight = PairPart((Piece(drag="c"),), {"c": 0.0})
    for k in (1, 6, 12):
        for sign in (-1, 1):
            radius = 2.0 * (1 + sign * 10.0**-k)
            q = np.array([[0.0, 0.0], [-3.0, 2.0]])
            p = np.array([[0.0, 0.0], [1.5, 0.0]])
            problem = Problem(q, p, 0.0, 4.0, np.array([0.0, 4.0]), (Links(radius, radius),), (flight,))
            motion = judge.motion(problem)
            assert [x.kind for x in motion.switches] == (["appear", "break"] if sign > 0 else [])
            if sign < 0 and k > 1:
                assert motion.grazes[0].gap == pytest.approx(2.0 - radius, rel=1e-3)


def test_energy_and_momentum_stay_without_drag(judge: Judge) -> None:
    """Smooth links change neither; the judge's rise of the energy is rounding."""
    for name in ("logarithms", "exponentials", "even", "bent", "smooth_energies", "smooth_quintic"):
        made = FAMILIES[name](generator(3, 1), 4, 2)
        parts = (made.parts[0],)
        rng = np.random.default_rng(5)
        q, p = rng.uniform(-1.5, 1.5, (4, 2)), rng.normal(size=(4, 2)) * 0.5
        problem = Problem(q, p, 0.0, 3.0, np.linspace(0, 3, 4), made.graphs, parts, shifts=False)
        motion = judge.motion(problem)
        assert motion.steps > 3
        assert abs(motion.energies[1] - motion.energies[0]) < 1e-14 * max(1, abs(motion.energies[0])), name
        assert np.abs(motion.p.sum(axis=1) - motion.p[0].sum(axis=0)).max() < 1e-16, name


def test_slopes_are_those_of_the_formulas() -> None:
    for text in ("1/r + 1/(4 - r)", "r**1.5*exp(-r/2)", "log(cosh_(r))", "sqrt(r)*sin(r) + cos(r)/r", "tanh(r)"):
        plain = text.replace("cosh_(r)", "(exp(r) + exp(-r))/2")
        tree = derivative(parsed(plain, {}), "r")
        with mpmath.workdps(30):
            names = {x: getattr(mpmath, x) for x in ("exp", "log", "sqrt", "sin", "cos", "tanh")}
            slope = mpmath.diff(lambda r, text=plain, names=names: eval(text, {**names, "r": r}), 1.3)
        assert value_of(tree, 1.3) == pytest.approx(float(slope), rel=1e-12)


@pytest.mark.parametrize("name", sorted(FAMILIES))
def test_both_statements_of_a_law_are_one(judge: Judge, name: str) -> None:
    """The library's control at the start is the judge's: its motion over a very short time."""
    rng = generator(11, 4)
    made = FAMILIES[name](rng, 3, 2)
    q = rng.uniform(-0.7, 0.7, (3, 2)) * min(made.scale, 2.0) + np.array([[0, 0], [0.9, 0], [0, 0.9]])
    p = rng.normal(size=(3, 2))
    state = fk.State(q, p)
    control = fk.control(made.law, state)
    masses = np.broadcast_to(np.asarray(made.agents.masses), 3)[:, None]
    damping = np.broadcast_to(np.asarray(made.agents.damping), 3)[:, None]
    h = 2.0**-40
    problem = Problem(
        q, p, 0.0, h, np.array([0.0, h]), made.graphs, made.parts, masses[:, 0], damping[:, 0], made.follow, False
    )
    motion = judge.motion(problem)
    rate = np.asarray((motion.p[-1] - motion.p[0]) / h, dtype=float)
    np.testing.assert_allclose(masses * rate + damping * p, control, rtol=1e-6, atol=1e-5)


def test_the_other_arithmetic_agrees(judges) -> None:
    """mpmath's own Taylor integrator at 30 digits, and the judge's 128-bit numbers."""
    parts = (PairPart((Piece("1/r + 1/(R - r)"),), {"R": 3.0}), PairPart((Piece(drag="c"),), {"c": 0.5}))
    problem = pair_problem(parts, speed=0.5, across=0.3, end=0.5)
    problem = replace(problem, shifts=False)
    motion = judges[30].motion(problem)
    with mpmath.workdps(34):

        def rates(_t, y):
            d, v = y[:2], y[2:]
            r = mpmath.sqrt(d[0] ** 2 + d[1] ** 2)
            force = -1 / r**2 + 1 / (3 - r) ** 2
            return [*v, *(-2 * (force * d[k] / r + v[k] / 2) for k in range(2))]

        start = [mpmath.mpf(x) for x in (1.0, 0.0, float(np.float64(0.5)), float(np.float64(0.3)))]
        end = mpmath.odefun(rates, 0, start)(mpmath.mpf("0.5"))
        for k in range(2):
            both = [exact(motion.q[-1, i, k]) + exact(motion.rest[-1, 0, i, k]) for i in range(2)]
            assert abs(both[1] - both[0] - end[k]) < 1e-29


def test_draws_do_not_depend_on_each_other() -> None:
    one, two = draw(5, 17), draw(5, 17)
    assert (one.problem.q == two.problem.q).all()
    assert one.law == two.law
    assert {draw(5, k).kind for k in range(60)} >= {"ordinary", "passing", "moved"}
