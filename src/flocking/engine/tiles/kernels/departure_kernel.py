"""The kernel of what velocities beyond those of the law change of the storage, for agents of order 1.

Storage changes at a rate that is affine in the velocities of the agents: -u . v, as in a descent of the gradient, and
the ``flow`` of the formulas. A velocity that exceeds that of the law by d thus adds -u . d and the part of the flow
that is linear in d, which this kernel sums over the links of the last pass.
"""

from __future__ import annotations

from types import ModuleType
from typing import TYPE_CHECKING

from flocking.engine.kernels.source_text import indented
from flocking.engine.tiles.kernels.pair_loop import pair_loop
from flocking.engine.tiles.kernels.spec import KernelSpec
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

if TYPE_CHECKING:
    import sympy

    from flocking.engine.kernels.expressions import LawFormulas


def departure_kernel(spec: KernelSpec) -> ModuleType:
    """Module with the kernel ``depart`` of a law; for its arguments see `_arguments`.

    It is None where no such flow depends on velocities.

    Parameters
    ----------
    spec
        Specification of the kernels of the law, of agents of order 1, without obstacles.
    """
    from flocking.engine.kernels.expressions import law_formulas
    from flocking.engine.kernels.flow_formulas import flow_formulas

    layout = spec.layout
    return generated_module(
        ("departures", spec.kind), layout.structure, layout.parts,
        lambda: flow_formulas(law_formulas(layout, spec.dimension)), lambda formulas: _source(spec, formulas),
    )  # fmt: skip


def _arguments(spec: KernelSpec) -> list[str]:
    """Arguments of ``depart``.

    ``first_tile``, ``last_tile``; the time ``t``; ``hold``, True: links do not change; the state ``X`` and the
    differences of velocities in the second half of each row of ``Y``, shape (16 tiles, 2m); the number of agents ``n``;
    for each graph the lists and the squared radii; parameters; means of positions and of the differences over the
    group ``M``; the result by tile ``found``.
    """
    found = ["first_tile", "last_tile", "t", "hold", "X", "Y", "n"]
    found += graph_arguments(spec)
    return [*found, *obstacle_arguments(spec), "P", "A", "O", "ids", "seeds", "matrices", "M", "found"]


def _linear(flow: sympy.Expr, dimension: int) -> sympy.Expr:
    """The part of an affine flow that is linear in the velocity ``u0...`` and its mean ``mean_u0...``."""
    import sympy

    names = [sympy.Symbol(f"{name}{k}", real=True) for name in ("u", "mean_u") for k in range(dimension)]
    slopes = [sympy.diff(flow, name) for name in names]
    assert not any(slope.has(*names) for slope in slopes), "a flow is affine in velocities"
    return sum((slope * name for slope, name in zip(slopes, names, strict=True)), sympy.Integer(0))


def _source(spec: KernelSpec, formulas: LawFormulas) -> str:
    assert spec.order == 1
    assert spec.ledger
    w = Writer(spec, formulas)
    pairs: list[str] = []
    for number, pair in enumerate(formulas.pairs):
        pairs += pair_loop(w, number, pair, flow=True)
    own = _linear(formulas.body.flow, spec.dimension)
    met: list[str] = []
    for number, group in enumerate(formulas.obstacles):
        met += obstacle_block(w, number, group)
    if not pairs and not met and own == 0:
        return "depart = None\n"
    tail = w.statements({"own_supply": own}, "e_") if own != 0 else ["own_supply = spread(T(0.0))"]
    if met:
        # No potential of obstacles is part of the energy: what their forces do is supplied.
        met = [f"{name}{k} = spread(T(0.0))" for name in ("pull", "met") for k in w.axes] + met
        tail += ["own_supply = own_supply + " + " + ".join(f"met{k} * u{k}" for k in w.axes)]
    tail += ["found[tile] = 0.5 * total(total_supply) + total(select(i < n, own_supply, T(0.0)))"]
    beside = [f"{letter}{k}" for letter in "xu" for k in w.axes]
    first = ["base = tile * 16", "i = numbers_from(base)", *own_lines(w, "X")]
    first += [f"{', '.join(beside)} = load_agents(Y, base)", "total_supply = spread(T(0.0))"]
    text = f"@native\ndef depart({', '.join(_arguments(spec))}):\n" + indented(
        uniform_lines(w, w.obstacle_values, [], "u"), 1
    )
    text += indented(["for tile in range(first_tile, last_tile):"], 1) + indented([*first, *pairs, *met, *tail], 2)
    return module_header(spec, text) + text
