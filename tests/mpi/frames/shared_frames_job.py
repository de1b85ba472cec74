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


def small():
    """Let frames of few agents have several chunks, and no links."""
    columns.SPLIT_BYTES, columns.CHUNK_BYTES = 1024, 1
    for module in (recorder, ideal, held):
        module.MOST_LINKED = 2


def main():
    asked = json.loads(sys.argv[1])
    small()
    if asked["do"] == "resume":
        fk.resume(asked["folder"], progress=False)
        return
    name, kind = asked["name"], held_cases if asked["held"] else domain_cases
    scenario, options = kind.case(name)
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
    said = session.ranks.comm.gather((raised, len(session.records.parts), session._shares is not None))
    if session.ranks.first:
        print(json.dumps(said))


if __name__ == "__main__":
    main()
