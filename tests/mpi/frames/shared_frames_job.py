"""Started under mpiexec: saved runs of small groups whose frames are split among the ranks as those of large ones."""

from __future__ import annotations

import json
import os
import signal
import sys

import flocking as fk
from flocking.engine.driver.simulate import open_session, run_session
from flocking.engine.lammps.domains import session as ideal
from flocking.engine.lammps.engine import ENGINE
from flocking.engine.lammps.held import session as held
from flocking.engine.lammps.options import LammpsOptions
from flocking.engine.runs import columns, recorder
from flocking.errors import FlockingError, StorageError
from tests.mpi import domain_cases
from tests.mpi.held import held_cases
from tests.mpi.jobs import run_each


def small(put=setattr):
    """Let frames of few agents have several chunks, and no links."""
    put(columns, "SPLIT_BYTES", 1024)
    put(columns, "CHUNK_BYTES", 1)
    for module in (recorder, ideal, held):
        put(module, "MOST_LINKED", 2)


def scenario_of(name, held):
    """A case that ends early, and its options: frames are small, so many parts of them are written all the same."""
    scenario, options = (held_cases if held else domain_cases).case(name)
    return scenario.with_(t_end=0.4 * scenario.t_end), options


def saved(_=None, **asked):
    """Run and save a case; what each rank says of it, on the first."""
    scenario, options = scenario_of(asked["name"], asked["held"])
    options |= {"ledger": int(options.get("ledger", True))}
    session = open_session(ENGINE, scenario, LammpsOptions(threads=1, precision=asked["precision"], **options))
    if asked["do"] == "gather":
        session.share_frames = lambda agents: False
    if asked["do"] == "full" and not session.ranks.first:
        # The disk of one rank is full.
        from flocking.engine.driver import session_writer

        def full(folder, parts, frame):
            raise StorageError(f"{folder}: no space left")

        session_writer.write_parts = full
    if asked["do"] == "die":
        take = session._take_step

        def dying():
            if session.time >= asked["at"] and session.ranks.rank == session.ranks.size - 1:
                os.kill(os.getpid(), signal.SIGKILL)
            take()

        session._take_step = dying
    raised = ""
    try:
        run_session(session, save=asked["folder"], progress=False, every=0.0)
    except FlockingError as error:
        raised = str(error)
    shared = session._shares is not None
    said = session.ranks.comm.gather((raised, len(session.records.parts), shared))
    return {"said": json.dumps(said)}


def main():
    asked = json.loads(sys.argv[1])
    small()
    if "cases" in asked:
        run_each(saved)
    elif asked["do"] == "resume":
        fk.resume(asked["folder"], progress=False)
    else:
        saved(**asked)


if __name__ == "__main__":
    main()
