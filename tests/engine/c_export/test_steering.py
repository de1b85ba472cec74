"""Exported laws of agents of order 1 and in discrete time: steering terms, and the velocities that are set."""

import ctypes
from dataclasses import dataclass, replace

import numpy as np
import pytest

import flocking as fk
from flocking.engine.c_export.export import c_files
from flocking.errors import UnsupportedLaw
from flocking.model.terms import braking, steering
from tests.engine.c_export.building import CODES, CompiledLaw, needs_compiler
from tests.engine.c_export.judging import random_surroundings, steering_by_scalars
from tests.engine.c_export.rounding import Bounds, Exact
from tests.engine.c_export.test_on_this_machine import EPS, agree
from tests.engine.c_export.test_single_precision import random_state

pytestmark = needs_compiler

TERMS = (
    steering.Separation(1.2, 2.0, -0.7, near=0.3), steering.Separation(0.3, 2.0, total="mean", exponent=0.0, among=3.0),
    steering.Separation(0.7, 2.5, total="sum", exponent=1.5), steering.Alignment(0.8, 2.5, 0.5, total="mean"),
    steering.Alignment(0.4, 3.0, total="sum", compared="velocities"),
    steering.Alignment(0.9, 3.0, compared="headings", relative=False), steering.Cohesion(0.6, 3.0, -0.2),
    steering.Cohesion(0.1, 2.0, total="mean"), steering.TurnBack(2.0, 1.5), braking.SelfPropulsion(1.3),
    braking.LinearRepulsion(0.4, 2.5, 0.6), braking.BrakingAlignment(0.3, 0.2, 1.0, 0.9, 0.8, 3.0),
    braking.ShillWalls(4.0, 1.1, 0.7, 0.6), braking.ShillDisc((1.0, -1.0), 0.5, 1.2, 0.7, 0.5),
)  # fmt: skip


def scenario_of(terms, body=None, n=7, m=2, **parts):
    rng = np.random.default_rng(3)
    p = rng.normal(size=(n, m))
    p /= np.linalg.norm(p, axis=1)[:, None]
    law = fk.Law(fk.Proximity(3.0), list(terms))
    body = fk.Impulsive() if body is None else body
    return fk.Scenario(law, fk.State(rng.uniform(-3, 3, (n, m)), p), 1.0, agents=body, control=fk.Held(0.1), **parts)


def test_each_steering_term_is_that_of_the_law_and_of_a_second_text(tmp_path):
    """All terms at once, and two texts of each: the library's on arrays and the judge's on scalars."""
    rng = np.random.default_rng(4)
    for number, terms in enumerate([TERMS[:9], TERMS[9:]]):
        scenario = scenario_of(terms)
        folder = tmp_path / str(number)
        folder.mkdir()
        compiled = CompiledLaw(folder, scenario)
        assert agree(compiled, scenario, rng, 60) <= 8
        acted = np.zeros(len(terms))
        for _ in range(40):
            _, q, p, others = random_surroundings(rng, scenario)
            found = [steering_by_scalars(scenario_of([t]), q, p, others) for t in terms]
            _, u, _ = compiled.force(0, q, p, {j + 1: x for j, x in enumerate(others.values())})
            force, size = (sum(x[k] for x in found) for k in (0, 1))
            assert (np.abs(u - force) <= 8 * EPS * (size + 1e-300)).all()
            acted += [bool(x[0].any()) for x in found]
        assert (acted > 2).all()


@pytest.mark.parametrize("limit", [None, 0.8])
def test_single_precision_stays_within_the_bounds_of_intervals(limit, tmp_path):
    """The force of all terms at once, scaled back or not, and the exact one."""
    rng, scenario, shares = np.random.default_rng(8), scenario_of(TERMS), []
    compiled, saturated = CompiledLaw(tmp_path, scenario, float32=True, limit=limit), 0
    bounds, exactly = Bounds(compiled.files), Exact(c_files(scenario, limit=limit))
    for _ in range(60):
        state = random_state(rng, scenario)
        enclosure, (_, exact), (code, u, memory) = (f(*state) for f in (bounds.force, exactly.force, compiled.force))
        assert code == CODES["OK"]
        saturated += memory.saturated
        assert not enclosure.undecided
        for interval, x, y in zip(enclosure.numbers, u, exact, strict=True):
            assert interval.lo <= x <= interval.hi
            assert interval.lo <= y <= interval.hi
            shares.append(float(abs(y - float(x))) / (interval.hi - interval.lo))
    assert max(shares) > 0.03
    assert (saturated > 30) == (limit is not None)


