"""A picture of margins: of each quantity, how far every conclusion is shown, and where it is refuted or left open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from flocking.formula.safe_digits import given_text
from flocking.show.sheet import sheet
from flocking.show.style import GREEN, ORANGE, PAGE, VERMILION, axes_or_new, in_style, theme
from flocking.study.certificates.beside.margin_lines import MarginLine
from flocking.study.margins.brackets import Count
from flocking.study.margins.margin_table import Margins, Varied

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROW = 0.24
"""Height of a conclusion, in inches."""

SLANT = 60
"""Rotation of labels in degrees: steep enough that neighbours do not overlap."""

STATES = {"shown": GREEN, "refuted": VERMILION, "open": ORANGE}
"""What a level states of a conclusion, and its colour."""


def state_of(count: Count, share: float) -> str:
    """What runs at a level state: shown in enough of them, refuted in one at least, or left open.

    Parameters
    ----------
    count
        The runs.
    share
        Share of them that must show it.
    """
    if count.shown(share):
        return "shown"
    return "refuted" if count.failed else "open"


@in_style
def margins_of(table: Margins, quantity: str, *, lines: Sequence[MarginLine] = (), axes: Axes | None = None) -> Axes:
    """Every conclusion that is shown in the ideal world over the levels of one quantity.

    A bar reaches as far as the conclusion is shown without interruption; dots are levels that were tried. Levels stand
    side by side, evenly, from the ideal world on. Lines are bounds of certificates, placed between the levels.

    Parameters
    ----------
    table
        The margins.
    quantity
        Name of the quantity.
    lines
        What is proven of it, see `flocking.study.certificates.beside.margin_lines.common_lines`.
    axes
        Axes to draw on; a new figure by default.
    """
    one = next(each for each in table.varied if each.name == quantity)
    axes = axes_or_new(axes, width=PAGE, height=1.0 + ROW * max(1, len(table.shown_ideally)))
    keys, levels = list(table.shown_ideally), list(one.levels)
    for row, key in enumerate(keys):
        counts = one.counts.get(key, {})
        bracket = table.margin(quantity, key).bracket
        reach = 0 if bracket.lower is None else 1 + levels.index(bracket.lower)
        axes.plot([0, reach], [row, row], color=theme().faint, lw=5.0, solid_capstyle="butt", gid=f"bar {key}")
        axes.plot([0], [row], "o", color=GREEN, ms=4, zorder=3)
        for state, color in STATES.items():
            states = [state_of(counts[level], table.share) if level in counts else "" for level in levels]
            found = [1 + k for k, name in enumerate(states) if name == state]
            if found:
                axes.plot(found, [row] * len(found), "o", color=color, ms=4, zorder=3, gid=f"{state} {key}",
                          mfc=theme().ground if state == "open" else color)  # fmt: skip
    for line in lines:
        place = place_of(line.value, levels, falling=one.falling)
        axes.plot(
            [place, place], [-0.5, len(keys) - 0.5], ls="--", lw=1.0, color=theme().ink, zorder=2.5,
            gid=f"proven {line.key}", label=f"proven: {line.label} {line.text(3)}",
        )  # fmt: skip
    _label(axes, one, keys, levels)
    return axes


def place_of(value: float, levels: Sequence[float], *, falling: bool) -> float:
    """Where a value lies among levels side by side from 1 on, the ideal world at 0; half a level beyond them at most.

    Parameters
    ----------
    value
        The value.
    levels
        The levels, from the ideal one outwards.
    falling
        Whether smaller levels are further out; the ideal one is then infinite, else zero.
    """
    places = np.arange(len(levels) + 1, dtype=np.float64)
    # Of a quantity whose ideal value is infinite the reciprocal is zero there.
    sizes = np.array([0.0, *((1.0 / x if falling else x) for x in levels)])
    size = 1.0 / value if falling else value
    if size > sizes[-1]:
        return float(places[-1] + 0.5)
    return float(np.interp(size, sizes, places))


def _label(axes: Axes, one: Varied, keys: list[str], levels: list[float]) -> None:
    for state, color in STATES.items():
        axes.plot([], [], "o", color=color, ms=4, mfc=theme().ground if state == "open" else color, label=state)
    axes.legend(ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    axes.set_yticks(np.arange(len(keys)), keys)
    axes.set_xticks(np.arange(len(levels) + 1), ["ideal", *map(given_text, levels)], rotation=SLANT)
    axes.set_xlim(-0.5, len(levels) + 0.5)
    axes.set_ylim(len(keys) - 0.5, -0.5)
    axes.set_xlabel(one.name)


def margins_figure(table: Margins, lines: Mapping[str, Sequence[MarginLine]] | None = None) -> Figure | None:
    """All quantities of a table below each other; None where nothing is shown in the ideal world.

    Parameters
    ----------
    table
        The margins.
    lines
        What is proven, by the names of the quantities.
    """
    rows = len(table.shown_ideally)
    if not table.varied or not rows:
        return None
    proven = lines or {}
    panels = [partial(_panel, table, one.name, proven.get(one.name, ())) for one in table.varied]
    return sheet(panels, columns=1, ratio=(1.0 + ROW * rows) / PAGE)


def _panel(table: Margins, quantity: str, lines: Sequence[MarginLine], axes: Axes) -> Axes:
    return margins_of(table, quantity, lines=lines, axes=axes)
