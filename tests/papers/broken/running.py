"""Runs the tests of rows while their home is broken, each fault in a process of its own."""

from __future__ import annotations

import os
import pickle
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

from flocking.formula.native.functions import NativeFunction
from flocking.papers.equation_table import Row
from tests.papers.broken.equivalent import reason
from tests.papers.broken.homes import Mutant, Part, mutants_of, names_of, parts_of
from tests.papers.broken.tracing import traced
from tests.papers.homes import HOMES
from tests.papers.transcriptions.rows import ROWS, identity, statement

MOST = 60
"""Largest number of faults tried for a home."""
LEAST_SECONDS = 20.0
"""Processor time after which a test is stopped: at least so much, or five times what it takes while it is watched."""
ENDLESS = 20.0
"""A test that is stopped after so many times what it takes while watched would go on for ever, which nobody overlooks;
one stopped earlier may only be slow, and has noticed nothing."""
STOPPED = " (a test was stopped)"
"""Said of a fault which no test noticed, one of which was stopped."""

Test = Callable[[Row], None]


@dataclass(frozen=True)
class Outcome:
    """What became of the faults of one home.

    Parameters
    ----------
    home
        The home.
    rows
        The rows that live there.
    possible, tried
        Number of faults known, and of those tried.
    survivors
        Faults that no test of these rows noticed, rows whose test does not run the home, or passes while it raises.
    equivalent
        Faults that change nothing, with the rule that says so.
    by_a_row
        Faults that the check of the home did not notice, but the statement of a row, with this row.
    seconds
        Processor time it took.
    """

    home: str
    rows: tuple[str, ...]
    possible: int
    tried: int
    survivors: tuple[str, ...]
    equivalent: tuple[str, ...]
    by_a_row: tuple[str, ...]
    seconds: float


@dataclass(frozen=True)
class Sound:
    """A test that passes on the sound home.

    Parameters
    ----------
    name
        Identity of the row; empty for the check of the home.
    run
        Runs it.
    places
        What of the home it runs, see `tests.papers.broken.tracing.traced`.
    known
        Keys of the faults at these places.
    seconds
        Processor time it takes while it is watched.
    """

    name: str
    run: Callable[[], None]
    places: set[Any]
    known: set[tuple[str, str, str]]
    seconds: float


def changes_runs(home: str) -> bool:
    """Whether runs depend on the home: floors below study, and the systems of the papers."""
    parts = home.split(".")
    return parts[1] in ("formula", "model", "engine") or parts[-2] == "system" or parts[-1] == "scenario"


def changes_generated_code(home: str) -> bool:
    return changes_runs(home) or home.startswith("flocking.study.nets.matrices.")


# -- runs once computed -------------------------------------------------------------------------------------------

_RUNS: dict[bytes, Any] = {}


@contextmanager
def remembered_runs() -> Iterator[None]:
    """Within it every module's ``simulate`` keeps its results: faults above the engine do not change them."""
    import cloudpickle

    from flocking.engine.driver import simulate as home

    original = home.simulate

    def simulate(scenario: Any, **options: Any) -> Any:
        if options.get("sinks") or options.get("into") is not None:
            return original(scenario, **options)
        try:
            key = cloudpickle.dumps((scenario, sorted(options.items())))
        except Exception:
            return original(scenario, **options)
        if key not in _RUNS:
            _RUNS[key] = original(scenario, **options)
        return _RUNS[key]

    _replace(original, simulate)
    try:
        yield
    finally:
        # Modules that were imported meanwhile took the other one.
        _replace(simulate, original)


def _replace(known: Any, other: Any) -> None:
    for name, module in list(sys.modules.items()):
        if name.startswith(("flocking", "tests.papers")) and vars(module).get("simulate") is known:
            module.simulate = other  # type: ignore[attr-defined]


