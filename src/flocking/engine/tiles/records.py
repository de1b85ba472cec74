"""What a tiled session writes down: frames, observables, the ledger and the closest linked pair."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from flocking.engine.run import SWITCH_FIELDS, TRACE_FIELDS, Closest
from flocking.engine.tiles.schemes import Books
from flocking.engine.tiles.spec import PRECISIONS
from flocking.errors import InvalidInput
from flocking.model.law import Scenario

MOST_FRAME_BYTES = 8 * 2**30
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

    Raises
    ------
    InvalidInput
        When the frames would take more than 8 GiB.
    """

    def __init__(self, scenario: Scenario, precision: str, *, keep_frames: bool) -> None:
        self.frame_times = scenario.frame_times
        self.n, self.m = scenario.start.q.shape
        self.dtype = PRECISIONS[precision]
        self.keep_frames = keep_frames
        self.with_links = len(self.frame_times) * self.n**2 <= MOST_LINK_BYTES
        size = len(self.frame_times) * self.n * self.m * 2.0 * np.dtype(self.dtype).itemsize
        if keep_frames and size > MOST_FRAME_BYTES:
            raise InvalidInput(
                "Scenario", "frames", f"must fit in {MOST_FRAME_BYTES / 2**30:g} GiB for {self.n} agents",
                f"{len(self.frame_times)} frames ({size / 2**30:.3g} GiB)",
                "Ask for fewer frames, or set keep_frames=False and observe=True.",
            )  # fmt: skip
        self.count = 0
        self.t: list[float] = []
        self.q: list[Any] = []
        self.p: list[Any] = []
        self.links: list[Any] = []
        self.trace: list[tuple[float, ...]] = []
        self.observed: list[tuple[float, ...]] = []
        self.closest = Closest()
        self.apart = 0.0

    def copy(self) -> Records:
        """A copy that goes on by itself; stored frames are never changed and are shared."""
        other = copy.copy(self)
        for name in ("t", "q", "p", "links", "trace", "observed"):
            setattr(other, name, list(getattr(self, name)))
        return other

    def due(self, t: float) -> bool:
        """Whether a frame is due at time ``t``, on or after its time."""
        return self.count < len(self.frame_times) and t >= self.frame_times[self.count]

    def frame(self, t: float, q: Any, p: Any, links: Any, observed: tuple[float, ...] | None) -> None:
        """Store a frame."""
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

    def book(self, t: float, books: Books, n: int, unlinked: float) -> None:
        """Add a row to the ledger; a second row of the same time replaces the first."""
        sums = books.sums
        energy = sums["pairs"] + sums["bodies"] + sums["kinetic"]
        # What pairs without a link carry changes by jumps alone.
        apart = 0.5 * (n * (n - 1.0) - sums["links"]) * unlinked
        if not self.trace:
            self.apart = apart
        row = (
            t, energy + apart, sums["kinetic"], *(float(x) for x in books.integrals), books.jumped + apart - self.apart,
        )  # fmt: skip
        if self.trace and self.trace[-1][0] == t:
            self.trace.pop()
        self.trace.append(row)

    def tables(self) -> dict[str, Any]:
        """All records as arrays, by the names of `Run`."""
        from flocking.engine.tiles.observables import OBSERVED_FIELDS

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
            "observables": np.array(self.observed, dtype=OBSERVED_FIELDS),
        }
