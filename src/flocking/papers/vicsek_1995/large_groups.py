"""Many agents of one speed on a torus, update by update: what the engine in discrete time computes, without its frames.

Results are those of `flocking.simulate` to the last bit.
"""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array
from flocking.engine.discrete.heading_updates import HeadingUpdates, why_not
from flocking.engine.fixed_step.threads import check_threads
from flocking.errors import UnsupportedLaw
from flocking.model.law import Scenario
from flocking.model.world.control import Held
from flocking.model.world.times import NANOSECOND, PER_SECOND


class HeadingGroup:
    """Agents of a scenario whose headings follow the average of their neighbours, on a torus in the plane.

    Parameters
    ----------
    scenario
        Of `Heading` agents of one speed and noise under `VelocityAverage` with the gain of one period, that update
        together; its frames and its end do not matter.
    threads
        Number of threads; by default all processors for large groups. Results do not depend on it.

    Attributes
    ----------
    updates
        How often the agents have updated.

    Raises
    ------
    UnsupportedLaw
        When the scenario is another one.
    """

    def __init__(self, scenario: Scenario, threads: int | None = None) -> None:
        reason = why_not(scenario)
        if reason:
            raise UnsupportedLaw(f"HeadingGroup needs {reason}. Use flocking.simulate.")
        body, control = scenario.agents, scenario.control
        assert isinstance(control, Held)
        if threads is not None:
            check_threads("HeadingGroup", threads)
        self.updates, self._space = 0, scenario.space
        self._backward = getattr(body, "update", "") == "backward"
        self._period = round(float(np.max(control.period)) * PER_SECOND) * NANOSECOND
        self._agents = HeadingUpdates(scenario, threads)
        self._agents.take(scenario.start.q, scenario.start.p, np.zeros_like(scenario.start.p))

    def update(self, count: int = 1) -> None:
        """Let all agents update.

        Parameters
        ----------
        count
            How often.
        """
        for _ in range(count):
            self._agents.turn(self.updates)
            if not self._backward:
                self._agents.accept()
            self._agents.move(self._period, turned=self._backward)
            self.updates += 1

    @property
    def order(self) -> float:
        """Length of the mean unit velocity."""
        return float(np.hypot(*self.direction))

    @property
    def direction(self) -> Array:
        """The mean unit velocity, shape (2,)."""
        return self._agents.mean_velocity / self._agents.speed

    def state(self) -> tuple[Array, Array]:
        """Positions in the box and unit vectors of the velocities, by the number of the agent, shape (N, 2) each."""
        return self._space.wrapped(self._agents.positions), self._agents.velocities / self._agents.speed

    def close(self) -> None:
        """Stop the threads."""
        self._agents.close()
