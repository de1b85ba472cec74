"""How LAMMPS runs a scenario: what a user may choose."""

from __future__ import annotations

from dataclasses import dataclass

from flocking.model.checks import integer, number

AGENTS_A_ROW = 4000
"""Agents for which a row of the ledger every step is cheap."""
RAREST = 100
"""Steps between two rows of a ledger, at most, where nobody asks for another number."""


@dataclass(frozen=True)
class LammpsOptions:
    """How LAMMPS runs a scenario.

    Parameters
    ----------
    step
        Largest time step; it is shortened a little so that frames fall on steps. When absent it is chosen from the
        start, as the tiled engine does.
    skin
        Skin of the neighbour lists; a share of the largest radius when absent.
    ledger
        Steps between two rows of the energy ledger; 0 for no ledger. Rows are computed on one rank from the whole
        state. When absent every step has one up to 4,000 agents; for more agents they become rarer in proportion.
    observe
        Record order, flocks, density and closest pair at the frame times.
    keep_log
        A file for LAMMPS's own log.

    Raises
    ------
    InvalidInput
        When a value is out of range.
    """

    step: float | None = None
    skin: float | None = None
    ledger: int | None = None
    observe: bool = False
    keep_log: str | None = None

    def __post_init__(self) -> None:
        for name in ("step", "skin"):
            if getattr(self, name) is not None:
                number("engine='lammps'", name, getattr(self, name), above=0.0)
        if self.ledger is not None:
            integer("engine='lammps'", "ledger", self.ledger, least=0)

    def rows(self, agents: int) -> int:
        """Steps between two rows of the ledger of so many agents; 0 for none."""
        if self.ledger is not None:
            return self.ledger
        return min(RAREST, max(1, round(agents / AGENTS_A_ROW)))
