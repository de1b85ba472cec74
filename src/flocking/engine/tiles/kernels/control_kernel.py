"""The kernel of the agents' controls under held control: forces from what each agent knows, for those that act.

It sums over the neighbours as the kernel of a step does, with the same printed formulas, but moves nobody: controls of
agents that act are written to an array, and their links by what they know are followed. The others keep both.
"""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.kernels.source_text import indented
from flocking.engine.tiles.kernels.heard_samples import HeardSamples
from flocking.engine.tiles.kernels.pair_loop import pair_loop
from flocking.engine.tiles.kernels.spec import GraphKind, KernelSpec
from flocking.engine.tiles.kernels.step_kernel import (
    graph_arguments,
    module_header,
    obstacle_arguments,
    obstacle_block,
    own_lines,
    uniform_lines,
)
from flocking.engine.tiles.kernels.writer import Writer
from flocking.formula.compiled import generated_module
from flocking.model.graphs.distance_graphs import Graph

if TYPE_CHECKING:
    from flocking.engine.kernels.expressions import LawFormulas


def control_spec(spec: KernelSpec, graphs: tuple[Graph, ...]) -> KernelSpec:
    """Specification of the kernel of the controls of a law.

    Parameters
    ----------
    spec
        Specification of the kernel of its steps.
    graphs
        The graphs of the law. Only those with two radii have memory: energies are not summed.
    """
    kinds = tuple(
        GraphKind(kind.fixed, not kind.fixed and bool(np.any(graph.appear_radius != graph.break_radius)), kind.uneven,
                  barrier=False, view=kind.view, fades=kind.fades)
        for kind, graph in zip(spec.graphs, graphs, strict=True)
    )  # fmt: skip
    return replace(spec, graphs=kinds, damped=False, ledger=False)


def control_kernel(spec: KernelSpec, heard: HeardSamples | None, *, logs: bool = False) -> ModuleType:
    """Module with the kernel ``control``; for its arguments see `_arguments`.

    Parameters
    ----------
    spec
        What `control_spec` gives.
    heard
        How agents find what they know of each other; None where they know the present.
    logs
        Whether it writes down what is used, see `flocking.engine.tiles.held.used_samples`.
    """
    from flocking.engine.kernels.expressions import law_formulas
    from flocking.engine.kernels.flow_formulas import flow_formulas

    layout = spec.layout

    def stated() -> LawFormulas:
        found = law_formulas(layout, spec.dimension)
        return flow_formulas(found) if spec.order == 1 else found

    return generated_module(
        ("controls", spec.kind, heard, *["logs"] * logs), layout.structure, layout.parts, stated,
        lambda f: _source(spec, f, heard, logs=logs),
    )  # fmt: skip


def _arguments(spec: KernelSpec, heard: HeardSamples | None, *, logs: bool) -> list[str]:
    """Arguments of ``control``.

    ``first_tile``, ``last_tile``; the time ``t``; ``acting``, 1 for each agent that acts and 0 for the others, shape
    (size,); what each agent knows of itself ``K``, shape (size, 2m); the true state ``X``; for each graph the lists
    and the squared radii; where there are messages the samples ``S``, their ``news`` (see
    `flocking.engine.tiles.held.news.News`), and for each graph the samples used before and the numbers of the agents
    that the entries of its lists stand for; where it ``logs``, for each graph the marks that it writes, a row for each
    row of a list, and the first of them of each tile; the obstacles within range of each tile; parameters; the controls
    ``U``, shape (m, size).
    """
    found = ["first_tile", "last_tile", "t", "acting", "K", "X", "n"]
    found += graph_arguments(spec)
    if heard is not None:
        found += ["S", "news", *(f"{x}{number}" for x in ("used", "senders") for number in range(len(spec.graphs)))]
    if logs:
        found += [f"{x}{number}" for number in range(len(spec.graphs)) for x in ("marks", "placed")]
    return [*found, *obstacle_arguments(spec), "P", "A", "O", "ids", "seeds", "matrices", "M", "U"]


def _source(spec: KernelSpec, formulas: LawFormulas, heard: HeardSamples | None, *, logs: bool) -> str:
    import sympy

    w = Writer(spec, formulas, controls=True, heard=heard, logs=logs)
    pairs: list[str] = []
    for number, pair in enumerate(formulas.pairs):
        pairs += pair_loop(w, number, pair)
    for number, group in enumerate(formulas.obstacles):
        pairs += obstacle_block(w, number, group)
    desired = {f"wanted{k}": sympy.Symbol(f"pull{k}", real=True) + formulas.body.force[k] for k in w.axes}
    tail = w.statements(desired, "b_")
    tail += [f"store(U[{k}], base, select(hold, load(U[{k}], base), wanted{k}))" for k in w.axes]
    tile = [f"pull{k} = spread(T(0.0))" for k in w.axes] + ["near = spread(huge)"]
    tile += [] if heard is None else heard.tile_lines()
    first = ["base = tile * 16", "busy = load(acting, base)", "if highest(busy) == 0:", "    continue"]
    first += ["hold = busy == np.uint32(0)", "i = numbers_from(base)", *own_lines(w, "K")]
    top = uniform_lines(w, w.obstacle_values, [], "p") + ([] if heard is None else heard.uniform_lines())
    text = f"@native\ndef control({', '.join(_arguments(spec, heard, logs=logs))}):\n" + indented(top, 1)
    text += indented(["for tile in range(first_tile, last_tile):"], 1) + indented([*first, *tile, *pairs, *tail], 2)
    imports = "" if heard is None else heard.imports()
    return module_header(spec, text).replace("import math\n", f"import math\n{imports}", 1) + text
