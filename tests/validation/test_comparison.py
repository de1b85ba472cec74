"""Verdicts of random runs of two to five agents against an independent Taylor integration."""

from __future__ import annotations

import multiprocessing
import os
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from tests.counting import count
from tests.validation.comparison import Finding, examine
from tests.validation.draws import HARDSHIPS, draw
from tests.validation.judge.motion import Judge
from tests.validation.report import contradictions, open_share, told

SEED = 2026
RUNS = 10_000
AT_30_DIGITS = 300
MOST_OPEN = 0.05
"""Share of the ordinary draws of which a verdict may stay ``not resolved``."""

PORTION = 25


def portion(task: tuple[str, int, int]) -> list[Finding]:
    """Some draws, one after the other, in a process of their own."""
    folder, begin, end = task
    judge = Judge(Path(folder))
    return [examine(draw(SEED, number), judge) for number in range(begin, end)]


def digits_agree(task: tuple[str, int]) -> tuple[int, float, bool]:
    """The judge against itself at 30 digits: difference over its stated error, and whether switches are the same."""
    from tests.validation.truths import truth

    folder, number = task
    known = truth(draw(SEED, number), Judge(Path(folder)))
    fine = Judge(Path(folder), digits=30).motion(draw(SEED, number).problem)
    if known.trouble:
        return number, 0.0, True
    off = float(max(np.abs(known.motion.q - fine.q).max(), np.abs(known.motion.p - fine.p).max()))
    same = [(x.kind, x.pair) for x in known.motion.switches] == [(x.kind, x.pair) for x in fine.switches]
    return number, off / known.error, same


def test_a_few_runs_contradict_nothing(judge: Judge) -> None:
    """Few structures, so that few kernels are compiled."""
    chosen = ("springs", "watched", "flights")
    every = [x for x in (draw(SEED, k) for k in range(400)) if x.law in chosen and x.problem.q.shape[1] == 2]
    findings = [examine(x, judge) for x in [x for x in every if x.kind == "ordinary"][:40]]
    assert not contradictions(findings), contradictions(findings)
    assert sum(f.verdicts["links-kept"] == "fails" for f in findings) > 3


def test_a_missed_link_is_a_contradiction(judge: Judge, monkeypatch) -> None:
    """An engine that sees no crossing, and no pair near one, is found out."""
    picked = next(
        x for x in (draw(SEED, k) for k in range(400))
        if x.law == "flights" and [s.kind for s in judge.motion(x.problem).switches] == ["appear", "break"]
    )  # fmt: skip
    assert not examine(picked, judge).contradictions
    monkeypatch.setattr("flocking.engine.exact.session.take_block", lambda *_, **__: None)
    monkeypatch.setattr("flocking.engine.exact.crossings.switching.LinkState.next_crossings", lambda *_: (2.0, []))
    monkeypatch.setattr("flocking.engine.exact.uncertain_switches.Doubts.follow", lambda *_: [])
    found = examine(picked, judge)
    assert any("switches" in x or "links" in x for x in found.contradictions), found


def test_another_motion_is_told(judge: Judge) -> None:
    """A law whose gain is 1 % off, from the same start, ends elsewhere than the judge."""
    picked = next(x for x in (draw(SEED, k) for k in range(400)) if x.kind == "ordinary" and x.law == "springs")
    law = picked.scenario.law
    stiffer = law.terms[0].potential.with_parameters(k=1.01 * law.terms[0].potential.parameters["k"])
    other = fk.Law(law.graph, [fk.Gradient(stiffer), law.terms[1]])
    name = "positions / (tolerance x size)"
    wrong = examine(replace(picked, scenario=picked.scenario.with_(law=other)), judge)
    assert wrong.ratios[name] > 100 * examine(picked, judge).ratios[name]


def test_refusals_must_be_legitimate(judge: Judge, monkeypatch) -> None:
    from flocking.errors import StepTooSmall

    picked = next(x for x in (draw(SEED, k) for k in range(400)) if x.kind == "ordinary" and x.law == "springs")

    def refuse(*_: object, **__: object) -> None:
        raise StepTooSmall("no", time=0.0)

    monkeypatch.setattr(fk, "simulate", refuse)
    found = examine(picked, judge)
    assert found.refusal.startswith("StepTooSmall")
    assert not found.legitimate


@pytest.mark.slow
def test_ten_thousand_runs_contradict_nothing(judge_folder, capsys) -> None:
    begin = time.monotonic()
    Judge(judge_folder), Judge(judge_folder, digits=30)
    workers = min(2, os.cpu_count() or 1)
    tasks = [(str(judge_folder), k, min(k + PORTION, RUNS)) for k in range(0, RUNS, PORTION)]
    fine = [(str(judge_folder), int(k)) for k in np.linspace(0, RUNS - 1, AT_30_DIGITS)]
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        findings = [x for part in pool.map(portion, tasks) for x in part]
        digits = list(pool.map(digits_agree, fine, chunksize=5))
    with capsys.disabled():
        print(f"\n{told(findings)}")
        most = max(ratio for _, ratio, _ in digits)
        print(f"  the judge itself, {len(digits)} times at 30 digits: off by at most {most:.2g} of its own error")
        print(f"  {time.monotonic() - begin:.0f} s on {workers} processes")
    count("comparison: runs", len(findings))
    count("comparison: contradicted runs", sum(bool(f.contradictions) for f in findings))
    assert {f.kind for f in findings} == {"ordinary", *HARDSHIPS}
    assert not contradictions(findings), contradictions(findings)
    assert open_share([f for f in findings if f.kind == "ordinary"]) < MOST_OPEN
    assert all(same for _, _, same in digits)
    assert most < 100
