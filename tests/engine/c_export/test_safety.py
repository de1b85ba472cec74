"""Safety filters in exported C, against the filter of the engine."""

import ctypes
from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput, UnsupportedLaw
from tests.engine.c_export.building import CODES, CompiledLaw, needs_compiler
from tests.engine.c_export.filtering import called, crowd, engine_filter, filtered_scenario, of_engine, violated

pytestmark = needs_compiler
OBSTACLES = {
    2: (fk.Ball([3.0, 2.0], 1.0), fk.Ball([-3.0, 0.0], 0.5), fk.Wall([0.0, -4.0], [0.0, 1.0])),
    3: (fk.Ball([2.0, 2.0, 0.0], 1.0), fk.Wall([0.0, 0.0, -4.0], [0.0, 0.0, 1.0])),
}
CASES = [("sampled", 1), ("sampled", 2), ("sampled", 3), ("continuous", 2), ("stopping", 2), ("stopping", 3)]


def made(folder, form, m, **options):
    obstacles = OBSTACLES.get(m, ()) if form == "stopping" else ()
    scenario = filtered_scenario(form, 6, m, obstacles=obstacles)
    return scenario, CompiledLaw(folder, scenario, **options)


def states(scenario, compiled, count, seed, *, single=False):
    """Random crowds, two ticks each: agent, state, whom it hears, force of the law, filter, memory, code and force."""
    n, m = scenario.start.q.shape
    rng = np.random.default_rng(seed)
    for _ in range(count):
        agent = int(rng.integers(n))
        q, p = crowd(rng, n, m)
        others = [j for j in range(n) if j != agent]
        heard = sorted(rng.choice(others, size=rng.integers(0, n), replace=False).tolist())
        memory, filtering = compiled.begin(agent), engine_filter(scenario)
        law = fk.Controller(scenario.law, agent, agents=n, mass=float(scenario.agents.masses[agent]), dimension=m)
        for number in range(2):
            if single:
                q, p = np.float64(np.float32(q)), np.float64(np.float32(p))
            code, u = called(compiled, memory, agent, q, p, heard, number)
            assert code == CODES["OK"]
            force = law(number * 1e-9, q[agent], p[agent], ids=heard, q=q[heard], p=p[heard])
            yield agent, (q, p), heard, force, filtering, memory, u
            q = q + 0.05 * p


@pytest.mark.parametrize(("form", "m"), CASES)
def test_the_force_is_that_of_the_filter(form, m, tmp_path):
    """Projections agree but for the rounding with which the solver of the engine counts conditions as kept."""
    scenario, compiled = made(tmp_path, form, m)
    changed = relaxed = 0
    for agent, state, heard, force, filtering, memory, u in states(scenario, compiled, 60, m):
        expected, gave_way = of_engine(filtering, agent, *state, heard, force)
        size = scenario.agents.masses[agent] * filtering.most[agent]
        assert np.abs(u - expected).max() <= (1e-9 if form == "stopping" else 2e-6) * size
        assert memory.relaxed == gave_way
        assert memory.filtered == (np.abs(expected - force).max() > 1e-12 * size)
        changed, relaxed = changed + memory.filtered, relaxed + memory.relaxed
    assert changed > 30
    assert relaxed > 1


POLES = fk.Law(fk.Proximity(4.0), [fk.Gradient(fk.Potential("1/r**2 + 1/(R - r)**2 + exp(-r)", R=4.0))])
PAIR = fk.State([[0.0, 0.0], [2.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]])


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("form", ["sampled", "continuous", "stopping"])
def test_a_force_that_is_far_too_large_is_one_of_the_largest_size_allowed(form, single, tmp_path):
    """A law with an exponential function and poles, whose force is up to 1e20 times what is allowed."""
    control = fk.SafetyFilter(0.05, distance=0.3, acceleration=6.0, form=form)
    compiled = CompiledLaw(tmp_path, fk.Scenario(POLES, PAIR, 1.0, control=control), float32=single)
    for gap in (1e-3, 1e-5, 5e-7):
        q = np.array([[0.0, 0.0], [4.0 - gap, 0.0]])
        code, u = called(compiled, compiled.begin(0), 0, q, np.zeros((2, 2)), [1], 0)
        assert code == CODES["OK"]
        np.testing.assert_allclose(u, [6.0, 0.0], rtol=1e-4)


