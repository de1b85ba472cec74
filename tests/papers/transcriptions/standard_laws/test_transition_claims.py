"""Claims about the transition of Vicsek et al.: measures against plain loops, and motions of which they do not hold."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import flocking as fk
from flocking.papers.vicsek_1995 import system, theorems, transition_claims
from flocking.study.evidence import Evidence
from flocking.study.trajectory import run_from_samples


def verdicts(run, name):
    """By the frames alone: a motion that was made up is no motion of the law."""
    claims = [replace(c, dynamic=False) for c in theorems.claims(name) if c.key != "speed"]
    return {r.claim.key: str(r.verdict) for r in fk.audit(run, claims).results}


@cache
def simulated(name):
    return fk.simulate(system.scenario(name=name), progress=False)


def made_up(name, side, q, angles):
    """A run that another program made, of places and headings at frames, shapes (F, N, 2) and (F, N)."""
    p = 0.5 * np.stack([np.cos(angles), np.sin(angles)], axis=2)
    made = system.later(side, 0.5, system.SPARSE * (len(q) - 1), name=name).with_(start=fk.State(q[0], p[0]))
    return run_from_samples(made, system.SPARSE * np.arange(float(len(q))), q, p)


def places(frames, agents, side, seed=3):
    return np.random.default_rng(seed).uniform(0, side, (frames, agents, 2))


def spread(orders, agents=200):
    """Headings whose mean unit vector has about these lengths: a share of them is equal, the others opposite pairs."""
    rows = []
    for order in orders:
        equal = round(order * agents)
        rows.append(np.where(np.arange(agents) < equal, 0.3, 0.3 + math.pi * (np.arange(agents) % 2)))
    return np.array(rows)


@pytest.mark.slow
def test_two_phases_take_turns_at_the_transition_of_later_work():
    """Forty thousand updates: shorter runs may see one phase alone."""
    assert verdicts(simulated(system.PHASES), system.PHASES) == {"two-phases": "holds", "cumulant-dips": "holds"}
    assert verdicts(simulated(system.PHASES), system.MIDDLE) == {"one-phase": "fails"}


@pytest.mark.slow
def test_both_verdicts_on_the_transition():
    """At a size of the paper one phase; in later work's groups bands and giant fluctuations."""
    assert verdicts(simulated(system.MIDDLE), system.MIDDLE) == {"one-phase": "holds"}
    assert verdicts(simulated(system.BANDS), system.BANDS) == {"bands": "holds", "bands-across": "holds"}
    assert verdicts(simulated(system.FLUCTUATIONS), system.FLUCTUATIONS) == {"giant-fluctuations": "holds"}
    # The other way round none of it holds.
    assert verdicts(simulated(system.MIDDLE), system.PHASES) == {"two-phases": "fails", "cumulant-dips": "fails"}
    assert verdicts(simulated(system.FLUCTUATIONS), system.BANDS)["bands"] == "fails"
    (claim,) = (c for c in theorems.claims(system.FLUCTUATIONS) if c.key != "speed")
    assert str(fk.audit(simulated(system.FLUCTUATIONS), [claim]).results[0].verdict) == "holds"


@pytest.mark.parametrize(("noise", "updates"), [(0.55, 4000), pytest.param(0.7, 12000, marks=pytest.mark.slow)])
def test_on_either_side_of_the_transition_there_is_one_phase(noise, updates):
    """In disorder the cumulant of few values scatters more than in order: the run is longer."""
    run = fk.simulate(system.later(20.0, noise, updates, name=system.PHASES), progress=False)
    assert verdicts(run, system.PHASES) == {"two-phases": "fails", "cumulant-dips": "fails"}


