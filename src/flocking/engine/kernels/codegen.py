"""Kernels generated from a law's formulas: compiled for the exact engine, array functions for reference."""

from __future__ import annotations

from collections.abc import Iterable
from types import ModuleType
from typing import TYPE_CHECKING

from flocking.engine.kernels.displacements import displacement_lines
from flocking.engine.kernels.layout import Layout
from flocking.engine.kernels.motion_source import (
    RATES,
    given_motion_source,
    limits_source,
    motion_source,
    motion_values,
    point_source,
)
from flocking.engine.kernels.mutual_pairs import mutual_loop
from flocking.engine.kernels.neighbours import PRESENT, KnownNeighbours, PresentNeighbours
from flocking.engine.kernels.obstacle_formulas import obstacle_function, obstacle_loop, obstacle_slot
from flocking.engine.kernels.pieces import held, piece_lines
from flocking.engine.kernels.source_text import free_names, indented, nonzero, unpack
from flocking.formula.compiled import generated_module

if TYPE_CHECKING:
    import sympy

    from flocking.engine.kernels.expressions import BodyFormulas, LawFormulas

ARGUMENTS = "f8, f8[:,:], f8[:,:], i8[:], i8[:], i8[:], i4[:], f8[:,:], f8[:], f8[:,:], f8[:,:,:], f8[:,:]"
"""Kinds of t, q, p, senders, sensed, offsets, pieces, spans, P, A, W and S, which all compiled functions take."""
CONTROL_RESULTS = ", f8[:,:], f8[:]"
"""Kinds of u and rates, which ``control`` fills."""
FRAME_RESULTS = ", f8[:]"
"""Kind of the velocity that ``frame`` fills."""
SLOPE_ARGUMENTS = "f8, f8[:], " + ARGUMENTS.split(", ", 3)[3] + ", f8[:,:], f8[:,:], f8[:,:], f8[:]"
"""Kinds of the arguments of ``slope``: t, the state vector, pairs and slots, room for q, p and u, and the slope."""


def compiled_kernels(layout: Layout, dimension: int) -> ModuleType:
    """Functions of a law that are compiled when they are first used.

    Functions of the module: ``control(t, q, p, senders, sensed, offsets, pieces, spans, P, A, W, S, u, rates)`` fills
    the forces and `RATES`; for first-order agents ``flow`` does with velocities u that are given; ``slope(t, z,
    senders, ..., S, q, p, u, out)`` fills the slope of a state vector, see `motion_source`; of bodies with limits
    ``limit_signs`` takes the same and fills the expressions of `limits_source`; ``energies(t, q, p, ...)`` gives pair
    storage, body storage and kinetic energy in the frame of the energy, see `flocking.engine.kernels.law_kernels`;
    ``frame(t, q, p, ..., found)`` fills the velocity of that frame. Row
    ``pieces[e]`` of ``spans`` gives the piece of a piecewise formula that is in force for pair ``e``, see `limits`;
    ``shape0(r, side, reach, P, A, W)``... are those formulas of each graph in plain Python, ``shape_obstacles0``...
    those of each group of obstacles. ``shape0.reads`` numbers the slots of P, A and W that such a function reads,
    ``shape0.acting`` those of its values that are forces or multiply one.

    Parameters
    ----------
    layout
        The law, its energy, the bodies and the slots of their parameters.
    """
    from flocking.engine.kernels.expressions import law_formulas

    return generated_module(
        ("exact", dimension), layout.structure, layout.parts,
        lambda: law_formulas(layout, dimension), lambda stated: _scalar_module(stated, layout.bodies.order),
    )  # fmt: skip


def known_kernels(layout: Layout, dimension: int, degree: int) -> ModuleType:
    """The forces of agents that know a polynomial in time of each neighbour instead of its present state.

    Function of the module: ``control(t, q, p, senders, ..., S, T, K, u, rates)``, as that of `compiled_kernels`, where
    ``q`` and ``p`` are what agents know of themselves, and of the neighbour of pair ``e`` its agent knows the positions
    ``sum_k K[e, k, :m] (t - T[e])**k`` and velocities ``sum_k K[e, k, m:] (t - T[e])**k``.

    Parameters
    ----------
    layout, dimension
        As for `compiled_kernels`.
    degree
        Degree of the polynomials: 0 for states held as they were, 1 for those moved on with a velocity.
    """
    from flocking.engine.kernels.expressions import law_formulas

    known = KnownNeighbours(degree, dimension)
    return generated_module(
        ("known", degree, dimension), layout.structure, layout.parts, lambda: law_formulas(layout, dimension),
        lambda stated: _header(stated) + _control_source(stated, layout.bodies.order, known),
    )  # fmt: skip


