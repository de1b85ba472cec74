"""Mutation tests of the claims on the systems of the papers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from flocking.engine.driver.simulate import simulate
from flocking.engine.driver.waits import Wait, counted
from flocking.engine.runs.run import Run
from flocking.model.law import Scenario
from flocking.papers import paper
from flocking.papers.auditing import paper_claims
from flocking.study.claims.audit import audit
from flocking.study.claims.claim import Verdict
from flocking.study.mutants import MUTATIONS, coarse_step, mutated_run
from flocking.study.trajectory import run_from_samples

SAMPLES = 2001
"""Number of frames of a run of a mutant."""


@dataclass(frozen=True)
class Caught:
    """Result of the audit of a mutant.

    Parameters
    ----------
    mutant
        Name of the mutant.
    scenario
        The scenario that was declared.
    truth
        Claims that hold for the correct system with the same frames.
    fails, unresolved
        Claims that hold for the correct system and fail, or are not resolved, for the mutant.
    """

    mutant: str
    scenario: str
    truth: tuple[str, ...]
    fails: tuple[str, ...]
    unresolved: tuple[str, ...]

    @property
    def caught(self) -> bool:
        """Whether a claim that holds for the correct system fails for the mutant."""
        return bool(self.fails)


def declared(name: str, key: str, t_end: float) -> Scenario:
    """A paper's scenario with an earlier end and more frames.

    Parameters
    ----------
    key
        Key of the paper.
    t_end
        End of the scenario.
    """
    scenario: Scenario = paper(key).scenarios()[name](0)
    return scenario.with_(t_end=t_end, frames=SAMPLES)


CASES: dict[str, tuple[str, str, float]] = {
    "flipped sign": ("tanner-2003-fixed", "tanner-2003-fixed", 4.0),
    "gain halved": ("tanner-2003-dynamic", "tanner-2003-dynamic", 10.0),
    "dropped link": ("tanner-2003-fixed", "tanner-2003-fixed", 10.0),
    "late switch": ("tanner-2003-dynamic", "tanner-2003-dynamic", 10.0),
    "coarse step": ("tanner-2003-dynamic", "tanner-2003-dynamic", 10.0),
    "broken symmetry": ("shi-2009-uniform", "shi-2009", 10.0),
    "swapped obstacle velocity": ("olfati-saber-2003", "olfati-saber-2003", 14.0),
    "wrong mass": ("shi-2009-uniform", "shi-2009", 10.0),
    "flipped sign, all pairs": ("cucker-smale-2007", "cucker-smale-2007", 2.0),
    "gain halved, all pairs": ("cucker-smale-2007", "cucker-smale-2007", 10.0),
    "wrong exponent": ("cucker-smale-2007-sharp", "cucker-smale-2007", 10.0),
    "gain halved, smooth net": ("olfati-saber-2006-gentle", "olfati-saber-2006", 10.0),
    "late switch, smooth net": ("olfati-saber-2006-gentle", "olfati-saber-2006", 10.0),
    "plain distances": ("olfati-saber-2006-gentle", "olfati-saber-2006", 10.0),
}
"""For each mutant the scenario, its paper and the duration. A word after a comma distinguishes uses of one mutation."""


def catch(mutant: str) -> Caught:
    """Run one mutant and the correct system, and check both against the declared law.

    Parameters
    ----------
    mutant
        One of `CASES`.
    """
    name, key, t_end = CASES[mutant]
    scenario = declared(name, key, t_end)
    right = _right_verdicts(name, key, t_end)
    wrong = _verdicts(_mutant_run(mutant, scenario), name)
    truth = tuple(k for k, v in right.items() if v == Verdict.HOLDS)
    return Caught(
        mutant, name, truth,
        tuple(k for k in truth if wrong[k] == Verdict.FAILS),
        tuple(k for k in truth if wrong[k] == Verdict.NOT_RESOLVED),
    )  # fmt: skip


@cache
def _right_verdicts(name: str, key: str, t_end: float) -> dict[str, Verdict]:
    """Verdicts on the right system, which several mutants share."""
    return _verdicts(_right_run(declared(name, key, t_end)), name)


def _right_run(scenario: Scenario) -> Run:
    run = simulate(scenario, progress=False)
    return run_from_samples(scenario, run.t, run.q, run.p)


def _mutant_run(mutant: str, scenario: Scenario) -> Run:
    if mutant == "coarse step":
        return coarse_step(scenario, 0.05)
    return mutated_run(scenario, MUTATIONS[mutant.partition(",")[0]])


def _verdicts(run: Run, name: str) -> dict[str, Verdict]:
    claims = paper_claims(name)
    return {f"paper: {r.claim.key}": r.verdict for r in audit(run, claims).results} | {
        r.claim.key: r.verdict for r in audit(run).results
    }


def table(mutants: Callable[[], tuple[str, ...]] | None = None) -> list[Caught]:
    """All mutants, one row each."""
    with Wait("mutants"):
        return [catch(name) for name in counted(mutants() if mutants else tuple(CASES), "mutants")]


__all__ = ["CASES", "Caught", "catch", "declared", "table"]
