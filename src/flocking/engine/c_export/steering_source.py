"""Source of steering terms, which state functions of arrays: the same computation as their `steer`, over what is known.

A term sees all of whom a state is known, within its own radius and cone, not those that the graph links.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

from flocking.engine.c_export.braking_source import (
    braking_alignment,
    linear_repulsion,
    self_propulsion,
    shill_disc,
    shill_walls,
)
from flocking.engine.c_export.projection_source import filled
from flocking.engine.c_export.steering_blocks import FACTOR, FUNCTIONS, LARGE, each_axis, loop, number
from flocking.errors import UnsupportedLaw
from flocking.formula.c_source import CSource
from flocking.model.terms.braking import BrakingAlignment, LinearRepulsion, SelfPropulsion, ShillDisc, ShillWalls
from flocking.model.terms.steering import ALL_ROUND, Alignment, Cohesion, Separation, Steering, TurnBack

SIMPLE_POWERS = {0.0: "", 1.0: "$real power = r;", 2.0: "$real power = r * r;", 0.5: "$real power = $xsqrt(r);"}
"""Powers of the distance that need no function but the root."""


def check_steering_terms(terms: Sequence[Steering]) -> None:
    """Refuse by name terms of other kinds.

    Parameters
    ----------
    terms
        The steering terms of a law.

    Raises
    ------
    UnsupportedLaw
        When there is one.
    """
    for term in terms:
        if type(term) not in _WRITERS:
            raise UnsupportedLaw(
                f"export_c cannot write {type(term).__name__} in C: its force is a function of arrays of its own."
            )


def steering_source(terms: Sequence[Steering], c: CSource, dimension: int) -> str:
    """Blocks that add the forces of terms to ``sum``, in their order.

    Parameters
    ----------
    terms
        Terms that `check_steering_terms` lets pass.
    c
        Writes numbers.
    dimension
        Number of axes.
    """
    return "".join(filled(_WRITERS[type(term)](term, c, dimension), c) for term in terms)


def steering_functions(blocks: str, c: CSource) -> str:
    """Functions that blocks call.

    Parameters
    ----------
    blocks
        All source after these functions, what `steering_source` gave among it.
    c
        Writes numbers.
    """
    found = ""
    numbers = {"@large@": f"#{LARGE[c.single]!r}#", "@factor@": f"#{FACTOR[c.single]!r}#"}
    for name, text in reversed(FUNCTIONS.items()):
        if f"{c.prefix}{name}(" in blocks + found:
            for mark, number_of in numbers.items():
                text = text.replace(mark, number_of)
            found = filled(text, c) + found
    if found:
        c.used.add("sqrt")
    return found


def steering_latex(term: Steering) -> str:
    """The formula of a term as LaTeX, with its numbers.

    Parameters
    ----------
    term
        A term that `check_steering_terms` lets pass.
    """
    numbers = ", ".join(f"\\mathrm{{{k}}} = \\mathrm{{{v}}}" for k, v in vars(term).items() if not k.startswith("_"))
    return f"{_LATEX[type(term)]} \\qquad ({numbers})".replace("_", r"\_")


def _cone(term: Separation | Alignment | Cohesion, added: str, c: CSource, among: str = "") -> str:
    """A loop over those that a term sees in its cone, which adds to ``total``."""
    test = f"r < {number(term.radius)}"
    before, lines = "", []
    if term.cosine > ALL_ROUND:
        before += "        const $real speed = $xlength(p);\n"
        lines += [
            "$real ahead = seen->offset[slot][0] * p[0];", "uint32_t ahead_axis;",
            "for (ahead_axis = 1u; ahead_axis < $XDIMENSION; ahead_axis++)", "{",
            "    ahead = ahead + (seen->offset[slot][ahead_axis] * p[ahead_axis]);", "}",
        ]  # fmt: skip
        near = f"(r < {number(term.near)}) || " if term.near > 0.0 else ""
        test = f"({test}) && ({near}(!(speed > #0#)) || (ahead > (({number(term.cosine)} * r) * speed)))"
    counted = term.total == "mean"
    before += "        uint32_t count = 0u;\n" if counted else ""
    count = "count++;" if counted and not among else ""
    lines += [f"if ({test})", "{", *(f"    {x}" for x in added.splitlines()), f"    {count}" if count else "", "}"]
    lines += [f"if (r < {among})", "{", "    count++;", "}"] if among else []
    result = f"({number(term.weight)} * total[axis])"
    if term.total == "direction":
        result = f"({number(term.weight)} * ((length > #0#) ? (total[axis] / length) : total[axis]))"
    elif counted:
        result = f"({result} / ((count > 1u) ? ($real)count : #1#))"
    text = loop(type(term).__name__, before, lines, result)
    if term.total == "direction":
        # The length is that of the whole sum.
        last = "        for (axis = 0u; axis < $XDIMENSION; axis++)\n        {\n            sum"
        text = text.replace(last, "        length = $xlength(total);\n" + last)
        text = text.replace("        uint32_t axis;\n", "        $real length;\n        uint32_t axis;\n", 1)
    return text


def _separation(given: Steering, c: CSource, dimension: int) -> str:
    term = cast(Separation, given)
    power = SIMPLE_POWERS.get(term.exponent, f"$real power = $xpow(r, {number(term.exponent)});")
    if term.exponent not in SIMPLE_POWERS:
        c.used.add("pow")
    divided = " / power" if power else ""
    added = f"if (r > #0#)\n{{\n    const {power}\n" if power else "if (r > #0#)\n{\n"
    added += "\n".join(
        f"    {x}" for x in each_axis(f"total[axis] = total[axis] - (seen->offset[slot][axis]{divided});").splitlines()
    )
    among = "" if term.among is None else number(term.among)
    return _cone(term, f"{added}\n}}", c, among)


def _alignment(given: Steering, c: CSource, dimension: int) -> str:
    term = cast(Alignment, given)
    if term.compared == "headings":
        added = "$real their[$XDIMENSION];\n$xdirection(memory->known[slot].p, their);\n"
        value, own = "their[axis]", "own[axis]"
    else:
        added, value, own = "", "memory->known[slot].p[axis]", "p[axis]"
    value = f"({value} - {own})" if term.relative else value
    text = _cone(term, added + each_axis(f"total[axis] = total[axis] + {value};"), c)
    if term.compared == "headings" and term.relative:
        text = text.replace("        for (axis", "        $xdirection(p, own);\n        for (axis", 1)
        text = text.replace("        uint32_t axis;\n", "        $real own[$XDIMENSION];\n        uint32_t axis;\n", 1)
    return text


def _cohesion(given: Steering, c: CSource, dimension: int) -> str:
    return _cone(cast(Cohesion, given), each_axis("total[axis] = total[axis] + seen->offset[slot][axis];"), c)


def _turn_back(given: Steering, c: CSource, dimension: int) -> str:
    term = cast(TurnBack, given)
    radius, speed = number(term.radius), number(term.speed)
    return f"""\
    {{
        /* TurnBack */
        const $real distance = $xlength(q);
        if (distance >= {radius})
        {{
            const $real share = {speed} / distance;
            $real ahead[$XDIMENSION];
            $real difference[$XDIMENSION];
            $real along = #0#;
            uint32_t axis;
            $xdirection(p, ahead);
            for (axis = 0u; axis < $XDIMENSION; axis++)
            {{
                difference[axis] = ((-q[axis]) * ((share < #1#) ? share : #1#)) - p[axis];
                along = along + (difference[axis] * ahead[axis]);
            }}
            for (axis = 0u; axis < $XDIMENSION; axis++)
            {{
                sum[axis] = sum[axis] + (difference[axis] - (along * ahead[axis]));
            }}
        }}
    }}
"""


_WRITERS: dict[type[Steering], Callable[[Steering, CSource, int], str]] = {
    Separation: _separation, Alignment: _alignment, Cohesion: _cohesion, TurnBack: _turn_back,
    SelfPropulsion: self_propulsion, LinearRepulsion: linear_repulsion, BrakingAlignment: braking_alignment,
    ShillWalls: shill_walls, ShillDisc: shill_disc,
}  # fmt: skip
"""Who writes a term, by its class: a subclass may steer otherwise."""

_SEEN = r"\sum_{r_{ij} < \mathrm{radius},\ \mathrm{in\ the\ cone}}"
_LATEX: dict[type[Steering], str] = {
    Separation: rf"\mathrm{{weight}} \cdot \mathrm{{total}} \left( -{_SEEN} (q_j - q_i) / r_{{ij}}^k \right)",
    Alignment: rf"\mathrm{{weight}} \cdot \mathrm{{total}} \left( {_SEEN} (h_j - h_i) \right)",
    Cohesion: rf"\mathrm{{weight}} \cdot \mathrm{{total}} \left( {_SEEN} (q_j - q_i) \right)",
    TurnBack: (
        r"(I - h_i h_i^T) \left( -q_i \min(1, \mathrm{speed} / |q_i|) - p_i \right), "
        r"\quad |q_i| \ge \mathrm{radius}"
    ),
    SelfPropulsion: r"\mathrm{speed}\ p_i / |p_i|",
    LinearRepulsion: (
        r"-\sum_{r_{ij} < \mathrm{radius}} "
        r"\min(\mathrm{slope} (\mathrm{radius} - r_{ij}), \mathrm{most})\, n_{ij}"
    ),
    BrakingAlignment: (
        r"\mathrm{gain} \sum_{r_{ij} < \mathrm{range}} "
        r"\max(|\Delta p| - \max(\mathrm{slack}, D), 0)\, \Delta p / |\Delta p|"
    ),
    ShillWalls: r"\sum_{\mathrm{axes}} \max(|s - p_i| - D, 0)\, (s - p_i) / |s - p_i|",
    ShillDisc: r"\max(|s - p_i| - D, 0)\, (s - p_i) / |s - p_i|",
}  # fmt: skip
"""Formulas of the terms, as their docstrings state them."""
