"""Confidence intervals: against known values, against SciPy, and by how often they cover."""

import numpy as np
import pytest
from scipy.stats import binomtest

import flocking as fk
from flocking.study.sweeps.intervals import bootstrap, wilson


@pytest.mark.parametrize(("successes", "total"), [(0, 10), (10, 10), (1, 3), (7, 40), (500, 1000)])
@pytest.mark.parametrize("level", [0.8, 0.95, 0.99])
def test_wilson_is_the_interval_of_scipy(successes, total, level):
    expected = binomtest(successes, total).proportion_ci(level, method="wilson")
    assert wilson(successes, total, level) == pytest.approx((expected.low, expected.high), abs=1e-12)


def test_nothing_tried_gives_no_interval():
    assert np.isnan(wilson(0, 0)).all()
    assert np.isnan(bootstrap(np.array([1.0]))).all()
    assert np.isnan(bootstrap(np.array([1.0, np.nan]))).all()


def test_the_bootstrap_repeats_with_its_seed_and_leaves_nan_out():
    values = np.random.default_rng(0).exponential(size=30)
    assert bootstrap(values, seed=1) == bootstrap(np.append(values, np.nan), seed=1) != bootstrap(values, seed=2)


def test_the_bootstrap_covers_the_mean_about_as_often_as_it_says():
    rng = np.random.default_rng(5)
    hits = 0
    for k in range(200):
        low, high = bootstrap(rng.normal(3.0, 2.0, size=40), 0.9, seed=k, resamples=400)
        hits += low <= 3.0 <= high
    # 200 trials at 0.88 (percentile intervals are a little short): 4 sigma is 0.09.
    assert 0.79 <= hits / 200 <= 0.97


@pytest.mark.parametrize("level", [0.0, 1.0, 95, "high"])
def test_a_level_is_between_0_and_1(level):
    with pytest.raises(fk.InvalidInput, match="level"):
        wilson(1, 2, level)


def test_a_summary_uses_wilson_for_truth_values_and_the_bootstrap_for_numbers():
    from tests.study.sweep_cases import make

    table = fk.sweep(
        make, grid={"speed": [0.5, 1.0]}, seeds=20, workers=1, progress=False,
        measures={"even": lambda run: int(run.scenario.seed) % 2 == 0, "spread": "velocity_spread"},
    )  # fmt: skip
    found = table.summary(0.9)
    values = table.values("even")
    assert (float(found.even_low[1]), float(found.even_high[1])) == wilson(int(values[1].sum()), 20, 0.9)
    assert found.even.attrs["interval"] == "Wilson"
    spreads = table.values("spread")
    assert np.allclose(found.spread, spreads.mean(axis=1))
    assert (found.spread_low < found.spread).all()
    assert (found.spread < found.spread_high).all()
    assert found.spread_high[0] - found.spread_low[0] < spreads[0].max() - spreads[0].min()
    assert table.summary(0.9).equals(found)
    with pytest.raises(fk.InvalidInput, match="level"):
        table.summary(2.0)
