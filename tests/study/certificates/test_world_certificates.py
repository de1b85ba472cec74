"""Consensus under held control and messages: closed forms, enumerated losses, and the engine's own draws."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import flocking as fk
from flocking.study.certificates.consensus_certificates import LinearConsensus
from flocking.study.certificates.enclosed_matrices import EnclosedMatrix, eigenvalues, exact, spectral_radius
from flocking.study.certificates.random_recursion import RandomRecursion
from flocking.study.certificates.sampled_consensus import SampledConsensus

K4 = fk.Fixed.complete(4)


def consensus(graph, period, beta=None, alpha=1.0, steps=10, sent=None, **messages):
    """A scenario of linear consensus under held control, with messages where any of their fields are given."""
    terms = [fk.Gradient(fk.Potential("a*r**2/2", a=alpha))] if alpha else []
    if beta is not None:
        terms.append(fk.Consensus(beta))
    bodies = fk.SingleIntegrator() if beta is None else fk.PointMass(1.0)
    rng = np.random.default_rng(0)
    p = np.zeros((graph.n, 1)) if beta is None else rng.normal(size=(graph.n, 1))
    world = {"information": fk.Messages(sent or period, **messages)} if messages or sent else {}
    return fk.Scenario(
        fk.Law(graph, terms), fk.State(rng.normal(size=(graph.n, 1)), p), t_end=period * steps, frames=steps + 1,
        bodies=bodies, control=fk.Held(period), **world,
    )  # fmt: skip


def world_of(scenario) -> SampledConsensus:
    found = SampledConsensus(LinearConsensus(scenario))
    assert found.holds, found.hypotheses
    return found


def matrix(recursion: RandomRecursion, present) -> np.ndarray:
    """The matrix of a step in which some groups are present."""
    weights = np.repeat(np.asarray(present, dtype=float), recursion.width)
    return (
        recursion.steady
        + recursion.always_into @ recursion.always_out_of
        + recursion.into * weights @ (recursion.out_of)
    )


@pytest.mark.parametrize("paired", [True, False])
@pytest.mark.parametrize("share", [0.1, 0.3, 0.7])
def test_dropped_messages_on_complete_graphs(paired, share):
    """T* = 2/(N(1-p) + 2p) where both directions drop at once, 2/(N(1-p) + 2p(N-1)/N) where each by itself."""
    limit = 2 / (4 * (1 - share) + 2 * share * (1.0 if paired else 0.75))
    scenario = consensus(K4, 0.1, loss=fk.Bernoulli(share, paired), expires=0.1)
    bound = fk.certify(scenario)["period_in_world"].bound
    assert bound.lo < limit < bound.hi
    assert bound.hi - bound.lo < 1e-4


@pytest.mark.parametrize(
    ("n", "periods"), [(20, 40), *(pytest.param(n, 10, marks=pytest.mark.slow) for n in (40, 100))]
)
def test_dropped_messages_on_large_complete_graphs(n, periods):
    """The same closed form, T* = 2/(N(1-p) + 2p(N-1)/N), for as many agents as the operator of moments is for."""
    limit = 2 / (n * 0.7 + 0.6 * (n - 1) / n)
    found = fk.certify(consensus(fk.Fixed.complete(n), 0.02, loss=0.3, expires=0.02))
    bound = found["period_in_world"].bound
    assert bound.lo < limit < bound.hi
    assert bound.hi - bound.lo < 1e-2 * limit
    assert f"{periods} periods" in found["period_in_world"].statement


@pytest.mark.parametrize(("share", "limit"), [(0.3, 0.525), (0.6, 0.581)])
def test_held_messages_widen_the_bound_on_the_complete_graph(share, limit):
    bound = fk.certify(consensus(K4, 0.1, loss=share))["period_in_world"].bound
    assert bound.lo == pytest.approx(limit, abs=6e-4)
    assert bound.hi - bound.lo < 1e-4
    assert bound.lo > 0.5  # without loss


@pytest.mark.parametrize(
    ("scenario", "limit"),
    [
        (consensus(K4, 0.1, delay=0.2), 1 / 3),
        (consensus(K4, 0.1), 1 / 2),
        (consensus(K4, 0.1, beta=1.0), 1 / 2),
        (consensus(fk.Fixed(2, ((0, 1),)), 0.1, beta=0.3, alpha=3.0), 0.2),
        (consensus(K4, 0.1, beta=0.8, alpha=0.0), 2 / (0.8 * 4)),
    ],
)
def test_periods_without_loss(scenario, limit):
    """2/lambda; neighbours alone late, 1/3 on K_4 for 1 to 4 samples; min(2 beta/alpha, 2/(beta lambda)) of order 2."""
    bound = fk.certify(scenario)["period_in_world"].bound
    assert bound.lo < limit < bound.hi
    assert bound.hi - bound.lo < 1e-8


@pytest.mark.parametrize(
    ("beta", "messages"),
    [
        (None, {"loss": 0.4, "expires": 0.1}),
        (None, {"loss": fk.Bernoulli(0.4, True), "expires": 0.1}),
        (None, {"loss": 0.4}),
        (None, {"loss": fk.Bernoulli(0.4, True), "delay": 0.2}),
        (None, {"loss": 0.4, "delay": 0.2, "expires": 0.3}),
        (0.7, {"loss": 0.4, "expires": 0.1}),
        (0.7, {"loss": 0.4, "delay": 0.1, "expires": 0.2}),
    ],
)
def test_the_recursion_is_what_the_engine_runs(beta, messages):
    """From the engine's own losses the recursion reproduces its trajectory."""
    graph, steps = fk.Fixed.random_connected(5, 0.6, 2), 40
    scenario = consensus(graph, 0.1, beta, steps=steps, **messages)
    world = world_of(scenario)
    recursion, late = world.recursion(0.1), world.delayed_samples
    run = fk.simulate(scenario, progress=False)
    rows = [run.q[:, :, 0], *([run.p[:, :, 0]] if beta is not None else [])]
    loss = scenario.information.loss
    links = np.argwhere(graph.initial(scenario.start.q))
    pairs = links[links[:, 0] < links[:, 1]] if loss.paired else links

    def state(k):
        parts = [np.concatenate([r[k - d] for r in rows]) for d in range(late + 1)]
        remembered = [rows[0][0][links[:, 1]]] if world.uses_older_samples else []
        return np.concatenate([*parts, *remembered])

    z = state(late)
    y = world_relative(world, z)
    for k in range(late, steps):
        sample = np.full(len(pairs), k - late)
        present = ~loss.lost(0, pairs[:, 1], pairs[:, 0], sample) | (k == late)
        y = matrix(recursion, present) @ y
        now = world_relative(world, np.concatenate([np.concatenate([r[k + 1] for r in rows]), z[len(rows) * 5 :]]))
        count = len(rows) * 5 - (2 if beta is not None and not late else 1)
        assert y[:count] == pytest.approx(now[:count], abs=1e-11)


