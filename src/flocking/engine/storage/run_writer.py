"""Writing of a run to disk during the simulation: append, then commit."""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from flocking.arrays import AnyArray, Array, Mask, Reals, Records, Times
from flocking.engine.runs.columns import (
    AGENT_PARTS,
    COLUMN,
    FRAME_ERROR,
    GROWING,
    LEDGER,
    OBSERVED,
    Dimensions,
    component_names,
    frame_checksums,
    number_rows,
    switch_columns,
)
from flocking.engine.runs.fidelity import Fidelity
from flocking.engine.runs.message_log import MessageLog
from flocking.engine.runs.run import Accuracy, Closest
from flocking.engine.runs.run_errors import accuracy_data, json_number
from flocking.engine.runs.stored_fidelity import fidelity_data
from flocking.engine.storage.atomic_files import (
    NOTHING_WRITTEN,
    atomic_store,
    complete_folder,
    only_writer,
    put,
    settle,
    storage_errors,
    sweep,
)
from flocking.engine.storage.bounded_chunks import bounds_of
from flocking.engine.storage.metadata import checkpoint_name
from flocking.engine.storage.new_folders import check_free, law_sum, scenario_text
from flocking.engine.storage.part_writer import PartSums, joined_sums
from flocking.engine.storage.record import (
    FORMAT,
    RECORD,
    SCENARIO,
    UNFINISHED,
    read_provenance,
    read_record,
    read_root,
    write_record,
)
from flocking.engine.storage.regular_files import first_foreign
from flocking.engine.storage.scenario_sums import stored_sums
from flocking.engine.storage.zarr_thread import zarr_calls
from flocking.errors import StorageError
from flocking.model.law import Law, Scenario

if TYPE_CHECKING:
    import zarr


