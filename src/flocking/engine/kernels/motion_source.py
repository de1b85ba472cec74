"""How the columns of the agents change, as lines of the compiled slope and as values on NumPy arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flocking.engine.kernels.source_text import free_names, indented, nonzero, unpack
from flocking.model.bodies.body import MOTION

if TYPE_CHECKING:
    import sympy

    from flocking.engine.kernels.expressions import LawFormulas, MotionFormulas

RATES = ("work", "dissipated", "supplied")
"""Quantities integrated beside the state: power of the control, and the two powers of the energy ledger."""


def point_source(m: int, order: int) -> str:
    """Lines that take positions and velocities, as the law sees them, from the state vector.

    Parameters
    ----------
    order
        Order of the agents, 1 or 2.
    """
    lines = [f"q[i, {k}] = z[i * {m} + {k}]" for k in range(m)]
    if order == 2:
        lines += [f"p[i, {k}] = z[(n + i) * {m} + {k}]" for k in range(m)]
    return indented(["for i in range(n):"], 1) + indented(lines, 2)


def motion_source(formulas: LawFormulas) -> str:
    """Lines that fill the slope of the state vector, from the forces and the sums of the ledger.

    Parameters
    ----------
    formulas
        Those of the law and its bodies.
    """
    from flocking.formula.printing import code

    motion, m = formulas.body.motion, formulas.dimension
    requested = motion.lets | motion.rates | nonzero({"departure": motion.departure})
    names = free_names(requested.values())
    lines, first, out = [], 0, []
    for column, width in motion.columns:
        for k in range(width):
            place = f"({first} * n + i * {width} + {k})" if first else f"(i * {width} + {k})"
            name = f"{column}{k}" if column in MOTION else f"column_{column}_{k}"
            lines += [f"{name} = z[{place}]"] * (name in names.others)
            out += [f"out[{place}] = rate_{column}{k}"]
        first += width
    lines += [f"u{k} = u[i, {k}]" for k in range(m) if f"u{k}" in names.others]
    lines += [f"w{k} = p[i, {k}] - frame{k}" for k in range(m) if f"w{k}" in names.others]
    lines += [f"{n} = A[{n[1:]}, i]" for n in names.per_agent]
    lines += [f"{name} = {code(e, arrays=False)}" for name, e in requested.items()] + out
    if "departure" in requested:
        lines += ["supplied += departure"]
    source = unpack(names, 1) + indented(["for i in range(n):"], 1) + indented(lines, 2)
    return source + indented([f"out[{first} * n + {k}] = {name}" for k, name in enumerate(RATES)], 1)


def motion_values(motion: MotionFormulas) -> dict[str, sympy.Expr]:
    """Kinetic energy, departure and rates of ``motion``, with shared expressions substituted."""
    found = {"kinetic": motion.kinetic, "departure": motion.departure, **motion.rates}
    for name, expression in reversed(motion.lets.items()):
        shared = {s for e in found.values() for s in e.free_symbols if str(s) == name}
        found = {key: e.xreplace(dict.fromkeys(shared, expression)) for key, e in found.items()}
    return found
