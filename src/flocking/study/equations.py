"""The equation table: every numbered statement of a paper, where it lives, and how it is read."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

KINDS = ("equation", "definition", "assumption", "lemma", "proposition", "theorem", "corollary", "remark", "example",
         "figure", "table", "problem", "protocol")  # fmt: skip


@dataclass(frozen=True)
class Demonstration:
    """A computed counter-example to a statement as it is printed.

    Parameters
    ----------
    printed
        What the printed statement gives for the example.
    true
        What is really the case, computed independently.
    tolerance
        Difference that would still be rounding.
    example
        The example in words.
    """

    printed: float
    true: float
    tolerance: float
    example: str

    @property
    def refutes(self) -> bool:
        """Whether the printed statement is wrong for the example."""
        if math.isinf(self.printed) or math.isinf(self.true):
            return self.printed != self.true
        return abs(self.printed - self.true) > self.tolerance

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON; infinities as text."""
        return {"printed": _plain(self.printed), "true": _plain(self.true), "example": self.example}


def _plain(value: float) -> float | str:
    return float(value) if math.isfinite(value) else str(value)


@dataclass(frozen=True)
class Row:
    """One numbered statement of a paper.

    Parameters
    ----------
    paper
        Key of the paper.
    number
        Its number as printed, for example ``"(5)"``, ``"Theorem IV.4"`` or ``"Fig. 2"``.
    kind
        One of `KINDS`.
    title
        What it states, in a few words.
    home
        Dotted name of the object that carries it.
    build
        The object, with its decisive number multiplied by the argument: the test of the row passes for 1 and
        goes red for 1.01.
    reading
        How it is read, where the printed form cannot be meant; empty when it is read as printed.
    demonstration
        Computes a counter-example to the printed form, where that is wrong.
    """

    paper: str
    number: str
    kind: str
    title: str
    home: str
    build: Callable[[float], Any]
    reading: str = ""
    demonstration: Callable[[], Demonstration] | None = None

    @property
    def test(self) -> str:
        """Name of the test that shows it."""
        return f"tests/papers/test_equations.py::test_row[{self.paper} {self.number}]"

    def verdict(self) -> tuple[str, Demonstration | None]:
        """``"as printed"``, ``"read so"`` or ``"wrong"``; the last only by a counter-example computed now."""
        if self.demonstration is not None:
            shown = self.demonstration()
            if shown.refutes:
                return "wrong", shown
        return ("read so" if self.reading else "as printed"), None

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON, with the verdict computed."""
        verdict, shown = self.verdict()
        return {
            "paper": self.paper,
            "number": self.number,
            "kind": self.kind,
            "title": self.title,
            "home": self.home,
            "test": self.test,
            "verdict": verdict,
            "reason": self.reading,
            "demonstration": shown.as_dict() if shown else None,
        }


@dataclass(frozen=True)
class Erratum:
    """A statement of a paper that is wrong as printed.

    Parameters
    ----------
    statement
        Number and content of the statement.
    fault
        What is wrong, and how it is read.
    demonstration
        Computes a counter-example.
    """

    statement: str
    fault: str
    demonstration: Callable[[], Demonstration]


def errata_of(rows: Sequence[Row]) -> list[Erratum]:
    """Errata of a table: its rows that carry a counter-example."""
    return [Erratum(f"{r.number}: {r.title}", r.reading, r.demonstration) for r in rows if r.demonstration is not None]
