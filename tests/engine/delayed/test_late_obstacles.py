"""Obstacles of agents that know themselves late: closed forms, small steps with queues, SciPy, and wrong engines.

Where an agent was a delay ago, or where its own newest sample was taken, decides on the force of an obstacle and on
whether it is within range of it; the obstacle is where it is now.
"""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.polynomial import Polynomial

import flocking as fk
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.delayed.delayed_law import DelayedLaw
from flocking.engine.delayed.delays import OneDelay
from flocking.engine.delayed.met_obstacles import MetObstacles
from flocking.engine.delayed.stepping import DelayedSteps
from flocking.engine.protocol.session import Stored
from flocking.model.potentials.bumps import Bump
from tests.engine.delayed.plain_delays import PlainDelays
from tests.engine.delayed.test_sessions import check_going_on, same
from tests.engine.sampled.test_obstacles import BALL, RANGE, alone, ball_force, by_hand

# One agent and a wall: the delayed oscillator.

STIFFNESS, PUSH, TAU = 4.0, 0.3, 0.2
SPRING = fk.Potential("k*(r - d)**2/2 - f*r", k=STIFFNESS, d=1.0, f=PUSH)
FLAT = Bump("flat", "(z + k0)/(z + k0)")


def spring(*walls):
    """Within range 1 of a wall the force k (1 - s) + f pushes away from it."""
    return fk.Avoid(walls, range=1.0, repulsion_gain=1.0, damping_gain=0.0, repulsion=SPRING, bump=FLAT,
                    gamma_agents=False)  # fmt: skip


def lonely(term, information, speed=-1.0, **parts):
    law = fk.Law(fk.Fixed(1, []), [term])
    start = fk.State([[2.0]], [[speed]])
    given = {"t_end": 3.0, "frames": 4, "tolerance": 1e-11}
    return fk.Scenario(law, start, information=information, **{**given, **parts})


WALL = fk.Wall([0.0], [1.0])
LATE = fk.Delayed(TAU, self_delayed=True)


def delayed_oscillator(t_end):
    """Position at the end by the method of steps, and when the agent crosses the range; it meets it at t = 1.

    With x = s - 1: x'' = f - k x(t - tau) from 1 + tau on, until a delay after x has come back to 0.
    """
    x, at = Polynomial([0.0, -1.0]), 1.0
    while True:
        before, at = x, at + TAU
        speed = (PUSH - STIFFNESS * before).integ(k=before.deriv()(TAU))
        x = speed.integ(k=before(TAU))
        back = [r.real for r in x.roots() if abs(r.imag) < 1e-12 and 0.0 < r.real <= TAU]
        if back:
            (out,) = back
            break
    last = (PUSH - STIFFNESS * x).integ(k=x.deriv()(TAU))
    place = last.integ(k=x(TAU))
    left = at + TAU + out
    assert t_end > left
    return 1.0 + place(out) + last(out) * (t_end - left), (1.0, at + out)


def test_a_wall_with_a_spring_is_the_delayed_oscillator():
    run = fk.simulate(lonely(spring(WALL), LATE), progress=False)
    assert run.fidelity.engine == "delayed"
    place, crossed = delayed_oscillator(3.0)
    assert run.q[-1, 0, 0] == pytest.approx(place, abs=1e-9)
    assert run.switches["time"] == pytest.approx(crossed, abs=1e-9)
    assert abs(run.trace["departed"][-1]) > 0.1
    assert np.abs(run.residual).max() < 1e-9 * max(1.0, run.turnover)


@pytest.mark.parametrize(
    "tau",
    [TAU, [[TAU]]],
)
def test_the_force_of_an_obstacle_at_rest_begins_and_ends_a_delay_after_the_true_range_is_crossed(tau):
    session = fk.start(lonely(spring(WALL), fk.Delayed(tau, self_delayed=True)))
    for crossed, acts in zip(delayed_oscillator(3.0)[1], (True, False), strict=True):
        for off in (-1e-8, 1e-8):
            session.advance(crossed + TAU + off)
            assert (abs(session.accelerations()[0, 0]) > 0.2) == (acts == (off > 0.0))


