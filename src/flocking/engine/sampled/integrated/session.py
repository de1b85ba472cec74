"""A running simulation of bodies that are integrated between ticks, under held control and with messages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.adaptive_steps.adaptive_session import AdaptiveSession
from flocking.engine.imperfect.messages.interventions import packed_changes, unpacked_changes
from flocking.engine.imperfect.powers import FIFTEEN, POWERS, Powers, integrated, node_powers
from flocking.engine.protocol.body_chains import point_of
from flocking.engine.protocol.session import Packed, Stored
from flocking.engine.runs.fidelity import Fidelity
from flocking.engine.sampled.actuation import Actuation
from flocking.engine.sampled.integrated.checkpoint import IntegratedMemory, packed_memory, unpacked_memory
from flocking.engine.sampled.integrated.motion import IntegratedMotion
from flocking.engine.sampled.session import SampledSession
from flocking.model.law import Scenario
from flocking.model.world.times import NANOSECOND

HOW = "integrated numerically between ticks, by adaptive steps of order 8"
"""How bodies move here, for the provenance of a run."""


class IntegratedSession(AdaptiveSession, SampledSession):
    """Held control of bodies whose motion has no closed form: adaptive steps of order 8 from tick to tick.

    What agents know, when they act and what they log is as in `SampledSession`. True links, obstacles and closest
    approaches follow from the polynomials of the steps, and the ledger from the forces that bodies exert, so that its
    residual shows the error of the steps.

    Parameters
    ----------
    scenario
        What is simulated; its control is held.
    """

    rule = FIFTEEN
    rounding_alone = False
    motion: IntegratedMotion

    def _prepare(self, scenario: Scenario) -> None:
        self.integration_steps = 0
        """How many steps of the motion there were."""
        self._ends_step = False
        super()._prepare(scenario)
        self._lengths, self._stepper = self.motion.lengths, self.motion.stepper

    def _new_motion(self, scenario: Scenario, periods: Array) -> tuple[Actuation, IntegratedMotion]:
        points = point_of(scenario.agents)
        return Actuation(points, self.n, self.m, periods), IntegratedMotion(scenario)

    def _columns_at(self, seconds: float) -> dict[str, Array]:
        return self.motion.columns_at(seconds)

    def _headings(self, seconds: float, column: str) -> Array:
        return self.motion.headings(seconds, column)

    # Steps.

    def _next_change(self) -> float:
        at = super()._next_change()
        self._ends_step = self.motion.end < at
        return min(at, self.motion.end)

    def _change(self) -> None:
        """Go on to the next step, or what else falls on an instant."""
        if not self._ends_step:
            super()._change()
            return
        seconds = self.motion.end
        if self.accounted < seconds:
            self._account(seconds)
            self._record_row(seconds)
        applies = self._ticks.at(np.arange(self.n), self.applied) + self._latency
        self.motion.go_on(seconds, int(applies.min()) * NANOSECOND)
        self.integration_steps += 1
        end, everyone = self.motion.end, np.arange(self.n)
        self.obstacle_ranges.ends = np.full(self.n, end)
        self.obstacle_ranges.watch(self._base, seconds, self.motion.shifted(seconds), everyone)
        self._watch(seconds, np.full(self.n, end - seconds), np.ones(self.n, dtype=bool))

    def _watch_pieces(self, instant: int, changed: Links) -> None:
        """Nothing: a step that ends where a force changes is followed by the next one, an event of its own."""

    # The ledger.

    def _integrated(self, length: float) -> tuple[Array, Array, float]:
        powers = self._powers(self.accounted)
        return integrated(powers, length, self.scenario.tolerance, self.largest_power, self.rule)

    def _powers(self, seconds: float) -> Powers:
        """Powers of the ledger as functions of the time from ``seconds`` since the start on."""
        law, motion, now = self._law.in_force(self._pairs), self.motion, np.zeros(1)

        def at(times: Array) -> Array:
            found = np.empty((len(times), len(POWERS)))
            for row, s in enumerate((seconds + times).tolist()):
                q, p = motion.at(s)
                # Bodies of order 1 depart by the velocity with which they move, others by what they add to the force.
                acting = motion.force if law.order == 2 else p
                S = np.stack([q, p])
                node_powers(law, self._base + s, S, np.ascontiguousarray(acting)[None], now, found[row : row + 1])
                if law.order == 2:
                    found[row, -1] += motion.bodies.departed(s, motion.vector_at(s))
            return found

        return at

    # What others ask.

    def accelerations(self) -> Array:
        """Rates of change of the velocities now, shape (N, m); of agents of order 1 their velocities."""
        return self.motion.accelerations(self.time - self._base)

    @property
    def about(self) -> dict[str, object]:
        """Provenance of the records, with how bodies move and in how many steps."""
        return super().about | {"motion": HOW, "integration steps": self.integration_steps}

    @property
    def fidelity(self) -> Fidelity:
        """As of all sessions with adaptive steps, and whether this one was changed."""
        return replace(super().fidelity, changed=bool(self.interventions.times))

    def pack(self) -> Packed:
        """All that another session needs to go on bit for bit, but its scenario and its records."""
        (numbers, arrays), (more, rows) = (
            packed_memory(self._integrated_memory),
            packed_changes(self.interventions, self.knowledge),
        )
        return numbers | more, arrays | rows

    @property
    def _integrated_memory(self) -> IntegratedMemory:
        return IntegratedMemory(self._memory, self.motion, self.integration_steps)

    @classmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> IntegratedSession:
        """The session that was packed."""
        session = cls._unbegun(stored.scenario)
        memory = session._integrated_memory
        rest = unpacked_changes(packed, session.interventions, session.knowledge)
        unpacked_memory(memory, rest, stored.scenario)
        session.take_back(memory.sampled, stored)
        session.integration_steps = memory.steps
        return session
