"""A snapshot of the exact engine as plain numbers and named arrays, and back."""

from __future__ import annotations

from typing import Any

import numpy as np

from flocking.engine.archives.archive import Arrays
from flocking.engine.exact.checkpoint_form import check_exact
from flocking.engine.exact.companion import NODES, Difference
from flocking.engine.exact.crossings.switching import Crossing
from flocking.engine.exact.integrator.segment import Segment
from flocking.engine.exact.integrator.stepper import StepperMemory
from flocking.engine.exact.origin import Origin
from flocking.engine.exact.recorder import Recorder
from flocking.engine.exact.snapshot import Snapshot
from flocking.engine.exact.solution_error import ErrorMemory
from flocking.engine.runs.run import Closest, Largest, Run
from flocking.model.law import Law, Scenario


def pack_exact(snapshot: Snapshot) -> tuple[dict[str, object], Arrays]:
    """Numbers and arrays of a snapshot, but for its scenario and its records."""
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


def restore_exact(numbers: dict[str, Any], arrays: Arrays, records: Run, plant: Law | None) -> Snapshot:
    """The snapshot that was packed, with its records from a run read back.

    Parameters
    ----------
    numbers, arrays
        What was packed.
    records
        The run as of the same commit.
    plant
        The law the agents really obey, where it is not the scenario's.

    Raises
    ------
    MalformedError
        When the data are no snapshot of the scenario.
    """
    check_exact(numbers, arrays, records.scenario, plant)
    (t, step), (t0, t1) = numbers["stepper"], numbers["segment"]
    rate, lost, doubts = numbers.get("error", (0.0, t0, [[], []]))
    # What a checkpoint without an estimate of the error went through is not known.
    nodes = arrays.get("difference", np.zeros((NODES, len(arrays["y"]))))
    origin = Origin.unpacked(numbers["origin"])
    return Snapshot(
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
