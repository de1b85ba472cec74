"""Options of the LAMMPS engine."""

from __future__ import annotations

from dataclasses import dataclass

from flocking.engine.lammps.domains.options import DomainOptions
from flocking.errors import InvalidInput
from flocking.model.checks import integer, number

AGENTS_A_ROW = 4000
"""Largest number of agents for which the ledger has a row at every step by default."""
RAREST = 100
"""Largest default number of steps between two rows of the ledger."""
KERNELS, PAIR_STYLES = FORCES = ("kernels", "pair styles")
"""How forces are computed: by the kernels of the tiled engine, or by the pair styles of LAMMPS."""


OF_KERNELS = ("scheme", "precision", "threads", "keep_frames", "memory_limit", "ledger_at")
"""Options for the kernels only."""


@dataclass(frozen=True)
class LammpsOptions:
    """Options of the LAMMPS engine.

    Parameters
    ----------
    forces
        ``"kernels"``: those of the tiled engine on every rank, for all laws that it runs, while LAMMPS divides space
        and moves agents between ranks. ``"pair styles"``: a deck of LAMMPS alone, as
        `flocking.engine.driver.lammps_export` writes it, for the laws that it can express.
    step
        Largest time step; it is shortened slightly so that steps end at frame times. By default it is chosen from the
        start, as in the tiled engine.
    skin
        Skin of the neighbour lists; by default a fraction of the largest radius.
    ledger
        Steps between two rows of the energy ledger; 0 for no ledger. The kernels compute it at every step, so that
        with them it is 0 or 1 and by default 1. With pair styles rows are computed on one rank from the gathered
        state; by default every step has a row for up to 4,000 agents, and for more the interval grows in proportion.
        As in the tiled engine, False is none, and True the default.
    observe
        Whether order, flocks, density and closest pair are recorded at the frame times.
    keep_log
        A file for the log of LAMMPS.
    scheme, precision, threads, keep_frames, memory_limit, ledger_at
        For the kernels only, as in `flocking.engine.tiles.options.TilesOptions`. ``threads`` is the number of each
        rank, by default the processors of the machine divided by its ranks; ``memory_limit`` is that of each rank.

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
    forces: str = KERNELS
    scheme: str | None = None
    precision: str = "float64"
    threads: int | None = None
    keep_frames: bool = True
    memory_limit: float | None = None
    ledger_at: str = "steps"

    def __post_init__(self) -> None:
        for name in ("step", "skin"):
            if getattr(self, name) is not None:
                number("engine='lammps'", name, getattr(self, name), above=0.0)
        if isinstance(self.ledger, bool):
            object.__setattr__(self, "ledger", None if self.ledger else 0)
        if self.ledger is not None:
            integer("engine='lammps'", "ledger", self.ledger, least=0)
        if self.forces not in FORCES:
            raise InvalidInput("engine='lammps'", "forces", f"must be one of {', '.join(FORCES)}", self.forces)
        if self.forces == KERNELS:
            self.of_kernels()
            return
        for name in OF_KERNELS:
            if getattr(self, name) != getattr(type(self), name):
                rule = "is only for forces='kernels'"
                raise InvalidInput("engine='lammps'", name, rule, getattr(self, name), "Leave it out.")

    def of_kernels(self) -> DomainOptions:
        """The options of a session of the kernels."""
        if self.ledger not in (None, 0, 1):
            rule = "must be 0 or 1 with forces='kernels', which compute it at every step"
            raise InvalidInput("engine='lammps'", "ledger", rule, self.ledger)
        return DomainOptions(
            step=self.step, scheme=self.scheme, precision=self.precision, threads=self.threads,
            ledger=self.ledger != 0, observe=self.observe, keep_frames=self.keep_frames, skin=self.skin,
            memory_limit=self.memory_limit, keep_log=self.keep_log, ledger_at=self.ledger_at,
        )  # fmt: skip

    def rows(self, agents: int) -> int:
        """Steps between two rows of the ledger for a number of agents; 0 for no ledger."""
        if self.ledger is not None:
            return self.ledger
        return min(RAREST, max(1, round(agents / AGENTS_A_ROW)))
