"""Stored rates and observed values: of every claim and scenario there is, and those that runs give."""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.papers import ALL_KEYS, paper, stored_observations, stored_rates
from flocking.study.claims.audit import audit
from flocking.study.claims.claim import Basis
from flocking.study.claims.settled_run import settled_runs

OBSERVED = [name for key in stored_observations.OBSERVING for name in stored_observations.observed_scenarios(key)]


STORED = [key for key in ALL_KEYS if stored_rates.stored_rates(key)]
"""Papers whose rates are stored; their first scenarios have their names."""


def test_rates_are_stored_of_every_claim_of_a_paper_and_of_no_other():
    expected = {
        (name, claim.key) for key in STORED for name in paper(key).scenarios() for claim in paper(key).claims(name)
    }
    stored = {(name, key) for name in stored_rates.stored_scenarios() for key in stored_rates.stored_rates(name)}
    assert stored == expected, "make rates computes them again"
    assert stored_rates.stored_rates("mine") == {}
    assert set(stored_observations.OBSERVING) <= set(STORED)


@pytest.mark.parametrize("key", STORED)
def test_stored_verdicts_are_the_expected_ones(key):
    for name in paper(key).scenarios():
        rates = stored_rates.stored_rates(name)
        for claim in paper(key).claims(name):
            rate = rates[claim.key]
            assert 0 <= rate.held <= rate.decided <= rate.tried
            # With seed 3 of the split an agent falls to the centre of an obstacle, and the run ends there.
            assert rate.tried >= (9 if name == "olfati-saber-2006-split" else 10)
            if claim.basis is Basis.OBSERVATION:
                assert rate.verdict == "observed"
                assert rate.decided >= 5, (name, claim.key)
            else:
                assert rate.verdict == str(claim.expected), (name, claim.key)


def test_the_words_of_a_rate():
    assert stored_rates.Rate("holds", 9, 9, 10).text == "holds: 9 of 9 seeds (1 more decides nothing)"
    assert stored_rates.Rate("fails", 0, 5, 15).text == "fails: 0 of 5 seeds (10 more decide nothing)"
    assert stored_rates.Rate("holds", 10, 10, 10).text == "holds: 10 of 10 seeds"
    # Clopper and Pearson: of 0 successes in n the upper end is 1 - 0.025^(1/n).
    assert stored_rates.Rate("observed", 0, 10, 10).text == "0 of 10 seeds: 0 % (0 to 31)"
    assert round(100 * (1 - 0.025 ** (1 / 10))) == 31


def test_the_file_is_made_of_the_claims_of_a_reproduction():
    given = [("a", "x", "holds", 4, 5, 6), ("a", "y", "observed", 1, 2, 3), ("b", "x", "fails", 0, 1, 1)]
    rows = [
        {"scenario": a, "claim": x, "verdict": v, "seeds": {"held": h, "decided": d, "tried": t, "met": 0}}
        for a, x, v, h, d, t in given
    ]
    assert json.loads(stored_rates.as_text(rows)) == {
        "a": {"x": ["holds", 4, 5, 6], "y": ["observed", 1, 2, 3]}, "b": {"x": ["fails", 0, 1, 1]},
    }  # fmt: skip


@pytest.mark.parametrize("name", ["vasarhelyi-2018-quiet", "vasarhelyi-2018-alone"])
def test_stored_rates_are_those_of_the_present_code(name):
    """Three seeds of quick scenarios: no more hold, and no fewer, than the stored numbers allow."""
    key = next(key for key in ALL_KEYS if name in paper(key).scenarios())
    claims = paper(key).claims(name)
    held = dict.fromkeys((c.key for c in claims), 0)
    for seed in range(3):
        for _, report in settled_runs(paper(key).scenarios()[name](seed), claims):
            last = report
        for result in last.results:
            held[result.claim.key] += str(result.verdict) == "holds"
    for claim, rate in stored_rates.stored_rates(name).items():
        assert held[claim] <= rate.held
        assert 3 - held[claim] <= rate.tried - rate.held


@pytest.mark.parametrize("name", OBSERVED)
def test_observed_values_are_stored_of_ten_seeds(name):
    found = stored_observations.stored_observations(name)
    assert found.seeds == tuple(range(10))
    for quantity, values in found.values.items():
        assert values.shape == (10,)
        interval = found.interval(quantity)
        if not interval.method.startswith("none"):
            assert interval.low < found.mean(quantity) < interval.high
        else:
            assert np.ptp(values[~np.isnan(values)]) == 0.0, quantity


