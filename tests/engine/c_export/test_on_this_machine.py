"""Exported laws in double precision, compiled by the C compiler of this machine, against the law itself."""

import numpy as np
import pytest

import flocking as fk
from flocking.errors import FlockingError
from flocking.papers import keys, paper
from tests.contracts.strategies import STRUCTURES, case_of
from tests.engine.c_export.building import CODES, CompiledLaw, needs_compiler
from tests.engine.c_export.judging import judged, random_surroundings
from tests.engine.reference.test_controller import SIDED

pytestmark = needs_compiler
EPS = np.finfo(float).eps
SHORT = 1_000_000_000

PSI = fk.Potential("1/r + 1/(R - r)", R=4.0)
LAW = fk.Law(fk.Hysteresis(4.0, 0.5), [fk.Gradient(PSI), fk.Consensus(0.7)])


def scenario_of(law, n=6, m=2, **parts):
    return fk.Scenario(law, fk.State(np.arange(n * m, dtype=float).reshape(n, m), np.zeros((n, m))), 1.0, **parts)


def agree(compiled, scenario, rng, states):
    """Hold random states against `control_of`; the largest error by the sum of absolute terms, in units of eps."""
    worst = 0.0
    for _ in range(states):
        agent, q, p, others = random_surroundings(rng, scenario)
        t = scenario.start.t + float(rng.integers(0, 3 * SHORT)) * 1e-9
        now = round((t - scenario.start.t) * 1e9)
        try:
            expected, size = judged(scenario, agent, q, p, others, scenario.start.t + now * 1e-9)
        except FlockingError:
            # Beyond a pole: the code says it, too.
            code, u, _ = compiled.force(agent, q, p, others, now)
            assert code == CODES["POLE"]
            assert (u == 0.0).all()
            continue
        code, u, _ = compiled.force(agent, q, p, others, now)
        assert code == CODES["OK"]
        worst = max(worst, float((np.abs(u - expected) / (size * EPS + 1e-300)).max()))
    return worst


@pytest.mark.parametrize(
    "name",
    ["two graphs", "obstacles", "shi", "averages", "sigma-norms", "alignment of all pairs", "directed", "agent gains"],
)
def test_the_force_is_that_of_the_law(name, tmp_path):
    """Every agent finds the force of the law at a start, within 8 roundings of what is added up."""
    case = case_of(STRUCTURES[name], 6, 2, 3)
    start = fk.State(case.state.q, case.state.p, case.state.t)
    scenario = fk.Scenario(case.law, start, case.state.t + 1.0, agents=case.agents)
    compiled = CompiledLaw(tmp_path, scenario)
    assert agree(compiled, scenario, np.random.default_rng(5), 40) <= 8


def test_the_bits_are_those_of_the_controller(tmp_path):
    """Without elementary functions but roots nothing is rounded otherwise, over calls with memory."""
    compiled = CompiledLaw(tmp_path, scenario_of(LAW))
    controller, memory = fk.Controller(LAW, 2, agents=6), compiled.begin(2)
    rng, others = np.random.default_rng(1), [0, 1, 3, 4, 5]
    q, p = rng.uniform(-1.2, 1.2, (6, 2)), 3.0 * rng.normal(size=(6, 2))
    switched = 0
    for k in range(400):
        q += 0.05 * p
        p -= 0.02 * q
        for j in rng.permutation(others):
            assert compiled.receive(memory, int(j), q[j], p[j], number=k, stamp=k) == CODES["OK"]
        before = compiled.links(memory)
        code, u = compiled.control(memory, q[2], p[2], k)
        expected = controller(k * 1e-9, q[2], p[2], ids=others, q=q[others], p=p[others])
        assert code == CODES["OK"]
        assert (u == expected).all()
        assert compiled.links(memory) == np.flatnonzero(controller.links[0]).tolist()
        switched += before != compiled.links(memory)
    assert switched > 5


