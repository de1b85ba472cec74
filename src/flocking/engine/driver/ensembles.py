"""Run many scenarios in the threads of one process."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

from flocking.engine import interruption
from flocking.engine.driver.registry import check_name, chosen_engine, engine_named, options_of
from flocking.engine.driver.run_progress import Progress
from flocking.engine.driver.simulate import advance_slice, fine_option, open_session
from flocking.engine.interruption import Deferred
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.session import Session
from flocking.engine.runs.run import Run
from flocking.errors import FlockingError, InvalidInput, RunsFailed, SimulationError
from flocking.model.checks import integer
from flocking.model.law import Scenario

WAIT_SECONDS = 0.1
"""Wall time in seconds between two looks of the main thread at the others: Ctrl-C waits no longer for it."""


def simulate_many(
    scenarios: Iterable[Scenario],
    *,
    engine: str = "auto",
    threads: int | None = None,
    progress: bool = True,
    fine: bool = False,
    **options: object,
) -> tuple[Run, ...]:
    """Run many scenarios to their ends, in the threads of this process.

    Each run is, bit for bit, that of `flocking.simulate` for its scenario, whatever the number of threads and the order
    of the scenarios. Laws of the same formulas share their compiled code. Nothing is copied between processes. Engines
    that cannot run several sessions at once, such as ``"tiles"`` with threads of its own, run one scenario after
    another. For grids of parameters, stored results and several processes, see `flocking.sweep`.

    Parameters
    ----------
    scenarios
        The scenarios, of one or of several laws.
    engine, fine, options
        As for `flocking.simulate`, for all of them.
    threads
        Number of threads, 1 or more; by default as many as this process may use processors.
    progress
        Whether to show on a terminal how many runs are done.

    Returns
    -------
    tuple of Run
        The runs in the order of the scenarios. After Ctrl-C, runs under way and those not begun hold what was computed
        until then, at least their start, and their status states that they were interrupted.

    Raises
    ------
    InvalidInput, UnsupportedLaw, EngineMissing
        When a scenario cannot be started; the message begins with its number, as ``scenarios[3]``.
    RunsFailed
        When runs could not go on. All scenarios have been run; ``runs`` of the error holds every run, of the failed
        ones what was computed until then, and ``failures`` their errors by number.
    """
    count = _thread_count(threads)
    check_name("simulate_many", engine)
    given = _checked(scenarios)
    jobs = [_Job(k, scenario, *_engine_and_options(k, scenario, engine, fine, options)) for k, scenario in given]
    ensemble = _Ensemble(jobs)
    with Progress(progress, len(jobs), 0) as bar:
        if all(job.engine.runs_in_threads for job in jobs):
            interrupted = ensemble.run(min(count, max(len(jobs), 1)), bar)
        else:
            interrupted = ensemble.run(1, bar)
    if interrupted and not interruption.PARTIAL_RESULTS:
        raise KeyboardInterrupt
    if ensemble.unexpected:
        raise ensemble.unexpected[0]
    runs = tuple(job.run for job in jobs)
    failures = {job.number: job.failure for job in jobs if job.failure is not None}
    if failures:
        raise RunsFailed(runs, failures)
    return tuple(run for run in runs if run is not None)


@dataclass(eq=False)
class _Job:
    """A scenario to run, by its number; later the run, and why it could not go on."""

    number: int
    scenario: Scenario
    engine: Engine
    options: object
    run: Run | None = None
    failure: SimulationError | None = None


@dataclass(eq=False)
class _Ensemble:
    """Scenarios that threads take one after another."""

    jobs: Sequence[_Job]
    unexpected: list[BaseException] = field(default_factory=list)
    _next: int = 0
    _done: int = 0
    _stopped: bool = False
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def run(self, count: int, bar: Progress) -> bool:
        """Run all scenarios in ``count`` threads; whether that was interrupted.

        Ctrl-C is noted and ends the runs; a second one is raised at once. However this ends, no thread goes on for
        longer than the slice of work it is in.
        """
        threads = [threading.Thread(target=self._work, name=f"simulate_many {k}", daemon=True) for k in range(count)]
        deferred, shown = Deferred(), 0
        try:
            with deferred:
                for thread in threads:
                    thread.start()
                while any(thread.is_alive() for thread in threads):
                    for thread in threads:
                        self._stopped = self._stopped or interruption.noted()
                        thread.join(WAIT_SECONDS)
                    done = self._done
                    bar.advance(done - shown, 0)
                    shown = done
                interrupted = interruption.noted()
        finally:
            self._stopped = True
        return interrupted or deferred.late

    def _work(self) -> None:
        while (job := self._taken()) is not None:
            try:
                self._complete(job)
            except BaseException as error:
                self.unexpected.append(error)
                self._stopped = True
                return
            with self._lock:
                self._done += 1

    def _taken(self) -> _Job | None:
        with self._lock:
            if self._next == len(self.jobs) or self.unexpected:
                return None
            self._next += 1
            return self.jobs[self._next - 1]

    def _complete(self, job: _Job) -> None:
        try:
            session = open_session(job.engine, job.scenario, job.options)
        except SimulationError as error:
            job.failure = error
            return
        except FlockingError as error:
            raise _with_number(error, job.number) from None
        try:
            _check_fits(session, job.number)
            while not session.reached(job.scenario.t_end) and not self._stopped:
                advance_slice(session, job.scenario.t_end)
            job.run = session.run()
        except SimulationError as error:
            if error.run is None:
                error.run = session.run(str(error))
            job.run, job.failure = error.run, error
        finally:
            session.close()


def _thread_count(threads: int | None) -> int:
    if threads is None:
        with suppress(AttributeError):
            return len(os.sched_getaffinity(0))
        return os.cpu_count() or 1
    return integer("simulate_many", "threads", threads, least=1)


def _checked(scenarios: Iterable[Scenario]) -> list[tuple[int, Scenario]]:
    if isinstance(scenarios, Scenario) or not isinstance(scenarios, Iterable):
        raise InvalidInput(
            "simulate_many", "scenarios", "must be several scenarios", scenarios, "Use simulate for a single one."
        )
    found = list(enumerate(scenarios))
    for number, scenario in found:
        if not isinstance(scenario, Scenario):
            raise InvalidInput("simulate_many", f"scenarios[{number}]", "must be a Scenario", scenario)
    return found


def _engine_and_options(
    number: int, scenario: Scenario, name: str, fine: bool, options: Mapping[str, object]
) -> tuple[Engine, object]:
    try:
        found = engine_named(chosen_engine(scenario, name, None))
        found.check(scenario)
        return found, options_of(found, {**options, **fine_option(found, fine)})
    except FlockingError as error:
        raise _with_number(error, number) from None


def _check_fits(session: Session, number: int) -> None:
    try:
        session.records.check_fits()
    except SimulationError:
        raise
    except FlockingError as error:
        raise _with_number(error, number) from None


def _with_number(error: FlockingError, number: int) -> FlockingError:
    """The error with the number in its message: notes are not part of the text that programs log or show."""
    error.args = (f"scenarios[{number}] of simulate_many: {error}",)
    return error
