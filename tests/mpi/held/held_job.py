"""Started under mpiexec: cases under held control on all ranks; the first rank writes down what came out."""

from __future__ import annotations

import json
import os
import signal
import sys

from flocking.engine.driver.simulate import open_session, run_session
from flocking.engine.lammps.engine import ENGINE
from flocking.engine.lammps.options import LammpsOptions
from tests.mpi.held.held_cases import case
from tests.mpi.held.random_worlds import world
from tests.mpi.jobs import run_each


def opened(name, **more):
    scenario, options = world(int(name)) if name.isdigit() else case(name)
    options |= {"ledger": int(options.get("ledger", True))}
    return open_session(ENGINE, scenario, LammpsOptions(threads=1, **{**options, **more}))


def computed(name):
    """What a session gives for a case, on the first rank."""
    session = opened(name)
    session.advance(session.scenario.t_end)
    migrated, state = session.ranks.comm.allreduce(session._particles.migrated), session.state
    columns = {f"column {name}": values for name, values in session.state.columns.items()}
    owned, rates = session.ranks.comm.gather(session._particles.n), session.accelerations()
    run = session.run()
    session.close()
    return {
        "t": run.t, "q": run.q, "p": run.p, "links": run.links, "trace": run.trace, "owned": owned, "rates": rates,
        "migrated": migrated, "last": state.q, "closest": run.closest_linked.distance,
        **columns, **{f"columns {name}": values for name, values in run.columns.items()},
    }  # fmt: skip


def killed(name, save, die_at):
    """Save a case; the last rank dies on the way."""
    session = opened(name)
    take = session._take_step

    def dying():
        if session.time >= die_at and session.ranks.rank == session.ranks.size - 1:
            os.kill(os.getpid(), signal.SIGKILL)
        take()

    session._take_step = dying
    run_session(session, save=save, progress=False, every=0.0)


def main():
    words = json.loads(sys.argv[1])
    if "save" in words:
        killed(**words)
    else:
        run_each(computed)


if __name__ == "__main__":
    main()
