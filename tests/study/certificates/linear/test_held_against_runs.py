"""Rates of alignment and errors at the end of a run, enclosed, and held against runs that are cut or have errors."""

from __future__ import annotations

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs.run import Accuracy
from flocking.study.certificates.comparison import compare


def meeting(gap: float, speed: float, exponent: float = 1.0) -> fk.Scenario:
    """Two agents on a line whose relative velocity w falls by w' = -w/(1 + r^2)^exponent."""
    law = fk.Law(fk.Complete(), [fk.CuckerSmale(0.5, exponent)])
    return fk.Scenario(law, fk.State([[0.0], [gap]], [[0.0], [speed]]), t_end=2.0, frames=21)


@pytest.mark.parametrize(("gap", "speed"), [(0.3, 0.7), (2.0, 0.4), (0.01, 1.5), (5.0, 0.1)])
def test_the_rate_of_alignment_is_enclosed_to_the_last_digits(gap: float, speed: float) -> None:
    """w + arctan r stays the same: the farthest distance X has arctan X = arctan r(0) + w(0), the rate 1/(1 + X^2)."""
    bound = fk.certify(meeting(gap, speed))["alignment_rate"].bound
    with mp.workdps(40):
        exact = 1 / (1 + mp.tan(mp.atan(mp.mpf(gap)) + mp.mpf(speed)) ** 2)
        assert mp.mpf(bound.lo) <= exact <= mp.mpf(bound.hi)
        assert (mp.mpf(bound.hi) - mp.mpf(bound.lo)) / exact < 1e-8


@pytest.mark.parametrize(("share", "kept"), [(0.9, True), (4.0, False)])
def test_a_rate_is_kept_within_the_error_of_the_velocities(share: float, kept: bool) -> None:
    """With constant weights the rate is that the bound at all times; velocities at the end are off to either side."""
    made, off = meeting(0.3, 0.7, 0.0), 1e-4
    run = fk.simulate(made, progress=False)
    assert run.accuracy is not None
    p = run.p.copy()
    p[-1] += share * off * np.array([[-1.0], [1.0]])
    stated = Accuracy(np.tile([0.0, off], (len(run.t), 1)), run.accuracy.doubts, run.accuracy.largest)
    rows = {row.key: row for row in compare(fk.certify(made), replace(run, p=p, accuracy=stated))}
    assert rows["alignment_rate"].kept is kept


def test_what_is_promised_of_the_end_is_not_asked_of_a_run_that_was_cut() -> None:
    """The error behind a leader falls to its end: before, it is larger, and no promise is broken."""
    law = fk.Law(fk.Complete(), [fk.Consensus(0.5), fk.Track(fk.Velocity([1.0]), 0.0, 0.8)])
    made = fk.Scenario(law, fk.State([[0.0], [1.0]], [[0.0], [0.2]]), t_end=4.0, frames=21)
    found, run = fk.certify(made), fk.simulate(made, progress=False)
    promised = found["mean_leader_error_at_end"].safe_bound
    assert promised == pytest.approx(0.9 * np.exp(-0.8 * 4.0), rel=1e-9)
    assert "mean_leader_error_at_end" in {row.key for row in compare(found, run)}
    for cut in (run.until(2.0), replace(run, status="interrupted at t = 2")):
        assert "mean_leader_error_at_end" not in {row.key for row in compare(found, cut)}
