"""What agents measured, and when each message about it arrived, computed from the declared world alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array
from flocking.engine.runs.message_log import AT_START, PRESENT
from flocking.errors import InvalidInput
from flocking.model.law import Scenario
from flocking.model.world.information import Messages
from flocking.model.world.random_numbers import Purpose, uniform
from flocking.model.world.times import NANOSECOND, PER_SECOND
from flocking.study.message_logs.forced_motion import ForcedMotion
from flocking.study.message_logs.integrated_motion import IntegratedForcedMotion

NEVER = np.iinfo(np.int64).max
"""When a lost message arrives."""

ROUNDED = 1e-9
"""Share of a resolution within which it is open to which of two multiples a value is rounded."""


@dataclass(frozen=True)
class Sample:
    """What an agent measured of itself.

    Parameters
    ----------
    q, p
        Position and velocity, with all errors, shape (m,).
    exact_q, exact_p
        The same without errors.
    instant
        When, in nanoseconds since the start.
    open
        Whether rounding of the last digits could lead to another multiple of the resolution.
    """

    q: Array
    p: Array
    exact_q: Array
    exact_p: Array
    instant: int
    open: bool


class Arrivals:
    """Samples and arrivals of a run.

    Parameters
    ----------
    scenario
        Its information are messages.
    motion
        Where everybody was.
    last
        Nanosecond after which nothing is looked up.
    """

    def __init__(self, scenario: Scenario, motion: ForcedMotion | IntegratedForcedMotion, last: int) -> None:
        assert isinstance(scenario.information, Messages)
        self.world, self.scenario, self.motion = scenario.information, scenario, motion
        self.n, self.m = motion.n, motion.m
        world = self.world
        each = [np.broadcast_to(np.rint(np.asarray(x) * PER_SECOND), self.n).astype(np.int64).tolist()
                for x in (world.period, world.phase)]  # fmt: skip
        self._period, self._phase = each
        self.delay, self.jitter = round(world.delay * PER_SECOND), round(world.jitter * PER_SECOND)
        self.counts = [max(0, (last - a) // T + 1) for T, a in zip(self._period, self._phase, strict=True)]
        """How many samples each agent took until then."""
        self._samples: list[list[Sample]] = [[] for _ in range(self.n)]
        self._errors: list[Array] = []
        self._arrivals: dict[tuple[int, int], NDArray[np.int64]] = {}
        self.late: dict[tuple[int, int], NDArray[np.int64]] = {}
        """When messages would arrive if none were lost, once `arrivals` has been asked for."""

    def taken(self, agent: int, k: int) -> int:
        """Nanosecond at which sample ``k`` of an ``agent`` was taken."""
        return 0 if k == AT_START else self._phase[agent] + k * self._period[agent]

    def newest_taken(self, agent: int, instant: int) -> int:
        """Number of an agent's newest own sample at an ``instant``."""
        return AT_START if instant < self._phase[agent] else (instant - self._phase[agent]) // self._period[agent]

    def sample(self, agent: int, k: int, instant: int) -> Sample:
        """What is used of an agent: sample ``k``, the state at the start, or the true state at an ``instant``.

        Raises
        ------
        InvalidInput
            When the agent took no such sample.
        """
        if k == AT_START:
            q, p = self.scenario.start.q[agent], self.scenario.start.p[agent]
            # Agents of order 1 stand still before the start, whatever velocities it gives.
            p = p if self.motion.order > 1 else np.zeros_like(p)
            return Sample(q, p, q, p, 0, open=False)
        if k == PRESENT:
            q, p = self.motion.state(agent, instant * NANOSECOND, instant)
            return Sample(q, p, q, p, instant, open=False)
        if not 0 <= k < self.counts[agent]:
            raise InvalidInput("run", "log", f"must name samples that agent {agent} took", k, "The log was changed.")
        mine = self._samples[agent]
        while len(mine) <= k:
            mine.append(self._measured(agent, len(mine)))
        return mine[k]

    def _measured(self, agent: int, k: int) -> Sample:
        instant = self.taken(agent, k)
        q, p = self.motion.state(agent, instant * NANOSECOND, instant)
        # What is sent is the velocity before that time: agents of order 1 stand still before the start.
        p = p if instant or self.motion.order > 1 else np.zeros_like(p)
        found, world = [q, p], self.world
        if world.noise is not None and not world.noise.ideal:
            if not self._errors:
                self._errors = [np.zeros(2 * self.m) for _ in range(self.n)]
            one = np.array([agent]), np.array([k])
            drawn = np.concatenate([x[0] for x in world.noise.normals(world.seed, *one, self.m)])
            rho = world.noise.memory(self._period[agent] * NANOSECOND) if k else 0.0
            error = rho * self._errors[agent] + math.sqrt(1.0 - rho * rho) * drawn
            self._errors[agent] = error
            found = [q + world.noise.position * error[: self.m], p + world.noise.velocity * error[self.m :]]
        open_ = False
        for part, step in enumerate((world.resolution, world.velocity_resolution)):
            if step:
                ratio = found[part] / step
                size = 1.0 + float(np.abs(found[part]).max())
                moved = (self.motion.error * size + self.motion.shifts[part]) / step
                open_ |= bool((np.abs(ratio - np.floor(ratio) - 0.5) < ROUNDED + moved).any())
                found[part] = np.rint(ratio) * step
        return Sample(found[0], found[1], q, p, instant, open_)

    def arrivals(self, receiver: int, sender: int) -> NDArray[np.int64]:
        """When messages of ``sender`` reach ``receiver``, in nanoseconds by number; `NEVER` where they are lost."""
        known = self._arrivals.get((receiver, sender))
        if known is not None:
            return known
        world = self.world
        k = np.arange(self.counts[sender], dtype=np.int64)
        times = self._phase[sender] + k * self._period[sender] + self.delay
        i, j = np.full(len(k), receiver), np.full(len(k), sender)
        if self.jitter:
            times = times + np.rint(uniform(world.seed, Purpose.JITTER, j, i, k) * self.jitter).astype(np.int64)
        self.late[receiver, sender] = times
        if world.loss is not None and not world.loss.ideal:
            distance = None
            if world.loss.reads_distance:
                distance = np.array([self._distance(receiver, sender, self.taken(sender, int(x))) for x in k])
            times = np.where(world.loss.lost(world.seed, j, i, k, distance), NEVER, times)
        found: NDArray[np.int64] = times
        self._arrivals[receiver, sender] = found
        return found

    def _distance(self, receiver: int, sender: int, instant: int) -> float:
        (here, _), (there, _) = (self.motion.state(a, instant * NANOSECOND, instant) for a in (receiver, sender))
        return float(np.linalg.norm(self.scenario.space.displacement(there - here)))

    def newest(self, receiver: int, sender: int, instant: int, *, lossless: bool = False) -> int:
        """Number of the newest sample of a sender that has arrived at a receiver, by the time at which it was taken.

        Parameters
        ----------
        instant
            Now, in nanoseconds since the start.
        lossless
            As if nothing were ever lost.
        """
        times = self.arrivals(receiver, sender)
        if lossless:
            times = self.late[receiver, sender]
        there = np.flatnonzero(times <= instant)
        return int(there[-1]) if len(there) else AT_START
