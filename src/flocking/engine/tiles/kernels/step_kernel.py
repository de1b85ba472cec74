"""The one kernel of a law: pair sums over tiles, body terms and the move of the agents, in one pass.

The same pass serves every scheme: with ``a`` the acceleration, it writes ``p' = keep p + kick a`` and
``q' = q + drift p'`` beside the old state. keep 1, kick h, drift h is a step of half-step-velocity Verlet;
keep 0, kick 1, drift 0 gives the acceleration itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from types import ModuleType
from typing import TYPE_CHECKING, Any

from flocking.engine.tiles.kernels.spec import KernelSpec
from flocking.engine.tiles.kernels.tile_sums import SUMS, sums_of
from flocking.formula.compiled import generated_module
from flocking.formula.contact import ENDLESS

if TYPE_CHECKING:
    from flocking.engine.kernels.expressions import LawFormulas, PairFormulas
    from flocking.engine.kernels.obstacle_formulas import EncounterFormulas

GRAPH_ARGUMENTS = ("rows", "first", "count", "each", "limits")


def tile_kernels(spec: KernelSpec) -> ModuleType:
    """Module with the kernel ``move`` of a law; see the module's docstring and `_arguments`.

    Parameters
    ----------
    spec
        What fixes the kernel.
    """
    from flocking.engine.kernels.expressions import law_formulas

    layout = spec.layout
    return generated_module(
        ("tiles", spec.kind), layout.structure, layout.parts,
        lambda: law_formulas(layout, spec.dimension), lambda stated: _source(spec, stated),
    )  # fmt: skip


def _arguments(spec: KernelSpec) -> list[str]:
    """Arguments of ``move``.

    ``first_tile``, ``last_tile``; the time ``t``; ``keep``, ``kick``, ``drift``; ``velocity_lag`` (advances
    velocities to those of the time of the positions) and ``exponential_damping`` (1 where velocities are damped
    exponentially); ``hold``
    (links stay as they are); state ``X`` and its successor ``Y``, shape (16 tiles, 2m); the number of agents ``n``;
    per graph lists, squared radii per agent and for all; obstacles that each tile may meet; parameters ``P``, ``A``
    and ``O``; identities ``ids``; hash seeds and matrices of pair weights; means of the group; velocity of the crowd
    ``C``; results ``tile_extremes`` and ``sums`` per tile.
    """
    found = [
        "first_tile",
        "last_tile",
        "t",
        "keep",
        "kick",
        "drift",
        "velocity_lag",
        "exponential_damping",
        "hold",
        "X",
        "Y",
        "n",
    ]
    for number in range(len(spec.graphs)):
        found += [f"{name}{number}" for name in GRAPH_ARGUMENTS]
    for number in range(len(spec.layout.encounters())):
        found += [f"begin{number}", f"who{number}"]
    return [*found, "P", "A", "O", "ids", "seeds", "matrices", "M", "C", "tile_extremes", "sums"]


def _indented(lines: Iterable[str], depth: int) -> str:
    return "".join("    " * depth + line + "\n" for line in lines)


class _Writer:
    """Collects the parts of the kernel's source."""

    def __init__(self, spec: KernelSpec, formulas: LawFormulas) -> None:
        from flocking.engine.tiles.kernels.printing import Lifter

        self.spec, self.formulas = spec, formulas
        self.axes = range(spec.dimension)
        self.lifter = Lifter(self.uniform)
        self.per_agent: set[str] = set()
        self.encounter_values: list[Any] = []

    def uniform(self, name: str) -> bool:
        """Whether a symbol has one value for all agents."""
        if name in ("A0", "A1"):
            return not (self.spec.mass_each, self.spec.damping_each)[int(name[1])]
        return name in ("t", ENDLESS) or name.startswith(("P", "mean_"))

    def statements(self, results: dict[str, Any], prefix: str, inverses: dict[str, str] | None = None) -> list[str]:
        """Lines that compute ``results`` for one lane; notes which rows of A they read.

        ``inverses`` names what holds one over a symbol.
        """
        from flocking.engine.kernels.codegen import free_names
        from flocking.engine.tiles.kernels.printing import vector_statements

        lifted = {name: self.lifter.lift(value) for name, value in results.items()}
        names = free_names(lifted.values())
        self.per_agent |= {a for a in names.per_agent if not self.uniform(a)}
        weights = [self._weight(w) for w in names.per_pair]
        return weights + vector_statements(lifted, prefix, inverses)

    def _weight(self, name: str) -> str:
        number = int(name[1:])
        mine, theirs = "load(ids, base)", "gather(ids, j)"
        if self.spec.weights[number] == "hash":
            uniform = f"pair_uniform(seeds[{number}], {mine}, {theirs})"
            return f"{name} = narrow(seed_low{number} + seed_width{number} * {uniform}, T(0.0))"
        return f"{name} = narrow(gather(matrices[{number}], widen({mine}) * n + widen({theirs})), T(0.0))"

    def frame(self) -> list[str]:
        """Velocity of the energy's frame, one name per axis."""
        return [f"frame{k}" for k in self.axes]


