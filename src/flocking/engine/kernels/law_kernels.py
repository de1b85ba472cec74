"""The compiled functions of one law, called by their addresses from functions that are compiled once for all laws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from flocking.engine.kernels.codegen import ARGUMENTS, CONTROL_RESULTS, RATES
from flocking.formula.native.functions import by_address, native_apart
from flocking.model.checks import Array

_control = by_address(ARGUMENTS + CONTROL_RESULTS)
_energies = by_address(ARGUMENTS)
_RATES = len(RATES)

Pairs = tuple[Array | NDArray[np.int64] | NDArray[np.int32], ...]
"""Ordered pairs (sender, sensed), offsets of the graphs among them, rows of pieces, limits of pieces."""

Slots = tuple[Array, ...]
"""Parameters P, A and W, see `flocking.engine.kernels.layout.Layout.values`."""


def slope(
    address: int, t: float, z: Array, q: Array, p: Array, senders: Array, sensed: Array, offsets: Array, pieces: Array,
    spans: Array, P: Array, A: Array, W: Array, S: Array, u: Array, rates: Array, order: int, out: Array,
) -> None:  # fmt: skip
    """Slope ``out`` of the state vector ``z``; q, p, u and rates are written over.

    Parameters
    ----------
    address
        Address of the compiled function of the forces of the law.
    S
        Functionals of the graphs, shape (graphs, N).
    order
        Order of the agents, 1 or 2.
    """
    n, m = q.shape[0], q.shape[1]
    for i in range(n):
        for k in range(m):
            q[i, k] = z[i * m + k]
            if order == 2:
                p[i, k] = z[(n + i) * m + k]
    _control(address, t, q, p, senders, sensed, offsets, pieces, spans, P, A, W, S, u, rates, rates)
    for i in range(n):
        for k in range(m):
            if order == 2:
                out[i * m + k] = p[i, k]
                out[(n + i) * m + k] = (u[i, k] - A[1, i] * p[i, k]) / A[0, i]
            else:
                out[i * m + k] = u[i, k]
    for k in range(_RATES):
        out[n * m * order + k] = rates[k]


@native_apart
def stages(
    address: int, order: int, first: int, last: int, kept: int, t: float, y: Array, h: float, K: Array, nodes: Array,
    weights: Array, n: int, m: int, senders: Array, sensed: Array, offsets: Array, pieces: Array, spans: Array,
    P: Array, A: Array, W: Array, S: Array, found: Array,
) -> None:  # fmt: skip
    """Slopes K at stages of a Runge-Kutta step, see `flocking.engine.exact.dynamics.Dynamics.stages`.

    Parameters
    ----------
    address, order, S
        As for `slope`.
    first, last
        Slopes are computed at the stages ``first`` to ``last - 1``; those before are known.
    kept
        Stage whose state goes to ``found``.
    y, h
        State where the step begins, and its length.
    nodes
        Nodes of the method, shape (stages,).
    """
    size = y.shape[0]
    z = np.empty(size)
    q = np.empty((n, m))
    p = np.zeros((n, m))
    u = np.empty((n, m))
    rates = np.empty(_RATES)
    for s in range(first, max(last, kept + 1)):
        for c in range(size):
            z[c] = y[c]
        for k in range(s):
            if weights[s, k] != 0.0:
                factor = h * weights[s, k]
                for c in range(size):
                    z[c] += factor * K[k, c]
        if s == kept:
            for c in range(size):
                found[c] = z[c]
        if s < last:
            slope(
                address, t + nodes[s] * h, z, q, p, senders, sensed, offsets, pieces, spans, P, A, W, S, u, rates,
                order, K[s],
            )  # fmt: skip


def state_energies(
    address: int, order: int, t: float, y: Array, n: int, m: int, senders: Array, sensed: Array, offsets: Array,
    pieces: Array, spans: Array, P: Array, A: Array, W: Array, S: Array, found: Array,
) -> None:  # fmt: skip
    """Pair storage, body storage and kinetic energy of a state vector ``y``, for native functions.

    Parameters
    ----------
    address
        Address of the compiled function of the energies of the law.
    order, S
        As for `slope`.
    found
        Takes the three, shape (3,).
    """
    q, p = np.empty((n, m)), np.zeros((n, m))
    for i in range(n):
        for k in range(m):
            q[i, k] = y[i * m + k]
            if order == 2:
                p[i, k] = y[(n + i) * m + k]
    _energies(address, t, q, p, senders, sensed, offsets, pieces, spans, P, A, W, S, found)


class LawKernels:
    """Functions of one law.

    Parameters
    ----------
    module
        Its generated module, see `flocking.engine.kernels.codegen.compiled_kernels`.
    order
        Order of the agents, 1 or 2.
    """

    def __init__(self, module: ModuleType, order: int) -> None:
        self.module = module
        self.order = order
        self.name = module.__name__
        self._address = int(module.control.address)

    @cached_property
    def addresses(self) -> tuple[int, int]:
        """Where the compiled functions of the forces and of the energies are."""
        return self._address, int(self.module.energies.address)

    def control(
        self, t: float, q: Array, p: Array, pairs: Pairs, slots: Slots, functionals: Array, u: Array, rates: Array
    ) -> None:
        """Fill the forces ``u``, shape (N, m), and the `RATES`.

        Parameters
        ----------
        t, q, p
            Time, positions and velocities, shape (N, m).
        pairs, slots
            Pairs and parameters in force.
        functionals
            Functionals of the graphs, shape (graphs, N).
        u, rates
            Take the forces and the rates.
        """
        self.module.control(t, q, p, *pairs, *slots, functionals, u, rates)

    def energies(
        self, t: float, q: Array, p: Array, pairs: Pairs, slots: Slots, functionals: Array
    ) -> tuple[float, float, float]:
        """Pair storage, body storage and kinetic energy.

        Parameters
        ----------
        pairs, slots, functionals
            As for `control`.
        """
        found: tuple[float, float, float] = self.module.energies(t, q, p, *pairs, *slots, functionals)
        return found

    def stages(
        self, first: int, last: int, kept: int, t: float, y: Array, h: float, K: Array, nodes: Array, weights: Array,
        n: int, m: int, pairs: Pairs, slots: Slots, functionals: Array,
    ) -> Array:  # fmt: skip
        """Slopes at stages of a Runge-Kutta step, see `flocking.engine.exact.dynamics.Dynamics.stages`.

        Parameters
        ----------
        first, last, kept, y, h, K, nodes
            As for the function `stages` of this module.
        pairs, slots, functionals
            As for `control`.
        """
        found = np.empty(len(y))
        given = first, last, kept, t, y, h, K, nodes, weights, n, m
        stages(self._address, self.order, *given, *pairs, *slots, functionals, found)
        return found

    def shape(self, name: str) -> Callable[..., Sequence[float]] | None:
        """Formulas, in plain Python, of a graph (``"shape0"``...) or of obstacles (``"shape_obstacles0"``...)."""
        found: Callable[..., Sequence[float]] | None = getattr(self.module, name, None)
        return found
