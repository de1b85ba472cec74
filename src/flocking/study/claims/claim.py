"""Claims: a hypothesis and a conclusion about a run, each measured, and the verdict that follows."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from flocking.model.law import Scenario
from flocking.study.claims.subjects import About, Finder, Subject, about_of
from flocking.study.evidence import Evidence, NotMeasurable, NotResolvable

OF_THEIR_OWN = frozenset({Subject.LEDGER, Subject.CLOSEST})
"""Subjects whose measures have errors of their own, or state that they are not known. Others are of the motion as it
was computed, unless their measure is declared `flocking.study.claims.subjects.About.with_errors`."""

UNCOMPUTED = "could not be computed"
"""How the note of a claim begins whose computation failed for the numbers of a run."""


class Verdict(StrEnum):
    """The possible outcomes of a claim."""

    HOLDS = "holds"
    FAILS = "fails"
    HYPOTHESIS_NOT_MET = "hypothesis not met"
    NOT_APPLICABLE = "not applicable"
    NOT_RESOLVED = "not resolved"
    NOT_YET = "not yet"
    UNTESTED = "untested"
    OBSERVED = "observed"


class Origin(StrEnum):
    """Who states a claim."""

    PAPER = "stated by the paper"
    ASSUMPTION = "assumed by the paper"
    OWN = "own question"


class Basis(StrEnum):
    """What the expected verdict of a claim rests on; never on runs that it is judged by."""

    GENERAL = "asked of any law"
    PROOF = "proof"
    COUNTEREXAMPLE = "counter-example"
    OBSERVATION = "observation"


@dataclass(frozen=True)
class Measure:
    """A measured statement: it holds when its margin is positive.

    Parameters
    ----------
    margin
        How far the measured value is inside its bound; negative when outside. Its unit is the statement's.
    error
        Numerical error that bounds the margin: a margin smaller than it decides nothing.
    note
        The measured value in words.
    unsettled
        Of a statement about a limit, why this run is too short to show or refute it; empty when it is not.
    everywhere
        Whether the statement is about all times of the run, so that samples can refute it but not show it. False for
        what one time decides.
    somewhere
        Whether it is about the existence of a time, so that samples can show it but not refute it.
    decided
        Time after which the motion cannot change the result; the end of the run for most.
    as_computed
        Whether it is about the motion as it was computed, of whose errors nothing is known.
    conserved
        Whether it is of a quantity that every motion under the law keeps: that it was kept needs no error.
    absent
        Where the margin is infinite as the motion shows nothing of what is measured, such as a linked pair: by how much
        it misses showing it, in the unit of positions. Another motion within the error may show it. None elsewhere.
    """

    margin: float
    error: float = 0.0
    note: str = ""
    unsettled: str = ""
    everywhere: bool = True
    somewhere: bool = False
    decided: float = math.inf
    as_computed: bool = False
    conserved: bool = False
    absent: float | None = None

    @property
    def holds(self) -> bool | None:
        """True or false, or None when the margin is within the error or not a number."""
        if math.isnan(self.margin) or not math.isfinite(self.error) or abs(self.margin) < self.error:
            return None
        return self.margin > 0

    @property
    def opposite(self) -> Measure:
        """The measure of the contrary statement."""
        return replace(self, margin=-self.margin, everywhere=self.somewhere, somewhere=self.everywhere)


def below(value: float, bound: float, note: str, error: float = 0.0) -> Measure:
    """A measure that holds when ``value < bound``."""
    return Measure(bound - value, error, note)


def above(value: float, bound: float, note: str, error: float = 0.0) -> Measure:
    """A measure that holds when ``value > bound``."""
    return Measure(value - bound, error, note)


def happens(measured: Measure) -> Measure:
    """The measure of a statement about some time of the run, from what was ``measured`` at that time."""
    return replace(measured, everywhere=False, somewhere=True)


def _with_errors_of_motion(measured: Measure, e: Evidence, conclusion: Callable[[Evidence], Measure]) -> Measure:
    """What was ``measured`` by a ``conclusion``, with the error of the motion where the run states none.

    It is estimated where the run can be repeated more accurately, see `flocking.study.evidence.repetitions`, and is
    unknown elsewhere. In discrete time, where no step is integrated and only rounding grows, a conclusion is then one
    about the motion as it was computed.
    """
    kept = measured.conserved and measured.holds
    structural = math.isinf(measured.margin) and measured.absent is None
    if not e.motion_unstated or structural or kept:
        return measured
    if measured.unsettled:
        # No error decides what the run is too short for: it is not estimated, and none is not zero.
        return replace(measured, error=math.nan)
    try:
        repetitions = e.repetitions
        again = [conclusion(type(e)(run)) for run in repetitions.runs]
    except (NotMeasurable, NotResolvable) as reason:
        why = f": {reason}" if isinstance(reason, NotResolvable) and str(reason) else ""
        if e.in_discrete_time:
            note = f"{measured.note}; so of the motion as computed, whose rounding errors are not estimated{why}"
            return replace(measured, as_computed=True, note=note)
        return replace(measured, error=math.nan, note=f"{measured.note}; the error of the motion is not estimated{why}")
    if any(one.unsettled for one in again):
        return replace(measured, error=math.nan, note=f"{measured.note}; more accurate runs leave it unsettled")
    margins = [one.margin for one in again]
    note = f"{measured.note}; {repetitions.note}"
    if measured.absent is None or any(margin != measured.margin for margin in margins):
        return replace(measured, error=measured.error + repetitions.error(measured.margin, margins), note=note)
    if measured.absent == math.inf:
        return replace(measured, note=note)
    off = repetitions.error(measured.absent, [math.nan if one.absent is None else one.absent for one in again])
    if measured.absent > off:
        return replace(measured, note=note)
    missed = f"by {measured.absent:.1e} alone, with an error of {off:.1e}"
    if not measured.absent > 0.0:
        missed = "as far as frames show, a pair may have been within the radius"
    return replace(measured, error=math.nan, note=f"{note}; {missed}")


def granted(_: Evidence) -> Measure:
    """The empty hypothesis."""
    return Measure(math.inf, 0.0, "no hypothesis", everywhere=False)


def _everywhere(_: Evidence) -> str:
    return ""


@dataclass(frozen=True)
class Claim:
    """A statement about every run of a law, taken from a theorem or true of any law.

    Parameters
    ----------
    key
        Short name, unique within its paper.
    source
        Where it is stated, for example ``"Theorem VI.2"``.
    statement
        The statement in one sentence.
    conclusion
        Measures the conclusion on the evidence of a run.
    hypothesis
        Measures the hypothesis; none by default.
    obstacle
        Gives the reason why the claim does not apply to a run; empty when it applies.
    setting
        Gives the reason why a run is not of the agents, the space or the world that the theorem is about; empty
        when it is. Else the hypothesis is not met, and the conclusion, unless about energies, is measured beside it.
    expected
        The verdict that follows from the ground; see ``basis``.
    reason
        Why the expected verdict is not ``holds``, where it is not.
    dynamic
        Whether the claim rests on the computed motion: then a ledger that does not close leaves it unresolved.
    origin
        Whether the paper states it, assumes it, or it is a question of our own that the paper does not answer. A
        failure of the last two does not contradict the paper.
    basis
        What the expected verdict rests on. An observation has no expected verdict but a rate over many seeds.
        Claims of papers never have `Basis.GENERAL`.
    ground
        The proof or the theorem in a few words, for a basis of `Basis.PROOF`.
    counterexample
        Makes a scenario that refutes the claim, for a basis of `Basis.COUNTEREXAMPLE`: one is enough.
    subject
        What it is about; that of the conclusion when absent, see `flocking.study.claims.subjects.about`.
    witness
        Finds the time and the agents of a failure; that of the conclusion when absent.
    lasting
        Whether a failure is final; else it is pending until the end of the run. That of the conclusion when absent.

    Raises
    ------
    ValueError
        When basis, expected verdict, ground and counter-example do not go together.
    """

    key: str
    source: str
    statement: str
    conclusion: Callable[[Evidence], Measure]
    hypothesis: Callable[[Evidence], Measure] = granted
    obstacle: Callable[[Evidence], str] = _everywhere
    setting: Callable[[Evidence], str] = _everywhere
    expected: Verdict = Verdict.HOLDS
    reason: str = ""
    dynamic: bool = True
    origin: Origin = Origin.PAPER
    basis: Basis = Basis.GENERAL
    ground: str = ""
    counterexample: Callable[[], Scenario] | None = None
    subject: Subject | None = None
    witness: Finder | None = None
    lasting: bool | None = None

    def __post_init__(self) -> None:
        if (self.basis is Basis.PROOF) != bool(self.ground):
            raise ValueError(f"{self.key}: a ground goes with the basis PROOF, and with no other")
        refuted = self.basis is Basis.COUNTEREXAMPLE
        if refuted != (self.counterexample is not None) or (refuted and self.expected is not Verdict.FAILS):
            raise ValueError(f"{self.key}: the basis COUNTEREXAMPLE needs a counterexample and expected=FAILS")

    @property
    def about(self) -> About:
        """Subject, witness and finality of the claim."""
        found = about_of(self.conclusion)
        lasting = found.lasting if self.lasting is None else self.lasting
        return replace(
            found, subject=self.subject or found.subject, witness=self.witness or found.witness, lasting=lasting
        )

    @property
    def stated(self) -> Origin | Basis:
        """Who states it; a claim that is asked of any law no paper states."""
        return self.basis if self.basis is Basis.GENERAL and self.origin is Origin.PAPER else self.origin

    @property
    def expectation(self) -> str:
        """The expected verdict in words; an observation has none."""
        return "observation" if self.basis is Basis.OBSERVATION else str(self.expected)

    def examine(self, evidence: Evidence) -> Result:
        """Judge the claim by the evidence of one run; what cannot be computed from its numbers is not resolved."""
        try:
            with np.errstate(all="ignore"):
                return self._examined(evidence)
        except NotMeasurable as reason:
            return Result(self, Verdict.NOT_APPLICABLE, note=str(reason))
        except NotResolvable as reason:
            return Result(self, Verdict.NOT_RESOLVED, note=str(reason))
        except (ArithmeticError, LookupError, ValueError) as fault:
            return Result(self, Verdict.NOT_RESOLVED, note=f"{UNCOMPUTED}: {type(fault).__name__}: {fault}")

    def _examined(self, evidence: Evidence) -> Result:
        if reason := self.obstacle(evidence):
            return Result(self, Verdict.NOT_APPLICABLE, note=reason)
        if reason := self.setting(evidence):
            # In most other settings energies are not those of the forces that act.
            alone = None if self.about.subject is Subject.LEDGER else self.unconditional.examine(evidence)
            return Result(self, Verdict.HYPOTHESIS_NOT_MET, -1.0, 0.0, reason, alone)
        hypothesis = self.hypothesis(evidence)
        if (doubt := self._undecided_by_samples(evidence, hypothesis)) or hypothesis.holds is not True:
            unknown = doubt or hypothesis.holds is None
            verdict = Verdict.NOT_RESOLVED if unknown else Verdict.HYPOTHESIS_NOT_MET
            return Result(self, verdict, hypothesis.margin, hypothesis.error, _joined(hypothesis.note, doubt))
        explained = not self.dynamic or evidence.ledger_closes
        measured = self.conclusion(evidence)
        if not explained:
            return Result(self, Verdict.NOT_RESOLVED, measured.margin, math.inf, evidence.ledger_note)
        if self.dynamic and (self._reads_motion(evidence) or evidence.in_discrete_time):
            measured = _with_errors_of_motion(measured, evidence, self.conclusion)
        verdict, doubt = self._verdict(evidence, measured, hypothesis.unsettled or measured.unsettled)
        error = math.nan if measured.as_computed else measured.error
        return Result(self, verdict, measured.margin, error, _joined(measured.note, doubt))

    def _reads_motion(self, e: Evidence) -> bool:
        """Whether the error of the motion adds to that of the measure.

        Closest approaches of fixed steps bound what happens between two of them, not where agents are.
        """
        of_motion = self.about.subject not in OF_THEIR_OWN and not self.about.with_errors
        return of_motion or (self.about.subject is Subject.CLOSEST and e.fixed_step)

    @property
    def unconditional(self) -> Claim:
        """The conclusion by itself: of any run, without the hypothesis."""
        return replace(self, setting=_everywhere, hypothesis=granted)

    def _verdict(self, e: Evidence, measured: Measure, unsettled: str) -> tuple[Verdict, str]:
        """The verdict that a measured conclusion allows, and the doubt that remains."""
        if self.dynamic and measured.decided >= e.known_until < math.inf:
            return Verdict.NOT_RESOLVED, e.loss_note
        if unsettled:
            return Verdict.NOT_YET, unsettled
        if measured.holds is None:
            return Verdict.NOT_RESOLVED, ""
        if doubt := self._undecided_by_samples(e, measured):
            return Verdict.NOT_RESOLVED, doubt
        ahead = e.before_the_end if self.dynamic else ""
        if not measured.holds:
            return (Verdict.NOT_YET, ahead) if ahead and not self.about.lasting else (Verdict.FAILS, "")
        if ahead and (e.ended_early or self.about.at_end):
            return Verdict.NOT_YET, ahead
        if self.dynamic and (foreign := self._foreign(e)):
            return Verdict.NOT_RESOLVED, foreign
        return Verdict.HOLDS, ""

    def _foreign(self, e: Evidence) -> str:
        """What contradicts, at a frame, the records on which the conclusion rests between frames."""
        if self.about.subject is Subject.CLOSEST:
            return e.foreign_approach
        return e.foreign_switches if self.about.subject in (Subject.CONNECTIVITY, Subject.LINKS) else ""

    def _undecided_by_samples(self, e: Evidence, measured: Measure) -> str:
        """Why samples do not decide what was measured at them; empty where they do."""
        beyond = measured.everywhere if measured.holds else measured.somewhere
        decides = not e.sampled or not self.dynamic or not beyond
        return "" if decides else f"so at {len(e.run.t)} samples, nothing is known between"


def _joined(note: str, doubt: str) -> str:
    return f"{note}; {doubt}" if note and doubt else note or doubt


@dataclass(frozen=True, repr=False)
class Result:
    """Verdict on one claim for one run.

    Parameters
    ----------
    claim
        The claim.
    verdict
        What came out.
    margin, error
        Margin of the conclusion (or of a hypothesis that is not met) and the numerical error that bounds it.
    note
        The measured value in words, or why there is none.
    conclusion
        What the run shows of the conclusion by itself, where it is not of the setting of the theorem; see
        `Claim.setting`. No theorem promises it.
    """

    claim: Claim
    verdict: Verdict
    margin: float = math.nan
    error: float = math.nan
    note: str = ""
    conclusion: Result | None = None

    def __repr__(self) -> str:
        """In one line: the claim, the verdict, and what was measured."""
        return f"<Result {self.claim.key}: {self.verdict}{f', {self.words}' if self.words else ''}>"

    @property
    def words(self) -> str:
        """The note, and what the run shows of the conclusion by itself where that was measured."""
        if (alone := self.conclusion) is None:
            return self.note
        return f"{self.note}; the conclusion by itself: {alone.verdict}{f' ({alone.note})' if alone.note else ''}"

    @property
    def as_expected(self) -> bool:
        """Whether the verdict does not contradict what is expected of every run.

        A run that does not refute a claim does not contradict a counter-example, and an observation has no expected
        verdict.
        """
        binding = self.claim.basis in (Basis.GENERAL, Basis.PROOF)
        return not binding or self.verdict == self.claim.expected

    def as_dict(self) -> dict[str, object]:
        """Plain data for JSON; numbers that are not finite become None."""
        return {
            "claim": self.claim.key,
            "source": self.claim.source,
            "origin": str(self.claim.stated),
            "statement": self.claim.statement,
            "expected": self.claim.expectation,
            **self.measured(),
            **({} if self.conclusion is None else {"conclusion": self.conclusion.measured()}),
        }

    def measured(self) -> dict[str, object]:
        """Verdict, margin, error and note as plain data for JSON; numbers that are not finite become None."""
        return {
            "verdict": str(self.verdict),
            "margin": finite(self.margin),
            "error": finite(self.error),
            "note": self.note,
        }


def finite(value: float) -> float | None:
    """The value, or None where it is not finite and JSON cannot hold it."""
    return float(value) if math.isfinite(value) else None
