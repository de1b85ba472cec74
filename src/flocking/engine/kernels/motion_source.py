"""How the columns of the agents change, as lines of the compiled slope and as values on NumPy arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flocking.engine.kernels.source_text import Names, free_names, indented, nonzero, unpack
from flocking.model.bodies.body import MOTION

if TYPE_CHECKING:
    import sympy

    from flocking.engine.kernels.expressions import LawFormulas, MotionFormulas

RATES = ("work", "dissipated", "supplied")
"""Quantities integrated beside the state: power of the control, and the two powers of the energy ledger."""

GIVEN_ARGUMENTS = "f8, f8[:], f8[:], f8[:,:], f8[:,:,:], f8[:,:], f8[:]"
"""Kinds of t, the state vector, P, A, W, the forces and the result, which functions of bodies take."""


def point_source(m: int, order: int) -> str:
    """Lines that read the positions and velocities on which the law depends from the state vector.

    Parameters
    ----------
    order
        Order of the agents, 1 or 2.
    """
    lines = [f"q[i, {k}] = z[i * {m} + {k}]" for k in range(m)]
    if order == 2:
        lines += [f"p[i, {k}] = z[(n + i) * {m} + {k}]" for k in range(m)]
    return indented(["for i in range(n):"], 1) + indented(lines, 2)


def motion_source(formulas: LawFormulas, flow: str = "") -> str:
    """Lines that fill the slope of the state vector, from the forces and the sums of the ledger.

    The vector holds the columns of the bodies one after another, then `RATES`. Of bodies that may depart from the
    desired motion it holds the work of that after the columns, which is part of the supply, too.

    Parameters
    ----------
    formulas
        Those of the law and its bodies.
    flow
        Lines that give ``supplied`` for agents of order 1 that move with the velocities ``u``.
    """
    motion, m = formulas.body.motion, formulas.dimension
    requested = motion.lets | motion.rates | nonzero({"departure": motion.departure})
    names, lines = _agent_lines(formulas, requested)
    first, out = 0, []
    for column, width in motion.columns:
        out += [f"out[{_place(first, width, k)}] = rate_{column}{k}" for k in range(width)]
        first += width
    lines += out
    if "departure" in requested:
        lines += ["departed += departure"]
    source = unpack(names, 1) + indented(["departed = 0.0"] * motion.departs + ["for i in range(n):"], 1)
    source += indented(lines, 2)
    count = f"{first} * n"
    if motion.departs:
        if flow:
            source += _flow_of_bodies(m, flow)
        source += indented([f"out[{count}] = departed", "supplied += departed"], 1)
        count += " + 1"
    return source + indented([f"out[{count} + {k}] = {name}" for k, name in enumerate(RATES)], 1)


def limits_source(formulas: LawFormulas) -> str:
    """Lines that fill where limits begin and end to act, a row of agents for each, from the forces.

    Parameters
    ----------
    formulas
        Those of the law and its bodies.
    """
    motion = formulas.body.motion
    names, lines = _agent_lines(formulas, motion.lets | motion.limits)
    lines += [f"out[{k} * n + i] = {name}" for k, name in enumerate(motion.limits)]
    return unpack(names, 1) + indented(["for i in range(n):"], 1) + indented(lines, 2)


def given_motion_source(formulas: LawFormulas) -> str:
    """Functions of bodies under forces that are given, however agents came by them.

    ``move(t, z, P, A, W, u, out)`` fills the rates of all columns of a state vector; of bodies with limits
    ``limit_signs(...)`` fills the expressions of `limits_source`. ``u`` holds the forces, shape (N, m).

    Parameters
    ----------
    formulas
        Those of the law and its bodies.
    """
    motion = formulas.body.motion
    names, lines = _agent_lines(formulas, motion.lets | motion.rates)
    first = 0
    for column, width in motion.columns:
        lines += [f"out[{_place(first, width, k)}] = rate_{column}{k}" for k in range(width)]
        first += width
    head, count = f'@native_of("{GIVEN_ARGUMENTS}")\n', indented(["n = u.shape[0]"], 1)
    source = f"{head}def move(t, z, P, A, W, u, out):\n" + count + unpack(names, 1)
    source += indented(["for i in range(n):"], 1) + indented(lines, 2) + "\n\n"
    if motion.limits:
        source += f"{head}def limit_signs(t, z, P, A, W, u, out):\n" + count + limits_source(formulas) + "\n\n"
    return source


def _place(first: int, width: int, k: int) -> str:
    """Where number ``k`` of a column of agent i stands, after ``first`` numbers of each agent."""
    return f"({first} * n + i * {width} + {k})" if first else f"(i * {width} + {k})"


def _agent_lines(formulas: LawFormulas, requested: dict[str, sympy.Expr]) -> tuple[Names, list[str]]:
    """Lines that compute expressions of agent i from the state vector, and the names that these leave free."""
    from flocking.formula.printing import code

    m, names = formulas.dimension, free_names(requested.values())
    lines, first = [], 0
    for column, width in formulas.body.motion.columns:
        for k in range(width):
            name = f"{column}{k}" if column in MOTION else f"column_{column}_{k}"
            lines += [f"{name} = z[{_place(first, width, k)}]"] * (name in names.others)
        first += width
    lines += [f"u{k} = u[i, {k}]" for k in range(m) if f"u{k}" in names.others]
    lines += [f"w{k} = p[i, {k}] - frame{k}" for k in range(m) if f"w{k}" in names.others]
    lines += [f"{n} = A[{n[1:]}, i]" for n in names.per_agent]
    return names, lines + [f"{name} = {code(e, arrays=False)}" for name, e in requested.items()]


def _flow_of_bodies(m: int, flow: str) -> str:
    """Lines that set ``departed`` for agents of order 1: grad H . (q' - u), as grad H . v = supplied(v) - u . v."""
    lines = ["wanted_work = work", "wanted_supply = supplied", "along_wanted = 0.0", "for i in range(n):"]
    for k in range(m):
        place = _place(0, m, k)
        lines += [f"    along_wanted += u[i, {k}] * out[{place}]", f"    u[i, {k}] = out[{place}]"]
    lines += ["work = 0.0", "supplied = 0.0"]
    last = ["departed = wanted_work - wanted_supply - along_wanted + supplied"]
    last += ["work = wanted_work", "dissipated = wanted_work", "supplied = wanted_supply"]
    return indented(lines, 1) + flow + indented(last, 1)


def motion_values(motion: MotionFormulas) -> dict[str, sympy.Expr]:
    """Kinetic energy, departure, rates and limits of ``motion``, with shared expressions substituted."""
    found = {"kinetic": motion.kinetic, "departure": motion.departure, **motion.rates, **motion.limits}
    for name, expression in reversed(motion.lets.items()):
        shared = {s for e in found.values() for s in e.free_symbols if str(s) == name}
        found = {key: e.xreplace(dict.fromkeys(shared, expression)) for key, e in found.items()}
    return found
