"""What the panel of measurements shows: numbers of one moment, and the verdicts on claims."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flocking.engine.runs.run import Run
from flocking.model import observables
from flocking.model.state import State
from flocking.papers.auditing import paper_claims
from flocking.study.claims import general_claims as general
from flocking.study.claims.claim import Claim, Result, Verdict
from flocking.study.claims.witnesses import Witness, witness_of
from flocking.study.evidence import Evidence

MOST_CONNECTIVITY = 400
"""Agents up to which the algebraic connectivity is computed: the cost of its eigenvalues grows with the cube of their
number."""
MOST_CLAIMS = 400
"""Larger groups get no algebraic connectivity and no lamps: both look at every pair."""

LEDGER = ("dissipated", "supplied", "jumped", "residual")
"""What the energy did since the last intervention: `residual` is what the others leave unexplained of its change."""

NAMES = ("energy", "velocity spread", "connectivity", "flocks", "closest pair", "defect")


def measured(state: State, energy: float) -> dict[str, float]:
    """Numbers of one moment by their `NAMES`; NaN for what a group is too large for.

    ``defect`` is how far linked distances are from their mean, relatively.

    Parameters
    ----------
    energy
        Energy of the scenario at that moment.
    """
    found = dict.fromkeys(NAMES, float("nan"))
    found |= {"energy": energy, "velocity spread": observables.velocity_spread(state)}
    found["closest pair"] = observables.closest_pair(state)[0]
    if state.links is None:
        return found
    found["flocks"] = float(observables.flocks(state.links))
    if 1 < state.n <= MOST_CONNECTIVITY:
        from flocking.study.nets.matrices import algebraic_connectivity

        found["connectivity"] = algebraic_connectivity(state.links | state.links.T)
    i, j = np.nonzero(np.triu(state.links | state.links.T))
    if len(i):
        r = np.linalg.norm(state.q[i] - state.q[j], axis=1)
        found["defect"] = float(np.sqrt(np.mean((r / r.mean() - 1) ** 2))) if r.mean() > 0 else 0.0
    return found


def ledger(first: tuple[float, ...], last: tuple[float, ...]) -> dict[str, float]:
    """What the energy did between two rows of a ledger, by `LEDGER`.

    Parameters
    ----------
    first, last
        The two rows, fields `TRACE_FIELDS`.
    """
    _, energy, _, _, dissipated, supplied, jumped = (b - a for a, b in zip(first, last, strict=True))
    return dict(zip(LEDGER, (dissipated, supplied, jumped, energy + dissipated - supplied - jumped), strict=True))


@dataclass(frozen=True)
class Lamp:
    """A claim with its verdict, as a page shows it.

    Parameters
    ----------
    claim
        The claim.
    word
        Its verdict; ``"not yet"`` also of what a paper says of the end of its scenario, before that end.
    note
        What was measured.
    witness
        The moment and agents that broke it, where something did.
    """

    claim: Claim
    word: str
    note: str
    witness: Witness | None = None

    @property
    def color(self) -> str:
        """Green, red, orange while open, grey where it does not apply."""
        if self.word == str(self.claim.expected) == "fails":
            return "teal"  # the paper is known to be wrong there
        return {"holds": "green", "fails": "red", "hypothesis not met": "violet", "not yet": "orange"}.get(
            self.word, "gray"
        )


def claims_of(scenario_name: str) -> tuple[Claim, ...]:
    """The paper's claims about its scenario, then the general ones that these do not name already.

    Of the general ones agreement is claimed as the theorems do: of a graph that stays connected.

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


def lamps(run: Run, claims: Sequence[Claim]) -> list[Lamp]:
    """Verdicts on a run that goes on. A claim that cannot be measured on it is said to be not applicable."""
    evidence = Evidence(run)
    found = []
    for claim in claims:
        try:
            result = claim.examine(evidence)
            witness = witness_of(result, evidence)
        except Exception as error:  # claims of papers look at their own laws, and a law may be changed at will
            result, witness = Result(claim, Verdict.NOT_APPLICABLE, note=f"{type(error).__name__}: {error}"), None
        found.append(Lamp(claim, _word(claim, result.verdict, run), result.note, witness))
    return found


def _word(claim: Claim, verdict: Verdict, run: Run) -> str:
    """The verdict, or that it is too early for one: a paper speaks of the end of its scenario."""
    if verdict is not Verdict.FAILS or claim.about.lasting:
        return str(verdict)
    return str(Verdict.NOT_YET if run.t[-1] < run.scenario.t_end else verdict)
