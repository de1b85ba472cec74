"""Source of the nearest acceleration that satisfies linear conditions and is no larger than the largest one."""

from __future__ import annotations

import re
from dataclasses import dataclass

from flocking.arrays import Array
from flocking.formula.c_source import CSource


@dataclass(frozen=True)
class Slacks:
    """Roundings of one precision, relative to the largest acceleration or the desired one.

    Parameters
    ----------
    rounding
        Rounding with which a condition counts as satisfied.
    parallel
        Sine of the angle below which planes count as parallel.
    relaxed
        Relaxation, by the largest acceleration, that rounding explains.
    halvings
        Halvings of an interval in which a share or a relaxation is sought: the bits of a number, and a few.
    farthest
        Largest acceleration that is looked at, by the largest one allowed.
    """

    rounding: float
    parallel: float
    relaxed: float
    halvings: int
    farthest: float


DOUBLE = Slacks(1e-12, 1e-6, 1e-9, 60, 1e6)
"""Those of `flocking.engine.sampled.nearest_force`."""

SINGLE = Slacks(2e-6, 3e-4, 1e-4, 28, 1e3)
"""A scalar product of three numbers rounds by 3e-7 of its largest; the others follow as in double precision."""


def filled(text: str, c: CSource) -> str:
    """A template of C: ``$x`` begins names, ``$X`` those of constants, ``$real`` is the type, ``#0.5#`` a number.

    Parameters
    ----------
    text
        The template.
    c
        Writes numbers.
    """
    found = text.replace("$real", f"{c.prefix}real").replace("$x", c.prefix).replace("$X", c.prefix.upper())
    return re.sub(r"#([-+.e0-9]+)#", lambda number: c.literal(float(number[1])), found)


def of_agent(c: CSource, name: str, values: Array) -> str:
    """A function that gives a number of each agent.

    Parameters
    ----------
    c
        Writes numbers.
    name
        Name of the function, without its begin.
    values
        Shape (N,).
    """
    x, real = c.prefix, f"{c.prefix}real"
    if (values == values[0]).all():
        body = f"    (void)agent;\n    return {c.literal(float(values[0]))};\n"
        return f"static {real} {x}{name}(uint16_t agent)\n{{\n{body}}}\n\n"
    row = ", ".join(c.literal(float(v)) for v in values)
    table = f"static const {real} {x}{name}_of[{len(values)}] = {{ {row} }};\n"
    return f"{table}static {real} {x}{name}(uint16_t agent)\n{{\n    return {x}{name}_of[agent];\n}}\n\n"


def projection_source(c: CSource, dimension: int, conditions: int) -> str:
    """Source of ``nearest``.

    The conditions are taken one after another: where the nearest point of those before breaks one, the nearest point of
    all up to it lies on its plane, where the same is done in one dimension less. Every loop ends after the number of
    conditions, and there are as many loops inside each other as axes.

    Parameters
    ----------
    c
        Writes numbers.
    dimension
        Number of axes.
    conditions
        Largest number of conditions.
    """
    c.used.add("sqrt")
    slacks = SINGLE if c.single else DOUBLE
    levels = "".join(
        (_LAST if level == dimension else _LEVEL).replace("@next@", str(level + 1)).replace("@this@", str(level))
        for level in reversed(range(dimension + 1))
    )
    text = (_TYPES + levels + _NEAREST).replace("@conditions@", str(max(conditions, 1)))
    for name in ("rounding", "parallel", "relaxed", "farthest"):
        text = text.replace(f"@{name}@", f"#{getattr(slacks, name)!r}#")
    return filled(text.replace("@halvings@", str(slacks.halvings)), c)


