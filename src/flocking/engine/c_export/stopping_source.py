"""Templates of the safety filter of stopping paths, see `flocking.engine.sampled.stopping`."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array
from flocking.engine.c_export.projection_source import filled
from flocking.formula.c_source import CSource
from flocking.model.world.safety_filters import SafetyFilter


def obstacles_source(control: SafetyFilter, c: CSource, m: int) -> str:
    """Tables of balls and walls, and the function that adds their planes.

    Parameters
    ----------
    control
        The filter.
    c
        Writes numbers.
    m
        Number of axes.
    """

    def table(name: str, rows: Array) -> str:
        shape = f"[{rows.shape[0]}]" + (f"[{rows.shape[1]}]" if rows.ndim > 1 else "")

        def text(values: Array) -> str:
            if values.ndim == 0:
                return c.literal(float(values))
            return "{ " + ", ".join(text(x) for x in values) + " }"

        return f"static const {c.prefix}real {c.prefix}{name}{shape} = {text(rows)};\n"

    balls, walls, found, calls = control.balls, control.walls, "", ""
    clearance = f"#{control.guarded_clearance!r}#"
    if balls:
        centres = np.array([b.centre.at(0.0)[0] for b in balls]).reshape(len(balls), m)
        found += table("ball_centre", centres) + table("ball_radius", np.array([b.radius for b in balls]))
        found += filled(_BALLS.replace("@clearance@", clearance), c).replace("@count@", str(len(balls)))
        calls += "    $xbeside_balls(q, path, all);\n"
    if walls:
        normals = np.array([w.normal for w in walls]).reshape(len(walls), m)
        found += table("wall_normal", normals)
        found += table("wall_level", (normals * np.array([w.point.at(0.0)[0] for w in walls])).sum(axis=1))
        found += filled(_WALLS.replace("@clearance@", clearance), c).replace("@count@", str(len(walls)))
        calls += "    $xbeside_walls(q, all);\n"
    if not calls:
        calls = "    (void)q;\n    (void)path;\n    (void)all;\n"
    elif not balls:
        calls += "    (void)path;\n"
    return found + filled(_OBSTACLES.replace("@calls@", calls), c)


_OBSTACLES = """\
/* Add the planes beside obstacles. */
static void $xbeside_obstacles(const $real q[$XDIMENSION], const $real path[$XDIMENSION], $xconditions *all)
{
@calls@}

