"""Started under mpiexec by the tests of runs of the kernels on many ranks."""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path

import numpy as np

import flocking as fk
from flocking.engine.driver.simulate import open_session, run_session
from flocking.engine.lammps import ranks
from flocking.engine.lammps.domains.decomposition import Decomposition
from flocking.engine.lammps.engine import ENGINE
from flocking.engine.lammps.options import LammpsOptions
from flocking.errors import InvalidInput, SimulationError
from tests.mpi.domain_cases import case
from tests.mpi.jobs import run_each


def opened(scenario, **options):
    return open_session(ENGINE, scenario, LammpsOptions(threads=1, **options))


def streams(name="streams with hysteresis", **changes):
    scenario, options = case(name)
    return scenario.with_(**changes), options


def twice():
    found = []
    for _ in range(2):
        session = opened(*streams()[:1], **streams()[1])
        session.advance(session.scenario.t_end)
        found.append((session.run(), session.ranks.comm.allreduce(session._particles.migrated)))
        session.close()
    (one, migrated), (other, _) = found
    return {"q": one.q, "again": other.q, "energy": one.trace["energy"], "energy_again": other.trace["energy"],
            "migrated": migrated}  # fmt: skip


def threads():
    """The same ranks with one thread each and with three."""
    found = []
    for count in (1, 3):
        scenario, options = streams(t_end=0.1)
        session = open_session(ENGINE, scenario, LammpsOptions(threads=count, **options))
        session.advance(scenario.t_end)
        assert session.about["threads"] == count
        found.append(session.run())
        session.close()
    return {"q": found[0].q, "again": found[1].q, "energy": found[0].trace["energy"],
            "energy_again": found[1].trace["energy"]}  # fmt: skip


def single():
    """Forces and a motion in single precision."""
    scenario, options = streams(t_end=0.1)
    session = opened(scenario, precision="float32", **options)
    begin = session.accelerations()
    session.advance(scenario.t_end)
    run = session.run()
    session.close()
    return {"begin": begin, "q": run.q, "gap": session.law_gaps.gap}


def leaps():
    """Agents without forces fly from one end of the group to the other in one step."""
    scenario, _ = streams()
    q = scenario.start.q
    p = np.zeros_like(q)
    p[::7] = -190.0 * q[::7]
    law = fk.Law(fk.Hysteresis(8.4, 1.0), [fk.Consensus(0.0)])
    made = fk.Scenario(law, fk.State(q, p), t_end=0.1, frames=11)
    session = opened(made, step=0.01, skin=0.05)
    session.advance(0.1)
    run, migrated = session.run(), session.ranks.comm.allreduce(session._particles.migrated)
    session.close()
    return {"q": run.q, "expected": q + run.t[:, None, None] * p, "migrated": migrated}


def lost():
    """Every third time LAMMPS is said to have lost agents."""
    exchanged, calls = Decomposition.exchanged, []

    def losing(self, *arguments):
        found = exchanged(self, *arguments)
        calls.append(1)
        return None if len(calls) % 3 == 0 else found

    Decomposition.exchanged = losing
    try:
        return {**whole(), "lost": len(calls) // 3}
    finally:
        Decomposition.exchanged = exchanged


def whole(save=None, die_at=None, t_end=0.4, frames=6, out=None, name="streams with hysteresis", **_):
    scenario, options = streams(name, frames=frames, t_end=t_end)
    session = opened(scenario, **options)
    take, doomed = session._take_step, session.ranks.size - 1

    def dying():
        if die_at is not None and session.time >= die_at and session.ranks.rank == doomed:
            os.kill(os.getpid(), signal.SIGKILL)
        take()
        if out is not None and session.ranks.first and session.steps == 3:
            Path(f"{out}.part").write_text(str(os.getpid()))
            Path(f"{out}.part").rename(f"{out}.pid")

    session._take_step = dying
    run = run_session(session, save=save, progress=False, every=0.0)
    columns = {f"column {name}": values for name, values in run.columns.items()}
    return {"q": run.q, "links": run.links, "energy": run.trace["energy"], **columns}


def too_large():
    """Two agents of the last rank meet where their potential is infinite."""
    scenario, _ = streams()
    q = np.array(scenario.start.q)
    p = np.zeros_like(q)
    far = np.argsort(q[:, 0])[-2:]
    p[far] = 40.0 * (q[far[::-1]] - q[far])
    law = fk.Law(fk.Proximity(8.4), [fk.Gradient(fk.Potential("1/r + r"))])
    session = opened(fk.Scenario(law, fk.State(q, p), t_end=0.5, frames=2), step=0.01)
    raised = "nothing"
    try:
        session.advance(0.5)
    except SimulationError as error:
        raised = type(error).__name__
    session.close()
    return {"raised": session.ranks.comm.allgather(raised)}


def fails():
    scenario, options = streams()
    session = opened(scenario, **options)
    if session.ranks.rank == 1:

        def failing(step, skin=None):
            raise RuntimeError("this rank has had enough")

        session._particles.rebuild = failing
    session.advance(scenario.t_end)
    return {}


def refuses():
    """One rank alone raises an error of this library where the others go on."""
    ranks.MEETING_SECONDS = 1.0
    scenario, options = streams()
    session = opened(scenario, **options)
    if session.ranks.rank == 1:

        def failing(step, skin=None):
            raise InvalidInput("Rank", "patience", "must be longer", 0.0)

        session._particles.rebuild = failing
    session.advance(scenario.t_end)
    return {}


def nan_on_one_rank():
    """A velocity of one rank is not a number."""
    scenario, options = streams()
    session = opened(scenario, **options)
    session.advance(0.05)
    if session.ranks.rank == 1:
        session._particles.agents[3, 2] = np.nan
    raised = "nothing"
    try:
        session.advance(scenario.t_end)
    except SimulationError as error:
        raised = type(error).__name__
    session.close()
    return {"raised": session.ranks.comm.allgather(raised)}


def few():
    """Fewer agents than ranks."""
    law = fk.Law(fk.Hysteresis(4.0, 1.0), [fk.Gradient(fk.Potential("(r - 2)**2/2")), fk.Consensus(0.3)])
    found = {}
    for count in (1, 2, 3):
        q, p = np.arange(2.0 * count).reshape(count, 2), np.ones((count, 2)) * np.arange(count)[:, None]
        made = fk.Scenario(law, fk.State(q, p), t_end=0.2, frames=3)
        for name, more in (("ideal", {}), ("held", HELD)):
            given = made.with_(**more)
            session = opened(given, step=0.01)
            session.advance(0.2)
            run = session.run()
            session.close()
            if session.ranks.first:
                expected = fk.simulate(given, engine="tiles", step=0.01, threads=1, progress=False)
                found[f"{name} {count}"] = [np.abs(run.q - expected.q).max(), np.abs(run.p - expected.p).max()]
    return found


HELD = {"control": fk.Held(0.05), "information": fk.Messages(0.05)}
"""Held control with messages."""


CASES = {
    "twice": twice, "leaps": leaps, "threads": threads, "single": single, "lost": lost, "too large": too_large,
    "nan on one rank": nan_on_one_rank, "few": few,
}  # fmt: skip
"""What leaves its ranks alive: one job runs several."""


def main():
    asked = json.loads(sys.argv[1])
    if "cases" in asked:
        run_each(lambda name: CASES[name]())
        return
    what = asked.pop("what")
    if what in ("killed", "whole"):
        whole(**({"die_at": 0.2} if what == "killed" else {}), **asked)
    else:
        {"fails": fails, "refuses": refuses}[what]()


if __name__ == "__main__":
    main()
