"""Functions that write their own LLVM."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flocking.formula.native.kinds import Value


@dataclass(frozen=True)
class Primitive:
    """A function that writes its own LLVM.

    Parameters
    ----------
    build
        Given the builder and the values of the arguments it returns the value, or None.
    """

    build: Callable[..., Value | None]

    def __call__(self, *values: object) -> Any:
        """Python cannot call it.

        Raises
        ------
        TypeError
            Always.
        """
        raise TypeError("Only native functions can call this function.")
