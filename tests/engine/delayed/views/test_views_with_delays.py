"""Fields of view and cones with delays: links of what agents knew a delay before, and true ones, located."""

from __future__ import annotations

import math

import numpy as np
import pytest

import flocking as fk
from flocking.engine.delayed import delays
from flocking.engine.imperfect.turning_views import TurningView
from tests.engine.delayed.test_message_sessions import same_logs
from tests.engine.delayed.test_sessions import same
from tests.engine.delayed.views.plain_delayed_views import PlainDelayedCones, PlainDelayedViews

STIFF, GAIN = 0.3, 0.1
DELAYS = ("one", "one, also of themselves", "of pairs", "of pairs and of themselves")


def delayed(rng, n, kind):
    """A random delay of one of the `DELAYS`."""
    if kind in DELAYS[:2]:
        return fk.Delayed(float(rng.uniform(0.05, 0.3)), self_delayed=kind == DELAYS[1])
    tau = rng.choice([0.0, 0.1, 0.15, 0.25], (n, n))
    tau[0, 1] = 0.1
    if kind == DELAYS[2]:
        np.fill_diagonal(tau, 0.0)
    return fk.Delayed(tau, self_delayed=kind == DELAYS[3])


def viewed(seed, along, kind):
    """A random world, and its second implementation."""
    rng = np.random.default_rng(seed)
    n, order = int(rng.integers(3, 6)), 2 if along == "p" else int(rng.integers(1, 3))
    start = fk.State(rng.uniform(0, 3, (n, 2)), rng.normal(size=(n, 2)) if order == 2 else np.zeros((n, 2)))
    headings = None if along == "p" else rng.uniform(-3, 3, n)
    bodies = fk.SingleIntegrator(headings=headings)
    if order == 2:
        bodies = fk.PointMass(rng.uniform(0.5, 2.0, n), float(rng.choice([0.0, 0.4])), headings=headings)
    radius, angle = rng.uniform(1.5, 2.5, n), rng.uniform(0.4, 2.8, n)
    graph = fk.Cone(radius, 0.5 * angle, "rotation") if along == "cone" else (
        fk.FieldOfView(radius, angle, *(["p"] if along == "p" else [])))  # fmt: skip
    law = fk.Law(graph, [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=STIFF)), fk.Consensus(GAIN)])
    made = fk.Scenario(law, start, t_end=1.5, frames=31, information=delayed(rng, n, kind), bodies=bodies,
                       tolerance=1e-10)  # fmt: skip
    plain = PlainDelayedCones if along == "cone" else PlainDelayedViews
    angle = 0.5 * angle if along == "cone" else angle
    return made, plain(made, lambda r: STIFF * (r - 1), GAIN if order == 2 else 0.0, angle, headings)


def check(seed, along, kind, replayed=False):
    """The engine and the second implementation agree; how often a known link switched.

    Where they differ by more than 1e-8 the second one is made more accurate: its steps do not end where forces jump a
    delay after a switch.
    """
    made, _ = viewed(seed, along, kind)
    session = fk.start(made)
    start = session.known_links[0].copy()
    session.advance(made.t_end)
    run = session.run()
    for parts in (8, 64):
        plain = viewed(seed, along, kind)[1]
        plain.parts = parts
        assert (start == plain.links).all()
        q, p, switches = plain.run(made.t_end)
        off = max(np.abs(run.q[-1] - q).max(), np.abs(run.p[-1] - p).max())
        if off < 1e-8:
            break
    assert off < 1e-8
    assert run.fidelity.engine == "delayed"
    assert (session.known_links[0] == plain.links).all()
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover)
    for k in range(len(run.t)):
        seen = made.law.graph.start_links(run.q[k], run.p[k] if along == "p" else made.agents.headings)
        assert np.array_equal(run.links[k], seen)
    if replayed:
        found = fk.replay(run)
        assert found.agrees, str(found)
    return switches


ALONG = ("headings", "p", "cone")


@pytest.mark.parametrize("kind", DELAYS)
@pytest.mark.parametrize("along", ALONG)
def test_random_worlds(along, kind):
    assert sum(check(seed, along, kind) for seed in (0, 2)) > 5


@pytest.mark.slow
@pytest.mark.parametrize("kind", DELAYS)
@pytest.mark.parametrize("along", ALONG)
def test_12_more_random_worlds_of_each_kind(along, kind):
    for seed in (1, *range(3, 14)):
        check(seed, along, kind, replayed=True)


