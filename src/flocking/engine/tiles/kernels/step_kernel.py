"""The kernel of one time step: pair sums over tiles, body terms and the update of the agents, in one pass.

The same pass serves every integrator. With the acceleration ``a`` it writes ``p' = keep p + kick a`` and
``q' = q + drift p'`` to a second array. keep 1, kick h, drift h is a step of half-step-velocity Verlet;
keep 0, kick 1, drift 0 gives the acceleration itself. For agents of order 1 ``a`` is their velocity, and keep 0,
kick 1, drift h is a step of the forward Euler method. ``a`` is printed from the rates that the agents' body states.

The power supplied to agents of order 1 may depend on the velocities of their neighbours, which are known only after
the pass. A second kernel, ``flow``, adds it to the sums.
"""

from __future__ import annotations

import re
from types import ModuleType
from typing import TYPE_CHECKING

from flocking.engine.kernels.displacements import period_lines
from flocking.engine.kernels.layout import FACTORS
from flocking.engine.kernels.source_text import free_names, indented
from flocking.engine.tiles.kernels.body_motion import body_motion, further_names
from flocking.engine.tiles.kernels.pair_loop import pair_loop
from flocking.engine.tiles.kernels.spec import KernelSpec
from flocking.engine.tiles.kernels.tile_sums import DEPARTED, SUMS, has_momentum, sums_of
from flocking.engine.tiles.kernels.writer import Writer, parameter
from flocking.formula.compiled import generated_module
from flocking.formula.contact import ENDLESS

if TYPE_CHECKING:
    import sympy

    from flocking.engine.kernels.expressions import LawFormulas
    from flocking.engine.kernels.obstacle_formulas import ObstacleFormulas

GRAPH_ARGUMENTS = ("rows", "first", "count", "each", "limits")
"""Arguments of kernels for each graph: its lists, and its squared radii, per agent and common."""

BODY_ARGUMENTS = ("E", "R", "U")
"""Arguments of ``move`` where agents are more than points: their further columns, the rates of these, and the controls
of the law, each a row for each number of an agent, shape (rows, size)."""

HUGE = 1e36
"""Squared distance and squared speed above which numbers count as infinite: the sum of three such squares
is below the largest number of single precision (3.4e38)."""


def tile_kernels(spec: KernelSpec) -> ModuleType:
    """Module with the kernels ``move`` and ``flow`` of a law; for their arguments see `_arguments`.

    ``flow`` is called after ``move`` with the same arguments; it is None if there is nothing to add. ``VISITED``: for
    each graph whether ``move`` passes over its lists, as it does where something acts over it.

    Parameters
    ----------
    spec
        Specification of the kernels.
    """
    from flocking.engine.kernels.expressions import law_formulas
    from flocking.engine.kernels.flow_formulas import flow_formulas

    layout = spec.layout

    def stated() -> LawFormulas:
        found = law_formulas(layout, spec.dimension)
        return flow_formulas(found) if spec.order == 1 else found

    return generated_module(
        ("tiles", spec.kind), layout.structure, layout.parts, stated, lambda formulas: _source(spec, formulas)
    )


def _arguments(spec: KernelSpec) -> list[str]:
    """Arguments of ``move``.

    ``first_tile``, ``last_tile``; the time ``t``; ``keep``, ``kick``, ``drift``; ``velocity_lag`` (time by which
    velocities are advanced to the time of the positions) and ``exponential_damping`` (1 if velocities are damped
    exponentially); ``hold`` (links do not change); the state ``X`` and the next state ``Y``, shape (16 tiles, 2m),
    or no rows where only the sums are needed; the number of agents ``n``; `graph_arguments`; the obstacles within range
    of each tile; parameters ``P``, ``A`` and ``O``; identities ``ids``; hash seeds and matrices of pair weights; means
    over the group; velocity ``C`` of the frame of the lists; results ``tile_extremes`` and ``sums`` per tile;
    where agents are more than points `BODY_ARGUMENTS`.
    """
    found = [
        "first_tile", "last_tile", "t", "keep", "kick", "drift", "velocity_lag", "exponential_damping", "hold", "X",
        "Y", "n",
    ]  # fmt: skip
    found += graph_arguments(spec)
    found += obstacle_arguments(spec)
    found += ["P", "A", "O", "ids", "seeds", "matrices", "M", "C", "tile_extremes", "sums"]
    return [*found, *BODY_ARGUMENTS] if spec.bodied else found


