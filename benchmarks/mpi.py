"""The cluster engine on 1 and 2 ranks beside the tiled engine on 1 and 2 threads: the same states, the same law.

    make bench-mpi
    python benchmarks/mpi.py [--agents 100000 1000000] [--steps 25] [--repeats 1] [--json FILE]

Protocol (34) on a disturbed lattice, step 0.01, no ledger. Each contender runs in its own process, one after the
other, the order turning with every repeat; the median is given, and the best: another process on one of the cores holds
up both ranks.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

import flocking as fk
from flocking.papers.olfati_saber_2003 import system

STEP = 0.01
MPIEXEC = str(Path(sys.executable).with_name("mpiexec"))
CONTENDERS = (("lammps", 1), ("lammps", 2), ("tiles", 1), ("tiles", 2))


def scenario(agents: int) -> fk.Scenario:
    start = fk.start.hexagonal(agents, spacing=system.DISTANCE, noise=0.5, speed=0.5, seed=1)
    return fk.Scenario(fk.Law(system.hard_net(), system.alpha_terms()), start, t_end=1e6, frames=1)


def contend(engine: str, workers: int, agents: int, steps: int) -> None:
    """Run in a process of its own; the first rank prints seconds per step."""
    options = {"ledger": 0} if engine == "lammps" else {"ledger": False, "threads": workers}
    session = fk.start(scenario(agents), engine, step=STEP, **options)
    session.advance(20 * STEP)
    begin = time.perf_counter()
    session.advance(session.time + steps * STEP)
    seconds = (time.perf_counter() - begin) / steps
    if engine == "tiles" or session.ranks.first:
        print(json.dumps(seconds))


def measured(engine: str, workers: int, agents: int, steps: int) -> float:
    words = [sys.executable, __file__, "--contender", engine, str(workers), str(agents), str(steps)]
    if engine == "lammps":
        words = [MPIEXEC, "-n", str(workers), *words]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    return float(json.loads(done.stdout.strip().splitlines()[-1]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--agents", type=int, nargs="+", default=[100_000, 1_000_000])
    parser.add_argument("--steps", type=int, default=25)
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--contender", nargs=4)
    asked = parser.parse_args()
    if asked.contender:
        engine, workers, agents, steps = asked.contender
        contend(engine, int(workers), int(agents), int(steps))
        return
    found = []
    for agents in asked.agents:
        times: dict[tuple[str, int], list[float]] = {c: [] for c in CONTENDERS}
        for repeat in range(asked.repeats):
            turn = repeat % len(CONTENDERS)
            for contender in CONTENDERS[turn:] + CONTENDERS[:turn]:
                times[contender].append(measured(*contender, agents, asked.steps))
        for (engine, workers), values in times.items():
            middle = statistics.median(values)
            found.append(
                {"engine": engine, "workers": workers, "agents": agents, "seconds": values, "median": middle,
                 "load": os.getloadavg()[0], "processors": os.cpu_count()}
            )  # fmt: skip
            rate = agents / middle / 1e6
            print(
                f"{agents:8d} agents  {engine:6s} x{workers}  {1e3 * middle:8.2f} ms/step  {rate:.2f} M agent-steps/s"
                f"  best {1e3 * min(values):8.2f} ms/step"
            )
    if asked.json:
        asked.json.write_text(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
