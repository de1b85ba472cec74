"""What a tiled session writes down: frames, observables, the ledger and the closest linked pair."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from flocking.arrays import Links, Positions, Velocities
from flocking.engine.runs.columns import GROWING
from flocking.engine.runs.new_records import NewRecords
from flocking.engine.runs.run import OBSERVED_FIELDS, SWITCH_FIELDS, TRACE_FIELDS, Closest
from flocking.engine.tiles.integrators import LedgerSums
from flocking.engine.tiles.kernels.spec import PRECISIONS
from flocking.errors import InvalidInput
from flocking.model.law import Scenario

MOST_FRAME_BYTES = 8 * 2**30
"""Frames of a run that is not written to disk while it goes on may take so much memory."""
MOST_LINKED = 2000
"""Larger groups carry no link matrix in their states and frames."""
MOST_LINK_BYTES = 256 * 2**20
"""Frames hold link matrices only up to this size in total."""


class Records:
    """Collects the records of a run.

    Parameters
    ----------
    scenario
        Frame times and sizes.
    precision
        Precision of the stored frames.
    keep_frames
        Whether positions and velocities are stored.
    observe
        Whether observations are.
    """

    def __init__(self, scenario: Scenario, precision: str, *, keep_frames: bool, observe: bool = False) -> None:
        self.frame_times = scenario.frame_times
        self.n, self.m = scenario.start.q.shape
        self.dtype = PRECISIONS[precision]
        self.precision, self.keep_frames, self.observe = precision, keep_frames, observe
        small = self.n <= MOST_LINKED and len(self.frame_times) * self.n**2 <= MOST_LINK_BYTES
        self.with_links = small and keep_frames
        self.count = 0
        self.stored = dict.fromkeys(GROWING, 0)
        self.first: tuple[float, ...] | None = None
        self.t: list[float] = []
        self.q: list[Positions] = []
        self.p: list[Velocities] = []
        self.links: list[Links] = []
        self.trace: list[tuple[float, ...]] = []
        self.observed: list[tuple[float, ...]] = []
        self.closest = Closest()
        self.apart = 0.0

    @property
    def frame_bytes(self) -> float:
        """Memory of one frame."""
        return self.n * self.m * 2.0 * np.dtype(self.dtype).itemsize if self.keep_frames else 0.0

    def check_fits(self) -> None:
        """Refuse frames that memory cannot hold together.

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
                "Save the run while it goes on (save=folder, --out), ask for fewer frames, or set keep_frames=False "
                "and observe=True.",
            )  # fmt: skip

    def copy(self) -> Records:
        """A copy that goes on by itself; stored frames are never changed and are shared."""
        other = copy.copy(self)
        for name in ("t", "q", "p", "links", "trace", "observed"):
            setattr(other, name, list(getattr(self, name)))
        other.stored = dict(self.stored)
        return other

    @property
    def waiting(self) -> float:
        """Bytes of frames in memory."""
        return len(self.t) * self.frame_bytes

    @property
    def closest_pairs(self) -> tuple[Closest, Closest]:
        """Closest linked and unlinked pair until now; unlinked ones are not looked at."""
        return self.closest, Closest()

    @property
    def layout(self) -> dict[str, Any]:
        """How the records are stored on disk, as options of `RunWriter.create`."""
        return {"with_links": self.with_links, "precision": self.precision, "observed": self.observe}

    def since(self, counts: dict[str, int], *, complete: bool) -> NewRecords:
        """What came after the first ``counts`` records of each kind; unless ``complete``, without the last ledger row.

        The last row of the ledger is still open: a look at the same moment replaces it.
        """
        rows = self.trace if complete else self.trace[:-1]
        frames = slice(counts["time"] - self.stored["time"], None)
        none = np.zeros((0, self.n, self.m), self.dtype)
        q, p = (np.array(x[frames]) if x[frames] else none for x in (self.q, self.p))
        return NewRecords(
            np.array(self.t[frames]), q, p, np.array(self.links[frames]) if self.with_links else None,
            np.zeros(0, dtype=SWITCH_FIELDS),
            np.array(rows[counts["step"] - self.stored["step"] :], dtype=TRACE_FIELDS),
            np.array(self.observed[counts["observation"] - self.stored["observation"] :], dtype=OBSERVED_FIELDS),
        )  # fmt: skip

    def forget(self, counts: dict[str, int]) -> None:
        """Let go of the first ``counts`` records of each kind: they are on disk now."""
        for name, kind in (("t", "time"), ("q", "time"), ("p", "time"), ("links", "time"), ("trace", "step"),
                           ("observed", "observation")):  # fmt: skip
            rows = getattr(self, name)
            del rows[: counts[kind] - self.stored[kind]]
        self.stored = dict(counts)

    def memory(self) -> dict[str, Any]:
        """What a checkpoint must hold beside the records on disk."""
        return {"count": self.count, "apart": self.apart, "first": self.first, "open": list(self.trace[-1:]),
                "closest": self.closest}  # fmt: skip

    def recall(self, memory: dict[str, Any], stored: dict[str, int]) -> None:
        """Go on after so many records of each kind that are on disk.

        Parameters
        ----------
        memory
            What was kept of the records.
        stored
            Numbers of records on disk, by kind.
        """
        self.count, self.apart, self.first = memory["count"], memory["apart"], memory["first"]
        self.trace, self.stored, self.closest = list(memory["open"]), dict(stored), memory["closest"]

    def due(self, t: float) -> bool:
        """Whether a frame is due at time ``t``, on or after its time."""
        return self.count < len(self.frame_times) and t >= self.frame_times[self.count]

    def frame(
        self, t: float, q: Positions, p: Velocities, links: Links | None, observed: tuple[float, ...] | None
    ) -> None:
        """Store a frame.

        Parameters
        ----------
        observed
            Observations of the frame, fields `OBSERVED_FIELDS`, or None.
        """
        self.count += 1
        if observed is not None:
            self.observed.append(observed)
        if not self.keep_frames:
            return
        self.t.append(t)
        self.q.append(q.astype(self.dtype))
        self.p.append(p.astype(self.dtype))
        if links is not None and self.with_links:
            self.links.append(links)

    def book(self, t: float, ledger_sums: LedgerSums, n: int, unlinked: float) -> None:
        """Add a row to the ledger; a second row of the same time replaces the first.

        Parameters
        ----------
        ledger_sums
            Sums over the group and integrals so far.
        unlinked
            Energy of a pair without a link.
        """
        sums = ledger_sums.sums
        energy = sums["pairs"] + sums["bodies"] + sums["kinetic"]
        # What pairs without a link carry changes by jumps alone.
        apart = 0.5 * (n * (n - 1.0) - sums["links"]) * unlinked
        if self.first is None:
            self.apart = apart
        row = (
            t, energy + apart, sums["kinetic"], *(float(x) for x in ledger_sums.integrals),
            ledger_sums.jumped + apart - self.apart,
        )  # fmt: skip
        if self.trace and self.trace[-1][0] == t:
            self.trace.pop()
        if self.first is None or self.first[0] == t:
            self.first = row
        self.trace.append(row)

    def tables(self) -> dict[str, Any]:
        """The records in memory as arrays, by the names of `Run`."""
        frames = len(self.t)
        none = np.zeros((0, self.n, self.m), self.dtype)
        linked = self.with_links and len(self.links) == frames and self.n
        links = np.array(self.links) if linked and frames else np.zeros((frames, 0, 0), dtype=bool)
        return {
            "t": np.array(self.t),
            "q": np.array(self.q) if frames else none,
            "p": np.array(self.p) if frames else none,
            "links": links,
            "switches": np.zeros(0, dtype=SWITCH_FIELDS),
            "trace": np.array(self.trace, dtype=TRACE_FIELDS),
            "closest_linked": self.closest,
            "observables": np.array(self.observed, dtype=OBSERVED_FIELDS) if self.observe else None,
        }
