"""Loop over the undirected pairs of a graph: each is computed once, in portions that LLVM computes several at a time.

A pair acts on both of its agents with opposite forces if its formulas depend on the distance and the relative velocity
alone. Pairs of an undirected graph come so that those (i, j) with i < j are the first half, see `upper_first`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Indices, Links
from flocking.engine.kernels.displacements import displacement_lines
from flocking.engine.kernels.pieces import held
from flocking.engine.kernels.source_text import free_names, indented, nonzero
from flocking.model.graphs.connectivity import linked_pairs

if TYPE_CHECKING:
    from flocking.engine.kernels.expressions import LawFormulas

PORTION = 32
"""Pairs computed together: their numbers stay in the fastest cache, and few places are left over."""

LANES = 8
"""Numbers that processors compute at a time at most; a portion is filled up to a multiple of it, as single ones cost as
much. What is computed in places that no pair has is not read."""

MUTUAL = frozenset({"r", "side", "reach", "speed2", "radial", "t"})
"""Names that are the same for both agents of a pair."""


def upper_first(links: Links, directed: bool) -> tuple[Indices, Indices]:
    """Ordered pairs of a graph: row by row, of an undirected one those with i < j before the others.

    Parameters
    ----------
    links
        The link matrix, shape (N, N); symmetric unless ``directed``.
    """
    i, j = linked_pairs(links)
    if directed:
        return i, j
    upper = i < j
    return np.concatenate([i[upper], i[~upper]]), np.concatenate([j[upper], j[~upper]])


def mutual_loop(number: int, formulas: LawFormulas, requested: Mapping[str, str], order: int) -> str | None:
    """Lines that add the forces of both agents of every pair and the sums; None if the forces are not opposite.

    Parameters
    ----------
    number, formulas
        Number of the graph, and the formulas of the law.
    requested
        Formulas of a pair by the names they get: ``along``, ``drag``, ``dissipation``, ``supply``.
    order
        Order of the agents, 1 or 2.
    """
    from flocking.formula.printing import statements

    m, pair = formulas.dimension, formulas.pairs[number]
    chosen, split = held(nonzero({name: getattr(pair, source) for name, source in requested.items()}), "r")
    names = free_names(chosen.values())
    if pair.directed or names.per_agent or names.per_pair or not names.others <= MUTUAL:
        return None
    if not chosen:
        return ""
    axes, moving = range(m), "drag" in chosen or bool(names.others & {"speed2", "radial"})
    gathered = [f"d{k}" for k in axes] + [f"v{k}" for k in axes if moving]
    spans = ["low_side", "high_side", "low_reach", "high_reach"] if split else []
    sums = {"dissipation": "dissipated", "supply": "supplied"}
    given = [f"f{k}" for k in axes] + [name for name in sums if name in chosen]
    arrays = {name: f"{name}_{number}" for name in [*gathered, *spans, *given]}
    first = [f"{arrays[name]} = np.empty({PORTION})" for name in arrays]
    gather = ["i = senders[begin + c]", "j = sensed[begin + c]"]
    # The state vector's places are multiples of a number known when the code is compiled.
    gather += displacement_lines(formulas.periods, lambda k: f"z[j * {m} + {k}]", lambda k: f"z[i * {m} + {k}]")
    velocity = "z[(n + {agent}) * {m} + {k}]" if order == 2 else "p[{agent}, {k}]"
    seen, own = ([velocity.format(agent=agent, m=m, k=k) for k in axes] for agent in "ji")
    gather += [f"v{k} = {seen[k]} - {own[k]}" for k in axes if moving]
    gather += [f"{arrays[name]}[c] = {name}" for name in gathered]
    if split:
        gather += ["row = pieces[begin + c]"]
        gather += [f"{arrays[name]}[c] = spans[row, {k}]" for k, name in enumerate(spans)]
    compute = [f"{name} = {arrays[name]}[c]" for name in [*gathered, *spans]]
    compute += ["r = math.sqrt(" + " + ".join(f"d{k} * d{k}" for k in axes) + ")"]
    if split:
        compute += ["side = min(max(r, low_side), high_side)", "reach = min(max(r, low_reach), high_reach)"]
    if "speed2" in names.others:
        compute += ["speed2 = " + " + ".join(f"v{k} * v{k}" for k in axes)]
    if "radial" in names.others:
        compute += ["radial = (" + " + ".join(f"d{k} * v{k}" for k in axes) + ") / r if r > 0.0 else 0.0"]
    compute += statements(chosen, arrays=False, prefix=f"g{number}_")
    parts: dict[int, list[str]] = {k: [] for k in axes}
    if "along" in chosen:
        compute += ["scale = along / r if r > 0.0 else along * 0.0"]
        parts = {k: [*x, f"scale * d{k}"] for k, x in parts.items()}
    if "drag" in chosen:
        parts = {k: [*x, f"drag * v{k}"] for k, x in parts.items()}
    compute += [f"{arrays[f'f{k}']}[c] = " + (" + ".join(x) or "0.0") for k, x in parts.items()]
    compute += [f"{arrays[name]}[c] = {name}" for name in sums if name in chosen]
    scatter = ["i = senders[begin + c]", "j = sensed[begin + c]"]
    scatter += [f"force{k} = {arrays[f'f{k}']}[c]" for k in axes]
    # Pairs come row by row: the force on the agent of a row is added up in registers. No agent is its own partner.
    store = [f"u[held, {k}] = own{k}" for k in axes]
    scatter += ["if i != held:", "    if held >= 0:", *(f"        {line}" for line in store), "    held = i"]
    scatter += [f"    own{k} = u[i, {k}]" for k in axes]
    scatter += [f"own{k} += force{k}" for k in axes] + [f"u[j, {k}] -= force{k}" for k in axes]
    scatter += [f"{total} += {arrays[name]}[c]" for name, total in sums.items() if name in chosen]
    loop = "for c in range(count):"
    return (
        indented(first, 1)
        + indented([f"half_{number} = (offsets[{number}] + offsets[{number + 1}]) // 2"], 1)
        + indented([f"for begin in range(offsets[{number}], half_{number}, {PORTION}):"], 1)
        + indented([f"count = min({PORTION}, half_{number} - begin)"], 2)
        + indented([f"padded = (count + {LANES - 1}) // {LANES} * {LANES}"], 2)
        + indented([loop], 2)
        + indented(gather, 3)
        + indented(["for c in range(padded):"], 2)
        + indented(compute, 3)
        + indented(["held = -1", *(f"own{k} = 0.0" for k in axes), loop], 2)
        + indented(scatter, 3)
        + indented(["if held >= 0:", *(f"    {line}" for line in store)], 2)
    )
