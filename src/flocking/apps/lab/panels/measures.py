"""Contents of the measurement panel: numbers of one moment, and verdicts on claims."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from flocking.arrays import Array
from flocking.engine.runs.run import LedgerRow, Run
from flocking.errors import FlockingError
from flocking.formula.safe_digits import rounded_up
from flocking.model import observables
from flocking.model.space import OPEN, Space
from flocking.model.state import State
from flocking.papers.auditing import paper_claims
from flocking.study.certificates.beside.guaranteed_claims import WITH_GUARANTEE, guarantee_of
from flocking.study.certificates.certificate import Certificate, Certificates
from flocking.study.certificates.certify import certify
from flocking.study.claims import general_claims as general
from flocking.study.claims.claim import Claim, Result, Verdict
from flocking.study.claims.subjects import Subject
from flocking.study.claims.witnesses import Witness, witness_of
from flocking.study.evidence import Evidence

MOST_CONNECTIVITY = 400
"""Agents up to which the algebraic connectivity is computed: the cost of its eigenvalues grows with the cube of their
number."""
MOST_CERTIFIED = 60
"""Agents up to which certificates are computed beside verdicts: all pairs are looked at, which takes about a second."""
MOST_CLAIMS = 400
"""Largest group whose claims are judged: the cost grows with the number of pairs."""

LEDGER = ("dissipated", "supplied", "jumped", "departed", "residual")
"""Terms of the ledger since the last intervention, and the residual of the change of the energy."""

NAMES = ("energy", "velocity spread", "connectivity", "flocks", "closest pair", "defect")


def measured(
    state: State, energy: float, space: Space = OPEN, *, velocities: bool = True, masses: Array | float = 1.0
) -> dict[str, float]:
    """Numbers of one moment by their `NAMES`; NaN for what a group is too large for, or does not have.

    ``defect`` is the relative standard deviation of linked distances.

    Parameters
    ----------
    energy
        Energy of the scenario at that moment.
    space
        The space of the agents.
    velocities
        Whether agents have velocities of their own: states of agents of order 1 hold zeros in their place.
    masses
        Mass of each agent, or of all.
    """
    found = dict.fromkeys(NAMES, float("nan"))
    found["energy"] = energy
    if velocities:
        found["velocity spread"] = observables.velocity_spread(state, masses)
    found["closest pair"] = observables.closest_pair(state, space)[0]
    if state.links is None:
        return found
    found["flocks"] = float(observables.flocks(state.links))
    if 1 < state.n <= MOST_CONNECTIVITY:
        from flocking.study.nets.matrices import algebraic_connectivity

        net = state.links | state.links.T
        # Rounding leaves some 1e-15 of the eigenvalue of a net that is apart, which a page would show as a number.
        found["connectivity"] = 0.0 if observables.flocks(net) > 1 else algebraic_connectivity(net)
    found["defect"] = observables.link_length_deviation(state.q, state.links, space)
    return found


def ledger(first: tuple[float, ...], last: tuple[float, ...]) -> dict[str, float]:
    """Changes between two rows of a ledger, by `LEDGER`.

    Parameters
    ----------
    first, last
        The two rows, fields `TRACE_FIELDS`.
    """
    before, after = LedgerRow(*first), LedgerRow(*last)
    change = LedgerRow(*(b - a for a, b in zip(before, after, strict=True)))
    residual = change.energy + change.dissipated - change.supplied - change.jumped - change.departed
    return dict(
        zip(LEDGER, (change.dissipated, change.supplied, change.jumped, change.departed, residual), strict=True)
    )


@dataclass(frozen=True)
class ShownVerdict:
    """A claim with its verdict, as a page shows it.

    Parameters
    ----------
    claim
        The claim.
    word
        Its verdict; also ``"not yet"`` for a failure that is not final, before the end of the scenario.
    note
        The measured value.
    witness
        Time and agents of a failure, where there are any.
    guarantee
        The certificate that proves the claim of the motion from the last intervention on, where there is one.
    running
        Whether the motion goes on, so that what holds and is not guaranteed holds so far.
    margin
        How far the measured value is inside its bound, in its own unit; not a number where there is none.
    """

    claim: Claim
    word: str
    note: str
    witness: Witness | None = None
    guarantee: Certificate | None = None
    running: bool = False
    margin: float = float("nan")

    @property
    def lamp(self) -> str:
        """The verdict in words: what holds is guaranteed, or is not and holds so far."""
        if self.guarantee is not None and self.word in WITH_GUARANTEE:
            return "guaranteed" if self.word == "holds" else f"{self.word}, guaranteed"
        if self.word == "holds" and self.running and self.claim.about.lasting:
            return "not guaranteed, holds so far"
        return self.word

    @property
    def style(self) -> str:
        """How a page shows it, by shape and colour: a verdict, or that the failure was expected."""
        if self.word == str(self.claim.expected) == "fails":
            return "known to fail"
        return self.word


def claims_of(scenario_name: str) -> tuple[Claim, ...]:
    """The paper's claims about its scenario, then the general ones with other keys.

    General claims about agreement get the hypothesis of the theorems, that the graph stays connected.

    Parameters
    ----------
    scenario_name
        Name of the scenario.
    """
    found = paper_claims(scenario_name) or ()
    known = {c.key for c in found}
    return (*found, *(_conditional(c) for c in general.GENERAL if c.key not in known))


def _conditional(claim: Claim) -> Claim:
    if not claim.about.while_connected:
        return claim
    statement = f"While the graph stays connected, {claim.statement[0].lower()}{claim.statement[1:]}"
    return replace(claim, statement=statement, hypothesis=general.stays_connected)


def guarantees_of(run: Run, *, untouched: bool = True) -> Certificates | None:
    """What is guaranteed of the motion from the first frame of a run on; None for groups that are too large.

    None, too, from a later frame or an intervention on where forces are held or messages are on their way: a state does
    not contain these.

    Parameters
    ----------
    run
        The run, whose law did not change.
    untouched
        Whether the run is that of its scenario from the start, without any intervention.
    """
    if run.n > MOST_CERTIFIED or not len(run.t):
        return None
    scenario = run.scenario
    from_start = untouched and run.t[0] <= scenario.start.t
    if not from_start and not (scenario.control.ideal and scenario.information.ideal):
        return None
    try:
        return certify(
            run.scenario.with_(start=run.state(0), t_end=max(run.scenario.t_end, float(run.t[-1])), frames=2)
        )
    except FlockingError:
        # The state cannot be the start of a scenario, for example since the run goes on beyond its end.
        return None


def verdicts_on(run: Run, claims: Sequence[Claim], guarantees: Certificates | None = None) -> list[ShownVerdict]:
    """Verdicts on a running run. A claim that cannot be measured on it is not applicable.

    Parameters
    ----------
    run
        The run.
    claims
        The claims.
    guarantees
        What is guaranteed of it, as `guarantees_of` gives it.
    """
    evidence = Evidence(run)
    found = []
    for claim in claims:
        try:
            result = _since_the_beginning(claim.examine(evidence), evidence)
            witness = witness_of(result, evidence)
        except Exception as error:  # claims of papers read their own laws, which may be changed
            result, witness = Result(claim, Verdict.NOT_APPLICABLE, note=f"{type(error).__name__}: {error}"), None
        proof = None if guarantees is None else guarantee_of(claim, guarantees, run.scenario)
        word = _word(claim, result.verdict, run)
        going = run.status == "running"
        found.append(ShownVerdict(claim, word, _note(result), witness, proof, going, float(result.margin)))
    return found


def _since_the_beginning(result: Result, e: Evidence) -> Result:
    """A verdict on the motion since an intervention, which a session's closest approach may precede.

    Agents have come no closer since, so that what holds does; what fails may have failed before alone.
    """
    about = result.claim.about
    decided = result.verdict in (Verdict.HOLDS, Verdict.FAILS)
    if about.subject is not Subject.CLOSEST or about.witness is None or not decided:
        return result
    if not about.witness(e).time < e.run.t[0]:
        return result
    if result.verdict is Verdict.HOLDS:
        return replace(result, note=f"{result.note}, before the last intervention; no closer since")
    return replace(result, verdict=Verdict.NOT_RESOLVED, note=f"{result.note}, which was before the last intervention")


def _note(result: Result) -> str:
    """What was measured, and how well where the error leaves the verdict open."""
    left_open = result.verdict is Verdict.NOT_RESOLVED and abs(result.margin) <= result.error < math.inf
    return f"{result.note}, known to within {rounded_up(result.error, 2)}" if left_open else result.words


def _word(claim: Claim, verdict: Verdict, run: Run) -> str:
    """The verdict; "not yet" for a failure that is not final, before the end of the scenario."""
    if verdict is not Verdict.FAILS or claim.about.lasting:
        return str(verdict)
    return str(Verdict.NOT_YET if run.t[-1] < run.scenario.t_end else verdict)
