"""What a second computation finds in a log: how much it computed, and which entries are wrong."""

from __future__ import annotations

from dataclasses import dataclass

MOST_ERRORS = 20
"""Findings that are listed."""


@dataclass(frozen=True)
class WrongEntry:
    """What is wrong in a log.

    Parameters
    ----------
    time
        When, in the scenario's time.
    agent
        Who acted.
    entry
        Number of the entry in ``run.log.uses``; None where an entry is missing, or the act itself is wrong.
    what
        What is wrong, in words.
    """

    time: float
    agent: int
    entry: int | None
    what: str

    def __str__(self) -> str:
        where = "" if self.entry is None else f" (entry {self.entry})"
        return f"t = {self.time:.9g}, agent {self.agent}{where}: {self.what}"


@dataclass(frozen=True)
class Replay:
    """What a second computation found in the log of a run.

    Parameters
    ----------
    acts, entries
        How many acts and entries were computed again.
    undecided
        Acts in which rounding leaves open what was to be used; under continuous control also times at which what an
        agent uses may have changed.
        With delayed knowledge acts, and agents at frames, for which the error of interpolation between frames leaves
        open what was known.
    wrong
        The first `MOST_ERRORS` things that are wrong, in order of time.
    open_by
        What leaves open those that are undecided: ``"rounding"``, or ``"interpolation"``, rounding included.
    """

    acts: int
    entries: int
    undecided: int
    wrong: tuple[WrongEntry, ...]
    open_by: str = "rounding"

    @property
    def agrees(self) -> bool:
        """Whether nothing is wrong."""
        return not self.wrong

    def as_dict(self) -> dict[str, object]:
        """What was found, as plain data for JSON."""
        return {
            "agrees": self.agrees, "acts": self.acts, "entries": self.entries, "undecided": self.undecided,
            "wrong": [{"time": w.time, "agent": w.agent, "entry": w.entry, "what": w.what} for w in self.wrong],
        }  # fmt: skip

    def __str__(self) -> str:
        size = f"{self.acts} acts with {self.entries} entries computed again"
        open_ = f", {self.undecided} left open by {self.open_by}" if self.undecided else ""
        if self.agrees:
            return f"{size}{open_}: {'what is not left open is' if open_ else 'all'} as declared"
        return "\n".join([f"{size}{open_}: not as declared", *map(str, self.wrong)])
