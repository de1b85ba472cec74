"""Faults that change nothing: each with the rule that says why."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flocking.study.equations import Row

if TYPE_CHECKING:
    from tests.papers.broken.homes import Mutant

RULES: tuple[tuple[str, str, str], ...] = ()
"""Function, words of the fault, and why it changes nothing."""


def reason(row: Row, mutant: Mutant) -> str:
    """Why a mutant behaves as the sound home does; empty where nothing says so."""
    for place, words, why in RULES:
        if place in mutant.where and words in mutant.what:
            return why
    return ""