def graph_arguments(spec: KernelSpec) -> list[str]:
    """Names of `GRAPH_ARGUMENTS` of each graph, of fields of view, and of factors of headings; graph after graph.

    Parameters
    ----------
    spec
        Specification of the kernel.
    """
    each = [(*GRAPH_ARGUMENTS, *["views"] * bool(kind.view), *[FACTORS] * kind.fades) for kind in spec.graphs]
    return [f"{name}{number}" for number, names in enumerate(each) for name in names]


def obstacle_arguments(spec: KernelSpec) -> list[str]:
    """Names of the lists of obstacles within range of each tile, group by group.

    Parameters
    ----------
    spec
        Specification of the kernel.
    """
    return [f"{name}{number}" for number in range(len(spec.layout.obstacle_groups())) for name in ("begin", "who")]


def obstacle_block(w: Writer, number: int, obstacle_group: ObstacleFormulas) -> list[str]:
    """Loop over the obstacles of one group within range of a tile.

    Parameters
    ----------
    w
        Collects the parts of the source.
    number, obstacle_group
        Index of the group, and its formulas.
    """
    from flocking.engine.tiles.kernels.printing import Lifter
    from flocking.formula.printing import code

    spec, outer = w.spec, w.lifter
    w.lifter = Lifter(lambda name: w.uniform(name) or bool(re.fullmatch(r"O\d+", name)), prefix=f"met{number}_")
    body: list[str] = []
    powers = ("dissipation", "supply") if spec.ledger and spec.order == 2 else ()
    requested = {*(f"force{k}" for k in w.axes), *powers}
    *geometry, last = obstacle_group.stages()
    for k, stage in enumerate([*geometry, {f"meet_{n}": e for n, e in last.items() if n in requested}]):
        body += w.statements(stage, f"o{number}_{k}_")
    term, _ = spec.layout.obstacle_groups()[number]
    reach = spec.layout.slot(spec.layout.term_owner(term), "range")
    body += [f"close = distance <= T({reach})"]
    body += [f"pull{k} = pull{k} + select(close, meet_force{k}, T(0.0))" for k in w.axes]
    if spec.ledger and spec.order == 1:
        body += [f"met{k} = met{k} + select(close, meet_force{k}, T(0.0))" for k in w.axes]
    elif spec.ledger:
        body += ["met_dissipated = met_dissipated + select(close, meet_dissipation, T(0.0))"]
        body += ["met_supplied = met_supplied + select(close, meet_supply, T(0.0))"]
    definitions, w.lifter = w.lifter.definitions, outer
    w.obstacle_values += list(definitions.values())
    rows = sorted({s for e in definitions.values() for s in map(str, e.free_symbols) if re.fullmatch(r"O\d+", s)})
    head = [f"o = who{number}[at]"] + [f"{n} = O[{n[1:]}, o]" for n in rows]
    head += [f"{name} = T({code(value, arrays=False)})" for name, value in definitions.items()]
    w.obstacle_values += [parameter(reach)]
    assert not free_names(definitions.values()).per_pair
    return [f"for at in range(begin{number}[tile], begin{number}[tile + 1]):", *("    " + x for x in [*head, *body])]


