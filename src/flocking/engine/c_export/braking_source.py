"""Source of the steering terms of agents that brake in time, see `flocking.model.terms.braking`."""

from __future__ import annotations

from typing import cast

from flocking.engine.c_export.steering_blocks import each_axis, loop, number
from flocking.formula.c_source import CSource
from flocking.model.terms.braking import BrakingAlignment, LinearRepulsion, SelfPropulsion, ShillDisc, ShillWalls
from flocking.model.terms.steering import Steering


def linear_repulsion(given: Steering, c: CSource, dimension: int) -> str:
    """Block of a `LinearRepulsion`.

    Parameters
    ----------
    given
        The term.
    c
        Writes numbers.
    dimension
        Number of axes.
    """
    term = cast(LinearRepulsion, given)
    lines = [
        f"if (r < {number(term.radius)})", "{",
        f"    const $real push = {number(term.slope)} * ({number(term.radius)} - r);",
        f"    const $real size = (push < {number(term.most)}) ? push : {number(term.most)};",
        "    $real way[$XDIMENSION];", "    $xdirection(seen->offset[slot], way);",
        *(f"    {x}" for x in each_axis("total[axis] = total[axis] - (size * way[axis]);").splitlines()), "}",
    ]  # fmt: skip
    return loop("LinearRepulsion", "", lines, "total[axis]")


def braking_alignment(given: Steering, c: CSource, dimension: int) -> str:
    """Block of a `BrakingAlignment`.

    Parameters
    ----------
    given
        The term.
    c
        Writes numbers.
    dimension
        Number of axes.
    """
    term = cast(BrakingAlignment, given)
    slack = number(term.slack)
    lines = [
        f"if (r < {number(term.range)})", "{",
        f"    const $real most = $xbraking_speed(r - {number(term.radius)}, {number(term.acceleration)}, "
        f"{number(term.slope)});",
        f"    const $real allowed = (most > {slack}) ? most : {slack};",
        "    $real difference[$XDIMENSION];", "    $real excess[$XDIMENSION];",
        *(f"    {x}" for x in each_axis("difference[axis] = memory->known[slot].p[axis] - p[axis];").splitlines()),
        "    $xexcess(difference, allowed, excess);",
        *(f"    {x}" for x in
          each_axis(f"total[axis] = total[axis] + ({number(term.gain)} * excess[axis]);").splitlines()), "}",
    ]  # fmt: skip
    return loop("BrakingAlignment", "", lines, "total[axis]")


def self_propulsion(given: Steering, c: CSource, dimension: int) -> str:
    """Block of a `SelfPropulsion`.

    Parameters
    ----------
    given
        The term.
    c
        Writes numbers.
    dimension
        Number of axes.
    """
    speed = number(cast(SelfPropulsion, given).speed)
    return f"""\
    {{
        /* SelfPropulsion */
        $real way[$XDIMENSION];
        uint32_t axis;
        $xdirection(p, way);
        for (axis = 0u; axis < $XDIMENSION; axis++)
        {{
            sum[axis] = sum[axis] + ({speed} * way[axis]);
        }}
    }}
"""


def shill_walls(given: Steering, c: CSource, dimension: int) -> str:
    """Block of a `ShillWalls`.

    Parameters
    ----------
    given
        The term.
    c
        Writes numbers.
    dimension
        Number of axes.
    """
    term = cast(ShillWalls, given)
    c.used.add("fabs")
    far, offset = number(term.half_width), number(term.offset)
    return f"""\
    {{
        /* ShillWalls */
        $real total[$XDIMENSION];
        uint32_t wall;
        uint32_t axis;
        for (axis = 0u; axis < $XDIMENSION; axis++)
        {{
            total[axis] = #0#;
        }}
        for (wall = 0u; wall < $XDIMENSION; wall++)
        {{
            if ((q[wall] < #0#) || (q[wall] > #0#))
            {{
                const $real distance = ({far} - $xfabs(q[wall])) - {offset};
                const $real most = $xbraking_speed(distance, {number(term.acceleration)}, {number(term.slope)});
                $real difference[$XDIMENSION];
                $real excess[$XDIMENSION];
                for (axis = 0u; axis < $XDIMENSION; axis++)
                {{
                    difference[axis] = -p[axis];
                }}
                difference[wall] = ((q[wall] > #0#) ? {number(-term.speed)} : {number(term.speed)}) - p[wall];
                $xexcess(difference, most, excess);
                for (axis = 0u; axis < $XDIMENSION; axis++)
                {{
                    total[axis] = total[axis] + excess[axis];
                }}
            }}
        }}
        for (axis = 0u; axis < $XDIMENSION; axis++)
        {{
            sum[axis] = sum[axis] + total[axis];
        }}
    }}
"""


def shill_disc(given: Steering, c: CSource, dimension: int) -> str:
    """Block of a `ShillDisc`.

    Parameters
    ----------
    given
        The term.
    c
        Writes numbers.
    dimension
        Number of axes.
    """
    term = cast(ShillDisc, given)
    centre = ", ".join(number(x) for x in term.centre)
    return f"""\
    {{
        /* ShillDisc */
        static const $real centre[$XDIMENSION] = {{ {centre} }};
        $real offset[$XDIMENSION];
        $real way[$XDIMENSION];
        $real excess[$XDIMENSION];
        $real most;
        uint32_t axis;
        for (axis = 0u; axis < $XDIMENSION; axis++)
        {{
            offset[axis] = q[axis] - centre[axis];
        }}
        most = $xbraking_speed($xlength(offset) - {number(term.radius)},
            {number(term.acceleration)}, {number(term.slope)});
        $xdirection(offset, way);
        for (axis = 0u; axis < $XDIMENSION; axis++)
        {{
            way[axis] = ({number(term.speed)} * way[axis]) - p[axis];
        }}
        $xexcess(way, most, excess);
        for (axis = 0u; axis < $XDIMENSION; axis++)
        {{
            sum[axis] = sum[axis] + excess[axis];
        }}
    }}
"""