class RunWriter:
    """Appends frames, switches and ledger rows to a run on disk and commits them.

    `create` makes a new folder, `reopen` continues after the last commit. Rows are visible only after `commit`. Use it
    in a ``with`` block.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        read_record(folder)
        with zarr_calls(), storage_errors(folder, "write the run"), ExitStack() as opening:
            opening.enter_context(only_writer(folder))
            self.record = read_record(folder)
            self._arrays = self._open_arrays()
            self._closing = opening.pop_all()
        self._counts = dict.fromkeys(GROWING, 0) | dict(self.record["counts"])
        self._sums = dict(self.record["checksums"])
        self.provenance = read_provenance(folder)

    @classmethod
    def create(
        cls,
        folder: str | Path,
        scenario: Scenario,
        *,
        plant: Law | None = None,
        with_links: bool = True,
        precision: str = "float64",
        observed: bool = False,
        with_errors: bool = False,
        with_log: bool = False,
        session: Mapping[str, object] | None = None,
    ) -> RunWriter:
        """Start a run in a new or empty folder; its first commit, without frames, is made at once.

        Parameters
        ----------
        folder
            The folder; it appears when it contains a readable run.
        scenario
            The scenario. One with a part from outside this library is not stored; it must then be given when reading.
        plant
            The law that agents follow, if it differs from that of the scenario.
        with_links
            Whether frames contain link matrices.
        precision
            ``"float64"`` or ``"float32"``, of the frames.
        observed
            Whether there are observables.
        with_errors
            Whether errors of the frames are stored.
        with_log
            Whether there is a log of what agents used when they acted.
        session
            Engine and options, so that a run killed before its first commit can be started again.

        Raises
        ------
        StorageError
            If the folder is not empty or cannot be written.
        """
        folder = Path(folder).resolve()
        check_free(folder)
        components = component_names(scenario)
        start = scenario.start
        size = Dimensions(start.n, start.dimension, with_links, precision, observed, with_errors, components, with_log)
        # Zarr writes in a separate thread, which an interrupt of this one does not stop.
        with (
            zarr_calls(),
            storage_errors(folder, "create the run", full=NOTHING_WRITTEN),
            complete_folder(folder) as fresh,
        ):
            text, reason = scenario_text(scenario, plant)
            put(fresh / SCENARIO, text)
            store = atomic_store(fresh)
            for name in size.names():
                size.create(store, name)
            record: dict[str, Any] = {
                "format": FORMAT, "title": scenario.name, "status": UNFINISHED, "commits": 0, "checkpoint": None,
                "n": size.n, "dimension": size.m, "links": with_links, "arrays": list(size.names()),
                "components": list(components),
                "counts": dict.fromkeys(GROWING, 0), "checksums": {}, "closest": [None, None],
                "scenario": {
                    "checksum": zlib.crc32(text), "left_out": reason, "law": law_sum(scenario.law),
                    "plant": plant is not None, **stored_sums(scenario, plant),
                },
                "session": session or {},
            }  # fmt: skip
            write_record(fresh, record, {})
        return cls(folder)

    @classmethod
    def reopen(cls, folder: str | Path) -> RunWriter:
        """Open a run to continue after its last commit; later rows are dropped.

        Raises
        ------
        StorageError
            If there is no run, or another process is writing it.
        """
        return cls(Path(folder))

    def __enter__(self) -> RunWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the lock; rows that were not committed are lost."""
        self._closing.close()

    @property
    def counts(self) -> dict[str, int]:
        """Rows appended so far along each of `flocking.engine.runs.columns.GROWING`."""
        return dict(self._counts)

    def _open_arrays(self) -> dict[str, zarr.Array]:
        """The arrays with the shapes of the last commit."""
        import zarr

        sweep(self.folder)
        if (foreign := first_foreign(self.folder)) is not None:
            raise StorageError(f"{foreign[0]}: {foreign[1]}; a run is written in its own folder.")
        read_record(self.folder)
        committed = read_root(self.folder)["consolidated_metadata"]["metadata"]
        self._store = atomic_store(self.folder, bounds_of(committed))
        for name, metadata in committed.items():
            put(self.folder / name / RECORD, json.dumps(metadata).encode(), lasting=False)
        return {name: zarr.open_array(self._store, path=name, mode="r+", zarr_format=3) for name in committed}

    def append(
        self,
        t: Times,
        q: Reals,
        p: Reals,
        links: Mask | None = None,
        errors: Array | None = None,
        columns: Array | None = None,
    ) -> None:
        """Append frames: times (F,), positions and velocities (F, N, m), links (F, N, N), errors (F, 2).

        Parameters
        ----------
        columns
            Further columns of the agents, shape (F, N, components), see `flocking.engine.runs.columns.joined_columns`.

        Raises
        ------
        StorageError
            If the disk is full or missing; committed rows stay.
        """
        kind = self._arrays["position"].dtype
        parts = {"time": np.asarray(t, dtype="f8"), "position": np.asarray(q, kind), "velocity": np.asarray(p, kind)}
        if self.record["links"]:
            parts["links"] = np.asarray(links, dtype=bool)
        if len(parts["time"]):
            parts["checksum"] = frame_checksums(parts)
            if FRAME_ERROR in self._arrays:
                unknown = np.full((len(parts["time"]), 2), np.nan)
                parts[FRAME_ERROR] = unknown if errors is None else np.asarray(errors, dtype="f8")
            if COLUMN in self._arrays:
                parts[COLUMN] = np.asarray(columns, dtype="f8")
            self._extend("time", parts)
            self._sum({name: parts[name] for name in (FRAME_ERROR, COLUMN) if name in parts})

    @property
    def shared_agents(self) -> int:
        """Agents of a chunk of a frame where several processes may write frames, else 0."""
        shapes = {self._arrays[name].chunks[:2] for name in AGENT_PARTS if name in self._arrays}
        alone = self.record["links"] or FRAME_ERROR in self._arrays or len(shapes) > 1
        frames, agents = next(iter(shapes))
        return 0 if alone or frames != 1 or agents >= self.record["n"] else int(agents)

    def make_room(self, t: Times) -> int:
        """Make room for frames whose parts are written by several processes; the number of the first one.

        Parameters
        ----------
        t
            Their times.

        Raises
        ------
        StorageError
            If the disk is full or missing.
        """
        old = self._counts["time"]
        with zarr_calls(), storage_errors(self.folder, "append to the run"):
            for name in AGENT_PARTS:
                if name in self._arrays:
                    array = self._arrays[name]
                    array.resize((old + len(t), *array.shape[1:]))
        return old

    def note_parts(self, t: Times, written: Sequence[Sequence[PartSums]]) -> None:
        """Note frames for which there was room, and whose parts have been written.

        Parameters
        ----------
        t
            Their times.
        written
            What `flocking.engine.storage.part_writer.write_parts` gave in each process, in the order of the agents.

        Raises
        ------
        StorageError
            If the disk is full or missing.
        """
        times = np.asarray(t, dtype="f8")
        found, columns = joined_sums(times, written, self._sums.get(COLUMN, 0))
        if COLUMN in self._arrays:
            self._sums[COLUMN] = columns
        self._extend("time", {"time": times, "checksum": found})

    def append_records(self, switches: Records, trace: Records, observed: Records | None = None) -> None:
        """Append switches, fields `SWITCH_FIELDS`, ledger rows, `TRACE_FIELDS`, and observables, `OBSERVED_FIELDS`.

        Parameters
        ----------
        switches, trace, observed
            Structured arrays, shape (K,) each.

        Raises
        ------
        StorageError
            If the disk is full or missing; committed rows stay.
        """
        if len(switches):
            # A run of format 1 has no columns for errors.
            columns = {name: x for name, x in switch_columns(switches).items() if name in self._arrays}
            self._extend("switch", columns)
            self._sum(columns)
        if len(trace):
            # Runs of earlier versions continue without the last field of the ledger.
            ledger = {LEDGER: np.ascontiguousarray(number_rows(trace)[:, : self._arrays[LEDGER].shape[1]])}
            self._extend("step", ledger)
            self._sum(ledger)
        if observed is not None and len(observed) and OBSERVED in self._arrays:
            seen = {OBSERVED: number_rows(observed)}
            self._extend("observation", seen)
            self._sum(seen)

    def append_log(self, log: MessageLog | None) -> None:
        """Append to the ``log`` of what agents used, in a run that has one.

        Raises
        ------
        StorageError
            If the disk is full or missing; committed rows stay.
        """
        if log is None or not len(log.ticks) or "tick" not in self._arrays:
            return
        acts, entries = {"tick": log.ticks, "tick_force": log.forces}, {"use": log.uses}
        self._extend("tick", acts)
        self._sum(acts)
        if len(log.uses):
            self._extend("use", entries)
            self._sum(entries)

    def _sum(self, columns: Mapping[str, AnyArray]) -> None:
        for name, values in columns.items():
            self._sums[name] = zlib.crc32(np.ascontiguousarray(values).tobytes(), self._sums.get(name, 0))

    def _extend(self, dimension: str, parts: Mapping[str, AnyArray]) -> None:
        old = self._counts[dimension]
        new = old + len(next(iter(parts.values())))
        with zarr_calls(), storage_errors(self.folder, "append to the run"):
            for name, values in parts.items():
                array = self._arrays[name]
                array.resize((new, *array.shape[1:]))
                array[old:new] = values
        self._counts[dimension] = new

    def commit(
        self,
        status: str = UNFINISHED,
        *,
        closest: tuple[Closest, Closest] = (Closest(), Closest()),
        accuracy: Accuracy | None = None,
        provenance: Mapping[str, object] | None = None,
        fidelity: Fidelity | None = None,
        checkpoint: bytes | Callable[[BinaryIO], None] | None = None,
    ) -> None:
        """Make all appended rows part of the run, in one step.

        Parameters
        ----------
        status
            State of the run.
        closest
            Closest linked and unlinked pair so far.
        accuracy
            Estimates of the errors so far.
        provenance
            Origin of the run.
        fidelity
            Its `Fidelity`.
        checkpoint
            Data that `resume` needs to continue after the last frame, or a function that writes them; None if the run
            cannot continue.

        Raises
        ------
        StorageError
            If the disk is full or missing; the previous commit stays.
        """
        number = self.record["commits"] + 1
        record = {
            **self.record, "status": status, "counts": dict(self._counts), "checksums": dict(self._sums),
            "closest": [_closest_data(c) for c in closest], "commits": number, "checkpoint": None,
            "accuracy": None if accuracy is None else accuracy_data(accuracy),
            "fidelity": None if fidelity is None else fidelity_data(fidelity),
        }  # fmt: skip
        with storage_errors(self.folder, "commit to the run"):
            if checkpoint is not None:
                name = checkpoint_name(number)
                record["checkpoint"] = {"file": name, "checksum": put(self.folder / name, checkpoint)}
            settle(self._store.touched | {self.folder})
            self.provenance = dict(provenance or {})
            write_record(self.folder, record, self.provenance)
        self.record = record
        self._store.touched.clear()
        for old in self.folder.glob("checkpoint-*.npz"):
            if record["checkpoint"] is None or old.name != record["checkpoint"]["file"]:
                old.unlink(missing_ok=True)

    def mark(self, status: str) -> None:
        """Change the status of the last commit.

        Raises
        ------
        StorageError
            If the disk is full or missing.
        """
        record = {**self.record, "status": status}
        with storage_errors(self.folder, "mark the run"):
            write_record(self.folder, record, self.provenance)
        self.record = record


def _closest_data(found: Closest) -> list[object] | None:
    if not np.isfinite(found.distance):
        return None
    return [found.distance, found.time, list(found.pair), json_number(found.error)]
