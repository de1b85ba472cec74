"""Numbers of agents that stay as they are between events: which limits act, and what is set by the clock."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from flocking.engine.adaptive_steps.segment import Segment
from flocking.errors import NotFinite, SimulationError
from flocking.model.bodies.body import LIMIT_ROUNDS, Body
from flocking.model.checks import Array

LOOKED_AT = 8
"""Places of a step at which limits are looked at; the solution is a polynomial of degree 7 there."""

LOCATED = 1e-3
"""Largest interval in which the time of a change of limits is located, in tolerances of the scenario; of a step that is
shorter than this, the share that the tolerance is."""

Signs = Callable[[float, Array], Array]
"""Values of the expressions of all limits at a time and state vector, shape (limits, 2, N)."""


class HeldNumbers:
    """Rows of numbers of the agents beside the parameters of their bodies, see `flocking.model.bodies.body.Body.held`.

    Parameters
    ----------
    body
        What the agents are.
    n, m
        Numbers of agents and axes.
    tolerance
        That of the scenario.
    base
        The time at which the session's own time, that of all functions here, is 0.
    """

    def __init__(self, body: Body, n: int, m: int, tolerance: float, base: float) -> None:
        self._body, self._n, self._m = body, n, m
        self._tolerance, self._base = tolerance, base
        self.names = body.held(m)
        drawn = body.drawn(0.0, n, m)
        self.limits = [k for k, name in enumerate(self.names) if name not in drawn]
        """Rows that state which limits act."""
        self.rows = np.zeros((len(self.names), n))
        """The numbers, shape (rows, N)."""

    def copy(self) -> HeldNumbers:
        """An independent copy."""
        other = HeldNumbers(self._body, self._n, self._m, self._tolerance, self._base)
        other.rows[:] = self.rows
        return other

    def below(self, values: Array) -> Array:
        """``values`` of each agent, shape (slots, N), with the numbers as further rows, where kernels read them."""
        return np.concatenate([values, self.rows]) if self.names else values

    def put(self, values: Array) -> None:
        """Write the numbers as they are now into the last rows of ``values``, which `below` gave."""
        values[len(values) - len(self.rows) :] = self.rows

    @property
    def acting(self) -> Array:
        """Which limits act on which agents: 1 where they do, shape (limits, N)."""
        return self.rows[self.limits]

    def draw(self, own: float) -> None:
        """Set what the clock sets, ``own`` being the time since the start."""
        found = self._body.drawn(own, self._n, self._m)
        for row, name in zip(self.rows, self.names, strict=True):
            if name in found:
                row[:] = found[name]

    def changed(self, signs: Array) -> NDArray[np.bool_]:
        """Which limits begin or end to act, from the signs of their expressions, shape (limits, N)."""
        return np.asarray(np.where(self.acting > 0.0, signs[:, 1] > 0.0, signs[:, 0] > 0.0))

    def check(self, values: Array, t: float) -> Array:
        """The ``values`` of the expressions of limits at a time, once they are known to be no infinities.

        They are made of squares of forces, of which one of 1e160 has none: a scale made of it would be zero.

        Raises
        ------
        NotFinite
            When one is infinite.
        """
        if np.isinf(values).any():
            row, _, agent = (int(k) for k in np.argwhere(np.isinf(values))[0])
            name = self.names[self.limits[row]]
            raise NotFinite(
                f"What the limit {name!r} of agent {agent} holds down is so large that its square is no number. "
                "Start agents farther apart, or choose units in which forces and speeds are below 1e150.",
                time=t + self._base, agents=(agent,),
            )  # fmt: skip
        return values

    def follow(self, signs: Signs, t: float, y: Array, put: Callable[[], None]) -> bool:
        """Change which limits act according to the state; whether one changed.

        Parameters
        ----------
        signs
            Gives the expressions.
        t, y
            Time and state vector.
        put
            Called after a change, so that the expressions see it.

        Raises
        ------
        SimulationError
            When a limit begins and ends without end, or where `check` refuses.
        """
        any_change = False
        for _ in range(LIMIT_ROUNDS):
            change = self.changed(self.check(signs(t, y), t))
            if not change.any():
                return any_change
            any_change = True
            self.rows[self.limits] = np.where(change, 1.0 - self.acting, self.acting)
            put()
        if self.changed(signs(t, y)).any():
            agent = int(np.flatnonzero(change.any(axis=0))[0])
            raise SimulationError(f"a limit of agent {agent} begins and ends to act without end", time=t + self._base)
        return any_change

    def first_limit_change(self, signs: Signs, segment: Segment) -> float | None:
        """The fraction of a segment just after which the first limit begins or ends to act; None if none does.

        Parameters
        ----------
        signs
            Gives the expressions.
        segment
            The step. One that begins and ends between two of the `LOOKED_AT` places is not seen.
        """
        length = segment.t1 - segment.t0
        if not self.limits or length <= 0.0:
            return None

        def bitten(x: float) -> bool:
            part = segment.cut(x) if x < 1.0 else segment
            return bool(self.changed(signs(part.t1, part.coefficients[-1])).any())

        low = 0.0
        for k in range(1, LOOKED_AT + 1):
            high = k / LOOKED_AT
            if bitten(high):
                break
            low = high
        else:
            return None
        finest = self._tolerance * min(LOCATED / length, 1.0)
        finest = max(finest, 4 * float(np.spacing(max(abs(segment.t1), length))) / length)
        while high - low > finest:
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            low, high = (low, middle) if bitten(middle) else (middle, high)
        return high