def test_the_measures_of_phases_by_hand():
    """Of eleven frames the first two are passed over; then 0.1 twice and 0.9 seven times, and so on."""
    for orders, key, verdict in (
        ([0.5] * 2 + [0.1] * 2 + [0.9] * 7, "two-phases", "holds"), ([0.1] * 2 + [0.9] * 9, "two-phases", "fails"),
        ([0.1] * 9 + [0.3] * 2, "two-phases", "fails"), ([0.5] * 2 + [0.05] * 8 + [0.9], "cumulant-dips", "holds"),
        ([0.9] * 2 + [0.05] * 9, "cumulant-dips", "fails"),
    ):  # fmt: skip
        run = made_up(system.PHASES, 10.0, places(11, 200, 10.0), spread(orders))
        assert verdicts(run, system.PHASES)[key] == verdict, orders
        late = np.array([np.hypot(*np.mean(p, axis=0)) for p in run.p[2:]]) / 0.5
        cumulant = 1 - (late**4).mean() / (3 * (late**2).mean() ** 2)
        assert transition_claims.one_phase(Evidence(run)).margin == pytest.approx(cumulant - 1 / 3, rel=1e-9)
        assert transition_claims.cumulant_dips(Evidence(run)).margin == pytest.approx(7 / 30 - cumulant, rel=1e-9)


def test_the_exponent_by_loops_over_boxes():
    side, q = 8.0, places(11, 128, 8.0)
    q[:, :60] *= 0.5
    run = made_up(system.FLUCTUATIONS, side, q, spread([0.5] * 11, 128))
    x, y = [], []
    for size in (1, 2, 3, 4):
        along, numbers = int(side // size), []
        for frame in q[2:]:
            for a in range(along):
                for b in range(along):
                    corner = np.array([a, b]) * size
                    numbers.append(int(((frame >= corner) & (frame < corner + size)).all(axis=1).sum()))
        x.append(math.log(np.mean(numbers)))
        y.append(math.log(np.std(numbers)))
    slope = np.polyfit(x, y, 1)[0]
    assert transition_claims.fluctuation_exponent(Evidence(run)) == pytest.approx(slope, rel=1e-9)
    margin = transition_claims.giant_fluctuations(Evidence(run)).margin
    assert margin == pytest.approx(0.1 - abs(slope - 0.8), rel=1e-9)


def test_independent_places_have_neither_bands_nor_giant_fluctuations():
    q = places(11, 1152, 24.0)
    run = made_up(system.BANDS, 24.0, q, spread([0.6] * 11, 1152))
    assert verdicts(run, system.BANDS)["bands"] == "fails"
    assert verdicts(run, system.FLUCTUATIONS) == {"giant-fluctuations": "fails"}
    assert transition_claims.fluctuation_exponent(Evidence(run)) == pytest.approx(0.5, abs=0.05)


def test_bands_that_move_along_their_fronts_are_told_from_those_that_move_across():
    q = places(11, 512, 16.0)
    q[:, :250, 0] *= 0.25
    for angle, verdict in ((0.0, "holds"), (0.5 * math.pi, "fails")):
        run = made_up(system.BANDS, 16.0, q, np.full((11, 512), angle))
        assert verdicts(run, system.BANDS) == {"bands": "holds", "bands-across": verdict}


def test_what_the_measures_do_not_apply_to():
    run = simulated(system.BANDS)
    law, start = system.law(), run.scenario.start
    other = fk.simulate(
        run.scenario.with_(law=law, start=start, space=fk.Periodic([32.0, 33.0]), t_end=40.0, frames=3), progress=False
    )
    assert set(verdicts(other, system.BANDS).values()) == {"not applicable"}
    assert verdicts(other, system.FLUCTUATIONS) == {"giant-fluctuations": "not applicable"}
    short = fk.simulate(run.scenario.with_(t_end=20.0, frames=2), progress=False)
    for name in (system.MIDDLE, system.PHASES, system.BANDS, system.FLUCTUATIONS):
        assert set(verdicts(short, name).values()) == {"not applicable"}, name
    narrow = made_up(system.FLUCTUATIONS, 3.0, places(11, 18, 3.0), spread([0.5] * 11, 18))
    assert verdicts(narrow, system.FLUCTUATIONS) == {"giant-fluctuations": "not applicable"}
