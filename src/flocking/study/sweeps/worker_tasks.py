"""The work of a worker: it runs and measures the scenarios of a batch; a failure becomes a row."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, NotRequired, TypedDict

from flocking.engine.driver.registry import Entry, adopt_entries, registered
from flocking.engine.driver.stalls import Pace
from flocking.engine.interruption import interrupted
from flocking.engine.protocol.session import Session
from flocking.engine.runs.run import Run
from flocking.errors import FlockingError, InvalidInput, SimulationError
from flocking.model.law import Scenario
from flocking.study.sweeps.equal_scenarios import run_digest
from flocking.study.sweeps.measures import Measured, Measuring, plain_measure
from flocking.study.sweeps.plan import Task


class Row(TypedDict):
    """Outcome of one run: its number in the plan, status, measured values, verdicts, seconds, and the error message.

    Where it is known, ``scenario`` is the digest by which runs of equal scenarios are found.
    """

    index: int
    status: Literal["ok", "failed"]
    values: dict[str, Measured | int]
    verdicts: dict[str, str]
    message: str
    tries: int
    seconds: float
    scenario: NotRequired[str]


LONGEST_MESSAGE = 500
"""Characters of the message of a failed run that are stored."""


@dataclass(frozen=True)
class Work:
    """What is done for every run.

    Parameters
    ----------
    make
        Makes the scenario from the parameters and the seed.
    measures
        The measures.
    audit
        Makes the report on a run; None for no audit.
    options
        Further arguments of `simulate`.
    engines
        Engines registered in the process that sends the work.
    gives_up
        Whether runs that hardly advance are given up.
    """

    make: Callable[..., Scenario]
    measures: Mapping[str, Measuring]
    audit: Callable[[Run], object] | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    engines: tuple[Entry, ...] = field(default_factory=registered)
    gives_up: bool = False


def run_task(work: Work, task: Task) -> Row:
    """Run the scenario of a ``task`` and measure it, as ``work`` defines."""
    begin = time.perf_counter()
    row: Row = {"index": task.index, "status": "ok", "values": {}, "verdicts": {}, "message": "", "tries": 1,
                "seconds": 0.0}  # fmt: skip
    doing = "make"
    try:
        scenario = _made(work, task)
        row["scenario"] = run_digest(scenario)
        run = _simulated(work, scenario)
        from flocking.study.evidence import Evidence, NotMeasurable, NotResolvable

        evidence = Evidence(run)
        unknown = []
        for name, measure in work.measures.items():
            doing = name
            try:
                row["values"][name] = plain_measure(name, measure(evidence))
            except (NotMeasurable, NotResolvable) as reason:
                row["values"][name] = math.nan
                unknown.append(f"{name}: {reason}")
        row["message"] = _cut("; ".join(unknown))
        doing = "audit"
        if work.audit is not None:
            row["verdicts"] = _verdicts(work.audit(run))
    except Exception as error:
        if interrupted(error):
            raise KeyboardInterrupt from error
        text = str(error) if isinstance(error, FlockingError) else f"{type(error).__name__}: {error}"
        where = f"{doing}: " if doing != "make" else ""
        row |= {"status": "failed", "values": {}, "verdicts": {}, "message": _cut(f"{where}{text}")}
    row["seconds"] = time.perf_counter() - begin
    return row


def _cut(text: str) -> str:
    """A message that is no longer than what is stored, with dots where its end is left out."""
    return text if len(text) <= LONGEST_MESSAGE else f"{text[: LONGEST_MESSAGE - 4]} ..."


def _verdicts(report: object) -> dict[str, str]:
    from flocking.study.claims.audit import Report

    if not isinstance(report, Report):
        raise InvalidInput(
            "sweep", "audit", "must give a Report", report, "Pass fk.audit, or a function that calls it."
        )
    return {result.claim.key: str(result.verdict) for result in report.results}


def _made(work: Work, task: Task) -> Scenario:
    scenario = work.make(**task.parameters, seed=task.seed)
    if not isinstance(scenario, Scenario):
        raise InvalidInput("sweep", "make", "must give a Scenario", scenario)
    return scenario


def _simulated(work: Work, scenario: Scenario) -> Run:
    from flocking.engine.driver.simulate import simulate

    run = _followed(scenario, work) if work.gives_up else simulate(scenario, progress=False, **work.options)
    if run.status.startswith("interrupted"):
        raise KeyboardInterrupt
    return run


def _followed(scenario: Scenario, work: Work) -> Run:
    """A run that is given up where it hardly advances."""
    from flocking.engine.driver.simulate import drive, start

    session = start(scenario, **work.options)
    session.records.check_fits()
    pace = Pace(session)

    def watch(session: Session) -> None:
        if why := pace.stalled(session):
            raise SimulationError(f"It was given up: {why}", time=session.time)

    return drive(session, progress=False, watch=watch)


def packed(work: Work) -> bytes:
    """The work as bytes that any process with this library can unpickle, lambdas included."""
    import cloudpickle

    try:
        return bytes(cloudpickle.dumps(work))
    except Exception as error:
        raise InvalidInput(
            "sweep", "make", f"must be a function that can be sent to other processes ({error})", work.make,
            "Pass workers=1 (--workers 1), or make what it holds inside the function.",
        ) from None  # fmt: skip


@lru_cache(maxsize=4)
def _unpacked(content: bytes) -> Work:
    import pickle

    work = pickle.loads(content)
    assert isinstance(work, Work)
    adopt_entries(work.engines)
    return work


def run_batch(content: bytes, memory: int | None, tasks: Sequence[Task], scratch: str | None) -> list[Row]:
    """Run a batch in a worker.

    Parameters
    ----------
    content
        The work, packed.
    memory
        Bytes the worker may allocate; a run that needs more fails. None for no bound.
    tasks
        The runs.
    scratch
        Folder in which the worker writes the number of its run, to identify it if the worker dies; None for none.
    """
    _ignore_interrupts()
    if memory is not None:
        _bound_memory(memory)
    work = _unpacked(content)
    rows = []
    for task in tasks:
        with _noted(scratch, task.index), _first_alone(scratch):
            rows.append(run_task(work, task))
    return rows


def run_here(work: Work, tasks: Sequence[Task], _: str | None) -> list[Row]:
    """Run a batch of ``work`` in this process."""
    return [run_task(work, task) for task in tasks]


def _bound_memory(most: int) -> None:
    """Limit the memory of this process, so that a run that needs more fails with a message."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(resource.RLIMIT_DATA, (most, hard))