RISE, TURN = 2.0 * math.tan(math.pi / 6), 2.0 / math.tan(math.pi / 6)
BEARINGS = {
    "one": (fk.Delayed(0.4), 0.0, 0.4), "one, also of themselves": (fk.Delayed(0.4, self_delayed=True), 0.4, 0.4),
    "of pairs": (fk.Delayed([[0.0, 0.4], [0.3, 0.0]]), 0.0, 0.4),
    "of pairs and of themselves": (fk.Delayed([[0.2, 0.4], [0.3, 0.1]], self_delayed=True), 0.1, 0.4),
}  # fmt: skip


@pytest.mark.parametrize("kind", DELAYS)
def test_a_bearing_is_located_exactly_where_it_is_known(kind):
    """Agent 0 at rest looks along x, agent 1 rises at speed 1 at x = 2: seen between -30 and 30 degrees, a delay later.

    Agent 1, which looks up, sees agent 0, which stays where it is, until that is 30 degrees from straight up, a delay
    later if it knows its own place late.
    """
    world, own, late = BEARINGS[kind]
    start = fk.State([[0.0, 0.0], [2.0, -5.0]], [[0.0, 0.0], [0.0, 1.0]])
    law = fk.Law(fk.FieldOfView(10.0, np.pi / 6), [fk.Consensus(0.0)])
    agents = fk.Agents(headings=[0.0, 0.5 * np.pi])
    run = fk.simulate(fk.Scenario(law, start, 9.0, agents=agents, information=world), progress=False)
    assert run.switches["time"].tolist() == pytest.approx([5.0 - TURN, 5.0 - RISE, 5.0 + RISE], rel=1e-10)
    acts = [(int(agent), 1e-9 * instant) for instant, agent, _ in run.log.ticks.tolist() if instant > 0]
    assert [agent for agent, _ in acts] == [1, 0, 0]
    expected = [5.0 - TURN + own, 5.0 - RISE + late, 5.0 + RISE + late]
    assert [t for _, t in acts] == pytest.approx(expected, abs=2e-9)
    assert fk.replay(run).agrees


def turning(world, **parts):
    """Agent 0 is drawn to the velocity (2, 3) from (2, 0), as others are; it looks along its velocity."""
    half = 0.4
    others = [[1.5 * math.cos(x), 1.5 * math.sin(x)] for x in (half + 0.3, 0.2 - half)]
    start = fk.State([[0.0, 0.0], *others], [[2.0, 0.0]] * 3)
    law = fk.Law(fk.FieldOfView(3.0, half, "p"), [fk.Consensus(0.0), fk.Track(fk.Velocity([2.0, 3.0]), 0.0, 1.0)])
    return fk.Scenario(law, start, 0.8, information=world, **parts)


@pytest.mark.parametrize("pairs", [False, True])
def test_who_knows_itself_late_looks_along_its_velocity_of_then(pairs):
    """All know themselves and others tau = 0.2 ago: they see what was in view then.

    They are drawn at rate 1 to 3 along y from the velocity that they know. Up to tau this is the one of before the
    start: it rises to 3 t, and from there on to 0.6 + 3 s - 1.5 s^2 with s = t - tau.
    """
    tau = 0.2
    world = fk.Delayed(np.full((3, 3), tau) if pairs else tau, self_delayed=True)
    run = fk.simulate(turning(world, tolerance=1e-11), progress=False)
    lost = 2.0 * math.tan(0.2) / 3.0
    seen = tau + 1.0 - math.sqrt(1.0 - (2.0 * math.tan(0.3) - 0.6) / 1.5)
    switches = run.switches[run.switches["i"] == 0]
    assert switches["time"][:2].tolist() == pytest.approx([lost, seen], rel=1e-9)
    acts = [1e-9 * instant for instant, agent, _ in run.log.ticks.tolist() if agent == 0 and instant > 0]
    assert acts[:2] == pytest.approx([lost + tau, seen + tau], abs=2e-9)


