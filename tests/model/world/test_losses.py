"""Losses of messages: shares, bursts and directions."""

import numpy as np
import pytest
from scipy import stats

import flocking as fk
from flocking.errors import InvalidInput


def link(count, i=0, j=1):
    k = np.arange(count)
    return np.full(count, i), np.full(count, j), k


def test_bernoulli_share():
    lost = fk.Bernoulli(0.3).lost(5, *link(1_000_000))
    assert stats.binomtest(int(lost.sum()), len(lost), 0.3).pvalue > 1e-4


def test_paired_losses_are_those_of_both_directions():
    for loss in (fk.Bernoulli(0.3, paired=True), fk.GilbertElliott(0.2, 0.4, 0.1, 0.9, paired=True)):
        there, back = loss.lost(5, *link(1000, 2, 7)), loss.lost(5, *link(1000, 7, 2))
        assert (there == back).all()
    there, back = fk.Bernoulli(0.3).lost(5, *link(1000, 2, 7)), fk.Bernoulli(0.3).lost(5, *link(1000, 7, 2))
    assert (there != back).any()


# Below, at and above the border at which the channel is looked back for in another way.
@pytest.mark.parametrize(("to_bad", "to_good"), [(0.05, 0.2), (0.4, 0.6), (0.7, 0.6), (1.0, 1.0), (1.0, 0.3)])
def test_gilbert_elliott_channel_is_the_declared_markov_chain(to_bad, to_good):
    channel = fk.GilbertElliott(to_bad, to_good)
    bad = channel.bad(11, *link(1_000_000))
    if to_bad + to_good < 2.0:
        before, after = bad[:-1], bad[1:]
        for state, chance in ((False, to_bad), (True, 1.0 - to_good)):
            turned = after[before == state]
            assert stats.binomtest(int(turned.sum()), len(turned), chance).pvalue > 1e-4
    else:
        assert (bad[1:] != bad[:-1]).all()
    # The law of the first sample, over many links.
    n = 100_000
    first = channel.bad(11, np.zeros(n, dtype=int), np.arange(1, n + 1), np.zeros(n, dtype=int))
    assert stats.binomtest(int(first.sum()), n, to_bad / (to_bad + to_good)).pvalue > 1e-4


def test_bursts_are_geometric():
    bad = fk.GilbertElliott(0.05, 0.2).bad(4, *link(1_000_000))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], bad.astype(int), [0]])))
    lengths = (edges[1::2] - edges[::2])[1:-1]
    longest = 20
    counts = np.array(
        [*(np.count_nonzero(lengths == k) for k in range(1, longest)), np.count_nonzero(lengths >= longest)]
    )
    law = stats.geom(0.2)
    expected = len(lengths) * np.array([*(law.pmf(k) for k in range(1, longest)), law.sf(longest - 1)])
    assert stats.chisquare(counts, expected * counts.sum() / expected.sum()).pvalue > 1e-4


@pytest.mark.parametrize(("to_bad", "to_good"), [(0.05, 0.2), (0.7, 0.6)])
def test_stationary_loss(to_bad, to_good):
    """The law of channel and loss together, chi-square over 10^6 independent draws: links at one late sample."""
    loss = fk.GilbertElliott(to_bad, to_good, loss_good=0.02, loss_bad=0.6)
    share = to_bad / (to_bad + to_good)
    assert loss.stationary_loss == pytest.approx(share * 0.6 + (1.0 - share) * 0.02)
    n = 1_000_000
    draws = 9, np.zeros(n, dtype=int), np.arange(1, n + 1), np.full(n, 50)
    bad, lost = loss.bad(*draws), loss.lost(*draws)
    counts = [np.count_nonzero((bad == state) & (lost == gone)) for state in (False, True) for gone in (False, True)]
    law = np.array([(1.0 - share) * 0.98, (1.0 - share) * 0.02, share * 0.4, share * 0.6])
    assert stats.chisquare(counts, n * law).pvalue > 1e-4
    kept = np.count_nonzero(~lost)
    assert stats.chisquare([kept, n - kept], [n * (1.0 - loss.stationary_loss), n * loss.stationary_loss]).pvalue > 1e-4