def _forget(home: str, folder: str) -> None:
    """Clear what was computed with the sound home; generated code that depends on it is kept in this folder."""
    for name, module in list(sys.modules.items()):
        if not name.startswith("flocking"):
            continue
        for thing in list(vars(module).values()):
            if hasattr(thing, "cache_clear") and getattr(thing, "__name__", "") != "_generation":
                thing.cache_clear()
        for kept in ("_modules", "_known"):
            if isinstance(vars(module).get(kept), dict):
                vars(module)[kept].clear()
    if changes_runs(home):
        _RUNS.clear()
        _interpret(home.rpartition(".")[0])
    if changes_generated_code(home):
        for name in [n for n in sys.modules if n.startswith("flocking_generated_")]:
            del sys.modules[name]
        os.environ["FLOCKING_CACHE"] = folder


def _interpret(module: str) -> None:
    """Let native functions of a module run in Python: machine code that is loaded knows of no fault."""
    known = vars(sys.modules[module]) if module in sys.modules else {}
    plain = [x for x in known.values() if isinstance(x, NativeFunction) and x.__module__ == module]
    call = NativeFunction.__call__
    NativeFunction.__call__ = lambda self, *values: (  # type: ignore[method-assign]
        self.py_func(*values) if self in plain else call(self, *values)
    )


# -- one fault ----------------------------------------------------------------------------------------------------


def in_child(home: str, work: Callable[[], Any], limit: float) -> tuple[str, Any]:
    """Result of ``work`` in a forked process that forgot the home: ("done", result), ("raised", text), ("time", None),
    or ("died", None).

    The limit is of processor time of the work alone, so that a busy machine does not decide.
    """
    out, into = os.pipe()
    # Made and removed here: a child that runs out of time removes nothing.
    folder = tempfile.mkdtemp(prefix="broken-")
    child = os.fork()
    if child == 0:
        os.close(out)
        status: tuple[str, Any]
        try:
            signal.signal(signal.SIGPROF, signal.SIG_DFL)
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, 1)
            os.dup2(nowhere, 2)
            _forget(home, folder)
            signal.setitimer(signal.ITIMER_PROF, limit)
            status = ("done", work())
        except BaseException as error:
            status = ("raised", "".join(traceback.format_exception_only(error))[:200])
        try:
            with os.fdopen(into, "wb") as pipe:
                pickle.dump(status, pipe)
        finally:
            os._exit(0)
    os.close(into)
    with os.fdopen(out, "rb") as pipe:
        data = pipe.read()
    _, ended = os.waitpid(child, 0)
    shutil.rmtree(folder, ignore_errors=True)
    if data:
        return pickle.loads(data)
    return "time" if os.WIFSIGNALED(ended) and os.WTERMSIG(ended) == signal.SIGPROF else "died", None


def _sound(home: str, parts: list[Part], name: str, run: Callable[[], None]) -> Sound | str:
    """The test on the sound home, or the words of its failure."""

    def look() -> tuple[set[Any], float]:
        # Once: a second time caches would answer.
        began = time.process_time()
        with traced(parts) as places:
            run()
        return places, time.process_time() - began

    state, result = in_child(home, look, 300.0)
    if state != "done":
        return f"{name or 'the check of the home'} fails on the sound home: {state} {str(result).strip()}"
    places, seconds = result
    return Sound(name, run, places, {m.key for m in mutants_of(parts, places)}, seconds)


def _notices(home: str, test: Sound, faults: Sequence[Mutant]) -> bool | None:
    """Whether a test fails while these faults are in force; None where it was stopped and might have passed."""

    def work() -> None:
        try:
            for fault in faults:
                fault.install()
        except Exception:
            # A fault that is not in force has not been noticed.
            return
        test.run()

    limit = max(LEAST_SECONDS, 5 * test.seconds)
    state, _ = in_child(home, work, limit)
    if state == "time" and limit < ENDLESS * test.seconds:
        return None
    return state != "done"


