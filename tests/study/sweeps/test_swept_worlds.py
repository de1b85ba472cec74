"""Parts of worlds as axes of a sweep, against closed forms: period, delay and loss of linear consensus on K_4."""

import csv
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from scipy.special import lambertw

import flocking as fk
from flocking.apps.cli import main
from flocking.model.world.losses import Bernoulli

N = 4
"""All disagreement on K_N has the one eigenvalue N, so that its size is known at every tick, not its growth alone."""

LAW = fk.Law(fk.Fixed.complete(N), [fk.Consensus(1.0)])
PLACES, SPEEDS = np.random.default_rng(5).normal(size=(2, N, 2))
SPREAD = float(np.linalg.norm(SPEEDS - SPEEDS.mean(axis=0), axis=1).max())

PERIODS = [0.45, 0.495, 0.55, 0.66]
"""On both sides of T* = 2/N = 0.5; each divides the duration."""

DURATION = 9.9


def swept(make, grid, measure="velocity_spread", **options):
    table = fk.sweep(make, grid=grid, measures=measure, workers=1, progress=False, **{"seeds": [0], **options})
    assert table.failures == []
    return table


def held(period, seed):
    start = fk.State(PLACES, SPEEDS)
    return fk.Scenario(LAW, start, DURATION, frames=2, control=fk.Held(period))


def spread_after(period):
    """The size of p(k + 1) = (1 - T N) p(k), of velocities about their mean, and what is left of the last period."""
    ticks = int(DURATION / period + 1e-9)
    return SPREAD * abs(1 - period * N) ** ticks * abs(1 - (DURATION - ticks * period) * N)


def test_a_swept_period_has_the_spread_of_its_factor():
    found = swept(held, {"period": PERIODS}, ["velocity_spread"]).values("velocity_spread")
    assert found == pytest.approx([spread_after(period) for period in PERIODS], rel=1e-9)
    assert [bool(x < SPREAD) for x in found] == [period < 2 / N for period in PERIODS]


STRUCK: list[float] = []
"""Periods at which a sweep was interrupted: once."""


def struck(period, seed):
    if period == 0.55 and not STRUCK:
        STRUCK.append(period)
        raise KeyboardInterrupt
    return held(period, seed)


def test_an_interrupted_sweep_over_periods_goes_on_to_the_same_spreads(tmp_path):
    STRUCK.clear()
    options = {"grid": {"period": PERIODS}, "measure": ["velocity_spread"], "out": tmp_path / "out"}
    assert len(swept(struck, **options)) == 2
    table = swept(struck, **options)
    assert table.complete
    assert table.values("velocity_spread") == pytest.approx([spread_after(period) for period in PERIODS], rel=1e-9)


DELAYS = [0.3, 0.35, 0.44, 0.5]
"""On both sides of pi/(2 N) = 0.393, of a delay of all states, the own one too."""


def late(tau, seed):
    start = fk.State(PLACES, SPEEDS)
    return fk.Scenario(LAW, start, 40.0, frames=4001, information=fk.Delayed(tau, self_delayed=True))


