"""The arrays of a run on disk: their names, dimensions, units, chunks and checksums."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray, Array, Records
from flocking.engine.runs.message_log import TICK_PARTS, USE_PARTS
from flocking.engine.runs.run import OBSERVED_FIELDS, SWITCH_FIELDS, TRACE_FIELDS
from flocking.model.law import Scenario

CHUNK_BYTES = 2**20
"""Target size of a chunk before compression."""

LONGEST_CHUNK = 4096
"""Most rows of a chunk: a small run is one chunk, and appending rewrites no more than that."""
SPLIT_BYTES = 2**22
"""Most bytes of the agents of a chunk before compression: a frame of very many agents is split into several chunks,
which the processes of a run write each for itself. Four are a frame of a million agents in the plane."""
LARGEST_CHUNK = 2**25
"""Most bytes of a chunk of other arrays, and of those of earlier versions."""

FRAME_PARTS = ("time", "position", "velocity", "links")
"""Arrays of a frame; all but the time have a checksum per frame, and that of positions includes the time."""

GROWING = ("time", "step", "switch", "observation", "tick", "use")
"""Dimensions that grow while a run goes on."""

KINDS = ("appear", "break", "kink", "obstacle")
"""Kinds of switches; they are stored by number."""

LEDGER = "ledger"
QUANTITIES = tuple(TRACE_FIELDS.names or ())
OBSERVED = "observables"
MEASURES = tuple(OBSERVED_FIELDS.names or ())
AXES = ("x", "y", "z")

SWITCHES = {
    "switch_time": "f8", "switch_agent": "i8", "switch_neighbour": "i8", "switch_kind": "u1", "switch_graph": "i8",
    "switch_speed": "f8", "switch_tangential": "?", "switch_time_error": "f8", "switch_speed_error": "f8",
}  # fmt: skip
"""Columns of the table of switches, in the order of `SWITCH_FIELDS`."""

FRAME_ERROR = "frame_error"
ERRORS = ("position", "velocity")
"""Columns of the errors of frames."""

COLUMN = "column"
"""The array of further columns of the agents, beside positions and velocities, joined along the last axis."""

AGENT_PARTS = ("position", "velocity", COLUMN)
"""Arrays of a frame with a row for each agent."""

LOG = ("tick", "tick_force", "use")
"""Arrays of the log of what agents used when they acted."""

ARRAYS: dict[str, tuple[tuple[str, ...], str, dict[str, object]]] = {
    "time": (("time",), "f8", {"units": "unit of time", "long_name": "time of the frame"}),
    "position": (("time", "agent", "axis"), "f8", {"units": "unit of length", "long_name": "positions q"}),
    "velocity": (
        ("time", "agent", "axis"), "f8", {"units": "unit of length / unit of time", "long_name": "velocities p"},
    ),
    "links": (
        ("time", "agent", "neighbour"), "?", {"long_name": "whether the agent senses the neighbour", "units": "1"},
    ),
    "checksum": (("time", "part"), "u4", {"long_name": "CRC-32 of positions with time, of velocities, of links"}),
    FRAME_ERROR: (("time", "error"), "f8", {"long_name": "estimated errors of positions and velocities"}),
    COLUMN: (("time", "agent", "component"), "f8", {"long_name": "further columns of the agents"}),
    LEDGER: (("step", "quantity"), "f8", {
        "long_name": "energy ledger at every step", "units": "unit of energy, but of time for the time",
    }),
    OBSERVED: (("observation", "measure"), "f8", {"long_name": "what was observed at the frame times"}),
    "tick": (("tick", "tick_part"), "i8", {"long_name": "nanosecond, agent and number of entries of every act"}),
    "tick_force": (("tick", "axis"), "f8", {"long_name": "force that an agent computed when it acted"}),
    "use": (("use", "use_part"), "i8", {"long_name": "graph, sender and number of every sample used"}),
    **{name: (("switch",), kind, {"long_name": f"{name.partition('_')[2].replace('_', ' ')} of the switch"})
       for name, kind in SWITCHES.items()},
    "agent": (("agent",), "i8", {"long_name": "number of the agent"}),
    "neighbour": (("neighbour",), "i8", {"long_name": "number of the neighbour"}),
    "axis": (("axis",), "str", {"long_name": "axis in space"}),
    "quantity": (("quantity",), "str", {"long_name": "column of the ledger"}),
    "measure": (("measure",), "str", {"long_name": "what is observed"}),
    "error": (("error",), "str", {"long_name": "what the error is of"}),
    "component": (("component",), "str", {"long_name": "name of a further column and number within it"}),
}  # fmt: skip
"""Dimensions, type and attributes of every array. Positions and velocities of a run in single precision are f4."""
ARRAYS["switch_kind"][2].update({"flag_values": list(range(len(KINDS))), "flag_meanings": " ".join(KINDS)})


@dataclass(frozen=True)
class Dimensions:
    """Sizes of the arrays of one run.

    Parameters
    ----------
    with_links
        Whether frames hold link matrices.
    precision
        ``"float64"`` or ``"float32"``, of positions and velocities.
    observed
        Whether there are observations.
    with_errors
        Whether errors of frames are known.
    components
        Names of the numbers that agents have beside positions and velocities.
    with_log
        Whether there is a log of what agents used when they acted.
    """

    n: int
    m: int
    with_links: bool
    precision: str = "float64"
    observed: bool = False
    with_errors: bool = False
    components: tuple[str, ...] = ()
    with_log: bool = False

    @property
    def agents_in_chunk(self) -> int:
        """Agents of a chunk of a frame: the same of positions, velocities and further columns."""
        return min(self.n, max(1, SPLIT_BYTES // (8 * max(self.m, len(self.components)))))

    def names(self) -> tuple[str, ...]:
        """Names of the arrays there are."""
        left_out = (
            (() if self.with_links else ("links", "neighbour"))
            + (() if self.observed else (OBSERVED, "measure"))
            + (() if self.with_errors else (FRAME_ERROR, "error"))
            + (() if self.components else (COLUMN, "component"))
            + (() if self.with_log else LOG)
        )
        return tuple(name for name in ARRAYS if name not in left_out)

    def _labels(self, name: str) -> object:
        if name == "axis":
            return list(AXES[: self.m]) if self.m <= len(AXES) else [f"x{k + 1}" for k in range(self.m)]
        columns = {"quantity": QUANTITIES, "measure": MEASURES, "error": ERRORS, "component": self.components}
        return list(columns[name]) if name in columns else np.arange(self.n)

    def create(self, store: object, name: str) -> None:
        """Create one array in a store: empty along the axis that grows, coordinates with their labels."""
        import zarr

        dimensions, kind, attributes = ARRAYS[name]
        if name in ("position", "velocity"):
            kind = self.precision
        grows = dimensions[0] in GROWING
        sizes = {"agent": self.n, "neighbour": self.n, "axis": self.m, "quantity": len(QUANTITIES),
                 "measure": len(MEASURES), "error": len(ERRORS), "part": 3 if self.with_links else 2,
                 "component": len(self.components), "tick_part": len(TICK_PARTS),
                 "use_part": len(USE_PARTS)}  # fmt: skip
        shape = tuple(sizes.get(d, 0) for d in dimensions)
        row = int(np.prod(shape[1:])) * (1 if kind == "str" else np.dtype(kind).itemsize)
        first = max(1, min(LONGEST_CHUNK, CHUNK_BYTES // max(row, 1))) if grows else max(shape[0], 1)
        rest = shape[1:]
        if name in AGENT_PARTS:
            rest = (self.agents_in_chunk, *rest[1:])
        elif row > LARGEST_CHUNK:
            rest = (max(1, LARGEST_CHUNK * rest[0] // row), *rest[1:])
        array = zarr.create_array(
            store, name=name, shape=shape, chunks=(first, *rest), dtype=kind, dimension_names=dimensions,
            attributes=attributes,
        )  # fmt: skip
        if not grows:
            array[:] = np.array(self._labels(name), dtype=object if kind == "str" else kind)


def component_names(scenario: Scenario) -> tuple[str, ...]:
    """Names of the components of the further columns of a scenario's agents."""
    widths = scenario.agents.widths(scenario.start.dimension)
    return tuple(f"{name}_{k}" for name, width in widths.items() for k in range(width))