def chosen(mutants: list[Mutant], count: int, seed: str) -> list[Mutant]:
    """So many mutants, every kind in turn; which ones of a kind depends on the ``seed`` alone."""
    draw = random.Random(seed)
    kinds: dict[str, list[Mutant]] = defaultdict(list)
    for mutant in mutants:
        kinds[mutant.kind].append(mutant)
    for kind in kinds.values():
        draw.shuffle(kind)
    found: list[Mutant] = []
    while kinds and len(found) < count:
        for name in list(kinds):
            found.append(kinds[name].pop())
            if not kinds[name]:
                del kinds[name]
    return found[:count]


# -- one home -----------------------------------------------------------------------------------------------------


def rows_at(home: str) -> list[Row]:
    return [row for row in ROWS if row.home == home]


def break_home(
    home: str, *, most: int | None = None, test: Test = statement, check: Callable[[], None] | None = None
) -> Outcome:
    """Break a home in several ways and put the check of the home, and its rows, to the test each time.

    Every row's test must run its home, and fail when it raises. A fault must be noticed by the check of the home,
    which belongs to the test of every row, or by the statement of a row that runs the place of the fault.
    """
    with remembered_runs():
        return _broken(home, most, test, check)


def _broken(home: str, most: int | None, test: Test, check: Callable[[], None] | None) -> Outcome:
    began = _processor_time()
    rows = rows_at(home)
    check = HOMES.get(home) if check is None else check
    survivors, tests = [], []
    if not changes_runs(home):
        # What it leaves behind, runs above all, serves every process that is forked from here.
        for work in [*([check] if check else []), *(lambda r=row: test(r) for row in rows)]:
            try:
                work()
            except Exception:
                continue
    try:
        parts, own = parts_of(home), names_of(home)
    except AttributeError:
        return Outcome(home, tuple(map(identity, rows)), 0, 0, ("there is no such home",), (), (), 0.0)
    whole = _sound(home, parts, "", check) if check is not None else None
    for row in rows:
        found = _sound(home, parts, identity(row), lambda r=row: test(r))
        if isinstance(found, str):
            survivors.append(found)
        elif not found.places:
            survivors.append(f"{identity(row)}: its test does not run its home")
        else:
            tests.append(found)
    if isinstance(whole, str):
        survivors.append(whole)
        whole = None
    everything = [whole, *tests] if whole else tests
    mutants = mutants_of(parts, set().union(*(t.places for t in everything)))
    if not mutants and not survivors:
        survivors.append("nothing to break in this home")
    for one in tests:
        raising = [m for m in mutants if m.what == "raises" and m.where.split(":")[0] in own]
        noticed = _notices(home, one, raising)
        if not noticed:
            how = "was stopped" if noticed is None else "passes"
            survivors.append(f"{one.name}: its test {how} when its home raises")
    tried = chosen(mutants, MOST if most is None else most, home)
    equivalent, by_a_row = [], []
    tests.sort(key=lambda t: t.seconds)
    for mutant in tried:
        found = [_notices(home, whole, [mutant])] if whole and mutant.key in whole.known else []
        if found == [True]:
            continue
        words = f"{mutant.kind}: {mutant.what} [{mutant.where.removeprefix('flocking.')}]"
        why = reason(mutant)
        if why:
            equivalent.append(f"{words} -- {why}")
            continue
        for one in tests:
            if mutant.key in one.known:
                found.append(_notices(home, one, [mutant]))
                if found[-1]:
                    if whole:
                        by_a_row.append(f"{words}: {one.name}")
                    break
        else:
            survivors.append(words + STOPPED * (None in found))
    names = tuple(identity(row) for row in rows)
    took = _processor_time() - began
    return Outcome(home, names, len(mutants), len(tried), tuple(survivors), tuple(equivalent), tuple(by_a_row), took)


def _processor_time() -> float:
    own, children = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


@cache
def warmed() -> bool:
    """Load what every row needs, once, before processes fork."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot
    import sympy  # noqa: F401

    return True