def body_kernels(layout: Layout, dimension: int) -> ModuleType:
    """How bodies move under given forces, see `flocking.engine.kernels.motion_source.given_motion_source`.

    Parameters
    ----------
    layout, dimension
        As for `compiled_kernels`.
    """
    from flocking.engine.kernels.expressions import law_formulas

    return generated_module(
        ("bodies", dimension), layout.structure, layout.parts, lambda: law_formulas(layout, dimension),
        lambda stated: _header(stated) + given_motion_source(stated),
    )  # fmt: skip


def array_kernels(layout: Layout, dimension: int) -> ModuleType:
    """NumPy functions of a law: ``pair0``, ``pair1``... per graph and ``body``, on arrays of pairs or agents."""
    from flocking.engine.kernels.expressions import law_formulas

    return generated_module(
        ("arrays", dimension), layout.structure, layout.parts, lambda: law_formulas(layout, dimension), _array_module
    )


_HEADER = """import math

import numpy as np

from flocking.formula.native.functions import native_of

ARGUMENTS = {arguments!r}
DEPARTS = {departs!r}

"""


def _header(formulas: LawFormulas) -> str:
    return _HEADER.format(arguments=ARGUMENTS, departs=formulas.body.motion.departs)


def _scalar_module(formulas: LawFormulas, order: int) -> str:
    source = _header(formulas) + _control_source(formulas, order) + _energies_source(formulas)
    return source + _frame_source(formulas) + _shapes_source(formulas)


def _shapes_source(formulas: LawFormulas) -> str:
    source = ""
    for number, pair in enumerate(formulas.pairs):
        requested, _ = held({name: getattr(pair, name) for name in ("along", "drag", "storage")}, "r")
        source += _shape_function(f"shape{number}", "r", requested, formulas)
    for number, group in enumerate(formulas.obstacles):
        requested, _ = held(group.after_distance, "distance")
        source += _shape_function(f"shape_obstacles{number}", "distance", requested, formulas)
    return source


def _shape_function(name: str, distance: str, requested: dict[str, sympy.Expr], formulas: LawFormulas) -> str:
    """Formulas as a function of the distance alone: other values are 1, or those of the first agent."""
    from flocking.formula.printing import statements

    names = free_names(requested.values())
    lines = [f"{n} = A[{n[1:]}, 0]" for n in names.per_agent] + [f"{n} = W[{n[1:]}, 0, -1]" for n in names.per_pair]
    for other in sorted(names.others - {distance, "side", "reach"}):
        lines += [f"{other} = {obstacle_slot(other, formulas.obstacles, '0') or '1.0'}"]
    lines += [*statements(requested, arrays=False, prefix="s_"), "return " + ", ".join(requested) + ","]
    head = f"\n\ndef {name}({distance}, side, reach, P, A, W):\n"
    kinds = (names.scalars, names.per_agent, names.per_pair)
    reads = tuple(tuple(int(n[1:]) for n in slots) for slots in kinds)
    acting = tuple(k for k, what in enumerate(requested) if what in ("along", "drag") or what.startswith("force"))
    facts = f"\n\n{name}.reads = {reads!r}\n{name}.acting = {acting!r}\n"
    return head + unpack(names, 1) + indented(lines, 1) + facts


def _sums(formulas: Iterable[str], m: int, share: str = "") -> list[str]:
    """Lines that add computed formulas, by their names, to the force and to the sums."""
    found, forces = [], {k: [f"force{k}"] if f"force{k}" in formulas else [] for k in range(m)}
    if "along" in formulas:
        found += ["scale = along / r if r > 0.0 else along * 0.0"]
        forces = {k: [*parts, f"scale * d{k}"] for k, parts in forces.items()}
    if "drag" in formulas:
        forces = {k: [*parts, f"drag * v{k}"] for k, parts in forces.items()}
    found += [f"u[i, {k}] += " + " + ".join(parts) for k, parts in forces.items() if parts]
    sums = {"dissipation": "dissipated", "supply": "supplied"}
    return found + [f"{total} += {share}{name}" for name, total in sums.items() if name in formulas]