def _pair_block(w: _Writer, number: int, pair: PairFormulas) -> list[str]:
    """Loop over the neighbours of one tile under one graph."""
    spec, axes = w.spec, w.axes
    kind = spec.graphs[number]
    requested = {"along": pair.along, "drag": pair.drag}
    if spec.ledger:
        requested |= {"storage": pair.storage, "dissipation": pair.dissipation, "supply": pair.supply}
    requested = {name: value for name, value in requested.items() if value != 0}
    if not requested and not kind.barrier:
        return []
    from flocking.engine.kernels.codegen import free_names

    names = free_names(requested.values())
    lane = [
        f"at = (first{number}[tile] + step) * 16",
        f"entry = load(rows{number}, at)",
        "j = entry & NUMBER" if kind.memory or kind.fixed else "j = entry",
    ]
    there = [f"{letter}{k}_there" for letter in "qp" for k in axes]
    mask = "NUMBER" if kind.memory or kind.fixed else "ALL"
    lane += [f"{', '.join(there)} = gather_agents(X, rows{number}, at, {mask})"]
    lane += [f"d{k} = q{k}_there - q{k}" for k in axes]
    if "drag" in requested or names.others & {"speed2", "radial", "pull"}:
        lane += [f"v{k} = p{k}_there - p{k}" for k in axes]
    lane += ["square = " + " + ".join(f"d{k} * d{k}" for k in axes), "other = j != i"]
    if kind.fixed:
        lane += ["linked = other"]
    else:
        leave = f"load(each{number}, base)" if kind.uneven else f"leave{number}"
        lane += [f"inside = square < {leave}"]
        if kind.memory:
            enter = "inside" if kind.uneven else f"(square < enter{number})"
            lane += [
                "was = other & (entry > NUMBER)",
                f"linked = select(hold, was, other & inside & (was | {enter}))",
                f"store(rows{number}, at, select(linked, j | LINKED, j))",
            ]
        else:
            lane += ["linked = other & inside"]
    lane += ["apart = linked & (square > T(0.0))", f"safe = select(square > T(0.0), square, safe{number})"]
    lane += ["inverse_r = inverse_root(safe)", "r = safe * inverse_r"]
    lane += ["near = select(linked & (square < near), square, near)"]
    if kind.barrier:
        lane += ["broken = select(was & ~inside, T(1.0), broken)"]
    if "speed2" in names.others:
        lane += ["speed2 = " + " + ".join(f"v{k} * v{k}" for k in axes)]
    if "radial" in names.others:
        lane += ["radial = (" + " + ".join(f"d{k} * v{k}" for k in axes) + ") * inverse_r"]
    relative = [f"(p{k} - {f})" for k, f in enumerate(w.frame())]
    if "push" in names.others:
        lane += ["push = (" + " + ".join(f"d{k} * {f}" for k, f in enumerate(relative)) + ") * inverse_r"]
    if "pull" in names.others:
        lane += ["pull = " + " + ".join(f"v{k} * {f}" for k, f in enumerate(relative))]
    results = dict(requested)
    if "along" in results:
        # Dividing inside the expression lets common factors of r cancel.
        results["along"] = results["along"] / _distance()
    met = _at_contact(requested)
    results |= {f"met_{name}": value for name, value in met.items()}
    lane += w.statements(results, f"g{number}_", {"r": "inverse_r"})
    lane += [f"{name} = select(square > T(0.0), {name}, met_{name})" for name in met]
    for k in axes:
        terms = []
        if "along" in requested:
            terms.append(f"select(apart, along, T(0.0)) * d{k}")
        if "drag" in requested:
            terms.append(f"select(linked, drag, T(0.0)) * v{k}")
        if terms:
            lane += [f"pull{k} = pull{k} + " + " + ".join(terms)]
    if spec.damped and "drag" in requested:
        lane += ["dragged = dragged + select(linked, drag, T(0.0))"]
    if spec.ledger:
        for name in ("storage", "dissipation", "supply"):
            if name in requested:
                lane += [f"total_{name} = total_{name} + select(linked, {name}, T(0.0))"]
        if "storage" in requested and kind.memory:
            change = "select(linked, storage, T(0.0)) - select(was, storage, T(0.0))"
            lane += [f"total_jumped = total_jumped + ({change})"]
        if number == 0:
            lane += ["links = links + select(linked, T(1.0), T(0.0))"]
    return [f"for step in range(count{number}[tile]):", *("    " + line for line in lane)]


