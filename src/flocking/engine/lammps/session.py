"""Session of the pair styles of LAMMPS on any number of MPI ranks; all methods are collective."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from flocking.arrays import Array, Forces
from flocking.engine import interruption
from flocking.engine.fixed_step.energy_jumps import check_no_energy_jump
from flocking.engine.fixed_step.passing_pairs import check_passing, singular_reach
from flocking.engine.fixed_step.step_checks import ledger_rule
from flocking.engine.fixed_step.step_counts import STEP_ROUNDING, is_reached, steps_between
from flocking.engine.lammps import library
from flocking.engine.lammps.atoms import Atoms, LammpsError
from flocking.engine.lammps.deck import Deck, make_deck
from flocking.engine.lammps.images import MOST_IMAGES
from flocking.engine.lammps.law_check import LawCheck, check_apart, check_not_crowded
from flocking.engine.lammps.ledger import observed_state
from flocking.engine.lammps.options import PAIR_STYLES, LammpsOptions
from flocking.engine.lammps.ranks import Ranks
from flocking.engine.lammps.records import LammpsRecorder
from flocking.engine.lammps.restart import Restart, packed_restart, unpacked
from flocking.engine.lammps.steps import check_ledger_rows, check_strides, chosen_step, step_too_large
from flocking.engine.protocol.session import Packed, Session, Stored, end_of_slice, time_to_reach
from flocking.engine.protocol.world import check_world
from flocking.engine.reference.plants import check_plant
from flocking.engine.runs.fidelity import Approaches, Fidelity
from flocking.errors import SimulationError, UnsupportedLaw
from flocking.model.law import Law, Scenario
from flocking.model.state import State

STEPS_BEYOND = 1000
"""Number of steps to the next stop after the end of the scenario."""
GROWTH = 1.2
"""Growth of the group in a batch of steps beyond which batches become shorter; cells fit a group that has grown by a
fifth."""
LONGEST_BOUT = 1024
"""Largest growth of a flock, and largest number of steps, between two checks of its box."""


NO_CELLS = "neighbor bins"
"""The message of LAMMPS where no search cells fit the box."""


class LammpsSession(Session):
    """Session of the LAMMPS engine. Its time is always the end of a step.

    Parameters
    ----------
    scenario
        The scenario to simulate; the same on all ranks.
    options
        Options of the engine.
    plant
        The law that agents follow, over the graphs of the scenario's law, for tests of the ledger; the scenario's law
        by default.
    restart
        State to continue from; the start of the scenario by default.

    Raises
    ------
    UnsupportedLaw
        If a part of the scenario has no translation.
    EngineMissing
        If LAMMPS or MPI is not installed.
    """

    engine = "lammps"
    saves_when_interrupted = True
    records: LammpsRecorder
    options: LammpsOptions

    def __init__(
        self, scenario: Scenario, options: LammpsOptions, *, plant: Law | None = None, restart: Restart | None = None
    ) -> None:
        check_world(self.engine, scenario)
        self.scenario, self.plant = scenario, plant
        declared = make_deck(scenario, options.skin)
        if options.rows(scenario.start.n):
            check_no_energy_jump(scenario.law)
        if plant is not None:
            check_plant("LammpsSession", scenario.law, plant)
        self.deck: Deck = declared if plant is None else make_deck(scenario.with_(law=plant), options.skin)
        check_not_crowded(scenario)
        check_apart(scenario)
        self._judge: LawCheck | None = None
        self.ranks = Ranks(library.communicator())
        self.time, self.steps = scenario.start.t, 0
        break_energies = [part.break_energy for part in declared.parts]
        self.records = LammpsRecorder(scenario, break_energies, observe=options.observe)
        self._plan = (self.time, self.time, 1, 1)
        self._step = 0.0
        self._at_row = True
        self._bout = 1
        self._longest_bout = LONGEST_BOUT if scenario.space.is_open else MOST_IMAGES
        self._sound = scenario.start
        self._judged = 0
        with self.ranks.bound():
            self.options = replace(
                options, forces=PAIR_STYLES, step=self._time_step(options), ledger=options.rows(scenario.start.n)
            )
            self.atoms = Atoms(self.deck, self.ranks, options.keep_log or "none")
            self._begin(restart)
            if restart is None:
                self._record()

    def _time_step(self, options: LammpsOptions) -> float:
        """The given step, or one chosen by the first rank."""
        step = options.step
        if step is None:
            step = self.ranks.comm.bcast(self.ranks.alone(lambda: chosen_step(self.scenario, self.scenario.start)))
        return float(step)

    def _begin(self, restart: Restart | None) -> None:
        try:
            state = self.scenario.start if restart is None else restart.state(self.deck.dimension)
            self.atoms.begin(self.step, state, 0 if restart is None else restart.steps)
        except LammpsError as error:
            self._end_alone(error, f"LAMMPS cannot start this run: {error}.")
            raise SimulationError(
                f"LAMMPS cannot start this run: {error}.", time=self.time, agents=error.agents
            ) from None
        if restart is not None:
            self.time, self.steps, self._plan = restart.time, restart.steps, restart.plan
            self.atoms.set_forces(restart.agents[:, 6:])

    @property
    def team(self) -> Ranks:
        """The ranks of the job."""
        return self.ranks

    def reached(self, to: float) -> bool:
        """Whether time ``to`` is reached, up to the rounding of a step."""
        return is_reached(self.time, to, self.step)

    @property
    def step(self) -> float:
        """The largest time step."""
        assert self.options.step is not None
        return self.options.step

    @property
    def rows(self) -> int:
        """Steps between two rows of the ledger; 0 for no ledger."""
        assert self.options.ledger is not None
        return self.options.ledger

    def _end_alone(self, error: LammpsError, message: str) -> None:
        """Abort the job if only this rank has an error; the others would wait forever."""
        if error.alone and self.ranks.size > 1:
            self.ranks.end(message)

    def _command(self, *lines: str) -> None:
        """Execute LAMMPS commands during the run; errors are then reported as too large a step."""
        try:
            self.atoms.command(*lines)
        except LammpsError as error:
            if NO_CELLS in str(error):
                self._end_alone(error, str(error))
                raise SimulationError(
                    f"LAMMPS cannot find neighbours: since t = {self._sound.t:.6g} an agent went too far away for its "
                    "search cells. Use engine='tiles', whose cells do not depend on the extent of the group.",
                    time=self.time,
                ) from None
            failure = step_too_large(self.scenario, self._sound, self.step, f"LAMMPS reported: {error}", self.time)
            self._end_alone(error, str(failure))
            raise failure from None

    def gathered_state(self) -> State | None:
        """The state on the first rank, None elsewhere.

        Raises
        ------
        StepTooLarge
            On all ranks, when an agent is lost or its state is not finite.
        """
        rows = self.atoms.gathered("x", "v")
        self.ranks.alone(lambda: None if rows is None else self._check_finite(rows))
        if rows is None:
            return None
        m = self.deck.dimension
        p = rows[:, 3 : 3 + m]
        # For agents of order 1 LAMMPS stores the velocity of the last step; it is not part of the state.
        return State(rows[:, :m], p if self.deck.order == 2 else np.zeros_like(p), self.time)

    def _check_finite(self, rows: Array) -> None:
        bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))[:10]
        if len(bad):
            why = "agents were lost or became infinite or NaN"
            raise step_too_large(self.scenario, self._sound, self.step, why, self.time, tuple(map(int, bad)))

    @property
    def state(self) -> State:
        """State at the session's time, on every rank."""
        found = self.ranks.comm.bcast(self.gathered_state())
        return State(found.q, found.p, found.t)

    def forces(self) -> Forces | None:
        """Forces on all agents, shape (N, m), on the first rank; None elsewhere."""
        rows = self.atoms.gathered("f")
        return None if rows is None else rows[:, : self.deck.dimension]

    def _fitted(self) -> float:
        """Adapt the cells to the box; returns the growth of the box since the last call."""
        try:
            return self.atoms.fit_cells()
        except LammpsError as error:
            raise SimulationError(
                f"LAMMPS cannot find neighbours: {error}.", time=self.time, agents=error.agents
            ) from None

    def _next_stop(self) -> float:
        times = [self.scenario.t_end] if self.time < self.scenario.t_end else []
        times += [float(t) for t in self.records.frame_times if t > self.time][:1]
        return min(times, default=self.time + STEPS_BEYOND * self.step)

    def advance(self, to: float, seconds: float = math.inf) -> None:
        """Take steps until the session's time is at or just beyond ``to``, or for ``seconds`` of wall time.

        The first rank decides for all when the time is over, and whether Ctrl-C was pressed.
        """
        to = time_to_reach(type(self).__name__, to, -math.inf)
        stop = end_of_slice(type(self).__name__, seconds)
        try:
            with self.ranks.bound():
                while not self.reached(to):
                    noted = interruption.noted()
                    if noted if self.ranks.size == 1 else self.ranks.comm.bcast(noted):
                        interruption.check()
                        raise interruption.Noted
                    self._take_steps(to)
                    self._record()
                    over = time.monotonic() >= stop
                    if over if self.ranks.size == 1 or seconds == math.inf else self.ranks.comm.bcast(over):
                        return
        except SimulationError as error:
            error.run = self.run(str(error))
            raise

    def _take_steps(self, to: float) -> None:
        start, end, count, index = self._plan
        if index >= count:
            start, end = self.time, self._next_stop()
            count, index = steps_between(start, end, self.step), 0
        h = (end - start) / count
        rows = self.rows or count
        row_end = min(count, (index // rows + 1) * rows)
        steps_left = math.ceil((to - self.time) / h - STEP_ROUNDING)
        todo = max(1, min(row_end - index, steps_left, self._bout, self._longest_bout))
        if h != self._step:
            self._step = h
            self._command(f"timestep {h!r}")
        # Without a setup: forces that depend on velocities remain those of half a step before.
        self._command(f"run {todo} pre no post no")
        self.atoms.fold_images()
        # The cells are enlarged before a scattering flock has grown far beyond them.
        grown = self._fitted()
        self._bout = max(1, self._bout // 4) if grown > GROWTH else min(2 * self._bout, LONGEST_BOUT)
        self.steps += todo
        index += todo
        self._plan = (start, end, count, index)
        self.time = end if index == count else start + (end - start) * index / count
        self._at_row = index == row_end

    def _record(self) -> None:
        """Add a row to the ledger, and store a frame if one is due."""
        due = self.records.due(self.time)
        if not due and not (self.rows and self._at_row):
            return
        state = self.gathered_state()
        if due and not self.ranks.first:
            self.records.skip()
        judged = self.rows and (due or self._judged == 0 or self.steps >= 2 * self._judged)
        drifting = self.deck.order == 1 and self.scenario.law.singular_at_zero()
        forces = self.atoms.gathered("f") if judged or drifting else None
        self._judged = self.steps if judged else self._judged
        self.ranks.alone(lambda: self._write_down(state, due, forces, judged=bool(judged)))

    def _write_down(self, state: State | None, due: bool, forces: Forces | None, *, judged: bool) -> None:
        """Check a state and record it on the first rank."""
        assert state is not None
        records = self.records
        singular = self.scenario.law.singular_at_zero()
        moving = state.p if self.deck.order == 2 or forces is None else forces[:, : self.deck.dimension]
        pairs = records.ledger.pairs(state) if self.rows or self.options.observe or singular else []
        for some in pairs if singular else []:
            check_strides(state, moving, some, self.step, self.scenario.space)
        if singular:
            reach = singular_reach(self.scenario.law)
            check_passing(state.q, self.step * moving, reach, self.step, time=self.time, space=self.scenario.space)
        if self.rows:
            records.ledger.add(state, pairs)
        if judged and forces is not None:
            self._judge = self._judge or LawCheck(self.scenario, self.deck)
            self._judge.look(state, forces[:, : self.deck.dimension], self._step, fatal=self.plant is None)
        if due:
            records.state_frame(
                state, observed_state(state, pairs[0], self.scenario.space) if self.options.observe else None
            )
            if self.rows:
                needed = check_ledger_rows(
                    records.ledger, self.step, self.rows, self._sound, partial(self._energy_rounding, state)
                )
                records.energy_rounding = max(records.energy_rounding, needed)
        self._sound = state

    def _energy_rounding(self, state: State) -> float:
        """Change of the energy by rounding, needed where the ledger would fail: most runs never ask for it."""
        judge = self._judge or LawCheck(self.scenario, self.deck)
        return judge.energy_rounding(state)

    def restart(self) -> Restart | None:
        """The restart data on the first rank; None elsewhere."""
        with self.ranks.bound():
            agents = self.atoms.gathered("x", "v", "f")
        return None if agents is None else Restart(agents, self.time, self.steps, self._plan)

    def pack(self) -> Packed:
        """The packed restart data on the first rank; empty elsewhere. Collective."""
        restart = self.restart()
        return ({}, {}) if restart is None else packed_restart(restart, self.options)

    @classmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> LammpsSession:
        """Restore a session from its packed form, on any number of ranks; all get the same arguments."""
        restart, options = unpacked(*packed, stored.scenario)
        session = cls(stored.scenario, options, plant=stored.plant, restart=restart)
        run = stored.read()
        session.records.resume(run, session.gathered_state())
        if session.ranks.first and (known := run.fidelity.law) is not None:
            session._judge = LawCheck(session.scenario, session.deck)
            session._judge.gaps.recall(known)
        return session

    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Raise an error: a LAMMPS run has one deck."""
        raise UnsupportedLaw(
            "LAMMPS cannot replace a law or a state during a run. Use engine='tiles' or 'exact', or start a new "
            "session from the session's state."
        )

    def accelerations(self) -> Array:
        """Forces divided by masses, shape (N, m), on every rank; velocities enter as of half a step before.

        For agents of order 1 the forces themselves.
        """
        forces = self.ranks.comm.bcast(self.forces())
        if self.deck.order == 1:
            return np.asarray(forces)
        masses = np.broadcast_to(self.scenario.agents.masses, len(forces))
        return np.asarray(forces / masses[:, None])

    @property
    def about(self) -> dict[str, object]:
        """Entries of the run's provenance."""
        return super().about | library.versions() | {
            "step": self.step, "scheme": "verlet" if self.deck.order == 2 else "euler", "ranks": self.ranks.size,
            "switches": "not recorded",
            "ledger": f"trapezoidal, a row every {self.rows} steps" if self.rows else "none",
            "closest": self._looked,
            **(self._judge.gaps.about if self._judge is not None else {}),
        }  # fmt: skip

    @property
    def _looked(self) -> str:
        return "at the rows of the ledger" if self.rows else "not recorded"

    @property
    def fidelity(self) -> Fidelity:
        """Steps are fixed, switches are not located, and linked pairs are checked at the rows of the ledger."""
        return Fidelity(
            self.engine, approaches=Approaches("linked", math.nan, self._looked), ledger=ledger_rule(self.records),
            fixed_step=self.step, law=self._judge.gaps.agreement if self._judge is not None else None,
        )  # fmt: skip

    def close(self) -> None:
        """Release the memory of LAMMPS."""
        self.atoms.close()


__all__ = ["LammpsOptions", "LammpsSession"]
