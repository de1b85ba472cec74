"""Grounds of the expected verdicts of a paper's claims: proofs, counter-examples, or observation only."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from flocking.model.law import Scenario
from flocking.study.claims.claim import Basis, Claim


@dataclass(frozen=True)
class Ground:
    """Ground of the expected verdict of a claim.

    Parameters
    ----------
    basis
        Kind of the ground.
    proof
        Short form of the proof or the theorem.
    counterexample
        Makes a scenario that refutes the claim.
    """

    basis: Basis
    proof: str = ""
    counterexample: Callable[[], Scenario] | None = None


OBSERVED = Ground(Basis.OBSERVATION)
"""Ground of a verdict without a proof: observation over many seeds."""


def proved(proof: str) -> Ground:
    """The verdict follows from a proof.

    Parameters
    ----------
    proof
        Short form of the proof, or the cited theorem.
    """
    return Ground(Basis.PROOF, proof)


def refuted(counterexample: Callable[[], Scenario]) -> Ground:
    """The claim fails by a counter-example.

    Parameters
    ----------
    counterexample
        Makes a scenario that refutes it.
    """
    return Ground(Basis.COUNTEREXAMPLE, counterexample=counterexample)


def grounded(claims: Sequence[Claim], grounds: Mapping[str, Ground]) -> tuple[Claim, ...]:
    """Claims with the grounds of their expected verdicts.

    Parameters
    ----------
    claims
        The claims of one scenario.
    grounds
        Grounds by the key of the claim; every claim needs one.

    Raises
    ------
    KeyError
        If a claim has no ground.
    """
    found = []
    for claim in claims:
        ground = grounds[claim.key]
        found.append(replace(claim, basis=ground.basis, ground=ground.proof, counterexample=ground.counterexample))
    return tuple(found)
