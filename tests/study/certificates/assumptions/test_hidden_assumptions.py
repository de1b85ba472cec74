"""What a theorem assumes without saying so: largest speeds, units, sizes of groups, graphs of single terms."""

from __future__ import annotations

import signal
from contextlib import contextmanager
from fractions import Fraction

import mpmath
import numpy as np
import pytest

import flocking as fk
from flocking.study.certificates.certificate import Certificates
from flocking.study.certificates.comparison import compare
from flocking.study.certificates.pieces import leader_at

RNG = np.random.default_rng(5)
PLACES, VELOCITIES = RNG.normal(size=(4, 2)), 0.3 * RNG.normal(size=(4, 2))
TRIANGLE = fk.State([[0.0, 0], [1.3, 0], [0.2, 1.1]], [[0.0, 0], [0, 0.2], [0.1, 0]])


@contextmanager
def soon(seconds: float):
    """An error where something takes more processor time."""

    def late(*_: object) -> None:
        raise TimeoutError(f"took more than {seconds:g} s of the processor")

    before = signal.signal(signal.SIGVTALRM, late)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def test_an_agent_at_its_largest_speed_does_not_make_way():
    """One at the speed 2 is 0.3 behind one at 1: braking alone takes 1^2/2 = 0.5, and making way as well 0.25."""
    push = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("-100*r"))])
    start = fk.State([[0.0], [0.3]], [[2.0], [1.0]])
    nearest = {}
    for speed in (None, [2.0, 1.0]):
        bodies = fk.Limited(fk.PointMass(), force=1.0, speed=speed)
        scenario = fk.Scenario(push, start, t_end=0.5, frames=51, bodies=bodies)
        gaps = np.diff(fk.simulate(scenario, progress=False).q[:, :, 0], axis=1)
        nearest[speed is None] = float(gaps.min())
        for control in (scenario.control, fk.Held(0.01)):
            found = fk.certify(scenario.with_(control=control))
            assert found["braking_suffices"].granted == (speed is None)
            assert found["stopping_distance"].granted
    assert nearest[True] == pytest.approx(0.05, abs=1e-3)
    assert nearest[False] < 0.0
    assert "out of the way" in found["braking_suffices"].reason


def test_obstacles_alone_are_a_law():
    """A push of (2 - s) before a wall, of one agent at the speed v: it stops at s with (2 - s)^2 = v^2."""
    wall = fk.Avoid(
        [fk.Wall([-4.0, 0.0], [1.0, 0.0])], range=2.0, gamma_agents=False, repulsion_gain=1.0, damping_gain=0.0,
        repulsion=fk.Potential("(r - 2)**2/2"), onset=0.999,
    )  # fmt: skip
    scenario = fk.Scenario(fk.Law(fk.Complete(), [wall]), fk.State([[0.0, 0]], [[-1.0, 0.3]]), t_end=8.0, frames=81)
    found = fk.certify(scenario)["obstacles_not_entered"]
    assert found.granted
    assert found.bound.lo == pytest.approx(2.0 - np.sqrt(1.09), abs=2e-3)
    row = next(r for r in compare(fk.certify(scenario), fk.simulate(scenario, progress=False)) if r.key == found.key)
    assert row.kept
    assert row.observed == pytest.approx(1.0, abs=1e-3)


def test_only_links_of_the_graph_of_the_law_are_promised_to_stay():
    spring = fk.Gradient(fk.Potential("r**2/2"))
    law = fk.Law(fk.Fixed.complete(2), [spring, fk.Consensus(0.1, over=fk.Proximity(1.0))])
    scenario = fk.Scenario(law, fk.State([[0.0, 0], [0.9, 0]], [[0, 0.0], [1.0, 0]]), t_end=2.0, frames=2)
    assert (fk.simulate(scenario, progress=False).switches["kind"] == "break").any()
    found = fk.certify(scenario)
    for key in ("links_kept", "longest_link"):
        assert found[key].granted
        assert "of the graph of the law" in found[key].statement
    one = fk.certify(scenario.with_(law=fk.Law(law.graph, [spring])))
    assert "graph of the law" not in one["links_kept"].statement
    # Others than linked ones collide unseen.
    terms = [fk.Gradient(fk.Potential("1/r + r**2")), fk.Consensus(1.0, over=fk.Complete())]
    far = fk.Law(fk.Fixed(3, ((0, 1),)), terms)
    apart = fk.certify(fk.Scenario(far, TRIANGLE, t_end=1.0))["closest_approach"]
    assert "linked in the graph of the law" in apart.statement