def _tail_block(w: Writer) -> list[str]:
    """Update of the agents of one tile after the pair sums."""
    import sympy

    spec, axes, body = w.spec, w.axes, w.formulas.body
    mass, damping = sympy.Symbol("A0", real=True), sympy.Symbol("A1", real=True)
    controls = {sympy.Symbol(f"u{k}", real=True): sympy.Symbol(f"pull{k}", real=True) + body.force[k] for k in axes}
    moved = "p" if spec.order == 2 else "q"
    results: dict[str, sympy.Expr] = {}
    stated = body.motion.rates
    lines: list[str] = []
    if spec.bodied:
        stated, controls, lines = body_motion(w, controls)
        results = {f"rate_{name}": stated[f"rate_{name}"] for name in further_names(spec)}
    for k in axes:
        results[f"a{k}"] = stated[f"rate_{moved}{k}"].xreplace(controls)
        if spec.damped:
            slope = sympy.diff(body.force[k], sympy.Symbol(f"p{k}", real=True))
            results[f"rate{k}"] = (sympy.Symbol("dragged", real=True) + damping - slope) / mass
    lines += w.statements(results, "b_")
    lines += [f"store(R[{k}], base, rate_{name})" for k, name in enumerate(further_names(spec))]
    ledger: dict[str, sympy.Expr] = {}
    if spec.ledger and spec.order == 1:
        ledger = _flow_ledger(w)
        lines += w.statements(ledger, "e_")
    elif spec.ledger:
        moving = [sympy.Symbol(f"full{k}", real=True) - f for k, f in enumerate(body.frame)]
        kinetic = body.motion.kinetic.xreplace({sympy.Symbol(f"w{k}", real=True): v for k, v in enumerate(moving)})
        powers = [u * sympy.Symbol(f"p{k}", real=True) for k, u in enumerate(controls.values())]
        ledger = {"bodies": body.storage, "kinetic": kinetic, "work": sum(powers)}
        ledger |= {"dissipated": body.dissipation, "supplied": body.supply}
        if spec.departs:
            relative = {sympy.Symbol(f"w{k}", real=True): v for k, v in enumerate(moving)}
            ledger[DEPARTED] = stated["departure"].xreplace(relative)
        if has_momentum(spec):
            ledger |= {f"momentum{k}": mass * v for k, v in enumerate(moving)}
        lines += [f"full{k} = p{k} + velocity_lag * a{k}" for k in axes] + w.statements(ledger, "e_")
    for k in axes:
        if spec.damped:
            lines += [
                f"x{k} = exponential_damping * kick * rate{k}",
                f"x{k} = select(x{k} > T(0.0), x{k}, T(0.0))",
                f"mild{k} = T(1.0) - x{k} * (T(0.5) - x{k} * T({1 / 6!r}))",
                f"strong{k} = (T(1.0) - fast_exp(-x{k})) / select(x{k} > T(0.0), x{k}, T(1.0))",
                f"kick{k} = kick * select(x{k} < T(1e-3), mild{k}, strong{k})",
            ]
        kick = f"kick{k}" if spec.damped else "kick"
        lines += [f"next{k} = keep * p{k} + {kick} * a{k}", f"x{k} = q{k} + drift * next{k}"]
        lines += [f"c{k} = next{k} - C[{k}]"]
    state = ", ".join([f"x{k}" for k in axes] + [f"next{k}" for k in axes])
    lines += ["if Y.shape[0] > 0:", f"    store_agents(Y, base, ({state}))"]
    lines += ["square = " + " + ".join(f"c{k} * c{k}" for k in axes), "live = i < n"]
    # The comparison is false for NaN, which therefore gives an infinite speed.
    lines += ["speed = select(square < huge, square, endless)"]
    lines += ["tile_extremes[tile, 0] = highest(select(live, speed, T(0.0)))", "tile_extremes[tile, 1] = lowest(near)"]
    lines += ["tile_extremes[tile, 2] = highest(broken)" if _has_barriers(spec) else "tile_extremes[tile, 2] = T(0.0)"]
    if spec.ledger:
        parts = {name: f"total(select(live, {name}, T(0.0)))" for name in ledger}
        parts |= {"pairs": "0.5 * total(total_storage)", "links": "total(links)", "jumped": "0.5 * total(total_jumped)"}
        parts["dissipated"] += " + 0.5 * total(total_dissipation)"
        parts["supplied"] += " + 0.5 * total(total_supply)"
        if w.formulas.obstacles and spec.order == 2:
            parts["dissipated"] += " + total(select(live, met_dissipated, T(0.0)))"
            parts["supplied"] += " + total(select(live, met_supplied, T(0.0)))"
        lines += [f"sums[tile, {k}] = {parts[name]}" for k, name in enumerate(sums_of(spec))]
    return lines


def _flow_ledger(w: Writer) -> dict[str, sympy.Expr]:
    """Energies and powers of an agent of order 1: gradient descent dissipates |u|^2; ``flow`` adds further supply."""
    import sympy

    body = w.formulas.body
    velocity = [sympy.Symbol(f"a{k}", real=True) for k in w.axes]
    square: sympy.Expr = sum((v**2 for v in velocity), sympy.Integer(0))
    supply: sympy.Expr = sympy.Integer(0)
    if not _reads_mean_control(body.flow):
        supply = body.flow.xreplace({sympy.Symbol(f"u{k}", real=True): v for k, v in enumerate(velocity)})
    if w.formulas.obstacles:
        met = [sympy.Symbol(f"met{k}", real=True) for k in w.axes]
        supply += sum((f * v for f, v in zip(met, velocity, strict=True)), sympy.Integer(0))
    zero = sympy.Integer(0)
    return {"bodies": body.storage, "kinetic": zero, "work": square, "dissipated": square, "supplied": supply}


