"""The energy of forces with the weight of a smooth graph: the integral of a psi' over the distance.

Where the weight decreases it has no closed form for most potentials. By parts it is a psi + (integral of a' psi from r
to R). The second term is approximated by a polynomial on the interval of the decrease, in Newton's form at Chebyshev
points in Leja order, which is stable and short. The coefficients are run-time numbers of compiled code, like
parameters; their number is chosen so that the polynomial has 12 correct digits, or 10 with the largest number, of the
largest value of the integral. Of a steep potential that is the value at the begin of the decrease, and pairs that never
come there have small energies: 9 digits are asked for of the largest value farther out, or from the middle on.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flocking.model.checks import Array

if TYPE_CHECKING:
    import sympy

    from flocking.model.graphs.smooth_graphs import Smooth
    from flocking.model.potentials.potential import Potential

COUNTS = (8, 12, 16, 24, 32, 48, 64, 96)
"""Tried numbers of coefficients."""

ACCURACY, POOREST = 1e-12, 1e-10
"""Largest error relative to the largest value of the integral: in general, and with the most coefficients."""

FARTHER_OUT = 1e-9
"""Largest error relative to the largest value of the integral farther out, or from the middle on: the default tolerance
of a scenario, to which its ledger holds."""

MOST_REMEMBERED = 256
"""Integrals that are stored: a run asks for that of its law again and again, and the store is bounded."""

PLACES = 1001
"""Distances at which the error is measured."""

NODES = 16
"""Number of nodes of the Gauss-Legendre rule between two neighbouring distances."""


@dataclass(frozen=True)
class Fall:
    """Integral from a distance to the radius of the slope of a weight times a potential, as numbers.

    Parameters
    ----------
    begin, end
        Distances between which the weight falls from 1 to 0.
    coefficients
        Newton coefficients of the integral as a function of its lower limit.
    """

    begin: float
    end: float
    coefficients: tuple[float, ...]

    @property
    def parameters(self) -> dict[str, float]:
        """The numbers by name."""
        named = {f"coefficient_{k}": value for k, value in enumerate(self.coefficients)}
        return {"begin": self.begin, "end": self.end, **named}


@dataclass(frozen=True)
class Fade:
    """The same as symbols.

    Parameters
    ----------
    begin, end
        Distances between which the weight falls from 1 to 0.
    coefficients
        Newton's coefficients of the integral.
    """

    begin: sympy.Expr
    end: sympy.Expr
    coefficients: tuple[sympy.Expr, ...]

    def integral(self, r: sympy.Expr) -> sympy.Expr:
        """The integral from ``r`` to the end; constant before `begin`."""
        import sympy

        start = sympy.Piecewise((self.begin, r <= self.begin), (r, True))
        place = 2 * (2 * start - self.begin - self.end) / (self.end - self.begin)
        *rest, found = self.coefficients
        for coefficient, node in zip(reversed(rest), reversed(nodes(len(rest) + 1)[:-1]), strict=True):
            found = coefficient + (place - sympy.Float(node, 17)) * found
        return found


@cache
def nodes(count: int) -> tuple[float, ...]:
    """Chebyshev points of [-2, 2] in Leja order (F. Leja, Ann. Polon. Math. 4 (1957) 8).

    On an interval of this length products of differences neither overflow nor underflow.

    Parameters
    ----------
    count
        Their number.
    """
    left = 2 * np.cos(np.pi * (np.arange(count) + 0.5) / count)
    order = [float(left[0])]
    apart = np.zeros(count)
    while len(order) < count:
        with np.errstate(divide="ignore"):
            apart += np.log(np.abs(left - order[-1]))
        order.append(float(left[int(np.argmax(apart))]))
    return tuple(order)


def newton_coefficients(values: Array) -> Array:
    """Coefficients of the interpolating polynomial at `nodes`, shape (K,).

    Parameters
    ----------
    values
        The values, in the order of the nodes.
    """
    places = np.array(nodes(len(values)))
    found = np.array(values)
    for k in range(1, len(values)):
        found[k:] = (found[k:] - found[k - 1]) / (places[k:] - places[k - 1])
    return found


def newton_value(coefficients: Array, places: Array) -> Array:
    """Value of the polynomial at points in [-2, 2].

    Parameters
    ----------
    coefficients
        Newton's coefficients.
    places
        The points.
    """
    points = nodes(len(coefficients))
    found = np.full(len(places), coefficients[-1])
    for coefficient, node in zip(coefficients[-2::-1], points[-2::-1], strict=True):
        found = coefficient + (places - node) * found
    return found


@lru_cache(maxsize=MOST_REMEMBERED)
def fall_of(potential: Potential, graph: Smooth) -> Fall | None:
    """The integral of the slope of a graph's weight times a potential; None if no polynomial is accurate enough.

    Parameters
    ----------
    graph
        The graph; its weight decreases between its kink and its radius.
    """
    begin, end = float(graph.kinks()[0]), graph.radius
    places, weights = np.polynomial.legendre.leggauss(NODES)

    def integral(starts: Array) -> Array:
        """Integrals from each of the ascending distances to the end."""
        ends = np.append(starts[1:], end)
        half = (ends - starts) / 2
        s = starts[:, None] + half[:, None] * (1 + places)
        with np.errstate(all="ignore"):
            values = graph.weight_slope(s) * potential(s)
        return np.asarray(np.cumsum((half * (values @ weights))[::-1])[::-1])

    between = np.linspace(-2.0, 2.0, PLACES)[:-1]
    exact = integral(begin + (end - begin) * (between + 2) / 4)
    size = float(np.abs(exact).max())
    farther = np.maximum.accumulate(np.abs(exact)[::-1])[::-1]
    farther = np.maximum(farther, farther[len(farther) // 2])
    if not np.isfinite(exact).all() or size == 0.0:
        return None
    for count in COUNTS:
        at = np.array(nodes(count))
        together = np.concatenate([between, at])
        order = np.argsort(together)
        values = np.empty(len(together))
        values[order] = integral(begin + (end - begin) * (together[order] + 2) / 4)
        fitted = newton_coefficients(values[len(between) :])
        # Zero at the radius, so that the energy does not jump with a link.
        fitted[0] -= newton_value(fitted, np.array([2.0]))[0]
        allowed = POOREST if count == COUNTS[-1] else ACCURACY
        error = np.abs(newton_value(fitted, between) - exact)
        if error.max() <= allowed * size and (error <= FARTHER_OUT * farther).all():
            return Fall(begin, float(end), tuple(fitted.tolist()))
    return None
