"""Source text: names that formulas leave free, and lines of generated functions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import sympy


@dataclass(frozen=True)
class Names:
    """Free names of some formulas, sorted by where their values come from.

    Parameters
    ----------
    scalars
        Slots ``P0``... of single numbers.
    per_agent
        Slots ``A0``... of one number for each agent.
    per_pair
        Slots ``W0``... of one number for each pair.
    others
        All other names: distances, coordinates, time.
    """

    scalars: tuple[str, ...]
    per_agent: tuple[str, ...]
    per_pair: tuple[str, ...]
    others: frozenset[str]


def free_names(expressions: Iterable[sympy.Expr]) -> Names:
    """Sort the free symbols of ``expressions`` into slots and other names."""
    names = {str(s) for e in expressions for s in e.free_symbols}

    def slots(letter: str) -> tuple[str, ...]:
        return tuple(sorted((n for n in names if re.fullmatch(letter + r"\d+", n)), key=lambda n: int(n[1:])))

    groups = slots("P"), slots("A"), slots("W")
    return Names(*groups, frozenset(names - {n for g in groups for n in g}))


def indented(lines: Iterable[str], depth: int) -> str:
    """The ``lines`` as text, indented by ``depth`` levels of four blanks."""
    return "".join("    " * depth + line + "\n" for line in lines)


def unpack(names: Names, depth: int) -> str:
    """Lines, indented by ``depth`` levels, that read single numbers from the slots in ``names``."""
    return indented((f"{n} = P[{n[1:]}]" for n in names.scalars), depth)


def nonzero(formulas: Mapping[str, sympy.Expr]) -> dict[str, sympy.Expr]:
    """The ``formulas`` that are not zero; the others need not be compiled."""
    return {name: value for name, value in formulas.items() if value != 0}