def _at_contact(requested: dict[str, Any]) -> dict[str, Any]:
    """Limits, where two agents coincide, of the formulas that depend on the distance and have one."""
    from flocking.formula.contact import limit_at_contact

    still = {_parameter("radial"): 0, _parameter("push"): 0}
    found = {}
    for name, value in requested.items():
        limit = limit_at_contact(value.subs(still), _distance()) if name != "along" else None
        if limit is not None and value.has(_distance()):
            found[name] = limit
    return found


def _encounter_block(w: _Writer, number: int, encounter: EncounterFormulas) -> list[str]:
    """Loop over the obstacles of one group that a tile may meet."""
    from flocking.engine.kernels.codegen import free_names
    from flocking.engine.tiles.kernels.printing import Lifter
    from flocking.formula.printing import code

    spec, outer = w.spec, w.lifter
    w.lifter = Lifter(lambda name: w.uniform(name) or bool(re.fullmatch(r"O\d+", name)), prefix=f"met{number}_")
    body: list[str] = []
    requested = {*(f"force{k}" for k in w.axes), *(("dissipation", "supply") if spec.ledger else ())}
    *geometry, last = encounter.stages()
    for k, stage in enumerate([*geometry, {f"meet_{n}": e for n, e in last.items() if n in requested}]):
        body += w.statements(stage, f"o{number}_{k}_")
    term, _ = spec.layout.encounters()[number]
    reach = spec.layout.slot(spec.layout.term_owner(term), "range")
    body += [f"close = distance <= T({reach})"]
    body += [f"pull{k} = pull{k} + select(close, meet_force{k}, T(0.0))" for k in w.axes]
    if spec.ledger:
        body += ["met_dissipated = met_dissipated + select(close, meet_dissipation, T(0.0))"]
        body += ["met_supplied = met_supplied + select(close, meet_supply, T(0.0))"]
    definitions, w.lifter = w.lifter.definitions, outer
    w.encounter_values += list(definitions.values())
    rows = sorted({s for e in definitions.values() for s in map(str, e.free_symbols) if re.fullmatch(r"O\d+", s)})
    head = [f"o = who{number}[at]"] + [f"{n} = O[{n[1:]}, o]" for n in rows]
    head += [f"{name} = T({code(value, arrays=False)})" for name, value in definitions.items()]
    w.encounter_values += [_parameter(reach)]
    assert not free_names(definitions.values()).per_pair
    return [f"for at in range(begin{number}[tile], begin{number}[tile + 1]):", *("    " + x for x in [*head, *body])]


