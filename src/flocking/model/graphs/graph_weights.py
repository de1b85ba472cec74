"""The weight of a link as a function on arrays, made from the formula of its graph."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from flocking.formula.compiled import generated_module
from flocking.model.checks import Array
from flocking.model.graphs.distance_graphs import Graph

if TYPE_CHECKING:
    import sympy


def weight_function(graph: Graph) -> Callable[..., Array]:
    """a_ij as a function of distances, shape (k,), and the values of the graph's parameters in their order."""
    names = tuple(graph.parameters)
    module = generated_module(
        ("weight", names), graph.structure, (graph,), lambda: _weight(graph), lambda stated: _source(stated, names)
    )
    weight: Callable[..., Array] = module.weight
    return weight


def _weight(graph: Graph) -> sympy.Expr:
    import sympy

    return graph.weight(sympy.Symbol("r", positive=True), lambda name: sympy.Symbol(name, real=True))


def _source(stated: sympy.Expr, names: tuple[str, ...]) -> str:
    from flocking.formula.printing import code

    return f"import numpy\n\n\ndef weight({', '.join(['r', *names])}):\n    return {code(stated, arrays=True)}\n"
