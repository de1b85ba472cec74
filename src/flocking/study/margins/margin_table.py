"""The table of margins: which conclusions stand how much of which quantity, with the evidence for each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from flocking.formula.safe_digits import given_text
from flocking.study.confidence_intervals import Interval
from flocking.study.margins.brackets import Bracket, Count, bracket, islands, open_everywhere, open_from_ideal


@dataclass(frozen=True)
class Margin:
    """What one conclusion stands of one quantity.

    Parameters
    ----------
    quantity, conclusion
        Names of both.
    counts
        Runs that show it, refute it and leave it open, by level.
    bracket
        The first level at which it is not shown, and the last one before.
    islands
        Spans of levels beyond, at which it is shown again.
    """

    quantity: str
    conclusion: str
    counts: Mapping[float, Count]
    bracket: Bracket
    islands: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Varied:
    """A quantity as it was varied.

    Parameters
    ----------
    name, meaning
        The quantity.
    world
        What was not ideal at the last level, in words: it states the base world too.
    counts
        By conclusion and level.
    falling
        Whether smaller levels are further from the ideal one.
    base
        What is not ideal about the world at level 0, where nothing of the quantity is varied yet; empty where no runs
        were made there.
    """

    name: str
    meaning: str
    world: str
    counts: Mapping[str, Mapping[float, Count]]
    falling: bool = False
    base: str = ""

    @property
    def levels(self) -> tuple[float, ...]:
        """All levels that were tried, from the ideal one outwards."""
        found = {level for counts in self.counts.values() for level in counts}
        return tuple(sorted(found, reverse=self.falling))


@dataclass(frozen=True)
class Margins:
    """Margins of the conclusions of a scenario: observations on the runs made, at the levels tried.

    Parameters
    ----------
    scenario
        Name of the scenario.
    statements
        Statement of each conclusion by its key.
    ideal
        Runs in the ideal world, by conclusion; those whose run is not shown to meet its hypothesis are not counted
        anywhere.
    varied
        The quantities.
    refused
        Quantities that could not be varied, with the reason.
    share
        Share of the runs that must show a conclusion at a level.
    width
        Width to which brackets were to be narrowed, as a share of their larger end.
    confidence
        Level of confidence of the intervals.
    seeds
        The seeds.
    runs
        Number of runs made.
    status
        ``"finished"``, ``"interrupted"``, or that the number of runs did not suffice.
    provenance
        Versions of the software.
    refused_levels
        Levels by quantity at which its scenario could not be made, with the reason; nothing is known there.
    failures
        Message of the first run that failed, by its world, such as ``"loss=0.2"``; such runs count as open.
    """

    scenario: str
    statements: Mapping[str, str]
    ideal: Mapping[str, Count]
    varied: tuple[Varied, ...]
    refused: Mapping[str, str]
    share: float
    width: float
    confidence: float
    seeds: tuple[int, ...]
    runs: int
    status: str
    provenance: Mapping[str, object] = field(default_factory=dict)
    refused_levels: Mapping[str, Mapping[float, str]] = field(default_factory=dict)
    failures: Mapping[str, str] = field(default_factory=dict)

    @property
    def shown_ideally(self) -> tuple[str, ...]:
        """Conclusions that are shown in the ideal world, the only ones that have margins."""
        return tuple(key for key, count in self.ideal.items() if count.shown(self.share))

    @property
    def rows(self) -> list[Margin]:
        """One margin for each quantity and conclusion that is shown in the ideal world."""
        found = []
        for one in self.varied:
            for key in self.shown_ideally:
                counts = one.counts.get(key, {})
                where = bracket(counts, self.share, falling=one.falling)
                spans = islands(where, tuple(counts), falling=one.falling)
                found.append(Margin(one.name, key, counts, where, tuple(spans)))
        return found

    def margin(self, quantity: str, conclusion: str) -> Margin:
        """The margin of one conclusion in one quantity.

        Raises
        ------
        KeyError
            When there is none.
        """
        for row in self.rows:
            if (row.quantity, row.conclusion) == (quantity, conclusion):
                return row
        raise KeyError(f"{quantity}, {conclusion}")

    @property
    def _most_runs(self) -> int:
        """Number of runs of all seeds in the ideal world and at each level."""
        return len(self.seeds) * (1 + sum(len(one.levels) for one in self.varied))

    @property
    def notes(self) -> list[str]:
        """What the table rests on, in sentences."""
        share = "every run" if self.share == 1 else f"{100 * self.share:g} % of the runs"
        found = [
            f"Observed on {self.runs} runs, {len(self.seeds)} seed{'s' * (len(self.seeds) != 1)} at a level, the same "
            f"at all. A level counts where {share} shows the conclusion by the end of the run.",
            *(
                []
                if self.runs >= self._most_runs
                else ["Seeds whose scenarios are equal in a world are one run there."]
            ),
            "Nothing is known between and beyond the levels tried. Runs that neither show nor refute a conclusion are "
            "open and do not count as showing it.",
            "Runs are taken as computed: what their numerical error may change is not counted.",
        ]
        found += [f"{one.name}: {one.meaning}. World at the last level: {one.world}." for one in self.varied]
        found += [f"{name} was not varied: {why}" for name, why in self.refused.items()]
        for name, levels in self.refused_levels.items():
            for why in dict.fromkeys(levels.values()):
                there = ", ".join(given_text(level) for level in sorted(levels) if levels[level] == why)
                found.append(f"{name} was refused at {there}, where nothing is known: {why}")
        found += [
            f"Runs that failed count as open; the first of {world}: {why}" for world, why in self.failures.items()
        ]
        for one in self.varied:
            refuted = [
                key for key in self.shown_ideally if one.counts.get(key, {}).get(0.0, Count()).refuted(self.share)
            ]
            if refuted and one.base:
                found.append(
                    f"{one.name}: refuted at 0 already, where nothing of it is varied: {', '.join(refuted)}. What "
                    f"these do not stand is the world in which it is varied: {one.base}."
                )
        for key, count in self.ideal.items():
            if not count.shown(self.share):
                found.append(f"{key} has no margin: {_counted(count)} in the ideal world.")
        if self.status != "finished":
            found.append(f"Brackets may be wider than requested: {self.status}.")
        return found

    @property
    def head(self) -> tuple[str, ...]:
        """Names of the columns of `cells`."""
        interval = f"{100 * self.confidence:g} %"
        return ("quantity", "conclusion", "shown to", "runs there", interval, "not at", "runs there", "again at")

    @property
    def cells(self) -> list[tuple[str, ...]]:
        """The table as text, one row for each of `rows`."""
        return [self._cells(row) for row in self.rows]

    def _cells(self, row: Margin) -> tuple[str, ...]:
        if open_everywhere(row.counts):
            runs = sum(count.total for count in row.counts.values())
            return (row.quantity, row.conclusion, "not known", "", "", "open at all tried", f"{runs} open", "")
        lower, upper = row.bracket.lower, row.bracket.upper
        if upper is not None and open_from_ideal(row.counts, row.bracket):
            first = self._first_refuted(row)
            where, there = "refuted at none", ""
            if first is not None:
                where, there = given_text(first), _counted(row.counts[first])
            shown = (f"not known, open at {given_text(upper)}", _counted(row.counts[upper]), "")
            return (row.quantity, row.conclusion, *shown, where, there, _spans(row))
        at_lower = self.ideal[row.conclusion] if lower is None else row.counts[lower]
        interval = at_lower.interval(self.confidence)
        return (
            row.quantity, row.conclusion, "ideal" if lower is None else given_text(lower),
            f"{at_lower.held}/{at_lower.total}",
            _outwards(interval) if at_lower.total > 1 else "one run",
            "all tried" if upper is None else given_text(upper),
            "" if upper is None else _counted(row.counts[upper]), _spans(row),
        )  # fmt: skip

    def _first_refuted(self, row: Margin) -> float | None:
        """The first level at which a conclusion is refuted, from the ideal one outwards; None where it is at none."""
        falling = next(one.falling for one in self.varied if one.name == row.quantity)
        return next(
            (level for level in sorted(row.counts, reverse=falling) if row.counts[level].refuted(self.share)), None
        )

    def as_dict(self) -> dict[str, object]:
        """Plain data for ``margins.json``."""
        return {
            "format": 1,
            "scenario": self.scenario,
            "status": self.status,
            "runs": self.runs,
            "seeds": list(self.seeds),
            "share": self.share,
            "width": self.width,
            "confidence": self.confidence,
            "conclusions": [
                {"key": key, "statement": text, "ideal": self._count_data(self.ideal[key])}
                for key, text in self.statements.items()
            ],
            "quantities": [
                {
                    "name": one.name, "meaning": one.meaning, "world": one.world, "falling": one.falling,
                    "base": one.base,
                    "levels": list(one.levels),
                    "counts": {
                        key: [{"level": level, **self._count_data(counts[level])} for level in one.levels
                              if level in counts]
                        for key, counts in one.counts.items()
                    },
                }
                for one in self.varied
            ],
            "margins": [self._margin_data(row) for row in self.rows],
            "refused": dict(self.refused),
            "refused_levels": [
                {"quantity": name, "level": level, "why": why}
                for name, levels in self.refused_levels.items()
                for level, why in sorted(levels.items())
            ],
            "failures": dict(self.failures),
            "provenance": dict(self.provenance),
        }  # fmt: skip

    def _margin_data(self, row: Margin) -> dict[str, object]:
        unknown = open_from_ideal(row.counts, row.bracket)
        return {
            "quantity": row.quantity, "conclusion": row.conclusion, "open": unknown,
            "shown_to": row.bracket.lower, "again": [list(span) for span in row.islands],
            "not_at": self._first_refuted(row) if unknown else row.bracket.upper,
        }  # fmt: skip

    def _count_data(self, count: Count) -> dict[str, object]:
        found: dict[str, object] = {"held": count.held, "failed": count.failed, "open": count.left_open}
        if count.total > 1:
            interval = count.interval(self.confidence)
            found |= {"low": interval.low, "high": interval.high}
        return found

    def __str__(self) -> str:
        lines = [self.head, *self.cells]
        widths = [max(len(line[k]) for line in lines) for k in range(len(self.head))]
        table = ["  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip() for line in lines]
        return "\n".join([*table, "", *self.notes])


def margins_from(data: Mapping[str, object]) -> Margins:
    """Margins from the plain data of `Margins.as_dict`.

    Raises
    ------
    InvalidInput
        When the data are not such.
    """
    from flocking.errors import InvalidInput

    try:
        return _read(data)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InvalidInput("margins", "data", "must be the content of a margins.json", repr(error)) from None


def _read(data: Mapping[str, object]) -> Margins:
    def count(entry: Mapping[str, int]) -> Count:
        return Count(int(entry["held"]), int(entry["failed"]), int(entry["open"]))

    read: dict[str, list[dict[str, object]]] = {name: list(data[name]) for name in ("conclusions", "quantities")}  # type: ignore[call-overload]
    if data["format"] != 1:
        raise ValueError("format")
    varied = []
    for one in read["quantities"]:
        counts = {
            key: {float(entry["level"]): count(entry) for entry in entries}
            for key, entries in one["counts"].items()  # type: ignore[attr-defined]
        }
        words = str(one["name"]), str(one["meaning"]), str(one["world"])
        varied.append(Varied(*words, counts, bool(one["falling"]), str(one.get("base", ""))))
    refused: dict[str, dict[float, str]] = {}
    for entry in data.get("refused_levels", ()):  # type: ignore[attr-defined]
        refused.setdefault(str(entry["quantity"]), {})[float(entry["level"])] = str(entry["why"])
    return Margins(
        str(data["scenario"]), {str(c["key"]): str(c["statement"]) for c in read["conclusions"]},
        {str(c["key"]): count(c["ideal"]) for c in read["conclusions"]}, tuple(varied),  # type: ignore[arg-type]
        dict(data["refused"]), float(data["share"]), float(data["width"]), float(data["confidence"]),  # type: ignore
        tuple(data["seeds"]), int(data["runs"]), str(data["status"]), dict(data["provenance"]),  # type: ignore
        refused, dict(data.get("failures", {})),  # type: ignore
    )  # fmt: skip


def _outwards(interval: Interval) -> str:
    """An interval with two decimals that holds all of it."""
    return f"{math.floor(100 * interval.low) / 100:.2f} to {math.ceil(100 * interval.high) / 100:.2f}"


def _spans(row: Margin) -> str:
    return ", ".join(f"{given_text(a)}" if a == b else f"{given_text(a)} to {given_text(b)}" for a, b in row.islands)


def counts_of(verdicts: list[str]) -> Count:
    """Counts of runs from the ``verdicts`` on a conclusion, one for each run."""
    held, failed = verdicts.count("holds"), verdicts.count("fails")
    return Count(held, failed, len(verdicts) - held - failed)


def _counted(count: Count) -> str:
    parts = [(count.held, "show it"), (count.failed, "refute it"), (count.left_open, "open")]
    return ", ".join(f"{number} {what}" for number, what in parts if number) or "no runs"
