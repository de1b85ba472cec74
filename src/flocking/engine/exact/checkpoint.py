"""A snapshot of the exact engine as plain numbers and named arrays, and back."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.adaptive_steps.stepper import StepperMemory
from flocking.engine.archives.archive import Arrays
from flocking.engine.exact.checkpoint_form import ExactNumbers, check_exact
from flocking.engine.exact.companion import NODES, Difference
from flocking.engine.exact.crossings.switching import Crossing
from flocking.engine.exact.origin import Origin
from flocking.engine.exact.recorder import ExactRecorder
from flocking.engine.exact.snapshot import Snapshot
from flocking.engine.exact.solution_error import ErrorMemory
from flocking.engine.protocol.session import Stored
from flocking.engine.runs.run import Closest, Largest


def pack_exact(snapshot: Snapshot) -> tuple[dict[str, object], Arrays]:
    """Numbers and arrays of a snapshot, without its scenario and its records."""
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
    if snapshot.limits is not None and len(snapshot.limits):
        arrays["limits"] = snapshot.limits
    if snapshot.tolerance is not None:
        arrays["tolerance"] = snapshot.tolerance
    if snapshot.centres is not None:
        numbers["centres"] = snapshot.centres
    if snapshot.error is not None:
        difference = snapshot.error.difference
        numbers["error"] = [difference.rate, difference.lost, snapshot.error.doubts]
        arrays["difference"] = difference.nodes
    arrays |= {f"pending{k}": c.pairs for k, c in enumerate(snapshot.pending)}
    arrays |= {f"links{k}": x for k, x in enumerate(links)} | {f"near{k}": x for k, x in enumerate(near)}
    return numbers, arrays


def restore_exact(numbers: Mapping[str, object], arrays: Arrays, stored: Stored) -> Snapshot:
    """The snapshot that was packed, with its records from a stored run.

    Parameters
    ----------
    numbers, arrays
        What was packed.
    stored
        Its scenario, and the run as of the same commit.

    Raises
    ------
    MalformedError
        When the data are no snapshot of the scenario.
    """
    scenario, plant = stored.scenario, stored.plant
    checked = check_exact(numbers, arrays, scenario, plant)
    (t, step), (t0, t1) = checked["stepper"], checked["segment"]
    rate, lost, doubts = checked.get("error", (0.0, t0, ((), ())))
    # A checkpoint without an estimate of the error leaves the error until then unknown.
    nodes = arrays.get("difference", np.zeros((NODES, len(arrays["y"]))))
    origin = Origin.unpacked(checked["origin"])
    return Snapshot(
        scenario, checked["time"], StepperMemory(t, arrays["y"], arrays["slope"], step),
        Segment(t0, t1, arrays["coefficients"]),
        [Crossing(watch, arrays[f"pending{k}"]) for k, watch in enumerate(checked["pending"])],
        ([arrays[f"links{k}"] for k in range(checked["graphs"])],
         [arrays[f"near{k}"] for k in range(checked["watches"])]),
        recorder_of(stored, checked),
        checked["energy"], checked["jumped"], checked["steps"],
        arrays.get("tolerance"),
        {(w, i, j): (time, speed, count) for w, i, j, time, speed, count in checked["sliding"]}, plant,
        ErrorMemory(Difference(nodes, rate, lost), doubts), arrays.get("limits"), checked.get("centres"),
        origin=origin, momentum=np.array(checked["momentum"]),
    )  # fmt: skip


def recorder_of(stored: Stored, numbers: ExactNumbers) -> ExactRecorder:
    """A recorder with the records of a ``stored`` run, and doubts and extreme values from ``numbers``."""
    recorder = ExactRecorder(stored.scenario)
    recorder.recall(stored.counts, stored.read)
    linked, unlinked = (Closest(d, t, (pair[0], pair[1]), e) for d, t, pair, e in numbers["closest"])
    recorder.extremes.closest = (linked, unlinked)
    recorder.extremes.largest = {
        name: Largest(value, time, agents, error) for name, (value, time, agents, error) in numbers["largest"].items()
    }
    recorder.doubts = list(numbers["doubts"])
    return recorder
