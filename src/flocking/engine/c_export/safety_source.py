"""Source of a safety filter: conditions on the acceleration of an agent, and the one that it takes instead.

The same computation as that of `flocking.engine.sampled.safety` and `flocking.engine.sampled.stopping`.
"""

from __future__ import annotations

import numpy as np

from flocking.engine.c_export.exported_law import ExportedLaw
from flocking.engine.c_export.projection_source import filled, of_agent, projection_source
from flocking.engine.c_export.stopping_source import ACCELERATION, PATHS, PLANES, obstacles_source
from flocking.engine.sampled.safety import ASKED
from flocking.engine.sampled.stopping import RELAXED, ROUNDING, SHARES
from flocking.formula.c_source import CSource
from flocking.model.world.safety_filters import SAMPLED, SafetyFilter
from flocking.model.world.times import NANOSECOND

SINGLE_RELAXED = 1e-5
"""Relaxation of a plane in single precision, by the distance, that rounding explains: distances round by some 1e-6."""

SINGLE_ASKED = 1e3
"""`ASKED` of single precision, so that what is asked for, less a relaxation, keeps four digits of what can be done."""

SINGLE_ROUNDING = 8 * float(np.finfo(np.float32).eps)
"""`ROUNDING` of single precision; fewer units, since a unit is larger beside the margin of the filter."""


def safety_source(law: ExportedLaw, c: CSource) -> str:
    """Source of ``filter``; empty where there is no safety filter.

    Parameters
    ----------
    law
        The law.
    c
        Writes numbers.
    """
    control = law.filter
    if control is None:
        return ""
    c.used.add("sqrt")
    n = law.n
    period = np.asarray(control.schedule(n).period * NANOSECOND, dtype=np.float64)
    numbers = {"most": control.accelerations(n), "mass": np.broadcast_to(np.asarray(law.scenario.agents.masses), n)}
    if control.form != "continuous":
        numbers["period"] = np.broadcast_to(period, n)
    if control.form == SAMPLED:
        numbers["decay"] = np.exp(-control.gain * numbers["period"])
    obstacles = len(control.obstacles)
    text = "".join(of_agent(c, name, values) for name, values in numbers.items())
    text += projection_source(c, law.m, law.neighbours + obstacles) + filled(_CLIPPED, c)
    if control.form == "stopping":
        c.used.add("floor")
        text += _filled(PATHS, c, control) + obstacles_source(control, c, law.m)
        text += _filled(ACCELERATION, c, control)
    else:
        text += _filled(_BOUNDS[control.form] + _OF_PAIRS[control.form], c, control)
    stopping = control.form == "stopping"
    parts = {
        "period": "    const $real period = $xperiod(memory->agent);\n" * stopping,
        "path": "    $real path[$XDIMENSION];\n" * stopping, "found": PLANES if stopping else _CONDITIONS,
    }  # fmt: skip
    last = _FILTER
    for name, part in parts.items():
        last = last.replace(f"@{name}@", part)
    return text + _filled(last, c, control)


def _filled(text: str, c: CSource, control: SafetyFilter) -> str:
    """A template with the numbers of a filter."""
    relaxed = SINGLE_RELAXED if c.single else RELAXED
    values = {
        "guarded": control.guarded_distance, "gain": control.gain, "asked": SINGLE_ASKED if c.single else ASKED,
        "relaxed": relaxed * control.distance, "part": 1.0 / SHARES, "distance": control.distance,
        "rounded": SINGLE_ROUNDING if c.single else ROUNDING,
    }  # fmt: skip
    for name, value in values.items():
        text = text.replace(f"@{name}@", f"#{value!r}#")
    return filled(text.replace("@shares@", str(SHARES)), c)


_CLIPPED = """\
static $real $xclipped($real a, $real least, $real most)
{
    const $real found = (a > least) ? a : least;
    return (found < most) ? found : most;
}

"""

_BOUNDS = {
    "continuous": """\
/* Least relative acceleration along the line of two agents by the condition in continuous time. */
static $real $xbound($real r, const $real dp[$XDIMENSION], const $real dv[$XDIMENSION], $real braking)
{
    $real found = braking;
    if (r > @guarded@)
    {
        const $real opening = $xdot(dp, dv) / r;
        const $real root = $xsqrt((#2# * braking) * (r - @guarded@));
        const $real across = ($xdot(dv, dv) - (opening * opening)) / r;
        const $real sum = root + opening;
        found = -(((@gain@ * ((sum * sum) * sum)) + across) + ((braking * opening) / root));
        found = ($xfinite(found) != 0u) ? found : braking;
    }
    return $xclipped(found, -(@asked@ * braking), @asked@ * braking);
}

""",
    "sampled": """\
/* Least relative acceleration along a line, held for a period, after which two agents can still brake in time. */
static $real $xbound($real r, $real closing, $real braking, $real distance, $real period)
{
    const $real gap = (r - distance) - ((#0.5# * closing) * period);
    const $real room = (r > distance) ? (r - distance) : #0#;
    const $real change = braking * period;
    $real found = -$XLARGEST;
    if (gap >= #0#)
    {
        /* After the period they close in at the speed that braking still stops. */
        const $real last = (#-0.5# * change) + $xsqrt((#0.25# * (change * change)) + ((#2# * braking) * gap));
        found = (closing - last) / period;
    }
    else if (closing > #0#)
    {
        /* They turn round within the period. */
        found = (room > #0#) ? ((closing * closing) / (#2# * room)) : $XLARGEST;
    }
    else
    {
        /* They move apart. */
    }
    return $xclipped(found, -(@asked@ * braking), @asked@ * braking);
}

""",
}