@pytest.mark.parametrize("single", [False, True])
def test_a_force_whose_square_overflows_has_the_size_of_the_limit(single, tmp_path):
    compiled = CompiledLaw(tmp_path, fk.Scenario(POLES, PAIR, 1.0), float32=single, limit=5.0)
    for gap in (1e-3, 5e-7, 2.5e-7) if single else (1e-3, 1e-15):
        q = np.array([[0.0, 0.0], [4.0 - gap, 0.0]])
        code, u = called(compiled, compiled.begin(0), 0, q, np.zeros((2, 2)), [1], 0)
        assert code == CODES["OK"]
        np.testing.assert_allclose(u, [5.0, 0.0], rtol=1e-6)


@pytest.mark.parametrize("m", [2, 3])
def test_forces_of_single_precision_keep_the_conditions(m, tmp_path):
    """Conditions of pairs are kept within a hundredth of the largest acceleration, and nothing nearer is given away.

    What is asked for is the difference of speeds by the period, a tenth of a second, so that a rounding of distances of
    1e-7 under a root becomes some thousandths.
    """
    scenario, compiled = made(tmp_path, "sampled", m, float32=True)
    kept = 0
    for agent, (q, p), heard, force, filtering, memory, u in states(scenario, compiled, 70, 9, single=True):
        mass, most = scenario.agents.masses[agent], filtering.most[agent]
        expected, gave_way = of_engine(filtering, agent, q, p, heard, force)
        missed, beyond = violated(filtering, agent, q, p, heard, u / mass)
        assert beyond <= 1e-5 * most
        if gave_way or not heard:
            continue
        assert missed <= 0.01 * most
        away = [float(np.linalg.norm(x - force) / mass) for x in (u, expected)]
        assert away[0] <= away[1] + 0.01 * most
        kept += memory.filtered
    assert kept > 30


def test_brute_force_finds_nothing_nearer(tmp_path):
    """No acceleration of a fine grid that keeps all conditions is nearer to the desired one than that of C."""
    scenario, compiled = made(tmp_path, "sampled", 2)
    grid, judged = np.linspace(-1.0, 1.0, 161), 0
    square = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    for agent, (q, p), heard, force, filtering, memory, u in states(scenario, compiled, 40, 3):
        of_engine(filtering, agent, q, p, heard, force)
        if memory.relaxed or not memory.filtered:
            continue
        mass, most = scenario.agents.masses[agent], filtering.most[agent]
        others = np.isin(np.arange(6), heard)
        normals, bounds = filtering._conditions(agent, others, *(x[agent] - x[others] for x in (q, p)))
        tried = most * square[np.linalg.norm(square, axis=1) <= 1.0]
        tried = tried[(tried @ normals.T >= bounds).all(axis=1)]
        wanted = force / mass
        assert (normals @ (u / mass) >= bounds - 1e-6 * most).all()
        nearest = np.linalg.norm(tried - wanted, axis=1).min(initial=np.inf)
        assert np.linalg.norm(u / mass - wanted) <= nearest + 1e-6 * most
        judged += len(tried) > 0
    assert judged > 10


