"""Delays against closed forms: method of steps by hand, limits of stability, and the braking of a moving flock."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

import flocking as fk

SPRING = fk.Gradient(fk.Potential("k*r**2/2", k=1.0))


def group(graph, terms, q, p=None, order=2, **parts):
    p = np.zeros_like(np.asarray(q, dtype=float)) if p is None else p
    bodies = fk.PointMass() if order == 2 else fk.SingleIntegrator()
    return fk.Scenario(fk.Law(graph, terms), fk.State(q, p), bodies=bodies, **parts)


def run_of(scenario):
    return fk.simulate(scenario, engine="delayed", progress=False)


@pytest.mark.parametrize("late", [False, True])
def test_first_order_by_the_method_of_steps(late):
    """x' = -2 x(t - 1) of the difference, x = 1 before; or two agents that know their own present."""
    made = group(fk.Fixed.complete(2), [SPRING], [[0.5, 0.0], [-0.5, 0.0]], order=1, t_end=4.0, frames=41,
                 information=fk.Delayed(1.0, self_delayed=late))  # fmt: skip
    run = run_of(made)
    x = run.q[:, 0, 0] - run.q[:, 1, 0]
    if late:
        expected = [
            sum((-2) ** k * (t - k + 1) ** k / math.factorial(k) for k in range(7) if t >= k - 1) for t in run.t
        ]  # fmt: skip
        assert np.abs(x - expected).max() < 1e-12
        return
    # The difference obeys x' = -x(t) - x(t - 1): on [0, 1] x = -1 + 2 exp(-t), on [1, 2] by variation of constants.
    first, second = run.t <= 1.0, (run.t >= 1.0) & (run.t <= 2.0)
    s = run.t[second] - 1.0
    assert np.abs(x[first] - (2.0 * np.exp(-run.t[first]) - 1.0)).max() < 1e-8
    assert np.abs(x[second] - (1.0 + (2.0 / math.e - 2.0 - 2.0 * s) * np.exp(-s))).max() < 1e-8


def growth(scenario, mode, tau):
    """Size of a mode in the last periods of a run relative to that in earlier ones; a period at the limit is 4 tau."""
    run = run_of(scenario)
    x = np.abs(np.einsum("i,fi->f", mode, run.q[:, :, 0]))
    early = (run.t >= 20 * tau) & (run.t <= 28 * tau)
    return float(x[run.t >= run.t[-1] - 8 * tau].max() / x[early].max())


def first_order_at(share, seed, *, late=True, tau=None, delays=108):
    """Growth of the stiffest mode of consensus on a random graph at a share of the delay it bears, over ``delays``."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 8))
    edges = [(i, i + 1) for i in range(n - 1)]
    edges += [(i, j) for i in range(n) for j in range(i + 2, n) if rng.random() < 0.4]
    laplacian = np.zeros((n, n))
    for i, j in edges:
        laplacian[[i, j], [i, j]] += 1.0
        laplacian[[i, j], [j, i]] -= 1.0
    values, vectors = np.linalg.eigh(laplacian)
    tau = share * math.pi / (2.0 * values[-1]) if tau is None else tau
    q = np.outer(vectors[:, -1], [1.0, 0.0])
    made = group(fk.Fixed(n, edges), [SPRING], q, order=1, t_end=delays * tau, frames=20 * delays + 1,
                 information=fk.Delayed(tau, self_delayed=late))  # fmt: skip
    return growth(made, vectors[:, -1], tau)


def limit_of_first_order(seed):
    # At lambda tau = (pi/2)(1 + e) the rightmost root has the real part e (pi^2/4)/(1 + pi^2/4)/tau to first order.
    rate = 80 * (math.pi**2 / 4) / (1 + math.pi**2 / 4)
    assert math.log(first_order_at(0.999, seed)) == pytest.approx(-0.001 * rate, rel=0.1)
    assert math.log(first_order_at(1.001, seed)) == pytest.approx(0.001 * rate, rel=0.1)


@pytest.mark.parametrize("seed", range(4))
def test_first_order_consensus_bears_a_delay_up_to_a_quarter_turn(seed):
    """Self and neighbour delayed: stable iff tau < pi/(2 lambda_N) (Olfati-Saber & Murray 2004)."""
    limit_of_first_order(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4, 50))
def test_first_order_consensus_on_46_more_graphs(seed):
    limit_of_first_order(seed)


@pytest.mark.parametrize("tau", [0.5, 3.0, pytest.param(20.0, marks=pytest.mark.slow)])
def test_first_order_consensus_that_knows_itself_bears_every_delay(tau):
    assert first_order_at(1.0, 1, late=False, tau=tau, delays=44) < 0.9


def second_order_limit(alpha, beta, eigenvalue):
    """Delay of everybody's state at which u = -alpha L q - beta L p begins to swing, and its frequency."""
    square = eigenvalue**2 * beta**2
    w = math.sqrt((square + math.sqrt(square**2 + 4 * eigenvalue**2 * alpha**2)) / 2)
    return math.atan(w * beta / alpha) / w, w


