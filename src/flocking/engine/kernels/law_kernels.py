"""The compiled functions of one law, called by address from functions that are compiled once for all laws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from types import ModuleType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Indices
from flocking.engine.kernels.codegen import ARGUMENTS, SLOPE_ARGUMENTS
from flocking.engine.kernels.pieces import free_pieces
from flocking.formula.native.functions import by_address, native_apart
from flocking.model.checks import Array

_slope = by_address(SLOPE_ARGUMENTS)
_energies = by_address(ARGUMENTS)


class Pairs(NamedTuple):
    """Ordered pairs of agents that act on each other, those of each graph after those of the one before.

    Parameters
    ----------
    senders, sensed
        The agent that senses and the one that is sensed, shape (pairs,).
    offsets
        Where the pairs of each graph, and then of each group of obstacles, begin; shape (graphs + groups + 1,).
    pieces
        Row of ``spans`` of each pair, shape (pairs,).
    spans
        Limits of the pieces of piecewise formulas, see `flocking.engine.kernels.pieces.limits`.
    """

    senders: Indices
    sensed: Indices
    offsets: Indices
    pieces: NDArray[np.int32]
    spans: Array


def free_pairs(found: Sequence[tuple[Indices, Indices]]) -> Pairs:
    """Pairs of piecewise formulas whose pieces the distance itself selects.

    Parameters
    ----------
    found
        Sensing agents and what they sense, under each graph and then for each group of obstacles.
    """
    offsets = np.cumsum([0, *(len(i) for i, _ in found)])
    senders, sensed = (np.concatenate(x).astype(np.int64) for x in zip(*found, strict=True))
    return Pairs(senders, sensed, offsets, *free_pieces(len(senders)))


class Slots(NamedTuple):
    """Parameters of a law, see `flocking.engine.kernels.layout.Layout.values`.

    Parameters
    ----------
    P, A, W
        Single numbers; numbers of each agent, shape (rows, N); numbers of each pair, shape (matrices, N, N).
    """

    P: Array
    A: Array
    W: Array


class LedgerLaw(NamedTuple):
    """The law whose energies and powers the ledger holds.

    Parameters
    ----------
    slope
        Address of its compiled function of the slope; 0 if it is the law that acts.
    energies
        Address of its compiled function of the energies.
    begin, end
        Its powers are those components of the state vector.
    spans
        Limits of the pieces of its formulas, as those of `Pairs`, for the pieces of the law that acts.
    slots
        Its parameters.
    """

    slope: int
    energies: int
    begin: int
    end: int
    spans: Array
    slots: Slots


class CompiledLaw(NamedTuple):
    """A law in force, as native functions take it.

    Parameters
    ----------
    slope
        Address of its compiled function, see `flocking.engine.kernels.codegen.compiled_kernels`.
    order, n, m
        Order of the agents, 1 or 2, their number and that of the axes.
    pairs, slots
        Pairs and parameters in force.
    functionals
        Functionals of the graphs, shape (graphs, N).
    ledger
        The law whose energies and powers the ledger holds.
    """

    slope: int
    order: int
    n: int
    m: int
    pairs: Pairs
    slots: Slots
    functionals: Array
    ledger: LedgerLaw


@native_apart
def stages(
    law: CompiledLaw, nodes: Array, weights: Array, first: int, last: int, state_stage: int, t: float, y: Array,
    h: float, K: Array, found: Array,
) -> None:  # fmt: skip
    """Slopes K at stages of a Runge-Kutta step.

    Parameters
    ----------
    nodes, weights
        The method: its nodes c, shape (stages,), and its matrix a, shape (stages, stages).
    first, last
        Slopes are computed at the stages ``first`` to ``last - 1``; those before are known.
    state_stage
        Stage whose state goes to ``found``.
    t, y, h
        Time and state where the step begins, and its length.
    K
        Slopes at the stages, shape (stages, size).
    """
    size, pairs, slots, ledger = y.shape[0], law.pairs, law.slots, law.ledger
    powers = np.empty(size if ledger.slope else 0)
    z, none = np.empty(size), np.empty(0)
    q, p, u = np.empty((law.n, law.m)), np.zeros((law.n, law.m)), np.empty((law.n, law.m))
    for s in range(first, max(last, state_stage + 1)):
        for c in range(size):
            z[c] = y[c]
        for k in range(s):
            if weights[s, k] != 0.0:
                factor = h * weights[s, k]
                for c in range(size):
                    z[c] += factor * K[k, c]
        if s == state_stage:
            for c in range(size):
                found[c] = z[c]
        if s < last:
            _slope(
                law.slope, t + nodes[s] * h, z, pairs.senders, pairs.sensed, pairs.offsets, pairs.pieces, pairs.spans,
                slots.P, slots.A, slots.W, law.functionals, q, p, u, K[s], none,
            )  # fmt: skip
            if ledger.slope:
                _slope(
                    ledger.slope, t + nodes[s] * h, z, pairs.senders, pairs.sensed, pairs.offsets, pairs.pieces,
                    ledger.spans, ledger.slots.P, ledger.slots.A, ledger.slots.W, law.functionals, q, p, u, powers,
                    none,
                )  # fmt: skip
                for c in range(ledger.begin, ledger.end):
                    K[s, c] = powers[c]


def state_energies(law: CompiledLaw, t: float, y: Array, found: Array) -> None:
    """Pair storage, body storage and kinetic energy of a state vector ``y``, for native functions.

    Parameters
    ----------
    y
        The state vector, shape (size,).
    found
        Takes the three, shape (3,).
    """
    n, m, pairs, spans, slots = law.n, law.m, law.pairs, law.ledger.spans, law.ledger.slots
    q, p = np.empty((n, m)), np.zeros((n, m))
    for i in range(n):
        for k in range(m):
            q[i, k] = y[i * m + k]
            if law.order == 2:
                p[i, k] = y[(n + i) * m + k]
    _energies(
        law.ledger.energies, t, q, p, pairs.senders, pairs.sensed, pairs.offsets, pairs.pieces, spans,
        slots.P, slots.A, slots.W, law.functionals, found,
    )  # fmt: skip


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
        self.departs = bool(module.DEPARTS)
        """Whether the state vector holds what bodies depart from the desired motion."""

    @cached_property
    def _addresses(self) -> tuple[int, int]:
        """Addresses of the compiled functions of the slope and of the energies."""
        return int(self.module.slope.address), int(self.module.energies.address)

    def in_force(
        self, n: int, m: int, pairs: Pairs, slots: Slots, functionals: Array, ledger: LedgerLaw | None = None
    ) -> CompiledLaw:
        """The law with pairs and parameters, as native functions take it.

        Parameters
        ----------
        pairs, slots, functionals
            As for `control`.
        ledger
            The law of the ledger, see `in_ledger`, if it is another one.
        """
        slope, energies = self._addresses
        own = ledger or LedgerLaw(0, energies, 0, 0, pairs.spans, slots)
        return CompiledLaw(slope, self.order, n, m, pairs, slots, functionals, own)

    def in_ledger(self, begin: int, end: int, spans: Array, slots: Slots) -> LedgerLaw:
        """The law as that of the ledger of a run in which another acts.

        Parameters
        ----------
        begin, end, spans, slots
            As those of `LedgerLaw`.
        """
        return LedgerLaw(*self._addresses, begin, end, spans, slots)

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

    def limit_signs(self, t: float, y: Array, law: CompiledLaw, count: int) -> Array:
        """Expressions that are positive where limits of the bodies begin and end to act, shape (limits, 2, N).

        Parameters
        ----------
        t, y
            Time and state vector.
        law
            The law in force.
        count
            Number of limits.
        """
        found, (n, m) = np.empty(2 * count * law.n), (law.n, law.m)
        q, p, u = np.empty((n, m)), np.zeros((n, m)), np.empty((n, m))
        self.module.limit_signs(t, y, *law.pairs, *law.slots, law.functionals, q, p, u, found)
        return found.reshape(count, 2, n)

    def shape(self, name: str) -> Callable[..., Sequence[float]] | None:
        """Formulas, in plain Python, of a graph (``"shape0"``...) or of obstacles (``"shape_obstacles0"``...)."""
        found: Callable[..., Sequence[float]] | None = getattr(self.module, name, None)
        return found
