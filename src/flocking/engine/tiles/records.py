"""Records of a tiled session: ledger rows from its sums, of which the last may still change."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NotRequired, TypedDict

from flocking.engine.runs.recorder import Recorder
from flocking.engine.runs.run import Closest, LedgerRow, Run
from flocking.engine.tiles.integrators import LedgerSums
from flocking.model.law import Scenario


class RecordsMemory(TypedDict):
    """State of the records besides those on disk: the number of frames, the initial energy of pairs without a link,
    the first and the last row of the ledger, the closest linked pair, when law or state were replaced, and the largest
    error of the energy from rounding that a check of the ledger needed, which earlier versions left out.
    """

    count: int
    apart: float
    first: tuple[float, ...] | None
    open: list[tuple[float, ...]]
    closest: Closest
    replaced: NotRequired[list[float]]
    rounding: NotRequired[float]


class TilesRecorder(Recorder):
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
        Whether observables are stored.
    with_log
        Whether there is a log of what agents used when they acted.
    """

    open_rows = 1
    """A second row at the same time replaces the last row of the ledger."""

    def __init__(
        self, scenario: Scenario, precision: str, *, keep_frames: bool, observe: bool = False, with_log: bool = False
    ) -> None:  # fmt: skip
        super().__init__(scenario, precision=precision, keep_frames=keep_frames, observe=observe, with_log=with_log)
        self.first: tuple[float, ...] | None = None
        self.apart = 0.0

    def memory(self) -> RecordsMemory:
        """The state of the records for a checkpoint, besides the records on disk."""
        found: RecordsMemory = {
            "count": self.count, "apart": self.apart, "first": None if self.first is None else (*self.first,),
            "open": [(*row,) for row in self.trace[-1:]], "closest": self.closest_linked,
            "rounding": self.energy_rounding,
        }  # fmt: skip
        if self.replaced_at:
            found["replaced"] = list(self.replaced_at)
        return found

    def recall_memory(self, memory: RecordsMemory, counts: Mapping[str, int], read: Callable[[], Run]) -> None:
        """Continue after the records on disk.

        Parameters
        ----------
        memory
            State of the records from `memory`.
        counts, read
            As for `recall`.
        """
        self.recall(counts, read)
        self._skipped = memory["count"] - self.stored["time"]
        self.apart, self.first, self.closest_linked = memory["apart"], memory["first"], memory["closest"]
        self.trace, self.energy_rounding = list(memory["open"]), float(memory.get("rounding", 0.0))
        self.replaced_at = tuple(memory.get("replaced", ()))
        assert isinstance(self.closest_linked, Closest)

    def add_ledger_row(self, t: float, ledger_sums: LedgerSums, n: int, unlinked: float, departed: float = 0.0) -> None:
        """Add a row to the ledger; a second row of the same time replaces the first.

        Parameters
        ----------
        ledger_sums
            Sums over all agents, and integrals so far.
        unlinked
            Energy of a pair without a link.
        departed
            Work of what acted beyond the law.
        """
        sums = ledger_sums.sums
        energy = sums["pairs"] + sums["bodies"] + sums["kinetic"]
        # The energy of pairs without a link changes only by jumps.
        apart = 0.5 * (n * (n - 1.0) - sums["links"]) * unlinked
        if self.first is None:
            self.apart = apart
        work, lost, supplied, *beyond = map(float, ledger_sums.integrals)
        departed = departed + sum(beyond)
        jumped = ledger_sums.jumped + apart - self.apart
        row = LedgerRow(t, energy + apart, sums["kinetic"], work, lost, supplied, jumped, departed)
        if self.trace and self.trace[-1][0] == t:
            self.trace.pop()
        if self.first is None or self.first[0] == t:
            self.first = row
        self.trace.append(row)
