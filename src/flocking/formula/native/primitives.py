"""Functions that write their own LLVM."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flocking.formula.native.kinds import Argument, Value


@dataclass(frozen=True)
class Primitive:
    """A function that writes its own LLVM.

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
        """Call what Python calls in its place.

        Raises
        ------
        TypeError
            When there is no such thing.
        """
        if self.python is None:
            raise TypeError("Only native functions can call this function.")
        return self.python(*values)


@dataclass(frozen=True)
class Outside:
    """A function that is compiled by itself, for arguments of some kinds.

    Parameters
    ----------
    reference
        What it is known by.
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
    """Whether it is compiled by itself and called; else it is put in place."""

    @abstractmethod
    def outside(self, arguments: tuple[Argument, ...]) -> Outside:
        """The function compiled by itself."""
