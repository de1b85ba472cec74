"""The one entry: start a session, or run a scenario to its end."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from flocking.engine.exact import ExactSession
from flocking.engine.run import Run
from flocking.errors import InvalidInput
from flocking.model.law import Law, Scenario

ENGINES = ("auto", "exact")
QUIET_SECONDS = 2.0


def start(scenario: Scenario, engine: str = "auto", *, plant: Law | None = None) -> ExactSession:
    """Start a session: a simulation that is advanced, looked at and changed step by step.

    Parameters
    ----------
    scenario
        What to simulate.
    engine
        ``"exact"``, or ``"auto"`` to choose.
    plant
        The law the agents really obey, for tests of an audit; the scenario's law when absent.

    Raises
    ------
    InvalidInput
        When the engine is unknown or the scenario cannot be started.
    """
    if not isinstance(scenario, Scenario):
        raise InvalidInput("start", "scenario", "must be a Scenario", scenario)
    if engine not in ENGINES:
        raise InvalidInput("start", "engine", f"must be one of {', '.join(ENGINES)}", engine)
    return ExactSession(scenario, plant=plant)


def simulate(
    scenario: Scenario,
    *,
    engine: str = "auto",
    save: str | Path | None = None,
    progress: bool = True,
    plant: Law | None = None,
) -> Run:
    """Run a scenario to its end.

    Parameters
    ----------
    scenario
        What to simulate.
    engine
        ``"exact"``, or ``"auto"`` to choose.
    save
        Folder to write the run to; nothing is written when absent.
    progress
        Show a progress bar once the run takes longer than two seconds.
    plant
        The law the agents really obey, for tests of an audit; the scenario's law when absent.

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
    """
    session = start(scenario, engine, plant=plant)
    status = "finished"
    try:
        with _Progress(progress, scenario) as bar:
            for t in _stops(scenario):
                session.advance(t)
                bar.show(t)
    except KeyboardInterrupt:
        status = f"interrupted at t = {session.time:.9g}"
    run = session.run(status)
    if save is not None:
        from flocking.engine.storage import write_run

        write_run(run, save)
    return run


def _stops(scenario: Scenario) -> list[float]:
    times = np.linspace(scenario.start.t, scenario.t_end, 101)
    return [float(t) for t in times[1:-1]] + [scenario.t_end]


class _Progress:
    """A progress bar that stays away from short runs."""

    def __init__(self, wanted: bool, scenario: Scenario) -> None:
        self._wanted = wanted
        self._scenario = scenario
        self._begin = time.monotonic()
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> _Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def show(self, t: float) -> None:
        """Report the time reached."""
        if not self._wanted or time.monotonic() - self._begin < QUIET_SECONDS:
            return
        if self._bar is None:
            from rich.console import Console
            from rich.progress import Progress

            self._bar = Progress(console=Console(stderr=True), transient=True)
            name = self._scenario.name or "simulation"
            self._task = self._bar.add_task(name, total=self._scenario.t_end - self._scenario.start.t)
            self._bar.start()
        self._bar.update(self._task, completed=t - self._scenario.start.t)
