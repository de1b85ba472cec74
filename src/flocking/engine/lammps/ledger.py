"""The energy ledger of a run on a cluster: its rows are taken from whole states, on one rank, now and then."""

from __future__ import annotations

from typing import Any

import numpy as np

from flocking.engine.codegen import RATES, compiled_kernels
from flocking.engine.encounters import Encounters
from flocking.engine.layout import Layout
from flocking.engine.run import Closest
from flocking.model.law import Scenario
from flocking.model.state import State


def near_pairs(q: Any, radius: float) -> tuple[Any, Any]:
    """Ordered pairs (i, j) of positions closer than a radius, each a row of indices."""
    from scipy.spatial import cKDTree

    found = cKDTree(q).query_pairs(radius, output_type="ndarray")
    # The tree keeps pairs at exactly the radius.
    found = found[((q[found[:, 0]] - q[found[:, 1]]) ** 2).sum(axis=1) < radius**2]
    return np.concatenate([found[:, 0], found[:, 1]]), np.concatenate([found[:, 1], found[:, 0]])


class Ledger:
    """Rows of the ledger and the closest pair, from states at chosen times.

    Work, dissipation and supply are integrated by the trapezoidal rule between the rows: the residual shows when
    rows are too far apart.

    Parameters
    ----------
    scenario
        The law and its energy.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.trace: list[tuple[float, ...]] = []
        self.closest_linked = Closest()
        self.closest_unlinked = Closest()
        self._last: tuple[float, Any] | None = None
        self._layout = Layout(scenario.law, scenario.energy)
        self._slots = self._layout.values(scenario.agents, scenario.start.n, scenario.start.t)
        self._encounters = Encounters(scenario.law)

    def go_on(self, trace: list[tuple[float, ...]], state: State) -> None:
        """Go on after the rows of an earlier run that ended in ``state``."""
        self.trace = trace
        if trace:
            self._last = (state.t, self._evaluated(state)[2])

    def add(self, state: State) -> None:
        """Add the row of a state."""
        stored, kinetic, powers = self._evaluated(state)
        integrals = np.array(self.trace[-1][3:6]) if self.trace else np.zeros(len(RATES))
        if self._last is not None:
            t, before = self._last
            integrals = integrals + 0.5 * (state.t - t) * (before + powers)
        self._last = (state.t, powers)
        self.trace.append((state.t, stored + kinetic, kinetic, *map(float, integrals), 0.0))

    def _evaluated(self, state: State) -> tuple[float, float, Any]:
        """Stored and kinetic energy, and the powers of `RATES`."""
        kernels = compiled_kernels(self._layout, state.dimension, 2)
        pairs = [near_pairs(state.q, float(g.break_radius)) for g in self.scenario.law.graphs]
        self._closest(state, pairs[0])
        n, count = state.n, len(pairs[0][0])
        for level in self._encounters.levels:
            if level.kind == "obstacle":
                near = np.argwhere(self._encounters.within(level, state.q, state.t))
                pairs.append((near[:, 0], near[:, 1]))
        offsets = np.cumsum([0, *(len(i) for i, _ in pairs)])
        senders, sensed = (np.concatenate([pair[k] for pair in pairs]).astype(np.int64) for k in (0, 1))
        P, A, W = self._slots
        functionals = np.zeros((len(self.scenario.law.graphs), n))
        given = (state.t, np.ascontiguousarray(state.q), np.ascontiguousarray(state.p), senders, sensed, offsets)
        u, powers = np.empty((n, state.dimension)), np.empty(len(RATES))
        kernels.control(*given, P, A, W, functionals, u, powers)
        links, bodies, kinetic = kernels.energies(*given, P, A, W, functionals)
        unlinked = 0.5 * (n * (n - 1.0) - count) * self.scenario.energy.unlinked
        return float(links + bodies + unlinked), float(kinetic), powers

    def _closest(self, state: State, pairs: tuple[Any, Any]) -> None:
        i, j = pairs
        if not len(i):
            return
        square = ((state.q[i] - state.q[j]) ** 2).sum(axis=1)
        k = int(np.argmin(square))
        if float(np.sqrt(square[k])) < self.closest_linked.distance:
            pair = (int(min(i[k], j[k])), int(max(i[k], j[k])))
            self.closest_linked = Closest(float(np.sqrt(square[k])), state.t, pair)


def observation(scenario: Scenario, state: State) -> tuple[float, ...]:
    """A row of `flocking.engine.tiles.observables.OBSERVED_FIELDS` from a whole state."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    from flocking.model.observables import order, velocity_spread

    n = state.n
    i, j = near_pairs(state.q, float(scenario.law.graph.break_radius))
    length = np.sqrt(((state.q[i] - state.q[j]) ** 2).sum(axis=1))
    count, label = connected_components(coo_array((np.ones(len(i), dtype=bool), (i, j)), shape=(n, n)), directed=False)
    mean = float(length.mean()) if len(length) else np.nan
    defect = float(length.std()) / mean if len(length) else np.nan
    return (
        state.t, order(state), float(np.linalg.norm(state.p, axis=1).mean()), velocity_spread(state), int(count),
        float(np.bincount(label).max()) / n, len(i) / n, mean, defect, float(length.min(initial=np.inf)),
    )  # fmt: skip
