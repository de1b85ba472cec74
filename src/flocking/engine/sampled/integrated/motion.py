"""Motion of bodies under held forces by adaptive steps: one polynomial in time for all agents, step by step."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.adaptive_steps.integration_method import DEGREE
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.adaptive_steps.step_lengths import StepLengths
from flocking.engine.adaptive_steps.stepper import Stepper, StepperMemory
from flocking.engine.imperfect.taylor_series import shifted
from flocking.engine.protocol.body_chains import point_of
from flocking.engine.sampled.integrated.held_bodies import HeldBodies
from flocking.engine.sampled.motion import Motion
from flocking.engine.sampled.piece_series import LONGEST_PIECE
from flocking.model.law import Scenario
from flocking.model.world.times import NANOSECOND, PER_SECOND, Instants


class IntegratedMotion(Motion):
    """All columns of all agents on the last step, as polynomials of degree 7 in time.

    A step ends at the latest when a force changes, when a body is set by its clock, and where a limit of a body begins
    or ends to act.

    Parameters
    ----------
    scenario
        What the agents are, and the start.

    Attributes
    ----------
    bodies
        How they change.
    segment
        The last step, in seconds from the start.
    lengths
        Lengths of the last steps.
    """

    def __init__(self, scenario: Scenario) -> None:
        start = scenario.start
        super().__init__(start.q, start.p, point_of(scenario.agents))
        self.bodies = HeldBodies(scenario)
        self._body, self._base = scenario.agents, start.t
        self.n, self.m = start.q.shape
        self.segment = Segment.resting(0.0, self.bodies.vector(start))
        self.lengths = StepLengths(scenario.t_end - start.t)
        self.drawn_until = 0
        """Nanosecond until which the numbers that the clock sets stay as they are."""
        t, y, bodies = self.segment.t1, np.array(self.segment.coefficients[-1]), self.bodies
        shape = self.order, self.n, self.m
        memory = StepperMemory(t, y, np.zeros_like(y), 0.0)
        self.stepper = Stepper(bodies.slope, bodies.stages, bodies.tolerances, memory, self._base, shape)

    def recall(self, segment: Segment, acting: Array, step: float) -> None:
        """Go on from the last step of another motion, and from the forces that are set.

        Parameters
        ----------
        segment
            The step.
        acting
            1 where limits act, shape (limits, N).
        step
            Proposed length of the next step.
        """
        limits = self.bodies.limits
        self.segment, self.drawn_until = segment, 0
        self.bodies.hold(self.force)
        self.draw(segment.t0)
        limits.rows[limits.limits] = acting
        self.bodies.put_limits()
        y = np.array(segment.coefficients[-1])
        self.stepper.recall(StepperMemory(segment.t1, y, np.zeros_like(y), step))

    @property
    def end(self) -> float:
        """When the last step ends, in seconds from the start."""
        return self.segment.t1

    def go_on(self, seconds: float, bound: float) -> None:
        """Take the next step, under the forces that are held from now on.

        Parameters
        ----------
        seconds
            Now, since the start: where the last step ends.
        bound
            When a force changes next.

        Raises
        ------
        SimulationError
            When no step is possible.
        """
        bodies, before = self.bodies, self.stepper.memory
        y = self._take_up(seconds)
        try:
            self.stepper.restart(seconds, y)
            segment = self.stepper.step(min(bound, self.drawn_until * NANOSECOND))
            change = bodies.limits.first_limit_change(bodies.signs, segment)
            if bodies.limits.limits:
                bodies.limits.check(bodies.signs(segment.t1, segment.coefficients[-1]), segment.t1)
        except BaseException:
            self.stepper.recall(before)
            raise
        self.segment = segment if change is None or change >= 1.0 else segment.cut(change)
        self.lengths.add(self.segment.t1 - self.segment.t0)

    def _take_up(self, seconds: float) -> Array:
        """Let the forces, the numbers of the clock and the limits of a time act, and return the state vector then."""
        bodies, y = self.bodies, self.vector_at(seconds)
        bodies.hold(self.force)
        self.draw(seconds)
        if bodies.limits.limits:
            bodies.limits.follow(bodies.signs, seconds, y, bodies.put_limits)
        return y

    def draw(self, seconds: float) -> None:
        """Take the numbers that the clock sets at ``seconds`` from the start, and write them where the kernels read.

        The limits that act are written there too.
        """
        instant = round(seconds * PER_SECOND)
        if instant >= self.drawn_until:
            elapsed = instant / PER_SECOND
            self.bodies.limits.draw(elapsed)
            until = self._body.drawn_until(elapsed)
            self.drawn_until = LONGEST_PIECE
            if np.isfinite(until):
                # A whole nanosecond that is not before it.
                self.drawn_until = round(until * PER_SECOND)
                self.drawn_until += self.drawn_until / PER_SECOND < until
        self.bodies.put_limits()

    def _state(self, seconds: float) -> Array:
        return self.segment.at(seconds)

    def at(self, time: float, agents: Indices | slice = slice(None)) -> tuple[Array, Array]:
        """Positions and velocities of ``agents`` at ``time`` seconds from the start, within the last step.

        Velocities of agents of order 1 are those with which they move.
        """
        y, count = self._state(time), self.n * self.m
        q = y[:count].reshape(self.n, self.m)
        moving = y[count : 2 * count] if self.order == 2 else self.bodies.slope(time, y)[:count]
        return q[agents], moving.reshape(self.n, self.m)[agents]

    def accelerations(self, time: float) -> Array:
        """Rates of change of the velocities, shape (N, m); of agents of order 1 their velocities."""
        count = self.n * self.m
        slope = self.bodies.slope(time, self._state(time))
        return slope[(self.order - 1) * count : self.order * count].reshape(self.n, self.m)

    def columns_at(self, time: float) -> dict[str, Array]:
        """Further columns of all agents at ``time`` seconds from the start, shape (N, width) each, by name."""
        return self.bodies.further(self._state(time))

    def vector_at(self, time: float) -> Array:
        """State vector at ``time`` seconds from the start, without what is integrated beside."""
        return self.bodies.widened(self._state(time)[: self.bodies.size])

    def shifted(self, time: float) -> Array:
        """Taylor coefficients of the positions about ``time`` seconds from the start, shape (8, N, m)."""
        return self._vectors(time, 0)

    def headings(self, time: float, column: str) -> Array:
        """The same of the vectors of a ``column`` along which agents look."""
        return self._vectors(time, self.bodies.place_of(column))

    def _vectors(self, time: float, first: int) -> Array:
        """Taylor coefficients of the vectors that begin at ``first`` in state vectors, shape (8, N, m)."""
        series = self.segment.series(first + self.n * self.m)[:, first:].reshape(DEGREE + 1, self.n, self.m)
        return shifted(series, time - self.segment.t0)

    def ends(self) -> Instants:
        """No polynomial ends at a nanosecond of its own: steps have times between them, see `end`."""
        return np.full(self.n, LONGEST_PIECE, dtype=np.int64)

    def exert(self, time: int, agents: Indices, force: Array | None = None, beside: Array | None = None) -> None:
        """Let other forces of ``agents`` act from ``time`` nanoseconds on: the last step ends there.

        Parameters
        ----------
        force
            The forces, shape (agents, m).
        beside
            None: gusts are numbers of the bodies.
        """
        if force is None:
            return
        seconds = time * NANOSECOND
        self.segment = Segment.resting(seconds, self.vector_at(seconds))
        self.force[agents] = force
        self._take_up(seconds)
