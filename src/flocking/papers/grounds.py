"""What the expected verdicts of a paper's claims rest on: proofs, counter-examples, or nothing but observation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from flocking.model.law import Scenario
from flocking.study.claims.claim import Basis, Claim


@dataclass(frozen=True)
class Ground:
    """What the expected verdict of a claim rests on.

    Parameters
    ----------
    basis
        Which kind of ground it is.
    proof
        The proof or the theorem in a few words.
    counterexample
        Makes a scenario that refutes the claim.
    """

    basis: Basis
    proof: str = ""
    counterexample: Callable[[], Scenario] | None = None


OBSERVED = Ground(Basis.OBSERVATION)
"""No proof backs it: over many seeds it has a rate."""


def proved(proof: str) -> Ground:
    """The verdict follows from a proof.

    Parameters
    ----------
    proof
        The proof, or the theorem that is cited, in a few words.
    """
    return Ground(Basis.PROOF, proof)


def refuted(counterexample: Callable[[], Scenario]) -> Ground:
    """The claim fails, by one counter-example.

    Parameters
    ----------
    counterexample
        Makes a scenario that refutes it.
    """
    return Ground(Basis.COUNTEREXAMPLE, counterexample=counterexample)


def grounded(claims: Sequence[Claim], grounds: Mapping[str, Ground]) -> tuple[Claim, ...]:
    """Claims with what their expected verdicts rest on.

    Parameters
    ----------
    claims
        The claims of one scenario.
    grounds
        By the key of the claim; every claim needs one.

    Raises
    ------
    KeyError
        When a claim has no ground.
    """
    found = []
    for claim in claims:
        ground = grounds[claim.key]
        found.append(replace(claim, basis=ground.basis, ground=ground.proof, counterexample=ground.counterexample))
    return tuple(found)