def _has_barriers(spec: KernelSpec) -> bool:
    return any(kind.barrier for kind in spec.graphs)


def _scratch(w: Writer) -> list[str]:
    """Initialization of the sums over the neighbours of a tile."""
    names = [f"pull{k}" for k in w.axes]
    if _has_barriers(w.spec):
        names += ["broken"]
    if w.spec.damped:
        names += ["dragged"]
    if w.spec.ledger:
        names += ["total_storage", "total_dissipation", "total_supply", "total_jumped", "links"]
        names += [f"met{k}" for k in w.axes] if w.spec.order == 1 else ["met_dissipated", "met_supplied"]
    return names


def _source(spec: KernelSpec, formulas: LawFormulas) -> str:
    from flocking.formula.printing import code

    w = Writer(spec, formulas)
    pairs = [pair_loop(w, number, pair) for number, pair in enumerate(formulas.pairs)]
    visited = tuple(map(bool, pairs))
    pairs += [obstacle_block(w, number, obstacle_group) for number, obstacle_group in enumerate(formulas.obstacles)]
    tail = _tail_block(w)
    frames: list[str] = []
    if spec.ledger:
        frames = [f"frame{k} = T({code(f, arrays=False)})" for k, f in enumerate(formulas.body.frame)]
    tile = [f"{name} = spread(T(0.0))" for name in _scratch(w)] + ["near = spread(huge)"]
    for block in pairs:
        tile += block
    kernels = _kernel(w, "move", tile + tail, [*formulas.body.frame, *w.obstacle_values], frames, "p")
    kernels += _flow_kernel(spec, formulas) if spec.order == 1 and spec.ledger else "\n\nflow = None\n"
    return module_header(spec, kernels) + kernels + f"\n\nVISITED = {visited!r}\n"


def module_header(spec: KernelSpec, kernels: str) -> str:
    """Imports, constants and functions that the text of some ``kernels`` uses.

    Parameters
    ----------
    spec
        Specification of the kernels.
    """
    from flocking.engine.tiles.simd import elementary_functions as vector_math

    used = {name for name in vector_math.NAMES if name + "(" in kernels}
    header = "import math\n\nimport numpy as np\n\n"
    header += f"from flocking.engine.tiles.simd.vectors import ({', '.join(_PRIMITIVES)})\n"
    header += "from flocking.engine.tiles.simd.row_transposition import GATHERERS, LOADERS, STORERS\n"
    header += "from flocking.engine.tiles.simd.reductions import highest, lowest, total\n"
    header += "from flocking.engine.tiles.simd.inverse_square_root import inverse_root\n"
    header += "from flocking.formula.native.functions import native\n\n"
    header += f"T = np.{spec.precision}\nNUMBER = {2**31 - 1}\nLINKED = {2**31}\nALL = {2**32 - 1}\n"
    columns = 2 * spec.dimension
    header += f"load_agents = LOADERS[{columns}]\ngather_agents = GATHERERS[{columns}]\n"
    header += f"store_agents = STORERS[{columns}]\n\n\n"
    header += vector_math.source(used, spec.precision == "float64")
    return header + (_HASH if "hash" in spec.weights else "")


def _kernel(w: Writer, name: str, tile: list[str], values: list[sympy.Expr], frames: list[str], mean: str) -> str:
    """One function over the tiles: unpacking of its arguments, then the lines for a tile."""
    first = ["base = tile * 16", "i = numbers_from(base)", *own_lines(w, "X")]
    head = f"@native\ndef {name}({', '.join(_arguments(w.spec))}):\n"
    head += indented(uniform_lines(w, values, frames, mean), 1)
    return head + indented(["for tile in range(first_tile, last_tile):"], 1) + indented(first + tile, 2)


def own_lines(w: Writer, source: str) -> list[str]:
    """Lines that load the agents of a tile from the array ``source``, and the numbers of the law that each has.

    Parameters
    ----------
    w
        Has printed the lines that use them.
    """
    own = [f"{letter}{k}" for letter in "qp" for k in w.axes]
    lines = [f"{', '.join(own)} = load_agents({source}, base)"]
    return lines + [f"{row} = load(A[{row[1:]}], base)" for row in sorted(w.per_agent)]


