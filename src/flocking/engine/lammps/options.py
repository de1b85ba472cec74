"""Options of the LAMMPS engine."""

from __future__ import annotations

from dataclasses import dataclass

from flocking.model.checks import integer, number

AGENTS_A_ROW = 4000
"""Largest number of agents for which the ledger has a row at every step by default."""
RAREST = 100
"""Largest default number of steps between two rows of the ledger."""


@dataclass(frozen=True)
class LammpsOptions:
    """Options of the LAMMPS engine.

    Parameters
    ----------
    step
        Largest time step; it is shortened slightly so that steps end at frame times. By default it is chosen from the
        start, as in the tiled engine.
    skin
        Skin of the neighbour lists; by default a fraction of the largest radius.
    ledger
        Steps between two rows of the energy ledger; 0 for no ledger. Rows are computed on one rank from the
        gathered state. By default every step has a row for up to 4,000 agents; for more agents the interval grows in
        proportion.
    observe
        Whether order, flocks, density and closest pair are recorded at the frame times.
    keep_log
        A file for the log of LAMMPS.

    Raises
    ------
    InvalidInput
        If a value is out of range.
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
        """Steps between two rows of the ledger for a number of agents; 0 for no ledger."""
        if self.ledger is not None:
            return self.ledger
        return min(RAREST, max(1, round(agents / AGENTS_A_ROW)))
