"""Start a session, or run a scenario to its end."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

from flocking.engine import interruption
from flocking.engine.driver.progress import Progress, stops
from flocking.engine.driver.registry import check_name, chosen_engine, engine_named, options_of
from flocking.engine.driver.session_writer import SessionWriter
from flocking.engine.driver.stalls import StallWarning
from flocking.engine.driver.waits import Wait, stage
from flocking.engine.interruption import Deferred, Noted
from flocking.engine.memory_shortage import starved
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.session import Session, interrupted_at
from flocking.engine.protocol.world import check_world
from flocking.engine.runs.run import Run
from flocking.engine.storage.new_folders import check_free, check_path
from flocking.errors import EngineFailed, EngineMissing, FlockingError, InvalidInput, SimulationError, StorageError
from flocking.model.law import Law, Scenario
from flocking.model.leaders_and_obstacles.unbounded_velocities import check_leaders

GLANCE_SECONDS = 0.25
"""Wall time in seconds between two stops of a run for progress and commits; a slow step takes longer."""


def start(scenario: Scenario, engine: str = "auto", *, plant: Law | None = None, **options: object) -> Session:
    """Start a session: a simulation that is advanced, inspected and changed step by step.

    Parameters
    ----------
    scenario
        The scenario to simulate.
    engine
        ``"exact"``, ``"tiles"`` for large groups, ``"sampled"`` for held control, ``"delayed"`` for delays and for
        messages under continuous control, ``"discrete"`` for bodies in discrete time, ``"lammps"`` for a cluster, one
        of another package, or ``"auto"``: the tiled one for more than 2,000 agents where it can run them, else the one
        of the others but ``"lammps"`` that runs the world of the scenario.
    plant
        The law that agents follow, for tests of an audit; the scenario's law by default.
    options
        For ``"tiles"``: step, scheme, precision and more, see `flocking.engine.tiles.options.TilesOptions`; for
        ``"lammps"``: step and more, see `flocking.engine.lammps.options.LammpsOptions`.

    Raises
    ------
    InvalidInput
        If the engine or an option is unknown, or the scenario cannot be started.
    UnsupportedLaw
        If the engine does not support a part of the law.
    """
    session = _opened(scenario, engine, plant, options)
    session.records.check_fits()
    return session


def _opened(scenario: Scenario, engine: str, plant: Law | None, options: Mapping[str, object]) -> Session:
    found = _engine_of(scenario, engine, plant)
    return open_session(found, scenario, options_of(found, options), plant)


def _engine_of(scenario: Scenario, engine: str, plant: Law | None) -> Engine:
    if not isinstance(scenario, Scenario):
        raise InvalidInput("start", "scenario", "must be a Scenario", scenario)
    return engine_named(chosen_engine(scenario, check_name("start", engine), plant))


def open_session(engine: Engine, scenario: Scenario, options: object, plant: Law | None = None) -> Session:
    """Start a session of an ``engine``, and check its type; ``plant`` as for `start`.

    Raises
    ------
    InvalidInput, UnsupportedLaw, EngineMissing
        As raised by the engine, if the opened object is not a session, and if the velocity of a leader is infinite or
        not real during the run.
    """
    followed = [*scenario.law.leaders, *(plant.leaders if isinstance(plant, Law) else ())]
    followed += [] if scenario.energy.leader is None else [scenario.energy.leader]
    check_leaders({id(x): x for x in followed}.values(), scenario.start.t, scenario.t_end)
    engine.check_space(scenario)
    engine.check_bodies(scenario)
    check_world(engine.name, scenario, engine.worlds, leader_messages=engine.leader_messages)
    session = engine.open(scenario, options, plant=plant)
    if not isinstance(session, Session):
        kind = "flocking.engine.protocol.session.Session"
        raise InvalidInput(f"engine={engine.name!r}", "open", f"must give a {kind}", session)
    return session


def fine_option(engine: Engine, fine: bool) -> dict[str, object]:
    """The option that stores fine samples, if they are requested (``fine``), for an ``engine`` that has it.

    Raises
    ------
    InvalidInput
        If they are requested and the engine has no such option.
    """
    if not fine:
        return {}
    if "fine" not in engine.option_names:
        raise _no_fine_samples(fine)
    return {"fine": fine}


def _no_fine_samples(fine: bool) -> InvalidInput:
    return InvalidInput(
        "simulate", "fine", "is for runs of engine='exact' that are not saved", fine,
        "Raise Scenario.frames for the others.",
    )  # fmt: skip


def simulate(
    scenario: Scenario,
    *,
    engine: str = "auto",
    save: str | Path | None = None,
    progress: bool = True,
    plant: Law | None = None,
    fine: bool = False,
    **options: object,
) -> Run:
    """Run a scenario to its end.

    Parameters
    ----------
    scenario
        The scenario to simulate.
    engine
        ``"exact"``, ``"tiles"`` for large groups, ``"sampled"`` for held control, ``"delayed"`` for delays and for
        messages under continuous control, ``"discrete"`` for bodies in discrete time, ``"lammps"`` for a cluster, one
        of another package, or ``"auto"``: the tiled one for more than 2,000 agents where it can run them, else the one
        of the others but ``"lammps"`` that runs the world of the scenario.
    save
        New or empty folder to which the run is written while it continues, see
        `flocking.engine.driver.resuming.resume`; nothing is written by default.
    progress
        Whether to show a progress bar for runs longer than two seconds.
    plant
        The law that agents follow, for tests of an audit; the scenario's law by default.
    fine
        Whether to store several samples of every step of the exact engine in ``run.fine``, for curves; not saved.
    options
        For ``"tiles"``: step, scheme, precision and more, see `flocking.engine.tiles.options.TilesOptions`; for
        ``"lammps"``: step and more, see `flocking.engine.lammps.options.LammpsOptions`.

    Returns
    -------
    Run
        Frames, switches and ledger. After Ctrl-C it contains the results so far, and its status is that of an
        interrupted run.

    Raises
    ------
    SimulationError
        If the run cannot continue; ``run`` of the error contains the results so far.
    InvalidInput
        If the scenario cannot be started.
    StorageError
        If the run cannot be saved; ``run`` of the error contains the results so far.
    """
    found = _engine_of(scenario, engine, plant)
    if fine and save is not None:
        raise _no_fine_samples(fine)
    if save is not None:
        check_path("simulate", "save", save)
        # Before the session is opened, which takes long for a large group.
        check_free(Path(save).resolve())
    chosen = options_of(found, {**options, **fine_option(found, fine)})
    with Wait(scenario.name or "simulation", shown=progress and _speaks(found)):
        stage("compiling the law and opening the scenario")
        session = open_session(found, scenario, chosen, plant)
    return run_session(session, save=save, progress=progress)


def _speaks(engine: Engine) -> bool:
    """Whether this process is the one that shows progress; what an engine is missing is reported when it is opened."""
    try:
        return engine.team().first
    except EngineMissing:
        return False


def run_session(
    session: Session, *, save: str | Path | None = None, progress: bool = True, every: float | None = None
) -> Run:
    """Advance a new session to the end of its scenario.

    Parameters
    ----------
    save
        New or empty folder to which the run is written; nothing is written by default.
    progress
        Whether to show a progress bar.
    every
        Wall time between two commits, in seconds.

    Raises
    ------
    SimulationError, StorageError, InvalidInput
        As `simulate` does.
    """
    if save is None:
        session.records.check_fits()
        return drive(session, progress=progress)
    with SessionWriter.create(save, session, every) as writer:
        return drive(session, progress=progress, writer=writer)


def drive(
    session: Session, *, progress: bool, writer: SessionWriter | None = None,
    watch: Callable[[Session], None] | None = None,
) -> Run:  # fmt: skip
    """Advance a session to the end of its scenario, save it, and close it.

    Parameters
    ----------
    progress
        Whether to show a progress bar.
    writer
        Saves the run; nothing is saved by default.
    watch
        Called between two slices of the run; what it raises ends it.

    Raises
    ------
    SimulationError, StorageError
        If the run cannot continue or cannot be saved; ``run`` of the error contains the results so far.
    """
    try:
        return _drive(session, progress, writer, watch)
    finally:
        session.close()


def _drive(
    session: Session, progress: bool, writer: SessionWriter | None, watch: Callable[[Session], None] | None
) -> Run:
    scenario, team = session.scenario, session.team
    status = "finished"
    deferred = Deferred()
    try:
        with deferred, Progress(progress and team.first, scenario) as bar:
            begin, stalls = session.steps, StallWarning(session)
            # A saved run can be committed at every frame; otherwise it stops only by wall time.
            for t in [scenario.t_end] if writer is None else stops(scenario, session.time, often=True):
                while not session.reached(t):
                    advance_slice(session, t)
                    if watch is not None:
                        watch(session)
                    stalls.look(session)
                    note = "" if session.shrunk is None else str(session.shrunk)
                    bar.show(session.time, (session.steps - begin) * scenario.start.n, note)
                    if writer is not None and not session.reached(scenario.t_end):
                        writer.commit_if_due()
            if writer is not None:
                writer.finish(status)
    except KeyboardInterrupt as stop:
        between_steps = isinstance(stop, Noted)
        if team.size > 1 and not between_steps:
            raise
        status = interrupted_at(session.time)
        if writer is not None:
            try:
                writer.interrupt(status, between_steps=between_steps)
            except StorageError as fault:
                fault.run = _available(session, writer, status)
                raise
        if not interruption.PARTIAL_RESULTS:
            raise
        interruption.answered()
    except EngineFailed as error:
        # Once the engine is repaired, the run can be resumed from its last commit.
        if writer is not None:
            with suppress(StorageError):
                writer.interrupt(f"stopped: {error}")
        with suppress(Exception):
            error.run = _available(session, writer, str(error))
        raise
    except SimulationError as error:
        if writer is not None:
            try:
                writer.finish(str(error))
                error.run = writer.run(str(error))
            except StorageError as fault:
                fault.run = _available(session, writer, str(error))
                raise
        raise
    except StorageError as error:
        error.run = _available(session, writer, str(error))
        raise
    if deferred.late:
        # The interrupt came after the last step: the run is complete and saved, and the caller stops.
        raise KeyboardInterrupt
    return session.run(status) if writer is None else writer.run(status)


def advance_slice(session: Session, to: float) -> None:
    """Advance a session for a while, at most to the time ``to``.

    Raises
    ------
    EngineFailed
        When the engine fails with an exception that is not of this library.
    """
    before = session.time, session.steps
    try:
        session.advance(to, GLANCE_SECONDS)
    except (FlockingError, OSError):
        raise
    except Exception as error:
        if interruption.interrupted(error) or starved(error):
            raise
        raise EngineFailed(
            f"engine={session.engine!r} failed: {type(error).__name__}: {error}", time=session.time
        ) from error
    if (session.time, session.steps) == before and not session.reached(to):
        raise EngineFailed(f"engine={session.engine!r} takes no step and does not end", time=session.time)


def _available(session: Session, writer: SessionWriter | None, status: str) -> Run:
    """The results until the disk failed, with the part on disk if it can be read."""
    with suppress(StorageError):
        if writer is not None:
            return writer.run(status)
    return session.run(status)
