"""Held control and messages against closed forms: thresholds of stability, variances, and exact recursions."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov

import flocking as fk
from flocking.model.world.losses import Bernoulli

QUADRATIC = fk.Potential("r**2/2")


def consensus(graph, control, information=None, *, steps, period, seed=0, **agents):
    """Deviations from the mean of first-order agents on a line after each tick, shape (steps + 1, N)."""
    q = np.random.default_rng(seed).normal(size=(graph.n, 1))
    parts = {} if information is None else {"information": information}
    run = fk.simulate(
        fk.Scenario(
            fk.Law(graph, [fk.Gradient(QUADRATIC)]), fk.State(q - q.mean()), t_end=period * steps, frames=steps + 1,
            agents=fk.SingleIntegrator(**agents), control=control, **parts,
        )
    )  # fmt: skip
    return run.q[:, :, 0]


def laplacian(graph):
    links = graph.initial(np.zeros((graph.n, 1))).astype(float)
    return np.diag(links.sum(axis=1)) - links


def grows(x):
    """Whether deviations from the mean are larger at the end than in the middle."""
    spread = np.abs(x - x.mean(axis=1, keepdims=True)).max(axis=1)
    middle, width = len(x) // 2, max(2, len(x) // 10)
    return spread[-width:].max() > spread[middle : middle + width].max()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "samples", [0, 1, pytest.param(2, marks=pytest.mark.slow), 3, pytest.param(4, marks=pytest.mark.slow)]
)
def test_first_order_held_with_whole_samples_of_delay(seed, samples):
    """0 < T lambda_N < 2 sin(pi/(2(2d + 1))), d samples of delay of the own state too (Levin and May 1976)."""
    graph = fk.Fixed.random_connected(6, 0.5, seed)
    largest = np.linalg.eigvalsh(laplacian(graph))[-1]
    limit = 2 * np.sin(np.pi / (2 * (2 * samples + 1))) / largest
    for share, unstable in ((0.98, False), (1.02, True)):
        period = round(limit * share, 9)
        x = consensus(graph, fk.Held(period, latency=samples * period), steps=400, period=period, seed=seed)
        assert grows(x) == unstable


@pytest.mark.parametrize("samples", [1, 2, pytest.param(3, marks=pytest.mark.slow), 4])
def test_delay_of_the_neighbours_alone_on_a_complete_graph_of_4(samples):
    """K4 with held control stays stable up to T = 1/3 for any number of samples of delay.

    Beyond it the agents move apart from where they were together; a little noise excites that mode.
    """
    for period, unstable in ((0.32, False), (0.36, True)):
        information = fk.Messages(period, delay=samples * period, noise=fk.WhiteNoise(1e-6))
        x = consensus(fk.Fixed.complete(4), fk.Held(period), information, steps=800, period=period)
        assert (np.abs(x[-1]).max() > np.abs(x[0]).max()) == unstable


@pytest.mark.parametrize(
    ("alpha", "beta", "graph"), [(1.0, 1.0, fk.Fixed.complete(4)), (3.0, 0.5, fk.Fixed(2, [(0, 1)]))]
)
def test_second_order_held(alpha, beta, graph):
    """T < min(2 beta/alpha, 2/(beta lambda_N)) under relative damping (Cao and Ren 2010)."""
    largest = np.linalg.eigvalsh(laplacian(graph))[-1]
    limit = min(2 * beta / alpha, 2 / (beta * largest))
    rng = np.random.default_rng(0)
    law = fk.Law(graph, [fk.Gradient(fk.Potential("a*r**2/2", a=alpha)), fk.Consensus(beta)])
    for share, unstable in ((0.97, False), (1.03, True)):
        period, steps = limit * share, 400
        q, p = rng.normal(size=(graph.n, 1)), rng.normal(size=(graph.n, 1))
        run = fk.simulate(
            fk.Scenario(
                law, fk.State(q - q.mean(), p - p.mean()), t_end=period * steps, frames=steps + 1,
                control=fk.Held(period),
            )
        )  # fmt: skip
        assert grows(run.q[:, :, 0]) == unstable


def test_dropped_messages_follow_the_random_recursion():
    """With messages forgotten after a period, x(k + 1) = (I - T L_k) x(k) over the links of the messages that came.

    At the start everybody knows everybody.
    """
    n, period, steps, share, seed = 5, 0.1, 60, 0.4, 3
    information = fk.Messages(period, loss=share, expires=period, seed=seed)
    x = consensus(fk.Fixed.complete(n), fk.Held(period), information, steps=steps, period=period)
    expected, sender, receiver = x[0].copy(), *np.meshgrid(np.arange(n), np.arange(n))
    for k in range(steps):
        lost = Bernoulli(share).lost(seed, sender, receiver, np.full((n, n), k))
        links = (~lost | (k == 0)) & ~np.eye(n, dtype=bool)
        expected = expected + period * (links @ expected - links.sum(axis=1) * expected)
        assert x[k + 1] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("paired", [True, False])
def test_mean_square_threshold_of_loss(paired):
    """On K_N: T* = 2/(N(1-p) + 2p) where both directions drop at once, 2/(N(1-p) + 2p(N-1)/N) where each by itself.

    The second moment of the deviations after a sample is estimated from the engine's own draws at T*: it stays.
    """
    n, share, draws = 4, 0.3, 40_000
    limit = 2 / (n * (1 - share) + 2 * share * (1 if paired else (n - 1) / n))
    sender, receiver = np.meshgrid(np.arange(n), np.arange(n))
    k = np.arange(draws)[:, None, None]
    lost = Bernoulli(share, paired).lost(1, *(np.broadcast_to(x, (draws, n, n)) for x in (sender, receiver)), k)
    links = (~lost & ~np.eye(n, dtype=bool)).astype(float)
    degrees = links.sum(axis=2)
    W = np.eye(n) - limit * (np.einsum("ki,ij->kij", degrees, np.eye(n)) - links)
    P = np.eye(n) - 1 / n
    moment = np.mean([np.kron(P @ w @ P, P @ w @ P) for w in W[:8000]], axis=0)
    radius = np.abs(np.linalg.eigvals(moment)).max()
    assert radius == pytest.approx(1.0, abs=0.03)


def test_measurement_noise_spreads_consensus_as_the_sampled_lyapunov_equation_says():
    """Variance per agent (s^2/N) sum T lambda/(2 - T lambda), the own state measured too."""
    graph, period, sigma, steps = fk.Fixed.complete(5), 0.1, 0.2, 2500
    information = fk.Messages(period, noise=fk.WhiteNoise(sigma), self_known="measured", seed=4)
    x = consensus(graph, fk.Held(period), information, steps=steps, period=period)
    spread = (x - x.mean(axis=1, keepdims=True))[100:]
    values = np.linalg.eigvalsh(laplacian(graph))[1:]
    expected = sigma**2 / graph.n * (period * values / (2 - period * values)).sum()
    # All modes forget within 1/(T lambda) = 2 steps, so that some 600 samples of each of 4 modes are independent.
    assert (spread**2).mean() == pytest.approx(expected, rel=0.12)


@pytest.mark.slow
def test_measured_neighbours_of_agents_that_know_themselves_spread_as_the_discrete_lyapunov_equation_says():
    """x(k + 1) = (I - T L) x(k) + T A v(k), v the errors of the neighbours' samples, on a path."""
    graph, period, sigma, steps = fk.Fixed(4, [(0, 1), (1, 2), (2, 3)]), 0.1, 0.2, 6000
    information = fk.Messages(period, noise=fk.WhiteNoise(sigma), seed=4)
    x = consensus(graph, fk.Held(period), information, steps=steps, period=period)
    spread = (x - x.mean(axis=1, keepdims=True))[400:]
    L, P = laplacian(graph), np.eye(4) - 0.25
    F, G = P @ (np.eye(4) - period * L), P @ (np.diag(np.diag(L)) - L) * period * sigma
    expected = np.trace(solve_discrete_lyapunov(F, G @ G.T)) / 4
    # The slowest mode forgets within 1/(T lambda_2) = 17 steps: some 330 independent samples of it.
    assert (spread**2).mean() == pytest.approx(expected, rel=0.15)


