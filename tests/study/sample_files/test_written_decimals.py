"""Tables of text: what numbers were rounded by when they were written is not known, and counts as an error."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flocking.study.claims.claim import Verdict
from flocking.study.sample_files.reading import read_samples
from flocking.study.sample_files.sampled_runs import motion_of

T = np.linspace(0.0, 2.0, 41)


def table(folder: Path, q: np.ndarray, form: str) -> Path:
    rows = ["t,id,x,y"]
    for t, places in zip(T, q, strict=True):
        rows += [f"{t:.2f},{i},{form.format(x)},{form.format(y)}" for i, (x, y) in enumerate(places)]
    path = folder / "a.csv"
    path.write_text("\n".join(rows))
    return path


def resting(*places: float) -> np.ndarray:
    q = np.zeros((len(T), len(places), 2))
    q[:, :, 0] = places
    return q


def verdicts(path: Path, radius: float) -> dict[str, Verdict]:
    return {r.claim.key: r.verdict for r in motion_of(read_samples(path), radius=radius).audit().results}


def test_agents_that_are_written_at_one_place_may_be_apart(tmp_path):
    """At 1.231 and 1.2255, both written as 1.23."""
    found = verdicts(table(tmp_path, resting(1.231, 1.2255), "{:.2f}"), radius=1.0)
    assert found["apart"] is Verdict.NOT_RESOLVED
    assert verdicts(table(tmp_path, resting(1.231, 1.2255), "{:.17g}"), radius=1.0)["apart"] is Verdict.HOLDS
    assert verdicts(table(tmp_path, resting(1.231, 1.231), "{:.17g}"), radius=1.0)["apart"] is not Verdict.HOLDS


def test_a_radius_that_rounding_crosses_is_open(tmp_path):
    """1.03 apart, written as 1.3 and 2.3 with one decimal, and as 1.260 and 2.290 with three."""
    q = resting(1.26, 2.29)
    coarse, fine = (verdicts(table(tmp_path, q, form), radius=1.01) for form in ("{:.1f}", "{:.3f}"))
    for key in ("connected", "neighbours-kept"):
        assert coarse[key] is Verdict.NOT_RESOLVED
    assert fine["connected"] is Verdict.FAILS


@pytest.mark.parametrize(
    ("texts", "expected"),
    [
        (("0.5", "1.25"), 5e-3), (("1", "20"), 0.0), (("1e3", "2"), 0.0), (("1.5e-3", "2"), 5e-2),
        (("1.5e-3", "2.5e-3"), 5e-5), (("1.5e3", "2.5e3"), 5e1),
        (("0.0", "0.30000000000000004"), 5e-17), ((" 1.50 ", "2.0"), 5e-3), (("-1.", "2"), 0.0),
        (("123.456", "0.00123456"), 5e-4), (("1.23456e+02", "1.23456e-03"), 5e-4), (("1.23e+06", "4.56e+05"), 5e3),
        (("0.00", "0.01"), 5e-3), (("999.25", "-1000.00"), 5e-3), (("1.5", "1.5e-" + "9" * 5000), 5e-2),
    ],
)  # fmt: skip
def test_decimals_of_coordinates_are_counted(tmp_path, texts, expected):
    path = tmp_path / "a.csv"
    rows = [f"{k},a,{text},{k}" for k, text in enumerate([*texts, texts[0]])]
    path.write_text("\n".join(["t,id,x,y", *rows]))
    assert read_samples(path).rounding == (pytest.approx(expected, rel=1e-9), 0.0)


@pytest.mark.parametrize("form", ["{:.6g}", "{:.5e}"])
def test_numbers_near_zero_do_not_make_large_ones_exact(tmp_path, form):
    """123.4564 from the first agent, written as 123.456 like 123.4561; the third is at 0.00123456."""
    q = resting(0.0, 123.4564, 0.0)
    q[:, 2, 1] = 0.00123456
    found = verdicts(table(tmp_path, q, form), radius=123.4562)
    for key in ("connected", "neighbours-kept"):
        assert found[key] is Verdict.NOT_RESOLVED
    assert verdicts(table(tmp_path, q, "{:.17e}"), radius=123.4562)["connected"] is Verdict.FAILS
