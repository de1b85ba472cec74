"""Confidence intervals: against known values, against SciPy, and by how often they cover."""

from functools import cache

import numpy as np
import pytest
from scipy.stats import binom, binomtest, t

import flocking as fk
from flocking.study.confidence_intervals import LEAST_VALUES, MEAN, SHARE, least_values, mean_interval, share_interval

DISTRIBUTIONS = {
    "normal": (lambda rng, shape: rng.normal(3.0, 2.0, shape), 3.0),
    "uniform": (lambda rng, shape: rng.random(shape), 0.5),
    "exponential": (lambda rng, shape: rng.exponential(1.0, shape), 1.0),
    "two equal peaks": (lambda rng, shape: rng.choice([-1.0, 1.0], shape) + 0.1 * rng.normal(size=shape), 0.0),
}


@pytest.mark.parametrize(("successes", "total"), [(0, 10), (10, 10), (1, 3), (7, 40), (500, 1000), (0, 1), (1, 1)])
@pytest.mark.parametrize("level", [0.8, 0.95, 0.99])
def test_the_interval_of_a_share_is_the_exact_one_of_scipy(successes, total, level):
    expected = binomtest(successes, total).proportion_ci(level, method="exact")
    found = share_interval(successes, total, level)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high), abs=1e-12)
    assert found.method == SHARE


@pytest.mark.parametrize("total", [1, 2, 3, 5, 10, 40])
def test_the_interval_of_a_share_covers_every_share(total):
    intervals = [share_interval(k, total, 0.95) for k in range(total + 1)]
    for share in np.linspace(0.0, 1.0, 401):
        inside = np.array([x.low <= share <= x.high for x in intervals])
        assert binom.pmf(np.arange(total + 1), total, share) @ inside >= 0.95 - 1e-9


@pytest.mark.parametrize(("values", "level", "reason"), [
    ([], 0.95, "0 values, 8 needed"),
    ([1.0, np.nan], 0.95, "1 value, 8 needed"),
    (np.arange(7.0), 0.95, "7 values, 8 needed"),
    (np.arange(59.0), 0.999, "59 values, 60 needed"),
    (np.arange(99.0), 0.9999, "not known to cover at levels above 0.999"),
    ([2.0] * 20, 0.95, "all values are equal"),
    ([*np.arange(20.0), np.inf], 0.95, "a value is infinite"),
])  # fmt: skip
def test_a_mean_has_no_interval_where_none_would_cover(values, level, reason):
    found = mean_interval(np.array(values), level)
    assert np.isnan([found.low, found.high]).all()
    assert found.method == f"none: {reason}"
    assert share_interval(0, 0).method.startswith("none")


def test_the_fewest_values_follow_the_level():
    assert [least_values(level) for level in (0.5, 0.8, 0.81, 0.95, 0.951, 0.999, 0.9991)] == [4, 4, 5, 8, 15, 60, None]


def test_symmetric_values_have_the_interval_of_student():
    values = np.array([-3.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.0]) + 5
    found = mean_interval(values)
    reach = t.ppf(0.975, 7) * values.std(ddof=1) / np.sqrt(8)
    assert (found.low, found.high) == pytest.approx((5 - reach, 5 + reach), rel=1e-12)
    assert found.method == MEAN


def test_skewed_values_have_the_end_of_hall_on_their_long_side():
    values = np.random.default_rng(2).exponential(size=12)
    n, mean, deviation = 12, values.mean(), values.std(ddof=1)
    skewness = ((values - mean) ** 3).mean() / values.std() ** 3 * np.sqrt(n * (n - 1)) / (n - 2)
    reach = t.ppf(0.975, n - 1) / np.sqrt(n)
    found = mean_interval(values)
    assert found.low == pytest.approx(mean - reach * deviation, rel=1e-12)
    w = (mean - found.high) / deviation
    assert w + skewness * w**2 / 3 + skewness**2 * w**3 / 27 + skewness / (6 * n) == pytest.approx(-reach, rel=1e-12)
    assert found.high > mean + reach * deviation


@pytest.mark.parametrize(("factor", "shift"), [(1e-200, 0.0), (1e200, 0.0), (-3.0, 0.0), (1.0, 1e6)])
def test_intervals_scale_and_shift_with_their_values(factor, shift):
    values = np.random.default_rng(0).exponential(size=10)
    plain, changed = mean_interval(values), mean_interval(factor * np.append(values, np.nan) + shift)
    ends = sorted((factor * plain.low + shift, factor * plain.high + shift))
    assert (changed.low, changed.high) == pytest.approx(tuple(ends), rel=1e-9)


@cache
def _draws(name, count):
    draw, mean = DISTRIBUTIONS[name]
    # The fixed seed makes every distribution repeat; 4 standard deviations of the share are allowed below.
    return draw(np.random.default_rng(count), (1500, count)), mean


@pytest.mark.parametrize("name", DISTRIBUTIONS)
@pytest.mark.parametrize("level", [0.8, 0.95, 0.99])
def test_the_interval_of_a_mean_covers_from_the_fewest_values_on(name, level):
    for count in {least_values(level), 50}:
        values, mean = _draws(name, count)
        found = [mean_interval(row, level) for row in values]
        missed = 1 - np.mean([x.low <= mean <= x.high for x in found])
        allowed = 1.1 * (1 - level)
        assert missed <= allowed + 4 * np.sqrt(allowed / len(values))