def test_who_knows_itself_at_once_looks_along_its_present_velocity():
    """Others are taken to be where they were: they fly on with it, 0.2 behind."""
    run = fk.simulate(turning(fk.Delayed(0.2), tolerance=1e-11), progress=False)
    acts = [1e-9 * instant for instant, agent, _ in run.log.ticks.tolist() if agent == 0 and instant > 0]

    def inside(t, bearing):
        """Velocities are (2, 3 (1 - e^-t)), and (2, 0) before the start."""
        d = 1.5 * np.array([math.cos(bearing), math.sin(bearing)])
        height = 3.0 * (t - 1.0 + math.exp(-t)) - (3.0 * (t - 1.2 + math.exp(0.2 - t)) if t > 0.2 else 0.0)
        return 0.4 - abs(math.atan2(d[1] - height, d[0] - 0.4) - math.atan2(3.0 * (1.0 - math.exp(-t)), 2.0))

    for at in acts:
        assert min(abs(inside(at, 0.7)), abs(inside(at, -0.2))) < 1e-8
    assert len(acts) >= 2


N = 6
RNG = np.random.default_rng(3)
HEADINGS = RNG.uniform(-np.pi, np.pi, N)
START = fk.State(RNG.uniform(0, 4, (N, 2)), 2.0 * RNG.normal(size=(N, 2)))
RADII, ANGLES = np.linspace(2.0, 3.0, N), np.linspace(0.6, 2.5, N)
GRAPHS = {
    "headings": fk.FieldOfView(RADII, ANGLES), "p": fk.FieldOfView(RADII, ANGLES, "p"),
    "cone": fk.Cone(RADII, 1.5, "wrapped"), "smooth cone": fk.SmoothCone(2.5, 0.4, 1.5),
}  # fmt: skip
TAU = np.where(np.eye(N, dtype=bool), 0.05, 0.1 + 0.05 * (np.arange(N)[:, None] % 2))
WORLDS = {"one": fk.Delayed(0.1), "of pairs": fk.Delayed(TAU, self_delayed=True)}


def world(graph, information, t_end=0.6, **parts):
    weighted = graph == "smooth cone"
    terms = [fk.Gradient(fk.Potential("0.1*(r - 1)^2"), **({"weighting": "force"} if weighted else {})),
             fk.Consensus(0.1, weighted=weighted)]  # fmt: skip
    given = {"frames": 13, "agents": fk.PointMass(damping=0.3, headings=HEADINGS), "information": information, **parts}
    return fk.Scenario(fk.Law(GRAPHS[graph], terms), START, t_end, **given)


@pytest.mark.parametrize("kind", WORLDS)
@pytest.mark.parametrize("graph", GRAPHS)
def test_pieces_moments_and_stored_runs_give_the_same_bits(graph, kind, tmp_path):
    made = world(graph, WORLDS[kind])
    whole = fk.simulate(made, save=tmp_path / "run", progress=False)
    assert len(whole.log.ticks) > N
    session = fk.start(made)
    for t in np.linspace(0.01, 0.6, 5):
        session.advance(float(t))
        session = session.moment()()
    assert same(session.run(), whole)
    assert same_logs(session.run(), whole)
    assert same(fk.read_run(tmp_path / "run"), whole)
    fk.write_scenario(made, tmp_path / "world.toml")
    assert same(fk.simulate(fk.read_scenario(tmp_path / "world.toml"), progress=False), whole)
    assert fk.replay(whole).agrees


def robots(information, offset=0.15, speed=0.4, angle=1.8, bearing=0.9, half=0.6):
    """Two robots that drive on along x, of which the first one turns from its angle into its course."""
    law = fk.Law(fk.FieldOfView(2.0, half, "heading"), [fk.Consensus(0.0)])
    headings = {"heading": [[np.cos(angle), np.sin(angle)], [1.0, 0.0]]}
    start = fk.State([[0.0, 0.0], [np.cos(bearing), np.sin(bearing)]], [[speed, 0.0]] * 2, columns=headings)
    return fk.Scenario(law, start, 2.0, bodies=fk.Unicycle(offset), tolerance=1e-10, information=information)


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize("pairs", [False, True])
def test_a_robot_that_turns_into_its_course_sees_a_companion_at_the_closed_times(late, pairs):
    """tan(theta/2) falls as e^(-v t/offset). Robots know at once where they look, however late where they are.

    The companion is taken to be v tau behind where it is, unless the robot knows its own place as late.
    """
    tau, speed, offset, half = 0.3, 0.4, 0.15, 0.6
    delays = np.full((2, 2), tau) if late else tau * (1.0 - np.eye(2))
    made = robots(fk.Delayed(delays if pairs else tau, self_delayed=late), offset, speed, half=half)
    run = fk.simulate(made, progress=False)
    bearing = math.atan2(math.sin(0.9), math.cos(0.9) - (0.0 if late else speed * tau))
    expected = [offset / speed * np.log(np.tan(0.9) / np.tan(x / 2)) for x in (bearing + half, bearing - half)]
    acts = [1e-9 * instant for instant, agent, _ in run.log.ticks.tolist() if agent == 0 and instant > 0]
    assert acts == pytest.approx(expected, abs=3e-9)
    assert fk.replay(run).agrees


