"""Checks of the record of a run and of the metadata of its arrays, before its data are decoded."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from flocking.engine.archives.data_checks import And, Flag, Integer, MalformedError, Many, Maybe, Names, Row, Text
from flocking.engine.runs.columns import ARRAYS, ERRORS, GROWING, LARGEST_CHUNK, MEASURES, QUANTITIES
from flocking.engine.runs.message_log import TICK_PARTS, USE_PARTS
from flocking.engine.runs.run import FIRST_QUANTITIES
from flocking.engine.storage.bounded_chunks import COMPRESSORS

CODECS = ("bytes", "crc32c", "gzip", "vlen-utf8", "zstd")
"""Codecs of Zarr format 3 that a run may use. None of them executes data."""

TYPES = {"f8": "float64", "f4": "float32", "i8": "int64", "u4": "uint32", "u1": "uint8", "?": "bool", "str": "string"}
"""Zarr's names of the types of `flocking.engine.runs.columns.ARRAYS`."""

MOST_CODECS = len(CODECS)
"""Codecs of one array: each of them once."""

MOST_PIECES, LEAST_PIECE = 1000, 2**10
"""An array may have so many chunks, and one more for every 1024 bytes: this library stores 4096 rows, or megabytes, in
a chunk. Zarr keeps a task for every chunk, and a million of them take minutes."""

CHECKPOINT_DIGITS = 6
"""Number of digits in the name of a checkpoint, so that names sort like numbers up to a million."""

MOST_ROWS = 2**48
"""Upper bound on the rows of any table, larger than any disk."""


def checkpoint_name(number: int) -> str:
    """Name of the checkpoint file of a commit with this ``number``."""
    return f"checkpoint-{number:0{CHECKPOINT_DIGITS}d}.npz"


def _is_checkpoint(name: str) -> bool:
    digits = name.removeprefix("checkpoint-").removesuffix(".npz")
    return digits.isascii() and digits.isdigit() and name == checkpoint_name(int(digits[:18]))


_CHECKPOINT_FILE = And(Text(), "be the name of a checkpoint", _is_checkpoint)
_CHECKPOINT = Names({"file": _CHECKPOINT_FILE, "checksum": Integer()})
_RECORD = Names(
    {
        "format": Integer(1), "title": Text(), "status": Text(), "commits": Integer(),
        "checkpoint": Maybe(_CHECKPOINT),
        "n": Integer(1), "dimension": Integer(1), "links": Flag(), "arrays": Many(Text(tuple(ARRAYS))),
        "counts": Names({"time": Integer(0, MOST_ROWS)}, {name: Integer(0, MOST_ROWS) for name in GROWING}),
        "checksums": Names({}, {name: Integer() for name in ARRAYS}),
        "scenario": Names({"checksum": Integer(), "left_out": Maybe(Text())}, others=True),
    },
    {"components": Many(Text())},
    others=True,
)  # fmt: skip


def check_metadata(root: dict[str, Any], record: dict[str, Any]) -> None:
    """Check that a record and the metadata of arrays have the form that this library writes.

    Parameters
    ----------
    root
        Content of the file with both.
    record
        The record of the last commit.

    Raises
    ------
    MalformedError
        If something is wrong; the message names it.
    """
    _RECORD.check(record, "")
    Names(
        {"zarr_format": Integer(3, 3), "node_type": Text(("group",)), "attributes": Names({}, others=True),
         "consolidated_metadata": Names({"metadata": Names({}, others=True)}, others=True)},
    ).check(root, "")  # fmt: skip
    arrays = root["consolidated_metadata"]["metadata"]
    if sorted(arrays) != sorted(record["arrays"]):
        raise MalformedError("metadata must be of the arrays of the run")
    missing = {"time", "position", "velocity", "checksum", "ledger"} - set(arrays)
    if missing:
        raise MalformedError(f"arrays must hold {', '.join(sorted(missing))}")
    for name, data in arrays.items():
        _check_array(name, data, record)
    if arrays["position"]["data_type"] != arrays["velocity"]["data_type"]:
        raise MalformedError("positions and velocities must have one precision")


def _check_array(name: str, data: Any, record: dict[str, object]) -> None:
    dimensions, kind, _ = ARRAYS[name]
    kinds: tuple[str, ...] = (TYPES[kind],)
    if name in ("position", "velocity"):
        kinds = ("float64", "float32")
    shape = [*_sizes(dimensions, record)]
    # Runs of earlier versions lack the last field of the ledger.
    least = [FIRST_QUANTITIES if name == "quantity" else k for name, k in zip(dimensions, shape, strict=True)]
    transformers = And(Many(Text()), "hold no transformers", lambda x: not x)
    grid = Names({"name": Text(("regular",)), "configuration": Names({"chunk_shape": Row([Integer(1)] * len(shape))})})
    codec = Names({"name": Text(CODECS)}, others=True)
    few = And(Many(codec), f"be at most {MOST_CODECS}", lambda x: len(x) <= MOST_CODECS)
    # Data packed twice would be bounded after the first unpacking alone.
    codecs = And(few, "be packed once", lambda x: sum(c["name"] in COMPRESSORS for c in x) < 2)
    keys = Names({"name": Text(("default",))}, others=True)
    Names(
        {"zarr_format": Integer(3, 3), "node_type": Text(("array",)), "shape": Row([*map(Integer, least, shape)]),
         "data_type": Text(kinds), "chunk_grid": grid, "chunk_key_encoding": keys, "codecs": codecs},
        {"storage_transformers": transformers}, others=True,
    ).check(data, name)  # fmt: skip
    size = 1 if kind == "str" else np.dtype(data["data_type"]).itemsize
    chunks = data["chunk_grid"]["configuration"]["chunk_shape"]
    if math.prod(chunks) * size > 2 * LARGEST_CHUNK:
        raise MalformedError(f"{name}: chunks must be of {LARGEST_CHUNK // 2**20} MiB at most")
    pieces = math.prod(-(-k // chunk) for k, chunk in zip(data["shape"], chunks, strict=True))
    if pieces > MOST_PIECES + math.prod(data["shape"]) * size // LEAST_PIECE:
        raise MalformedError(f"{name}: chunks must not be {pieces} pieces of an array of shape {tuple(data['shape'])}")


def _sizes(dimensions: tuple[str, ...], record: Mapping[str, Any]) -> Iterator[int]:
    known = {
        "agent": record["n"], "neighbour": record["n"], "axis": record["dimension"], "quantity": len(QUANTITIES),
        "measure": len(MEASURES), "error": len(ERRORS), "part": 3 if record["links"] else 2,
        "component": len(record.get("components", [])), "tick_part": len(TICK_PARTS), "use_part": len(USE_PARTS),
    }  # fmt: skip
    for name in dimensions:
        yield known[name] if name in known else record["counts"].get(name, 0)
