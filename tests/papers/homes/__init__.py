"""Checks of the objects at the homes of rows, by dotted name: each whole, against formulas typed once more."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from tests.papers.homes import (
    arguments,
    avoidance,
    claims,
    cucker_smale,
    laws,
    measures,
    motion,
    nets,
    olfati_saber_2006,
    papers,
    reynolds,
    shapes,
    shi,
    states,
    structure,
    terms,
    vasarhelyi,
    vicsek,
)

_WHOLE: dict[str, Callable[[], None]] = {
    **nets.HOMES, **structure.HOMES, **terms.HOMES, **laws.HOMES, **states.HOMES, **avoidance.HOMES,
    **papers.HOMES, **shi.HOMES, **measures.HOMES, **claims.HOMES, **shapes.HOMES, **motion.HOMES,
    **cucker_smale.HOMES,
    **olfati_saber_2006.HOMES,
    **vicsek.HOMES,
    **reynolds.HOMES,
    **vasarhelyi.HOMES,
}  # fmt: skip


def _both(first: Callable[[], None], second: Callable[[], None]) -> None:
    first()
    second()


HOMES = {**_WHOLE, **{home: partial(_both, check, _WHOLE[home]) for home, check in arguments.CHECKS.items()}}