def _ignore_interrupts() -> None:
    """Ignore Ctrl-C, which a terminal sends to workers too: the parent stops them after storing their results."""
    import signal
    import threading

    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _noted(scratch: str | None, index: int) -> Iterator[None]:
    if scratch is None:
        yield
        return
    note = Path(scratch) / f"{os.getpid()}.at"
    note.write_text(str(index))
    yield
    note.write_text("")


@contextmanager
def _first_alone(scratch: str | None) -> Iterator[None]:
    """Let one worker make the first run, which may compile kernels for the others to load."""
    warm = Path(scratch) / "warm" if scratch is not None else None
    if warm is None or warm.exists():
        yield
        return
    with suppress(ImportError), open(warm.with_suffix(".lock"), "ab") as file:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX)
        if not warm.exists():
            yield
            warm.touch()
            return
    yield


def worker_notes(scratch: str) -> dict[int, int]:
    """Number of the run under way of each worker, by its process id, read from ``scratch``."""
    found = {}
    for note in Path(scratch).glob("*.at"):
        with suppress(ValueError):  # It is empty between two runs.
            found[int(note.stem)] = int(note.read_text())
    return found


def noted_tasks(scratch: str) -> set[int]:
    """Numbers of the runs that were under way, read from ``scratch`` and deleted there."""
    found = set(worker_notes(scratch).values())
    for note in Path(scratch).glob("*.at"):
        note.unlink()
    return found
