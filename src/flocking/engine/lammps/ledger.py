"""The energy ledger of a LAMMPS run: rows are computed on one rank from gathered states, at intervals of steps."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.kernels.motion_source import RATES
from flocking.engine.lammps.gathered_states import LawOnStates
from flocking.engine.runs.observation import observation
from flocking.engine.runs.recorder import Recorder
from flocking.engine.runs.run import Closest, LedgerRow
from flocking.errors import NotFinite
from flocking.model.law import Scenario
from flocking.model.space import OPEN, Space
from flocking.model.state import State


class Ledger:
    """Rows of the ledger and the closest pair, from states at several times.

    Work, dissipation and supply are integrated by the trapezoidal rule between the rows.

    Parameters
    ----------
    scenario
        The law and its energy.
    break_energies
        Energy of a pair at the break radius, for each graph of the law: the jump of the energy when a link appears or
        breaks. Links that do both between two rows cancel.
    records
        Receives the rows and the closest pair.
    """

    def __init__(self, scenario: Scenario, break_energies: list[float], records: Recorder) -> None:
        self.scenario = scenario
        self._records = records
        self._last: tuple[float, Array] | None = None
        self._heights = [break_energies[0] - scenario.energy.unlinked, *break_energies[1:]]
        self._counts: list[int] = []
        self._law = LawOnStates(scenario)

    @property
    def trace(self) -> list[tuple[float, ...]]:
        """The rows, fields `TRACE_FIELDS`."""
        return self._records.trace

    def resume(self, state: State) -> None:
        """Continue after the rows of an earlier run that ended in ``state``."""
        if self.trace:
            pairs = self.pairs(state)
            self._last = (state.t, self._evaluated(state, pairs)[2])
            self._counts = [len(i) for i, _ in pairs]

    def pairs(self, state: State) -> list[tuple[Indices, Indices]]:
        """Ordered pairs of agents linked under each graph of the law."""
        return self._law.pairs(state)

    def add(self, state: State, pairs: list[tuple[Indices, Indices]]) -> None:
        """Add the row of a state with its pairs under each graph."""
        stored, kinetic, powers = self._evaluated(state, pairs)
        integrals = np.array(self.trace[-1][3:6]) if self.trace else np.zeros(len(RATES))
        if self._last is not None:
            t, before = self._last
            integrals = integrals + 0.5 * (state.t - t) * (before + powers)
        self._last = (state.t, powers)
        work, lost, supplied = map(float, integrals)
        row = LedgerRow(state.t, stored + kinetic, kinetic, work, lost, supplied, self._jumped(pairs))
        self.trace.append(row)

    def _jumped(self, pairs: list[tuple[Indices, Indices]]) -> float:
        """Energy of all links that have appeared so far, minus that of all links that have broken."""
        before = self.trace[-1][6] if self.trace else 0.0
        last, self._counts = self._counts, [len(i) for i, _ in pairs]
        gained = (
            0.5 * (new - old) * height for new, old, height in zip(self._counts, last, self._heights, strict=False)
        )
        return float(before + sum(gained))

    def _evaluated(self, state: State, pairs: list[tuple[Indices, Indices]]) -> tuple[float, float, Array]:
        """Stored and kinetic energy, and the powers of `RATES`."""
        self._closest(state, pairs[0])
        n, count = state.n, len(pairs[0][0])
        u, powers, (links, bodies, kinetic) = self._law.evaluated(state, pairs)
        if not np.isfinite([links, bodies]).all() or not np.isfinite(u).all():
            raise NotFinite("Some agents are where a potential is infinite.", time=state.t)
        unlinked = 0.5 * (n * (n - 1.0) - count) * self.scenario.energy.unlinked
        return float(links + bodies + unlinked), float(kinetic), powers

    def _closest(self, state: State, pairs: tuple[Indices, Indices]) -> None:
        i, j = pairs
        if not len(i):
            return
        square = (self.scenario.space.displacement(state.q[i] - state.q[j]) ** 2).sum(axis=1)
        k = int(np.argmin(square))
        if float(np.sqrt(square[k])) < self._records.closest_linked.distance:
            pair = (int(min(i[k], j[k])), int(max(i[k], j[k])))
            self._records.closest_linked = Closest(float(np.sqrt(square[k])), state.t, pair)


def observed_state(state: State, pairs: tuple[Indices, Indices], space: Space = OPEN) -> tuple[float, ...]:
    """A row of `flocking.engine.runs.run.OBSERVED_FIELDS`.

    Parameters
    ----------
    state
        The whole state.
    pairs
        Pairs linked under the law's graph, the agents i and j of each, shape (K,) each.
    space
        The space of the agents.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = state.n
    i, j = pairs
    length = np.sqrt((space.displacement(state.q[i] - state.q[j]) ** 2).sum(axis=1))
    _, label = connected_components(coo_array((np.ones(len(i), dtype=bool), (i, j)), shape=(n, n)), directed=False)
    mean, deviation = (float(length.mean()), float(length.std())) if len(length) else (np.nan, np.nan)
    return observation(
        state.t, state.p, np.bincount(label), len(i), mean=mean, deviation=deviation,
        closest=float(length.min(initial=np.inf)),
    )  # fmt: skip
