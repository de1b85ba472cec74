"""Exported laws in single precision stay within bounds that intervals give before they are run."""

import numpy as np
import pytest

import flocking as fk
from flocking.papers import keys, paper
from tests.engine.c_export.building import CODES, CompiledLaw, needs_compiler
from tests.engine.c_export.judging import judged, linked_at_start, random_surroundings
from tests.engine.c_export.rounding import enclosed_force

pytestmark = needs_compiler
SCENARIOS = {name: make for key in keys() for name, make in paper(key).scenarios().items()}


def within(compiled, scenario, states, seed):
    """Check random states; the largest error and the smallest, as shares of their bounds."""
    rng, shares = np.random.default_rng(seed), []
    for _ in range(states):
        agent, q, p, others = random_surroundings(rng, scenario)
        q, p = np.float64(np.float32(q)), np.float64(np.float32(p))
        others = {j: (np.float64(np.float32(x)), np.float64(np.float32(v))) for j, (x, v) in others.items()}
        now = int(rng.integers(0, 3 * 10**9))
        distance = {j: float(np.linalg.norm(x - q)) for j, (x, _) in others.items()}
        linked = linked_at_start(scenario.law, scenario.start.n, agent, distance)
        bounds = enclosed_force(scenario, agent, q, p, others, linked, now)
        code, u, _ = compiled.force(agent, q, p, others, now)
        assert code == CODES["OK"]
        exact, _ = judged(scenario, agent, q, p, others, scenario.start.t + now * 1e-9)
        for k, bound in enumerate(bounds):
            low, high = float(bound.lo[0]), float(bound.hi[0])
            # The judge itself is of double precision.
            slack = 1e-12 * (abs(low) + abs(high))
            assert low - slack <= u[k] <= high + slack
            assert low - slack <= exact[k] <= high + slack
            if u[k] != exact[k] and np.isfinite(high - low):
                shares.append(abs(u[k] - exact[k]) / (high - low))
    return max(shares), float(np.median(shares))


@pytest.mark.parametrize("name", ["zhou-2015-leader", "shi-2009", "olfati-saber-2006"])
def test_errors_stay_within_their_bounds(name, tmp_path):
    scenario = SCENARIOS[name](0)
    compiled = CompiledLaw(tmp_path, scenario, float32=True, neighbours=8)
    largest, median = within(compiled, scenario, 40, 1)
    assert largest <= 1
    # The bound says something: not all errors vanish beside it.
    assert largest > 1e-3


@pytest.mark.slow
def test_errors_of_more_states_and_papers(tmp_path):
    found = {}
    for name in ("zhou-2015", "zhou-2015-leader", "shi-2009", "olfati-saber-2003-smooth", "olfati-saber-2003-free",
                 "olfati-saber-2006", "olfati-saber-2006-space", "tanner-2003-dynamic", "tanner-2003-fixed",
                 "cucker-smale-2007"):  # fmt: skip
        (tmp_path / name).mkdir()
        scenario = SCENARIOS[name](0)
        compiled = CompiledLaw(tmp_path / name, scenario, float32=True, neighbours=8)
        found[name] = within(compiled, scenario, 1000, 3)
    print({name: (round(a, 4), round(b, 5)) for name, (a, b) in found.items()})
    assert all(largest <= 1 for largest, _ in found.values())


@pytest.mark.parametrize("name", ["vicsek-1995", "reynolds-1987", "reynolds-1987-comparison-small", "vasarhelyi-2018"])
def test_averages_and_steering_round_what_they_add_up(name, tmp_path):
    """To first order, within 8 roundings of the sum of absolute terms, which follows from the state alone."""
    scenario = SCENARIOS[name](0)
    compiled = CompiledLaw(tmp_path, scenario, float32=True, neighbours=8)
    rng, acted = np.random.default_rng(11), 0
    for _ in range(30):
        agent, q, p, others = random_surroundings(rng, scenario)
        q, p = np.float64(np.float32(q)), np.float64(np.float32(p))
        others = {j: (np.float64(np.float32(x)), np.float64(np.float32(v))) for j, (x, v) in others.items()}
        expected, size = judged(scenario, agent, q, p, others, 0.0)
        code, u, _ = compiled.force(agent, q, p, others)
        assert code == CODES["OK"]
        assert (np.abs(u - expected) <= 8 * np.finfo(np.float32).eps * size + 1e-30).all()
        acted += bool(u.any())
    assert acted > 8


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