def world_relative(world, z):
    """Components relative to those of agent 0, as the recursion has them."""
    n, block, late = world.n, world.n * world.order, world.delayed_samples
    y = z.copy()
    for d in range(late + 1):
        y[d * block : d * block + n] -= z[0]
    if world.uses_older_samples:
        y[(late + 1) * block :] -= z[0]
    gone = [0]
    if world.order == 2 and not late:
        y[n:block] -= z[n]
        gone.append(n)
    return np.delete(y, gone)


@pytest.mark.parametrize("messages", [{"expires": 0.1}, {}, {"delay": 0.1, "expires": 0.2}])
@pytest.mark.parametrize("paired", [False, True])
def test_growth_is_that_of_all_patterns_of_loss(messages, paired):
    """The second moment by enumeration: the sum over all patterns of P kron(M, M)."""
    share, graph = 0.35, fk.Fixed(3, ((0, 1), (1, 2)))
    scenario = consensus(graph, 0.1, loss=fk.Bernoulli(share, paired), **messages)
    recursion = world_of(scenario).recursion(0.25)
    groups = recursion.into.shape[1] // recursion.width
    moment = np.zeros((recursion.size**2,) * 2)
    for present in product((0, 1), repeat=groups):
        weight = np.prod([(1 - share) if x else share for x in present])
        step = matrix(recursion, present)
        moment += weight * np.kron(step, step)
    expected = np.abs(np.linalg.eigvals(moment)).max()
    lo, hi = recursion.growth()
    assert lo <= expected * (1 + 1e-9)
    assert expected <= hi * (1 + 1e-9)
    assert hi == pytest.approx(expected, rel=2e-3)
    x = np.random.default_rng(1).normal(size=(recursion.size,) * 2)
    x = x @ x.T
    enclosed = recursion.enclosed_moment(x)
    assert np.abs(enclosed.values.ravel() - moment @ x.ravel()).max() < 1e-12
    assert (np.abs(enclosed.values.ravel() - moment @ x.ravel()) <= enclosed.error.ravel() + 1e-15).all()
    assert enclosed.error.max() < 1e-11


