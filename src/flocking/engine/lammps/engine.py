"""Registration of the LAMMPS engine."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace

from flocking.engine.fixed_step.given_links import check_given_links
from flocking.engine.fixed_step.supported_bodies import is_known
from flocking.engine.lammps import library
from flocking.engine.lammps.domains.checkpoint import stored_options as domain_options
from flocking.engine.lammps.domains.options import DomainOptions
from flocking.engine.lammps.domains.session import DomainSession
from flocking.engine.lammps.held.session import HeldDomainSession
from flocking.engine.lammps.options import KERNELS, PAIR_STYLES, LammpsOptions
from flocking.engine.lammps.ranks import Ranks
from flocking.engine.lammps.restart import stored_options
from flocking.engine.lammps.session import LammpsSession
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.repeats import Repeats
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.engine.reference.plants import check_plant
from flocking.engine.runs.run import Run
from flocking.engine.tiles.held.news import check_messages
from flocking.engine.tiles.kernels.spec import SPACES, check_supported
from flocking.errors import UnsupportedLaw
from flocking.model.law import Law, Scenario
from flocking.model.world.control import Held
from flocking.model.world.information import Messages


class LammpsEngine(Engine):
    """Fixed-step integration by LAMMPS on any number of MPI ranks."""

    name = "lammps"
    summary = "fixed steps on many processes, under mpiexec"
    options = LammpsOptions
    free_options = frozenset({"threads"})
    spaces = SPACES
    worlds = (Held, Messages)

    def check(self, scenario: Scenario, plant: Law | None = None) -> None:
        """Check that the scenario and the plant are supported."""
        for law in [scenario.law] if plant is None else [scenario.law, plant]:
            _check_kernels(scenario.with_(law=law))
        check_given_links(self.name, scenario)
        if plant is not None:
            if not scenario.control.ideal:
                raise UnsupportedLaw(
                    "engine='lammps' runs no plant under held control: its work counts as departed. Leave it out."
                )
            check_plant("DomainSession", scenario.law, plant)

    def open(self, scenario: Scenario, options: object, *, plant: Law | None = None) -> Session:
        """Start a session. Collective."""
        if isinstance(options, LammpsOptions) and options.forces == PAIR_STYLES:
            return LammpsSession(scenario, options, plant=plant)
        chosen = options.of_kernels() if isinstance(options, LammpsOptions) else options
        assert isinstance(chosen, DomainOptions)
        self.check(scenario, plant)
        if chosen.threads is None:
            chosen = replace(chosen, threads=_threads_of_a_rank(self.team()))
        if isinstance(scenario.control, Held):
            return HeldDomainSession(scenario, chosen)
        return DomainSession(scenario, chosen, plant=plant)

    def repeats(self, run: Run) -> Repeats | None:
        """By the tiled engine, whose steps are the same, in this process."""
        from flocking.engine.tiles.engine import ENGINE as TILES

        return TILES.repeats(run)

    def unpack(self, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> Session:
        """Restore a session from its packed form. Collective."""
        if "session" in packed[0]:
            kind = HeldDomainSession if isinstance(stored.scenario.control, Held) else DomainSession
            return kind.unpack(packed, stored, {"threads": _threads_of_a_rank(self.team()), **changes})
        return LammpsSession.unpack(packed, stored, changes)

    def free_options_of(self, options: Mapping[str, object]) -> frozenset[str]:
        """Threads, for kernels alone."""
        return self.free_options if options.get("forces", PAIR_STYLES) == KERNELS else frozenset()

    def team(self) -> Ranks:
        """The ranks of the job."""
        return Ranks(library.communicator())

    def stored_options(self, data: Mapping[str, object]) -> object:
        """Options of a run on disk, without the log file of LAMMPS. Runs before there were kernels name no forces."""
        if data.get("forces", PAIR_STYLES) == KERNELS:
            return domain_options(data)
        return stored_options(data)


def _check_kernels(scenario: Scenario) -> None:
    """Check that the kernels can run a scenario."""
    try:
        check_supported(scenario)
        check_messages(scenario)
    except UnsupportedLaw as error:
        raise UnsupportedLaw(f"engine='lammps' runs the kernels of the tiled engine. {error}") from None
    if not is_known(scenario.agents):
        raise UnsupportedLaw(
            f"engine='lammps' cannot run {type(scenario.agents).__name__} agents on ranks, only points and unicycles, "
            "limited, lagged or disturbed. Use engine='tiles'."
        )


def _threads_of_a_rank(ranks: Ranks) -> int:
    """Threads that a rank has where all ranks of a machine share its processors."""
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    return max(1, processors // ranks.on_this_machine)


ENGINE = LammpsEngine()
"""The instance that is registered."""
