"""Checkpoints: all a session needs to go on bit for bit, but its records, as arrays and numbers in one file."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from flocking.engine.archives.archive import UNREADABLE, Arrays, read_archive, write_archive
from flocking.engine.exact.checkpoint_form import check_exact
from flocking.engine.exact.companion import NODES, Difference
from flocking.engine.exact.crossings.switching import Crossing
from flocking.engine.exact.integrator.segment import Segment
from flocking.engine.exact.integrator.stepper import StepperMemory
from flocking.engine.exact.origin import Origin
from flocking.engine.exact.recorder import Recorder
from flocking.engine.exact.session import ExactSession
from flocking.engine.exact.snapshot import Snapshot
from flocking.engine.exact.solution_error import ErrorMemory
from flocking.engine.runs.columns import GROWING
from flocking.engine.runs.run import Closest, Largest, Run
from flocking.errors import StorageError
from flocking.model.law import Law, Scenario

if TYPE_CHECKING:
    from flocking.engine.tiles.session import TilesSession


def write_checkpoint(session: ExactSession | TilesSession, file: BinaryIO) -> None:
    """Write the state of a session as an ``.npz`` file: arrays, and one JSON text of numbers."""
    numbers, arrays = _PACKERS[session.engine](session)
    write_archive(file, {"engine": session.engine, **numbers}, arrays)


def pack(session: ExactSession | TilesSession) -> bytes:
    """State of a session as bytes, see `write_checkpoint`."""
    file = io.BytesIO()
    write_checkpoint(session, file)
    return file.getvalue()


def unpack(
    data: bytes | Path,
    records: Run,
    plant: Law | None,
    where: Path,
    *,
    stored: dict[str, int] | None = None,
    threads: int | None = None,
) -> ExactSession | TilesSession:
    """The session that was packed, with its records from a run read back.

    Parameters
    ----------
    data
        What `pack` gave, or the file that `write_checkpoint` wrote.
    records
        The run as of the same commit; the tiled engine takes its scenario alone.
    plant
        The law the agents really obey, where it is not the scenario's.
    where
        Where the data come from, for messages.
    stored
        Numbers of records on disk, of each kind, that the tiled engine goes on after.
    threads
        Number of threads of the tiled engine; that of before when absent.

    Raises
    ------
    StorageError
        When the data are no checkpoint.
    """
    try:
        numbers, arrays = read_archive(data)
        if numbers["engine"] == "tiles":
            from flocking.engine.tiles.checkpoint import restore_tiles

            counts = stored or dict.fromkeys(GROWING, 0)
            return restore_tiles(numbers, arrays, records.scenario, counts, threads, plant)
        check_exact(numbers, arrays, records.scenario, plant)
        return _restore_exact(numbers, arrays, records, plant)
    except UNREADABLE as error:
        raise StorageError(f"{where}: no checkpoint this version can go on from ({str(error)[:200]}).") from None


def _pack_tiles(session: TilesSession) -> tuple[dict[str, Any], Arrays]:
    from flocking.engine.tiles.checkpoint import pack_tiles

    return pack_tiles(session)


def _pack_exact(session: ExactSession) -> tuple[dict[str, Any], Arrays]:
    snapshot = session.snapshot(records=False)
    links, near = snapshot.links
    numbers = {
        "time": snapshot.time, "energy": snapshot.energy, "jumped": snapshot.jumped, "steps": snapshot.steps,
        "stepper": [snapshot.stepper.t, snapshot.stepper.step], "segment": [snapshot.segment.t0, snapshot.segment.t1],
        "pending": [c.watch for c in snapshot.pending], "graphs": len(links), "watches": len(near),
        "origin": snapshot.origin.packed(), "momentum": snapshot.momentum.tolist(),
        "sliding": [[*map(int, pair), *values] for pair, values in snapshot.sliding.items()],
        "doubts": [list(row) for row in snapshot.recorder.doubts],
        "closest": [[c.distance, c.time, list(c.pair), c.error] for c in snapshot.recorder.extremes.closest],
        "largest": {
            name: [x.value, x.time, list(x.agents), x.error] for name, x in snapshot.recorder.extremes.largest.items()
        },
    }  # fmt: skip
    arrays: Arrays = {
        "y": snapshot.stepper.y,
        "slope": snapshot.stepper.slope,
        "coefficients": snapshot.segment.coefficients,
    }
    if snapshot.tolerance is not None:
        arrays["tolerance"] = snapshot.tolerance
    if snapshot.error is not None:
        difference = snapshot.error.difference
        numbers["error"] = [difference.rate, difference.lost, snapshot.error.doubts]
        arrays["difference"] = difference.nodes
    arrays |= {f"pending{k}": c.pairs for k, c in enumerate(snapshot.pending)}
    arrays |= {f"links{k}": x for k, x in enumerate(links)} | {f"near{k}": x for k, x in enumerate(near)}
    return numbers, arrays


def _restore_exact(numbers: dict[str, Any], arrays: dict[str, Any], records: Run, plant: Law | None) -> ExactSession:
    (t, step), (t0, t1) = numbers["stepper"], numbers["segment"]
    rate, lost, doubts = numbers.get("error", (0.0, t0, [[], []]))
    # What a checkpoint without an estimate of the error went through is not known.
    nodes = arrays.get("difference", np.zeros((NODES, len(arrays["y"]))))
    origin = Origin.unpacked(numbers["origin"])
    snapshot = Snapshot(
        records.scenario, numbers["time"], StepperMemory(t, arrays["y"], arrays["slope"], step),
        Segment(t0, t1, arrays["coefficients"]),
        [Crossing(watch, arrays[f"pending{k}"]) for k, watch in enumerate(numbers["pending"])],
        ([arrays[f"links{k}"] for k in range(numbers["graphs"])],
         [arrays[f"near{k}"] for k in range(numbers["watches"])]),
        recorder_of(records, numbers),
        numbers["energy"], numbers["jumped"], numbers["steps"],
        arrays.get("tolerance"),
        {(w, i, j): (time, speed, count) for w, i, j, time, speed, count in numbers["sliding"]}, plant,
        ErrorMemory(Difference(nodes, rate, lost), doubts),
        origin=origin, momentum=np.array(numbers["momentum"]),
    )  # fmt: skip
    return ExactSession.resume(snapshot)


def recorder_of(run: Run, numbers: dict[str, Any]) -> Recorder:
    """A recorder that holds the records of a run and goes on with them.

    Parameters
    ----------
    numbers
        Those of the checkpoint: what was in doubt, and the extreme values, at the last whole step.
    """
    scenario: Scenario = run.scenario
    recorder = Recorder(scenario)
    recorder.t = [float(t) for t in run.t]
    recorder.q, recorder.p, recorder.links = list(run.q), list(run.p), list(run.links)
    recorder.switches = run.switches.tolist()
    recorder.trace = run.trace.tolist()
    recorder.extremes.closest = (run.closest_linked, run.closest_unlinked)
    if "closest" in numbers:
        linked, unlinked = (Closest(d, t, (pair[0], pair[1]), e) for d, t, pair, e in numbers["closest"])
        recorder.extremes.closest = (linked, unlinked)
    recorder.extremes.largest = {
        name: Largest(value, time, tuple(agents), error)
        for name, (value, time, agents, error) in numbers.get("largest", {}).items()
    }
    recorder.doubts = [tuple(row) for row in numbers.get("doubts", [])]
    recorder.errors = [(np.inf, np.inf)] * len(recorder.t)
    if run.accuracy is not None:
        recorder.errors = [(q, p) for q, p in run.accuracy.frames.tolist()]
    return recorder


_PACKERS: dict[str, Callable[[Any], tuple[dict[str, Any], Arrays]]] = {"exact": _pack_exact, "tiles": _pack_tiles}
"""How the sessions of each engine are packed."""