def test_links_keep_their_memory_and_expired_neighbours_are_forgotten(tmp_path):
    information = fk.Messages(0.1, expires=0.5, predict=True)
    compiled = CompiledLaw(tmp_path, scenario_of(LAW, 3, information=information, control=fk.Held(0.1)))
    memory, rest = compiled.begin(0), [0.0, 0.0]

    def at(distance, now, speed=0.0, number=None):
        if distance is not None:
            compiled.receive(memory, 1, [distance, 0.0], [speed, 0.0], number=number or now // 1000, stamp=now)
        code, u = compiled.control(memory, rest, rest, now)
        return code, compiled.links(memory), u

    # Links appear below 3.5 and break at 4; the first call links as at a start.
    assert [at(x, 1000 * k)[1] for k, x in enumerate([3.8, 3.9, 4.1, 3.8, 3.4, 3.8])] == [[1], [1], [], [], [1], [1]]
    # Moved on with its velocity: 3.4 + 1 * 0.2 after 0.2 s.
    begun = SHORT
    assert at(3.4, begun, speed=1.0)[1] == [1]
    code, links, u = at(None, begun + 200_000_000)
    along = -1 / 3.6**2 + 1 / 0.4**2
    assert u == pytest.approx([along + 0.7, 0.0], rel=1e-12)
    # After exactly 0.5 s the state is not used any more, and the link must appear anew.
    assert at(None, begun + 499_999_999)[1] == [1]
    code, links, u = at(None, begun + 500_000_000)
    assert (code, links, u.tolist(), memory.count) == (CODES["OK"], [], [0.0, 0.0], 0)
    assert at(3.8, 2 * SHORT)[1] == []
    assert at(3.4, 3 * SHORT)[1] == [1]


def test_the_newest_sample_counts_whatever_the_order_of_arrival(tmp_path):
    compiled = CompiledLaw(tmp_path, scenario_of(LAW, 4), neighbours=2)
    memory = compiled.begin(3)
    assert compiled.receive(memory, 1, [1.0, 0.0], [0.0, 0.0], number=5, stamp=50, now=60) == CODES["OK"]
    assert compiled.receive(memory, 1, [2.0, 0.0], [0.0, 0.0], number=4, stamp=40, now=60) == CODES["OLD"]
    assert compiled.receive(memory, 1, [2.0, 0.0], [0.0, 0.0], number=5, stamp=50, now=60) == CODES["OLD"]
    assert memory.known[0].q[0] == 1.0
    assert compiled.receive(memory, 0, [3.0, 0.0], [0.0, 0.0], number=0, stamp=0, now=60) == CODES["OK"]
    assert [memory.known[s].sender for s in memory.order[:2]] == [0, 1]
    assert compiled.receive(memory, 2, [1.0, 1.0], [0.0, 0.0], number=0, stamp=0, now=60) == CODES["FULL"]
    # The order of arrival does not change a bit of the sum.
    forward, backward = compiled.begin(3), compiled.begin(3)
    for memory, order in ((forward, (0, 2)), (backward, (2, 0))):
        for j in order:
            compiled.receive(memory, j, [0.3 + j, 0.7], [0.1, j])
    assert (compiled.control(forward, [0, 0], [0, 0])[1] == compiled.control(backward, [0, 0], [0, 0])[1]).all()


def test_faults_have_codes_and_change_no_links(tmp_path):
    compiled = CompiledLaw(tmp_path, scenario_of(LAW, 3))
    memory, rest = compiled.begin(0), [0.0, 0.0]
    compiled.receive(memory, 1, [2.0, 0.0], rest, number=1, stamp=10)
    _, usual = compiled.control(memory, rest, rest, 10)
    nan, inf = float("nan"), float("inf")
    assert compiled.receive(memory, 2, [nan, 0.0], rest, stamp=10) == CODES["NOT_FINITE"]
    assert compiled.receive(memory, 2, [0.0, 0.0], [0.0, -inf], stamp=10) == CODES["NOT_FINITE"]
    assert compiled.receive(memory, 0, [1.0, 0.0], rest) == CODES["NO_AGENT"]
    assert compiled.receive(memory, 3, [1.0, 0.0], rest) == CODES["NO_AGENT"]
    assert compiled.receive(memory, 1, [1.0, 0.0], rest, number=9, stamp=30, now=20) == CODES["TIME"]
    assert compiled.library.law_begin(None, 3) == CODES["NO_AGENT"]
    for q, p, now, said in (
        ([nan, 0.0], rest, 10, "NOT_FINITE"), (rest, [0.0, inf], 10, "NOT_FINITE"), (rest, rest, 9, "TIME"),
        ([2.0, 0.0], rest, 10, "COINCIDENT"),
    ):  # fmt: skip
        code, u = compiled.control(memory, q, p, now)
        assert (code, u.tolist(), compiled.links(memory), memory.time) == (CODES[said], [0.0, 0.0], [1], 10)
    code, u = compiled.control(memory, rest, rest, 20)
    assert code == CODES["OK"]
    assert (u == usual).all()


@pytest.mark.parametrize(("formula", "distances"), SIDED, ids=[formula for formula, _ in SIDED])
def test_a_neighbour_on_the_wrong_side_of_a_pole_has_a_code(formula, distances, tmp_path):
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential(formula))])
    compiled = CompiledLaw(tmp_path, scenario_of(law, 2))
    codes = {"farther": "POLE", "nearer": "POLE", "finite": "NO_FORCE", "": "OK"}
    for distance, said in distances.items():
        code, u, _ = compiled.force(0, [0.0, 0.0], [0.0, 0.0], {1: ([distance, 0.0], [0.0, 0.0])})
        assert code == CODES[codes[said]]
        if not said:
            assert u == pytest.approx(fk.Controller(law, agents=2)(
                0.0, [0.0, 0.0], [0.0, 0.0], ids=[1], q=[[distance, 0.0]], p=[[0.0, 0.0]]
            ))  # fmt: skip


