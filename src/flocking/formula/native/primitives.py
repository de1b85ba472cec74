"""Functions that emit their own LLVM code."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flocking.formula.native.kinds import Argument, Value


@dataclass(frozen=True)
class Primitive:
    """A function that emits its own LLVM code.

    Parameters
    ----------
    build
        Given the builder and the values of the arguments it returns the value, or None.
    python
        What Python calls in its place.
    gives_fault
        Whether the value is the number of a fault, see `flocking.formula.native.faults`, to be passed on.
    """

    build: Callable[..., Value | None]
    python: Callable[..., object] | None = None
    gives_fault: bool = False

    def __call__(self, *values: object) -> Any:
        """Call ``python`` with ``values``.

        Raises
        ------
        TypeError
            When there is no Python form.
        """
        if self.python is None:
            raise TypeError("Only native functions can call this function.")
        return self.python(*values)


@dataclass(frozen=True)
class Outside:
    """A function that is compiled separately for some argument kinds.

    Parameters
    ----------
    reference
        Module, name and argument kinds.
    symbol
        Name by which compiled code calls it.
    results
        Kinds of the numbers it returns.
    """

    reference: str
    symbol: str
    results: tuple[str, ...]


class Callee(ABC):
    """A native function, as other native functions see it."""

    apart: bool
    """Whether it is compiled separately and called; else it is inlined."""

    @abstractmethod
    def outside(self, arguments: tuple[Argument, ...]) -> Outside:
        """The function compiled separately."""
