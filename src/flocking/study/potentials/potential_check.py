"""Holds a potential against the papers' definitions of what a potential is, and says where it fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import number
from flocking.model.potentials.potential import Potential
from flocking.study.potentials.potential_shape import MOST_MINIMA, Limit, Minimum, Shape, same, shape_of


@dataclass(frozen=True)
class PropertyRow:
    """One property of a potential.

    Parameters
    ----------
    name
        The property.
    holds
        Whether it holds; None where it cannot be asked without a radius.
    explanation
        The numbers behind it: what fails and where.
    """

    name: str
    holds: bool | None
    explanation: str


@dataclass(frozen=True)
class DefinitionRow:
    """A definition of a paper and its items.

    Parameters
    ----------
    key
        Key of the paper.
    source
        Where the paper says it.
    rows
        Its items.
    """

    key: str
    source: str
    rows: tuple[PropertyRow, ...]

    @property
    def holds(self) -> bool | None:
        """Whether every item holds; None where none fails and one cannot be asked."""
        verdicts = [row.holds for row in self.rows]
        return False if False in verdicts else None if None in verdicts else True


@dataclass(frozen=True)
class PotentialReport:
    """What a potential is, and which papers' definitions it meets.

    Parameters
    ----------
    potential
        The potential.
    radius
        Radius it was judged at: the one given, else the first distance where it is infinite.
    rows
        Its properties.
    definitions
        The papers' definitions.
    """

    potential: Potential
    radius: float | None
    rows: tuple[PropertyRow, ...]
    definitions: tuple[DefinitionRow, ...]

    def __str__(self) -> str:
        lines = [str(self.potential)]
        lines += _table(self.rows)
        for definition in self.definitions:
            lines += ["", f"{definition.source}: {_WORDS[definition.holds]}", *_table(definition.rows)]
        return "\n".join(lines)

    def as_dict(self) -> dict[str, object]:
        """The report as plain values for JSON."""

        def plain(rows: tuple[PropertyRow, ...]) -> list[dict[str, object]]:
            return [{"name": row.name, "holds": row.holds, "explanation": row.explanation} for row in rows]

        return {
            "formula": self.potential.formula.text,
            "parameters": dict(self.potential.parameters),
            "radius": self.radius,
            "rows": plain(self.rows),
            "definitions": [
                {"key": d.key, "source": d.source, "holds": d.holds, "rows": plain(d.rows)} for d in self.definitions
            ],
        }


_WORDS = {True: "holds", False: "fails", None: "open"}


def _table(rows: tuple[PropertyRow, ...]) -> list[str]:
    width = max((len(row.name) for row in rows), default=0)
    return [f"  {row.name:<{width}}  {_WORDS[row.holds]:<5}  {row.explanation}" for row in rows]


@dataclass(frozen=True)
class _Judge:
    shape: Shape
    radius: float | None

    def end(self, past_radius: bool) -> float:
        return np.inf if past_radius or self.radius is None else self.radius

    def defined(self, past_radius: bool) -> PropertyRow:
        end = self.end(past_radius)
        missing = [x for x in self.shape.undefined if x < end]
        text = f"no real value at r = {missing[0]:.3g} and {len(missing) - 1} more of 97 samples" if missing else ""
        return PropertyRow("defined", not missing, text or "real at every sampled distance")

    def minima(self, past_radius: bool) -> list[Minimum]:
        end = self.end(past_radius)
        return [m for m in self.shape.minima if m.at < end and not same(m.at, end)]

    def lowest(self, past_radius: bool) -> tuple[float, float]:
        """Where and how low the potential gets, attained or not."""
        end = self.end(past_radius)
        lows = [(x, v) for x, v in self.shape.lows if not np.isnan(v) and (x < end or x == end == np.inf)]
        edge = None if np.isinf(end) else self.shape.break_at(end)
        if edge is not None and not np.isnan(edge.left[0].value):
            lows = [low for low in lows if not same(low[0], end)] + [(end, edge.left[0].value)]
        return min(lows, key=lambda low: low[1], default=(np.nan, np.nan))

    def unique(self, past_radius: bool) -> PropertyRow:
        name = "unique minimum"
        minima = self.minima(past_radius)
        where, low = self.lowest(past_radius)
        if len(self.shape.minima) >= MOST_MINIMA:
            return PropertyRow(name, False, f"has {len(self.shape.minima)} local minima and more")
        if not minima:
            text = f"the values fall to {low:.6g} as r -> {where:.6g}" if not np.isnan(low) else "it has no real values"
            return PropertyRow(name, False, f"has no minimum; {text}")
        best = min(minima, key=lambda m: m.value)
        if low < best.value and not same(low, best.value):
            text = f"the lowest minimum is {best.value:.9g}, but the values fall to {low:.6g} as r -> {where:.6g}"
            return PropertyRow(name, False, text)
        equal = [m for m in minima if same(m.value, best.value)]
        others = [m for m in minima if m not in equal]
        if best.flat or len(equal) > 1:
            spots = [f"[{m.at:.9g}, {m.until:.9g}]" if m.flat else f"{m.at:.9g}" for m in equal[:4]]
            more = f" and at least {len(equal) - 4} more" if len(equal) > 4 else ""
            return PropertyRow(name, False, f"the minimum {best.value:.9g} is taken at r = {', '.join(spots)}{more}")
        text = f"{best.value:.9g} at r = {best.at:.9g}"
        if others:
            spots = [f"{m.value:.6g} at r = {m.at:.6g}" for m in others[:3]]
            text += f"; higher local minima: {', '.join(spots)}" + (" ..." if len(others) > 3 else "")
        return PropertyRow(name, True, text)

    def nonnegative(self, past_radius: bool) -> PropertyRow:
        where, low = self.lowest(past_radius)
        undefined = not self.defined(past_radius).holds or np.isnan(low)
        holds = bool(low >= -1e-12) and not undefined
        text = f"gets as low as {low:.9g} at r = {where:.9g}" + (", and is not defined everywhere" if undefined else "")
        return PropertyRow("nonnegative", holds, text)

    def at_zero(self, past_radius: bool) -> PropertyRow:
        return PropertyRow("infinite at 0", self.shape.zero.rises, f"tends to {self.shape.zero} as r -> 0")

    def at_radius(self, past_radius: bool) -> PropertyRow:
        name = "infinite at R"
        if self.radius is None:
            return PropertyRow(name, None, "no radius was given and the potential is infinite at none")
        edge = self.shape.break_at(self.radius)
        left = edge.left[0] if edge is not None else Limit("none")
        return PropertyRow(name, left.rises, f"tends to {left} as r -> R = {self.radius:.9g} from below")

    def edge(self) -> PropertyRow:
        name = "smooth at R"
        edge = None if self.radius is None else self.shape.break_at(self.radius)
        if edge is None:
            return PropertyRow(name, None, "no radius was given and the potential is infinite at none")
        sides = [f"{what} {a} | {b}" for what, a, b in zip(("value", "slope"), edge.left, edge.right, strict=False)]
        return PropertyRow(name, edge.order >= 1, f"left | right of R = {edge.at:.9g}: {', '.join(sides)}")

    def increasing(self, past_radius: bool) -> PropertyRow:
        name = "increasing near R"
        if self.radius is None:
            return PropertyRow(name, None, "no radius was given and the potential is infinite at none")
        R = self.radius
        slopes = [float(self.shape.slope(R * (1 - 10.0**-k))) for k in range(1, 13)]
        steps = [k for k, s in enumerate(slopes, start=1) if not s > 0]
        if steps and steps[-1] > 6:
            return PropertyRow(
                name, False, f"slope {slopes[steps[-1] - 1]:.6g} at r = R - R/1e{steps[-1]}, R = {R:.9g}"
            )
        start = max((m.until for m in self.minima(False)), default=np.nan)
        since = f"; its last minimum before R is at r = {start:.9g}" if np.isfinite(start) else ""
        return PropertyRow(name, True, f"slope {slopes[5]:.6g} at r = R - R/1e6, R = {R:.9g}{since}")

    def unbounded(self, past_radius: bool) -> PropertyRow:
        found = self.shape.infinity
        return PropertyRow("radially unbounded", found.rises, f"tends to {found} as r -> infinity")

    def differentiable(self, past_radius: bool) -> PropertyRow:
        end = self.end(past_radius)
        broken = [b for b in self.shape.breaks if b.order < 1 and b.at < end and not same(b.at, end)]
        text = "; ".join(str(b) for b in broken[:3]) + (f"; {len(broken) - 3} more" if len(broken) > 3 else "")
        kept = [b for b in self.shape.breaks if b.order == 1 and b.at < end]
        calm = "; ".join(str(b) for b in kept[:3]) or f"no break of the slope below {end:.9g}"
        defined = self.defined(past_radius)
        return PropertyRow("differentiable", not broken and bool(defined.holds), text or
                           (calm if defined.holds else defined.explanation))  # fmt: skip

    def still(self, past_radius: bool) -> PropertyRow:
        name = "zero slope beyond R"
        if self.radius is None:
            return PropertyRow(name, None, "no radius was given and the potential is infinite at none")
        R = self.radius
        samples = [R * (1 + 10.0**k) for k in np.linspace(-9, 6, 61)]
        slopes = [(abs(float(self.shape.slope(x))), x) for x in samples]
        worst = max(slopes, key=lambda pair: np.inf if np.isnan(pair[0]) else pair[0])
        holds = bool(worst[0] <= 1e-12)
        fix = "" if holds else "; Potential.capped(R) makes it constant there"
        return PropertyRow(
            name, holds, f"largest |slope| beyond R = {R:.9g}: {worst[0]:.3g} at r = {worst[1]:.9g}{fix}"
        )

    def smoothness(self) -> PropertyRow:
        breaks = self.shape.breaks
        worst = min((b.order for b in breaks), default=2)
        text = "; ".join(str(b) for b in breaks[:6] if b.order < 2) or "C2 or smoother for every r > 0"
        return PropertyRow("smooth (C2) for r > 0", worst >= 2, text)


Item = Callable[[_Judge, bool], PropertyRow]

_DEFINITIONS: dict[str, tuple[str, bool, tuple[Item, ...]]] = {
    "tanner-2003-fixed": (
        "Tanner I, Definition IV.3", True,
        (_Judge.differentiable, _Judge.nonnegative, _Judge.unbounded, _Judge.at_zero, _Judge.unique),
    ),
    "tanner-2003-dynamic": (
        "Tanner II, Definition IV.2", False,
        (_Judge.nonnegative, _Judge.at_zero, _Judge.unique, _Judge.increasing),
    ),
    "shi-2009": (
        "Shi, Definition 2", True,
        (_Judge.differentiable, _Judge.nonnegative, _Judge.at_zero, _Judge.unique, _Judge.still),
    ),
    "zhou-2015": ("Zhou, rules (i)-(ii)", False, (_Judge.unique, _Judge.at_zero, _Judge.at_radius)),
}  # fmt: skip
"""Where each paper defines a potential, whether on all r > 0 (else below R), and what it asks."""


def check_potential(
    potential: Potential | str, *, radius: float | None = None, definition: str | None = None
) -> PotentialReport:
    """Find the properties of a potential and hold them against the papers' definitions.

    Limits are taken with 600 digits from the symbolic formula; breaks and minima are searched on [1e-9, 1e9].
    "Unique minimum" means that the smallest value is taken at one distance only; higher local minima are named.

    Parameters
    ----------
    potential
        The potential, or its formula.
    radius
        Sensing radius R; the first distance where the potential is infinite when absent.
    definition
        Hold it against this paper's definition alone: ``"tanner-2003-fixed"``, ``"tanner-2003-dynamic"``,
        ``"shi-2009"`` or ``"zhou-2015"``.

    Returns
    -------
    PotentialReport
        ``rows`` and ``definitions``; print it for a table.

    Raises
    ------
    InvalidInput
        When the radius is not positive, the definition is unknown, or the formula is not in the grammar.

    Examples
    --------
    >>> report = check_potential("1/r^2 + log(r^2)", definition="tanner-2003-fixed")
    >>> report.definitions[0].holds
    True
    """
    if isinstance(potential, str):
        potential = Potential(potential)
    if not isinstance(potential, Potential):
        raise InvalidInput("check_potential", "potential", "must be a Potential or a formula", potential)
    if radius is not None:
        radius = number("check_potential", "radius", radius, above=0.0)
    if definition is not None and definition not in _DEFINITIONS:
        raise InvalidInput(
            "check_potential", "definition", f"must be one of {', '.join(sorted(_DEFINITIONS))}", definition
        )
    shape = shape_of(potential, radius)
    judge = _Judge(shape, radius if radius is not None else shape.singular_point())
    rows = (
        judge.defined(False), judge.unique(False), judge.nonnegative(False), judge.at_zero(False),
        judge.at_radius(False), judge.edge(), judge.increasing(False), judge.unbounded(True), judge.smoothness(),
    )  # fmt: skip
    definitions = tuple(
        DefinitionRow(key, source, tuple(item(judge, past_radius) for item in items))
        for key, (source, past_radius, items) in _DEFINITIONS.items()
        if definition in (None, key)
    )
    return PotentialReport(potential, judge.radius, rows, definitions)