def test_any_order_of_questions_gives_the_same_answers():
    loss = fk.GilbertElliott(0.9, 0.7, 0.1, 0.8)
    i, j, k = link(500)
    order = np.random.default_rng(0).permutation(500)
    assert (loss.lost(3, i[order], j[order], k[order]) == loss.lost(3, i, j, k)[order]).all()


def test_distance_loss():
    loss = fk.DistanceLoss(range=2.0, exponent=2.0, floor=0.1)
    n = 200_000
    for distance in (0.0, 1.0, 4.0):
        lost = loss.lost(3, *link(n), np.full(n, distance))
        assert stats.binomtest(int(lost.sum()), n, 1 - 0.9 * np.exp(-((distance / 2) ** 2))).pvalue > 1e-4


@pytest.mark.parametrize(
    "make",
    [
        lambda: fk.Bernoulli(1.5),
        lambda: fk.Bernoulli(-0.1),
        lambda: fk.GilbertElliott(0.0, 0.0),
        lambda: fk.GilbertElliott(1.0, 0.9999),
        lambda: fk.DistanceLoss(0.0),
        lambda: fk.Messages(0.0),
        lambda: fk.Messages(0.1, loss=2.0),
        lambda: fk.Messages(0.1, expires=0.0),
        lambda: fk.Messages(0.1, self_known="guessed"),
        lambda: fk.Messages(0.1, predict=1),
        lambda: fk.Held(-1.0),
        lambda: fk.Held(1e-12),
        lambda: fk.Held(0.1, latency=-1),
        lambda: fk.WhiteNoise(-1.0),
        lambda: fk.OrnsteinUhlenbeck(1.0, 1.0, 0.0),
        lambda: fk.Messages(0.1, noise=-0.2),
        lambda: fk.Messages(0.1, noise=True),
    ],
)  # fmt: skip
def test_wrong_values_are_refused(make):
    with pytest.raises(InvalidInput):
        make()


def test_ornstein_uhlenbeck_samples_have_the_declared_correlation():
    """Of 1000 agents side by side: their errors are independent of each other, and stationary from the first."""
    noise = fk.OrnsteinUhlenbeck(1.0, 1.0, time_constant=0.5)
    agents = np.arange(1000)
    memory = np.full((len(agents), 1), noise.memory(0.1))
    x, rows = None, []
    for k in range(100):
        a, b = noise.normals(2, agents, np.full(len(agents), k), 1)
        x = noise.next_errors(x, np.concatenate([a, b], axis=1), memory)
        rows.append(x)
    series = np.array(rows)
    for lag in (1, 5):
        found = (series[lag:] * series[:-lag]).mean(axis=(0, 1))
        assert found == pytest.approx(np.full(2, np.exp(-0.1 * lag / 0.5)), abs=0.03)
    for first, last in ((0, 1), (50, 100)):
        # Five standard deviations of the variance of 1000 independent errors: 5 * (2 / 1000)**0.5.
        assert series[first:last].var(axis=(0, 1)) == pytest.approx([1.0, 1.0], abs=0.23 if first == 0 else 0.04)
    across = np.corrcoef(series[-1, :, 0], series[-1, :, 1])[0, 1]
    assert abs(across) < 5 / len(agents) ** 0.5


@pytest.mark.parametrize("share", [0.9999, 0.99951, 1.0 - 1e-12])
def test_what_is_nearly_all_is_not_said_to_be_all(share):
    assert fk.Messages(0.1, loss=share).summary != fk.Messages(0.1, loss=1.0).summary
    assert float(fk.Messages(0.1, loss=share).summary.split()[3]) < 1.0
    assert fk.Messages(0.1, loss=0.3).summary == "messages every 0.1, 0.3 of them lost"
    assert " 1 of" not in fk.GilbertElliott(0.9995, 0.0001).summary


def test_agents_that_differ_are_not_said_to_be_alike():
    assert fk.Held([0.1, 0.10000001]).summary == "control held for 0.1 to 0.10000001"
    assert fk.Held([0.1, 0.2]).summary == "control held for 0.1 to 0.2"
