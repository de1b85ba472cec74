"""Started under mpiexec by `test_observations`: a run with observations, saved, whose last rank dies."""

from __future__ import annotations

import json
import os
import signal
import sys

from flocking.engine.driver.simulate import open_session, run_session
from flocking.engine.lammps.engine import ENGINE
from flocking.engine.lammps.options import LammpsOptions
from tests.mpi.frames.test_observations import made


def main():
    words = json.loads(sys.argv[1])
    scenario, options = made(words["name"])
    options |= {"ledger": int(options.get("ledger", True))}
    session = open_session(ENGINE, scenario, LammpsOptions(threads=1, observe=True, **options))
    take = session._take_step

    def dying():
        if session.time >= 0.25 and session.ranks.rank == session.ranks.size - 1:
            os.kill(os.getpid(), signal.SIGKILL)
        take()

    session._take_step = dying
    run_session(session, save=words["save"], progress=False, every=0.0)


if __name__ == "__main__":
    main()
