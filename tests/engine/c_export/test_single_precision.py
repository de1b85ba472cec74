"""Exported laws in single precision stay within bounds that are computed before they are run."""

from dataclasses import dataclass, field

import numpy as np
import pytest

import flocking as fk
from flocking.engine.c_export.export import c_files
from flocking.model.terms import braking, steering
from flocking.papers import keys, paper
from tests.engine.c_export.building import CODES, CompiledLaw, needs_compiler
from tests.engine.c_export.judging import judged, random_surroundings
from tests.engine.c_export.rounding import Bounds, Exact
from tests.engine.c_export.single_intervals import ROUNDING, Unbounded

pytestmark = needs_compiler
EPS = np.finfo(float).eps
SCENARIOS = {name: make for key in keys() for name, make in paper(key).scenarios().items()}
TORUS = fk.Scenario(
    fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(0.7)]),
    fk.State(np.arange(12.0).reshape(6, 2), np.zeros((6, 2))), 1.0, space=fk.Periodic([5.0, 7.0]),
)  # fmt: skip


def single(vector):
    """The nearest numbers of single precision."""
    return np.float64(np.float32(vector))


def random_state(rng, scenario):
    """A random state of single precision: agent, q, p, others, time.

    Others are in any image of a periodic space; where walls or discs are, every other state is anywhere between them.
    """
    agent, q, p, others = random_surroundings(rng, scenario)
    far = [_far(term) for term in scenario.law.steering_terms]
    if max(far, default=0.0) > 0.0 and rng.uniform() < 0.5:
        moved = rng.uniform(-1.2, 1.2, len(q)) * max(far) - q
        q, others = q + moved, {j: (x + moved, v) for j, (x, v) in others.items()}
    images = np.array([x if np.isfinite(x) else 0.0 for x in scenario.space.lengths] or [0.0] * len(q))
    moved = {j: single(x + images * rng.integers(-2, 3, len(q))) for j, (x, _) in others.items()}
    return (
        agent, single(q), single(p), {j: (moved[j], single(v)) for j, (_, v) in others.items()},
        int(rng.integers(0, 3 * 10**9)),
    )  # fmt: skip


def _far(term):
    """How far from the origin a term of places acts; 0 for other terms."""
    match term:
        case steering.TurnBack():
            return term.radius
        case braking.ShillWalls():
            return term.half_width
        case braking.ShillDisc():
            return float(np.abs(term.centre).max()) + term.radius
    return 0.0


@dataclass
class Found:
    """Errors as shares of their bounds; bounds in roundings of the sum of absolute terms; how many states were what."""

    shares: list[float] = field(default_factory=list)
    sizes: list[float] = field(default_factory=list)
    states: int = 0
    undecided: int = 0
    unbounded: int = 0

    def hold(self, enclosure, got, exact):
        """Errors of a call, each component within its bound."""
        for interval, width, x, y in zip(enclosure.numbers, enclosure.widths, got, exact, strict=True):
            error = abs(float(x) - y)
            assert interval.lo <= x <= interval.hi
            assert interval.lo <= y <= interval.hi
            assert error <= width
            if error and not enclosure.undecided:
                self.shares.append(float(error) / width)


def within(folder, scenario, states, seed):
    """Random states: the force of C in single precision, and the exact one, lie in the interval found before."""
    compiled = CompiledLaw(folder, scenario, float32=True, neighbours=8)
    bounds, exactly = Bounds(compiled.files), Exact(c_files(scenario, neighbours=8))
    rng, found = np.random.default_rng(seed), Found()
    for _ in range(states):
        agent, q, p, others, now = random_state(rng, scenario)
        found.states += 1
        try:
            enclosure = bounds.force(agent, q, p, others, now)
        except Unbounded:
            found.unbounded += 1
            continue
        found.undecided += enclosure.undecided
        code, u, _ = compiled.force(agent, q, p, others, now)
        exact_code, exact = exactly.force(agent, q, p, others, now)
        assert {code, exact_code} <= enclosure.codes
        assert code == exact_code == CODES["OK"]
        # The text of double precision is that of the law.
        expected, size = judged(scenario, agent, q, p, others, scenario.start.t + now * 1e-9)
        assert (np.abs(np.array(exact, dtype=float) - expected) <= 8 * EPS * size).all()
        found.hold(enclosure, u, exact)
        if not enclosure.undecided:
            found.sizes += [w / (ROUNDING * s) for w, s in zip(enclosure.widths, size, strict=True) if s]
        if scenario.agents.discrete:
            _set_velocity(compiled, bounds, exactly, agent, p, u, found)
    return found


def _set_velocity(compiled, bounds, exactly, agent, p, u, found):
    """The velocity that is set from a force of single precision."""
    code, v = compiled.velocity(agent, p, u)
    exact_code, exact = exactly.velocity(agent, p, u)
    assert code == exact_code == CODES["OK"]
    found.hold(bounds.velocity(agent, p, u), v, exact)


def says_something(found, scenario):
    """Bounds are of the order of the rounding, and states without one are few.

    The sum of absolute terms does not count whole lengths of a torus, which cancel in differences of positions.
    """
    assert np.median(found.sizes) < (200 if np.isfinite(scenario.space.lengths).any() else 10)
    assert max(found.shares) > 0.03
    assert found.undecided + found.unbounded <= 0.01 * found.states


@pytest.mark.parametrize("key", keys())
def test_errors_stay_within_their_bounds(key, tmp_path):
    scenario = next(iter(paper(key).scenarios().values()))(0)
    says_something(within(tmp_path, scenario, 40, 1), scenario)


def test_errors_on_a_torus_stay_within_their_bounds(tmp_path):
    says_something(within(tmp_path, TORUS, 200, 1), TORUS)


