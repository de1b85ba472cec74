"""Agents that stay at the centre of a ball, where the force of an obstacle has no direction."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flocking.arrays import Array
from flocking.engine.archives.data_checks import MalformedError
from flocking.errors import Chattering
from flocking.model.law import Scenario
from flocking.model.leaders_and_obstacles.obstacles import Ball
from flocking.model.state import State
from flocking.model.terms.avoidance import ObstacleTerm

CLOSE = 1e-5
"""Distance from a centre, relative to the radius, within which an agent counts as being there: one that passes through
the ball leaves it within a few steps."""

LASTING = 1000
"""Steps between two looks; who is at the same centre in both does not leave it."""

REMAINING = 100
"""Looks that the rest of the run would take if steps stayed as short: below, it ends in reasonable time."""


CentresMemory = tuple[int, float, tuple[tuple[int, int], ...]]
"""Steps and time of the last look, and the agents and balls of whose centres they were close, as plain data."""


class ObstacleCentres:
    """Looks now and then whether agents stay at centres of balls in steps that hardly advance.

    A law that drives agents inside a ball to its centre, as that of Olfati-Saber (2006) does, has no solution after
    one arrives there: the direction of the force jumps. One that rests there without a force stays, as it should.

    Parameters
    ----------
    scenario
        The law, and when the run ends.
    """

    def __init__(self, scenario: Scenario) -> None:
        terms = [term for term in scenario.law.body_terms if isinstance(term, ObstacleTerm)]
        self._balls = [o for term in terms for o in term.obstacles if isinstance(o, Ball)]
        self._end, self._steps, self._time = scenario.t_end, 0, scenario.start.t
        self._order = scenario.agents.order
        self._there: set[tuple[int, int]] = set()

    def until_look(self, steps: int) -> float:
        """Steps until the next look, after so many ``steps``: where looks fall does not depend on how a run is cut."""
        return self._steps + LASTING - steps if self._balls else np.inf

    @property
    def memory(self) -> CentresMemory | None:
        """What was seen in the last look; None where there are no balls."""
        return (self._steps, self._time, tuple(sorted(self._there))) if self._balls else None

    def recall(self, memory: CentresMemory | None) -> None:
        """Go on from what was seen in the last look, if that is known.

        Parameters
        ----------
        memory
            What `memory` gave, or None.

        Raises
        ------
        MalformedError
            If there are no such balls.
        """
        if memory is None:
            return
        self._steps, self._time, there = memory
        self._there = set(there)
        if any(ball >= len(self._balls) for _, ball in there):
            raise MalformedError("centres must name balls that there are")

    def look(self, steps: int, moment: Callable[[], tuple[State, Array]]) -> None:
        """Look at a state after so many steps.

        Parameters
        ----------
        steps
            Number of steps of the run.
        moment
            Gives the state, and the rates of change of the velocities, of agents of order 1 their velocities.

        Raises
        ------
        Chattering
            If an agent does not leave a centre.
        """
        if not self._balls or steps - self._steps < LASTING:
            return
        now, rates = moment()
        places = np.array([ball.centre.at(now.t)[0] for ball in self._balls])
        reach = CLOSE * np.array([ball.radius for ball in self._balls])
        near = ((now.q[:, None] - places) ** 2).sum(axis=2) < reach**2
        # A force that would not even move an agent from there in all of the time that remains does not hold it there.
        remaining = self._end - now.t
        carried = np.linalg.norm(rates, axis=1) * (remaining if self._order == 1 else remaining**2 / 2.0)
        near &= carried[:, None] > reach
        there = {(int(i), int(k)) for i, k in zip(*np.nonzero(near), strict=True)}
        staying = sorted({agent for agent, _ in there & self._there})
        short = (now.t - self._time) * REMAINING < remaining
        self._steps, self._time, self._there = steps, now.t, there
        if staying and short:
            raise Chattering(
                "An agent inside a ball does not leave its centre, where the force of the obstacle has no direction (a "
                "Filippov sliding mode): the law has no solution beyond. Raise the repulsion_gain of Avoid, so that "
                "agents stay outside.",
                time=now.t, agents=tuple(staying),
            )  # fmt: skip
