"""A certificate: what is guaranteed, by which theorem, under which hypotheses, with an enclosed number."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from math import inf, isfinite, nextafter

from flocking.formula.intervals import Interval
from flocking.formula.safe_digits import bound_text, given_text, nearest_text, rounded_down, rounded_up
from flocking.model.law import Scenario

GRANTED, REFUSED, NOT_APPLICABLE = "granted", "refused", "not applicable"
"""Outcomes of a certificate."""

ALONE = "there is one agent alone"
"""Why nothing is stated of pairs in a group of one."""

TOO_EXTREME = "the numbers are too large or too small for an enclosure in double precision"
"""Why a bound that would be infinite is not granted."""

MIDDLE_DIGITS = 12
"""Digits of the middle of an enclosure as text; a convention."""
LARGEST_MIDDLE = 1e300
"""Ends beyond are stated one by one: the distance of two doubles of this size may overflow."""


@dataclass(frozen=True)
class Hypothesis:
    """One hypothesis of a theorem, as found for a scenario.

    Parameters
    ----------
    statement
        What is required.
    holds
        Whether it is met.
    found
        What was found, in words and numbers.
    """

    statement: str
    holds: bool
    found: str = ""


@dataclass(frozen=True)
class Enclosure:
    """Two numbers between which an exact one lies.

    Parameters
    ----------
    lo, hi
        The ends; both may be infinite.
    """

    lo: float
    hi: float

    @classmethod
    def of(cls, interval: Interval) -> Enclosure:
        """The enclosure that an interval of one element is."""
        return cls(float(interval.lo), float(interval.hi))

    def __str__(self) -> str:
        if self.lo == self.hi:
            return given_text(self.lo)
        if not max(abs(self.lo), abs(self.hi)) < LARGEST_MIDDLE:
            return f"from {rounded_down(self.lo)} to {rounded_up(self.hi)}"
        middle = nearest_text(0.5 * self.lo + 0.5 * self.hi, MIDDLE_DIGITS)
        # The radius covers the rounding of the middle, too: both ends lie within the bounds in the text.
        ends = (Fraction(self.hi) - Fraction(middle), Fraction(middle) - Fraction(self.lo))
        return f"{middle} +- {rounded_up(nextafter(float(max(ends)), inf), 1)}"


@dataclass(frozen=True)
class Certificate:
    """What is guaranteed of every run of a scenario, or why nothing is.

    Parameters
    ----------
    key
        Short name, such as ``"closest_approach"``.
    statement
        The guarantee as a sentence, with its number where it is granted.
    source
        Theorem, and where it is stated.
    hypotheses
        Its hypotheses, each checked.
    outcome
        ``"granted"``, ``"refused"`` or ``"not applicable"``.
    reason
        Why it is refused or not applicable; empty where it is granted.
    bound
        The guaranteed number, enclosed; None where there is none.
    side
        ``"at least"`` or ``"at most"``: which side of the bound the measured quantity stays on. The safe end of the
        enclosure is the lower one of ``"at least"`` and the upper one of ``"at most"``. ``"is"`` for a property of
        the law that no run measures.
    quantity
        What is bounded, with its unit.
    """

    key: str
    statement: str
    source: str
    hypotheses: tuple[Hypothesis, ...]
    outcome: str
    reason: str = ""
    bound: Enclosure | None = None
    side: str = "at most"
    quantity: str = ""

    @property
    def granted(self) -> bool:
        """Whether the guarantee is given."""
        return self.outcome == GRANTED

    @property
    def safe_bound(self) -> float | None:
        """The end of the enclosure that is safe to rely on; None where nothing is granted."""
        if self.bound is None or not self.granted:
            return None
        return self.bound.lo if self.side == "at least" else self.bound.hi

    @property
    def safe_lower(self) -> float | None:
        """The lower end of the enclosure of a granted certificate; None where there is none."""
        return self.bound.lo if self.bound is not None and self.granted else None

    def as_dict(self) -> dict[str, object]:
        """The certificate as plain values for JSON, which has no infinity: None stands for an infinite end."""
        bound = None if self.bound is None else {"lower": _plain(self.bound.lo), "upper": _plain(self.bound.hi)}
        return {
            "key": self.key, "statement": self.statement, "source": self.source, "outcome": self.outcome,
            "reason": self.reason, "quantity": self.quantity, "side": self.side, "bound": bound,
            "hypotheses": [{"statement": h.statement, "holds": h.holds, "found": h.found} for h in self.hypotheses],
        }  # fmt: skip


def _plain(end: float) -> float | None:
    return end if isfinite(end) else None


@dataclass(frozen=True)
class Certificates:
    """The certificates of one scenario.

    Parameters
    ----------
    name
        Name of the scenario.
    all
        The certificates, granted or not.
    """

    name: str
    all: tuple[Certificate, ...]

    def __iter__(self) -> Iterator[Certificate]:
        return iter(self.all)

    def __len__(self) -> int:
        return len(self.all)

    def __contains__(self, key: object) -> bool:
        return any(key is c or key == c.key for c in self.all)

    def __getitem__(self, key: str) -> Certificate:
        """The certificate with a key.

        Raises
        ------
        KeyError
            When there is none.
        """
        for each in self.all:
            if each.key == key:
                return each
        raise KeyError(f"{key!r} is no certificate; there are {', '.join(c.key for c in self.all)}")

    @property
    def granted(self) -> tuple[Certificate, ...]:
        """Those that are granted."""
        return tuple(c for c in self.all if c.granted)

    def __repr__(self) -> str:
        """In one line: how many are granted."""
        return f"<Certificates {self.name!r}: {len(self.granted)} of {len(self.all)} granted>"

    def _repr_html_(self) -> str:
        """In a notebook: how many are granted, and folded a row for each."""
        from html import escape

        from flocking.formula.markup.cells import folded, rows_table
        from flocking.formula.markup.text_formulas import set_text

        rows = [
            (
                escape(c.key), "granted" if c.granted else "not granted",
                set_text(c.statement if c.granted else c.reason),
                "" if c.safe_bound is None else f"{escape(c.side)} {bound_text(c.safe_bound, c.side, 4)}",
            )
            for c in self.all
        ]  # fmt: skip
        summary = f"Certificates: {len(self.granted)} of {len(self.all)} granted"
        return folded(summary, rows_table(("certificate", "", "statement or reason", "bound"), rows))

    def __str__(self) -> str:
        lines = [self.name] if self.name else []
        for c in self.all:
            lines.append(f"{c.key}: {c.outcome}. {c.statement if c.granted else c.reason}")
        return "\n".join(lines)

    def as_dict(self) -> dict[str, object]:
        """All certificates as plain values for JSON."""
        return {"scenario": self.name, "certificates": [c.as_dict() for c in self.all]}


def until_failed(*checks: Callable[[], Hypothesis]) -> tuple[Hypothesis, ...]:
    """Hypotheses in the order of their checks, up to the first that does not hold; later ones assume earlier ones.

    Parameters
    ----------
    checks
        Functions that check one hypothesis each.
    """
    found: list[Hypothesis] = []
    for check in checks:
        found.append(check())
        if not found[-1].holds:
            break
    return tuple(found)


def ideal_world(scenario: Scenario) -> Hypothesis:
    """The hypothesis that agents know and apply everything at once, in open space.

    Parameters
    ----------
    scenario
        The scenario.
    """
    world = scenario.imperfections
    if not scenario.space.is_open:
        world = "; ".join(x for x in (world, "space repeats") if x)
    return Hypothesis("ideal information and control in open space", not world, world or "ideal, open")


def graph_in_words(scenario: Scenario) -> str:
    """What a hypothesis about one graph of several agents in open space was found to be: what is against it first.

    Parameters
    ----------
    scenario
        The scenario.
    """
    law = scenario.law
    if scenario.start.n == 1:
        return ALONE
    if not scenario.space.is_open:
        return "space repeats"
    if len(law.graphs) > 1:
        return f"terms have {len(law.graphs)} graphs"
    return f"{type(law.graph).__name__}, {'directed' if law.graph.directed else 'undirected'}"


def not_applicable(keys: Iterable[str], source: str, hypotheses: tuple[Hypothesis, ...]) -> tuple[Certificate, ...]:
    """Certificates of a theorem that does not apply to a scenario, with the hypothesis that is not met as the reason.

    Parameters
    ----------
    keys
        Keys of the certificates.
    source, hypotheses
        As in `Certificate`; one hypothesis does not hold.
    """
    failed = next(h for h in hypotheses if not h.holds)
    reason = f"{failed.statement}: {failed.found}"
    return tuple(Certificate(key, "", source, hypotheses, NOT_APPLICABLE, reason) for key in keys)


def decided(
    key: str, source: str, hypotheses: tuple[Hypothesis, ...], *, statement: str = "", reason: str = "",
    bound: Interval | Enclosure | None = None, side: str = "at most", quantity: str = "",
) -> Certificate:  # fmt: skip
    """A certificate that is granted if no hypothesis fails, its bound is finite and no other reason is against it.

    Parameters
    ----------
    key, source, hypotheses, statement, bound, side, quantity
        As in `Certificate`.
    reason
        What else is against it.
    """
    failed = next((h for h in hypotheses if not h.holds), None)
    against = f"not met: {failed.statement} ({failed.found})" if failed is not None else reason
    enclosure = Enclosure.of(bound) if isinstance(bound, Interval) else bound
    if not against and enclosure is not None and not _tells(enclosure, side):
        against = TOO_EXTREME
    outcome = REFUSED if against else GRANTED
    return Certificate(
        key, statement, source, hypotheses, outcome, against, None if against else enclosure, side, quantity
    )


def _tells(bound: Enclosure, side: str) -> bool:
    """Whether the ends of a bound that are relied on are finite."""
    ends = {"at least": (bound.lo,), "at most": (bound.hi,)}.get(side, (bound.lo, bound.hi))
    return all(isfinite(end) for end in ends)
