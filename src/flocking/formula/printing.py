"""SymPy expressions printed as source code: for compiled functions (scalars, ``math``) and for NumPy (arrays)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import sympy
    from sympy.printing.codeprinter import CodePrinter


@cache
def _printer(arrays: bool) -> CodePrinter:
    from sympy.printing.numpy import NumPyPrinter
    from sympy.printing.pycode import PythonCodePrinter

    settings = {"fully_qualified_modules": True, "allow_unknown_functions": False}

    def print_integer(printer: CodePrinter, expr: sympy.Integer) -> str:
        # NumPy's functions and 64-bit registers know no larger integers.
        return str(int(expr)) if abs(expr) < 2**53 else repr(float(expr))

    def print_rational(printer: CodePrinter, expr: sympy.Rational) -> str:
        return f"{expr.p}/{expr.q}" if max(abs(expr.p), expr.q) < 2**53 else repr(float(expr))

    class ScalarPrinter(PythonCodePrinter):  # type: ignore[misc]
        """Large integers become floats."""

        _print_Integer = print_integer  # noqa: N815
        _print_Rational = print_rational  # noqa: N815

    if not arrays:
        return ScalarPrinter(settings)

    class ArrayPrinter(NumPyPrinter):  # type: ignore[misc]
        """Joins conditions with operators and extremes in pairs: NumPy's reduce cannot mix numbers with arrays."""

        _print_Integer = print_integer  # noqa: N815
        _print_Rational = print_rational  # noqa: N815

        def _print_And(self, expr: sympy.And) -> str:  # noqa: N802
            return "(" + " & ".join(f"({self._print(c)})" for c in expr.args) + ")"

        def _print_Or(self, expr: sympy.Or) -> str:  # noqa: N802
            return "(" + " | ".join(f"({self._print(c)})" for c in expr.args) + ")"

        def _extreme(self, function: str, expr: sympy.Expr) -> str:
            *rest, found = map(self._print, expr.args)
            for value in reversed(rest):
                found = f"numpy.{function}({value}, {found})"
            return str(found)

        def _print_Max(self, expr: sympy.Max) -> str:  # noqa: N802
            return self._extreme("maximum", expr)

        def _print_Min(self, expr: sympy.Min) -> str:  # noqa: N802
            return self._extreme("minimum", expr)

    return ArrayPrinter(settings)


def code(expression: sympy.Expr, *, arrays: bool) -> str:
    """Source text of one expression: NumPy calls when ``arrays``, else the ``math`` module."""
    return str(_printer(arrays).doprint(expression))


def statements(results: Mapping[str, sympy.Expr], *, arrays: bool, prefix: str) -> list[str]:
    """Assignments that compute all ``results``, common subexpressions first and once.

    Parameters
    ----------
    results
        Name of each variable to assign, and its expression.
    arrays
        NumPy source when true, scalar source when false.
    prefix
        Start of the names of the intermediate variables.
    """
    import sympy

    names = list(results)
    numbered = sympy.numbered_symbols(prefix)
    # Branches of a Piecewise must not be lifted out of their condition: they may divide by zero there.
    shared, reduced = _common([results[n] for n in names], numbered)
    lines = [f"{symbol.name} = {code(value, arrays=arrays)}" for symbol, value in shared]
    lines += [f"{name} = {code(value, arrays=arrays)}" for name, value in zip(names, reduced, strict=True)]
    return lines


def _common(
    expressions: Sequence[sympy.Expr], numbered: Iterator[sympy.Symbol]
) -> tuple[list[tuple[sympy.Symbol, sympy.Expr]], list[sympy.Expr]]:
    import sympy

    masks: dict[sympy.Piecewise, sympy.Dummy] = {}
    masked = []
    for expression in expressions:
        pieces = expression.atoms(sympy.Piecewise) if expression.has(sympy.Piecewise) else set()
        outer = [p for p in pieces if not any(p != o and o.has(p) for o in pieces)]
        for piece in outer:
            if piece not in masks:
                masks[piece] = sympy.Dummy(f"piece{len(masks)}", real=True)
        masked.append(expression.xreplace({p: masks[p] for p in outer}))
    shared, reduced = sympy.cse(masked, symbols=numbered)
    if not masks:
        return list(shared), list(reduced)
    # Each piecewise value is computed once, before everything else.
    first = [(next(numbered), piece) for piece in masks]
    back = {dummy: name for dummy, (name, _) in zip(masks.values(), first, strict=True)}
    return (
        first + [(symbol, value.xreplace(back)) for symbol, value in shared],
        [value.xreplace(back) for value in reduced],
    )