def test_neighbours_that_are_known_late_slow_a_moving_pair():
    """Two agents, 0.1 s late, alpha = beta = 1, 5 m/s: 2.0 m/s after 10 s and 0.13 m/s after 40 s; not so if both
    are late, and not with prediction.
    """
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(QUADRATIC), fk.Consensus(1.0)])
    start = fk.State([[0.0], [0.0]], [[5.0], [5.0]])
    # A force that is held for a period is half a period older still.
    period, late = 0.02, 0.09

    def speeds(**how):
        world = {"control": fk.Held(period), "information": fk.Messages(period, delay=late, **how)}
        return fk.simulate(fk.Scenario(law, start, t_end=40, frames=[10.0, 40.0], **world)).p[:, 0, 0]

    assert speeds() == pytest.approx([2.0, 0.13], rel=0.03)
    assert speeds(predict=True) == pytest.approx([5.0, 5.0], abs=1e-9)


def test_the_ideal_world_is_the_limit_of_short_periods():
    """Held control departs from the continuous law in first order of the period."""
    law = fk.Law(fk.Fixed.complete(4), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(1.0)])
    rng = np.random.default_rng(1)
    start = fk.State(rng.normal(size=(4, 2)), rng.normal(size=(4, 2)))
    ideal = fk.simulate(fk.Scenario(law, start, t_end=2, frames=3, tolerance=1e-12)).q[-1]
    gaps = []
    for period in (0.02, 0.01, 0.005):
        run = fk.simulate(fk.Scenario(law, start, t_end=2, frames=3, control=fk.Held(period)))
        gaps.append(np.abs(run.q[-1] - ideal).max())
    orders = np.log2(np.array(gaps[:-1]) / gaps[1:])
    assert orders == pytest.approx([1.0, 1.0], abs=0.1)


