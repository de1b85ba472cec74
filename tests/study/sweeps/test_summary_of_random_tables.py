"""Summaries of random tables against plain loops: runs that failed, are missing, are unknown, or are one run."""

import math

import numpy as np
import pytest
from scipy.stats import binomtest

from flocking.study.sweeps.plan import make_plan
from flocking.study.sweeps.table import SweepTable


def random_row(rng, index, truth):
    failed, known = rng.random() < 0.2, rng.random() < 0.8
    value = (bool(rng.integers(2)) if truth else float(rng.integers(3))) if known else math.nan
    return {
        "index": index, "status": "failed" if failed else "ok", "values": {} if failed else {"m": value},
        "verdicts": {}, "message": "", "tries": 1, "seconds": 0.1,
        "scenario": str(rng.integers(6)) if rng.random() < 0.7 else "",
    }  # fmt: skip


def counted(rows):
    """Rows without repetitions: of one scenario and one result the first."""
    kept = []
    for row in rows:
        same = [
            other for other in kept
            if row["scenario"] and other["scenario"] == row["scenario"] and repr(other["values"]) == repr(row["values"])
        ]  # fmt: skip
        if not same:
            kept.append(row)
    return kept


@pytest.mark.parametrize("truth", [True, False])
def test_a_summary_counts_as_plain_loops_do(truth):
    rng = np.random.default_rng(11)
    for _ in range(60):
        plan = make_plan({"a": [1, 2], "b": ["x", "y", "z"]}, None, int(rng.integers(1, 12)), 0, 1000)
        rows = {k: random_row(rng, k, truth) for k in range(plan.size) if rng.random() < 0.9}
        table = SweepTable(plan, rows, ("m",))
        found = table.summary()
        kinds = [
            type(row["values"]["m"])
            for row in rows.values()
            if row["values"] and row["values"]["m"] == row["values"]["m"]
        ]
        share = bool(kinds) and all(kind is bool for kind in kinds)
        for point in range(plan.points):
            place = dict(zip(("a", "b"), (point // 3, point % 3), strict=True))
            here = found.isel(place)
            mine = [rows[k] for k in range(plan.size) if k // plan.runs_per_point == point and k in rows]
            kept = counted(mine)
            known = [row["values"]["m"] for row in kept if row["values"] and row["values"]["m"] == row["values"]["m"]]
            assert int(here["runs"]) == len(mine)
            assert int(here["failed"]) == sum(row["status"] == "failed" for row in mine)
            assert int(here["different"]) == len(kept)
            assert int(here["m_count"]) == len(known)
            complete = known and (len(known) == len(kept) or not share)
            expected = sum(known) / len(known) if complete else math.nan
            assert float(here["m"]) == pytest.approx(expected, nan_ok=True)
            if not share:
                assert np.isnan(here["m_low"]) == (len(known) < 8 or len(set(known)) == 1)
            elif kept:
                open_ = len(kept) - len(known)
                low = binomtest(sum(known), len(kept)).proportion_ci(method="exact").low
                high = binomtest(sum(known) + open_, len(kept)).proportion_ci(method="exact").high
                assert (float(here["m_low"]), float(here["m_high"])) == pytest.approx((low, high))
