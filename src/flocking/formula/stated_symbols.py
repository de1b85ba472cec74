"""Symbols in formulas of users' parts: those that the part was given alone. Kernels have variables of other names."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from flocking.errors import InvalidInput
from flocking.formula.origins import library_states_all

if TYPE_CHECKING:
    import sympy

Give = Callable[[str], "sympy.Expr"]
"""Gives an expression by its name, as ``x.parameter`` does."""


class StatedSymbols:
    """The symbols that a part may use in its formulas; parts of the library are not looked at.

    Parameters
    ----------
    part
        The part.
    given
        Expressions that it is given.
    """

    def __init__(self, part: object, given: Iterable[object] = ()) -> None:
        self._owner = type(part).__name__
        self.checked = not library_states_all([part])
        """Whether other code than the library's states formulas of the part."""
        self._known: set[sympy.Basic] = set()
        if self.checked:
            self.add(given)

    def add(self, given: Iterable[object]) -> None:
        """Let it use the symbols of further expressions ``given``."""
        import sympy

        for expression in given:
            self._known |= sympy.sympify(expression).free_symbols

    def asked(self, what: str, give: Give, names: Callable[[], Iterable[str]]) -> Give:
        """A function that gives an expression by its name, with the symbols of what it gave allowed from then on.

        Parameters
        ----------
        what
            How the part calls it, such as ``x.parameter``.
        give
            Gives it.
        names
            The names that there are.

        Raises
        ------
        InvalidInput
            By the function: when there is nothing of that name.
        """
        if not self.checked:
            return give

        def found(name: str) -> sympy.Expr:
            known = list(names())
            if name not in known:
                rule = f"must name one of {', '.join(known)}" if known else "must not be used: there is none"
                raise InvalidInput(self._owner, what, rule, name)
            expression = give(name)
            self.add([expression])
            return expression

        return found

    def check(self, method: str, *stated: object) -> None:
        """Refuse formulas with other symbols.

        Parameters
        ----------
        method
            Name of the method that stated them.
        stated
            The formulas.

        Raises
        ------
        InvalidInput
            When one has a symbol that the part was not given.
        """
        if not self.checked:
            return
        import sympy

        for expression in stated:
            foreign = sorted(str(s) for s in sympy.sympify(expression).free_symbols - self._known)
            if foreign:
                raise InvalidInput(
                    self._owner, method, "must use no symbols but those of its argument", ", ".join(foreign),
                    "Make a number a parameter of the part, and take its symbol from there.",
                )  # fmt: skip