def test_small_noise_departs_in_first_order():
    """Errors of the same draws, half as large, lead half as far from the run without errors."""
    law = fk.Law(fk.Fixed.complete(4), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(1.0)])
    rng = np.random.default_rng(1)
    start = fk.State(rng.normal(size=(4, 2)), rng.normal(size=(4, 2)))

    def end(sigma):
        information = fk.Messages(0.05, noise=fk.WhiteNoise(sigma, sigma), seed=3)
        made = fk.Scenario(law, start, t_end=2, frames=3, control=fk.Held(0.05), information=information)
        return fk.simulate(made, progress=False).q[-1]

    ideal = end(0.0)
    gaps = np.array([np.abs(end(sigma) - ideal).max() for sigma in (0.02, 0.01, 0.005)])
    assert np.log2(gaps[:-1] / gaps[1:]) == pytest.approx([1.0, 1.0], abs=0.1)
    assert gaps[0] > 1e-3


def test_damped_agents_under_a_held_force_move_as_the_exponential_says():
    """p(t) = u/k + (p0 - u/k) exp(-k t/m), with a constant leader's pull."""
    agents = fk.PointMass(masses=2.0, damping=[0.0, 3.0, 50.0])
    law = fk.Law(fk.Fixed(3, [(0, 1)]), [fk.Gradient(fk.Potential("0*r"))])
    start = fk.State(np.zeros((3, 2)), np.ones((3, 2)))
    run = fk.simulate(fk.Scenario(law, start, t_end=1.5, frames=4, agents=agents, control=fk.Held(0.5)))
    for i, k in ((1, 3.0), (2, 50.0)):
        assert run.p[:, i, 0] == pytest.approx(np.exp(-k * run.t / 2.0), abs=1e-12)
        assert run.q[:, i, 0] == pytest.approx(2.0 / k * (1 - np.exp(-k * run.t / 2.0)), abs=1e-12)
    assert run.q[:, 0, 0] == pytest.approx(run.t)
    assert np.abs(run.residual).max() < 1e-12


@pytest.mark.parametrize(("control", "stays"), [(fk.Held(0.1), True), (fk.Continuous(), False)])
def test_link_memory_between_two_ticks(control, stays):
    """A sample expires halfway to the next, between the two radii: held control does not look there."""
    law = fk.Law(fk.Hysteresis(2.0, 0.5), [fk.Gradient(fk.Potential("0*r"))])
    information = fk.Messages(0.1, expires=0.05)
    made = fk.Scenario(law, fk.State([[0.0, 0], [1.8, 0]]), 1.0, frames=6, control=control, information=information)
    run = fk.simulate(made)
    assert fk.replay(run).agrees
    assert run.known_links_at(-1)[0, 0, 1] == stays