def _parameter(name: str) -> Any:
    import sympy

    return sympy.Symbol(name, real=True)


def _distance() -> Any:
    import sympy

    return sympy.Symbol("r", positive=True)


def _tail_block(w: _Writer) -> list[str]:
    """What happens to the agents of one tile after the pair sums."""
    import sympy

    spec, axes, body = w.spec, w.axes, w.formulas.body
    mass, damping = sympy.Symbol("A0", real=True), sympy.Symbol("A1", real=True)
    velocity = [sympy.Symbol(f"p{k}", real=True) for k in axes]
    results: dict[str, Any] = {}
    for k in axes:
        total = sympy.Symbol(f"pull{k}", real=True) + body.force[k]
        results[f"a{k}"] = (total - damping * velocity[k]) / mass
        if spec.damped:
            slope = sympy.diff(body.force[k], velocity[k])
            results[f"rate{k}"] = (sympy.Symbol("dragged", real=True) + damping - slope) / mass
    if spec.ledger:
        squares = [(sympy.Symbol(f"full{k}", real=True) - f) ** 2 for k, f in enumerate(body.frame)]
        powers = [(sympy.Symbol(f"pull{k}", real=True) + body.force[k]) * velocity[k] for k in axes]
        ledger = {"bodies": body.storage, "kinetic": mass * sum(squares) / 2, "work": sum(powers)}
        ledger |= {"dissipated": body.dissipation, "supplied": body.supply}
        if len(sums_of(spec)) > len(SUMS):
            moving = (sympy.Symbol(f"full{k}", real=True) - f for k, f in enumerate(body.frame))
            ledger |= {f"momentum{k}": mass * v for k, v in enumerate(moving)}
    lines = w.statements(results, "b_")
    if spec.ledger:
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
    lines += [f"store_agents(Y, base, ({', '.join([f'x{k}' for k in axes] + [f'next{k}' for k in axes])}))"]
    lines += ["square = " + " + ".join(f"c{k} * c{k}" for k in axes), "live = i < n"]
    # A NaN fails the comparison, so that it shows as an infinite speed.
    lines += ["speed = select(square < huge, square, endless)"]
    lines += ["tile_extremes[tile, 0] = highest(select(live, speed, T(0.0)))", "tile_extremes[tile, 1] = lowest(near)"]
    lines += ["tile_extremes[tile, 2] = highest(broken)" if _has_barriers(spec) else "tile_extremes[tile, 2] = T(0.0)"]
    if spec.ledger:
        parts = {name: f"total(select(live, {name}, T(0.0)))" for name in ledger}
        parts |= {"pairs": "0.5 * total(total_storage)", "links": "total(links)", "jumped": "0.5 * total(total_jumped)"}
        parts["dissipated"] += " + 0.5 * total(total_dissipation)"
        parts["supplied"] += " + 0.5 * total(total_supply)"
        if w.formulas.encounters:
            parts["dissipated"] += " + total(select(live, met_dissipated, T(0.0)))"
            parts["supplied"] += " + total(select(live, met_supplied, T(0.0)))"
        lines += [f"sums[tile, {k}] = {parts[name]}" for k, name in enumerate(sums_of(spec))]
    return lines


def _has_barriers(spec: KernelSpec) -> bool:
    return any(kind.barrier for kind in spec.graphs)


def _scratch(w: _Writer) -> list[str]:
    """Sums over the neighbours of a tile, which start at zero."""
    names = [f"pull{k}" for k in w.axes]
    if _has_barriers(w.spec):
        names += ["broken"]
    if w.spec.damped:
        names += ["dragged"]
    if w.spec.ledger:
        names += ["total_storage", "total_dissipation", "total_supply", "total_jumped", "links"]
        names += ["met_dissipated", "met_supplied"]
    return names