_TYPES = """\
#define $XCONDITIONS @conditions@

/* Conditions n . u >= b on an acceleration u, with unit vectors n. */
typedef struct
{
    $real normal[$XCONDITIONS][$XDIMENSION];
    $real level[$XCONDITIONS];
    uint32_t count;
} $xconditions;

/* The nearest point that is looked for: planes on which it lies, made to be at right angles, and the point. */
typedef struct
{
    const $xconditions *all;
    $real shift;
    $real slack;
    $real desired[$XDIMENSION];
    $real normal[$XDIMENSION][$XDIMENSION];
    $real level[$XDIMENSION];
    uint32_t count;
    $real u[$XDIMENSION];
} $xsearch;

static $real $xdot(const $real a[$XDIMENSION], const $real b[$XDIMENSION])
{
    $real sum = a[0] * b[0];
    uint32_t k;
    for (k = 1u; k < $XDIMENSION; k++)
    {
        sum = sum + (a[k] * b[k]);
    }
    return sum;
}

/* Let the point lie on the plane of a condition, too; 0 where that plane is parallel to where it lies. */
static uint32_t $xbind($xsearch *s, uint32_t condition)
{
    const $real *normal = s->all->normal[condition];
    $real rest[$XDIMENSION];
    $real left = s->all->level[condition] - s->shift;
    $real size;
    uint32_t a;
    uint32_t k;
    uint32_t found = 0u;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        rest[k] = normal[k];
    }
    for (a = 0u; a < s->count; a++)
    {
        const $real along = $xdot(s->normal[a], rest);
        left = left - (along * s->level[a]);
        for (k = 0u; k < $XDIMENSION; k++)
        {
            rest[k] = rest[k] - (along * s->normal[a][k]);
        }
    }
    size = $xsqrt($xdot(rest, rest));
    if (size > @parallel@)
    {
        for (k = 0u; k < $XDIMENSION; k++)
        {
            s->normal[s->count][k] = rest[k] / size;
        }
        s->level[s->count] = left / size;
        s->count++;
        found = 1u;
    }
    return found;
}

/* How far the point is beyond a condition. */
static $real $xbroken(const $xsearch *s, uint32_t condition)
{
    return (s->all->level[condition] - s->shift) - $xdot(s->all->normal[condition], s->u);
}

/* The point of the planes that is nearest to what is desired. */
static void $xfoot($xsearch *s)
{
    uint32_t a;
    uint32_t k;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        s->u[k] = s->desired[k];
    }
    for (a = 0u; a < s->count; a++)
    {
        const $real missing = s->level[a] - $xdot(s->normal[a], s->u);
        for (k = 0u; k < $XDIMENSION; k++)
        {
            s->u[k] = s->u[k] + (missing * s->normal[a][k]);
        }
    }
}

"""

_LAST = """\
/* Whether the one point that is left satisfies the first conditions. */
static uint32_t $xon@this@($xsearch *s, uint32_t before)
{
    uint32_t fits = 1u;
    uint32_t k;
    $xfoot(s);
    for (k = 0u; k < before; k++)
    {
        if ($xbroken(s, k) > (s->slack * (@parallel@ / @rounding@)))
        {
            fits = 0u;
        }
    }
    return fits;
}

"""

_LEVEL = """\
/* The nearest point on @this@ planes that satisfies the first conditions; 0 where there is none. */
static uint32_t $xon@this@($xsearch *s, uint32_t before)
{
    uint32_t fits = 1u;
    uint32_t k;
    $xfoot(s);
    for (k = 0u; (k < before) && (fits != 0u); k++)
    {
        const $real broken = $xbroken(s, k);
        if (broken > s->slack)
        {
            if ($xbind(s, k) != 0u)
            {
                fits = $xon@next@(s, k);
                s->count--;
            }
            else
            {
                /* Parallel planes contradict each other, or differ by rounding. */
                fits = (broken > (s->slack * (@parallel@ / @rounding@))) ? 0u : 1u;
            }
        }
    }
    return fits;
}

"""

