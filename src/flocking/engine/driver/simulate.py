"""The one entry: start a session, or run a scenario to its end."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, cast

from flocking.engine import interruption
from flocking.engine.driver.keyword_options import from_keywords, unknown_option
from flocking.engine.driver.progress import Progress, stops
from flocking.engine.exact.session import ExactSession
from flocking.engine.interruption import Deferred, Noted
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput, SimulationError, StorageError, UnsupportedLaw
from flocking.model.law import Law, Scenario

if TYPE_CHECKING:
    from flocking.engine.driver.session_writer import SessionWriter
    from flocking.engine.lammps.session import LammpsSession
    from flocking.engine.tiles.session import TilesSession

ENGINES = ("auto", "exact", "tiles", "lammps")
FEW_AGENTS = 2000
"""Up to this size ``engine="auto"`` takes the exact engine; larger groups the tiled one, where it can run their law."""
MOST_EXACT = 20_000
"""Largest group of the exact engine, which holds a matrix of all pairs."""
GLANCE_SECONDS = 0.25
"""Wall time between two looks at a run on its way, for its progress and its commits; a slow step takes longer."""


def start(
    scenario: Scenario, engine: str = "auto", *, plant: Law | None = None, **options: object
) -> ExactSession | TilesSession | LammpsSession:
    """Start a session: a simulation that is advanced, looked at and changed step by step.

    Parameters
    ----------
    scenario
        What to simulate.
    engine
        ``"exact"``, ``"tiles"`` for large groups, ``"lammps"`` for a cluster, or ``"auto"`` to choose: the exact one
        up to 2,000 agents, the tiled one beyond.
    plant
        The law the agents really obey, for tests of an audit; the scenario's law when absent.
    options
        For ``"tiles"``: step, scheme, precision and more, see `flocking.engine.tiles.options.TilesOptions`; for
        ``"lammps"``: step and more, see `flocking.engine.lammps.options.LammpsOptions`.

    Raises
    ------
    InvalidInput
        When the engine or an option is unknown, or the scenario cannot be started.
    UnsupportedLaw
        When the engine cannot run a part of the law.
    """
    session = _opened(scenario, engine, plant, options)
    if session.engine == "tiles":
        cast("TilesSession", session).records.check_fits()
    return session


def opened(scenario: Scenario, engine: str, plant: Law | None, **options: object) -> ExactSession | TilesSession:
    """A session of an engine that this process runs alone, which is going to be saved while it goes on."""
    return cast("ExactSession | TilesSession", _opened(scenario, engine, plant, options))


def _opened(
    scenario: Scenario, engine: str, plant: Law | None, options: Mapping[str, object]
) -> ExactSession | TilesSession | LammpsSession:
    if not isinstance(scenario, Scenario):
        raise InvalidInput("start", "scenario", "must be a Scenario", scenario)
    if not isinstance(engine, str) or engine not in ENGINES:
        raise InvalidInput("start", "engine", f"must be one of {', '.join(ENGINES)}", engine)
    engine = chosen_engine(scenario, engine, plant)
    if engine == "tiles":
        from flocking.engine.tiles.session import TilesOptions, TilesSession

        return TilesSession(scenario, from_keywords(TilesOptions, options, "the tiled engine"), plant=plant)
    if engine == "lammps":
        from flocking.engine.lammps.session import LammpsOptions, LammpsSession

        return LammpsSession(scenario, from_keywords(LammpsOptions, options, "engine='lammps'"), plant=plant)
    if options:
        name = min(options)
        raise _no_option(name, options[name])
    if scenario.start.n > MOST_EXACT:
        raise InvalidInput(
            "start", "engine", f"must be 'tiles' for more than {MOST_EXACT} agents", f"'exact' for {scenario.start.n}",
            "The exact engine looks at every pair.",
        )  # fmt: skip
    return ExactSession(scenario, plant=plant)


def _no_option(name: str, value: object) -> InvalidInput:
    """Why the exact engine, which has no options, refuses one."""
    from flocking.engine.lammps.options import LammpsOptions
    from flocking.engine.tiles.options import TilesOptions

    owners = {
        engine: {f.name for f in fields(kind)} for engine, kind in (("tiles", TilesOptions), ("lammps", LammpsOptions))
    }
    having = [f"engine={engine!r}" for engine, names in owners.items() if name in names]
    if having:
        return InvalidInput("start", name, f"is an option of {' and '.join(having)} alone", value)
    others = {"plant", "save", "progress", "fine", "engine", *owners["tiles"], *owners["lammps"]}
    return unknown_option(name, value, others, "any engine")


def chosen_engine(scenario: Scenario, engine: str, plant: Law | None = None) -> str:
    """The engine that ``"auto"`` means for a scenario; any other name is left as it is."""
    if not isinstance(engine, str) or engine != "auto":
        return engine
    if scenario.start.n <= FEW_AGENTS or plant is not None:
        return "exact"
    from flocking.engine.tiles.kernels.spec import check_supported

    try:
        check_supported(scenario)
    except UnsupportedLaw:
        return "exact"
    return "tiles"


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
        What to simulate.
    engine
        ``"exact"``, ``"tiles"`` for large groups, ``"lammps"`` for a cluster, or ``"auto"`` to choose: the exact one
        up to 2,000 agents, the tiled one beyond.
    save
        New or empty folder to write the run to while it goes on, see `flocking.engine.driver.resuming.resume`;
        nothing is written when absent.
    progress
        Show a progress bar once the run takes longer than two seconds.
    plant
        The law the agents really obey, for tests of an audit; the scenario's law when absent.
    fine
        Keep several samples of every step of the exact engine in ``run.fine``, for curves; they are not saved.
    options
        For ``"tiles"``: step, scheme, precision and more, see `flocking.engine.tiles.options.TilesOptions`; for
        ``"lammps"``: step and more, see `flocking.engine.lammps.options.LammpsOptions`.

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
    if isinstance(scenario, Scenario):
        engine = chosen_engine(scenario, engine, plant)
    if isinstance(save, str | Path):
        from flocking.engine.storage.run_writer import check_free

        # Before the session: a large one takes its time.
        check_free(Path(save).resolve())
    session = _opened(scenario, engine, plant, options)
    if fine:
        if not isinstance(session, ExactSession) or save is not None:
            raise InvalidInput(
                "simulate", "fine", "is for runs of engine='exact' that are not saved", fine,
                "Raise Scenario.frames for the others.",
            )  # fmt: skip
        session.recorder.fine = []
    if save is None and session.engine == "tiles":
        cast("TilesSession", session).records.check_fits()
    if session.engine == "lammps":
        from flocking.engine.driver.lammps_runs import drive_ranks

        return drive_ranks(cast("LammpsSession", session), save=save, progress=progress)
    shared = cast("ExactSession | TilesSession", session)
    if save is None:
        return drive(shared, progress=progress)
    from flocking.engine.driver.session_writer import SessionWriter

    with SessionWriter.create(save, shared) as saving:
        return drive(shared, progress=progress, saving=saving)


def drive(session: ExactSession | TilesSession, *, progress: bool, saving: SessionWriter | None = None) -> Run:
    """Advance a session to the end of its scenario, and save it on the way.

    Parameters
    ----------
    progress
        Show a progress bar.
    saving
        Keeps the run on disk on the way; nothing is kept when absent.

    Raises
    ------
    SimulationError, StorageError
        When the run cannot go on or cannot be saved; ``run`` of the error holds what was computed until then.
    """
    scenario = session.scenario
    status = "finished"
    deferred = Deferred()
    try:
        with deferred, Progress(progress, scenario, lines=True) as bar:
            begin = session.steps
            # What is saved can be committed at every frame; else the clock alone says when to look.
            for t in [scenario.t_end] if saving is None else stops(scenario, session.time, often=True):
                while before(session, t):
                    session.advance(t, GLANCE_SECONDS)
                    note = "" if session.shrunk is None else str(session.shrunk)
                    bar.show(session.time, (session.steps - begin) * scenario.start.n, note)
                    if saving is not None and before(session, scenario.t_end):
                        saving.keep()
            if saving is not None:
                saving.finish(status)
    except KeyboardInterrupt as stop:
        status = f"interrupted at t = {session.time:.9g}"
        if saving is not None:
            try:
                saving.interrupt(status, between_steps=isinstance(stop, Noted))
            except StorageError as fault:
                fault.run = _available(session, saving, status)
                raise
        if not interruption.PARTS_WANTED:
            raise
    except SimulationError as error:
        if saving is not None:
            try:
                saving.finish(str(error))
                error.run = saving.run(str(error))
            except StorageError as fault:
                fault.run = _available(session, saving, str(error))
                raise
        raise
    except StorageError as error:
        error.run = _available(session, saving, str(error))
        raise
    if deferred.late:
        # It came after the last step: the run is complete and saved, the caller is to stop.
        raise KeyboardInterrupt
    return session.run(status) if saving is None else saving.run(status)


def _available(session: ExactSession | TilesSession, saving: SessionWriter | None, status: str) -> Run:
    """What was computed until the disk failed: with what is on it, where that can be read."""
    with suppress(StorageError):
        if saving is not None:
            return saving.run(status)
    return session.run(status)


def before(session: ExactSession | TilesSession, stop: float) -> bool:
    """Whether a session has still to go on to reach a stop; one of fixed steps stands on them, not on the stop."""
    return session.time < stop - 1e-9 * getattr(session, "step", 0.0)
