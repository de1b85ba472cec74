"""Registration of the LAMMPS engine."""

from __future__ import annotations

from collections.abc import Mapping

from flocking.engine.lammps import library
from flocking.engine.lammps.checks import check_supported
from flocking.engine.lammps.options import LammpsOptions
from flocking.engine.lammps.ranks import Ranks
from flocking.engine.lammps.restart import stored_options
from flocking.engine.lammps.session import LammpsSession
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.engine.reference.plants import check_plant
from flocking.model.law import Law, Scenario

ROWS_OF_LARGE_GROUPS = 25
"""Default number of steps between two rows of the ledger, which one rank computes."""


class LammpsEngine(Engine):
    """Fixed-step integration by LAMMPS on any number of MPI ranks."""

    name = "lammps"
    summary = "fixed steps on many processes, under mpiexec"
    options = LammpsOptions
    large_group_options = {"ledger": ROWS_OF_LARGE_GROUPS}  # noqa: RUF012  never changed

    def check(self, scenario: Scenario, plant: Law | None = None) -> None:
        """Check that the scenario and the plant are supported."""
        check_supported(scenario)
        if plant is not None:
            check_plant("LammpsSession", scenario.law, plant)
            check_supported(scenario.with_(law=plant))

    def open(self, scenario: Scenario, options: object, *, plant: Law | None = None) -> LammpsSession:
        """Start a session. Collective."""
        assert isinstance(options, LammpsOptions)
        return LammpsSession(scenario, options, plant=plant)

    def unpack(self, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> Session:
        """Restore a session from its packed form. Collective."""
        return LammpsSession.unpack(packed, stored, changes)

    def team(self) -> Ranks:
        """The ranks of the job."""
        return Ranks(library.communicator())

    def stored_options(self, data: Mapping[str, object]) -> LammpsOptions:
        """Options of a run on disk, without the log file of LAMMPS."""
        return stored_options(data)


ENGINE = LammpsEngine()
"""The instance that is registered."""