_OF_PAIRS = {
    "continuous": """\
/* The condition of the pair with a neighbour. */
static void $xcondition($xmemory *memory, uint16_t slot, const $real dp[$XDIMENSION], const $real dv[$XDIMENSION],
                        $real distance, $xconditions *all)
{
    const $real own = $xmost(memory->agent);
    const $real braking = own + $xmost(memory->known[slot].sender);
    uint32_t k;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        all->normal[all->count][k] = (distance > #0#) ? (dp[k] / distance) : #0#;
    }
    all->level[all->count] = (own / braking) * $xbound(distance, dp, dv, braking);
    all->count++;
}

""",
    "sampled": """\
/* Distance that two agents have left when both brake along a line from now on. */
static $real $xreserve($real along, $real closing, $real braking)
{
    const $real speed = (closing > #0#) ? closing : #0#;
    return (along - @guarded@) - ((speed * speed) / (#2# * braking));
}

/* The condition of the pair with a neighbour: along the line between them, or that of the tick before. */
static void $xcondition($xmemory *memory, uint16_t slot, const $real dp[$XDIMENSION], const $real dv[$XDIMENSION],
                        $real distance, $xconditions *all)
{
    const $real own = $xmost(memory->agent);
    const $real braking = own + $xmost(memory->known[slot].sender);
    const $real period = $xperiod(memory->agent);
    $real *normal = memory->normals[slot];
    $real line[$XDIMENSION];
    $real held;
    $real along;
    $real closing;
    $real left;
    uint32_t k;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        line[k] = (distance > #0#) ? (dp[k] / distance) : normal[k];
    }
    along = $xdot(line, dp);
    closing = -$xdot(line, dv);
    left = ($xdot(line, line) > #0.5#) ? $xreserve(along, closing, braking) : -$XLARGEST;
    held = ($xdot(normal, normal) > #0.5#) ? $xreserve($xdot(normal, dp), -$xdot(normal, dv), braking) : -$XLARGEST;
    if (held > left)
    {
        left = held;
        along = $xdot(normal, dp);
        closing = -$xdot(normal, dv);
    }
    else
    {
        for (k = 0u; k < $XDIMENSION; k++)
        {
            normal[k] = line[k];
        }
    }
    for (k = 0u; k < $XDIMENSION; k++)
    {
        all->normal[all->count][k] = normal[k];
    }
    left = (left > #0#) ? left : #0#;
    all->level[all->count] =
        (own / braking) * $xbound(along, closing, braking, @guarded@ + (left * $xdecay(memory->agent)), period);
    all->count++;
}

""",
}

_CONDITIONS = """    (void)q;
    for (k = 0u; k < memory->count; k++)
    {
        const uint16_t slot = memory->order[k];
        $real dp[$XDIMENSION];
        $real dv[$XDIMENSION];
        uint32_t axis;
        for (axis = 0u; axis < $XDIMENSION; axis++)
        {
            dp[axis] = -seen->offset[slot][axis];
            dv[axis] = p[axis] - memory->known[slot].p[axis];
        }
        $xcondition(memory, slot, dp, dv, seen->distance[slot], &all);
    }
    fits = $xnearest_force(&all, desired, most, used);
"""

_FILTER = """/* The force that the agent exerts instead of u, by what it knows; none where numbers overflow. */
static int32_t $xfilter($xmemory *memory, const $real q[$XDIMENSION], const $real p[$XDIMENSION], const $xview *seen,
                     $real u[$XDIMENSION])
{
    const $real mass = $xmass(memory->agent);
    const $real most = $xmost(memory->agent);
@period@    $xconditions all;
    $real desired[$XDIMENSION];
    $real used[$XDIMENSION];
@path@    uint32_t fits;
    uint32_t k;
    all.count = 0u;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        desired[k] = u[k] / mass;
    }
@found@    for (k = 0u; k < $XDIMENSION; k++)
    {
        if ($xfinite(used[k]) == 0u)
        {
            return $XNO_FORCE;
        }
    }
    if (!($xlength(used) <= (most * #1.001#)))
    {
        return $XNO_FORCE;
    }
    memory->relaxed = (fits == 0u) ? 1u : 0u;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        if ((used[k] < desired[k]) || (used[k] > desired[k]))
        {
            memory->filtered = 1u;
        }
    }
    if (memory->filtered != 0u)
    {
        for (k = 0u; k < $XDIMENSION; k++)
        {
            u[k] = mass * used[k];
        }
    }
    return $XOK;
}

"""
