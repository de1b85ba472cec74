"""Run a parametrised scenario over parameters and seeds, and continue interrupted sweeps."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import fields
from pathlib import Path

from flocking.engine.driver.registry import check_name
from flocking.engine.interruption import answered
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput, SuspectInput
from flocking.model.law import Scenario
from flocking.model.parts.seeds import SeedNumber, given_seed
from flocking.study.claims.claim import Claim
from flocking.study.sweeps.measures import Measuring, check_names, find_measures, recorded_measure
from flocking.study.sweeps.plan import MOST_RUNS, Plan, make_plan
from flocking.study.sweeps.recorded_content import code_of, content_of, digest_of
from flocking.study.sweeps.sampling import Sample
from flocking.study.sweeps.store import FORMAT, check_draws, open_store, read_record, read_rows, read_versions
from flocking.study.sweeps.table import SweepTable
from flocking.study.sweeps.worker_pool import WorkerPool, pool
from flocking.study.sweeps.worker_tasks import Row, Work

Auditing = bool | Sequence[Claim] | Callable[[Run], object]

DIGITS = 12
"""Hexadecimal digits of the digest of a claim in a record, as of the code of functions: equal ones by chance once in
3e14.
"""


def sweep(
    make: Callable[..., Scenario],
    *,
    grid: Mapping[str, Iterable[object]] | None = None,
    sample: Sample | None = None,
    seeds: int | Iterable[int] = 1,
    measures: Sequence[str | Callable[[Run], object]] | Mapping[str, Callable[[Run], object]] | str = (
        "flocks",
        "velocity_spread",
    ),
    audit: Auditing = False,
    out: str | Path | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    seed: int | None = None,
    rng: SeedNumber | None = None,
    engine: str = "auto",
    options: Mapping[str, object] | None = None,
    most_runs: int = MOST_RUNS,
    progress: bool = True,
    record: Mapping[str, object] | None = None,
    more_measures: Mapping[str, tuple[str, Measuring]] | None = None,
    shared: WorkerPool | None = None,
    gives_up: bool = False,
) -> SweepTable:
    """Run a parametrised scenario over parameters and seeds, and measure every run.

    A run that fails becomes a row with its message. With ``out``, results are committed as they arrive; after
    Ctrl-C, a crash or a killed worker the same call makes only the missing runs.

    Parameters
    ----------
    make
        Called as ``make(**parameters, seed=...)``; returns the scenario. It may be a lambda.
    grid
        Values of each parameter by name; every combination is run.
    sample
        Points drawn from ranges, each run with every point of the grid.
    seeds
        Seeds that every point runs with, or how many runs every point gets. Then each has its own seed, fixed by
        ``seed`` and the run's place in the sweep alone, whatever the order and the number of workers.
    measures
        Names from `flocking.study.sweeps.measures.MEASURES`, functions of a run, or a mapping of names to either.
    audit
        True to judge the general claims for every run; or the claims; or a function of a run, such as ``fk.audit``.
    out
        New folder for the results, or that of an earlier attempt at the same sweep.
    workers
        Local processes; as many as cores when absent. 1 runs in this process.
    cluster
        Address of a Dask scheduler whose workers are used instead.
    seed
        Root of the seeds of the runs when ``seeds`` is a number; 0 when neither it nor ``rng`` is given.
    rng
        The same by the name of SPEC 7: an integer, or a `numpy.random.SeedSequence`.
    engine, options
        Engine and its options, see `flocking.engine.driver.simulate.simulate`.
    most_runs
        Largest number of runs.
    progress
        Show a bar with the time left on a terminal.
    record
        Plain data that identifies ``make``, stored and compared instead of its code.
    more_measures
        Further measures that ``measures`` may name.
    shared
        Workers that several sweeps share, instead of ``workers`` and ``cluster``; they stay after the sweep.
    gives_up
        Whether a run whose steps have become so short that it hardly advances is given up, as one that failed.

    Returns
    -------
    SweepTable
        One row per run. After Ctrl-C it holds those that were finished, and its status states it.

    Raises
    ------
    InvalidInput
        When an argument breaks a rule.
    StorageError
        When ``out`` holds another sweep, is damaged, or cannot be written.
    SweepError
        When workers die before they begin a run.

    Warns
    -----
    SuspectInput
        When seeds, or values of a parameter with equal seeds, change no scenario.
    """
    if not callable(make):
        raise InvalidInput("sweep", "make", "must be a function that gives a Scenario", make)
    root = given_seed("sweep", seed, rng)
    plan = make_plan(grid, sample, seeds, 0 if root is None else root, most_runs)
    _check_call(make, plan)
    found = find_measures(measures, more_measures, plan.names)
    choices = {"engine": engine, **(options or {})}
    check_name("sweep", engine)
    work = Work(make, found, auditing(audit), choices, gives_up=gives_up)
    about = {
        "format": FORMAT,
        "plan": plan.as_data(),
        "make": dict(record) if record is not None else code_of(make),
        "measures": {name: recorded_measure(name, function, more_measures) for name, function in found.items()},
        "audit": _audit_data(audit),
        "options": {name: str(value) for name, value in choices.items()},
        "provenance": versions(),
    }  # fmt: skip
    opened = pool(workers, cluster) if shared is None else nullcontext(shared)
    table = _run(plan, work, about, Path(out) if out is not None else None, opened, progress)
    if shared is None:  # What makes several sweeps compares the scenarios of all.
        _warn(table)
    return table


def _warn(table: SweepTable) -> None:
    """Warn of parameters and seeds that change no scenario."""
    for name in table.without_effect:
        rule = f"has values of {name!r} whose scenarios are equal: the parameter changes nothing that is simulated"
        warnings.warn(f"sweep: grid {rule}.", SuspectInput, stacklevel=3)
    runs, different = len(table), sum(len(rows) for rows in table.different)
    if different < runs:
        rule = f"has {runs} runs of {different} different scenarios at their points: seeds that change nothing"
        warnings.warn(f"sweep: make {rule}. Equal ones count once in the summary.", SuspectInput, stacklevel=3)


def _run(
    plan: Plan,
    work: Work,
    about: dict[str, object],
    folder: Path | None,
    opened: AbstractContextManager[WorkerPool],
    show: bool,
) -> SweepTable:
    from flocking.engine.driver.run_progress import Progress
    from flocking.study.sweeps.scheduler import Scheduler

    rows: dict[int, Row] = {}
    made_by: list[object] = []
    status = "finished"
    with ExitStack() as stack:
        store = stack.enter_context(open_store(folder, about, plan.sample)) if folder is not None else None
        if folder is not None:
            rows.update(read_rows(folder, plan.size))
            made_by = read_versions(folder, read_record(folder)) if rows else []
        missing = [k for k in range(plan.size) if k not in rows]
        if missing:
            bar = stack.enter_context(Progress(show, plan.size, len(rows)))

            def commit(new: Sequence[Row]) -> None:
                if store is not None:
                    store.append(new)
                rows.update((row["index"], row) for row in new)
                bar.advance(len(new), sum(row["status"] == "failed" for row in new))

            try:
                with opened as workers_pool:
                    Scheduler(work, workers_pool, commit).run(plan.task(k) for k in missing)
            except KeyboardInterrupt:
                answered()
                status = "interrupted"
            if len(rows) > plan.size - len(missing) and about["provenance"] not in made_by:
                made_by.append(about["provenance"])
    return SweepTable(plan, rows, tuple(work.measures), _with_versions(about, made_by), status)


def _with_versions(record: Mapping[str, object], made_by: Sequence[object]) -> dict[str, object]:
    """The record of a sweep with the versions that made its rows, a list where there are several."""
    return {**record, "provenance": made_by[0] if len(made_by) == 1 else list(made_by)} if made_by else dict(record)


def read_sweep(folder: str | Path, *, most_runs: int = MOST_RUNS) -> SweepTable:
    """Read the results of a sweep from its folder, finished or not.

    Parameters
    ----------
    folder
        The folder.
    most_runs
        Largest number of runs, a bound on memory.

    Raises
    ------
    StorageError
        When there is no sweep, or it is damaged.
    """
    from flocking.errors import StorageError

    folder = Path(folder)
    record = read_record(folder)
    try:
        data = record["plan"]
        drawn = data["sample"]
        sample = None
        if drawn is not None:
            ranges = {name: (low, high) for name, (low, high) in drawn["ranges"].items()}
            sample = Sample(drawn["method"], drawn["count"], ranges, tuple(drawn["log"]), drawn["seed"])
        plan = make_plan(data["grid"], sample, data["seeds"], data["seed"], most_runs)
        if not isinstance(record["measures"], dict):
            raise ValueError("its measures are no table")
        check_names(record["measures"], plan.names)
        measures = tuple(record["measures"])
        if data["dimensions"] != list(plan.lengths):
            raise ValueError("its dimensions are not those of its grid")
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise StorageError(f"{folder}: the record of the sweep is invalid ({error}).") from None
    check_draws(folder, record, sample)
    rows = read_rows(folder, plan.size)
    status = "finished" if len(rows) == plan.size else "interrupted"
    return SweepTable(plan, rows, measures, _with_versions(record, read_versions(folder, record)), status)


def auditing(audit: Auditing) -> Callable[[Run], object] | None:
    """The function that audits a run.

    Raises
    ------
    InvalidInput
        When ``audit`` is none of these.
    """
    from flocking.study.claims.audit import audit as audit_claims
    from flocking.study.claims.audit import check_claims

    if audit is False or audit is None:
        return None
    if audit is True:
        return audit_claims
    if callable(audit):
        return audit
    if isinstance(audit, Sequence) and all(isinstance(claim, Claim) for claim in audit):
        claims = check_claims("sweep", audit, "audit")
        return lambda run: audit_claims(run, claims)
    raise InvalidInput("sweep", "audit", "must be true or false, claims, or a function of a run", audit)


def _audit_data(audit: Auditing) -> object:
    if isinstance(audit, bool):
        return audit
    return code_of(audit) if callable(audit) else [_claim_data(claim) for claim in audit]


def _claim_data(claim: Claim) -> str:
    """What the record states of a claim: its key, and of one with functions of a user their code and what they hold."""
    functions = (entry for field in fields(claim) if callable(entry := getattr(claim, field.name)))
    own = any(not str(getattr(each, "__module__", "")).startswith("flocking.") for each in functions)
    return f"{claim.key} {digest_of(content_of(claim))[:DIGITS]}" if own else claim.key


def _check_call(make: Callable[..., object], plan: Plan) -> None:
    """Refuse parameters that ``make`` does not take before any run."""
    try:
        signature = inspect.signature(make)
    except (TypeError, ValueError):
        return
    try:
        signature.bind(**dict.fromkeys(plan.names), seed=0)
    except TypeError as error:
        raise InvalidInput(
            "sweep", "make", f"must take the parameters of the sweep and seed ({error})", str(signature)
        ) from None


def versions() -> dict[str, object]:
    """Versions of this library, NumPy and Python, as results name them."""
    import platform

    import numpy as np

    from flocking.engine.runs.provenance import version_of

    return {"flocking": version_of("flocking"), "numpy": np.__version__, "python": platform.python_version()}
