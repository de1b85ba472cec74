"""The true state of a session under held control: links, closest pairs, ledger, frames."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property

import numpy as np

from flocking.arrays import Array
from flocking.engine.fixed_step.step_checks import ENERGY_ROUNDING, check_ledger, ledger_rule
from flocking.engine.protocol.body_chains import of_points
from flocking.engine.reference.infinite_starts import infinite_start
from flocking.engine.runs.fidelity import Approaches, Fidelity, LedgerRule
from flocking.engine.runs.message_log import NO_LOG
from flocking.engine.tiles import checks
from flocking.engine.tiles.held.held_ledger import at_rest, powers_of
from flocking.engine.tiles.held.held_particles import HeldParticles
from flocking.engine.tiles.held.memory import HeldMemory
from flocking.engine.tiles.law_check import LawCheck
from flocking.engine.tiles.session import TilesSession
from flocking.errors import NotFinite
from flocking.model.state import State
from flocking.model.world.times import NANOSECOND

ON_STEP = 1e-6
"""Share of a step within which a time counts as that of the step: far more than rounding, far less than matters."""


AHEAD = 1.01
"""Ratio of a skin that is wide enough for a time between two steps to the narrowest one: far more than rounding."""


class HeldTruth(TilesSession):
    """A session whose forces are held: what is seen and recorded of its true state."""

    why_no_log: str = ""
    """Why no log of what agents used is kept, in words; empty where one is, or by an engine that keeps none."""
    _memory: HeldMemory
    _particles: HeldParticles

    @property
    def step(self) -> float:  # type: ignore[override]
        """Length of the steps."""
        return self._memory.step_length * NANOSECOND

    @property
    def time(self) -> float:  # type: ignore[override]
        """Time reached."""
        return self._memory.time

    @property
    def steps(self) -> int:  # type: ignore[override]
        """Number of steps until then."""
        return self._memory.steps

    @property
    def _follows(self) -> bool:
        """Whether the law is evaluated on the true state, for the ledger or for memory of true links."""
        return self.options.ledger or any(kind.memory for kind in self._particles.spec.graphs)

    @property
    def _now(self) -> int:
        """Nanoseconds from the start of the last step's end."""
        return self._memory.steps * self._memory.step_length

    # The law on the true state.

    @property
    def _sums_powers(self) -> bool:
        """Whether steps sum the powers that the ledger needs of the forces that act."""
        actuation = self._particles.actuation
        lags = actuation is not None and actuation.lag is not None
        return self.scenario.agents.order == 2 and at_rest(self.scenario) and not lags

    def _powers_of_step(self, end: int) -> Array:
        """Power of the forces that act at the beginning (0) or the end (1) of the last step, twice, shape (2,)."""
        particles = self._particles
        power = float(particles.group_sum(particles.powers[:, end].sum(keepdims=True))[0])
        return np.array([power, power])

    def _look_at_truth(
        self, seconds: float, *, hold: bool = False, stepped: bool = False, adds_row: bool = True
    ) -> None:
        """Evaluate the law on the true state: true links, the closest pair, and a row of the ledger.

        Parameters
        ----------
        seconds
            Time from the start.
        hold
            Whether links stay as they are.
        stepped
            Whether a step has just ended and nothing has changed since.
        adds_row
            Whether the ledger is complete, so that it has a row.
        """
        particles, t = self._particles, self.scenario.start.t + seconds
        length = seconds - self._memory.looked
        self._memory.farthest = max(self._memory.farthest, 2.0 * particles.top_speed * length)
        self._guarded(lambda: particles.require_lists(self.step))
        top = particles.top_speed
        # Accelerations under the law are needed only where the ledger takes powers in a frame that moves, velocities
        # under the law of agents of order 1 always.
        writes = self.options.ledger and (self.scenario.agents.order == 1 or not at_rest(self.scenario))
        particles.evaluate(t, hold=hold, writes=writes)
        particles.top_speed = top
        self.records.closest_linked = checks.closest_pair(particles, self.records.closest_linked, t, particles.X)
        if particles.lost is not None:
            self._memory.ledger_ends, particles.lost = (
                min(self._memory.ledger_ends, self.scenario.start.t + self._memory.looked),
                None,
            )
        if self.options.ledger:
            summed = stepped and self._sums_powers
            powers = self._powers_of_step(1) if summed else powers_of(self.scenario, particles, t, lawful=True)
            self._memory.ledger.look(particles, powers, length, jumps=not hold)
            if adds_row:
                self._add_row(seconds)
        self._memory.looked = seconds

    def _add_row(self, seconds: float) -> None:
        t = self.scenario.start.t + seconds
        if t > self._memory.ledger_ends:
            return
        unlinked = self.scenario.energy.unlinked
        departed = float(self._memory.ledger.integrals[3])
        self.records.add_ledger_row(t, self._memory.ledger.in_form, self._particles.everyone, unlinked, departed)
        if not seconds and not np.isfinite(self.records.trace[-1][1]):
            raise infinite_start(self.scenario, self.scenario.start, self.records.trace[-1][1])
        eps = float(np.finfo(self._particles.dtype).eps)
        sums = self._memory.ledger.sums
        scale = abs(sums["pairs"]) + abs(sums["bodies"]) + sums["kinetic"]
        first, last = self.records.first, self.records.trace[-1]
        if first is not None and last[0] > first[0] and self.options.ledger_at == "steps":
            rounding = ENERGY_ROUNDING * eps * scale
            needed = check_ledger(
                self.step, first, last, order=2, rounding=rounding, time=t,
                of_places=lambda: self._law_check.energy_rounding(self._particles, t),
            )  # fmt: skip
            self.records.energy_rounding = max(self.records.energy_rounding, needed)

    @cached_property
    def _law_check(self) -> LawCheck:
        return LawCheck(of_points(self.scenario), self._particles.dtype, motion=False, refuses=False)

    # States.

    @contextmanager
    def _moved_by(self, offset: float) -> Iterator[None]:
        """The particle arrays as they are some time after the last step, with lists that hold then."""
        particles = self._particles
        if offset <= self.step * ON_STEP:
            self._guarded(lambda: particles.require_lists(self.step))
            yield
            return
        target = np.empty_like(particles.agents)
        # A force that has just begun to act may make agents faster than they were.
        ahead = offset * max(particles.top_speed, particles.coast(offset, target))
        if particles.moving and particles.displacement.bound + 2.0 * ahead > particles.displacement.allowed:
            self._guarded(lambda: particles.rebuild(self.step))
            if 2.0 * ahead > particles.displacement.allowed:
                wide = particles.displacement.skin * AHEAD * 2.0 * ahead / particles.displacement.allowed
                self._guarded(lambda: particles.rebuild(self.step, skin=wide))
            target = np.empty_like(particles.agents)
            particles.coast(offset, target)
        agents = particles.agents
        particles.agents = target
        try:
            yield
        finally:
            particles.agents = agents
            if particles.actuation is not None:
                particles.actuation.seen = None

    def _offset(self) -> float:
        return self.time - self.scenario.start.t - self._now * NANOSECOND

    def _seen(self) -> tuple[Array, Array, dict[str, Array]]:
        particles, actuation = self._particles, self._particles.actuation
        q, p = particles.in_order(particles.X[: particles.m]), particles.in_order(particles.X[particles.m :])
        columns = {} if actuation is None else actuation.columns(particles.ids)
        return q, p if self.scenario.agents.order == 2 else np.zeros_like(p), columns

    @property
    def state(self) -> State:
        """State at the session's time; includes the link matrix for at most 2,000 agents."""
        with self._moved_by(self._offset()):
            q, p, columns = self._seen()
            return State(q, p, self.time, self._links(p), columns)

    def accelerations(self) -> Array:
        """Rates of change of the velocities, shape (N, m); of agents of order 1 their velocities."""
        particles, body = self._particles, self.scenario.agents
        with self._moved_by(self._offset()):
            force = particles.in_order(particles.seen_force)
        if body.order == 1:
            return force
        n = particles.n
        masses = np.broadcast_to(np.asarray(body.masses, dtype=np.float64), n)[:, None]
        damping = np.broadcast_to(np.asarray(body.damping, dtype=np.float64), n)[:, None]
        return np.asarray((force - damping * self.state.p) / masses)

    def _record_frames(self, ahead: float) -> None:
        """Frames that are due until ``ahead`` after the last step, before what falls on that time."""
        base, records = self.scenario.start.t + self._now * NANOSECOND, self.records
        while records.count < len(records.frame_times):
            t = float(records.frame_times[records.count])
            if t - base > ahead + self.step * ON_STEP:
                return
            self._frame(t, max(t - base, 0.0))

    def _frame(self, t: float, offset: float) -> None:
        particles = self._particles
        if not (self.options.keep_frames or self.options.observe):
            self.records.skip()
            return
        with self._moved_by(offset):
            q, p, columns = self._seen()
            if not (np.isfinite(q).all() and np.isfinite(p).all()):
                raise NotFinite("The state became infinite or NaN.", time=t)
            checks.resolution(particles, q, t)
            observed = None
            if self.options.observe:
                from flocking.engine.tiles.observables import observe

                observed = observe(particles, t, p)
            self.records.frame(t, q, p, self._links(p), observed=observed, columns=columns)

    @property
    def about(self) -> dict[str, object]:
        """Entries of the run's provenance."""
        o, base = self.options, super(TilesSession, self).about
        found = base | {
            "step": self.step, "scheme": self.scheme, "precision": o.precision,
            "rebuilds": self._particles.search.rebuilds,
            "switches": "not recorded", "farthest": self._memory.farthest, "world": self.scenario.imperfections,
        }  # fmt: skip
        if self.options.ledger:
            found["ledger at"] = o.ledger_at
        if self.why_no_log:
            found[NO_LOG] = self.why_no_log
        if np.isfinite(self._memory.ledger_ends):
            found["ledger ends"] = self._memory.ledger_ends
        return found

    @property
    def fidelity(self) -> Fidelity:
        """Links are followed at steps; a ledger as fine as these is held to a share of the energy moved."""
        rule = ledger_rule(self.records) if self.options.ledger_at == "steps" else LedgerRule()
        approaches = Approaches("linked", self._memory.farthest) if self._follows else Approaches()
        return Fidelity(self.engine, approaches=approaches, ledger=rule, fixed_step=self.step)
