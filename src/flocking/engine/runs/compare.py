"""The first difference between two runs, by time and agent."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flocking.arrays import AnyArray, Mask, Records
from flocking.engine.runs.run import Run
from flocking.engine.runs.run_errors import accuracy_data
from flocking.errors import InvalidInput
from flocking.model.checks import number

NANOSECOND = 1e-9
"""Unit in which logs of messages count time, in units of time of the scenario."""


@dataclass(frozen=True)
class Difference:
    """A difference of two runs.

    Parameters
    ----------
    what
        What differs: ``"position"``, ``"velocity"``, ``"links"``, ``"switches"``, ``"ledger"``, ...
    first, second
        The two values.
    time
        Its time, where known.
    agent
        Number of the agent, where it concerns one.
    """

    what: str
    first: object
    second: object
    time: float | None = None
    agent: int | None = None

    def __str__(self) -> str:
        where = f"t = {self.time!r}: " if self.time is not None else ""
        who = f" of agent {self.agent}" if self.agent is not None else ""
        return f"{where}{self.what}{who}: {self.first} against {self.second}"


def first_difference(one: Run, two: Run, *, tolerance: float = 0.0) -> Difference | None:
    """The earliest difference of two runs, None when they are equal bit for bit.

    Compared are frames with all columns, links, switches, ledger, observations and status, but not the provenance.

    Parameters
    ----------
    one, two
        The runs.
    tolerance
        Differences of numbers up to this size do not count.

    Raises
    ------
    InvalidInput
        When the tolerance is negative.
    """
    number("first_difference", "tolerance", tolerance, least=0.0)
    for name, value in (("one", one), ("two", two)):
        if not isinstance(value, Run):
            raise InvalidInput("first_difference", name, "must be a Run", value, "Read it with fk.read_run(folder).")
    if one.q.shape[1:] != two.q.shape[1:]:
        return Difference("number of agents and axes", one.q.shape[1:], two.q.shape[1:])
    found = [d for d in _differences(one, two, tolerance) if d is not None]
    # Sorting is stable: of differences at one time the frames come first, and those without a time last.
    return min(found, key=lambda d: np.inf if d.time is None else d.time, default=None)


def _differences(one: Run, two: Run, tolerance: float) -> Iterator[Difference | None]:
    count = min(len(one.t), len(two.t))
    apart = _apart(one.t[:count], two.t[:count], tolerance)
    if apart.any():
        count = int(np.argmax(apart))
        first, second = float(one.t[count]), float(two.t[count])
        yield Difference("time of a frame", first, second, min(first, second))
    for name, field in (("position", "q"), ("velocity", "p")):
        yield _frame_difference(one, getattr(one, field), getattr(two, field), name, count, tolerance)
    if one.columns.keys() == two.columns.keys():
        for name, values in one.columns.items():
            yield _frame_difference(one, values, two.columns[name], f"column {name!r}", count, tolerance)
    else:
        yield Difference("columns of the agents", tuple(one.columns), tuple(two.columns))
    if one.links.shape[1:] == two.links.shape[1:]:
        yield _frame_difference(one, one.links, two.links, "links", count, 0.0)
    else:
        yield Difference("whether links are kept", one.links.shape[1:], two.links.shape[1:])
    yield _row_difference(one.switches, two.switches, "switch", tolerance)
    yield _row_difference(one.trace, two.trace, "ledger", tolerance)
    if one.observables is not None and two.observables is not None:
        yield _row_difference(one.observables, two.observables, "observation", tolerance)
    elif one.observables is not two.observables:
        yield Difference("whether observations are kept", one.observables is not None, two.observables is not None)
    yield from _log_differences(one, two, tolerance)
    if tolerance == 0 and _errors(one) != _errors(two):
        yield Difference("estimated errors", _errors(one)[0], _errors(two)[0])
    if len(one.t) != len(two.t):
        longer = one if len(one.t) > len(two.t) else two
        at = min(len(one.t), len(two.t))
        yield Difference("number of frames", len(one.t), len(two.t), float(longer.t[at]))
    for name in ("closest_linked", "closest_unlinked", "status"):
        x, y = getattr(one, name), getattr(two, name)
        same = x == y or (name != "status" and tolerance > 0 and abs(x.distance - y.distance) <= tolerance)
        both_none = name != "status" and not np.isfinite([x.distance, y.distance]).any()
        if not (same or both_none):
            yield Difference(name.replace("_", " "), x, y)


def _errors(run: Run) -> tuple[object, bytes]:
    found = run.accuracy
    return (None, b"") if found is None else (accuracy_data(found), found.frames.tobytes())


def _log_differences(one: Run, two: Run, tolerance: float) -> Iterator[Difference]:
    """The first difference of each array of the logs: of acts, of what was used in them, and of their forces."""
    if one.log is None or two.log is None:
        if one.log is not two.log:
            yield Difference("whether a log is kept", one.log is not None, two.log is not None)
        return
    for name, digits in (("ticks", 0.0), ("uses", 0.0), ("forces", tolerance)):
        x, y = getattr(one.log, name), getattr(two.log, name)
        count = min(len(x), len(y))
        apart = _apart(x[:count], y[:count], digits).any(axis=1)
        if apart.any() or len(x) != len(y):
            row = int(np.argmax(apart)) if apart.any() else count
            first, second = (v[row].tolist() if row < len(v) else None for v in (x, y))
            # Where one run has no such row, or a later one, the difference is where the other has it.
            acts = [_act(run, name, row) for run, v in ((one, x), (two, y)) if row < len(v)]
            yield Difference(f"log of messages, {name}", first, second, *min(acts))


def _act(run: Run, name: str, row: int) -> tuple[float, int]:
    """Time and agent of the act to which a row of an array of the log belongs."""
    log = run.log
    assert log is not None
    act = int(np.searchsorted(log.firsts, row, side="right")) - 1 if name == "uses" else row
    instant, agent, _ = log.ticks[act].tolist()
    return run.scenario.start.t + instant * NANOSECOND, agent


def _apart(x: AnyArray, y: AnyArray, tolerance: float) -> Mask:
    """Where two arrays differ: bit for bit without tolerance, so that 0.0 and -0.0 count and equal NaN do not."""
    if x.dtype.kind != "f":
        return np.asarray(x != y)
    if x.dtype != y.dtype:
        x, y = x.astype(np.float64), y.astype(np.float64)
    kind = f"i{x.dtype.itemsize}"
    bits = np.ascontiguousarray(x).view(kind) != np.ascontiguousarray(y).view(kind)
    if tolerance == 0:
        return np.asarray(bits)
    return np.asarray(bits & ~(np.abs(x.astype(np.float64) - y.astype(np.float64)) <= tolerance))


def _frame_difference(run: Run, x: AnyArray, y: AnyArray, name: str, count: int, tolerance: float) -> Difference | None:
    if not count:
        return None
    apart = _apart(x[:count], y[:count], tolerance).reshape(count, run.n, -1).any(axis=-1)
    if not apart.any():
        return None
    frame, agent = (int(k) for k in np.argwhere(apart)[0])
    first, second = (
        f"neighbours {np.flatnonzero(v[frame, agent]).tolist()}" if v.dtype.kind == "b" else v[frame, agent].tolist()
        for v in (x, y)
    )
    return Difference(name, first, second, float(run.t[frame]), agent)


def _row_difference(x: Records, y: Records, name: str, tolerance: float) -> Difference | None:
    count = min(len(x), len(y))
    apart = np.zeros(count, dtype=bool)
    names = x.dtype.names or ()
    for field in names:
        apart |= _apart(x[field][:count], y[field][:count], tolerance)
    if apart.any():
        row = int(np.argmax(apart))
        agent = int(x["i"][row]) if "i" in names else None
        return Difference(name, x[row].tolist(), y[row].tolist(), float(min(x["time"][row], y["time"][row])), agent)
    if len(x) != len(y):
        longer = x if len(x) > len(y) else y
        return Difference(f"number of {name} rows", len(x), len(y), float(longer["time"][count]))
    return None