def test_where_an_obstacle_moves_the_range_is_crossed_by_the_known_place_and_the_present_obstacle():
    """The agent, at 2 - t, takes itself to be at 2 - (t - tau); the wall is at v t, and its range ends at 1 + v t."""
    session = fk.start(lonely(spring(fk.Wall(fk.Velocity([0.45], [0.0]), [1.0])), LATE))
    known, true = (1.0 + TAU) / 1.45, 1.0 / 1.45
    assert abs(known - true - TAU) > 0.05
    for off in (-1e-8, 1e-8):
        session.advance(known + off)
        assert (session.accelerations()[0, 0] > 0.2) == (off > 0.0)
    assert session.run().switches["time"][0] == pytest.approx(true, abs=1e-11)
    # A jump of the force comes back a delay later, again and again: steps end there.
    breaks = session.delays.points.arrays()["breaks"]
    assert [bool(np.abs(breaks - known - k * TAU).min() < 1e-9) for k in range(1, 9)] == [True] * 8


def test_ranges_that_are_crossed_on_one_step_are_crossed_one_after_the_other():
    """The agent is at 2.03 - t until 1.23; the ranges of the walls end at 1 and at 0.95."""
    made = lonely(spring(WALL, fk.Wall([-0.05], [1.0])), LATE)
    session = fk.start(made.with_(start=fk.State([[2.03]], [[-1.0]])))
    for at, forces in ((1.23, (0.0, PUSH)), (1.28, (PUSH + 0.05 * STIFFNESS, 2.0 * PUSH + 0.05 * STIFFNESS))):
        for off, force in zip((-1e-8, 1e-8), forces, strict=True):
            session.advance(at + off)
            assert session.accelerations()[0, 0] == pytest.approx(force, abs=1e-6)
    assert session.run().switches["time"] == pytest.approx([1.03, 1.08], abs=1e-11)


def test_the_line_before_the_start_is_a_known_path_too():
    """An agent that comes from the wall is beyond its range at the start, and takes itself to be within until later."""
    made = lonely(spring(WALL), LATE, speed=8.0).with_(start=fk.State([[1.4]], [[8.0]]))
    session = fk.start(made)
    assert session.accelerations()[0, 0] == pytest.approx(PUSH + STIFFNESS * (1.0 - (1.4 - 8.0 * TAU)), abs=1e-12)
    crossed = TAU - 0.4 / 8.0
    for off in (-1e-8, 1e-8):
        session.advance(crossed + off)
        assert (session.accelerations()[0, 0] > 0.2) == (off < 0.0)
    assert not len(session.run().switches)