def test_agents_of_order_one_are_single_integrators_by_either_name():
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("r**2/2"))])
    one, other = (
        fk.certify(fk.Scenario(law, TRIANGLE, t_end=1.0, bodies=bodies))
        for bodies in (fk.SingleIntegrator(), fk.Agents(order=1))
    )
    assert [(c.key, c.outcome, c.statement) for c in one] == [(c.key, c.outcome, c.statement) for c in other]
    assert {"largest_energy", "decay_rate", "disagreement"} <= {c.key for c in other.granted}


@pytest.mark.parametrize(
    ("with_names", "with_digits", "numbers"),
    [
        ("a*exp(-r/s) + r**2", "exp(-100*r/37) + r**2", {"a": 1.0, "s": 0.37}),
        ("exp(-b*r) + r**2", "exp(-1e6*r) + r**2", {"b": 1e6}),
        ("r**b + 1/r", "r**0.37 + 1/r", {"b": 0.37}),
        ("2**(-r*b) + r**2", "exp(-0.25646445*r) + r**2", {"b": 0.37}),
        ("(1 - exp(-a*(r - b)))**2", "(1 - exp(-1.7*(r - 1.13)))**2", {"a": 1.7, "b": 1.13}),
    ],
)
def test_exponents_of_sixteen_digits_take_no_longer(with_names, with_digits, numbers):
    """A product of powers of exp(r/q), of which exp(-0.37 r) has three thousand million million."""
    found = []
    for potential in (fk.Potential(with_names, **numbers), fk.Potential(with_digits)):
        law = fk.Law(fk.Complete(), [fk.Gradient(potential)])
        with soon(20.0):
            found.append(fk.certify(fk.Scenario(law, TRIANGLE, t_end=1.0)))
    for key in ("largest_energy", "longest_link", "closest_approach"):
        assert found[0][key].outcome == found[1][key].outcome
        if found[1][key].granted:
            assert found[0][key].safe_bound == pytest.approx(found[1][key].safe_bound, rel=1e-6)
    assert found[0]["largest_energy"].granted


@pytest.mark.parametrize("known", [0.0, 1.0])
def test_formulas_of_leaders_are_simplified_only_where_that_can_help(known):
    strange = ["exp(sin(cos(t)))/(2 + sin(t**2)*cos(3*t)**5)", "log(2 + sin(t))**3*atan(t)"]
    wave, line = ["2*sin(t)*cos(t)", "1 - 2*sin(t)**2"], ["3*t", "sin(1)"]
    for formulas, steady in ((strange, False), (wave, True), (line, True)):
        law = fk.Law(fk.Complete(), [fk.Consensus(1.0), fk.Track(fk.Path(formulas), 1.0, 1.0, known)])
        with soon(20.0):
            found = fk.certify(fk.Scenario(law, TRIANGLE, t_end=1.0))["steady_leader_error"]
        assert found.granted == (steady or known == 1.0)


def test_the_state_of_a_leader_is_enclosed_late_in_a_wave():
    """At w t = 3e8 the rounding of the product alone turns the phase by up to 3e-8."""
    w, late = 0.3, 1e9 + 1 / 3
    place, velocity = leader_at(fk.Path(["A*cos(w*t)", "1"], w=w, A=1e6), late)
    with mpmath.workdps(60):
        angle = mpmath.mpf(Fraction(w).numerator) / Fraction(w).denominator * mpmath.mpf(late)
        exact = 10**6 * mpmath.cos(angle), 10**6 * mpmath.sin(angle) / mpmath.mpf(w)
        for found, value in ((velocity, exact[0]), (place, exact[1])):
            assert mpmath.mpf(float(found.lo[0])) <= value <= mpmath.mpf(float(found.hi[0]))


