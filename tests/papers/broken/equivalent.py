"""Faults that change nothing: each with the rule that says why."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flocking.study.equations import Row

if TYPE_CHECKING:
    from tests.papers.broken.homes import Mutant

SYMMETRIC_GAP = "the difference of two headings is the same seen from either agent"
RULES: tuple[tuple[str, str, str], ...] = (
    ("nets.adjacency", "index: [(i, j)] turned round", SYMMETRIC_GAP),
    ("nets._matrix", "sign: minus matrix", "algebraic_connectivity passes its matrix through _matrix twice"),
    ("structure._weights", "times adjacency", "a vote asks only whether a weight is positive"),
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