def test_a_world_that_does_not_agree_is_refused_with_a_proof():
    found = fk.certify(consensus(K4, 0.7, loss=0.2, expires=0.7))["growth_in_world"]
    assert found.outcome == "refused"
    assert "does not fall" in found.reason
    ideal = fk.certify(consensus(K4, 0.1).with_(control=fk.Continuous()))["growth_in_world"]
    assert ideal.outcome == "not applicable"


def test_a_common_motion_that_swings_is_no_disagreement():
    """Late neighbours beside a true own state drive the common motion of a group whose agents agree.

    For g = T a and N = 5 it has the factor -4 g relative to a place, and the disagreement has the roots of
    z^2 - (1 - 4 g) z + g. Nothing but rounding moves all together at first; it grows by 1.84 each time.
    """
    made = consensus(fk.Fixed.complete(5), 0.46, delay=0.46, steps=150)
    slow = made.with_(information=fk.Messages(0.1, delay=0.1), control=fk.Held(0.1))
    bound = fk.certify(slow)["growth_in_world"].bound
    assert bound.lo <= 0.4 <= bound.hi
    reason = fk.certify(made)["growth_in_world"].reason
    assert "it does not fall: the factor of the disagreement and common motion" in reason
    q = fk.simulate(made, progress=False).q
    assert np.linalg.norm(q[-1].mean(axis=0)) > 1e3 * np.linalg.norm(q[0].mean(axis=0))
    assert np.linalg.norm(q[-1] - q[-1].mean(axis=0)) < 1e-3 * np.linalg.norm(q[0] - q[0].mean(axis=0))


@pytest.mark.parametrize("own", ["measured", "true"])
def test_noise_of_samples(own):
    """(s^2/N) sum T lambda/(2 - T lambda) with the own state measured, else by the discrete Lyapunov equation."""
    graph, period, sigma = fk.Fixed(4, ((0, 1), (1, 2), (2, 3))), 0.2, 0.3
    scenario = consensus(graph, period, noise=fk.WhiteNoise(sigma), self_known=own)
    bound = fk.certify(scenario)["noise_in_world"].bound
    links = graph.initial(np.zeros((4, 2))).astype(float)
    laplacian = np.diag(links.sum(axis=1)) - links
    if own == "measured":
        values = np.linalg.eigvalsh(laplacian)[1:]
        expected = sigma**2 / 4 * (period * values / (2 - period * values)).sum()
    else:
        centre = np.eye(4) - 0.25
        step, added = centre - period * laplacian, period * sigma * centre @ links
        expected, power = 0.0, np.eye(4)
        for _ in range(3000):
            expected += np.square(power @ added).sum() / 4
            power = power @ step
    assert bound.lo - 1e-12 <= expected <= bound.hi + 1e-12
    assert bound.hi - bound.lo < 1e-9