def uniform_lines(w: Writer, values: list[sympy.Expr], frames: list[str], mean: str) -> list[str]:
    """Lines before the loop over the tiles: all that is the same for every agent.

    Parameters
    ----------
    w
        Has printed the lines for a tile.
    values
        Further expressions whose numbers are needed.
    frames
        Lines that follow the unpacking of the numbers.
    mean
        As for `scalar_lines`.
    """
    from flocking.formula.printing import code

    spec = w.spec
    uniform = [f"{name} = T({code(value, arrays=False)})" for name, value in w.lifter.definitions.items()]
    repeated = [(k, slot) for k, slot in enumerate(w.periods) if slot is not None]
    needed = [*w.lifter.definitions.values(), *values, *(parameter(slot) for _, slot in repeated)]
    frames = frames + [line for k, slot in repeated for line in period_lines(k, slot)]
    top = [f"huge = T({HUGE!r})", f"{ENDLESS} = T(np.inf)", *scalar_lines(w, needed, mean), *frames, *uniform]
    for number, kind in enumerate(spec.graphs):
        top += [f"safe{number} = limits{number}[2]"]
        if not kind.fixed:
            top += [f"leave{number} = limits{number}[0]", f"enter{number} = limits{number}[1]"]
    return top


def _flow_kernel(spec: KernelSpec, formulas: LawFormulas) -> str:
    """Kernel that adds the supply of agents of order 1 that depends on velocities of others, read from ``Y``.

    It runs after ``move`` with kick 1 and uses the links of that pass.
    """
    w = Writer(spec, formulas)
    tile = ["total_supply = spread(T(0.0))"]
    for number, pair in enumerate(formulas.pairs):
        tile += pair_loop(w, number, pair, flow=True)
    flow = formulas.body.flow
    means = _reads_mean_control(flow)
    if len(tile) == 1 and not means:
        return "\n\nflow = None\n"
    lines = w.statements({"own_supply": flow}, "e_") if means else []
    beside = [f"{letter}{k}" for letter in "xu" for k in w.axes]
    tile = [f"{', '.join(beside)} = load_agents(Y, base)", *tile, *lines]
    own = " + total(select(i < n, own_supply, T(0.0)))" if means else ""
    at = SUMS.index("supplied")
    tile += [f"sums[tile, {at}] = sums[tile, {at}] + 0.5 * total(total_supply){own}"]
    return "\n\n" + _kernel(w, "flow", tile, [], [], "u")


def _reads_mean_control(flow: sympy.Expr) -> bool:
    """Whether a supply depends on the mean velocity of agents of order 1."""
    return any(name.startswith("mean_u") for name in free_names([flow]).others)


def scalar_lines(w: Writer, expressions: list[sympy.Expr], mean: str) -> list[str]:
    """Unpack the run-time numbers in expressions: parameters, mass and damping, ranges of hashed weights and widths
    of matrices.

    ``w`` has printed the lines that use them; ``mean`` is the quantity in the second half of the means: velocities
    ``p`` or controls ``u``.
    """
    names = free_names(expressions)
    count = sum(1 for s in w.spec.layout.slots.values() if s.startswith("P"))
    lines = [f"{n} = P[{n[1:]}]" for n in names.scalars]
    lines += [f"{n} = P[{count + int(n[1:])}]" for n in names.per_agent]
    for k in w.axes:
        lines += [f"mean_q{k} = M[{k}]", f"mean_{mean}{k} = M[{w.spec.dimension + k}]"]
    for number, kind in enumerate(w.spec.weights):
        if kind == "hash":
            at = count + 2 + 2 * number
            lines += [f"seed_low{number} = P[{at}]", f"seed_width{number} = P[{at + 1}]"]
        elif kind == "matrix":
            lines += [f"width{number} = np.int64(P[{count + 2 + 2 * number}])"]
    return lines


_PRIMITIVES = (
    "each_lane", "float_bits", "float_of", "float_of_bits", "floor_of", "gather", "load",
    "narrow", "numbers_from", "root", "select", "spread", "store", "integer_of", "widen",
)  # fmt: skip

_HASH = """def pair_uniform(seed, i, j):
    least = select(i < j, i, j)
    most = select(i < j, j, i)
    z = (widen(most) << 32) + widen(least) + seed * np.uint64(0x9E3779B97F4A7C15)
    for _ in range(2):
        z = z + np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> 30)) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> 27)) * np.uint64(0x94D049BB133111EB)
        z = z ^ (z >> 31)
    return float_of(z >> 11) * 1.1102230246251565e-16


"""