@pytest.mark.parametrize("form", ["sampled", "stopping"])
def test_a_run_of_exported_agents_keeps_the_distance(form, tmp_path):
    """Agents that the law drives into each other stay apart behind the filter, and come too close without it."""
    closest = {}
    for name, control in (("with", None), ("without", fk.Held(0.1))):
        folder = tmp_path / name
        folder.mkdir()
        n = 2 if form == "sampled" else 4
        scenario = filtered_scenario(form, n)
        scenario = scenario if control is None else scenario.with_(control=control)
        compiled = CompiledLaw(folder, scenario)
        angle = 2 * np.pi * np.arange(n) / n
        q = 3.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        p = -1.5 * q / 3.0 + 0.2 * np.random.default_rng(1).normal(size=(n, 2))
        memories, least = [compiled.begin(i) for i in range(n)], np.inf
        for tick in range(60):
            for i, memory in enumerate(memories):
                for j in range(n):
                    if j != i:
                        compiled.receive(memory, j, q[j], p[j], number=tick, stamp=tick * 10**8)
            found = [compiled.control(memory, q[i], p[i], tick * 10**8) for i, memory in enumerate(memories)]
            assert all(code == CODES["OK"] for code, _ in found)
            a = np.array([u for _, u in found]) / scenario.agents.masses[:, None]
            for s in np.linspace(0.0, 0.1, 21):
                at = q + s * p + 0.5 * s**2 * a
                gaps = np.linalg.norm(at[:, None] - at[None], axis=2)[np.triu_indices(n, 1)]
                least = min(least, float(gaps.min()))
            q, p = q + 0.1 * p + 0.005 * a, p + 0.1 * a
        closest[name] = least
    assert closest["with"] >= 0.7
    assert closest["without"] < 0.6


@pytest.mark.parametrize("m", [1, 2])
def test_others_brake_for_periods_of_their_own(m, tmp_path):
    """Where ticks differ, another one stops on the path of its own period and largest acceleration."""
    one = filtered_scenario("stopping", 6, m)
    control = replace(one.control, period=np.array([0.1, 0.4, 0.2, 0.3, 0.1, 0.5]))
    scenario = one.with_(control=control)
    compiled, changed = CompiledLaw(tmp_path, scenario), 0
    for agent, state, heard, force, filtering, memory, u in states(scenario, compiled, 60, m):
        expected, gave_way = of_engine(filtering, agent, *state, heard, force)
        assert np.abs(u - expected).max() <= 1e-9 * scenario.agents.masses[agent] * filtering.most[agent]
        assert memory.relaxed == gave_way
        changed += memory.filtered
    assert changed > 30


@pytest.mark.parametrize("obstacle", [fk.Wall([0.0, 0.0], [1.0, 0.0]), fk.Ball([0.0, 0.0], 1.0)], ids=["wall", "ball"])
@pytest.mark.parametrize("aside", [0.0, 0.4])
def test_an_agent_that_is_pulled_into_an_obstacle_comes_as_near_as_the_clearance(obstacle, aside, tmp_path):
    """The stopping form promises the clearance, all the time; what the law pulls comes close to it."""
    clearance, period = 0.2, 0.1
    control = fk.SafetyFilter(
        period, distance=0.7, acceleration=5.0, form="stopping", obstacles=(obstacle,), clearance=clearance
    )
    law = fk.Law(fk.Proximity(1.0), [fk.Track(fk.Sink([-9.0, 0.0]), 2.0, 0.5)])
    start = fk.State([[5.0, aside], [99.0, 0.0]], [[-3.0, 0.0], [0.0, 0.0]])
    compiled = CompiledLaw(tmp_path, fk.Scenario(law, start, 1.0, control=control))
    memory, q, p, least = compiled.begin(0), start.q[0], start.p[0], np.inf
    for tick in range(60):
        code, u = compiled.control(memory, q, p, tick * 10**8)
        assert code == CODES["OK"]
        for s in np.linspace(0.0, period, 41):
            x, y = q + s * p + 0.5 * s**2 * u
            least = min(least, x if isinstance(obstacle, fk.Wall) else np.hypot(x, y) - 1.0)
        q, p = q + period * p + 0.5 * period**2 * u, p + period * u
        assert not memory.relaxed
    assert clearance <= least <= clearance + 0.05