def test_schedules_limits_and_periodic_space(tmp_path):
    track = fk.Track(fk.Velocity([1.0, 0.0]), 0.0, fk.Schedule([1.0], [1.0, 4.0]))
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("r")), track])
    space = fk.Periodic([10.0, 10.0])
    compiled = CompiledLaw(tmp_path, scenario_of(law, 2, space=space), limit=2.5)
    for now, gain in ((0, 1.0), (SHORT - 1, 1.0), (SHORT, 4.0)):
        far = {1: ([29.0, 0.0], [0.0, 0.0])}
        code, u, memory = compiled.force(0, [0.5, 0.0], [0.0, 0.0], far, now)
        wanted = gain - 1.0
        assert code == CODES["OK"]
        assert u == pytest.approx([min(wanted, 2.5), 0.0])
        assert memory.saturated == (wanted > 2.5)


@pytest.mark.parametrize("float32", [False, True])
def test_leaders_and_ages_are_those_of_the_time_however_long_a_run_lasts(float32, tmp_path):
    """Seconds are those of both halves of a number of nanoseconds, before the start too; schedules count from it."""
    leader, steps = fk.Velocity([0.25, 0.0], [1.0, 0.0]), fk.Schedule([-2.0, 6.0], [1.0, 2.0, 4.0])
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("r**2/2")), fk.Track(leader, steps, 0.0)])
    start = fk.State([[0.0, 0.0], [2.0, 0.0]], np.zeros((2, 2)), -3.0)
    information = fk.Messages(0.1, predict=True)
    scenario = fk.Scenario(law, start, 1.0, information=information, control=fk.Held(0.1))
    compiled = CompiledLaw(tmp_path, scenario, float32=float32)
    for now in (-5_000_000_000, -1, 0, 999_999_999, SHORT, 4_294_967_296, 9_000_000_000, 10**12):
        for age in (0, SHORT // 2, 5_000_000_000, 50_000_000_000):
            memory = compiled.begin(0)
            assert compiled.receive(memory, 1, [2.0, 0.0], [0.5, -0.125], stamp=now - age, now=now) == CODES["OK"]
            code, u = compiled.control(memory, [0.5, 0.0], [0.0, 0.0], now)
            assert code == CODES["OK"]
            t, seconds = -3.0 + now * 1e-9, age * 1e-9
            gain = 4.0 if now >= 9_000_000_000 else 2.0 if now >= SHORT else 1.0
            expected = [2.0 + 0.5 * seconds - 0.5 + gain * (1.0 + 0.25 * t - 0.5), -0.125 * seconds]
            assert u == pytest.approx(expected, rel=1e-6 if float32 else 1e-13, abs=1e-6 if float32 else 1e-13)


def test_each_agent_has_the_numbers_of_its_own_rows(tmp_path):
    """Weights that are not symmetric are those that the agent gives, and gains that begin alike differ later."""
    weights = np.array([[0.0, 1.0, 2.0], [4.0, 0.0, 8.0], [16.0, 32.0, 0.0]])
    later = np.array([2.0, 3.0, 5.0])
    track = fk.Track(fk.Velocity([1.0, 0.0]), 0.0, fk.Schedule([1.0], [np.full(3, 2.0), later]))
    law = fk.Law(fk.Complete(), [fk.Consensus(weights=fk.MatrixWeights(weights)), track])
    compiled = CompiledLaw(tmp_path, scenario_of(law, 3))
    q, p = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), np.array([[1.0, 2.0], [-3.0, 0.5], [0.25, -4.0]])
    for now, gains in ((0, np.full(3, 2.0)), (SHORT, later)):
        for i in range(3):
            code, u, _ = compiled.force(i, q[i], p[i], {j: (q[j], p[j]) for j in range(3) if j != i}, now)
            assert code == CODES["OK"]
            assert u == pytest.approx(weights[i] @ (p - p[i]) + gains[i] * (np.array([1.0, 0.0]) - p[i]), rel=1e-13)


