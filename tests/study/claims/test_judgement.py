"""One claim over many seeds: a counter-example refutes, an observation has a rate, nothing is surer than its seeds."""

from __future__ import annotations

import math

import pytest

from flocking.study.claims.claim import Basis, Claim, Measure, Result, Verdict
from flocking.study.claims.judgement import FEWEST_SEEDS, Judgement


def claim(basis: Basis = Basis.PROOF, expected: Verdict = Verdict.HOLDS) -> Claim:
    return Claim(
        "key", "source", "Statement.", lambda _: Measure(1.0), expected=expected, basis=basis,
        ground="a proof" if basis is Basis.PROOF else "",
        counterexample=(lambda: None) if basis is Basis.COUNTEREXAMPLE else None,
    )  # fmt: skip


def judged(verdicts: str, of: Claim, counterexample: str = "") -> Judgement:
    """Verdicts by letter: holds, fails, unmet hypothesis, not resolved (?), not yet."""
    letters = {
        "h": Verdict.HOLDS, "f": Verdict.FAILS, "u": Verdict.HYPOTHESIS_NOT_MET, "?": Verdict.NOT_RESOLVED,
        "y": Verdict.NOT_YET,
    }  # fmt: skip
    results = tuple(Result(of, letters[v], margin=1.0 if v == "h" else -1.0) for v in verdicts)
    refuted = Result(of, letters[counterexample]) if counterexample else None
    return Judgement(of, results, refuted)


@pytest.mark.parametrize(
    ("verdicts", "found"),
    [("hhhhh", "holds"), ("hhhhhf", "fails"), ("hhhhy", "not yet"), ("hhhh?", "not resolved"), ("hhhhy?f", "fails"),
     ("hhhhuuuu", "untested"), ("hhhhhuuuu", "holds"), ("hhhhhh??yu", "holds"), ("hhhhh?f", "fails"),
     ("hhhhuu??", "not resolved"), ("hhyyyy", "not yet"), ("??????", "not resolved")],
)  # fmt: skip
def test_of_a_statement_about_all_runs(verdicts: str, found: str) -> None:
    assert judged(verdicts, claim()).verdict == found


def test_one_counter_example_refutes_whatever_the_seeds_say() -> None:
    refuted = claim(Basis.COUNTEREXAMPLE, Verdict.FAILS)
    found = judged("hhhhhhhhhh", refuted, "f")
    assert found.verdict == Verdict.FAILS
    assert found.as_expected
    assert found.worst is found.counterexample
    assert found.as_dict("p", "s")["seeds"] == {
        "tried": 10,
        "met": 10,
        "decided": 10,
        "held": 10,
        "not_resolved": 0,
        "not_yet": 0,
    }
    assert not judged("hhhhhhhhhh", refuted, "h").as_expected


def test_an_observation_has_a_rate_and_no_verdict_of_its_own() -> None:
    found = judged("hhhhhhhhhf", claim(Basis.OBSERVATION))
    assert found.verdict == Verdict.OBSERVED
    assert found.as_expected
    share, low, high = found.rate
    assert share == 0.9
    # Clopper and Pearson for 9 of 10.
    assert (round(low, 4), round(high, 4)) == (0.5550, 0.9975)
    assert found.as_dict("p", "s")["expected"] == "observation"


def test_undecided_seeds_count_as_either_in_a_rate() -> None:
    """Five held, five have not settled: between 5 and 10 of 10, and Clopper and Pearson's ends of these."""
    from scipy.stats import beta

    found = judged("hhhhhyy?yyuu", claim(Basis.OBSERVATION))
    share, low, high = found.rate
    assert math.isnan(share)
    assert low == pytest.approx(beta.ppf(0.025, 5, 6))
    assert high == 1.0
    assert found.rate_text == "50 to 100 % (18 to 100)"
    less = judged("hhhffyy", claim(Basis.OBSERVATION))
    assert less.rate[1:] == (pytest.approx(beta.ppf(0.025, 3, 5)), pytest.approx(beta.ppf(0.975, 6, 2)))
    assert less.rate_text == "43 to 71 % (9 to 97)"
    assert found.as_dict("p", "s")["rate"]["held"] is None


def test_too_few_decided_seeds_leave_an_observation_untested() -> None:
    assert judged("h" * (FEWEST_SEEDS - 1) + "yy??", claim(Basis.OBSERVATION)).verdict == Verdict.UNTESTED
    assert math.isnan(judged("yyyyy", claim(Basis.OBSERVATION)).rate[0])


def test_basis_and_expected_verdict_go_together() -> None:
    with pytest.raises(ValueError, match="ground goes with"):
        Claim("key", "source", "Statement.", lambda _: Measure(1.0), basis=Basis.PROOF)
    with pytest.raises(ValueError, match="COUNTEREXAMPLE"):
        claim(Basis.COUNTEREXAMPLE, Verdict.HOLDS)


def test_what_is_asked_without_a_proof_is_open_while_one_run_is() -> None:
    asked = claim(Basis.GENERAL)
    assert judged("hhhhhhhh?", asked).verdict == Verdict.NOT_RESOLVED
    assert judged("hhhhhhhhy", asked).verdict == Verdict.NOT_YET
    assert judged("hhhhhhhhu", asked).verdict == Verdict.HOLDS
    assert judged("hhhhhhhh?", claim()).as_dict("p", "s")["seeds"]["not_resolved"] == 1