def test_noise_with_loss_spreads_as_the_engine_shows():
    """An observation within five standard errors: 1,500 ticks of the engine, less those of the start."""
    sigma, period, steps = 0.2, 0.1, 1500
    scenario = consensus(
        fk.Fixed.complete(5), period, steps=steps, loss=0.3, expires=period, noise=fk.WhiteNoise(sigma), seed=2
    )
    bound = fk.certify(scenario)["noise_in_world"].bound
    x = fk.simulate(scenario, progress=False).q[100:, :, 0]
    squares = np.square(x - x.mean(axis=1, keepdims=True)).mean(axis=1)
    blocks = squares[: len(squares) // 25 * 25].reshape(-1, 25).mean(axis=1)
    assert abs(blocks.mean() - bound.lo) < 5 * blocks.std(ddof=1) / np.sqrt(len(blocks))
    assert bound.hi - bound.lo < 1e-9


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"control": fk.Held([0.1, 0.1, 0.2, 0.1])}, "periods differ"),
        ({"control": fk.Held(0.1, latency=0.05)}, "latency"),
        ({"information": fk.Messages(0.05)}, "not taken together"),
        ({"information": fk.Messages(0.1, delay=0.05)}, "whole number"),
        ({"information": fk.Messages(0.1, predict=True)}, "moved on"),
        ({"information": fk.Messages(0.1, loss=0.1, expires=0.25)}, "for a time"),
        ({"information": fk.Messages(0.1, delay=0.1, expires=0.1)}, "before they arrive"),
        ({"information": fk.Messages(0.1, loss=fk.GilbertElliott(0.1, 0.5))}, "one probability"),
        ({"information": fk.Messages(0.1, noise=fk.OrnsteinUhlenbeck(0.1, 0.0, 1.0))}, "errors of samples"),
    ],
)
def test_worlds_that_no_theorem_covers_are_refused_by_name(change, reason):
    found = fk.certify(consensus(K4, 0.1).with_(**change))["growth_in_world"]
    assert found.outcome == "refused"
    assert reason in found.reason


def test_spectral_radii_are_enclosed():
    """Companion matrices of known roots, and all matrices within an error."""
    for roots in ([0.5, -0.9, 0.3], [0.8 + 0.3j, 0.8 - 0.3j, 0.1]):
        lo, hi = spectral_radius(exact(np.real(np.diag(np.ones(2), -1)) + first_row(roots)))
        assert lo <= max(abs(r) for r in roots) <= hi
        assert hi - lo < 1e-12
    lo, hi = spectral_radius(EnclosedMatrix(np.diag([1.0, 0.5]), np.full((2, 2), 0.01)))
    rng = np.random.default_rng(0)
    for _ in range(50):
        one = np.diag([1.0, 0.5]) + rng.uniform(-0.01, 0.01, (2, 2))
        assert lo <= np.abs(np.linalg.eigvals(one)).max() <= hi
    # A Jordan block has no basis of eigenvectors: nothing is said.
    assert (
        eigenvalues(exact(np.array([[1.0, 1.0], [0.0, 1.0]]))) is None
        or spectral_radius(exact(np.array([[1.0, 1.0], [0.0, 1.0]])))[1] >= 1.0
    )


def first_row(roots) -> np.ndarray:
    found = np.zeros((len(roots),) * 2)
    found[0] = -np.real(np.poly(roots))[1:]
    return found


def late(tau, order, *, self_delayed=True, n=4, **parts):
    terms = [fk.Gradient(fk.Potential("r**2/2"))] + ([fk.Consensus(1.0)] if order == 2 else [])
    bodies = fk.PointMass() if order == 2 else fk.SingleIntegrator()
    rng = np.random.default_rng(3)
    start = fk.State(rng.normal(size=(n, 2)), np.zeros((n, 2)))
    information = fk.Delayed(tau, self_delayed=self_delayed)
    return fk.Scenario(fk.Law(fk.Fixed.complete(n), terms), start, t_end=60 * tau, frames=1201,
                       **{"bodies": bodies, "information": information, **parts})  # fmt: skip


@pytest.mark.parametrize(("order", "limit"), [(1, np.pi / 8), (2, 0.323705)])
def test_a_declared_delay_is_judged_and_runs_agree(order, limit):
    """K4: pi/(2 lambda) with lambda = 4; atan(w beta/alpha)/w for alpha = beta = 1."""
    for share in (0.95, 1.05):
        made = late(share * limit, order)
        found = fk.certify(made)["delay_in_world"]
        assert found.granted == (share < 1.0)
        run = fk.simulate(made, progress=False)
        spread = np.abs(run.q - run.q.mean(axis=1, keepdims=True)).max(axis=(1, 2))
        shrinks = (
            spread[run.t >= 50 * made.information.tau].max() < spread[run.t <= 30 * made.information.tau][500:].max()
        )
        assert shrinks == found.granted
        if found.granted:
            assert found.bound.lo <= limit * (1 + 2e-6)
            assert found.bound.hi >= limit * (1 - 2e-6)
            assert found.bound.hi - found.bound.lo < 1e-9
        else:
            assert "it is not stable" in found.reason