GAINS = ("weight", "gain", "slope", "speed", "acceleration", "most")


WRONG = [(t, k) for t in TERMS for k in GAINS if hasattr(t, k)]


@pytest.mark.parametrize(
    ("term", "name"),
    [pytest.param(*x, marks=pytest.mark.slow if k % 2 else ()) for k, x in enumerate(WRONG)],
    ids=[f"{t}-{k}" for t, k in WRONG],
)
def test_a_number_that_is_wrong_by_a_hundred_thousandth_leaves_the_bounds(term, name, tmp_path):
    """Of each term: the bounds are narrow enough to tell."""
    rng, scenario = np.random.default_rng(9), scenario_of([term])
    wrong = replace(term, **{name: getattr(term, name) * (1 + 1e-5)})
    bounds, exactly = Bounds(c_files(scenario, float32=True)), Exact(c_files(scenario_of([wrong])))
    outside = 0
    for _ in range(300):
        state = random_state(rng, scenario)
        numbers, (_, force) = bounds.force(*state).numbers, exactly.force(*state)
        outside += any(not i.lo <= x <= i.hi for i, x in zip(numbers, force, strict=True))
    assert outside > 0


def test_agents_at_one_place_and_at_rest_have_a_force(tmp_path):
    compiled = CompiledLaw(tmp_path, scenario_of(TERMS[:1]))
    code, u, _ = compiled.force(0, [1.0, 1.0], [0.0, 0.0], {1: ([1.0, 1.0], [0.0, 0.0]), 2: ([1.5, 1.0], [0.0, 0.0])})
    assert code == CODES["OK"]
    assert u.tolist() == [-1.2, 0.0]


@dataclass(frozen=True)
class Sideways(steering.Cohesion):
    """A term of somebody else."""


def test_terms_of_others_are_refused_by_name(tmp_path):
    with pytest.raises(UnsupportedLaw, match="Sideways in C"):
        CompiledLaw(tmp_path, scenario_of([Sideways(1.0, 2.0)]))


def test_agents_of_order_one_see_no_velocities(tmp_path):
    law = fk.Law(
        fk.Hysteresis(4.0, 0.5), [fk.Gradient(fk.Potential("(r - 2)**2/2")), fk.Consensus(0.7),
                                  fk.Track(fk.Velocity([0.5, 0.0]), 0.3, 0.2)],
    )  # fmt: skip
    scenario = fk.Scenario(law, fk.State(np.arange(12.0).reshape(6, 2)), 1.0, agents=fk.SingleIntegrator())
    compiled = CompiledLaw(tmp_path, scenario)
    assert agree(compiled, scenario, np.random.default_rng(2), 60) <= 8
    others = {1: ([1.0, 0.5], [3.0, -2.0])}
    code, fast, _ = compiled.force(0, [0.0, 0.0], [5.0, 5.0], others)
    assert code == CODES["OK"]
    assert (fast == compiled.force(0, [0.0, 0.0], [0.0, 0.0], others)[1]).all()
    assert fast.any()


