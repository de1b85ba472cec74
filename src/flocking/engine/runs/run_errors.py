"""Errors of a run as plain data for its record."""

from __future__ import annotations

from typing import Any

import numpy as np

from flocking.arrays import Array
from flocking.engine.runs.run import DOUBT_FIELDS, Accuracy, Largest


def json_number(value: float) -> float | str:
    """A number for JSON: text where it is infinite or NaN."""
    return float(value) if np.isfinite(value) else str(float(value))


def accuracy_data(found: Accuracy) -> dict[str, object]:
    """The accuracy ``found``, without the errors of the frames, which have an array of their own."""
    doubts = [[x if isinstance(x, str | int) else json_number(x) for x in row] for row in found.doubts.tolist()]
    largest = {
        name: [json_number(x.value), json_number(x.time), list(x.agents), json_number(x.error)]
        for name, x in found.largest.items()
    }
    return {"doubts": doubts, "largest": largest, "known_until": json_number(found.known_until)}


def accuracy_of(data: dict[str, Any] | None, frames: Array | None) -> Accuracy | None:
    """The accuracy read back; ``frames`` are the errors of the frames, shape (F, 2). None where nothing is known."""
    if data is None or frames is None:
        return None
    numbers = [k for k, name in enumerate(DOUBT_FIELDS.names or ()) if DOUBT_FIELDS[name].kind == "f"]
    rows = [tuple(float(x) if k in numbers else x for k, x in enumerate(row)) for row in data["doubts"]]
    largest = {
        name: Largest(float(value), float(time), tuple(agents), float(error))
        for name, (value, time, agents, error) in data["largest"].items()
    }
    return Accuracy(frames, np.array(rows, dtype=DOUBT_FIELDS), largest, float(data["known_until"]))
