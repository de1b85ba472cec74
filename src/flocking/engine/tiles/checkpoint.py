"""A snapshot of a tiled session as plain numbers and named arrays, and back."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import Any

import numpy as np

from flocking.engine.archives.archive import PLAIN, Arrays
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.fixed_step.law_gaps import LawGaps
from flocking.engine.runs.run import Closest
from flocking.engine.tiles.checkpoint_form import check_session
from flocking.engine.tiles.instability import Instability
from flocking.engine.tiles.integrators import LedgerSums
from flocking.engine.tiles.neighbours.neighbour_lists import TileLists
from flocking.engine.tiles.particle_memory import ParticleMemory
from flocking.engine.tiles.records import Records
from flocking.engine.tiles.session import TilesOptions, TilesSession, TilesSnapshot
from flocking.model.law import Law, Scenario

PARTS: dict[str, type[object]] = {
    "Books": LedgerSums, "Closest": Closest, "CrowdMemory": ParticleMemory, "Instability": Instability,
    "LawGaps": LawGaps, "TileLists": TileLists,
}  # fmt: skip
"""Classes that memory may hold, by their names in files."""

_STORED_NAMES = {part: name for name, part in PARTS.items()}


def flattened(value: Any, arrays: Arrays) -> object:
    """A value as data for JSON; arrays go to ``arrays`` and leave their name.

    Raises
    ------
    TypeError
        When the value holds what cannot be stored.
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
    if type(value) in _STORED_NAMES:
        return {"part": _STORED_NAMES[type(value)], "of": {f.name: flattened(getattr(value, f.name), arrays)
                                                     for f in fields(value)}}  # fmt: skip
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"a checkpoint cannot hold a {type(value).__name__}")


def restored(data: Any, arrays: Arrays) -> Any:
    """The value that `flattened` gave ``data`` for.

    Parameters
    ----------
    arrays
        Arrays by the names that ``data`` mentions.
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
        raise MalformedError(f"memory holds no part called {str(data['part'])[:40]}")
    return PARTS[data["part"]](**{name: restored(x, arrays) for name, x in data["of"].items()})


def pack_tiles(session: TilesSession) -> tuple[dict[str, object], Arrays]:
    """Numbers and arrays of a session, but for its scenario and the records on disk; arrays are not copied."""
    arrays: Arrays = {}
    snapshot = session.snapshot(copied=False)
    data = {
        "step": snapshot.step, "time": snapshot.time, "plan": snapshot.plan, "steps": snapshot.steps,
        "crowd": snapshot.particles, "scheme": snapshot.scheme, "records": snapshot.records.memory(),
        "farthest": snapshot.farthest, "law_gaps": snapshot.law_gaps, "instability": snapshot.instability,
    }  # fmt: skip
    return {"options": asdict(snapshot.options), "session": flattened(data, arrays)}, arrays


def restore_tiles(
    numbers: dict[str, Any],
    arrays: Arrays,
    scenario: Scenario,
    stored: dict[str, int],
    threads: int | None,
    plant: Law | None = None,
) -> TilesSession:
    """The session that was packed, with so many records of each kind ``stored`` on disk.

    Parameters
    ----------
    numbers, arrays
        What was packed.
    threads
        Number of threads; all processors when absent.
    plant
        The law the agents really obey.
    """
    options = TilesOptions(**numbers["options"])
    parts = restored(numbers["session"], arrays)
    check_session(parts, LedgerSums, ParticleMemory, scenario)
    records = Records(scenario, options.precision, keep_frames=options.keep_frames, observe=options.observe)
    records.recall(parts["records"], stored)
    snapshot = TilesSnapshot(
        scenario, options, parts["step"], parts["time"], parts["plan"], parts["crowd"], parts["scheme"], records,
        parts["steps"], parts["farthest"], parts["law_gaps"], parts["instability"],
        plant,
    )  # fmt: skip
    return TilesSession.resume(snapshot, threads=threads)
