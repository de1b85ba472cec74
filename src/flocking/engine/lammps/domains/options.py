"""Options of a session of the tiled kernels on many processes."""

from __future__ import annotations

from dataclasses import dataclass

from flocking.engine.tiles.options import TilesOptions


@dataclass(frozen=True)
class DomainOptions(TilesOptions):
    """Options of a session that runs the tiled kernels on many processes.

    Parameters
    ----------
    step, scheme, precision, threads, ledger, observe, keep_frames, skin, memory_limit, ledger_at
        As for `flocking.engine.tiles.options.TilesOptions`.
    forces
        Always ``"kernels"``: it states in a stored run how its forces were computed.
    keep_log
        A file for the log of LAMMPS.
    """

    forces: str = "kernels"
    keep_log: str | None = None
