"""The one entry: start a session, or run a scenario to its end."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from flocking.engine.exact import ExactSession
from flocking.engine.interruption import Deferred
from flocking.engine.run import Run
from flocking.errors import InvalidInput, SimulationError, StorageError
from flocking.model.law import Law, Scenario

if TYPE_CHECKING:
    from flocking.engine.lammps.session import LammpsSession
    from flocking.engine.saving import Saving
    from flocking.engine.tiles.session import TilesSession

ENGINES = ("auto", "exact", "tiles", "lammps")
QUIET_SECONDS = 2.0


def start(
    scenario: Scenario, engine: str = "auto", *, plant: Law | None = None, **options: Any
) -> ExactSession | TilesSession | LammpsSession:
    """Start a session: a simulation that is advanced, looked at and changed step by step.

    Parameters
    ----------
    scenario
        What to simulate.
    engine
        ``"exact"``, ``"tiles"`` for large groups, ``"lammps"`` for a cluster, or ``"auto"`` to choose (the exact one).
    plant
        The law the agents really obey, for tests of an audit; the scenario's law when absent.
    options
        For ``"tiles"``: step, scheme, precision and more, see `flocking.engine.tiles.session.TilesOptions`; for
        ``"lammps"``: step and more, see `flocking.engine.lammps.session.LammpsOptions`.

    Raises
    ------
    InvalidInput
        When the engine or an option is unknown, or the scenario cannot be started.
    UnsupportedLaw
        When the engine cannot run a part of the law.
    """
    if not isinstance(scenario, Scenario):
        raise InvalidInput("start", "scenario", "must be a Scenario", scenario)
    if not isinstance(engine, str) or engine not in ENGINES:
        raise InvalidInput("start", "engine", f"must be one of {', '.join(ENGINES)}", engine)
    if engine == "tiles":
        from flocking.engine.tiles.session import TilesSession, tiles_options

        return TilesSession(scenario, tiles_options(options), plant=plant)
    if engine == "lammps":
        from flocking.engine.lammps.session import LammpsSession, lammps_options

        return LammpsSession(scenario, lammps_options(options), plant=plant)
    if options:
        raise InvalidInput(
            "start", sorted(options)[0], "is an option of engine='tiles' or 'lammps' alone", options[sorted(options)[0]]
        )
    return ExactSession(scenario, plant=plant)


def simulate(
    scenario: Scenario,
    *,
    engine: str = "auto",
    save: str | Path | None = None,
    progress: bool = True,
    plant: Law | None = None,
    **options: Any,
) -> Run:
    """Run a scenario to its end.

    Parameters
    ----------
    scenario
        What to simulate.
    engine
        ``"exact"``, ``"tiles"`` for large groups, ``"lammps"`` for a cluster, or ``"auto"`` to choose (the exact one).
    save
        New or empty folder to write the run to while it goes on, see `flocking.engine.resuming.resume`;
        nothing is written when absent. The tiled engine writes at the end, or when it is interrupted.
    progress
        Show a progress bar once the run takes longer than two seconds.
    plant
        The law the agents really obey, for tests of an audit; the scenario's law when absent.
    options
        For ``"tiles"``: step, scheme, precision and more, see `flocking.engine.tiles.session.TilesOptions`; for
        ``"lammps"``: step and more, see `flocking.engine.lammps.session.LammpsOptions`.

    Returns
    -------
    Run
        Frames, switches and ledger. After Ctrl-C it holds what was computed, and its status says so.

    Raises
    ------
    SimulationError
        When the run cannot go on; its ``run`` holds what was computed until then.
    InvalidInput
        When the scenario cannot be started.
    StorageError
        When the run cannot be saved; its ``run`` holds what was computed until then.
    """
    if isinstance(engine, str) and engine == "tiles":
        options.setdefault("tell", progress)
    session = start(scenario, engine, plant=plant, **options)
    if session.engine == "lammps":
        from flocking.engine.lammps.run import drive_ranks

        return drive_ranks(cast("LammpsSession", session), save=save, progress=progress)
    shared = cast("ExactSession | TilesSession", session)
    if save is None:
        return drive(shared, progress=progress)
    if not isinstance(session, ExactSession):
        return _drive_and_write(session, save, progress=progress)
    from flocking.engine.saving import Saving

    with Saving.create(save, session) as saving:
        return drive(session, progress=progress, saving=saving)


def _drive_and_write(session: Any, folder: str | Path, *, progress: bool) -> Run:
    from flocking.engine.storage import write_run

    try:
        run = drive(session, progress=progress)
    except SimulationError as error:
        if error.run is not None:
            write_run(error.run, folder)
        raise
    write_run(run, folder)
    return run


def drive(session: ExactSession | TilesSession, *, progress: bool, saving: Saving | None = None) -> Run:
    """Advance a session to the end of its scenario, and save it on the way.

    Raises
    ------
    SimulationError, StorageError
        When the run cannot go on or cannot be saved; ``run`` of the error holds what was computed until then.
    """
    scenario = session.scenario
    status = "finished"
    deferred = Deferred()
    try:
        with deferred, Progress(progress, scenario) as bar:
            for t in stops(scenario, session.time, often=saving is not None):
                session.advance(t)
                bar.show(t, session.steps * scenario.start.n)
                if saving is not None and t < scenario.t_end:
                    saving.keep()
            if saving is not None:
                saving.finish(status)
    except KeyboardInterrupt:
        status = f"interrupted at t = {session.time:.9g}"
        if saving is not None:
            saving.interrupt(status)
    except SimulationError as error:
        if saving is not None:
            try:
                saving.finish(str(error))
            except StorageError as fault:
                fault.run = error.run
                raise
        raise
    except StorageError as error:
        error.run = session.run(str(error))
        raise
    if deferred.late:
        # It came after the last step: the run is complete and saved, the caller is to stop.
        raise KeyboardInterrupt
    return session.run(status)


def stops(scenario: Scenario, now: float, *, often: bool) -> list[float]:
    """Times at which a session is looked at on its way to the end of its scenario; often: also at its frames."""
    times = np.linspace(scenario.start.t, scenario.t_end, 101)
    if often:
        times = np.union1d(times, scenario.frame_times)
    return [float(t) for t in times if now < t < scenario.t_end] + [scenario.t_end]


class Progress:
    """A progress bar that stays away from short runs."""

    def __init__(self, wanted: bool, scenario: Scenario) -> None:
        self._wanted = wanted
        self._scenario = scenario
        self._begin = time.monotonic()
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def show(self, t: float, agent_steps: int) -> None:
        """Report the time reached and how many agents made how many steps."""
        if not self._wanted or time.monotonic() - self._begin < QUIET_SECONDS:
            return
        if self._bar is None:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

            speed = TextColumn("{task.fields[rate]}")
            columns = (TextColumn("{task.description}"), BarColumn(), speed, TimeRemainingColumn())
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            name = self._scenario.name or "simulation"
            self._task = self._bar.add_task(name, total=self._scenario.t_end - self._scenario.start.t, rate="")
            self._bar.start()
        rate = f"{agent_steps / (time.monotonic() - self._begin):.3g} agent-steps/s"
        self._bar.update(self._task, completed=t - self._scenario.start.t, rate=rate)
