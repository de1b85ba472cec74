"""Faults that change nothing: each with the rule that says why."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flocking.study.equations import Row

if TYPE_CHECKING:
    from tests.papers.broken.homes import Mutant

SYMMETRIC_GAP = "the difference of two headings is the same seen from either agent"
ANY_LENGTH = "numpy reads every negative length as the one that fits"
NO_HEADINGS = "the count serves only where there are no headings, which is refused"
EQUAL_MASSES = "equal masses give the same mean, whatever they are"
RULES: tuple[tuple[str, str, str], ...] = (
    ("nets.adjacency", "index: [(i, j)] turned round", SYMMETRIC_GAP),
    ("nets._matrix", "sign: minus matrix", "algebraic_connectivity passes its matrix through _matrix twice"),
    ("structure._weights", "times adjacency", "a vote asks only whether a weight is positive"),
    ("views.Cone.allowed", "in -1", ANY_LENGTH),
    ("views.Cone.start_links", "in -1", ANY_LENGTH),
    ("Cone.allowed", "in max(n, 1)", NO_HEADINGS),
    ("Cone.allowed", "in 0 if headings is None", NO_HEADINGS),
    ("observables.mean_", "constant: 3 for 1 in ", EQUAL_MASSES),
    ("observables.mean_", "constant: 1.05 for 1 in ", EQUAL_MASSES),
    ("diagrams.pair_potentials", "[(0, 1)] turned round", "the adjacency matrix of two agents is symmetric"),
    ("Bump.steepest", "for 1 in best - 1", "a wider bracket about the best point of the grid holds the maximum too"),
    ("Bump.steepest", "without method = 'bounded'", "the method that scipy takes where bounds are given"),
    ("diagrams.neighbourhoods", "other sign in headings[0] +", "the first agent heads along x, at an angle of 0"),
    ("diagrams._neighbours", "without arrows = False", "the agents of Fig. 1 are at rest and have no arrows"),
    ("diagrams._neighbours", "True for False in a keyword", "the agents of Fig. 1 are at rest and have no arrows"),
)
"""Function, words of the fault, and why it changes nothing."""


def reason(row: Row, mutant: Mutant) -> str:
    """Why a mutant behaves as the sound home does; empty where nothing says so."""
    for place, words, why in RULES:
        if place in mutant.where and words in f"{mutant.kind}: {mutant.what}":
            return why
    return ""
