"""The loop of a kernel over the neighbours of one tile."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flocking.engine.kernels.displacements import nearest_image_line
from flocking.engine.tiles.kernels.spec import HEADINGS, GraphKind
from flocking.engine.tiles.kernels.writer import Writer, distance, parameter
from flocking.model.graphs.views import VELOCITY

if TYPE_CHECKING:
    import sympy

    from flocking.engine.kernels.expressions import PairFormulas

JUST_BELOW = 1.0 - 4e-6
"""Share of the squared break radius below which pieces are chosen: 34 spacings of single precision below the square."""


def pair_loop(w: Writer, number: int, pair: PairFormulas, *, flow: bool = False) -> list[str]:
    """Loop over the neighbours of one tile under one graph.

    Parameters
    ----------
    w
        Collects the parts of the source.
    number
        Index of the graph.
    pair
        Formulas of its pairs.
    flow
        Whether only the supply of agents of order 1 is summed, from their controls in the array ``Y``.
    """
    from flocking.engine.kernels.source_text import free_names

    spec = w.spec
    kind = spec.graphs[number]
    requested = {"along": pair.along, "drag": pair.drag}
    if spec.ledger:
        requested |= {"storage": pair.storage, "dissipation": pair.dissipation, "supply": pair.supply}
    if flow:
        requested = {"supply": pair.flow}
    requested = {name: value for name, value in requested.items() if value != 0}
    if not requested and (flow or not (kind.barrier or w.logs)):
        return []
    names = free_names(requested.values()).others
    needs_velocity = "drag" in requested or bool(names & {"speed2", "radial", "pull"})
    lane = _neighbour_lines(w, number, needs_velocity=needs_velocity, flow=flow)
    lane += _view_lines(w, number) if kind.view else []
    lane += _link_lines(kind, number, by_agent=w.controls)
    lane += _mark_lines(w, number)
    lane += ["apart = linked & (square > T(0.0))", f"safe = select(square > T(0.0), square, safe{number})"]
    lane += ["inverse_r = inverse_root(safe)", "r = safe * inverse_r"]
    lane += _side_lines(kind, number) if kind.edge and not flow else []
    lane += [] if flow else ["near = select(linked & (square < near), square, near)"]
    if kind.barrier and not flow:
        lane += ["broken = select(was & ~inside, T(1.0), broken)"]
    lane += _relative_motion_lines(w, names, flow=flow)
    results = dict(requested)
    by_side = kind.edge and "storage" in results
    if by_side:
        results |= _stored_by_side(pair.storage)
    if "along" in results:
        # Dividing inside the expression lets common factors of r cancel.
        results["along"] = results["along"] / distance()
    met = _at_contact(requested)
    results |= {f"met_{name}": value for name, value in met.items()}
    lane += w.statements(results, f"g{number}_", {"r": "inverse_r"})
    # Where the formula does not go on beyond the radius it has the value of there.
    lane += ["storage = select(storage - storage < T(1.0), storage, storage_at_side)"] * by_side
    lane += [f"{name} = select(square > T(0.0), {name}, met_{name})" for name in met]
    lane += _sum_lines(w, number, requested, counts_links=not flow)
    first = [] if w.heard is None else w.heard.rows_lines(number, [*_entry_lines(w, number), "other = j != i"])
    return [*first, f"for step in range(count{number}[tile]):", *("    " + line for line in lane)]


def _entry_lines(w: Writer, number: int) -> list[str]:
    """Load one row of a list."""
    kind = w.spec.graphs[number]
    marked = kind.memory or kind.fixed or w.controls
    return [
        f"at = (first{number}[tile] + step) * 16",
        f"entry = load(rows{number}, at)",
        "j = entry & NUMBER" if marked else "j = entry",
    ]


def _neighbour_lines(w: Writer, number: int, *, needs_velocity: bool, flow: bool) -> list[str]:
    """Load the neighbours in one row of a list, with their positions relative to the agents of the tile."""
    kind, axes = w.spec.graphs[number], w.axes
    marked = kind.memory or kind.fixed or w.controls
    lines = _entry_lines(w, number)
    there = [f"{letter}{k}_there" for letter in "qp" for k in axes]
    found = f"rows{number}, at, {'NUMBER' if marked else 'ALL'}"
    if w.heard is None:
        lines += [f"{', '.join(there)} = gather_agents(X, {found})"]
    else:
        # What is known of a neighbour is a row of the samples; who is not known is no neighbour.
        lines += ["other = j != i", *w.heard.search(number), "other = other & there"]
        lines += [f"{', '.join(there)} = gather_agents(S, spots, 0, ALL)"]
        lines += [f"q{k}_there = q{k}_there + age * p{k}_there" for k in axes] * w.heard.predict
    if flow:
        beside = [f"{letter}{k}_there" for letter in "xu" for k in axes]
        lines += [f"{', '.join(beside)} = gather_agents(Y, {found})"] * needs_velocity
    lines += [f"d{k} = q{k}_there - q{k}" for k in axes]
    lines += [nearest_image_line(k) for k, slot in enumerate(w.periods) if slot is not None]
    if needs_velocity:
        letter = "u" if flow else "p"
        lines += [f"v{k} = {letter}{k}_there - {letter}{k}" for k in axes]
    lines += ["square = " + " + ".join(f"d{k} * d{k}" for k in axes)]
    return lines if w.heard is not None else [*lines, "other = j != i"]


def _view_lines(w: Writer, number: int) -> list[str]:
    """Determine which neighbours are within the angle of view: by squares with their signs, which need no root.

    Velocities are divided by their largest component before: single precision does not hold squares of products of
    small lengths and speeds, nor of a speed that fades away.
    """
    view = w.spec.graphs[number].view
    length, first = [], list[str]()
    if view == VELOCITY:
        first = [f"part{k} = select(p{k} < T(0.0), -p{k}, p{k})" for k in w.axes]
        first += ["fastest = part0", *(f"fastest = select(part{k} > fastest, part{k}, fastest)" for k in w.axes[1:])]
        first += ["fastest = select(fastest > T(0.0), fastest, T(1.0))"]
        first += [f"look{k} = p{k} / fastest" for k in w.axes]
        headings = [f"look{k}" for k in w.axes]
        length = [f"({' + '.join(f'look{k} * look{k}' for k in w.axes)})"]
    elif view == HEADINGS:
        headings = [f"load(views{number}[{k + 1}], base)" for k in w.axes]
    else:
        headings = [f"load(E[{w.spec.row_of(view) + k}], base)" for k in w.axes]
    least = " * ".join([f"load(views{number}[0], base)", "square", *length])
    return [
        *first,
        "ahead = " + " + ".join(f"d{k} * {heading}" for k, heading in enumerate(headings)),
        "ahead = select(ahead < T(0.0), -ahead * ahead, ahead * ahead)",
        f"seen = ahead >= {least}",
    ]


def _link_lines(kind: GraphKind, number: int, *, by_agent: bool) -> list[str]:
    """Determine which neighbours are linked; entries of a graph with memory store it.

    Parameters
    ----------
    kind
        Properties of the graph.
    number
        Index of the graph.
    by_agent
        Whether ``hold`` differs between the agents of a tile.
    """
    if kind.fixed:
        return ["linked = other"]
    leave = f"load(each{number}, base)" if kind.uneven else f"leave{number}"
    lines = [f"inside = square < {leave}"]
    near = "other & inside & seen" if kind.view else "other & inside"
    if not kind.memory:
        return [*lines, f"linked = {near}"]
    enter = "inside" if kind.uneven else f"(square < enter{number})"
    flagged = "select(linked, j | LINKED, j)"
    return [
        *lines,
        "was = other & (entry > NUMBER)",
        f"linked = select(hold, was, {near} & (was | {enter}))",
        f"store(rows{number}, at, {f'select(hold, entry, {flagged})' if by_agent else flagged})",
    ]


def _stored_by_side(storage: sympy.Expr) -> dict[str, sympy.Expr]:
    """What a pair stores: with its pieces chosen by ``side`` instead of the distance, and at that distance itself."""
    import sympy

    side = sympy.Symbol("side", positive=True)
    found = {x: x.xreplace({distance(): side}) for x in storage.atoms(sympy.core.relational.Relational)}
    return {"storage": storage.xreplace(found), "storage_at_side": storage.xreplace({distance(): side})}


def _side_lines(kind: GraphKind, number: int) -> list[str]:
    """Set ``side``, the distance or what is just below the break radius: a link that broke had the energy of there."""
    leave = f"load(each{number}, base)" if kind.uneven else f"leave{number}"
    return [
        f"edge = {leave} * T({JUST_BELOW})", "below = select(safe < edge, safe, edge)",
        "side = below * inverse_root(below)",
    ]  # fmt: skip


def _mark_lines(w: Writer, number: int) -> list[str]:
    """Write beside an entry whether it stands for a neighbour that is used, and by which sample, counted from 1."""
    if not w.logs:
        return []
    sample = "spread(np.uint32(0))" if w.heard is None else "best"
    mark = f"select(linked, {sample} | LINKED, spread(np.uint32(0)))"
    return [f"store(marks{number}, (placed{number}[tile] + step) * 16, {mark})"]


def _relative_motion_lines(w: Writer, names: frozenset[str], *, flow: bool) -> list[str]:
    """Products of distances and velocities in the formulas of a pair."""
    axes, lines = w.axes, []
    if "speed2" in names:
        lines += ["speed2 = " + " + ".join(f"v{k} * v{k}" for k in axes)]
    if "radial" in names:
        lines += ["radial = (" + " + ".join(f"d{k} * v{k}" for k in axes) + ") * inverse_r"]
    relative = [f"u{k}" for k in axes] if flow else [f"(p{k} - {f})" for k, f in enumerate(w.frame())]
    if "push" in names:
        lines += ["push = (" + " + ".join(f"d{k} * {f}" for k, f in enumerate(relative)) + ") * inverse_r"]
    if "pull" in names:
        lines += ["pull = " + " + ".join(f"v{k} * {f}" for k, f in enumerate(relative))]
    return lines


def _sum_lines(w: Writer, number: int, requested: dict[str, sympy.Expr], *, counts_links: bool) -> list[str]:
    """Add the contributions of the neighbours in one row to the forces and to the ledger."""
    spec, lines = w.spec, []
    for k in w.axes:
        terms = []
        if "along" in requested:
            terms.append(f"select(apart, along, T(0.0)) * d{k}")
        if "drag" in requested:
            terms.append(f"select(linked, drag, T(0.0)) * v{k}")
        if terms:
            lines += [f"pull{k} = pull{k} + " + " + ".join(terms)]
    if spec.damped and "drag" in requested:
        lines += ["dragged = dragged + select(linked, drag, T(0.0))"]
    if not spec.ledger:
        return lines
    for name in ("storage", "dissipation", "supply"):
        if name in requested:
            lines += [f"total_{name} = total_{name} + select(linked, {name}, T(0.0))"]
    if "storage" in requested and spec.graphs[number].memory:
        change = "select(linked, storage, T(0.0)) - select(was, storage, T(0.0))"
        lines += [f"total_jumped = total_jumped + ({change})"]
    if number == 0 and counts_links:
        lines += ["links = links + select(linked, T(1.0), T(0.0))"]
    return lines


def _at_contact(requested: dict[str, sympy.Expr]) -> dict[str, sympy.Expr]:
    """Limits at distance zero of the formulas that depend on the distance, where they exist."""
    from flocking.formula.contact import limit_at_contact

    still = {parameter("radial"): 0, parameter("push"): 0}
    found = {}
    for name, value in requested.items():
        limit = limit_at_contact(value.subs(still), distance()) if name != "along" else None
        if limit is not None and value.has(distance()):
            found[name] = limit
    return found
