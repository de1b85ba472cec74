"""The cluster engine on 1 and 2 ranks beside the tiled engine on 1 and 2 threads: the same states, the same law.

    make bench-mpi
    python benchmarks/mpi.py [--agents 100000 1000000] [--steps 25] [--repeats 1] [--only kernels tiles] [--json FILE]

Protocol (34) on a disturbed lattice, step 0.01, no ledger. Each contender runs in its own process, one after the
other, the order turning with every repeat; the median is given, and the best: another process on one of the cores holds
up both ranks. Beside the wall time stands the processor time of the busiest rank. Ranks that wait sleep, so that on a
busy machine it is the time of their work. The largest memory is that of all ranks together.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import time
from pathlib import Path

import flocking as fk
from flocking.papers.olfati_saber_2003 import system

STEP = 0.01
MPIEXEC = str(Path(sys.executable).with_name("mpiexec"))
CONTENDERS = (
    ("kernels", 1), ("kernels", 2), ("tiles", 1), ("tiles", 2), ("pair styles", 1), ("pair styles", 2),
)  # fmt: skip
WAITING = {"MPIR_CVAR_ENABLE_HEAVY_YIELD": "1", "MPIR_CVAR_POLLS_BEFORE_YIELD": "20"}
"""Ranks that wait sleep instead of asking again and again."""


def scenario(agents: int) -> fk.Scenario:
    start = fk.start.hexagonal(agents, spacing=system.DISTANCE, noise=0.5, speed=0.5, seed=1)
    return fk.Scenario(fk.Law(system.hard_net(), system.alpha_terms()), start, t_end=1e6, frames=1)


def contend(engine: str, workers: int, agents: int, steps: int) -> None:
    """Run in a process of its own; the first rank prints seconds a step (wall, processor) and GiB."""
    if engine == "tiles":
        session = fk.start(scenario(agents), "tiles", step=STEP, ledger=False, threads=workers, keep_frames=False)
    else:
        more = {"threads": 1, "keep_frames": False} if engine == "kernels" else {}
        session = fk.start(scenario(agents), "lammps", step=STEP, ledger=0, forces=engine, **more)
    session.advance(20 * STEP)
    begin, worked = time.perf_counter(), time.process_time()
    session.advance(session.time + steps * STEP)
    found = [time.perf_counter() - begin, time.process_time() - worked]
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    if engine != "tiles":
        comm = session.ranks.comm
        every = comm.gather((found, memory))
        if not session.ranks.first:
            return
        found = [max(f[k] for f, _ in every) for k in range(2)]
        memory = sum(m for _, m in every)
    print(json.dumps([*(x / steps for x in found), memory]))


def measured(engine: str, workers: int, agents: int, steps: int) -> list[float]:
    words = [sys.executable, __file__, "--contender", engine, str(workers), str(agents), str(steps)]
    if engine != "tiles":
        words = [MPIEXEC, "-n", str(workers), *words]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", **WAITING}
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=environment)
    return [float(x) for x in json.loads(done.stdout.strip().splitlines()[-1])]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--agents", type=int, nargs="+", default=[100_000, 1_000_000])
    parser.add_argument("--steps", type=int, default=25)
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--only", nargs="+", default=["kernels", "tiles", "pair styles"])
    parser.add_argument("--json", type=Path)
    parser.add_argument("--contender", nargs=4)
    asked = parser.parse_args()
    if asked.contender:
        engine, workers, agents, steps = asked.contender
        contend(engine, int(workers), int(agents), int(steps))
        return
    found = []
    for agents in asked.agents:
        contenders = tuple(c for c in CONTENDERS if c[0] in asked.only)
        times: dict[tuple[str, int], list[list[float]]] = {c: [] for c in contenders}
        for repeat in range(asked.repeats):
            turn = repeat % len(contenders)
            for contender in contenders[turn:] + contenders[:turn]:
                times[contender].append(measured(*contender, agents, asked.steps))
        for (engine, workers), values in times.items():
            wall, work, memory = (statistics.median(v[k] for v in values) for k in range(3))
            found.append(
                {"engine": engine, "workers": workers, "agents": agents, "measured": values, "median": wall,
                 "processor": work, "gib": memory, "load": os.getloadavg()[0], "processors": os.cpu_count()}
            )  # fmt: skip
            print(
                f"{agents:8d} agents  {engine:11s} x{workers}  {1e3 * wall:8.2f} ms/step"
                f"  best {1e3 * min(v[0] for v in values):8.2f}  processor {1e3 * work:8.2f} ms/step"
                f" (best {1e3 * min(v[1] for v in values):.2f})  {1e-6 * agents / wall:.2f} M agent-steps/s"
                f"  {memory:.2f} GiB",
                flush=True,
            )
    if asked.json:
        asked.json.write_text(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
