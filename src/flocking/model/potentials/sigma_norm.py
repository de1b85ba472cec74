"""The sigma-norm of Olfati-Saber (2006), a map of distances that is smooth at zero."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from flocking.model.checks import Array, number

if TYPE_CHECKING:
    import sympy


@dataclass(frozen=True)
class SigmaNorm:
    """|z|_sigma = (sqrt(1 + eps |z|^2) - 1)/eps: quadratic near zero, linear far away.

    It is no norm. Its gradient z/sqrt(1 + eps |z|^2) is defined everywhere.

    Parameters
    ----------
    epsilon
        eps, positive; one over a squared length.

    Raises
    ------
    InvalidInput
        If it is not positive.
    """

    epsilon: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "epsilon", number("SigmaNorm", "epsilon", self.epsilon, above=0.0))

    def __call__(self, length: ArrayLike) -> Array:
        """|z|_sigma of lengths |z|; same shape."""
        z = np.asarray(length, dtype=np.float64)
        with np.errstate(over="ignore", invalid="ignore"):
            square = z**2
            root = np.sqrt(1.0 + self.epsilon * square)
            # Without the difference of two numbers near one, but where a square has no number.
            near, far = square / (1.0 + root), np.abs(z) / np.sqrt(self.epsilon) - 1.0 / self.epsilon
        return np.asarray(np.where(np.isfinite(square) & np.isfinite(root), near, far))

    def slope(self, length: ArrayLike) -> Array:
        """Derivatives by the length, |z|/sqrt(1 + eps |z|^2): the length of n_ij for z = q_j - q_i."""
        z = np.asarray(length, dtype=np.float64)
        with np.errstate(over="ignore", invalid="ignore"):
            root = np.sqrt(1.0 + self.epsilon * z**2)
            return np.asarray(np.where(np.isfinite(root), z / root, np.sign(z) / np.sqrt(self.epsilon)))

    def inverse(self, value: float) -> float:
        """The length whose sigma-norm is ``value``."""
        return float(np.sqrt(value * (self.epsilon * value + 2.0)))


def sigma_share(r: sympy.Expr, radius: sympy.Expr, epsilon: sympy.Expr) -> sympy.Expr:
    """|r|_sigma/|R|_sigma as an expression, without differences of numbers near one.

    Parameters
    ----------
    r, radius, epsilon
        r, R and eps.
    """
    import sympy

    far, near = (1 + sympy.sqrt(1 + epsilon * x**2) for x in (radius, r))
    return (r / radius) ** 2 * far / near
