"""What bodies make of held forces on one rank: what belongs to an agent goes with it; gusts are known everywhere."""

from __future__ import annotations

import numpy as np

from flocking.arrays import AnyArray, Array, Numbers32
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.held.held_actuation import HeldActuation
from flocking.model.bodies.actuators import APPLIED
from flocking.model.bodies.body import Body
from flocking.model.bodies.unicycles import HEADING
from flocking.model.state import State


class RankActuation(HeldActuation):
    """The way from the forces that agents computed to what acts, for the agents of one rank.

    Numbers of the bodies are looked up by the numbers of agents, and gusts drawn by them, on any rank. Desired forces,
    lagged ones and headings are asked from the rank that had the agent.

    Parameters
    ----------
    body, state, dtype, ids, workers, periods
        As for `HeldActuation`; ``state`` holds all agents, ``ids`` those here.
    """

    def __init__(
        self, body: Body, state: State, dtype: type[np.float32] | type[np.float64], ids: Numbers32, workers: Workers,
        periods: float | Array,
    ) -> None:  # fmt: skip
        super().__init__(body, state, dtype, ids, workers, periods)
        self._widths = body.widths(self.m)

    def columns_here(self, n: int) -> AnyArray:
        """All that belongs to the ``n`` agents of this rank at the last step, shape (n, `width`)."""
        parts = [self.desired[:, :n].T]
        parts += [] if self.lag is None else [self.lag[:, :n].T]
        parts += [] if self.heading is None else [self.heading[:n]]
        return np.concatenate(parts, axis=1).astype(np.float64)

    @property
    def width(self) -> int:
        """Number of columns of `columns_here`."""
        return int(self.m * (1 if self.lag is None else 2) + (0 if self.heading is None else 2))

    def hold(self, columns: AnyArray, ids: Numbers32) -> None:
        """Hold what belongs to other agents, under the gusts in force.

        Parameters
        ----------
        columns
            A row of `columns_here` for each place, shape (size, `width`).
        ids
            Number of the agent at each place.
        """
        m = self.m
        self.desired = np.ascontiguousarray(columns[:, :m].T.astype(self.dtype))
        end = m
        if self.lag is not None:
            self.lag = np.ascontiguousarray(columns[:, m : 2 * m].T.astype(self.dtype))
            self.beside = np.zeros_like(self.lag)
            end += m
        if self.heading is not None:
            self.heading = np.ascontiguousarray(columns[:, end : end + 2])
        if self.constants is not None:
            self.constants.reorder()
        for source in self._sources:
            source.draw(ids)
        self._blow()

    def further(self, n: int) -> Array:
        """Further columns of the ``n`` agents of this rank at the time that is looked at, in the body's order."""
        lag, heading = (self.lag, self.heading) if self.seen is None else self.seen
        found = {APPLIED: None if lag is None else lag[:, :n].T, HEADING: None if heading is None else heading[:n]}
        parts = [found[name] for name in self._widths]
        return np.concatenate([np.zeros((n, 0)), *(x for x in parts if x is not None)], axis=1)
