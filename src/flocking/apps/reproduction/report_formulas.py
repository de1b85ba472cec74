"""Formulas of the report as SVG paths, which need no font."""

from __future__ import annotations

import re
from dataclasses import dataclass
from html import escape

from flocking.model.potentials.potential import Potential

SIZE = 17.0
"""Size of the letters in CSS pixels."""

GAP = 0.6 * SIZE
"""Room between rows, and between a value and its condition."""


@dataclass(frozen=True)
class Drawn:
    """A piece of a formula.

    Parameters
    ----------
    path
        Outline as SVG path data, the baseline at height 0 and y downwards.
    width, height, depth
        Extents in pixels: to the right, above and below the baseline.
    """

    path: str
    width: float
    height: float
    depth: float


def formulas(potential: Potential) -> str:
    """A potential and its slope as two SVG pictures; each with its LaTeX for screen readers.

    Parameters
    ----------
    potential
        The potential.
    """
    import sympy

    r, psi = potential.symbolic()
    return _picture(r"\psi(r)", psi) + _picture(r"\psi'(r)", sympy.diff(psi, r))


def _picture(name: str, expression: object) -> str:
    import sympy

    folded = sympy.piecewise_fold(expression)
    pieces = folded.args if isinstance(folded, sympy.Piecewise) else [(folded, True)]
    rows = [(_drawn(sympy.latex(value)), _condition(when, len(pieces))) for value, when in pieces]
    head = _drawn(f"{name} = ")
    values = max(value.width for value, _ in rows)
    heights = [(max(a.height, b.height), max(a.depth, b.depth)) for a, b in rows]
    total = sum(h + d for h, d in heights) + GAP * (len(rows) - 1)
    left = head.width + (GAP if len(rows) > 1 else 0.0)
    parts, top = [], 0.0
    for (value, when), (height, depth) in zip(rows, heights, strict=True):
        parts += [_placed(value, left, top + height), _placed(when, left + values + 2 * GAP, top + height)]
        top += height + depth + GAP
    # The name is at the only row, or in the middle of several.
    baseline = heights[0][0] if len(rows) == 1 else total / 2 + head.height / 3
    parts.append(_placed(head, 0.0, baseline))
    if len(rows) > 1:
        parts.append(f'<path d="{_brace(total)}" transform="translate({head.width:.1f} 0)"/>')
    width = left + values + max(2 * GAP + when.width if when.width else 0.0 for _, when in rows)
    size = f'width="{width + 4:.0f}" height="{total + 4:.0f}" viewBox="-2 -2 {width + 4:.1f} {total + 4:.1f}"'
    label = escape(f"{name} = {sympy.latex(folded)}")
    return f'<svg role="img" aria-label="{label}" fill="currentColor" {size}>{"".join(parts)}</svg>\n'


def _condition(when: object, rows: int) -> Drawn:
    import sympy

    if rows == 1:
        return Drawn("", 0.0, 0.0, 0.0)
    return _drawn(r"\mathrm{otherwise}" if when == sympy.true else rf"\mathrm{{for}}\ \ {sympy.latex(when)}")


def _placed(piece: Drawn, x: float, y: float) -> str:
    return f'<path d="{piece.path}" transform="translate({x:.1f} {y:.1f})"/>' if piece.path else ""


def _drawn(latex: str) -> Drawn:
    """Outline of a formula without cases, by the typesetter that labels the figures."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.mathtext import MathTextParser
    from matplotlib.textpath import TextPath

    text, font = f"${_roomy(latex)}$", FontProperties(size=SIZE, math_fontfamily="stix")
    extent = MathTextParser("path").parse(text, 72, font)
    words = []
    for points, code in TextPath((0, 0), text, size=SIZE, prop=font).iter_segments(curves=True, simplify=False):
        if code == 79:  # the end of an outline
            words.append("Z")
            continue
        places = " ".join(f"{x:.2f} {-y:.2f}" for x, y in points.reshape(-1, 2))
        words.append({1: "M", 2: "L", 3: "Q", 4: "C"}[int(code)] + places)
    return Drawn("".join(words), float(extent[0]), float(extent[1]), float(extent[2]))


def _roomy(latex: str) -> str:
    """The formula with full-size outer fractions, and space before names of functions."""
    spaced = re.sub(r"(?<=[\w}]) (?=\\(?:log|exp|sin|cos|tan|sinh|cosh|tanh)\b)", r" \\, ", latex)
    depth, found = 0, []
    for piece in re.split(r"(\\frac|[{}])", spaced):
        depth += {"{": 1, "}": -1}.get(piece, 0)
        found.append(r"\dfrac" if piece == r"\frac" and depth == 0 else piece)
    return "".join(found)


def _brace(height: float) -> str:
    """An opening brace of any height, 7 pixels wide."""
    mid, end = f"{height / 2:.1f}", f"{height:.1f}"
    above, below, foot, lip = (f"{y:.1f}" for y in (height / 2 - 5, height / 2 + 5, height - 5, height - 1))
    outer = f"M7 0Q3 0 3 5V{above}Q3 {mid} 0 {mid}Q3 {mid} 3 {below}V{foot}Q3 {end} 7 {end}"
    return f"{outer}V{lip}Q4.4 {lip} 4.4 {foot}V{below}Q4.4 {mid} 1.6 {mid}Q4.4 {mid} 4.4 {above}V5Q4.4 1 7 1Z"
