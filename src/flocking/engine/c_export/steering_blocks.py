"""Pieces of the source of steering terms: loops over all of whom a state is known, and functions that they call."""

from __future__ import annotations

from collections.abc import Sequence

LARGE = {False: 2.0**500, True: 2.0**60}
"""Length above which a vector is made smaller before it is squared, in double and in single precision.

The squares of what is shorter, and the sum of as many as there are axes, are finite.
"""

FACTOR = {False: 2.0**-520, True: 2.0**-70}
"""Power of two by which it is made smaller: squares of all finite numbers, and sums of some hundred, are finite then.

Components that are lost by it are below 1e-36 of the length.
"""

FUNCTIONS = {
    "length": """\
static $real $xlength(const $real a[$XDIMENSION])
{
    $real sum = a[0] * a[0];
    uint32_t k;
    for (k = 1u; k < $XDIMENSION; k++)
    {
        sum = sum + (a[k] * a[k]);
    }
    return $xsqrt(sum);
}

""",
    "lowered": """\
/* The length of a vector; where its square may overflow the vector is made smaller by a power of two before. */
static $real $xlowered($real a[$XDIMENSION])
{
    $real size = $xlength(a);
    if (size > @large@)
    {
        uint32_t k;
        for (k = 0u; k < $XDIMENSION; k++)
        {
            a[k] = a[k] * @factor@;
        }
        size = $xlength(a);
    }
    return size;
}

""",
    "scaled": """\
/* Give a vector another length. */
static void $xscaled($real a[$XDIMENSION], $real most)
{
    const $real share = most / $xlowered(a);
    uint32_t k;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        a[k] = a[k] * share;
    }
}

""",
    "direction": """\
/* The unit vector of a vector; zero where it is zero. */
static void $xdirection(const $real a[$XDIMENSION], $real found[$XDIMENSION])
{
    const $real length = $xlength(a);
    uint32_t k;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        found[k] = (length > #0#) ? (a[k] / length) : a[k];
    }
}

""",
    "braking_speed": """\
/* The largest speed from which one stops within a distance, by a braking curve. */
static $real $xbraking_speed($real x, $real acceleration, $real slope)
{
    const $real linear = slope * x;
    const $real meet = acceleration / slope;
    $real found = #0#;
    if (x > #0#)
    {
        const $real square = ((#2# * acceleration) * x) - (meet * meet);
        found = (linear < meet) ? linear : $xsqrt((square > #0#) ? square : #0#);
    }
    return found;
}

""",
    "excess": """\
/* What of a difference of velocities is more than is allowed. */
static void $xexcess(const $real difference[$XDIMENSION], $real allowed, $real found[$XDIMENSION])
{
    const $real size = $xlength(difference) - allowed;
    uint32_t k;
    $xdirection(difference, found);
    for (k = 0u; k < $XDIMENSION; k++)
    {
        found[k] = ((size > #0#) ? size : #0#) * found[k];
    }
}

""",
}
"""Functions that blocks call, each after those that it calls itself."""

_LOOP = """\
    {
        /* @name@ */
        $real total[$XDIMENSION];
@before@        uint32_t axis;
        for (axis = 0u; axis < $XDIMENSION; axis++)
        {
            total[axis] = #0#;
        }
        for (k = 0u; k < memory->count; k++)
        {
            const uint16_t slot = memory->order[k];
            const $real r = seen->distance[slot];
@inside@        }
        for (axis = 0u; axis < $XDIMENSION; axis++)
        {
            sum[axis] = sum[axis] + @result@;
        }
    }
"""


def number(value: float) -> str:
    """A number as templates take it.

    Parameters
    ----------
    value
        The number.
    """
    return f"#{float(value)!r}#"


def loop(name: str, before: str, lines: Sequence[str], result: str) -> str:
    """A block that adds to ``total`` over all of whom a state is known, and then a result to ``sum``.

    Parameters
    ----------
    name
        Name of the term.
    before
        Declarations before the loop.
    lines
        Lines inside it.
    result
        What is added on each axis.
    """
    inside = "".join(f"            {line}\n" for line in lines if line)
    text = _LOOP.replace("@name@", name).replace("@before@", before).replace("@inside@", inside)
    return text.replace("@result@", result)


def each_axis(statement: str) -> str:
    """A loop over the axes.

    Parameters
    ----------
    statement
        What it does on each.
    """
    return f"for (axis = 0u; axis < $XDIMENSION; axis++)\n{{\n    {statement}\n}}"
