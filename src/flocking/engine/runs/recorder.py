"""Records of a session, in memory or already on disk; engines add their own."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Self

import numpy as np

from flocking.arrays import Array, Links, Reals
from flocking.engine.runs.columns import GROWING
from flocking.engine.runs.frame_parts import FramePart
from flocking.engine.runs.message_log import CHANGED, LogRecorder, changed_times
from flocking.engine.runs.new_records import NewRecords, RecordLayout, RecordTables, stacked_columns
from flocking.engine.runs.run import (
    OBSERVED_FIELDS,
    OF_VELOCITIES,
    SWITCH_FIELDS,
    Closest,
    Run,
    SwitchRow,
    ledger_of,
)
from flocking.errors import InvalidInput
from flocking.model.law import Scenario

MOST_FRAME_BYTES = 8 * 2**30
"""Largest memory of the frames of a run that is not written to disk meanwhile."""

MOST_LINKED = 2000
"""Largest group whose states and frames hold link matrices."""

MOST_LINK_BYTES = 256 * 2**20
"""Frames hold link matrices only up to this size in total."""

UNKNOWN_ERRORS = (np.inf, np.inf)
"""Errors of a frame of which nothing is known."""

NO_COLUMNS: Mapping[str, Array] = MappingProxyType({})
"""Further columns of agents without any."""


class Recorder:
    """Collects the records of a run.

    Attributes
    ----------
    t, q, p, columns, links, errors
        Frames in memory: times, positions, velocities, further columns and, where they are kept, links and errors.
    switches, trace, observed
        Rows of `SWITCH_FIELDS`, `flocking.engine.runs.run.TRACE_FIELDS` and `OBSERVED_FIELDS` in memory.
    parts
        Frames in memory after those, of which this process has some agents.
    stored
        Numbers of records that are on disk alone.
    energy_rounding
        Largest error of the energy from rounding that a check of the ledger needed until now.
    closest_linked, closest_unlinked
        Closest pairs until now.

    Parameters
    ----------
    precision
        ``"float64"`` or ``"float32"``, of the stored frames.
    keep_frames
        Whether positions and velocities are stored.
    with_links
        Whether frames hold link matrices; where absent those of groups that are not too large do.
    with_errors
        Whether errors of frames are known.
    observe
        Whether there are observations.
    with_log
        Whether there is a log of what agents used when they acted.
    lets_go
        Whether records that are on disk leave memory.
    """

    replaced_at: tuple[float, ...] = ()
    """Times at which the law or the state of a session of continuous control was replaced."""

    open_rows = 0
    """Number of the last rows of the ledger that may still change."""

    def __init__(
        self,
        scenario: Scenario,
        *,
        precision: str = "float64",
        keep_frames: bool = True,
        with_links: bool | None = None,
        with_errors: bool = False,
        observe: bool = False,
        with_log: bool = False,
        lets_go: bool = True,
    ) -> None:
        self.frame_times = scenario.frame_times
        self.n, self.m = scenario.start.q.shape
        self._moving = scenario.agents.order > 1
        self.precision, self.dtype = precision, np.dtype(precision)
        self.keep_frames, self.with_errors, self.observe, self.lets_go = keep_frames, with_errors, observe, lets_go
        small = self.n <= MOST_LINKED and len(self.frame_times) * self.n**2 <= MOST_LINK_BYTES
        self.with_links = keep_frames and (small if with_links is None else with_links)
        self.stored = dict.fromkeys(GROWING, 0)
        self.parts: list[FramePart] = []
        self.t: list[float] = []
        self.q: list[Reals] = []
        self.p: list[Reals] = []
        self.columns: list[Mapping[str, Array]] = []
        self.links: list[Links] = []
        self.errors: list[tuple[float, float]] = []
        self.switches: list[SwitchRow] = []
        self.trace: list[tuple[float, ...]] = []
        self.observed: list[tuple[float, ...]] = []
        self.log = LogRecorder(self.m) if with_log else None
        self.energy_rounding = 0.0
        self.closest_linked = Closest()
        self.closest_unlinked = Closest()
        self._skipped = 0

    def copy(self) -> Self:
        """An independent recorder. The rows are shared: none is changed after it was made."""
        other = copy.copy(self)
        for name, value in vars(self).items():
            if isinstance(value, list | dict | LogRecorder):
                setattr(other, name, copy.copy(value))
        return other

    @property
    def count(self) -> int:
        """Number of frames until now: in memory, on disk, or not stored."""
        return self._skipped + self.stored["time"] + len(self.t) + len(self.parts)

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of records of each kind, on disk and in memory."""
        now = {
            "time": len(self.t) + len(self.parts), "step": len(self.trace), "switch": len(self.switches),
            "observation": len(self.observed), **self._logged,
        }  # fmt: skip
        return {name: self.stored[name] + now[name] for name in GROWING}

    @property
    def _logged(self) -> dict[str, int]:
        log = self.log
        return {"tick": 0 if log is None else len(log.ticks), "use": 0 if log is None else len(log.uses)}

    def due(self, t: float) -> bool:
        """Whether a frame is due at time ``t``, on or after its time."""
        return self.count < len(self.frame_times) and bool(t >= self.frame_times[self.count])

    def keep_no_frames(self) -> None:
        """Drop the frames in memory and store no later ones."""
        self._skipped += len(self.t)
        for rows in (self.t, self.q, self.p, self.columns, self.links, self.errors):
            rows.clear()
        self.keep_frames = self.with_links = False

    def skip(self) -> None:
        """Count a frame that is due and not stored."""
        self._skipped += 1

    def frame(
        self,
        t: float,
        q: Reals,
        p: Reals,
        links: Links | None = None,
        errors: tuple[float, float] = UNKNOWN_ERRORS,
        observed: tuple[float, ...] | None = None,
        columns: Mapping[str, Array] = NO_COLUMNS,
    ) -> None:
        """Store a frame.

        Parameters
        ----------
        links
            Link matrix, shape (N, N), where there is one.
        errors
            Errors of any position and of any velocity in it.
        observed
            Observations of the frame, fields `OBSERVED_FIELDS`.
        columns
            Further columns of the agents by name, shape (N, width) each.
        """
        if observed is not None:
            self.observed.append(observed if self._moving else _without_velocities(observed))
        if not self.keep_frames:
            self.skip()
            return
        # The time comes last: a frame counts once it has one, so an interrupt in between loses nothing else.
        count = len(self.t)
        self.q[count:], self.p[count:] = [q.astype(self.dtype)], [p.astype(self.dtype)]
        self.columns[count:] = [{name: values.copy() for name, values in columns.items()}]
        if self.with_links and links is not None:
            self.links[count:] = [np.array(links, dtype=bool)]
        if self.with_errors:
            self.errors[count:] = [errors]
        self.t.append(t)

    def frames(self, t: list[float], q: Reals, p: Reals, links: Links, errors: list[tuple[float, float]]) -> None:
        """Store frames of agents without further columns, as `frame` does each.

        Parameters
        ----------
        t
            Their times.
        q, p
            Positions and velocities, shape (k, N, m).
        links
            Link matrices, shape (k, N, N).
        errors
            Errors of positions and of velocities.
        """
        if not self.keep_frames:
            self._skipped += len(t)
            return
        count = len(self.t)
        self.q[count:], self.p[count:] = q.astype(self.dtype), p.astype(self.dtype)
        self.columns[count:] = [{}] * len(t)
        if self.with_links:
            self.links[count:] = links
        if self.with_errors:
            self.errors[count:] = errors
        self.t += t

    @property
    def frame_bytes(self) -> float:
        """Memory of a frame that leaves memory once it is on disk."""
        return self.n * self.m * 2.0 * self.dtype.itemsize if self.keep_frames and self.lets_go else 0.0

    @property
    def waiting(self) -> float:
        """Bytes of frames in memory that are to be written to disk."""
        return (len(self.t) + len(self.parts)) * self.frame_bytes

    def check_fits(self) -> None:
        """Refuse frames that do not fit into memory.

        Raises
        ------
        InvalidInput
            When they would take more than 8 GiB.
        """
        size = len(self.frame_times) * self.frame_bytes
        if size > MOST_FRAME_BYTES:
            raise InvalidInput(
                "Scenario", "frames", f"must fit in {MOST_FRAME_BYTES / 2**30:g} GiB of memory for {self.n} agents",
                f"{len(self.frame_times)} frames ({size / 2**30:.3g} GiB)",
                "Save the run while it goes on with save=folder (--out FOLDER), give fewer frames, or give "
                "keep_frames=False (--no-frames) and observe=True (--observe).",
            )  # fmt: skip

    @property
    def layout(self) -> RecordLayout:
        """How the records are stored on disk, as options of `flocking.engine.storage.run_writer.RunWriter.create`."""
        return {
            "with_links": self.with_links, "precision": self.precision, "observed": self.observe,
            "with_errors": self.with_errors, "with_log": self.log is not None,
        }  # fmt: skip

    def since(self, counts: Mapping[str, int], *, complete: bool) -> NewRecords:
        """Records after the first ``counts`` of each kind; unless ``complete``, without open ledger rows."""
        first = {name: counts[name] - self.stored[name] for name in GROWING}
        frames = slice(first["time"], len(self.t))
        rows = self.trace if complete else self.trace[: len(self.trace) - self.open_rows]
        q, p = self._motion(frames)
        return NewRecords(
            np.array(self.t[frames]), q, p, np.array(self.links[frames]) if self.with_links else None,
            np.array(self.switches[first["switch"] :], dtype=SWITCH_FIELDS),
            ledger_of(rows[first["step"] :]),
            np.array(self.observed[first["observation"] :], dtype=OBSERVED_FIELDS) if self.observe else None,
            np.array(self.errors[frames]).reshape(-1, 2) if self.with_errors else None,
            stacked_columns(self.columns[frames]),
            None if self.log is None else self.log.part(first["tick"], first["use"]),
        )  # fmt: skip

    def forget(self, counts: Mapping[str, int]) -> None:
        """Release the first ``counts`` records of each kind, which are on disk now, unless all stay in memory."""
        if not self.lets_go:
            return
        for rows, kind in (
            (self.t, "time"), (self.q, "time"), (self.p, "time"), (self.columns, "time"), (self.links, "time"),
            (self.errors, "time"), (self.trace, "step"), (self.switches, "switch"), (self.observed, "observation"),
        ):  # fmt: skip
            del rows[: counts[kind] - self.stored[kind]]
        if self.log is not None:
            self.log.drop(counts["tick"] - self.stored["tick"], counts["use"] - self.stored["use"])
        self.stored = {name: counts[name] for name in GROWING}

    def forget_parts(self, *, stored: bool) -> None:
        """Release the parts of frames, which are on disk now.

        Parameters
        ----------
        stored
            Whether `forget` has counted these frames, as it does in the process that writes.
        """
        self._skipped += 0 if stored else len(self.parts)
        self.parts.clear()

    def note_replacement(self, time: float) -> None:
        """Note that the law or the state is replaced at a ``time``: the scenario alone does not make the run again."""
        self.replaced_at = (*self.replaced_at, float(time))

    @property
    def replacements(self) -> dict[str, object]:
        """Entry of the provenance on what was replaced, empty where nothing was."""
        return {CHANGED: list(self.replaced_at)} if self.replaced_at else {}

    def recall(self, counts: Mapping[str, int], read: Callable[[], Run]) -> None:
        """Go on after the records of a run that was stopped.

        Parameters
        ----------
        counts
            Numbers of records on disk, by kind.
        read
            Gives the run; called only if all records stay in memory.
        """
        if self.lets_go:
            self.stored = {name: counts.get(name, 0) for name in GROWING}
            return
        run = read()
        self.t, self.q, self.p = [float(t) for t in run.t], list(run.q), list(run.p)
        self.columns = [{name: x[k] for name, x in run.columns.items()} for k in range(len(run.t))]
        self.links = list(run.links) if self.with_links else []
        self.switches, self.trace = run.switches.tolist(), run.trace.tolist()
        self.observed = [] if run.observables is None else run.observables.tolist()
        self.closest_linked, self.closest_unlinked = run.closest_linked, run.closest_unlinked
        self.energy_rounding = run.fidelity.ledger.rounding
        if run.fidelity.changed:
            self.replaced_at = changed_times(run.provenance) or (run.scenario.start.t,)
        if self.with_errors:
            known = run.accuracy
            self.errors = [UNKNOWN_ERRORS] * len(run.t) if known is None else [(q, p) for q, p in known.frames.tolist()]

    def _motion(self, frames: slice) -> tuple[Reals, Reals]:
        none = np.zeros((0, self.n, self.m), self.dtype)
        q, p = (np.array(x[frames]) if x[frames] else none for x in (self.q, self.p))
        return q, p

    def tables(self) -> RecordTables:
        """The records in memory as arrays, by the names of `Run`."""
        frames = len(self.t)
        q, p = self._motion(slice(0, frames))
        links = np.zeros((frames, 0, 0), dtype=bool)
        if self.with_links and len(self.links) >= frames:
            links = np.array(self.links[:frames], dtype=bool).reshape(frames, self.n, self.n)
        return {
            "t": np.array(self.t), "q": q, "p": p, "links": links, "columns": stacked_columns(self.columns[:frames]),
            "switches": np.array(self.switches, dtype=SWITCH_FIELDS),
            "trace": ledger_of(self.trace),
            "observables": np.array(self.observed, dtype=OBSERVED_FIELDS) if self.observe else None,
            "log": None if self.log is None else self.log.part(0, 0),
        }  # fmt: skip

    def frame_errors(self) -> Array:
        """Errors of positions and velocities at the frames in memory, shape (F, 2)."""
        return np.array(self.errors[: len(self.t)], dtype=np.float64).reshape(len(self.t), 2)


def _without_velocities(observed: tuple[float, ...]) -> tuple[float, ...]:
    """An observation of agents that have no velocities of their own: zeros stand in their place."""
    return tuple(
        np.nan if name in OF_VELOCITIES else value
        for name, value in zip(OBSERVED_FIELDS.names or (), observed, strict=True)
    )