def agree(name: str, seed: int) -> None:
    """Values of one seed are the stored ones, or rounding decides on them and they are like those of the other seeds.

    Such motions are chaotic, and processors with wider vectors add in another order.
    """
    stored, now = stored_observations.stored_observations(name), stored_observations.observe(name, (seed,)).values
    other = {each for each, values in now.items() if not same(values[0], stored.values[each][seed])}
    if not other:
        return
    moved = [quantities_of_rounded_start(name, seed, share) for share in ROUNDED]
    for quantity in other:
        value, known = now[quantity][0], stored.values[quantity]
        # One of them may come near by chance: a quantity near zero is held to 1e-3.
        assert not all(same(value, each[quantity]) for each in moved), (name, quantity)
        low, high = np.nanmin(known), np.nanmax(known)
        assert low - (high - low) / 2 <= value <= high + (high - low) / 2, (name, quantity)


def same(a: float, b: float) -> bool:
    return a == pytest.approx(b, rel=0.05, abs=1e-3, nan_ok=True)


ROUNDED = (1e-14, -1e-14, 2e-14)
"""Shares of places by which agents start elsewhere: some units in the last place."""


def quantities_of_rounded_start(name: str, seed: int, share: float) -> Mapping[str, float]:
    """Of a run whose agents start elsewhere by a ``share`` of their places."""
    found = paper(next(key for key in ALL_KEYS if name in paper(key).scenarios()))
    scenario = found.scenarios()[name](seed)
    start = replace(scenario.start, q=scenario.start.q * (1.0 + share))
    run = fk.simulate(scenario.with_(start=start), progress=False)
    return importlib.import_module(f"{found.package}.observations").quantities(run)


def test_a_stored_value_is_that_of_the_present_code():
    for name in ("reynolds-1987", "vasarhelyi-2018-program"):
        agree(name, 2)


@pytest.mark.slow
@pytest.mark.parametrize("name", OBSERVED)
def test_more_stored_values_are_those_of_the_present_code(name):
    for seed in (0, 7):
        agree(name, seed)


def test_values_that_are_not_there_are_told():
    found = stored_observations.Observations("x", (0, 1), {"a": np.array([np.nan, 2.0]), "b": np.full(2, np.nan)})
    assert (found.mean("a"), found.interval("a").method) == (2.0, "none: 1 value, 8 needed")
    assert np.isnan(found.mean("b"))
    assert json.loads(stored_observations.as_text([found]))["scenarios"]["x"] == {"a": [None, 2.0], "b": [None, None]}
    with pytest.raises(fk.InvalidInput, match="Observations: name must be one of a, b"):
        found.mean("c")
    for wrong in ("zhou-2015", "vasarhelyi-2018-alone"):
        with pytest.raises(fk.InvalidInput, match="observations: scenario must be one of reynolds-1987"):
            stored_observations.observe(wrong, (0,))
        with pytest.raises(fk.InvalidInput, match="observations: scenario must be one of reynolds-1987"):
            stored_observations.stored_observations(wrong)


def test_order_parameters_are_averaged_after_the_first_minute():
    system, observations = fk.papers.vasarhelyi_2018.system, fk.papers.vasarhelyi_2018.observations
    run = fk.simulate(system.flock(8, seed=1, duration=70.0, half_width=60.0), progress=False)
    found = observations.quantities(run)
    late = run.t >= 60.0
    assert late.sum() == 11
    speeds = np.linalg.norm(run.p[late], axis=2)
    outside = np.linalg.norm(np.maximum(np.abs(run.q[late]) - 60.0, 0.0), axis=2)
    assert found["speed"] == pytest.approx(speeds.mean(), rel=1e-12)
    assert found["overrun"] == pytest.approx(outside.mean(), abs=1e-12)
    by_claim = {r.claim.key: r.note for r in audit(run, fk.papers.vasarhelyi_2018.theorems.claims()).results}
    assert by_claim["fast"].startswith(f"mean speed {found['speed']:.3g} m/s")
    short = fk.simulate(system.flock(4, duration=2.0), progress=False)
    assert all(np.isnan(x) for x in observations.quantities(short).values())
