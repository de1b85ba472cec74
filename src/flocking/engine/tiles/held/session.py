"""Session of the tiled engine under held control: events at steps, and motion in closed form between them."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np

from flocking.arrays import Links, Numbers32
from flocking.engine import interruption
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.kernels.headings import turns_too_often
from flocking.engine.protocol.body_chains import of_points, point_of
from flocking.engine.protocol.session import Packed, Session, Stored, end_of_slice, time_to_reach
from flocking.engine.protocol.waiting_forces import put
from flocking.engine.protocol.world import check_nanoseconds
from flocking.engine.tiles import automatic_step, checks
from flocking.engine.tiles.held.checkpoint import pack_held, packed_options, recall_held
from flocking.engine.tiles.held.held_ledger import powers_of
from flocking.engine.tiles.held.held_particles import HeldParticles
from flocking.engine.tiles.held.log_room import HeldRecorder, check_log_size, why_no_log
from flocking.engine.tiles.held.memory import HeldMemory
from flocking.engine.tiles.held.step_grid import held_step
from flocking.engine.tiles.held.true_state import ON_STEP, HeldTruth
from flocking.engine.tiles.kernels.spec import check_supported
from flocking.engine.tiles.options import TilesOptions
from flocking.engine.tiles.session import MOST_STEPS
from flocking.errors import InvalidInput, NotFinite, SimulationError, UnsupportedLaw
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.world.control import Held
from flocking.model.world.times import NANOSECOND


class HeldTilesSession(HeldTruth):
    """Session of the tiled engine under held control.

    Parameters
    ----------
    scenario
        The scenario to simulate; its control is held.
    options
        Options of the engine.

    Raises
    ------
    UnsupportedLaw
        If a part of the scenario is not supported.
    InvalidInput
        If a time of the world is no whole number of steps.
    TooCrowded
        If the neighbour lists would not fit in memory.
    """

    keeps_log: ClassVar[bool] = True
    """Whether it can keep a log of what agents use when they act."""
    _particles: HeldParticles

    def __init__(self, scenario: Scenario, options: TilesOptions | None = None) -> None:
        check_nanoseconds(scenario)
        check_supported(scenario)
        options = (options or TilesOptions()).of_order(scenario.agents.order)
        self.why_no_log = why_no_log(scenario, options) if self.keeps_log else ""
        options = replace(options, log=self.keeps_log and not self.why_no_log)
        self._set_up(scenario, options)
        checks.resolution(self._particles, scenario.start.q, self.time)
        memory = self._memory
        memory.step_length = held_step(scenario, self.options.step, self._automatic_step())
        if scenario.t_end - scenario.start.t > MOST_STEPS * self.step:
            raise InvalidInput(
                "TilesSession", "step", f"must reach the end in {MOST_STEPS:.0e} steps", self.step, "Give a longer one."
            )
        if self._follows:
            self._look_at_truth(0.0)
        self._record_frames(0.0)

    def _set_up(self, scenario: Scenario, options: TilesOptions, threads: int | None = None) -> None:
        """Begin with the state of the start; what a checkpoint holds may replace it."""
        self.scenario, self.options, self.plant = scenario, options, None
        self.workers = Workers(threads or options.threads)
        records = HeldRecorder(scenario, options)
        # Kernels see the points that the law sees; what their bodies make of forces comes after.
        particles = self._new_particles(of_points(scenario), scenario.start)
        self._memory = HeldMemory(options, particles, records, 1, scenario.start.t)
        self._particles, self.records = particles, records
        if point_of(scenario.agents) is not scenario.agents:
            particles.actuation = particles.new_actuation(scenario.agents, scenario.start)
            particles.exert(0, gusts=False)
        if scenario.agents.order == 1:
            self._particles.agents[:, self._particles.m :] = 0.0
        if self._particles.store is not None:
            speed = float(np.linalg.norm(scenario.start.p, axis=1).max()) if scenario.agents.order == 2 else 0.0
            self._particles.store.see_speed(0, np.zeros(self._particles.m), speed)
        control = scenario.control
        assert isinstance(control, Held)
        ticks = control.schedule(scenario.start.n)
        self._ticks = ticks.of_one if ticks.alike else ticks
        latencies = control.latencies(scenario.start.n)
        self._latency = latencies if np.ptp(latencies) else latencies[:1]

    def _new_particles(self, scenario: Scenario, state: State) -> HeldParticles:
        return HeldParticles(
            scenario, state, self._spec(scenario), self.workers, self.options.lists_limit, self.options.skin,
            logs=bool(self.options.log),
        )  # fmt: skip

    @property
    def scheme(self) -> str:
        """``held``: the motion between two steps has a closed form."""
        return "held"

    def _automatic_step(self) -> float:
        """The longest step that is chosen: any where nothing is integrated or followed beside the motion."""
        if not self._follows:
            return np.inf
        self._guarded(lambda: self._particles.require_lists(0.0))
        return automatic_step.choose(
            self._particles, self.scenario, "euler" if self.scenario.agents.order == 1 else "verlet"
        )

    @classmethod
    def longest_step(cls, scenario: Scenario, options: TilesOptions) -> float:
        """The longest step that is chosen for a scenario in seconds, infinite for any.

        Parameters
        ----------
        scenario
            Its control is held.
        options
            Options of the engine.
        """
        session = cls.__new__(cls)
        session._set_up(scenario, options)
        return session._automatic_step()

    # Steps.

    def advance(self, to: float, seconds: float = np.inf) -> None:
        """Take steps until time ``to``, or for ``seconds`` of wall time; frames lie anywhere between."""
        to = time_to_reach("TilesSession", to, self.time, self.step * ON_STEP)
        stop = end_of_slice("TilesSession", seconds)
        try:
            while self._reaches_next(to):
                interruption.check()
                self._take_step()
                if time.monotonic() >= stop:
                    return
            self._go_on_to(to)
        except SimulationError as error:
            error.run = self.run(str(error))
            raise

    def _reaches_next(self, to: float) -> bool:
        """Whether the next step ends at time ``to`` or before."""
        return self.scenario.start.t + self._now * NANOSECOND + self.step <= to + self.step * ON_STEP

    def _take_step(self) -> None:
        """Act, and move to the end of the next step."""
        self._act()
        self._record_frames(self.step * (1.0 - 2.0 * ON_STEP))
        self._guarded(self._coast)
        self._memory.steps += 1
        self._memory.time = self.scenario.start.t + self._now * NANOSECOND
        self._arrive()

    def _go_on_to(self, to: float) -> None:
        """Go on from the end of a step to a time before that of the next."""
        ahead = to - self.scenario.start.t - self._now * NANOSECOND
        if ahead > self.step * ON_STEP:
            self._act()
            self._record_frames(ahead)
            self._memory.time = to

    def _coast(self) -> None:
        particles = self._particles
        before = particles.top_speed
        particles.coast(self.step)
        if self.options.ledger and self._sums_powers and self._memory.looked == self._now * NANOSECOND:
            self._memory.ledger.act(self._powers_of_step(0))
        if particles.store is not None:
            frame = particles.displacement.velocity.astype(np.float64)
            particles.store.see_speed(self._now, frame, max(before, particles.top_speed))
        if not np.isfinite(particles.top_speed):
            particles.agree(self._check_finite)
            raise NotFinite("Velocities became infinite or NaN.", time=self.time)

    def _check_finite(self) -> None:
        particles = self._particles
        heading = None if particles.actuation is None else particles.actuation.heading
        lost = np.zeros(0, int) if heading is None else np.flatnonzero(np.isnan(heading[: particles.n]).any(axis=1))
        if len(lost) and np.isfinite(particles.X[:, lost]).all():
            raise turns_too_often(self.time, tuple(sorted(particles.ids[lost].tolist())[:10]))
        bad = np.flatnonzero(~np.isfinite(particles.X[:, : particles.n]).all(axis=0))
        if len(bad):
            raise NotFinite(
                "Velocities or positions became infinite or NaN.", time=self.time,
                agents=tuple(sorted(int(i) for i in particles.ids[bad[:10]])),
            )  # fmt: skip

    def _arrive(self) -> None:
        """The end of a step: the law on the true state where it is due, and a frame that falls on it."""
        self._memory.acted = False
        frames, records = self.records.frame_times, self.records
        frame_due = records.count < len(frames) and frames[records.count] <= self.time + self.step * ON_STEP
        if self._follows and (
            self.options.ledger_at == "steps" or frame_due or self._due().any() or self.reached(self.scenario.t_end)
            or bool(self._memory.waiting and self._memory.waiting[0][0] == self._now) or self._gusts_begin()
        ):  # fmt: skip
            self._look_at_truth(self._now * NANOSECOND, stepped=True)
        self._record_frames(0.0)

    def _due(self) -> Links:
        """Who acts at the end of the last step, shape (N,), or (1,) where all act together."""
        return self._ticks.falls_on(self._now)

    def _gusts_begin(self) -> bool:
        """Whether a gust begins at the end of the last step."""
        actuation = self._particles.actuation
        return actuation is not None and actuation.gusts_begin(self._now)

    def _act(self) -> None:
        """What falls on the time of the last step: gains, controls, and forces that begin to act."""
        if self._memory.acted:
            return
        self._memory.acted = True
        now, particles = self._now, self._particles
        t = self.scenario.start.t + now * NANOSECOND
        self._change_gains(t, now * NANOSECOND)
        particles.measure(now)
        tick = self._due()
        begun = self._tick(t, tick) if tick.any() else np.zeros_like(particles.acting)
        # Not whether one of the agents here is among them: what follows may be for all ranks.
        changed = bool((tick & (self._latency == 0)).any())
        while self._memory.waiting and self._memory.waiting[0][0] == now:
            _, agents, force = self._memory.waiting.pop(0)
            places = particles.places_of(agents)
            particles.desired[:, places] = force.T
            begun[places] = 1
            changed = True
        gusts = self._gusts_begin()
        if changed or gusts:
            particles.exert(now, begun, gusts=gusts)
            changed = True
        lags = particles.actuation is not None and particles.actuation.lag is not None
        begins = changed or (lags and self._memory.looked == now * NANOSECOND)
        if begins and self.options.ledger and not self._sums_powers:
            self._memory.ledger.act(powers_of(self.scenario, particles, t, step=self.step))

    def _tick(self, t: float, tick: Links) -> Numbers32:
        """Let agents marked in ``tick``, shape (N,) or (1,), compute their controls, which act after the latency.

        Returns
        -------
        array
            1 at the places of those whose forces act at once, shape (size,).
        """
        particles, now = self._particles, self._now
        self._guarded(lambda: particles.require_lists(self.step))
        if not particles.known_in_reach(now):
            self._guarded(lambda: particles.rebuild(self.step))
        particles.acting[: particles.n] = 1 if len(tick) == 1 else tick[particles.ids[: particles.n]]
        particles.all_act = len(tick) == 1
        before = particles.desired.copy() if self._latency.any() else None
        particles.act(t, now)
        if self.records.log is not None:
            self._log_act(tick)
        if before is None:
            return particles.acting.copy()
        begun = np.zeros_like(particles.acting)
        agents, n = particles.numbers_of(tick), self.scenario.start.n
        late = np.broadcast_to(self._latency, n)
        # Of all agents: ranks that have none of some latency wait for them as well.
        for latency in np.unique(late[np.broadcast_to(tick, n)]).tolist():
            mine = agents[late[agents] == latency]
            places = particles.places_of(mine)
            if latency:
                put(self._memory.waiting, now + latency, mine, particles.desired[:, places].T.copy())
                particles.desired[:, places] = before[:, places]
            else:
                begun[places] = 1
        return begun

    def _log_act(self, tick: Links) -> None:
        """Log what agents marked in ``tick`` have just used, and the forces that they computed."""
        particles, log = self._particles, self.records.log
        assert log is not None
        agents = particles.numbers_of(tick)
        places = particles.places_of(agents)
        store, known = particles.store, particles.leaders
        measured = store is not None and store.messages.self_known == "measured"
        own = store.own_numbers(self._now, agents) if store is not None and measured else None
        assert particles.logged is not None
        counts, uses = particles.logged.entries(
            agents, places, particles.ids, own, None if known is None else known.newest[places]
        )
        log.acts(self._now, agents, particles.desired[:, places].T.astype(np.float64), counts, uses)
        check_log_size(log.nbytes, self.time)

    def _change_gains(self, t: float, seconds: float) -> None:
        """Take scheduled gains; what they change of the energy is a jump of the ledger."""
        last, slack = t - self.step, self.step * ON_STEP
        times = (s for term in self.scenario.law.body_terms for s in term.switch_times(last, t + self.step))
        if not any(last + slack < s <= t + slack for s in times):
            return
        before = self._memory.ledger.energy
        if self.options.ledger:
            self._look_at_truth(seconds)
            before = self._memory.ledger.energy
        self._particles.pass_switch_time(self.scenario, t + slack)
        if self.options.ledger:
            # Without the jump the ledger would not close.
            self._look_at_truth(seconds, hold=True, adds_row=False)
            self._memory.ledger.jumped += self._memory.ledger.energy - before
            self._add_row(seconds)

    # Saving.

    def pack(self) -> Packed:
        """Everything needed to continue bit for bit, without the scenario and the records on disk."""
        return pack_held(self._memory)

    def moment(self) -> Callable[[], Session]:
        """A function that opens a session in the current state of this one."""
        return Session.moment(self)

    @classmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> HeldTilesSession:
        """Restore a session from its packed form, with another number of ``threads`` if ``changes`` contains it."""
        threads = changes.get("threads")
        session, options = cls.__new__(cls), packed_options(packed)
        if not options.log:
            # A run that was to keep none looks like one of an earlier version, which kept none.
            session.why_no_log = why_no_log(stored.scenario, replace(options, log=None)) or "log=False"
        session._set_up(stored.scenario, options, threads if isinstance(threads, int) else None)
        recall_held(packed, stored, session._memory)
        # Gains change before the controls of the same time.
        share = ON_STEP if session._memory.acted else -ON_STEP
        t = stored.scenario.start.t + session._now * NANOSECOND + share * session.step
        session._particles.pass_switch_time(stored.scenario, max(t, stored.scenario.start.t))
        return session

    # What others ask.

    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Not possible: forces that are held belong to the past of this run.

        Raises
        ------
        UnsupportedLaw
            Always.
        """
        raise UnsupportedLaw(
            "engine='tiles' replaces neither law nor state under held control. Start another run from run.state(-1)."
        )