def growth(run):
    """Rate at which the highest peaks of the disagreement change, between two windows longer than its period."""
    size = np.linalg.norm(run.p - run.p.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    peaks = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
    peaks = peaks[run.t[peaks] > 10.0]
    return float(np.polyfit(run.t[peaks], np.log(size[peaks]), 1)[0])


def test_a_swept_delay_grows_and_falls_with_the_root_of_its_equation():
    """s = -N exp(-s tau): s = W(-N tau)/tau, of which the principal branch is the fastest."""
    found = swept(late, {"tau": DELAYS}, {"growth": growth}).values("growth")
    exact = [float(lambertw(-N * tau).real / tau) for tau in DELAYS]
    assert found == pytest.approx(exact, rel=2e-3)
    assert [bool(x < 0) for x in found] == [tau < np.pi / (2 * N) for tau in DELAYS]


LOSSES, TICKED, DRAWS = [0.0, 0.05, 0.3, 0.6], 0.55, 100
"""Beyond 2/N = 0.5 without loss; 2/(N(1 - p) + 2 p (N - 1)/N) reaches 0.55 at a loss of 0.145."""


def lossy(loss, seed):
    start = fk.State(PLACES, SPEEDS)
    heard = fk.Messages(TICKED, loss=Bernoulli(loss) if loss else None, expires=TICKED / 2, seed=seed)
    return fk.Scenario(LAW, start, 3 * TICKED, frames=4, control=fk.Held(TICKED), information=heard)


def factor(run):
    """Of the sum of squares about the mean, over the last tick of three: what the first samples find is over."""
    squares = ((run.p - run.p.mean(axis=1, keepdims=True)) ** 2).sum(axis=(1, 2))
    return float(squares[-1] / squares[-2])


def factor_of(loss):
    """1 - 2 T N (1 - p) + T^2 (1 - p) (N^2 (1 - p) + 2 p (N - 1)), of independent losses that are left out."""
    share = 1 - loss
    return 1 - 2 * TICKED * N * share + TICKED**2 * share * (N**2 * share + 2 * loss * (N - 1))


def test_a_swept_loss_has_the_mean_square_factor_of_its_probability():
    """The mean of 100 draws at a level, within five standard errors; the factor crosses 1 with the loss."""
    values = swept(lossy, {"loss": LOSSES}, {"factor": factor}, seeds=range(DRAWS)).values("factor").reshape(-1, DRAWS)
    exact = np.array([factor_of(loss) for loss in LOSSES])
    assert values[0] == pytest.approx(exact[0], rel=1e-9)
    error = values.std(axis=1, ddof=1) / np.sqrt(DRAWS)
    assert (np.abs(values.mean(axis=1) - exact) <= 5 * error + 1e-9).all()
    assert (exact > 1).tolist() == [True, True, False, False]
    bound = 2 / (N * (1 - np.array(LOSSES)) + 2 * np.array(LOSSES) * (N - 1) / N)
    assert (exact > 1).tolist() == (bound < TICKED).tolist()


WRITTEN = """
name = "periods"
seeds = [0]
measures = ["velocity_spread"]

[scenario]
t_end = 9.9
frames = 2
terms = [{kind = "consensus", gain = 1.0}]
graph = {kind = "complete"}
start = {q = %s, p = %s}
control = {kind = "held", period = 0.1}

[grid]
"control.period" = {low = 0.45, high = 0.66, count = 200}
"""


def rows_of(folder):
    with (folder / "runs.csv").open(encoding="utf-8", newline="") as file:
        return {float(row["control.period"]): float(row["velocity_spread"]) for row in csv.DictReader(file)}


def test_a_file_that_sweeps_a_period_is_killed_and_goes_on_to_the_closed_form(tmp_path, monkeypatch):
    """The command in a process of its own, killed after its first rows; the same command again, and its table."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "periods.toml"
    path.write_text(WRITTEN % (PLACES.tolist(), SPEEDS.tolist()), encoding="utf-8")
    words = ["sweep", str(path), "--workers", "1", "--out", str(tmp_path / "out")]
    running = subprocess.Popen(
        [sys.executable, "-m", "flocking", *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip
    folder, deadline = tmp_path / "out" / "results", time.monotonic() + 300
    while not list(folder.glob("rows/*.json")) and running.poll() is None and time.monotonic() < deadline:
        time.sleep(0.005)
    killed = running.poll() is None
    if killed:
        os.killpg(running.pid, signal.SIGKILL)
    running.wait()
    before = len(fk.read_sweep(folder))
    assert before >= 1
    assert not killed or before < 200
    assert main(words) == 0
    found = rows_of(tmp_path / "out")
    periods = np.linspace(0.45, 0.66, 200)
    assert list(found) == pytest.approx(periods, rel=1e-12)
    for period, spread in found.items():
        exact = spread_after(round(period, 9))  # times are whole nanoseconds
        assert spread == pytest.approx(exact, rel=1e-8, abs=1e-8 * SPREAD * abs(1 - period * N) ** (DURATION // period))
