"""What the tests start under mpiexec: a law run on all ranks, and what came out written down by the first."""

from __future__ import annotations

import json
import os
import signal
import sys

import numpy as np

import flocking as fk
from flocking.engine.driver.simulate import run_session
from flocking.engine.lammps.session import LammpsOptions, LammpsSession
from tests.mpi.jobs import run_each
from tests.mpi.laws import law, start


def scenario(name, dimension, *, n=300, t_end=0.5, frames=6, side=1.0, speed=1.0):
    state = start(dimension, n, speed=speed)
    if name == "split":  # two halves that fly apart, one of them across the other's place
        q = np.array(state.q)
        away = np.where(q[:, :1] > 0, 1.0, -1.0) * np.array([60.0, 25.0, 10.0][:dimension])
        state = fk.State(q, state.p + away)
        name = "olfati-saber (35)"
    if name == "leaving":  # a crowd that leaves a few behind, far away in one corner
        q, p = np.array(state.q), np.array(state.p)
        p -= np.array([150.0, 50.0, 20.0][:dimension])
        q[::20], p[::20] = 20.0 * np.abs(q[::20]) + 1000.0, 0.0
        state, name = fk.State(q, p), "olfati-saber (35)"
    found, agents = law(name, dimension, state.n)
    return fk.Scenario(found, state, t_end=t_end, frames=frames, agents=agents, name=name)


def computed(_=None, **asked):
    """Run a law on all ranks, one or more; what came out, on the first."""
    made = scenario(asked["law"], asked["dimension"], **asked.get("scenario", {}))
    if asked.get("order") == 1:
        made = made.with_(agents=fk.SingleIntegrator(made.agents.masses))
    options = {"step": asked.get("step", 0.01), **asked.get("options", {})}
    session = LammpsSession(made, LammpsOptions(forces="pair styles", **options))
    before = session.ranks.comm.gather(set(session.atoms.ids.tolist()))
    if "die_at" in asked:
        _die(session, asked["die_at"], asked["how"])
    if "break" in asked and session.ranks.rank == session.ranks.size - 1:
        _break(session)
    crossed = []
    afterwards = []
    close = session.close

    def look():
        after = session.ranks.comm.gather(set(session.atoms.ids.tolist()))
        if session.ranks.first:
            afterwards.extend(len(a) for a in after)
            crossed.extend(len(a - b) for a, b in zip(after, before, strict=True))
        close()

    session.close = look
    run = run_session(session, save=asked.get("save"), progress=False, every=asked.get("every", 5.0))
    if not session.ranks.first:
        return {}
    return {
        "t": run.t, "q": run.q, "p": run.p, "trace": run.trace, "crossed": crossed, "ranks": session.ranks.size,
        "owned": [len(b) for b in before], "owned_after": afterwards,
    }  # fmt: skip


def _die(session, at, how):
    """Let the last rank die at a time."""
    doomed = session.ranks.size - 1
    take = session._take_steps

    def dying(to):
        if session.time >= at and session.ranks.rank == doomed:
            if how == "signal":
                os.kill(os.getpid(), signal.SIGKILL)
            raise RuntimeError("this rank has had enough")
        take(to)

    session._take_steps = dying


def _break(session):
    """Let LAMMPS fail on this rank."""
    lammps = session.atoms._lammps

    class MPIAbortException(Exception):
        pass

    def failing(text):
        if text.startswith("run"):
            raise MPIAbortException("ERROR on proc 1: Non-numeric atom coords - simulation unstable (../domain.cpp:1)")
        type(lammps).commands_string(lammps, text)

    lammps.commands_string = failing


def main():
    if "cases" in json.loads(sys.argv[1]):
        run_each(computed)
    else:
        computed(**json.loads(sys.argv[1]))


if __name__ == "__main__":
    main()