def second_order(n, alpha, beta, tau, late, t_end):
    q = np.zeros((n, 2))
    q[0, 0], q[1, 0] = 1.0, -1.0
    terms = [fk.Gradient(fk.Potential("k*r**2/2", k=alpha)), fk.Consensus(beta)]
    return group(fk.Fixed.complete(n), terms, q, t_end=t_end, frames=2001,
                 information=fk.Delayed(tau, self_delayed=late))  # fmt: skip


@pytest.mark.parametrize(
    ("alpha", "beta", "n", "stated"), [(1.0, 1.0, 4, 0.323705), (1.0, 0.3, 2, 0.282350), (0.5, 2.0, 7, 0.110907)]
)
def test_second_order_consensus_bears_a_known_delay(alpha, beta, n, stated):
    tau, w = second_order_limit(alpha, beta, float(n))
    assert tau == pytest.approx(stated, abs=1e-6)
    for share, sign in ((0.99, -1.0), (1.01, 1.0)):
        period = 2.0 * math.pi / w
        run = run_of(second_order(n, alpha, beta, share * tau, True, 40 * period))
        # Changes of velocity over half a period, 25 frames: a mode that creeps without swinging shows little in them.
        v = run.p[:, 0, 0] - run.p[:, 1, 0]
        v = np.abs(v[25:] - v[:-25])
        early, late = ((run.t[25:] >= a * period) & (run.t[25:] <= (a + 4) * period) for a in (20, 36))
        rate = math.log(v[late].max() / v[early].max()) / (16 * period)
        # The root near i w moves as the delay does: s^2 + lambda (alpha + beta s) exp(-s tau) = 0.
        root, lag = 1j * w, share * tau
        for _ in range(50):
            z = np.exp(-root * lag)
            value = root**2 + n * (alpha + beta * root) * z
            root -= value / (2 * root + n * (beta - lag * (alpha + beta * root)) * z)
        assert sign * root.real > 0
        assert rate == pytest.approx(root.real, rel=0.1)


def test_second_order_consensus_that_knows_itself_does_not_bear_every_delay():
    """On K4 with alpha = beta = 1 and neighbours known 5 late a flock that moves as one swings ever wider.

    Its speed obeys s^2 + 3 (1 + s)(1 - exp(-5 s)) = 0, with the root 0.032596 + 1.199321 i.
    """
    root = 0.032596 + 1.199321j
    for _ in range(20):
        z = np.exp(-5 * root)
        root -= (root**2 + 3 * (1 + root) * (1 - z)) / (2 * root + 3 * (1 - z) + 15 * (1 + root) * z)
    assert root.real == pytest.approx(0.032596, abs=1e-6)
    terms = [SPRING, fk.Consensus(1.0)]
    made = group(fk.Fixed.complete(4), terms, np.zeros((4, 2)), [[1.0, 0.0]] * 4, t_end=200.0, frames=2001)
    run = run_of(made.with_(information=fk.Delayed(5.0)))
    v = np.abs(run.p[:, 0, 0])
    early, late = ((run.t >= a) & (run.t <= a + 20) for a in (100, 180))
    assert math.log(v[late].max() / v[early].max()) / 80 == pytest.approx(root.real, rel=0.1)


def test_late_neighbours_brake_a_flock_that_moves():
    """The common velocity of two agents decays by s^2 = -(1 + s)(1 - exp(-s tau)), although both agree."""
    made = group(fk.Fixed.complete(2), [SPRING, fk.Consensus(1.0)], np.zeros((2, 2)), [[5.0, 0.0]] * 2, t_end=40.0,
                 frames=41, information=fk.Delayed(0.1))  # fmt: skip
    speed = run_of(made).p[:, 0, 0]
    rate = brentq(lambda s: s * s + (1 + s) * (1 - math.exp(-0.1 * s)), -0.2, -0.05, xtol=1e-14)
    assert rate == pytest.approx(-0.091287, abs=1e-6)
    assert np.log(speed[40] / speed[20]) / 20.0 == pytest.approx(rate, abs=1e-9)
    assert [round(float(speed[k]), 2) for k in (10, 40)] == [2.01, 0.13]
    together = run_of(made.with_(information=fk.Delayed(0.1, self_delayed=True)))
    assert np.abs(together.p[:, :, 0] - 5.0).max() < 1e-12


def test_short_delays_differ_from_none_to_first_order():
    start = fk.start.box(6, side=3, speed=1, seed=2)
    law = fk.Law(fk.Fixed.complete(6), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(0.5)])
    made = fk.Scenario(law, start, t_end=1.0, frames=3)
    ideal = fk.simulate(made.with_(information=fk.Delayed(0.0)), progress=False)
    assert ideal.fidelity.engine == "exact"
    off = [
        np.abs(fk.simulate(made.with_(information=fk.Delayed(tau)), progress=False).q[-1] - ideal.q[-1]).max()
        for tau in (0.02, 0.01, 0.005)
    ]  # fmt: skip
    assert off[0] / off[1] == pytest.approx(2.0, abs=0.1)
    assert off[1] / off[2] == pytest.approx(2.0, abs=0.05)