"""

_BALLS = """\
static void $xbeside_balls(const $real q[$XDIMENSION], const $real path[$XDIMENSION], $xconditions *all)
{
    uint32_t o;
    for (o = 0u; o < @count@u; o++)
    {
        const $real size = $xdot(path, path);
        $real centre[$XDIMENSION];
        $real away[$XDIMENSION];
        $real share = #0#;
        $real far;
        uint32_t k;
        for (k = 0u; k < $XDIMENSION; k++)
        {
            centre[k] = $xball_centre[o][k] - q[k];
        }
        if (size > #0#)
        {
            share = $xclipped($xdot(centre, path) / size, #0#, #1#);
        }
        for (k = 0u; k < $XDIMENSION; k++)
        {
            away[k] = (share * path[k]) - centre[k];
        }
        far = $xsqrt($xdot(away, away));
        for (k = 0u; k < $XDIMENSION; k++)
        {
            all->normal[all->count][k] = (far > #0#) ? (away[k] / far) : #0#;
        }
        all->level[all->count] = ($xdot(all->normal[all->count], centre) + $xball_radius[o]) + @clearance@;
        all->count++;
    }
}

"""

_WALLS = """\
static void $xbeside_walls(const $real q[$XDIMENSION], $xconditions *all)
{
    uint32_t o;
    for (o = 0u; o < @count@u; o++)
    {
        uint32_t k;
        for (k = 0u; k < $XDIMENSION; k++)
        {
            all->normal[all->count][k] = $xwall_normal[o][k];
        }
        all->level[all->count] = ($xwall_level[o] - $xdot(all->normal[all->count], q)) + @clearance@;
        all->count++;
    }
}

"""

PATHS = """\
/* Vector from where an agent is to where it stops that brakes for whole periods, the last one only as needed. */
static void $xstopping_path(const $real v[$XDIMENSION], $real most, $real period, $real path[$XDIMENSION])
{
    const $real speed = $xsqrt($xdot(v, v));
    const $real step = most * period;
    const $real periods = $xfloor(speed / step);
    const $real left = speed - (periods * step);
    const $real rest = (left > #0#) ? left : #0#;
    const $real way = ((periods * period) * (speed - ((#0.5# * periods) * step))) + ((#0.5# * rest) * period);
    const $real share = (speed > #0#) ? (way / speed) : #0#;
    uint32_t k;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        path[k] = v[k] * share;
    }
}

static $real $xshare($real over, $real under)
{
    return (under > #0#) ? $xclipped(over / under, #0#, #1#) : #0#;
}

/* The plane between the stopping path from 0 to d and that from q to q + e. */
static void $xbetween(const $real d[$XDIMENSION], const $real q[$XDIMENSION], const $real e[$XDIMENSION],
                      $xconditions *all)
{
    const $real dd = $xdot(d, d);
    const $real ee = $xdot(e, e);
    const $real de = $xdot(e, d);
    const $real dq = $xdot(q, d);
    const $real eq = $xdot(e, q);
    const $real inner = $xshare((dq * ee) - (de * eq), (dd * ee) - (de * de));
    const $real s[5] = { #0#, #1#, $xshare(dq, dd), $xshare(dq + de, dd), inner };
    const $real t[5] = { $xshare(-eq, ee), $xshare(de - eq, ee), #0#, #1#, $xshare((inner * de) - eq, ee) };
    $real away[$XDIMENSION];
    $real middle[$XDIMENSION];
    $real least = $XLARGEST;
    $real size;
    uint32_t pair;
    uint32_t k;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        away[k] = #0#;
        middle[k] = #0#;
    }
    for (pair = 0u; pair < 5u; pair++)
    {
        $real between[$XDIMENSION];
        for (k = 0u; k < $XDIMENSION; k++)
        {
            between[k] = (s[pair] * d[k]) - (q[k] + (t[pair] * e[k]));
        }
        size = $xdot(between, between);
        if (size < least)
        {
            least = size;
            for (k = 0u; k < $XDIMENSION; k++)
            {
                away[k] = between[k];
                middle[k] = (s[pair] * d[k]) + (q[k] + (t[pair] * e[k]));
            }
        }
    }
    size = $xsqrt($xdot(away, away));
    if (size <= (@rounded@ * (($xsqrt(dd) + $xsqrt($xdot(q, q))) + $xsqrt(ee))))
    {
        /* Where paths meet, but for rounding, there is no plane: away from the other agent, as braking allows. */
        for (k = 0u; k < $XDIMENSION; k++)
        {
            away[k] = -q[k];
        }
        size = $xsqrt($xdot(away, away));
    }
    for (k = 0u; k < $XDIMENSION; k++)
    {
        all->normal[all->count][k] = (size > #0#) ? (away[k] / size) : #0#;
    }
    all->level[all->count] = (#0.5# * $xdot(all->normal[all->count], middle)) + (#0.5# * @guarded@);
    all->count++;
}

"""
"""Stopping paths, and the plane between two of them."""

ACCELERATION = """\
/* How an agent moves that holds an acceleration for a period, and brakes then. */
typedef struct
{
    $real u[$XDIMENSION];
    $real place[$XDIMENSION];
    $real end[$XDIMENSION];
} $xway;

static void $xway_of(const $real u[$XDIMENSION], const $real v[$XDIMENSION], $real most, $real period, $xway *way)
{
    $real later[$XDIMENSION];
    uint32_t k;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        way->u[k] = u[k];
        later[k] = v[k] + (period * u[k]);
        way->place[k] = (period * v[k]) + ((#0.5# * (period * period)) * u[k]);
    }
    $xstopping_path(later, most, period, way->end);
    for (k = 0u; k < $XDIMENSION; k++)
    {
        way->end[k] = way->place[k] + way->end[k];
    }
}

/* Whether the way stays beyond a plane: in the period, and on the stopping path after it. */
static uint32_t $xbeyond(const $xconditions *all, uint32_t plane, const $xway *way, const $real v[$XDIMENSION],
                         $real period)
{
    const $real *normal = all->normal[plane];
    const $real place = $xdot(way->place, normal);
    const $real end = $xdot(way->end, normal);
    const $real along = $xdot(normal, v);
    const $real bent = $xdot(way->u, normal);
    $real least = (place < end) ? place : end;
    if ((along < #0#) && (bent > #0#) && ((-along) < (bent * period)))
    {
        const $real turning = (-(along * along)) / (#2# * bent);
        least = (turning < least) ? turning : least;
    }
    return (least >= all->level[plane]) ? 1u : 0u;
}

/* Whether an acceleration keeps all planes and is not too large. */
static uint32_t $xkeeps(const $xconditions *all, const $real u[$XDIMENSION], const $real v[$XDIMENSION], $real most,
                        $real period)
{
    $xway way;
    uint32_t found = $xsmall(u, most);
    uint32_t k;
    $xway_of(u, v, most, period, &way);
    for (k = 0u; (k < all->count) && (found != 0u); k++)
    {
        found = $xbeyond(all, k, &way, v, period);
    }
    return found;
}

/* The acceleration nearest to a target, on the way there from braking, that is found to keep the planes. */
static void $xtowards(const $xconditions *all, const $real target[$XDIMENSION], const $real brake[$XDIMENSION],
                      const $real v[$XDIMENSION], $real most, $real period, $real u[$XDIMENSION])
{
    $real low = #0#;
    $real width = #1#;
    uint32_t round;
    uint32_t k;
    for (round = 0u; (round < 2u) && (low < #1#); round++)
    {
        const $real begin = low;
        uint32_t part;
        uint32_t found = 0u;
        for (part = 0u; (part < @shares@u) && (found == 0u); part++)
        {
            const $real share = begin + (width * (#1# - (($real)part * @part@)));
            for (k = 0u; k < $XDIMENSION; k++)
            {
                u[k] = brake[k] + (share * (target[k] - brake[k]));
            }
            found = $xkeeps(all, u, v, most, period);
            low = (found != 0u) ? share : low;
        }
        width = width * @part@;
    }
    for (k = 0u; k < $XDIMENSION; k++)
    {
        u[k] = (low >= #1#) ? target[k] : (brake[k] + (low * (target[k] - brake[k])));
    }
}

/* An acceleration near the desired one that keeps the agent on its side of planes; gives whether none was relaxed. */
static uint32_t $xstopping($xconditions *all, const $real asked[$XDIMENSION], const $real v[$XDIMENSION],
                           $real most, $real period, $real u[$XDIMENSION])
{
    $real desired[$XDIMENSION];
    $real size;
    const $real speed = $xsqrt($xdot(v, v));
    $real first[$XDIMENSION];
    $real brake[$XDIMENSION];
    $real path[$XDIMENSION];
    $real rounded;
    uint32_t fits = 1u;
    uint32_t k;
    $xshortened(asked, @asked@ * most, desired);
    size = $xsqrt($xdot(desired, desired));
    for (k = 0u; k < $XDIMENSION; k++)
    {
        first[k] = (size <= most) ? desired[k] : (desired[k] * (most / size));
        brake[k] = (speed <= (most * period)) ? ((-v[k]) / period) : ((-v[k]) * (most / speed));
    }
    $xstopping_path(v, most, period, path);
    rounded = @rounded@ * ($xsqrt($xdot(path, path)) + @distance@);
    for (k = 0u; k < all->count; k++)
    {
        /* Braking satisfies what it can reach. */
        const $real along = $xdot(all->normal[k], path);
        const $real reached = ((along < #0#) ? along : #0#) - rounded;
        if (all->level[k] > reached)
        {
            fits = ((all->level[k] - reached) <= @relaxed@) ? fits : 0u;
            all->level[k] = reached;
        }
    }
    for (k = 0u; k < $XDIMENSION; k++)
    {
        u[k] = first[k];
    }
    if ($xkeeps(all, first, v, most, period) == 0u)
    {
        $xconditions crossed;
        $real slide[$XDIMENSION];
        $real other[$XDIMENSION];
        $real straight = #0#;
        $real aside = #0#;
        $xway way;
        $xtowards(all, first, brake, v, most, period, u);
        /* No nearer to the planes that the desired one crosses than braking brings it: the agent slides along them. */
        crossed.count = 0u;
        $xway_of(first, v, most, period, &way);
        for (k = 0u; k < all->count; k++)
        {
            if ($xbeyond(all, k, &way, v, period) == 0u)
            {
                uint32_t axis;
                for (axis = 0u; axis < $XDIMENSION; axis++)
                {
                    crossed.normal[crossed.count][axis] = all->normal[k][axis];
                }
                crossed.level[crossed.count] = $xdot(all->normal[k], brake);
                crossed.count++;
            }
        }
        (void)$xnearest_force(&crossed, first, most, slide);
        $xtowards(all, slide, brake, v, most, period, other);
        for (k = 0u; k < $XDIMENSION; k++)
        {
            straight = straight + ((u[k] - desired[k]) * (u[k] - desired[k]));
            aside = aside + ((other[k] - desired[k]) * (other[k] - desired[k]));
        }
        if (aside < straight)
        {
            for (k = 0u; k < $XDIMENSION; k++)
            {
                u[k] = other[k];
            }
        }
    }
    return fits;
}

"""
"""The acceleration that keeps the planes."""

PLANES = """    $xstopping_path(p, most, period, path);
    for (k = 0u; k < memory->count; k++)
    {
        const uint16_t slot = memory->order[k];
        const uint16_t sender = memory->known[slot].sender;
        $real theirs[$XDIMENSION];
        $xstopping_path(memory->known[slot].p, $xmost(sender), $xperiod(sender), theirs);
        $xbetween(path, seen->offset[slot], theirs, &all);
    }
    $xbeside_obstacles(q, path, &all);
    fits = $xstopping(&all, desired, p, most, period, used);
"""
"""What the filter does with the planes of all whose states are kept."""