def _source(spec: KernelSpec, formulas: LawFormulas) -> str:
    from flocking.engine.tiles.simd import elementary_functions as vector_math
    from flocking.formula.printing import code

    w = _Writer(spec, formulas)
    axes = w.axes
    pairs = [_pair_block(w, number, pair) for number, pair in enumerate(formulas.pairs)]
    pairs += [_encounter_block(w, number, encounter) for number, encounter in enumerate(formulas.encounters)]
    tail = _tail_block(w)
    scratch = _scratch(w)
    frames: list[str] = []
    if spec.ledger:
        frames = [f"frame{k} = T({code(f, arrays=False)})" for k, f in enumerate(formulas.body.frame)]
    uniform = [f"{name} = T({code(value, arrays=False)})" for name, value in w.lifter.definitions.items()]
    scalars = _scalars(w, [*w.lifter.definitions.values(), *formulas.body.frame, *w.encounter_values])
    top = ["huge = T(1e36)", f"{ENDLESS} = T(np.inf)", *scalars, *frames, *uniform]
    for number, kind in enumerate(spec.graphs):
        top += [f"safe{number} = limits{number}[2]"]
        if not kind.fixed:
            top += [f"leave{number} = limits{number}[0]", f"enter{number} = limits{number}[1]"]
    tile = ["base = tile * 16", "i = numbers_from(base)"]
    own = [f"{letter}{k}" for letter in "qp" for k in axes]
    tile += [f"{', '.join(own)} = load_agents(X, base)"]
    tile += [f"{name} = load(A[{name[1:]}], base)" for name in sorted(w.per_agent)]
    tile += [f"{name} = spread(T(0.0))" for name in scratch] + ["near = spread(huge)"]
    for block in pairs:
        tile += block
    tile += tail
    text = "\n".join(tile)
    used = {name for name in ("fast_sin", "fast_cos", "fast_exp", "fast_log") if name + "(" in text}
    header = "import math\n\nimport numpy as np\n\n"
    header += f"from flocking.engine.tiles.simd.vectors import ({', '.join(_PRIMITIVES)})\n"
    header += "from flocking.engine.tiles.simd.interleaved_arrays import GATHERERS, LOADERS, STORERS\n"
    header += "from flocking.engine.tiles.simd.reductions import highest, lowest, total\n"
    header += "from flocking.engine.tiles.simd.inverse_square_root import inverse_root\n"
    header += "from flocking.formula.native.functions import native\n\n"
    header += f"T = np.{spec.precision}\nNUMBER = {2**31 - 1}\nLINKED = {2**31}\nALL = {2**32 - 1}\n"
    columns = 2 * spec.dimension
    header += f"load_agents = LOADERS[{columns}]\ngather_agents = GATHERERS[{columns}]\n"
    header += f"store_agents = STORERS[{columns}]\n\n\n"
    header += vector_math.source(used, spec.precision == "float64")
    if "hash" in spec.weights:
        header += _HASH
    header += "@native\n"
    header += f"def move({', '.join(_arguments(spec))}):\n"
    return header + _indented(top, 1) + _indented(["for tile in range(first_tile, last_tile):"], 1) + _indented(tile, 2)


def _scalars(w: _Writer, expressions: list[Any]) -> list[str]:
    """Unpack the run-time numbers that expressions use: parameters, then mass and damping, then ranges of hashes."""
    from flocking.engine.kernels.codegen import free_names

    names = free_names(expressions)
    count = sum(1 for s in w.spec.layout.slots.values() if s.startswith("P"))
    lines = [f"{n} = P[{n[1:]}]" for n in names.scalars]
    lines += [f"{n} = P[{count + int(n[1:])}]" for n in names.per_agent]
    for k in w.axes:
        lines += [f"mean_q{k} = M[{k}]", f"mean_p{k} = M[{w.spec.dimension + k}]"]
    for number, kind in enumerate(w.spec.weights):
        if kind == "hash":
            at = count + 2 + 2 * number
            lines += [f"seed_low{number} = P[{at}]", f"seed_width{number} = P[{at + 1}]"]
    return lines


_PRIMITIVES = (
    "each_lane", "float_bits", "float_of", "float_of_bits", "floor_of", "gather", "load",
    "narrow", "numbers_from", "root", "select", "spread", "store", "whole_of", "widen",
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