@pytest.mark.slow
def test_errors_of_more_states_and_all_scenarios(tmp_path):
    found = {}
    for name, make in SCENARIOS.items():
        (tmp_path / name).mkdir()
        found[name] = within(tmp_path / name, make(0), 200, 3)
    for name, x in found.items():
        print(
            f"{name:32} errors of {max(x.shares):.3f} of the bound at most, {np.median(x.shares):.4f} in the median; "
            f"bound {np.median(x.sizes):.1f} roundings; {x.undecided} undecided, {x.unbounded} without a bound"
        )
        says_something(x, SCENARIOS[name](0))


MUTANTS = {
    "vicsek-1995": [("functional = 1.0f / (1.0f", "functional = 1.00001f / (1.0f")],
    "reynolds-1987": [
        ("(12.0f *", "(12.00012f *"),
        ("- own[axis])", "- (1.00001f * own[axis]))"),
        ("total[axis] + seen->offset[slot][axis]", "total[axis] + (seen->offset[slot][axis] * r)"),
    ],
    "vasarhelyi-2018": [
        ("0.4f * (25.6668f", "0.400004f * (25.6668f"),
        ("0.023802f", "0.02380224f"),
        ("(4.0f *", "(4.00004f *"),
        ("6.52174f", "6.5218f"),
        ("- law_fabs(q[wall])", "- (1.00001f * law_fabs(q[wall]))"),
        ("found[k] = ((size", "found[k] = 1.00001f * ((size"),
    ],
    "torus": [
        ("straight0 - (P1 *", "straight0 - ((1.00001f * P1) *"),
        ("drag * v0", "1.00001f * drag * v0"),
    ],
}


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        pytest.param(name, *x, marks=pytest.mark.slow if k % 2 else ())
        for name, listed in MUTANTS.items()
        for k, x in enumerate(listed)
    ],
)
def test_a_wrong_constant_or_a_relative_error_of_a_hundred_thousandth_breaks_the_bound(name, old, new, tmp_path):
    """What is run leaves the bound of what was written; where the wrong text is bounded, the law lies outside."""
    scenario = TORUS if name == "torus" else SCENARIOS[name](0)
    wrong = CompiledLaw(tmp_path, scenario, float32=True, neighbours=8, change=[(old, new)])
    right, of_wrong = Bounds(c_files(scenario, float32=True, neighbours=8)), Bounds(wrong.files)
    exactly, rng = Exact(c_files(scenario, neighbours=8)), np.random.default_rng(2)
    outside = np.zeros(2)
    for _ in range(60):
        state = random_state(rng, scenario)
        _, u, _ = wrong.force(*state)
        for k, (bounds, number) in enumerate(((right, u), (of_wrong, exactly.force(*state)[1]))):
            intervals = bounds.force(*state).numbers
            outside[k] += any(not i.lo <= x <= i.hi for i, x in zip(intervals, number, strict=True))
    assert (outside > 2).all(), outside


def test_a_neighbour_at_the_radius_is_undecided_and_held_all_the_same(tmp_path):
    """Whether it is linked is a matter of roundings: the interval holds both forces, with and without the link."""
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("3*r"))])
    scenario = fk.Scenario(law, fk.State([[0.0, 0.0], [9.0, 0.0]], np.zeros((2, 2))), 1.0)
    compiled, rest = CompiledLaw(tmp_path, scenario, float32=True), [0.0, 0.0]
    bounds, forces = Bounds(compiled.files), []
    for distance, undecided in (
        (2.0, True),
        (np.float32(2.0 - 1.2e-7), True),
        (2.0 - 1e-5, False),
        (2.0 + 1e-5, False),
    ):
        others = {1: (single([distance, 0.0]), rest)}
        found = bounds.force(0, rest, rest, others)
        forces.append(compiled.force(0, rest, rest, others)[1][0])
        assert found.undecided == undecided
        assert found.numbers[0].lo <= forces[-1] <= found.numbers[0].hi
        assert (found.widths[0] > 2.9) == undecided
    assert forces == [0.0, 3.0, 3.0, 0.0]


def test_no_bound_is_said_where_the_force_may_be_infinite(tmp_path):
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("1/(r - 1)"))])
    scenario = fk.Scenario(law, fk.State([[0.0, 0.0], [9.0, 0.0]], np.zeros((2, 2))), 1.0)
    bounds, rest = Bounds(c_files(scenario, float32=True)), [0.0, 0.0]
    assert bounds.force(0, rest, rest, {1: ([2.0, 0.0], rest)}).numbers
    with pytest.raises(Unbounded):
        bounds.force(0, rest, rest, {1: ([1.0, 0.0], rest)})


def test_what_keeps_a_root_from_zero_does_so_in_single_precision(tmp_path):
    """At the centre of a ball its direction is a quotient of zeros but for 1e-300, which single precision has not."""
    ball = fk.Avoid([fk.Ball([1.0, 2.0], 0.5)], range=5.0, repulsion_gain=5.0, gamma_agents=False)
    law = fk.Law(fk.Proximity(2.0), [ball, fk.Track(fk.Velocity([0.5, 0.0]), 0.0, 1.0)])
    scenario = fk.Scenario(law, fk.State([[5.0, 0.0], [9.0, 0.0]], np.zeros((2, 2))), 1.0)
    codes = []
    for name in ("single", "double"):
        (tmp_path / name).mkdir()
        compiled = CompiledLaw(tmp_path / name, scenario, float32=name == "single")
        code, u, _ = compiled.force(0, [1.0, 2.0], [0.0, 0.0], {})
        codes.append((code, np.isfinite(u).all()))
    assert codes[0] == codes[1] == (CODES["OK"], True)