def joined_columns(scenario: Scenario, columns: Mapping[str, Array]) -> Array | None:
    """Further ``columns`` of some frames, shape (F, N, width) each, joined along the last axis; None without any."""
    return np.concatenate([columns[c.name] for c in scenario.agents.columns], axis=2) if columns else None


def separate_columns(scenario: Scenario, stored: Array) -> dict[str, Array]:
    """Columns by name from the array ``stored`` that `joined_columns` gives, shape (F, N, components)."""
    found, first = {}, 0
    for name, width in scenario.agents.widths(scenario.start.dimension).items():
        found[name] = stored[:, :, first : first + width]
        first += width
    return found


def frame_checksums(parts: dict[str, AnyArray]) -> NDArray[np.uint32]:
    """CRC-32 of each part of each frame, shape (F, 3), or (F, 2) without links.

    Parameters
    ----------
    parts
        The stored arrays of some frames by name; the first axis of each counts the frames.
    """
    present = [name for name in FRAME_PARTS[1:] if name in parts]
    found = np.empty((len(parts["time"]), len(present)), dtype=np.uint32)
    for k in range(len(found)):
        for column, name in enumerate(present):
            begin = zlib.crc32(parts["time"][k].tobytes()) if name == "position" else 0
            found[k, column] = zlib.crc32(np.ascontiguousarray(parts[name][k]).tobytes(), begin)
    return found


def switch_columns(switches: Records) -> dict[str, AnyArray]:
    """The structured array ``switches``, fields `SWITCH_FIELDS`, as the columns stored."""
    names = SWITCH_FIELDS.names or ()
    columns = {}
    for column, field in zip(SWITCHES, names, strict=True):
        values = switches[field]
        if field == "kind":
            values = np.array([KINDS.index(str(v)) for v in values])
        columns[column] = np.ascontiguousarray(values, dtype=SWITCHES[column])
    return columns


def switch_table(columns: Mapping[str, AnyArray]) -> Records:
    """Structured array, fields `SWITCH_FIELDS`, from the stored ``columns`` by name, shape (K,) each.

    Runs of format 1 have no errors; they become NaN.
    """
    table = np.empty(len(columns["switch_time"]), dtype=SWITCH_FIELDS)
    for column, field in zip(SWITCHES, SWITCH_FIELDS.names or (), strict=True):
        if column not in columns:
            table[field] = np.nan
            continue
        values = columns[column]
        table[field] = np.array(KINDS)[values] if field == "kind" else values
    return table


def number_rows(table: Records) -> Array:
    """The fields of a structured array ``table``, shape (K,), as columns of numbers, shape (K, fields)."""
    return np.stack([table[name].astype(np.float64) for name in table.dtype.names or ()], axis=-1)


def table_of(rows: Array, fields: np.dtype[np.void]) -> Records:
    """Structured array with these ``fields`` from ``rows`` of `number_rows`; fields that older rows lack are 0."""
    table = np.zeros(len(rows), dtype=fields)
    for name, values in zip(fields.names or (), rows.T, strict=False):
        table[name] = values
    return table
