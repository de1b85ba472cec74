"""The base of all functions of a SymPy expression that are computed node by node, such as its text in a language."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

if TYPE_CHECKING:
    import sympy

Result = TypeVar("Result")


MOST_NODES = 4096
"""Nodes whose kind is stored: the nodes of a few formulas are visited again and again, and the store is bounded."""


@cache
def _classes() -> tuple[tuple[Any, str], ...]:
    """Classes of nodes with the names of their methods; the first that fits counts, as a symbol is a Boolean too."""
    import sympy
    from sympy.logic.boolalg import Boolean, BooleanAtom

    return (
        (sympy.Symbol, "symbol"), (BooleanAtom, "truth"), (sympy.Piecewise, "piecewise"), (Boolean, "condition"),
        (sympy.Add, "sum"), (sympy.Mul, "product"), (sympy.Pow, "power"),
    )  # fmt: skip


@lru_cache(maxsize=MOST_NODES)
def _kind_of(node: sympy.Basic, folds_numbers: bool) -> str:
    """The name of the method for a node."""
    import sympy

    if node.is_number and (not node.args or (folds_numbers and not node.has(sympy.Function))):
        return "number"
    return next((name for kind, name in _classes() if isinstance(node, kind)), "function")


class ExpressionVisitor(ABC, Generic[Result]):
    """Computes a result from an expression; a subclass states one method for each kind of node that it supports.

    The methods are ``symbol``, ``number``, ``truth`` (true or false), ``piecewise``, ``condition``, ``sum``,
    ``product``, ``power`` and ``function``. A node of a kind without a method is refused by the name of its class.
    """

    folds_numbers: ClassVar[bool] = False
    """Whether an expression of numbers alone, such as 2*sqrt(2), counts as one number."""

    def visit(self, node: sympy.Basic) -> Result:
        """Result for an expression."""
        method: Callable[[sympy.Basic], Result] | None = getattr(self, self._kind(node), None)
        if method is None:
            raise self.refusal(type(node).__name__, node)
        return method(node)

    def _kind(self, node: sympy.Basic) -> str:
        return _kind_of(node, self.folds_numbers)

    @abstractmethod
    def function(self, node: sympy.Basic) -> Result:
        """Result for a function, or for any other node that is of none of the kinds above."""

    @abstractmethod
    def refusal(self, name: str, node: sympy.Basic) -> Exception:
        """The error for a ``node`` that has no result; ``name`` is that of its class."""