def scaled(kind: str, length: float, time: float, mass: float) -> fk.Scenario:
    """The same motion in other units."""
    start = fk.State(length * PLACES, length / time * VELOCITIES)
    pole, spring = mass * length**3 / time**2, mass / time**2
    near = fk.Gradient(fk.Potential("a/r + b*r**2", a=pole, b=spring))
    leader = fk.Velocity([0.3 * length / time, 0.1 * length / time], start=[length, 0.0])
    graph, terms = {
        "energy": (fk.Complete(), [near, fk.Consensus(2.0 * mass / time)]),
        "barrier": (fk.Hysteresis(4.0 * length, 0.1 * length), [
            fk.Gradient(fk.Potential("a/r + a/(R - r)", a=8.0 * pole, R=4.0 * length)), fk.Consensus(mass / time)]),
        "leader": (fk.Complete(), [
            fk.Gradient(fk.Potential("a/r", a=pole)), fk.Track(leader, 0.5 * spring, 0.7 * mass / time)]),
    }[kind]  # fmt: skip
    return fk.Scenario(fk.Law(graph, terms), start, t_end=4.0 * time, bodies=fk.PointMass(mass))


DIMENSIONS = {
    "largest_energy": (2, -2, 1), "closest_approach": (1, 0, 0), "longest_link": (1, 0, 0),
    "group_diameter": (1, 0, 0), "largest_speed": (1, -1, 0), "largest_force": (1, -2, 1),
    "mean_leader_error": (1, -1, 0), "equilibrium_delay": (0, 1, 0), "equilibrium_period": (0, 1, 0),
}  # fmt: skip


@pytest.mark.parametrize("kind", ["energy", "barrier", "leader"])
def test_units_of_length_time_and_mass_change_no_promise(kind):
    """Powers of two, so that rounding is the same: nanometres, a thousand million metres, microseconds, grams."""
    first: Certificates = fk.certify(scaled(kind, 1.0, 1.0, 1.0))
    assert len(first.granted) >= 6
    for units in ((2.0**-30, 1.0, 1.0), (2.0**30, 1.0, 1.0), (2.0**-30, 2.0**-20, 2.0**-60), (1.0, 2.0**20, 2.0**40)):
        found = fk.certify(scaled(kind, *units))
        assert [(c.key, c.outcome) for c in found] == [(c.key, c.outcome) for c in first]
        for key, powers in DIMENSIONS.items():
            if first[key].granted:
                unit = float(np.prod([x**k for x, k in zip(units, powers, strict=True)]))
                assert found[key].safe_bound == pytest.approx(first[key].safe_bound * unit, rel=1e-6)


def test_large_groups_are_refused_by_name_before_all_pairs_are_looked_at():
    n = 100_000
    start = fk.State(np.arange(2.0 * n).reshape(n, 2), np.ones((n, 2)))
    limited = fk.Limited(fk.PointMass(), force=1.0)
    aligning, agreeing = fk.Law(fk.Complete(), [fk.CuckerSmale(1.0, 1.0)]), fk.Law(fk.Complete(), [fk.Consensus(1.0)])
    for law, bodies, key, outcome in (
        (aligning, fk.PointMass(), "alignment_rate", "not applicable"),
        (aligning, limited, "braking_suffices", "refused"),
        (agreeing, fk.PointMass(), "decay_rate", "not applicable"),
    ):  # fmt: skip
        with soon(5.0):
            found = fk.certify(fk.Scenario(law, start, t_end=1.0, bodies=bodies))
        assert found[key].outcome == outcome
        assert "agents" in found[key].reason
        assert str(n) in found[key].reason


def test_no_more_pairs_collide_than_there_are():
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("exp(-r)"))])
    found = fk.certify(fk.Scenario(law, fk.State(TRIANGLE.q, 1e150 * TRIANGLE.p), t_end=1.0))
    assert found["simultaneous_collisions"].bound.hi == 3.0
