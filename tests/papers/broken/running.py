"""Runs the test of a row while its home is broken, each fault in a process of its own."""

from __future__ import annotations

import os
import pickle
import random
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

from flocking.study.equations import Row
from tests.papers.broken.equivalent import reason
from tests.papers.broken.homes import Mutant, mutants_of, parts_of, traced
from tests.papers.rows import ROWS, examine, identity, statement

FEW, MANY = 6, 40
"""Least and largest number of faults tried for a row."""
SECONDS = 4.0
"""Time for the faults of a row beyond the first few."""


@dataclass(frozen=True)
class Outcome:
    """What became of the faults of one row.

    Parameters
    ----------
    row, home
        The row and its home.
    possible, tried
        Number of faults known, and of those tried.
    survivors
        Faults that the row's test did not notice.
    equivalent
        Faults that change nothing, with the rule that says so.
    seconds
        Time it took.
    """

    row: str
    home: str
    possible: int
    tried: int
    survivors: tuple[str, ...]
    equivalent: tuple[str, ...]
    seconds: float


def floor_of(home: str) -> str:
    return home.split(".")[1]


def changes_runs(home: str) -> bool:
    """Whether runs depend on the home: floors below study, and the systems of the papers."""
    parts = home.split(".")
    return parts[1] in ("formula", "model", "engine") or parts[-2] == "system" or parts[-1] == "scenario"


def changes_generated_code(home: str) -> bool:
    return changes_runs(home) or home.startswith("flocking.study.nets.")


# -- runs once computed -------------------------------------------------------------------------------------------

_RUNS: dict[bytes, Any] = {}


def remember_runs() -> None:
    """Make every module's ``simulate`` keep its results: faults above the engine do not change them."""
    import cloudpickle

    from flocking.engine import simulate as home

    original = home.simulate
    if hasattr(original, "remembered"):
        return

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

    simulate.remembered = original  # type: ignore[attr-defined]
    for name, module in list(sys.modules.items()):
        if name.startswith(("flocking", "tests.papers")) and vars(module).get("simulate") is original:
            module.simulate = simulate  # type: ignore[attr-defined]


def _forget(home: str) -> str | None:
    """Clear what was computed with the sound home; returns a new cache folder where generated code depends on it."""
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
        import numba

        # A kernel for a few steps is quicker as plain Python than compiled.
        numba.config.DISABLE_JIT = True
    if not changes_generated_code(home):
        return None
    for name in [n for n in sys.modules if n.startswith("flocking_generated_")]:
        del sys.modules[name]
    folder = tempfile.mkdtemp(prefix="broken-")
    os.environ["FLOCKING_CACHE"] = folder
    return folder


def _in_child(work: Callable[[], Any], limit: float) -> tuple[str, Any]:
    """Result of ``work`` in a forked process: ("done", result), ("raised", text) or ("time", None)."""
    out, into = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(out)
        status: tuple[str, Any]
        try:
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.setitimer(signal.ITIMER_REAL, limit)
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, 1)
            os.dup2(nowhere, 2)
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
    os.waitpid(child, 0)
    return pickle.loads(data) if data else ("time", None)


def _examined(row: Row, home: str, mutant: Mutant | None, test: Callable[[Row], None]) -> Any:
    folder = _forget(home)
    try:
        if mutant is not None:
            mutant.install()
            test(row)
            return None
        parts = parts_of(home)
        start = time.perf_counter()
        with traced(parts) as lines:
            test(row)
        return lines, time.perf_counter() - start
    finally:
        if folder:
            shutil.rmtree(folder, ignore_errors=True)


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


def break_row(row: Row, *, most: int | None = None, few: int = FEW, test: Callable[[Row], None] = examine) -> Outcome:
    """Break the home of a row in several ways and put the row to its ``test`` each time."""
    began, home = time.perf_counter(), row.home
    remember_runs()
    try:
        test(row)
    except Exception as error:
        text = "".join(traceback.format_exception_only(error)).strip().splitlines()[0]
        return Outcome(identity(row), home, 0, 0, (f"the sound home fails: {text}",), (), 0.0)
    parts = parts_of(home)
    state, result = _in_child(lambda: _examined(row, home, None, test), 120.0)
    if state != "done":
        return Outcome(identity(row), home, 0, 0, (f"the sound home fails: {state} {result}",), (), 0.0)
    lines, seconds = result
    if test is examine:
        state, own = _in_child(lambda: _examined(row, home, None, statement), 120.0)
        lines = lines if state == "done" and own[0] else set()
    mutants = mutants_of(parts, lines)
    if not mutants:
        note = "the row's test does not run its home" if not lines else "nothing to break in its home"
        return Outcome(identity(row), home, 0, 0, (note,), (), time.perf_counter() - began)
    count = MANY if most is None else most
    if most is None:
        count = max(few, min(MANY, int(SECONDS / max(seconds, 1e-3))))
    survivors, equivalent = [], []
    tried = chosen(mutants, count, identity(row))
    for mutant in tried:
        state, result = _in_child(lambda m=mutant: _examined(row, home, m, test), max(10.0, 10 * seconds))
        if state == "done":
            words = f"{mutant.kind}: {mutant.what} [{mutant.where.removeprefix('flocking.')}]"
            why = reason(row, mutant)
            if not why and row.kind == "figure" and test is examine and _seen_by_others(row, mutant, seconds):
                continue
            if why:
                equivalent.append(f"{words} -- {why}")
            else:
                survivors.append(words)
    took = time.perf_counter() - began
    return Outcome(identity(row), home, len(mutants), len(tried), tuple(survivors), tuple(equivalent), took)


def _seen_by_others(row: Row, mutant: Mutant, seconds: float) -> bool:
    """Whether the row of another figure of the paper notices: one table lists all of them, each fault is about some."""
    siblings = [other for other in ROWS if other.home == row.home and other is not row]
    for other in siblings:
        state, _ = _in_child(lambda o=other: _examined(o, row.home, mutant, examine), max(60.0, 20 * seconds))
        if state != "done":
            return True
    return False


@cache
def warmed() -> bool:
    """Load what every row needs, once, before processes fork."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot
    import sympy  # noqa: F401

    return True
