"""Conversion of a snapshot of a tiled session to plain numbers and named arrays, and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields, is_dataclass
from typing import TypedDict, cast

import numpy as np

from flocking.engine.archives.archive import PLAIN, Arrays
from flocking.engine.archives.data_checks import SHOWN, MalformedError
from flocking.engine.fixed_step.law_gaps import LawGaps
from flocking.engine.protocol.session import Stored
from flocking.engine.runs.run import Closest
from flocking.engine.tiles.checkpoint_form import check_session, stored_options
from flocking.engine.tiles.instability import Instability
from flocking.engine.tiles.integrators import IntegratorMemory, LedgerSums
from flocking.engine.tiles.neighbours.neighbour_lists import TileLists
from flocking.engine.tiles.particle_memory import ParticleMemory
from flocking.engine.tiles.records import RecordsMemory, TilesRecorder
from flocking.engine.tiles.snapshot import TilesSnapshot

PARTS: dict[str, type[object]] = {
    "Books": LedgerSums, "Closest": Closest, "CrowdMemory": ParticleMemory, "Instability": Instability,
    "LawGaps": LawGaps, "TileLists": TileLists,
}  # fmt: skip
"""Classes that a checkpoint may contain, by their names in files."""


class SessionMemory(TypedDict):
    """Fields of `TilesSnapshot` besides scenario and options, by their names in files."""

    step: float
    time: float
    plan: tuple[float, float, int, int]
    steps: int
    crowd: ParticleMemory
    scheme: IntegratorMemory
    records: RecordsMemory
    farthest: float
    law_gaps: LawGaps
    instability: Instability


_STORED_NAMES = {part: name for name, part in PARTS.items()}


def flattened(value: object, arrays: Arrays) -> object:
    """Convert a value to data for JSON; arrays are stored in ``arrays`` and replaced by their names.

    Raises
    ------
    TypeError
        If the value contains an object that cannot be stored.
    """
    if isinstance(value, np.ndarray):
        name = f"array{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if isinstance(value, np.generic):
        return {"scalar": value.item(), "type": value.dtype.str}
    if isinstance(value, list | tuple):
        return {type(value).__name__: [flattened(x, arrays) for x in value]}
    if isinstance(value, dict):
        return {"dict": {str(name): flattened(x, arrays) for name, x in value.items()}}
    if is_dataclass(value) and type(value) in _STORED_NAMES:
        of = {f.name: flattened(getattr(value, f.name), arrays) for f in fields(value)}
        return {"part": _STORED_NAMES[type(value)], "of": of}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"a checkpoint cannot hold a {type(value).__name__}")


def restored(data: object, arrays: Arrays) -> object:
    """Convert ``data`` from `flattened` back to the value.

    Parameters
    ----------
    arrays
        The arrays by name.
    """
    if not isinstance(data, dict):
        return data
    if "array" in data:
        return arrays[data["array"]]
    if "scalar" in data:
        kind = np.dtype(data["type"])
        if kind.kind not in PLAIN:
            raise MalformedError(f"a number cannot be of type {kind}")
        return kind.type(data["scalar"])
    if "list" in data:
        return [restored(x, arrays) for x in data["list"]]
    if "tuple" in data:
        return tuple(restored(x, arrays) for x in data["tuple"])
    if "dict" in data:
        return {name: restored(x, arrays) for name, x in data["dict"].items()}
    if data["part"] not in PARTS:
        raise MalformedError(f"a checkpoint contains no part named {str(data['part'])[:SHOWN]}")
    return PARTS[data["part"]](**{name: restored(x, arrays) for name, x in data["of"].items()})


def pack_tiles(snapshot: TilesSnapshot) -> tuple[dict[str, object], Arrays]:
    """Numbers and arrays of a snapshot, without its scenario and the records on disk; arrays are not copied."""
    arrays: Arrays = {}
    data = {
        "step": snapshot.step, "time": snapshot.time, "plan": snapshot.plan, "steps": snapshot.steps,
        "crowd": snapshot.particles, "scheme": snapshot.scheme, "records": snapshot.records.memory(),
        "farthest": snapshot.farthest, "law_gaps": snapshot.law_gaps, "instability": snapshot.instability,
    }  # fmt: skip
    return {"options": asdict(snapshot.options), "session": flattened(data, arrays)}, arrays


def restore_tiles(numbers: Mapping[str, object], arrays: Arrays, stored: Stored) -> TilesSnapshot:
    """Restore a snapshot from its packed form.

    Parameters
    ----------
    numbers, arrays
        The output of `pack_tiles`.
    stored
        The scenario, the plant and the number of records of each kind on disk.
    """
    scenario = stored.scenario
    options = stored_options(numbers["options"])
    found = restored(numbers["session"], arrays)
    check_session(found, LedgerSums, ParticleMemory, scenario)
    # `check_session` has checked every entry.
    parts = cast(SessionMemory, found)
    records = TilesRecorder(scenario, options.precision, keep_frames=options.keep_frames, observe=options.observe)
    records.recall_memory(parts["records"], stored.counts, stored.read)
    return TilesSnapshot(
        scenario, options, parts["step"], parts["time"], parts["plan"], parts["crowd"], parts["scheme"], records,
        parts["steps"], parts["farthest"], parts["law_gaps"], parts["instability"], stored.plant,
    )  # fmt: skip
