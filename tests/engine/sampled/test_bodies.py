"""Bodies under held control, against integration of their equations in small steps and against their closed forms."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flocking as fk
from flocking.engine.kernels.headings import turned
from flocking.engine.sampled.motion import Motion
from flocking.model.world.random_numbers import Purpose, normal_axes
from tests.engine.sampled.test_independent import random_world
from tests.engine.sampled.test_sessions import same

PAIR = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
START = fk.State([[0.0, 0.0], [6.0, 2.0]], [[0.0, 0.0], [-1.0, 0.5]])
WORLD = {"information": fk.Messages(0.1, delay=0.05, loss=0.2, seed=3), "control": fk.Held(0.1, latency=0.03)}


def scenario(bodies, **parts):
    return fk.Scenario(PAIR, START, **{"t_end": 1.0, "frames": 11, "control": fk.Held(0.1), "bodies": bodies, **parts})


def gust(seed, number, agents, period):
    return np.stack(normal_axes(seed, Purpose.GUST, np.arange(agents), number, 2), axis=1) / math.sqrt(period)


class Bodies:
    """A chain of bodies written a second time: its state is integrated numerically from event to event.

    ``before`` and ``behind`` are (sigma, period, seed) of gusts before and behind the lag.
    """

    def __init__(self, mass, damping, most=math.inf, tau=None, rate=math.inf, before=None, behind=None, offset=None):
        self.mass, self.damping, self.most, self.tau, self.rate = mass, damping, most, tau, rate
        self.before, self.behind, self.offset = before, behind, offset

    @property
    def declared(self):
        point = fk.PointMass if self.offset is None else lambda m, k: fk.Unicycle(self.offset, m, k)
        body = point(self.mass, self.damping)
        if self.behind:
            body = fk.Disturbed(body, *self.behind)
        if self.tau is not None:
            body = fk.Lagged(body, self.tau)
        if self.rate < math.inf:
            body = fk.Limited(body, rate=self.rate)
        if self.most < math.inf:
            body = fk.Limited(body, force=self.most)
        return fk.Disturbed(body, *self.before) if self.before else body

    def instants(self, end):
        periods = [round(x[1] * 1e9) for x in (self.before, self.behind) if x]
        return sorted({k for T in periods for k in range(T, round(end * 1e9), T)})

    def wind(self, source, now, n):
        if not source:
            return np.zeros((n, 2))
        sigma, period, seed = source
        return sigma * gust(seed, now // round(period * 1e9), n, period)

    def moved(self, q, p, lag, heading, wanted, now, s):
        """The state after a time, under the forces wanted and the gusts of this time."""
        n = len(q)
        wanted = wanted + self.wind(self.before, now, n)
        length = np.linalg.norm(wanted, axis=1, keepdims=True)
        wanted = wanted * np.minimum(1.0, self.most / np.maximum(length, 1e-300))
        wind = self.wind(self.behind, now, n)

        def slope(_, z):
            q, p, f, e = z.reshape(4, n, 2)
            turn = (e[:, 0] * p[:, 1] - e[:, 1] * p[:, 0]) / (self.offset or 1.0)
            f = wanted if self.tau is None else f
            change = np.zeros_like(f) if self.tau is None else (wanted - f) / self.tau
            size = np.linalg.norm(change, axis=1, keepdims=True)
            change = change * np.minimum(1.0, self.rate / np.maximum(size, 1e-300))
            around = turn[:, None] * np.stack([-e[:, 1], e[:, 0]], axis=1)
            return np.concatenate([p, (f + wind - self.damping * p) / self.mass, change, around]).ravel()

        step = s if self.rate == math.inf else s / 50
        z = solve_ivp(slope, (0.0, s), np.concatenate([q, p, lag, heading]).ravel(), "DOP853", rtol=1e-12, atol=1e-13,
                      max_step=step).y[:, -1]  # fmt: skip
        return z.reshape(4, n, 2)


WIND, COMMAND = (0.3, 0.07, 5), (0.2, 0.04, 9)
CHAINS = {
    "lag": Bodies(1.5, 0.0, tau=0.2),
    "lag and damping": Bodies(1.5, 0.4, tau=0.2),
    "lag as fast as damping": Bodies(1.0, 5.0, tau=0.2),
    "limits": Bodies(1.0, 0.0, most=2.0, tau=0.15, rate=4.0),
    "gusts": Bodies(1.0, 0.0, before=COMMAND, most=2.0),
    "gusts before and behind a lag": Bodies(2.0, 0.3, before=COMMAND, tau=0.1, behind=WIND),
    "unicycle": Bodies(1.0, 0.0, offset=0.3),
    "all": Bodies(1.5, 0.4, most=3.0, tau=0.1, rate=20.0, before=COMMAND, behind=WIND, offset=0.1),
}


QUICK = {"lag and damping", "gusts", "gusts before and behind a lag", "unicycle"}


@pytest.mark.parametrize(
    "chain", [pytest.param(x, id=k, marks=() if k in QUICK else pytest.mark.slow) for k, x in CHAINS.items()]
)
def test_bodies_move_as_their_equations_say(chain):
    """Two agents on a spring under held control, integrated in small steps; frames fall on ticks and between them."""
    made = scenario(chain.declared, frames=21)
    run = fk.simulate(made, progress=False)
    assert run.fidelity.engine == "sampled"
    q, p, now = START.q, START.p, 0
    lag, heading = np.zeros((2, 2)), np.array([[1.0, 0.0], p[1] / np.linalg.norm(p[1])])
    wanted = np.zeros((2, 2))
    frames = [round(t * 1e9) for t in run.t]
    instants = sorted({*frames, *chain.instants(1.0), *range(0, 10**9, 10**8)})
    tolerance = 1e-9 if chain.rate == math.inf else 1e-6
    for at in instants:
        if at > now:
            q, p, lag, heading = chain.moved(q, p, lag, heading, wanted, now, (at - now) / 1e9)
            now = at
        if at in frames:
            k = frames.index(at)
            assert np.abs(run.q[k] - q).max() < tolerance
            assert np.abs(run.p[k] - p).max() < tolerance
            if chain.offset:
                assert np.abs(run.columns["heading"][k] - heading).max() < 100 * tolerance
            if chain.tau is not None:
                assert np.abs(run.columns["applied"][k] - lag).max() < 10 * tolerance
        if at % 10**8 == 0:
            wanted = q[::-1] - q + p[::-1] - p
    assert np.abs(run.residual).max() < 1e-11 * max(1.0, run.turnover)


@pytest.mark.parametrize("name", [pytest.param("gusts before and behind a lag", marks=pytest.mark.slow), "all"])
def test_bodies_go_on_with_the_same_bits_and_their_log_is_right(name):
    made = scenario(CHAINS[name].declared, **WORLD)
    whole = fk.simulate(made, progress=False)
    session = fk.start(made)
    session.advance(0.634)
    again = session.moment()()
    again.advance(1.0)
    assert same(again.run(), whole)
    found = fk.replay(whole)
    assert found.agrees, str(found)
    causes = fk.departed_causes(whole).causes
    assert causes["disturbance"].any()
    assert causes["lag"].any()


def test_gusts_forgotten_by_the_motion_are_caught(monkeypatch):
    exert = Motion.exert
    monkeypatch.setattr(Motion, "exert", lambda self, time, agents, force=None, beside=None: exert(
        self, time, agents, force, None if beside is None else 0.9 * beside))  # fmt: skip
    made = scenario(CHAINS["gusts before and behind a lag"].declared, **WORLD)
    assert "from where the logged forces lead" in str(fk.replay(fk.simulate(made, progress=False)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_random_worlds_of_bodies_replay(seed):
    """Random messages, losses, noise and clocks under random bodies: the second computation of the motion agrees."""
    made, _ = random_world(seed)
    rng = np.random.default_rng(seed)
    n, body = made.start.n, made.agents
    if rng.random() < 0.5:
        body = fk.Unicycle(rng.uniform(0.1, 0.5, n), body.masses, rng.uniform(0.0, 1.0, n))
    if rng.random() < 0.5:
        body = fk.Disturbed(body, rng.uniform(0.0, 0.5, n), float(rng.uniform(0.03, 0.2)), seed)
    if rng.random() < 0.7:
        body = fk.Lagged(body, rng.uniform(0.05, 0.5, n))
        if rng.random() < 0.5:
            body = fk.Limited(body, rate=rng.uniform(1.0, 5.0, n))
    if rng.random() < 0.5:
        body = fk.Limited(body, force=rng.uniform(0.3, 2.0, n), shape=str(rng.choice(["ball", "box"])))
    run = fk.simulate(made.with_(agents=body), progress=False)
    found = fk.replay(run)
    assert found.agrees, str(found)
    assert np.abs(run.residual).max() <= 1e-11 * max(1.0, run.turnover) + run.fidelity.ledger.size


def test_agents_without_inertia_lag_as_the_recursion_says():
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2"))])
    bodies = fk.Lagged(fk.SingleIntegrator(), 0.5)
    made = fk.Scenario(law, fk.State([[0.0], [8.0]]), t_end=2, frames=9, bodies=bodies, control=fk.Held(0.25))
    run = fk.simulate(made, progress=False)
    x, v, fall = 8.0, 0.0, math.exp(-0.5)
    for k in range(9):
        assert run.q[k, 1, 0] - run.q[k, 0, 0] == pytest.approx(x, abs=1e-12)
        # The gap closes at the lagged velocity v, which tends to what was wanted at the tick.
        wanted = -2.0 * x
        x, v = x + 0.25 * wanted + (v - wanted) * 0.5 * (1.0 - fall), wanted + (v - wanted) * fall
    assert np.abs(run.residual).max() < 1e-11 * max(1.0, run.turnover)


def test_the_hand_point_of_a_unicycle_moves_as_a_point_mass_to_the_last_bit():
    free = fk.simulate(scenario(fk.PointMass(), **WORLD), progress=False)
    run = fk.simulate(scenario(fk.Unicycle(0.3), **WORLD), progress=False)
    assert np.array_equal(run.q, free.q)
    assert np.array_equal(run.trace, free.trace)


def test_headings_are_those_of_the_tractrix():
    """A hand point on a straight line at speed v: tan of half the angle to the line falls as exp(-v t/d)."""
    C = np.zeros((3, 1, 2))
    C[1, 0] = [3.0, 0.0]
    for angle in (0.1, 2.0, -3.0):
        for t in (0.01, 1.0, 4.0):
            found = turned(C, np.array([0.5]), np.array([t]), np.array([[math.cos(angle), math.sin(angle)]]))[0]
            half = math.tan(angle / 2) * math.exp(-3.0 * t / 0.5)
            assert found == pytest.approx([(1 - half**2) / (1 + half**2), 2 * half / (1 + half**2)], abs=1e-14)


def test_short_periods_tend_to_the_motion_of_continuous_control():
    bodies = fk.Lagged(fk.Unicycle(0.2), 0.3)
    ideal = fk.simulate(scenario(bodies, control=fk.Continuous(), tolerance=1e-11), progress=False)
    gaps = []
    for period in (0.02, 0.01):
        run = fk.simulate(scenario(bodies, control=fk.Held(period)), progress=False)
        both = [(run.q, ideal.q), *((run.columns[name], ideal.columns[name]) for name in ("heading", "applied"))]
        gaps.append([np.abs(a[-1] - b[-1]).max() for a, b in both])
    assert np.log2(np.array(gaps[0]) / gaps[1]) == pytest.approx([1.0, 1.0, 1.0], abs=0.2)


def test_links_switch_where_gusts_push_agents():
    """A gust that begins between two ticks ends every motion: links found beyond it are not taken."""
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(0.5)])
    start = fk.start.box(6, side=3.0, speed=1.0, seed=4)
    # Pieces of motion end at ticks and gusts alone; strong gusts turn agents around within a period.
    bodies = fk.Disturbed(fk.PointMass(), 3.0, 0.07, 2)
    run = fk.simulate(
        fk.Scenario(law, start, t_end=4.0, frames=401, bodies=bodies, control=fk.Held(0.5)), progress=False
    )
    away = np.linalg.norm(run.q[:, :, None] - run.q[:, None], axis=-1)
    near = (away < 2.0) & ~np.eye(6, dtype=bool)
    assert np.array_equal(run.links, near)
    assert len(run.switches) > 3


@pytest.mark.parametrize("lag", [None, 0.2])
def test_true_links_follow_distances_where_pieces_are_renewed_early(lag):
    """Pieces of damped and lagged agents that end together with others' were looked at twice for switches."""
    n = 60
    varied = np.linspace(0.5, 1.5, n)
    body = fk.PointMass(varied, 0.3)
    bodies = body if lag is None else fk.Lagged(body, varied)
    law = fk.Law(fk.Proximity(2.5), [fk.Gradient(fk.Potential("(r - 2)**2")), fk.Consensus(1.0)])
    start = fk.start.box(n, side=10, speed=1, seed=3)
    run = fk.simulate(fk.Scenario(law, start, t_end=2.0, frames=201, bodies=bodies, control=fk.Held(0.1)))
    near = np.linalg.norm(run.q[:, :, None] - run.q[:, None], axis=-1) < 2.5
    near[:, np.arange(n), np.arange(n)] = False
    assert (run.links == near).all()
    pairs = np.stack([run.switches["i"], run.switches["j"]])
    for i, j in np.unique(pairs, axis=1).T:
        kinds = run.switches["kind"][(pairs[0] == i) & (pairs[1] == j)]
        assert (kinds[1:] != kinds[:-1]).all()
