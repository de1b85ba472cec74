"""Started under mpiexec: cases run by the kernels on all ranks; the first rank writes down what came out."""

from __future__ import annotations

import numpy as np

from flocking.engine.lammps.domains.decomposition import Decomposition
from flocking.engine.lammps.domains.options import DomainOptions
from flocking.engine.lammps.domains.session import DomainSession
from tests.mpi.domain_cases import case
from tests.mpi.jobs import run_each


def computed(name, **more):
    """What a session gives for a case, on the first rank."""
    scenario, options = case(name)
    placed, place = [], Decomposition.place
    Decomposition.place = lambda self, *arguments: (placed.append(1), place(self, *arguments))[1]
    session = DomainSession(scenario, DomainOptions(threads=1, **options, **more))
    begin = session.accelerations()
    session.advance(scenario.t_end)
    migrated = session.ranks.comm.allreduce(session._particles.migrated)
    Decomposition.place = place
    links, owned = session.state.links, session.ranks.comm.gather(session._particles.n)
    particles = session._particles
    owner = np.zeros(particles.everyone, int)
    owner[particles.ids[: particles.n]] = session.ranks.rank
    owner = session.ranks.comm.allreduce(owner)
    run = session.run()
    session.close()
    columns = {f"column {name}": values for name, values in run.columns.items()}
    return columns | {
        "begin": begin, "t": run.t, "q": run.q, "p": run.p, "links": run.links, "trace": run.trace,
        "closest": [run.closest_linked.distance, *run.closest_linked.pair], "migrated": migrated, "last_links": links,
        "owned": owned, "owner": owner, "placed": len(placed), "gap": session.law_gaps.gap,
        "checks": session.law_gaps.checks,
    }  # fmt: skip


if __name__ == "__main__":
    run_each(computed)
