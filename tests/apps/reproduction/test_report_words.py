"""What reports say of a claim: seeds that leave it open, errors, counter-examples, and bounds on their safe side."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import pytest

import flocking as fk
from flocking.apps.reproduction import report_certificates
from flocking.apps.reproduction.report import _outcome, _summary
from flocking.apps.reproduction.report_certificates import certificates_table
from flocking.apps.reproduction.report_claims import claims_beside_pictures
from flocking.apps.reproduction.report_errata import errata_tables
from flocking.apps.reproduction.results import Reproduction, rate_of
from flocking.study.certificates.beside.guaranteed_claims import OTHER_RUN
from flocking.study.certificates.comparison import compare
from flocking.study.claims.claim import Basis, Result, Verdict
from flocking.study.claims.judgement import Judgement
from tests.study.claims.test_judgement import claim, judged


def shown(found: Judgement | Result) -> str:
    """The card of a claim, without tags."""
    return re.sub(r"<[^>]*>", "", claims_beside_pictures("s", [found], None, {}))


def test_seeds_that_leave_a_claim_open_are_counted_beside_those_that_hold() -> None:
    told = shown(judged("hhhhhy??u", claim()))
    assert "held 5, not yet 1, not resolved 2, met 8, tried 9; worst margin 1" in told


def test_a_rate_with_undecided_seeds_says_that_they_count_as_either() -> None:
    of = claim(Basis.OBSERVATION)
    assert "of the seeds that meet the hypothesis, with the" in shown(judged("hhhhhf", of))
    assert "of the seeds that meet the hypothesis, undecided ones counted as either, with the" in shown(
        judged("hhhhhfy", of)
    )


def test_the_worst_margin_is_shown_with_its_error_and_a_counter_example_as_one() -> None:
    of = claim()
    results = tuple(Result(of, Verdict.HOLDS, margin, 0.25) for margin in (3.0, 2.0, 5.0, 4.0, 7.0))
    assert "worst margin 2 (error 0.25)" in shown(Judgement(of, results))
    refuted = claim(Basis.COUNTEREXAMPLE, Verdict.FAILS)
    told = shown(judged("hhhhh", refuted, "f"))
    assert "counter-example: " in told
    assert "worst margin" not in told
    assert rate_of(judged("hhhhh", claim(Basis.OBSERVATION))).startswith("100")
    assert rate_of(replace(judged("hhhhh", claim(Basis.OBSERVATION)), counterexample=results[0])) == "counter-example"


def test_what_is_not_resolved_is_framed_and_does_not_differ_from_a_proof() -> None:
    """It is left open: a sentence of its own says so."""
    open_ = judged("hhhh?", claim())
    assert not open_.is_contrary
    found = Reproduction({"s": [open_, judged("hhhhy", claim()), judged("hh", claim())]})
    said = _outcome(found)
    assert said.startswith("No claim differs from the verdict that follows from its proof")
    assert "1 is not resolved: " in said
    assert "1 is not yet decided: " in said
    assert "1 is untested: " in said
    assert 'unexpected" id=' in claims_beside_pictures("s", [open_], None, {})
    assert 'unexpected" id=' not in claims_beside_pictures("s", found.judgements["s"][1:], None, {})
    assert found.unexpected == 3
    assert not found.as_expected


def test_printed_and_true_numbers_stand_in_their_columns() -> None:
    row = {
        "number": "(7)", "title": "A bound", "verdict": "false statement", "reason": "Too small.", "note": "",
        "home": "", "demonstration": {"printed": 2.0, "true": 3.0, "example": "two agents"},
    }  # fmt: skip
    text = errata_tables([row])  # type: ignore[list-item]
    # In the order of the head, which names the columns where the table is wide.
    assert re.findall(r'data-name="(printed|true)">([^<]*)<', text) == [("printed", "2"), ("true", "3")]


@pytest.fixture(scope="module")
def run() -> fk.Run:
    """Two agents on a spring that settles, of which the energy is promised."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [1.2345678, 0.0]], [[0.3, 0.0], [-0.3, 0.1]])
    return fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=5), progress=False)


def test_promises_are_rounded_to_their_safe_side_and_called_what_became_of_them(
    run: fk.Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = fk.certify(run.scenario)
    compared, seen = compare(found, run), 0
    monkeypatch.setattr(report_certificates, "certify", lambda scenario: found)
    for kept, word in ((True, "yes"), (False, "no"), (None, "not resolved")):
        rows = [replace(x, kept=kept) for x in compared]
        monkeypatch.setattr(report_certificates, "compare", lambda *given, rows=rows: rows)
        text = certificates_table(run)
        assert set(re.findall(r'data-name="kept">([^<]*)<', text)) - {""} == {word}
    told = re.findall(r'data-name="promised">([^<]*)<', text)
    for each, promised in zip(found.granted, told, strict=True):
        if each.safe_bound is not None:
            value = float(promised.removeprefix(f"{each.side} "))
            assert value <= each.safe_bound if each.side == "at least" else value >= each.safe_bound
            seen += value != float(f"{each.safe_bound:.4g}")
    assert seen, "the nearest number of four digits would be on the wrong side"


def test_nothing_is_promised_of_a_run_that_was_changed(run: fk.Run) -> None:
    changed = replace(run, fidelity=replace(run.fidelity, changed=True))
    assert OTHER_RUN in certificates_table(changed)
    assert "data-name" not in certificates_table(changed)


def test_the_claims_of_a_paper_and_of_all_are_counted_by_what_was_found() -> None:
    refuted = claim(Basis.COUNTEREXAMPLE, Verdict.FAILS)
    of_proofs = [judged(verdicts, claim()) for verdicts in ("hhhhh", "fffff", "hhhhf", "hh", "hhhh?")]
    judgements = [*of_proofs, judged("fffff", refuted), judged("hhhhhf", claim(Basis.OBSERVATION))]
    found = Reproduction({"s": judgements})
    article = SimpleNamespace(
        scenarios=lambda: {"s": None}, title_of=lambda name: "A title", short_citation="Author 2026", title="A paper"
    )
    text = _summary(found, {"key": article})  # type: ignore[dict-item]
    row = dict(re.findall(r'<td class="count" data-name="([^"]+)">(\d+)</td>', text))
    assert row == {
        "claims": "7", "hold": "1", "fail": "3", "observed": "1", "undecided": "2", "as expected": "2",
        "false statements": "0", "misprints": "0", "ambiguous or missing": "0", "own questions": "0",
    }  # fmt: skip
    boxes = re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", text.split("<table")[0]))
    for words in ("7 claims judged", "1 hold", "3 fail", "1 observed, with a rate", "2 undecided"):
        assert f" {words} " in boxes
