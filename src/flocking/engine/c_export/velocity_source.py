"""Source of the rule by which agents in discrete time set their velocity, without its noise."""

from __future__ import annotations

import numpy as np

from flocking.engine.c_export.exported_law import ExportedLaw
from flocking.engine.c_export.projection_source import filled, of_agent
from flocking.formula.c_source import CSource
from flocking.model.bodies.discrete_bodies import Heading, Impulsive
from flocking.model.bodies.velocity_units import VelocityUnit
from flocking.model.world.control import Held
from flocking.model.world.times import NANOSECOND


def velocity_source(law: ExportedLaw, c: CSource) -> str:
    """Source of ``velocity``; empty for agents in continuous time.

    Parameters
    ----------
    law
        The law.
    c
        Writes numbers.
    """
    body, control, n = law.scenario.agents, law.scenario.control, law.n
    if not body.discrete:
        return ""
    assert isinstance(control, Held)
    c.used.add("sqrt")
    masses = np.broadcast_to(np.asarray(body.masses, dtype=np.float64), n)
    step = np.asarray(control.schedule(n).period * NANOSECOND) / masses
    numbers: dict[str, object] = {}
    limits = ""
    if isinstance(body, Heading):
        numbers, rule = {"step": step, "speed": body.speed}, _HEADING
    elif isinstance(body, Impulsive):
        numbers = {"step": step, "damping": body.damping}
        rule = _IMPULSIVE
        for name, vector in (("force", "applied"), ("speed", "v")):
            limit = getattr(body, name)
            if limit is not None:
                numbers[f"largest_{name}"] = limit
            call = f"    $xlimit({vector}, $xlargest_{name}(memory->agent), 0u);\n"
            rule = rule.replace(f"@{name}@", call if limit is not None else "")
        limits = _LIMIT if body.force is not None or body.speed is not None else ""
    else:
        assert isinstance(body, VelocityUnit)
        rule = _DESIRED_VELOCITY
        if body.speed is not None:
            numbers, limits = {"largest_speed": body.speed}, _LIMIT
        call = f"    $xlimit(v, $xlargest_speed(memory->agent), {int(body.fixed)}u);\n"
        rule = rule.replace("@limit@", call if body.speed is not None else "    (void)memory;\n")
    tables = "".join(
        of_agent(c, name, np.broadcast_to(np.asarray(value, dtype=np.float64), n)) for name, value in numbers.items()
    )
    return "\n" + tables + filled(limits + _SIGNATURE + rule + _CHECKED, c)


_SIGNATURE = """\
int32_t $xvelocity(const $xmemory *memory, const $real p[$XDIMENSION], const $real u[$XDIMENSION],
                   $real v[$XDIMENSION])
{
    int32_t code = $XOK;
"""

_CHECKED = """\
    for (k = 0u; k < $XDIMENSION; k++)
    {
        code = (($xfinite(p[k]) == 0u) || ($xfinite(u[k]) == 0u)) ? $XNOT_FINITE : code;
    }
    for (k = 0u; k < $XDIMENSION; k++)
    {
        code = ((code == $XOK) && ($xfinite(v[k]) == 0u)) ? $XNO_FORCE : code;
    }
    for (k = 0u; k < $XDIMENSION; k++)
    {
        v[k] = (code == $XOK) ? v[k] : #0#;
    }
    return code;
}
"""

_LIMIT = """\
/* Scale a vector back that is longer than most, or, to have that length, any but zero. */
static void $xlimit($real a[$XDIMENSION], $real most, uint32_t fixed)
{
    const $real size = $xlength(a);
    if ((size > most) || ((fixed != 0u) && (size > #0#)))
    {
        $xscaled(a, most);
    }
}

"""

_HEADING = """\
    const $real step = $xstep(memory->agent);
    const $real speed = $xspeed(memory->agent);
    $real size;
    uint32_t k;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        v[k] = p[k] + (u[k] * step);
    }
    size = $xlowered(v);
    for (k = 0u; k < $XDIMENSION; k++)
    {
        v[k] = (size > #0#) ? (speed * (v[k] / size)) : (speed * (p[k] / speed));
    }
"""

_IMPULSIVE = """\
    const $real step = $xstep(memory->agent);
    $real applied[$XDIMENSION];
    uint32_t k;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        applied[k] = u[k];
    }
@force@    for (k = 0u; k < $XDIMENSION; k++)
    {
        v[k] = p[k] + ((applied[k] - ($xdamping(memory->agent) * p[k])) * step);
    }
@speed@"""

_DESIRED_VELOCITY = """\
    uint32_t k;
    for (k = 0u; k < $XDIMENSION; k++)
    {
        v[k] = u[k];
    }
@limit@"""