@pytest.mark.parametrize("moving", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_short_delays_tend_to_the_run_of_the_exact_engine_at_first_order(moving):
    wall = fk.Wall(fk.Velocity([0.2], [0.0]), [1.0]) if moving else WALL
    ideal = fk.simulate(lonely(spring(wall), fk.Instant()), progress=False)
    assert ideal.fidelity.engine == "exact"
    runs = [
        fk.simulate(lonely(spring(wall), fk.Delayed(tau, self_delayed=True)), progress=False) for tau in (0.02, 0.01)
    ]
    gaps = [float(np.abs(run.q[-1] - ideal.q[-1]).max()) for run in runs]
    assert 1e-3 < gaps[1] < 0.1
    assert math.log2(gaps[0] / gaps[1]) == pytest.approx(1.0, abs=0.05)


# Two agents by small steps with queues, and three by SciPy.

MOVING = fk.Ball(fk.Velocity([-0.4, 0.1], start=[4.0, 0.3]), 1.0)
GAIN = 0.4


def two(obstacle, information=LATE, **parts):
    avoid = fk.Avoid([obstacle], range=RANGE, gamma_agents=False, repulsion_gain=8.0, damping_gain=1.0)
    law = fk.Law(
        fk.Fixed.complete(2),
        [
            fk.Gradient(
                fk.Potential(
                    "r**2/2",
                )
            ),
            fk.Consensus(GAIN),
            avoid,
        ],
    )
    start = fk.State([[0.0, 0.0], [0.8, 0.7]], [[2.0, 0.0], [1.8, -0.2]])
    return fk.Scenario(law, start, information=information, **{"t_end": 2.0, "frames": 3, **parts})


def by_small_steps(made, centre, speed, parts):
    """Positions at the end by steps of tau/parts: a queue of states, forces of what is known; nothing is located."""
    h, past = TAU / parts, []
    q, p = made.start.q.copy(), made.start.p.copy()
    for k in range(-parts, 0):
        past.append((q + k * h * p, p.copy()))
    for k in range(round(made.t_end / h)):
        past.append((q.copy(), p.copy()))
        x, v = past[k]
        u = x[::-1] - x + GAIN * (v[::-1] - v)
        ball = np.add(centre, k * h * np.asarray(speed))
        for i in range(2):
            u[i] += ball_force(x[i], v[i], ball, 1.0, speed)
        q, p = q + h * p + 0.5 * h * h * u, p + h * u
    return q


KINDS = {"rest": (BALL, (4.0, 0.3), (0.0, 0.0)), "moving": (MOVING, (4.0, 0.3), (-0.4, 0.1))}


@pytest.mark.parametrize("kind", KINDS)
def test_small_steps_with_queues_tend_to_the_same_motion_at_first_order(kind):
    obstacle, *ball = KINDS[kind]
    run = fk.simulate(two(obstacle), progress=False)
    assert (run.switches["kind"] == "obstacle").sum() >= 2
    gaps = [np.abs(by_small_steps(run.scenario, *ball, parts) - run.q[-1]).max() for parts in (50, 200)]
    assert gaps[1] < 5e-3
    assert gaps[0] / gaps[1] == pytest.approx(4.0, rel=0.25)
    assert np.abs(run.residual).max() <= 1e-7 * run.turnover


def true_range(patch):
    """Where agents are decides on the range."""
    init = MetObstacles.__init__
    patch.setattr(MetObstacles, "__init__", lambda self, law, q, known, t: init(self, law, q, None, t))


def true_place(patch):
    """Forces of obstacles are those at the place where agents are."""
    forces = DelayedSteps._force

    def force(self, seconds, y):
        found = forces(self, seconds, y)
        if self._apart is None:
            return found
        true = self._true(y)
        own, _ = self.delays.states(seconds, true, *self._law.linked)
        t = self._base + seconds
        return found + self._apart.forces(t, true, true[:0]) - self._apart.forces(t, own, own[:0])

    prepare = DelayedSteps._prepare

    def prepared(self, scenario, longest_step):
        self._apart = None
        prepare(self, scenario, longest_step)

    relink = DelayedSteps._relink_known

    def relinked(self):
        relink(self)
        alone = fk.Law(fk.Fixed(self.n, []), list(self.scenario.law.body_terms))
        self._apart = self._apart or DelayedLaw(self.scenario.with_(law=alone))
        self._apart.relink(np.zeros((1, self.n, self.n), dtype=bool), self.obstacles.known.pairs)

    patch.setattr(DelayedSteps, "_prepare", prepared)
    patch.setattr(DelayedSteps, "_relink_known", relinked)
    patch.setattr(DelayedSteps, "_force", force)


def late_obstacle(patch):
    """Obstacles are known late, too."""
    forces = DelayedLaw.forces
    patch.setattr(DelayedLaw, "forces", lambda self, t, *given: forces(self, t - TAU, *given))
    first = MetObstacles.first_on
    patch.setattr(MetObstacles, "first_on", lambda self, base, *given: first(self, base - TAU, *given))


def not_located(patch):
    """The range is looked at when steps end."""
    patch.setattr(OneDelay, "own_paths", lambda self, segment: [])
    end = DelayedSteps._end_step

    def ended(self, t):
        end(self, t)
        own = self.delays.own(t, self._true(np.array(self._segment.coefficients[-1])))
        self.obstacles.take(self._everybody, own[:, : self.m], self._base + t)
        self._relink_known()

    patch.setattr(DelayedSteps, "_end_step", ended)


@pytest.mark.parametrize("broken", [true_range, true_place, late_obstacle, not_located])
def test_wrong_engines_are_found(monkeypatch, broken):
    broken(monkeypatch)
    judge = test_a_wall_with_a_spring_is_the_delayed_oscillator
    if broken in (late_obstacle, not_located):
        judge = test_where_an_obstacle_moves_the_range_is_crossed_by_the_known_place_and_the_present_obstacle
    with pytest.raises(AssertionError):
        judge()


def avoid():
    """A ball ahead of the agents, one that moves, and a wall."""
    moving = fk.Ball(fk.Velocity([-0.3, 0.0], [3.5, 1.5]), 0.4)
    return fk.Avoid([fk.Ball([2.4, 0.3], 0.5), moving, fk.Wall([0.0, -0.5], [0.0, 1.0])], range=0.9, gamma_agents=False)


PAIRS = fk.Delayed([[0.1, 0.1, 0.2], [0.15, 0.0, 0.1], [0.1, 0.0, 0.25]], self_delayed=True)
"""One agent knows its own present."""

OWN = {"one": fk.Delayed(0.15, self_delayed=True), "pairs": PAIRS}


def three(information, order=2, **parts):
    terms = [fk.Gradient(fk.Potential("1.5*(r - 1)**2/2")), *([fk.Consensus(0.8)] if order == 2 else []), avoid()]
    start = fk.State([[0.9, 0.0], [1.4, 1.1], [0.3, 0.8]], [[1.2, 0.1], [1.0, -0.2], [1.3, 0.0]])
    bodies = fk.PointMass(damping=0.1) if order == 2 else fk.SingleIntegrator()
    start = start if order == 2 else fk.State(start.q)
    common = {"t_end": 0.4, "frames": 6, "tolerance": 1e-10, "information": information, "bodies": bodies}
    return fk.Scenario(fk.Law(fk.Hysteresis(2.0, 0.3), terms), start, **{**common, **parts})


ALONE = fk.Law(fk.Fixed(3, []), [avoid()])
"""Obstacles alone."""


class PlainLateObstacles(PlainDelays):
    """`PlainDelays` with the forces of obstacles as the reference on arrays computes them, where agents were."""

    def rate(self, t, y, solutions):
        self._then = [self.split(y) if d == 0 else self.past(t - d, solutions) for d in self.delays.diagonal()]
        return super().rate(t, y, solutions)

    def moved(self, t, y, u):
        q, p = (np.array([then[part][i] for i, then in enumerate(self._then)]) for part in (0, 1))
        return super().moved(t, y, u + fk.control(ALONE, fk.State(q, p, max(t, 0.0))))


@pytest.mark.parametrize(
    ("name", "order"),
    [("pairs", 2), *(pytest.param(*given, marks=pytest.mark.slow) for given in (("one", 2), ("one", 1), ("pairs", 1)))],
)
def test_obstacles_beside_late_neighbours_by_scipy(name, order):
    made = three(OWN[name], order)
    run = fk.simulate(made, progress=False)
    q, p, _ = PlainLateObstacles(made, lambda r: 1.5 * (r - 1), 0.8).run(0.4)
    assert (run.switches["kind"] == "obstacle").sum() > 1
    assert np.abs(run.q[-1] - q).max() < 1e-7
    if order == 2:
        assert np.abs(run.p[-1] - p).max() < 1e-7
    assert np.abs(run.residual).max() <= 1e-8 * run.turnover
    assert fk.replay(run).agrees
    found = fk.departed_causes(run)
    assert np.abs(found.remainder).max() < 1e-7
    assert abs(found.causes["delay"][-1]) > 1e-3


# Own samples.


def measured(obstacle=BALL, **parts):
    """The agent of the tests of held control, which knows itself by a sample every 0.1."""
    avoid = fk.Avoid([obstacle], range=RANGE, gamma_agents=False, repulsion_gain=8.0, damping_gain=1.0)
    given = {"control": fk.Continuous(), "information": fk.Messages(0.1, self_known="measured"), "tolerance": 1e-11}
    made = alone(**{**given, **parts})
    return made.with_(law=dataclasses.replace(made.law, terms=(made.law.terms[0], avoid)))


@pytest.mark.parametrize("predict", [pytest.param(False, marks=pytest.mark.slow), True])
def test_own_samples_are_held_and_so_are_the_forces_of_obstacles_at_rest(predict):
    """As held control of the same period, by a recursion; samples of others alone are moved on."""
    run = fk.simulate(measured(information=fk.Messages(0.1, self_known="measured", predict=predict)), progress=False)
    assert run.fidelity.engine == "delayed"
    assert np.abs(run.q[:, 0] - by_hand(np.array([0.0, 0.0]), np.array([2.0, 0.0]), 0.1, 31)).max() < 1e-9
    assert np.abs(run.residual).max() < 1e-9 * max(1.0, run.turnover)
    assert fk.replay(run).agrees


def moved_by_samples(centre, speed, count):
    """Positions when samples are taken: forces of the place measured and the ball as it moves, by Gauss's rule.

    Between two samples the squared distance to the ball is a quadratic in time: when it is that of the range or of the
    onset of the bump follows from it, and integrals end there.
    """
    nodes, weights = np.polynomial.legendre.leggauss(12)
    q, p, found, crossings = np.array([0.0, 0.0]), np.array([2.0, 0.0]), [], 0
    speed = np.asarray(speed)
    for k in range(count):
        found.append(q.copy())
        x, v, ends = q.copy(), p.copy(), [0.0, 0.1]
        away = x - (np.asarray(centre) + 0.1 * k * speed)
        for level in (RANGE, 5.0 / 6.0 * RANGE):
            roots = Polynomial([away @ away - (1.0 + level) ** 2, -2.0 * away @ speed, speed @ speed]).roots()
            inner = [r.real for r in roots if abs(r.imag) < 1e-12 and 0.0 < r.real < 0.1]
            ends, crossings = ends + inner, crossings + len(inner) * (level == RANGE)
        ends = sorted(ends)
        kick, way = np.zeros(2), np.zeros(2)
        for begin, end in pairwise(ends):
            for place, weight in zip(nodes, 0.5 * (end - begin) * weights, strict=True):
                since = 0.5 * (begin + end + (end - begin) * place)
                u = ball_force(x, v, np.asarray(centre) + (0.1 * k + since) * speed, 1.0, speed)
                kick, way = kick + weight * u, way + weight * (0.1 - since) * u
        q, p = q + 0.1 * p + way, p + kick
    return np.array(found), crossings


def test_a_ball_that_moves_meets_the_place_of_an_own_sample_between_two_samples():
    speed = (-1.6, 0.1)
    ball = fk.Ball(fk.Velocity(list(speed), start=[4.0, 0.3]), 1.0)
    run = fk.simulate(measured(ball, t_end=1.3, frames=14), progress=False)
    hand, crossings = moved_by_samples((4.0, 0.3), speed, 14)
    assert crossings == 2
    assert np.abs(run.q[:, 0] - hand).max() < 1e-9
    assert np.abs(run.residual).max() < 1e-9 * max(1.0, run.turnover)
    assert fk.replay(run).agrees
    found = fk.departed_causes(run)
    assert np.abs(found.remainder).max() < 1e-8
    assert not found.causes["links"].any()
    assert abs(found.causes["delay"][-1]) > 1e-2


def test_errors_of_own_samples_decide_on_the_range_too():
    """Departed energy of noise: the forces at measured places less those at exact ones, with the ranges of both."""
    information = fk.Messages(0.1, self_known="measured", noise=fk.WhiteNoise(0.3), seed=4)
    run = fk.simulate(measured(MOVING, information=information, t_end=1.1), progress=False)
    assert fk.replay(run).agrees
    found = fk.departed_causes(run)
    assert np.abs(found.remainder).max() < 1e-8
    assert min(abs(found.causes[name][-1]) for name in ("noise", "delay")) > 1e-3
    assert not any(found.causes[name].any() for name in ("links", "loss"))


def test_frequent_own_samples_tend_to_the_run_of_the_exact_engine_at_first_order():
    ideal = fk.simulate(measured(information=fk.Instant()), progress=False)
    assert ideal.fidelity.engine == "exact"
    gaps = [
        np.abs(fk.simulate(measured(information=fk.Messages(period, self_known="measured")), progress=False).q[-1]
               - ideal.q[-1]).max()
        for period in (0.04, 0.02)
    ]  # fmt: skip
    assert math.log2(gaps[0] / gaps[1]) == pytest.approx(1.0, abs=0.25)


# Sessions.

WORLDS = {
    "one": three(OWN["one"], t_end=1.0), "pairs": three(OWN["pairs"], t_end=1.0),
    "measured": three(fk.Messages(0.11, delay=0.03, self_known="measured", loss=0.2), t_end=1.0),
}  # fmt: skip


@pytest.mark.parametrize("name", ["one", pytest.param("pairs", marks=pytest.mark.slow), "measured"])
def test_moments_and_stored_runs_give_the_same_bits(name, tmp_path):
    made = WORLDS[name]
    whole = fk.simulate(made, progress=False)
    assert (whole.switches["kind"] == "obstacle").any()
    # Where the known range is crossed a step ends: a moment at it and beside it.
    check_going_on(made, whole, (0.4, float(whole.trace["time"][len(whole.trace) // 2])), tmp_path)


@pytest.mark.parametrize("name", WORLDS)
def test_crafted_ranges_of_what_is_known_are_refused(name):
    session = fk.start(WORLDS[name])
    while not any(near.any() for near in session.obstacles.known.near):
        session.advance(session.time + 0.05)
    numbers, arrays = session.pack()
    stored = Stored(WORLDS[name], None, session.records.counts, lambda: session.run("unfinished"))
    wrong = {
        "known_near_obstacles": ~arrays["known_near_obstacles"], "known_meetings": np.array([[0, 0, 1], [0, 0, 1]]),
        "near_obstacles": ~arrays["near_obstacles"], "meetings": np.array([[0, 3, 0]]),
    }  # fmt: skip
    for key, value in wrong.items():
        with pytest.raises(MalformedError, match=f"^{key} must"):
            type(session).unpack((dict(numbers), arrays | {key: value}), stored, {})
    far = np.array([[0, 1, 0]])
    with pytest.raises(MalformedError, match="known_meetings must be at the range of an obstacle"):
        type(session).unpack((dict(numbers), arrays | {"known_meetings": far}), stored, {})
    type(session).unpack((dict(numbers), dict(arrays)), stored, {})


@pytest.mark.parametrize("tau", [TAU, [[TAU]]])
def test_a_state_that_is_replaced_meets_an_obstacle_when_it_becomes_known(tau):
    session = fk.start(lonely(spring(WALL), fk.Delayed(tau, self_delayed=True), speed=0.0))
    session.advance(0.7)
    session.replace(state=fk.State([[0.5]], [[0.0]]))
    again = session.moment()()
    for each in (session, again):
        each.advance(0.7 + TAU - 1e-8)
        assert each.accelerations()[0, 0] == 0.0
        each.advance(0.7 + TAU + 1e-8)
        assert each.accelerations()[0, 0] == pytest.approx(PUSH + STIFFNESS * 0.5, abs=1e-6)
    # Away again before the first move is known to be over.
    session.advance(1.0)
    session.replace(state=fk.State([[3.0]], [[0.0]]))
    session.advance(1.0 + TAU - 1e-8)
    assert session.accelerations()[0, 0] > 1.0
    session.advance(1.0 + TAU + 1e-8)
    assert session.accelerations()[0, 0] == 0.0


def test_a_state_that_is_replaced_meets_an_obstacle_with_its_next_own_sample():
    session = fk.start(lonely(spring(WALL), fk.Messages(0.5, self_known="measured"), speed=0.0))
    session.advance(0.7)
    session.replace(state=fk.State([[0.5]], [[0.0]]))
    session.advance(1.0 - 1e-8)
    assert session.accelerations()[0, 0] == 0.0
    session.advance(1.0 + 1e-8)
    assert session.accelerations()[0, 0] == pytest.approx(PUSH + STIFFNESS * 0.5, abs=1e-12)


@pytest.mark.parametrize("name", ["one", "measured"])
def test_obstacles_of_another_law_are_met_where_agents_take_themselves_to_be(name):
    """The law gets an obstacle within whose range agents are in truth, and take themselves to be later or not yet."""
    made = lonely(spring(WALL), WORLDS[name].information, speed=-1.0, t_end=2.0)
    none = made.with_(law=fk.Law(fk.Fixed(1, []), [spring(fk.Wall([-9.0], [1.0]))]))
    # Known places at 1.05: that of 0.9, and that of the sample at 0.99.
    session = fk.start(none)
    session.advance(1.05)
    session.replace(law=made.law)
    again = session.moment()()
    begins = 1.15 if name == "one" else 1.1
    for each in (session, again):
        each.advance(begins - 1e-8)
        assert each.accelerations()[0, 0] == 0.0
        each.advance(begins + 1e-8)
        assert each.accelerations()[0, 0] > 0.2
    session.advance(2.0)
    again.advance(2.0)
    assert same(session.run(), again.run())
