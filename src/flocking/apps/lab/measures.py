"""What the instruments read: numbers of one moment, and the verdicts on claims."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flocking.engine.run import Run
from flocking.model import observables
from flocking.model.state import State
from flocking.papers.auditing import paper_claims
from flocking.study import general_claims as general
from flocking.study.claims import Claim, Result, Verdict
from flocking.study.culprits import Culprit, culprit
from flocking.study.evidence import Evidence

MOST_CONNECTIVITY = 400
MOST_CLAIMS = 400
"""Larger groups get no algebraic connectivity and no lamps: both look at every pair."""

NAMES = ("energy", "residual", "velocity spread", "connectivity", "flocks", "closest pair", "deviation")

_PENDING = frozenset(
    {general.velocities_agree, general.distances_settle, general.switching_stops, general.forces_vanish,
     general.potential_is_minimal, general.agents_at_their_minimum}
)  # fmt: skip
"""Conclusions about the end of a run: while it goes on they have not failed, they have not come true yet."""


def measured(state: State, energy: float, residual: float) -> dict[str, float]:
    """Numbers of one moment by their `NAMES`; NaN for what a group is too large for.

    ``deviation`` is how far linked distances are from their mean, relatively: the defect of a lattice.
    """
    found = dict.fromkeys(NAMES, float("nan"))
    found |= {"energy": energy, "residual": residual, "velocity spread": observables.velocity_spread(state)}
    found["closest pair"] = observables.closest_pair(state)[0]
    if state.links is None:
        return found
    found["flocks"] = float(observables.flocks(state.links))
    if 1 < state.n <= MOST_CONNECTIVITY:
        from flocking.study.nets import algebraic_connectivity

        found["connectivity"] = algebraic_connectivity(state.links | state.links.T)
    i, j = np.nonzero(np.triu(state.links | state.links.T))
    if len(i):
        r = np.linalg.norm(state.q[i] - state.q[j], axis=1)
        found["deviation"] = float(np.sqrt(np.mean((r / r.mean() - 1) ** 2))) if r.mean() > 0 else 0.0
    return found


@dataclass(frozen=True)
class Lamp:
    """A claim with its verdict, as a page shows it.

    Parameters
    ----------
    claim
        The claim.
    word
        Its verdict, or ``"not yet"``.
    note
        What was measured.
    culprit
        The moment and agents that broke it, where something did.
    """

    claim: Claim
    word: str
    note: str
    culprit: Culprit | None = None

    @property
    def color(self) -> str:
        """Green, red, orange while open, grey where it does not apply."""
        if self.word == str(self.claim.expected) == "fails":
            return "teal"  # the paper is known to be wrong there
        return {"holds": "green", "fails": "red", "hypothesis not met": "violet", "not yet": "orange"}.get(
            self.word, "gray"
        )


def claims_of(scenario_name: str) -> tuple[Claim, ...]:
    """The paper's claims about its scenario, then the general ones that these do not name already."""
    found = paper_claims(scenario_name) or ()
    known = {c.key for c in found}
    return (*found, *(c for c in general.GENERAL if c.key not in known))


def lamps(run: Run, claims: Sequence[Claim]) -> list[Lamp]:
    """Verdicts on a run that goes on. A claim that cannot be measured on it is said to be not applicable."""
    evidence = Evidence(run)
    found = []
    for claim in claims:
        try:
            result = claim.examine(evidence)
            who = culprit(result, evidence)
        except Exception as error:  # claims of papers look at their own laws, and a law may be changed at will
            result, who = Result(claim, Verdict.NOT_APPLICABLE, note=f"{type(error).__name__}: {error}"), None
        open_still = result.verdict is Verdict.FAILS and claim.conclusion in _PENDING
        found.append(Lamp(claim, "not yet" if open_still else str(result.verdict), result.note, who))
    return found