@pytest.mark.parametrize(
    "body",
    [
        fk.Heading(1.0, masses=np.linspace(0.5, 2.0, 7)),
        fk.Impulsive(force=0.7, speed=np.linspace(0.5, 1.5, 7), damping=0.3, masses=1.7),
        fk.VelocityUnit(1.0, speed=1.1), fk.VelocityUnit(1.0, speed=1.1, fixed=True), fk.VelocityUnit(1.0),
    ],
    ids=lambda x: x.summary,
)  # fmt: skip
def test_velocities_are_those_of_the_body(body, tmp_path):
    """From random forces and from none, noise left out, the velocity is that which the body sets."""
    scenario = scenario_of(TERMS[:1], body)
    compiled, rng = CompiledLaw(tmp_path, scenario), np.random.default_rng(6)
    for k in range(50):
        agent = int(rng.integers(7))
        p, u = rng.normal(size=2), rng.normal(size=2) * (k > 5)
        p /= np.linalg.norm(p)
        v, memory = compiled.vector(), compiled.begin(agent)
        compiled.library.law_velocity.restype = None
        compiled.library.law_velocity(ctypes.byref(memory), compiled.vector(*p), compiled.vector(*u), v)
        who = np.array([agent])
        quiet = replace(body, noise=0.0) if isinstance(body, fk.Heading) else body
        expected = quiet.updated(p[None], u[None], np.array([0.1]), who, who)[0]
        assert np.abs(np.array(v[:]) - expected).max() <= 8 * EPS * (np.abs(p).max() + np.abs(u).max())


def test_a_force_that_takes_all_velocity_leaves_the_heading(tmp_path):
    """w = p + T u/m is zero: the agent keeps its heading, and its speed."""
    compiled = CompiledLaw(tmp_path, scenario_of(TERMS[:1], fk.Heading(1.0)))
    # 0.1 * 10 is 1 to the bit.
    code, v = compiled.velocity(0, [0.0, -1.0], [0.0, 10.0])
    assert (code, v.tolist()) == (CODES["OK"], [0.0, -1.0])


@pytest.mark.parametrize("float32", [False, True])
@pytest.mark.parametrize(
    ("body", "length"),
    [
        (fk.Heading(1.0), 1.0), (fk.Impulsive(force=30.0), 3.0), (fk.Impulsive(speed=0.7), 0.7),
        (fk.VelocityUnit(1.0, speed=1.1), 1.1), (fk.VelocityUnit(1.0, speed=1.1, fixed=True), 1.1),
    ],
    ids=lambda x: getattr(x, "summary", ""),
)  # fmt: skip
def test_velocities_from_forces_whose_squares_overflow(body, length, float32, tmp_path):
    """They have the direction of the force and the length of the limit, in C and in the body itself."""
    compiled = CompiledLaw(tmp_path, scenario_of(TERMS[:1], body), float32=float32)
    single, who = np.finfo(compiled.kind), np.array([0])
    for size in (1e19, 1e30, 0.9 * float(single.max) / np.sqrt(2)) if float32 else (1e160, 0.6 * float(single.max)):
        u = size * np.array([0.6, -0.8])
        for k in (0, 1):
            wanted = u * np.eye(2)[k] if k else u
            expected = length * (wanted / (size * (0.8 if k else 1.0)))
            p, v, memory = np.array([1.0, 0.0]), compiled.vector(), compiled.begin(0)
            code = compiled.library.law_velocity(
                ctypes.byref(memory), compiled.vector(*p), compiled.vector(*wanted), v
            )  # fmt: skip
            drift = p * isinstance(body, fk.Impulsive) * (body.parameters.get("speed") is None)
            assert code == CODES["OK"]
            assert np.array(v[:]) == pytest.approx(expected + drift, rel=1e-5 if float32 else 1e-14)
            found = body.updated(p[None], wanted[None], np.array([0.1]), who, who)[0]
            assert found == pytest.approx(expected + drift, rel=1e-14)


def test_velocities_from_numbers_that_are_none_have_a_code(tmp_path):
    for k, (body, force, said) in enumerate(
        (
            (fk.VelocityUnit(1.0), np.nan, "NOT_FINITE"), (fk.Heading(1.0), np.inf, "NOT_FINITE"),
            (fk.Impulsive(masses=1e-9, speed=1.0), 1e307, "NO_FORCE"), (fk.Impulsive(), 1.0, "OK"),
        )
    ):  # fmt: skip
        (tmp_path / str(k)).mkdir()
        compiled = CompiledLaw(tmp_path / str(k), scenario_of(TERMS[:1], body))
        v, memory = compiled.vector(), compiled.begin(0)
        code = compiled.library.law_velocity(
            ctypes.byref(memory), compiled.vector(1.0, 0.0), compiled.vector(force, 0.0), v
        )
        assert code == CODES[said]
        assert (v[0] != 0.0) == (said == "OK")