@pytest.mark.parametrize("information", [fk.Delayed(0.2), fk.Delayed(0.2, self_delayed=True),
                                         fk.Messages(0.3, predict=True, self_known="measured")])  # fmt: skip
def test_a_robot_that_is_turned_sees_the_other_way_at_once(information):
    session = fk.start(robots(information, angle=0.0, bearing=0.3))
    session.advance(0.25)
    now = session.state
    assert session.known_links[0, 0, 1]
    session.replace(state=fk.State(now.q, now.p, columns={"heading": [[-1.0, 0.0], [1.0, 0.0]]}))
    assert not session.state.links[0, 1]
    assert not session.known_links[0, 0, 1]
    again = session.moment()()
    for each in (session, again):
        each.advance(1.0)
    assert same(session.run(), again.run())


def test_a_state_that_replaces_another_is_seen_a_delay_later():
    """Agent 1 is put behind agent 0, which looks along x at rest: that is known 0.2 later, and in truth at once."""
    start = fk.State([[0.0, 0.0], [1.0, 0.2]], [[0.0, 0.0]] * 2)
    law = fk.Law(fk.FieldOfView(3.0, 1.0), [fk.Consensus(0.0)])
    agents = fk.PointMass(headings=[0.0, 0.0])
    for tau in (0.2, 0.2 * (1.0 - np.eye(2))):
        session = fk.start(fk.Scenario(law, start, 1.0, bodies=agents, information=fk.Delayed(tau)))
        session.advance(0.3)
        session.replace(state=fk.State([[0.0, 0.0], [-1.0, 0.2]], [[0.0, 0.0]] * 2))
        assert not session.state.links[0, 1]
        session.advance(0.499)
        assert session.known_links[0, 0, 1]
        session.advance(0.501)
        assert not session.known_links[0, 0, 1]


def test_a_law_that_replaces_another_is_looked_for_by_its_own_views():
    """From half angles of 0.3 to 1.5: agent 1, at a bearing of 0.5 and at rest, is seen from then on."""
    start, agents = fk.State([[0.0, 0.0], [1.0, 0.55]], [[0.0, 0.0]] * 2), fk.PointMass(headings=[0.0, 0.0])
    laws = [fk.Law(fk.FieldOfView(3.0, half), [fk.Consensus(0.0)]) for half in (0.3, 1.5)]
    session = fk.start(fk.Scenario(laws[0], start, 1.0, bodies=agents, information=fk.Delayed(0.1)))
    session.advance(0.3)
    assert not session.known_links[0, 0, 1]
    session.replace(law=laws[1])
    assert session.known_links[0, 0, 1]
    # Moved out of view it is lost by the new angle, not by the old one.
    session.replace(state=fk.State([[0.0, 0.0], [1.0, 0.55]], [[0.0, 0.0], [-4.0, 0.0]]))
    session.advance(1.0)
    lost = 0.3 + 0.1 + (1.0 - 0.55 / math.tan(1.5)) / 4.0
    acts = [1e-9 * instant for instant, agent, _ in session.run().log.ticks.tolist() if agent == 0 and instant > 3e8]
    assert any(abs(at - lost) < 3e-9 for at in acts)


def looks_elsewhere(patch):
    looking, along = TurningView.looking, TurningView.along
    patch.setattr(TurningView, "looking", lambda self, headings: looking(self, headings + 0.1))
    patch.setattr(TurningView, "along", lambda self, headings: along(self, headings + [[[0.1, 0.1]]]))


def knows_others_now(patch):
    """What is seen is what is there now, not a delay before."""
    switches = delays.known_view_switches
    patch.setattr(delays, "known_view_switches", lambda space, own, known, *rest: switches(space, own, own, *rest))
    patch.setattr(delays.OneDelay, "all_states", lambda self, t, true: (true, true[None]))


@pytest.mark.parametrize("broken", [looks_elsewhere, knows_others_now])
def test_broken_views_are_caught(monkeypatch, broken):
    broken(monkeypatch)
    made = world("p", fk.Delayed(0.1), frames=121)
    assert not fk.replay(fk.simulate(made, progress=False)).agrees