_NEAREST = """\
/* The point nearest to desired that satisfies all conditions, each relaxed by shift; 0 where there is none. */
static uint32_t $xproject(const $xconditions *all, $real shift, const $real desired[$XDIMENSION], $real size,
                          $real u[$XDIMENSION])
{
    $xsearch s;
    uint32_t k;
    uint32_t found;
    s.all = all;
    s.shift = shift;
    s.slack = @rounding@ * size;
    s.count = 0u;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        s.desired[k] = desired[k];
    }
    found = $xon0(&s, all->count);
    for (k = 0u; k < $XDIMENSION; k++)
    {
        u[k] = s.u[k];
    }
    return found;
}

static uint32_t $xsmall(const $real u[$XDIMENSION], $real most)
{
    return ($xsqrt($xdot(u, u)) <= (most * (#1# + @rounding@))) ? 1u : 0u;
}

/* The same that is no larger than most. Projections of shares of desired are the nearest for each largest size. */
static uint32_t $xwithin(const $xconditions *all, $real shift, const $real desired[$XDIMENSION], $real most,
                         $real u[$XDIMENSION])
{
    const $real length = $xsqrt($xdot(desired, desired));
    const $real size = (length > most) ? length : most;
    uint32_t found = $xproject(all, shift, desired, size, u);
    if ((found != 0u) && ($xsmall(u, most) == 0u))
    {
        $real least[$XDIMENSION];
        $real part[$XDIMENSION];
        uint32_t k;
        for (k = 0u; k < $XDIMENSION; k++)
        {
            part[k] = #0#;
        }
        found = $xproject(all, shift, part, size, least);
        found = (found != 0u) ? $xsmall(least, most) : 0u;
        if (found != 0u)
        {
            $real low = #0#;
            $real high = #1#;
            uint32_t halving;
            for (k = 0u; k < $XDIMENSION; k++)
            {
                u[k] = least[k];
            }
            for (halving = 0u; halving < @halvings@u; halving++)
            {
                const $real middle = #0.5# * (low + high);
                uint32_t fits;
                for (k = 0u; k < $XDIMENSION; k++)
                {
                    part[k] = middle * desired[k];
                }
                fits = $xproject(all, shift, part, size, least);
                if ((fits != 0u) && ($xsqrt($xdot(least, least)) <= most))
                {
                    low = middle;
                    for (k = 0u; k < $XDIMENSION; k++)
                    {
                        u[k] = least[k];
                    }
                }
                else
                {
                    high = middle;
                }
            }
        }
    }
    return found;
}

/* A vector of the same direction that is no longer than most, also where its square overflows. */
static void $xshortened(const $real from[$XDIMENSION], $real most, $real to[$XDIMENSION])
{
    $real largest = #0#;
    uint32_t k;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        const $real size = (from[k] < #0#) ? (-from[k]) : from[k];
        largest = (size > largest) ? size : largest;
        to[k] = from[k];
    }
    if (largest > #0#)
    {
        $real unit[$XDIMENSION];
        $real length;
        for (k = 0u; k < $XDIMENSION; k++)
        {
            unit[k] = from[k] / largest;
        }
        length = $xsqrt($xdot(unit, unit));
        if (length > (most / largest))
        {
            for (k = 0u; k < $XDIMENSION; k++)
            {
                to[k] = unit[k] * (most / length);
            }
        }
    }
}

/* The acceleration nearest to asked that satisfies all conditions; where none does, all are relaxed by the least
   amount for which one does. Gives whether none was relaxed. */
static uint32_t $xnearest_force(const $xconditions *all, const $real asked[$XDIMENSION], $real most,
                                $real u[$XDIMENSION])
{
    $real desired[$XDIMENSION];
    uint32_t fits;
    $xshortened(asked, @farthest@ * most, desired);
    fits = $xwithin(all, #0#, desired, most, u);
    if (fits == 0u)
    {
        $real low = #0#;
        $real high = -most;
        $real none[$XDIMENSION];
        uint32_t k;
        for (k = 0u; k < $XDIMENSION; k++)
        {
            none[k] = #0#;
        }
        for (k = 0u; k < all->count; k++)
        {
            high = (all->level[k] > high) ? all->level[k] : high;
        }
        high = high + most;
        for (k = 0u; k < @halvings@u; k++)
        {
            const $real middle = #0.5# * (low + high);
            $real least[$XDIMENSION];
            uint32_t found = $xproject(all, middle, none, most, least);
            if ((found != 0u) && ($xsmall(least, most) != 0u))
            {
                high = middle;
            }
            else
            {
                low = middle;
            }
        }
        if ($xwithin(all, high, desired, most, u) == 0u)
        {
            /* Rounding alone leads here: the shortest one that satisfies the relaxed conditions. */
            (void)$xproject(all, high, none, most, u);
        }
        fits = (high <= (@relaxed@ * most)) ? 1u : 0u;
    }
    return fits;
}

"""