@pytest.mark.parametrize("float32", [False, True])
def test_an_obstacle_at_its_range_acts_and_none_beyond(float32, tmp_path):
    """The damping of (54) does not fade: at the range all of it acts, and nothing one rounding farther away."""
    avoid = fk.Avoid([fk.Wall([0.0, 0.0], [1.0, 0.0])], range=2.0, damping_gain=2.0, gamma_agents=False)
    compiled = CompiledLaw(tmp_path, scenario_of(fk.Law(fk.Proximity(1.0), [avoid]), 2), float32=float32)
    beyond = np.nextafter(compiled.kind(2.0), compiled.kind(3.0))
    for x, expected in ((2.0, [6.0, 0.0]), (beyond, [0.0, 0.0])):
        code, u, _ = compiled.force(0, [x, 1.0], [-3.0, 0.5], {})
        assert code == CODES["OK"]
        assert u == pytest.approx(expected, abs=1e-5 if float32 else 1e-12)


@pytest.mark.parametrize("uneven", [False, True])
def test_agents_at_the_radius_itself_start_linked_under_a_closed_graph(uneven, tmp_path):
    """Olfati-Saber (2003), (1) and (8): nearer than the radius, or at it where the graph is closed."""
    for closed in (True, False):
        graph = fk.PerAgentRadii([2.0, 3.0, 2.0], closed) if uneven else fk.Proximity(2.0, closed)
        folder = tmp_path / str(closed)
        folder.mkdir()
        compiled = CompiledLaw(folder, scenario_of(fk.Law(graph, [fk.Consensus(1.0)]), 3))
        for distance, linked in ((2.0, closed), (np.nextafter(2.0, 3.0), False), (np.nextafter(2.0, 1.0), True)):
            code, u, memory = compiled.force(0, [0.0, 0.0], [0.0, 0.0], {1: ([0.0, distance], [1.0, 0.0])})
            assert (code, u.tolist()) == (CODES["OK"], [float(linked), 0.0])
            assert compiled.links(memory) == [1] * linked
            # As long as nobody moves they stay what they are.
            again, same = compiled.control(memory, [0.0, 0.0], [0.0, 0.0], 1)
            assert (again, same.tolist()) == (code, u.tolist())


@pytest.mark.slow
def test_a_hundred_thousand_states_of_all_papers(tmp_path):
    """Every law of every paper that can be exported, within 8 roundings of what is added up."""
    scenarios = {name: make(0) for key in keys() for name, make in paper(key).scenarios().items()}
    exported, worst, refused = {}, {}, set()
    for name, scenario in scenarios.items():
        folder = tmp_path / name
        folder.mkdir()
        try:
            exported[name] = CompiledLaw(folder, scenario, neighbours=8)
        except FlockingError:
            refused.add(name)
    assert not refused
    each = -(-100_000 // len(exported))
    for seed, (name, compiled) in enumerate(exported.items()):
        worst[name] = agree(compiled, scenarios[name], np.random.default_rng(seed), each)
    print({name: round(x, 2) for name, x in worst.items()})
    assert max(worst.values()) <= 8, worst
