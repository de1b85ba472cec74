"""The equation table: every numbered statement of a paper, its object in the code, and its reading."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TypedDict

KINDS = ("equation", "definition", "assumption", "lemma", "proposition", "theorem", "corollary", "remark", "example",
         "figure", "table", "problem", "protocol", "consequence")  # fmt: skip
"""Kinds of rows; a consequence is derived here from statements of a paper, its fault is `Fault.OWN`."""


class Fault(StrEnum):
    """Fault of a printed statement that is not read as printed, or the mark of one that is not printed, or not seen.

    Statements of a text that was not at hand are as commonly cited.
    """

    NONE = "as printed"
    CITED = "as commonly cited"
    READING = "ambiguity or missing value"
    MISPRINT = "misprint"
    FALSE = "false statement"
    OWN = "not printed"


class DemonstrationData(TypedDict):
    """A counter-example as plain data; infinities are strings."""

    printed: float | str
    true: float | str
    example: str


class RowData(TypedDict):
    """A row of an equation table as plain data, its verdict computed."""

    paper: str
    number: str
    kind: str
    title: str
    home: str
    test: str
    verdict: str
    reason: str
    note: str
    demonstration: DemonstrationData | None


@dataclass(frozen=True)
class Demonstration:
    """A computed counter-example to a statement as it is printed.

    Parameters
    ----------
    printed
        Value by the printed statement for the example.
    true
        True value, computed independently.
    tolerance
        Difference that rounding may explain.
    example
        Description of the example.
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

    def as_dict(self) -> DemonstrationData:
        """Plain data for JSON; infinities as strings."""
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
        Short description of its content.
    home
        Dotted name of the object that implements it.
    build
        Function of a factor on the number that determines the object: the test of the row passes for 1 and fails for
        1.01.
    reading
        The reading, if the printed form cannot be meant; empty if it is read as printed.
    demonstration
        Computes a counter-example to the printed form, if that cannot be meant or is wrong.
    fault
        Fault of the printed form. A reading without a fault means an ambiguity or a missing value. `Fault.MISPRINT`
        has one sensible reading under which the paper's argument is valid. `Fault.FALSE` is a statement that is wrong
        under every sensible reading, and needs a counter-example.
    note
        A remark without a fault.
    also
        Further numbers of the paper that the row covers.

    Raises
    ------
    ValueError
        If fault, reading and demonstration are inconsistent.
    """

    paper: str
    number: str
    kind: str
    title: str
    home: str
    build: Callable[[float], object]
    reading: str = ""
    demonstration: Callable[[], Demonstration] | None = None
    fault: Fault = Fault.NONE
    note: str = ""
    also: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.kind == "consequence":
            object.__setattr__(self, "fault", Fault.OWN)
            if self.reading or self.demonstration is not None:
                raise ValueError(f"{self.paper} {self.number}: a statement that is not printed has no fault")
            return
        faultless = (Fault.NONE, Fault.CITED)
        if self.fault in faultless and self.reading and self.demonstration is None:
            object.__setattr__(self, "fault", Fault.READING)
        if (self.fault in faultless) == bool(self.reading) or self.fault is Fault.OWN:
            raise ValueError(f"{self.paper} {self.number}: a fault needs a reading, and a reading a fault")
        if self.fault is Fault.FALSE and self.demonstration is None:
            raise ValueError(f"{self.paper} {self.number}: a false statement needs a counter-example")

    @property
    def test(self) -> str:
        """Name of its test."""
        return f"tests/papers/test_equations.py::test_row[{self.paper} {self.number}]"

    def verdict(self) -> tuple[Fault, Demonstration | None]:
        """The fault of the row and its counter-example, which is computed.

        A fault whose counter-example does not refute the statement is reduced to a reading.
        """
        if self.demonstration is None:
            return self.fault, None
        shown = self.demonstration()
        return (self.fault, shown) if shown.refutes else (Fault.READING, None)

    def as_dict(self) -> RowData:
        """Plain data for JSON, with the verdict computed."""
        verdict, shown = self.verdict()
        return {
            "paper": self.paper,
            "number": self.number,
            "kind": self.kind,
            "title": self.title,
            "home": self.home,
            "test": self.test,
            "verdict": str(verdict),
            "reason": self.reading,
            "note": self.note,
            "demonstration": shown.as_dict() if shown else None,
        }


@dataclass(frozen=True)
class Erratum:
    """A printed statement that is false or a misprint.

    Parameters
    ----------
    statement
        Number and content of the statement.
    reading
        The error, and the reading.
    demonstration
        Computes a counter-example; None for an obvious misprint.
    fault
        `Fault.FALSE` or `Fault.MISPRINT`.
    """

    statement: str
    reading: str
    demonstration: Callable[[], Demonstration] | None
    fault: Fault = Fault.FALSE


def errata_of(rows: Sequence[Row]) -> list[Erratum]:
    """Errata of a table: its false statements, then its misprints.

    Parameters
    ----------
    rows
        Rows of the table.
    """
    return [
        Erratum(f"{r.number}: {r.title}", r.reading, r.demonstration, fault)
        for fault in (Fault.FALSE, Fault.MISPRINT)
        for r in rows
        if r.fault is fault
    ]


def fault_counts(rows: Sequence[Row]) -> dict[Fault, int]:
    """Number of rows with each fault, including zeros."""
    found = Counter(row.fault for row in rows)
    return {fault: found[fault] for fault in Fault}