def _pair_loop(
    number: int,
    formulas: LawFormulas,
    requested: dict[str, str],
    tail: list[str] | None = None,
    velocity: str = "p",
    neighbours: PresentNeighbours | KnownNeighbours = PRESENT,
) -> str:
    """Loop over the ordered pairs of one graph, computing the ``requested`` formulas, then the ``tail`` lines.

    Without a ``tail`` the formulas are added to the force and the sums. ``velocity`` names the array of velocities:
    ``u`` for the power of first-order agents.
    """
    from flocking.formula.printing import statements

    m, pair = formulas.dimension, formulas.pairs[number]
    chosen, split = held(nonzero({name: getattr(pair, source) for name, source in requested.items()}), "r")
    if not chosen:
        return ""
    names = free_names(chosen.values())
    axes = range(m)
    body = ["i = senders[e]", "j = sensed[e]", *neighbours.lines()]
    body += displacement_lines(formulas.periods, neighbours.position)
    if "drag" in chosen or names.others & {"speed2", "radial", "pull"}:
        seen = [neighbours.velocity(k) if velocity == "p" else f"{velocity}[j, {k}]" for k in axes]
        body += [f"v{k} = {seen[k]} - {velocity}[i, {k}]" for k in axes]
    body += ["r = math.sqrt(" + " + ".join(f"d{k} * d{k}" for k in axes) + ")"]
    body += piece_lines("r") if split else []
    if "speed2" in names.others:
        body += ["speed2 = " + " + ".join(f"v{k} * v{k}" for k in axes)]
    if "radial" in names.others:
        body += ["radial = (" + " + ".join(f"d{k} * v{k}" for k in axes) + ") / r if r > 0.0 else 0.0"]
    relative = [f"(p[i, {k}] - frame{k})" if velocity == "p" else f"{velocity}[i, {k}]" for k in axes]
    if "push" in names.others:
        body += ["push = (" + " + ".join(f"d{k} * {f}" for k, f in enumerate(relative)) + ") / r if r > 0.0 else 0.0"]
    if "pull" in names.others:
        body += ["pull = " + " + ".join(f"v{k} * {f}" for k, f in enumerate(relative))]
    if "functional" in names.others:
        body += [f"functional = S[{number}, i]"]
    body += [f"{n} = A[{n[1:]}, i]" for n in names.per_agent]
    body += [f"{n} = W[{n[1:]}, i, j]" for n in names.per_pair]
    body += statements(chosen, arrays=False, prefix=f"g{number}_")
    head = f"for e in range(offsets[{number}], offsets[{number + 1}]):"
    return indented([head], 1) + indented(body + (_sums(chosen, m, "0.5 * ") if tail is None else tail), 2)


def _lengths(formulas: LawFormulas) -> list[sympy.Symbol]:
    """Lengths that displacements need."""
    return [period for period in formulas.periods if period is not None]


def _means(body: BodyFormulas, m: int) -> str:
    """Means over the group where a formula uses them, then the velocity of the frame."""
    from flocking.formula.printing import code

    frame = indented([f"frame{k} = {code(f, arrays=False)}" for k, f in enumerate(body.frame)], 1)
    used = free_names([*body.named().values(), *body.frame]).others
    if not any(n.startswith("mean_") for n in used):
        return frame
    lines = [f"mean_q{k} = 0.0" for k in range(m)] + [f"mean_p{k} = 0.0" for k in range(m)] + ["total_mass = 0.0"]
    lines += ["for i in range(n):"]
    lines += ["    total_mass += A[0, i]"]
    lines += [f"    mean_q{k} += A[0, i] * q[i, {k}]" for k in range(m)]
    lines += [f"    mean_p{k} += A[0, i] * p[i, {k}]" for k in range(m)]
    lines += [f"mean_q{k} /= total_mass" for k in range(m)] + [f"mean_p{k} /= total_mass" for k in range(m)]
    return indented(lines, 1) + frame


def _body_values(results: dict[str, sympy.Expr], m: int) -> list[str]:
    from flocking.formula.printing import statements

    names = free_names(results.values())
    lines = [f"{x}{k} = {x}[i, {k}]" for x in "qp" for k in range(m) if f"{x}{k}" in names.others]
    lines += [f"{n} = A[{n[1:]}, i]" for n in names.per_agent]
    return lines + statements(results, arrays=False, prefix="b_")


