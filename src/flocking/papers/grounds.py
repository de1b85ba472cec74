"""Grounds of the expected verdicts of a paper's claims: proofs, counter-examples, or observation only."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from flocking.model.checks import one_of
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


class ClaimsOf(Protocol):
    """Claims about one of a paper's scenarios, by default the first."""

    def __call__(self, scenario: str = ...) -> Sequence[Claim]:
        """Claims about the scenario of this name."""


def claims_by_name(
    scenarios: Callable[[], Mapping[str, Callable[[int], Scenario]]],
    stated: Callable[[str], Sequence[Claim]],
    grounds: Callable[[str], Mapping[str, Ground]],
) -> ClaimsOf:
    """The function that gives the claims about a scenario of a paper, with the grounds of their expected verdicts.

    It raises `InvalidInput` for a name that is not one of the paper's scenarios.

    Parameters
    ----------
    scenarios
        Scenarios by name; the first is the default.
    stated
        Claims about the scenario of a name, without grounds.
    grounds
        Grounds by the key of the claim, for the scenario of a name.
    """

    def claims(scenario: str | None = None) -> Sequence[Claim]:
        """Claims about a scenario of the paper by its name; about the first by default."""
        known = scenarios()
        name = next(iter(known)) if scenario is None else scenario
        one_of("claims", "scenario", name, known)
        return grounded(stated(name), grounds(name))

    # Other processes find it in the module of the paper.
    claims.__module__, claims.__qualname__ = stated.__module__, "claims"
    return claims