@pytest.mark.parametrize(("nearer", "gives_way"), [(1e-10, 0), (1e-8, 1), (1e-6, 1)])
def test_a_plane_is_relaxed_by_more_than_rounding_alone(nearer, gives_way, tmp_path):
    """Two agents at rest, nearer by a share of what is guarded: half of it is beyond the plane between them."""
    scenario = filtered_scenario("stopping", 2)
    compiled, filtering = CompiledLaw(tmp_path, scenario), engine_filter(scenario)
    guarded = scenario.control.guarded_distance
    q, p = np.array([[0.0, 0.0], [guarded * (1.0 - nearer), 0.0]]), np.zeros((2, 2))
    memory = compiled.begin(0)
    called(compiled, memory, 0, q, p, [1], 0)
    assert memory.relaxed == gives_way
    assert of_engine(filtering, 0, q, p, [1], np.array([1.0, 0.0]))[1] == gives_way


def test_what_is_forgotten_takes_its_line_with_it(tmp_path):
    """A neighbour that expired begins with the line to where it is, in C as in the engine."""
    information = fk.Messages(0.1, expires=0.5)
    scenario = filtered_scenario("sampled", 3).with_(information=information)
    compiled = CompiledLaw(tmp_path, scenario)
    memory, rest = compiled.begin(0), [0.0, 0.0]
    compiled.receive(memory, 1, [1.0, 0.0], [-1.0, 0.0], number=0, stamp=0)
    compiled.control(memory, rest, rest, 0)
    assert list(memory.normals[0]) == [-1.0, 0.0]
    compiled.control(memory, rest, rest, 600_000_000)
    assert memory.count == 0
    compiled.receive(memory, 2, [0.0, 2.0], rest, number=0, stamp=600_000_000)
    assert list(memory.normals[0]) == [0.0, 0.0]
    assert ctypes.sizeof(memory.normals) == 2 * 2 * 8


def test_filters_that_have_no_meaning_are_refused(tmp_path):
    with pytest.raises(InvalidInput, match="whose acceleration bounds the force"):
        CompiledLaw(tmp_path, filtered_scenario("sampled"), limit=1.0)
    damped = filtered_scenario("sampled").with_(agents=fk.Agents(damping=0.3))
    with pytest.raises(UnsupportedLaw, match="undamped point masses"):
        CompiledLaw(tmp_path, damped)
    start = fk.State(np.arange(40.0).reshape(10, 4), np.zeros((10, 4)))
    wide = fk.Scenario(fk.Law(fk.Proximity(9.0), [fk.Consensus()]), start, 1.0,
                       control=fk.SafetyFilter(0.1, distance=0.7, acceleration=5.0))  # fmt: skip
    with pytest.raises(UnsupportedLaw, match="up to 3 axes"):
        CompiledLaw(tmp_path, wide)


@pytest.mark.parametrize("form", ["sampled", "continuous", "stopping"])
def test_numbers_that_overflow_give_no_force(form, tmp_path):
    """A code, not a number: no component is ever NaN, and no force is larger than the filter allows."""
    law = fk.Law(fk.Hysteresis(3.0, 0.4), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(1.0)])
    start = fk.State(2.0 * np.arange(12.0).reshape(6, 2), np.zeros((6, 2)))
    control = fk.SafetyFilter(0.1, distance=0.5, acceleration=5.0, form=form)
    compiled = CompiledLaw(tmp_path, fk.Scenario(law, start, 1.0, control=control))
    rng, faults = np.random.default_rng(2), 0
    wild = [0.0, 1e300, -1e300, 1.7e308, 1e154, 5e-324, 1e-200, 1e19]
    memory = compiled.begin(0)
    for k in range(400):
        given = rng.normal(size=(4, 2))
        given[rng.random((4, 2)) < 0.25] = rng.choice(wild)
        compiled.receive(memory, int(rng.integers(1, 6)), given[0], given[1], number=k, stamp=k)
        code, u = compiled.control(memory, given[2], given[3], k)
        assert np.linalg.norm(u) <= 5.0 * (1 + 1e-9)
        assert code == CODES["OK"] or not u.any()
        faults += code == CODES["NO_FORCE"]
    assert faults > 3