def _control_source(
    formulas: LawFormulas, order: int, neighbours: PresentNeighbours | KnownNeighbours = PRESENT
) -> str:
    m, body, present = formulas.dimension, formulas.body, isinstance(neighbours, PresentNeighbours)
    everything = [e for p in formulas.pairs for e in (*p.named().values(), p.flow)]
    everything += [*body.named().values(), *body.frame, body.flow, *_lengths(formulas)]
    head = f'@native_of(ARGUMENTS + "{neighbours.kinds}{CONTROL_RESULTS}")\n'
    head += "def control(t, q, p, senders, sensed, offsets, pieces, spans, P, A, W, S"
    head += f"{neighbours.parameters}, u, rates):\n"
    slope = f'@native_of("{SLOPE_ARGUMENTS}")\n'
    slope += "def slope(t, z, senders, sensed, offsets, pieces, spans, P, A, W, S, q, p, u, out):\n"
    count = indented(["n = q.shape[0]"], 1)
    source = unpack(free_names(everything), 1)
    source += indented(["work = 0.0", "dissipated = 0.0", "supplied = 0.0"], 1) + _means(body, m)
    source += indented(["for i in range(n):"], 1) + indented([f"u[i, {k}] = 0.0" for k in range(m)], 2)
    requested = {name: name for name in ("along", "drag", *(("dissipation", "supply") if order == 2 else ()))}
    alone = source
    for number in range(len(formulas.pairs)):
        loop = _pair_loop(number, formulas, requested, neighbours=neighbours)
        mutual = mutual_loop(number, formulas, requested, order) if present else None
        source, alone = source + loop, alone + (loop if mutual is None else mutual)
    before = len(source)
    push = [f"u[i, {k}] += force{k}" for k in range(m)]
    if order == 2:
        push += ["dissipated += dissipation", "supplied += supply"]
    for number, group in enumerate(formulas.obstacles):
        source += obstacle_loop(number, len(formulas.pairs), group, m, push)
    source += indented(["for i in range(n):"], 1)
    unwanted = {"storage"} if order == 2 else {"storage", "dissipation", "supply"}
    results = nonzero({k: v for k, v in body.named().items() if k not in unwanted})
    lines = _body_values(results, m) + _sums(results, m)
    if order == 2:
        lines += ["work += " + " + ".join(f"u[i, {k}] * p[i, {k}]" for k in range(m))]
    source += indented(lines or ["pass"], 2)
    if order == 1 and present:
        source += _flow_source(formulas)
    rates = indented([f"rates[{k}] = {name}" for k, name in enumerate(RATES)], 1)
    control = head + count + source + rates
    if not present:
        return control
    if order == 1:
        control += "\n\n" + _given_flow_source(formulas, everything)
    given = count + point_source(m, order) + alone + source[before:]
    flow = _flow_source(formulas) if order == 1 else ""
    control += "\n\n" + slope + given + motion_source(formulas, flow) + "\n\n"
    if formulas.body.motion.limits:
        control += "\n" + slope.replace("def slope(", "def limit_signs(") + given + limits_source(formulas) + "\n\n"
    return control


def _given_flow_source(formulas: LawFormulas, everything: list[sympy.Expr]) -> str:
    """The function ``flow``: `RATES` of first-order agents whose velocities are given in ``u``."""
    source = f'@native_of(ARGUMENTS + "{CONTROL_RESULTS}")\n'
    source += "def flow(t, q, p, senders, sensed, offsets, pieces, spans, P, A, W, S, u, rates):\n"
    source += indented(["n = q.shape[0]"], 1) + unpack(free_names(everything), 1)
    source += indented(["work = 0.0", "supplied = 0.0"], 1) + _means(formulas.body, formulas.dimension)
    source += _flow_source(formulas)
    return source + indented([f"rates[{k}] = {name}" for k, name in enumerate(RATES)], 1)


def _flow_source(formulas: LawFormulas) -> str:
    """Ledger of first-order agents: a gradient flow dissipates |u|^2; what else changes the storage is supplied."""
    m, source = formulas.dimension, ""
    for number in range(len(formulas.pairs)):
        source += _pair_loop(number, formulas, {"supply": "flow"}, ["supplied += 0.5 * supply"], velocity="u")
    power = ["supplied += " + " + ".join(f"force{k} * u[i, {k}]" for k in range(m))]
    for number, group in enumerate(formulas.obstacles):
        source += obstacle_loop(number, len(formulas.pairs), group, m, power)
    if any(name.startswith("mean_u") for name in free_names([formulas.body.flow]).others):
        lines = (
            ["total_mass = 0.0"]
            + [f"mean_u{k} = 0.0" for k in range(m)]
            + ["for i in range(n):", "    total_mass += A[0, i]"]
        )
        lines += [f"    mean_u{k} += A[0, i] * u[i, {k}]" for k in range(m)]
        source += indented([*lines, *(f"mean_u{k} /= total_mass" for k in range(m))], 1)
    source += indented(["for i in range(n):"], 1)
    flow = nonzero({"supply": formulas.body.flow})
    lines = [f"u{k} = u[i, {k}]" for k in range(m)] + _body_values(flow, m) + _sums(flow, m)
    lines += ["work += " + " + ".join(f"u{k} * u{k}" for k in range(m))]
    return source + indented(lines, 2) + indented(["dissipated = work"], 1)


