"""Checks of the objects at the homes of rows, by dotted name: each whole, against formulas typed once more."""

from __future__ import annotations

from collections.abc import Callable

from tests.papers.homes import (
    avoidance,
    claims,
    laws,
    measures,
    motion,
    nets,
    papers,
    shapes,
    shi,
    states,
    structure,
    terms,
)  # fmt: skip

HOMES: dict[str, Callable[[], None]] = {
    **nets.HOMES, **structure.HOMES, **terms.HOMES, **laws.HOMES, **states.HOMES, **avoidance.HOMES,
    **papers.HOMES, **shi.HOMES, **measures.HOMES, **claims.HOMES, **shapes.HOMES, **motion.HOMES,
}  # fmt: skip