@pytest.mark.parametrize(("count", "stated"), [(8, 0.58), (20, 0.88), (30, 0.955)])
def test_a_mean_that_rests_on_a_tenth_of_the_values_is_covered_as_seldom_as_documented(count, stated):
    rng = np.random.default_rng(5)
    values = (rng.random((1500, count)) < 0.1) + 0.01 * rng.normal(size=(1500, count))
    covered = np.mean([x.low <= 0.1 <= x.high for x in map(mean_interval, values)])
    assert covered == pytest.approx(stated, abs=4 * np.sqrt(stated * (1 - stated) / len(values)))


@pytest.mark.slow
@pytest.mark.parametrize("name", DISTRIBUTIONS)
@pytest.mark.parametrize("level", LEAST_VALUES)
def test_the_table_of_fewest_values_is_measured_again(name, level):
    draw, mean = DISTRIBUTIONS[name]
    rng = np.random.default_rng(17)
    for count in {LEAST_VALUES[level], LEAST_VALUES[level] + 1, 2 * LEAST_VALUES[level]}:
        values = draw(rng, (10_000, count))
        missed = 1 - np.mean([x.low <= mean <= x.high for x in (mean_interval(row, level) for row in values)])
        allowed = 1.1 * (1 - level)
        assert missed <= allowed + 3 * np.sqrt(allowed / len(values))


@pytest.mark.slow
def test_one_value_fewer_covers_too_seldom():
    # At each level some distribution is missed too often with a value less: the table asks for no more than is needed.
    for level, least in ((0.8, 4), (0.9, 5), (0.95, 8)):
        worst = 0.0
        for draw, mean in DISTRIBUTIONS.values():
            values = draw(np.random.default_rng(23), (10_000, least - 1))
            ends = [_ends_at_any_count(row, level) for row in values]
            worst = max(worst, 1 - np.mean([low <= mean <= high for low, high in ends]))
        assert worst > 1.1 * (1 - level)


def _ends_at_any_count(values, level):
    from flocking.study.confidence_intervals import _wider

    found = _wider(values, level)
    return found.low, found.high


@pytest.mark.parametrize("level", [0.0, 1.0, 95, "high"])
def test_a_level_is_between_0_and_1(level):
    with pytest.raises(fk.InvalidInput, match="level"):
        share_interval(1, 2, level)
    with pytest.raises(fk.InvalidInput, match="level"):
        mean_interval(np.arange(9.0), level)


def test_a_summary_has_exact_intervals_of_shares_and_says_how_the_others_are_made():
    from tests.study.sweeps.sweep_cases import make

    table = fk.sweep(
        make, grid={"speed": [0.5, 1.0]}, seeds=20, workers=1, progress=False,
        measures={"even": lambda run: int(run.scenario.seed) % 2 == 0, "spread": "velocity_spread"},
    )  # fmt: skip
    found = table.summary(0.9)
    values = table.values("even")
    expected = share_interval(int(values[1].sum()), 20, 0.9)
    assert (float(found.even_low[1]), float(found.even_high[1])) == (expected.low, expected.high)
    assert found.even_interval.values.tolist() == [SHARE] * 2
    spreads = table.values("spread")
    assert np.allclose(found.spread, spreads.mean(axis=1))
    assert (found.spread_low < found.spread).all()
    assert (found.spread < found.spread_high).all()
    assert found.spread_high[0] - found.spread_low[0] < spreads[0].max() - spreads[0].min()
    assert found.spread_interval.values.tolist() == [MEAN] * 2
    assert table.summary(0.9).equals(found)
    few = table.summary(0.999)
    assert np.isnan(few.spread_low).all()
    assert few.spread_interval.values.tolist() == ["none: 20 values, 60 needed"] * 2
    with pytest.raises(fk.InvalidInput, match="level"):
        table.summary(2.0)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.9])
def test_a_share_is_covered_whatever_decides_which_runs_are_unknown(share):
    """Where all that is true is unknown, as a graph seen at frames alone is never shown to stay connected."""
    from scipy.stats import binom

    total = 12
    successes = np.arange(total + 1)
    weights = binom.pmf(successes, total, share)
    assert weights.sum() == pytest.approx(1.0)
    all_true_hidden = [share_interval(0, total, unknown=int(k)) for k in successes]
    all_false_hidden = [share_interval(int(k), total, unknown=total - int(k)) for k in successes]
    for found in (all_true_hidden, all_false_hidden):
        covered = sum(w for w, x in zip(weights, found, strict=True) if x.low <= share <= x.high)
        assert covered >= 0.95


def test_a_summary_has_no_share_of_the_known_where_others_are_unknown():
    from tests.study.sweeps.sweep_cases import make

    def apart(run):
        """Seen to be false for even seeds, else unknown."""
        return False if int(run.scenario.seed) % 2 == 0 else float("nan")

    table = fk.sweep(make, seeds=range(10), workers=1, progress=False, measures={"apart": apart})
    found = table.summary()
    assert table.is_share("apart")
    assert np.isnan(found["apart"])
    assert (float(found.apart_low), float(found.apart_high)) == (0.0, share_interval(5, 10).high)
    assert int(found.apart_count) == 5
    assert str(found.apart_interval.values) == f"{SHARE}, 5 unknown as either"