def _energies_source(formulas: LawFormulas) -> str:
    from flocking.formula.printing import statements

    m, body = formulas.dimension, formulas.body
    everything = [p.storage for p in formulas.pairs] + [*body.named().values(), *body.frame, body.motion.kinetic]
    everything += _lengths(formulas)
    source = "@native_of(ARGUMENTS)\n"
    source += "def energies(t, q, p, senders, sensed, offsets, pieces, spans, P, A, W, S):\n"
    source += indented(["n = q.shape[0]"], 1) + unpack(free_names(everything), 1)
    source += indented(["pairs = 0.0", "bodies = 0.0", "kinetic = 0.0"], 1) + _means(body, m)
    for number in range(len(formulas.pairs)):
        source += _pair_loop(number, formulas, {"storage": "storage"}, ["pairs += 0.5 * storage"])
    storage = nonzero({"storage": body.storage})
    lines = _body_values(storage, m) + ["bodies += storage"] * len(storage)
    if body.motion.kinetic != 0:
        moving = free_names([body.motion.kinetic])
        known = {line.split(" = ")[0] for line in lines}
        lines += [f"{x}{k} = {x}[i, {k}]" for x in "qp" for k in range(m) if f"{x}{k}" in moving.others - known]
        lines += [f"w{k} = p[i, {k}] - frame{k}" for k in range(m)]
        lines += [f"{n} = A[{n[1:]}, i]" for n in moving.per_agent if n not in known]
        lines += [*statements({"moving": body.motion.kinetic}, arrays=False, prefix="k_"), "kinetic += moving"]
    if lines:
        source += indented(["for i in range(n):"], 1) + indented(lines, 2)
    return source + "    return pairs, bodies, kinetic\n\n\n"


def _frame_source(formulas: LawFormulas) -> str:
    """The function ``frame``: velocity of the frame of the energy."""
    body, m = formulas.body, formulas.dimension
    source = f'@native_of(ARGUMENTS + "{FRAME_RESULTS}")\n'
    source += "def frame(t, q, p, senders, sensed, offsets, pieces, spans, P, A, W, S, found):\n"
    source += indented(["n = q.shape[0]"], 1) + unpack(free_names([*body.named().values(), *body.frame]), 1)
    return source + _means(body, m) + indented([f"found[{k}] = frame{k}" for k in range(m)], 1) + "\n\n"


def _array_module(formulas: LawFormulas) -> str:
    source = "import numpy\n\n\n"
    for number, pair in enumerate(formulas.pairs):
        source += _array_function(f"pair{number}", pair.named())
        source += _size_function(f"pair_sizes{number}", pair.named())
        source += _array_function(f"pair_flow{number}", {"supply": pair.flow})
    for number, group in enumerate(formulas.obstacles):
        source += obstacle_function(number, group)
    source += _array_function("body", formulas.body.named())
    source += _size_function("body_sizes", formulas.body.named())
    source += _array_function("motion", motion_values(formulas.body.motion))
    return source + _array_function("body_flow", {"supply": formulas.body.flow})


def _size_function(name: str, formulas: dict[str, sympy.Expr]) -> str:
    """Sums of the absolute values of what adds up to each formula: the scale of its rounding, where it cancels too."""
    import sympy

    addends = {key: sympy.Add.make_args(value) for key, value in formulas.items()}
    named = {f"{key}_{k}": x for key, found in addends.items() for k, x in enumerate(found)}
    sizes = {key: " + ".join(f"numpy.abs({key}_{k})" for k in range(len(found))) for key, found in addends.items()}
    return _array_function(name, named, sizes)


def _array_function(name: str, results: dict[str, sympy.Expr], given: dict[str, str] | None = None) -> str:
    """A function on arrays that gives the ``results``, or expressions of them."""
    from flocking.formula.printing import statements

    names = free_names(results.values())
    source = f"def {name}(P, values):\n" + unpack(names, 1)
    requested = [*names.per_agent, *names.per_pair, *sorted(names.others)]
    source += indented((f"{n} = values[{n!r}]" for n in requested), 1)
    source += indented(statements(results, arrays=True, prefix="x_"), 1)
    gives = {k: k for k in results} if given is None else given
    return source + indented(["return {" + ", ".join(f"{k!r}: {x}" for k, x in gives.items()) + "}"], 1) + "\n\n"