def test_delays_of_neighbours_alone_are_granted_where_they_are_harmless():
    assert fk.certify(late(7.0, 1, self_delayed=False))["delay_in_world"].granted
    second = fk.certify(late(0.1, 2, self_delayed=False))["delay_in_world"]
    assert not second.granted
    assert "not every delay" in second.reason
    ideal = fk.certify(late(0.1, 1, information=fk.Instant()))["delay_in_world"]
    assert ideal.outcome == "not applicable"
    held = fk.certify(late(0.1, 1, control=fk.Held(0.1)))["delay_in_world"]
    assert not held.granted
    assert "control is continuous" in held.reason
    moving = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("r**2/2"))])
    assert fk.certify(late(0.1, 1).with_(law=moving))["delay_in_world"].outcome == "not applicable"


@pytest.mark.slow
def test_a_hundred_agents_that_lose_messages_have_the_closed_bound():
    """K_N whose links are lost from both sides at once: the mean square falls for T < 2/(N (1 - p) + 2 p)."""
    n, lost = 100, 0.3
    bound = 2.0 / (n * (1 - lost) + 2 * lost)
    law = fk.Law(fk.Fixed.complete(n), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.State(np.random.default_rng(0).normal(size=(n, 1)))
    for factor, falls in ((0.99, True), (1.01, False)):
        period = round(factor * bound, 9)
        world = {
            "control": fk.Held(period), "bodies": fk.SingleIntegrator(),
            "information": fk.Messages(period, loss=fk.Bernoulli(lost, paired=True), expires=period),
        }  # fmt: skip
        found = fk.certify(fk.Scenario(law, start, t_end=1.0, **world))["growth_in_world"]
        assert found.granted == falls
        assert falls or "does not fall" in found.reason


PLACES, SPEEDS = np.random.default_rng(3).normal(size=(2, 4, 2))


@pytest.mark.parametrize(
    ("terms", "world", "key", "physical"),
    [
        ("both", {"control": fk.Held(0.1), "information": fk.Messages(0.1, delay=0.1)}, "growth_in_world", True),
        ("both", {"control": fk.Held(0.1), "information": fk.Messages(0.1, delay=0.1)}, "period_in_world", True),
        ("both", {"control": fk.Held(0.1), "information": fk.Messages(0.1)}, "growth_in_world", False),
        ("both", {"information": fk.Delayed(0.1, self_delayed=True)}, "delay_in_world", False),
        ("velocities", {"control": fk.Held(0.1), "information": fk.Messages(0.1, delay=0.1)}, "growth_in_world", False),
        ("velocities", {"information": fk.Delayed(0.1)}, "delay_in_world", False),
    ],
)
def test_a_guarantee_says_where_rest_is_physical(terms, world, key, physical):
    """Two runs judge it: whether the group with 1 added to all velocities moves as it does at rest, beside that 1."""
    pull = [fk.Gradient(fk.Potential("r**2/2"))] if terms == "both" else []
    law = fk.Law(fk.Fixed.complete(4), [*pull, fk.Consensus(1.0)])

    def made(extra):
        return fk.Scenario(law, fk.State(PLACES, SPEEDS + extra), t_end=2.0, frames=3, **world)

    still, moved = (fk.simulate(made(extra), progress=False).p[-1] for extra in (0.0, 1.0))
    assert (np.abs(moved - still - 1.0).max() > 0.05) == physical
    found = fk.certify(made(0.0))[key]
    assert found.granted
    assert ("The rest frame of the world is physical: messages every 0.1, 0.1 late." in found.statement) == physical
    assert ("rest frame" in found.statement) == physical
    assert "rest frame" not in fk.certify(made(0.0))["decay_rate"].statement
