"""Properties of a potential, and the definitions of a potential that it meets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import number
from flocking.model.potentials.potential import Potential
from flocking.study.potentials.potential_bounds import Lower, lower_value, steeper_slope
from flocking.study.potentials.potential_limits import Limit
from flocking.study.potentials.potential_shape import (
    FARTHEST,
    MOST_MINIMA,
    NEAREST,
    SAME,
    SAMPLES,
    Minimum,
    Shape,
    same,
    shape_of,
)

SAMPLES_BEYOND = 61
"""Distances beyond the radius at which the slope is computed, four in each decade."""


@dataclass(frozen=True)
class PropertyRow:
    """One property of a potential.

    Parameters
    ----------
    name
        The property.
    holds
        Whether it holds; None where it needs a radius and none is known, or where a limit is not known.
    explanation
        The numbers: what fails and where.
    """

    name: str
    holds: bool | None
    explanation: str


@dataclass(frozen=True)
class DefinitionRow:
    """The properties that a definition requires, as found for one potential.

    Parameters
    ----------
    key, source
        As in `Definition`.
    rows
        The required properties.
    """

    key: str
    source: str
    rows: tuple[PropertyRow, ...]

    @property
    def holds(self) -> bool | None:
        """Whether every property holds; None where none fails and one is open."""
        verdicts = [row.holds for row in self.rows]
        return False if False in verdicts else None if None in verdicts else True


@dataclass(frozen=True, repr=False)
class PotentialReport:
    """Properties of a potential, and the definitions that it meets.

    Parameters
    ----------
    potential
        The potential.
    radius
        The radius R: the one given, else the first distance where the potential is infinite.
    rows
        Its properties.
    definitions
        The definitions with what was found.
    """

    potential: Potential
    radius: float | None
    rows: tuple[PropertyRow, ...]
    definitions: tuple[DefinitionRow, ...]

    def __repr__(self) -> str:
        """In one line: which definitions the potential meets; as a text it is the table."""
        met = "; ".join(f"{d.source}: {_WORDS[d.holds]}" for d in self.definitions)
        return f"<PotentialReport of {self.potential!r}: {met or f'{len(self.rows)} properties'}>"

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
NO_RADIUS = "no radius was given and the potential is infinite at none"

ROUNDING = 1e-12
"""Values above minus this and slopes within it of zero count as nonnegative and zero, relative to the size of the
potential and to that over the radius: rounding lies below it."""

NEAREST_STEP, LAST_FREE_STEP = 12, 6
"""The slope is taken at R - R/10^k for k up to 12, where R - r has three digits; it must be positive for k > 6."""


def _table(rows: tuple[PropertyRow, ...]) -> list[str]:
    width = max((len(row.name) for row in rows), default=0)
    return [f"  {row.name:<{width}}  {_WORDS[row.holds]:<5}  {row.explanation}" for row in rows]


@dataclass(frozen=True)
class Properties:
    """Properties that definitions ask of a potential.

    Parameters
    ----------
    shape
        Shape of the potential.
    radius
        The radius; None where it is unknown.
    everywhere
        Whether the properties are required on all r > 0, else below the radius.
    potential
        The potential itself, of which values between the places looked at are bounded; None where they are not.
    """

    shape: Shape
    radius: float | None
    everywhere: bool = False
    potential: Potential | None = None

    @property
    def end(self) -> float:
        """Upper end of the distances."""
        return np.inf if self.everywhere or self.radius is None else self.radius

    def defined(self) -> PropertyRow:
        """Whether it is real at every sampled distance."""
        end = self.end
        missing = [x for x in self.shape.undefined if x < end]
        text = (
            f"no real value at r = {missing[0]:.3g} and {len(missing) - 1} more of {SAMPLES} samples" if missing else ""
        )
        return PropertyRow("defined", not missing, text or "real at every sampled distance")

    def minima(self) -> list[Minimum]:
        """Local minima."""
        end = self.end
        return [m for m in self.shape.minima if m.at < end and not same(m.at, end, 0.0)]

    def lowest(self) -> tuple[float, float]:
        """Distance and value of the infimum, attained or not."""
        end = self.end
        lows = [(x, v) for x, v in self.shape.lows if not np.isnan(v) and (x < end or x == end == np.inf)]
        edge = None if np.isinf(end) else self.shape.break_at(end)
        if edge is not None and not np.isnan(edge.left[0].value):
            lows = [low for low in lows if not same(low[0], end, 0.0)] + [(end, edge.left[0].value)]
        return min([*lows, *self._between(lows)], key=lambda low: low[1], default=(np.nan, np.nan))

    def _between(self, lows: list[tuple[float, float]]) -> list[tuple[float, float]]:
        """A lower value than those that were found, in a feature too narrow for the search, if there is one."""
        lower = self._lower(min((value for _, value in lows), default=np.nan))
        return [] if np.isnan(lower.value) else [(lower.at, lower.value)]

    def _lower(self, low: float) -> Lower:
        if self.potential is None or not np.isfinite(low):
            return Lower(excluded=True)
        value = low - SAME * max(abs(low), self.shape.energy)
        last = min(self.end * (1.0 - ROUNDING), FARTHEST * self.shape.place)
        return lower_value(self.potential, min(NEAREST * self.shape.place, 0.5 * last), last, value)

    def _in_words(self, low: float) -> str:
        """What is not known of lower values."""
        return "" if self._lower(low).excluded else "; that there are no lower values was searched, not proven"

    def unique(self) -> PropertyRow:
        """Whether the smallest value is a minimum at one distance."""
        name = "unique minimum"
        minima = self.minima()
        where, low = self.lowest()
        if len(self.shape.minima) >= MOST_MINIMA:
            return PropertyRow(name, False, f"has {len(self.shape.minima)} local minima and more")
        if not minima:
            text = f"the values fall to {low:.6g} as r -> {where:.6g}" if not np.isnan(low) else "it has no real values"
            return PropertyRow(name, False, f"has no minimum; {text}")
        best = min(minima, key=lambda m: m.value)
        if low < best.value and not self.shape.same_values(low, best.value):
            text = f"the lowest minimum is {best.value:.9g}, but the values fall to {low:.6g} as r -> {where:.6g}"
            return PropertyRow(name, False, text)
        equal = [m for m in minima if self.shape.same_values(m.value, best.value)]
        others = [m for m in minima if m not in equal]
        if best.flat or len(equal) > 1:
            spots = [f"[{m.at:.9g}, {m.until:.9g}]" if m.flat else f"{m.at:.9g}" for m in equal[:4]]
            more = f" and at least {len(equal) - 4} more" if len(equal) > 4 else ""
            return PropertyRow(name, False, f"the minimum {best.value:.9g} is taken at r = {', '.join(spots)}{more}")
        text = f"{best.value:.9g} at r = {best.at:.9g}"
        if others:
            spots = [f"{m.value:.6g} at r = {m.at:.6g}" for m in others[:3]]
            text += f"; higher local minima: {', '.join(spots)}" + (" ..." if len(others) > 3 else "")
        text += self._in_words(low)
        return PropertyRow(name, True, text)

    def nonnegative(self) -> PropertyRow:
        """Whether no value is negative."""
        where, low = self.lowest()
        undefined = not self.defined().holds or np.isnan(low)
        holds = bool(low >= -ROUNDING * self.shape.energy) and not undefined
        text = f"infimum {low:.9g} at r = {where:.9g}" + (", not defined everywhere" if undefined else "")
        text += self._in_words(low) if holds else ""
        return PropertyRow("nonnegative", holds, text)

    def at_zero(self) -> PropertyRow:
        """Whether it tends to infinity at 0."""
        return PropertyRow("infinite at 0", self.shape.zero.rises, f"tends to {self.shape.zero} as r -> 0")

    def at_radius(self) -> PropertyRow:
        """Whether it tends to infinity at the radius."""
        name = "infinite at R"
        if self.radius is None:
            return PropertyRow(name, None, NO_RADIUS)
        edge = self.shape.break_at(self.radius)
        left = edge.left[0] if edge is not None else Limit("none")
        return PropertyRow(name, left.rises, f"tends to {left} as r -> R = {self.radius:.9g} from below")

    def edge(self) -> PropertyRow:
        """Whether the slope is continuous at the radius."""
        name = "smooth at R"
        edge = None if self.radius is None else self.shape.break_at(self.radius)
        if edge is None:
            return PropertyRow(name, None, NO_RADIUS)
        sides = [f"{what} {a} | {b}" for what, a, b in zip(("value", "slope"), edge.left, edge.right, strict=False)]
        return PropertyRow(name, edge.order >= 1, f"left | right of R = {edge.at:.9g}: {', '.join(sides)}")

    def increasing(self) -> PropertyRow:
        """Whether the slope is positive just below the radius."""
        name = "increasing near R"
        if self.radius is None:
            return PropertyRow(name, None, NO_RADIUS)
        R = self.radius
        slopes = [float(self.shape.slope(R * (1 - 10.0**-k))) for k in range(1, NEAREST_STEP + 1)]
        steps = [k for k, s in enumerate(slopes, start=1) if not s > 0]
        if steps and steps[-1] > LAST_FREE_STEP:
            return PropertyRow(
                name, False, f"slope {slopes[steps[-1] - 1]:.6g} at r = R - R/1e{steps[-1]}, R = {R:.9g}"
            )
        start = max((m.until for m in replace(self, everywhere=False).minima()), default=np.nan)
        since = f"; its last minimum before R is at r = {start:.9g}" if np.isfinite(start) else ""
        return PropertyRow(
            name, True, f"slope {slopes[LAST_FREE_STEP - 1]:.6g} at r = R - R/1e{LAST_FREE_STEP}, R = {R:.9g}{since}"
        )

    def unbounded(self) -> PropertyRow:
        """Whether it tends to infinity at infinity."""
        found = self.shape.infinity
        return PropertyRow("radially unbounded", found.rises, f"tends to {found} as r -> infinity")

    def differentiable(self) -> PropertyRow:
        """Whether the slope is continuous."""
        end = self.end
        broken = [b for b in self.shape.breaks if b.order < 1 and b.at < end and not same(b.at, end, 0.0)]
        text = "; ".join(str(b) for b in broken[:3]) + (f"; {len(broken) - 3} more" if len(broken) > 3 else "")
        continuous = [b for b in self.shape.breaks if b.order == 1 and b.at < end]
        reason = "; ".join(str(b) for b in continuous[:3]) or f"no break of the slope below {end:.9g}"
        defined = self.defined()
        return PropertyRow("differentiable", not broken and bool(defined.holds), text or
                           (reason if defined.holds else defined.explanation))  # fmt: skip

    def constant_beyond(self) -> PropertyRow:
        """Whether the slope is zero beyond the radius."""
        name = "zero slope beyond R"
        if self.radius is None:
            return PropertyRow(name, None, NO_RADIUS)
        R = self.radius
        samples = [float(R * (1 + 10.0**k)) for k in np.linspace(-9, 6, SAMPLES_BEYOND)]
        slopes = [(abs(float(self.shape.slope(x))), x) for x in samples]
        worst = max(slopes, key=lambda pair: np.inf if np.isnan(pair[0]) else pair[0])
        bound = ROUNDING * self.shape.energy / R
        words = ""
        if worst[0] <= bound and self.potential is not None:
            # A feature may be too narrow for the samples.
            steeper = steeper_slope(self.potential, samples[0], samples[-1], bound)
            worst = worst if np.isnan(steeper.at) else (abs(steeper.value), steeper.at)
            words = "" if steeper.excluded else "; that there is no larger one was searched, not proven"
        holds = bool(worst[0] <= bound)
        fix = words if holds else "; Potential.capped(R) makes it constant there"
        return PropertyRow(
            name, holds, f"largest |slope| beyond R = {R:.9g}: {worst[0]:.3g} at r = {worst[1]:.9g}{fix}"
        )

    def smoothness(self) -> PropertyRow:
        """Whether it is twice continuously differentiable."""
        breaks = self.shape.breaks
        worst = min((b.order for b in breaks), default=2)
        text = "; ".join(str(b) for b in breaks[:6] if b.order < 2) or "C2 or smoother for every r > 0"
        return PropertyRow("smooth (C2) for r > 0", worst >= 2, text)


@dataclass(frozen=True)
class Definition:
    """A definition of what counts as a potential.

    Parameters
    ----------
    key
        Its name.
    source
        Where it is stated.
    everywhere
        Whether it is required on all r > 0, else below the radius.
    requirements
        The methods of `Properties` that must hold.
    """

    key: str
    source: str
    everywhere: bool
    requirements: tuple[Callable[[Properties], PropertyRow], ...]


def check_potential(
    potential: Potential | str, *, radius: float | None = None, definitions: Sequence[Definition] = ()
) -> PotentialReport:
    """Find the properties of a potential, and whether it meets the given definitions.

    Limits are taken with 600 digits from the symbolic formula; breaks and minima are searched on [1e-9, 1e9], or that
    range times the length of a potential of which all happens at much smaller or larger distances.
    "Unique minimum" means that the smallest value is taken at one distance only; higher local minima are named.

    Parameters
    ----------
    potential
        The potential, or its formula.
    radius
        Sensing radius R; the first distance where the potential is infinite when absent.
    definitions
        The definitions.

    Raises
    ------
    InvalidInput
        When the radius is not positive or the formula is not in the grammar.
    """
    if isinstance(potential, str):
        potential = Potential(potential)
    if not isinstance(potential, Potential):
        raise InvalidInput("check_potential", "potential", "must be a Potential or a formula", potential)
    if radius is not None:
        radius = number("check_potential", "radius", radius, above=0.0)
    shape = shape_of(potential, radius)
    below = Properties(shape, radius if radius is not None else shape.singular_point(), potential=potential)
    rows = (
        below.defined(), below.unique(), below.nonnegative(), below.at_zero(), below.at_radius(), below.edge(),
        below.increasing(), below.unbounded(), below.smoothness(),
    )  # fmt: skip
    found = tuple(
        DefinitionRow(d.key, d.source, tuple(rule(replace(below, everywhere=d.everywhere)) for rule in d.requirements))
        for d in definitions
    )
    return PotentialReport(potential, below.radius, rows, found)
