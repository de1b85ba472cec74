"""The cluster engine on 1 and 2 ranks beside the tiled engine on 1 and 2 threads: the same states, the same law.

    make bench-mpi
    python benchmarks/mpi.py [--agents 100000 1000000] [--steps 25] [--repeats 1] [--only kernels tiles] [--json FILE]
    python benchmarks/mpi.py --figures [--json FILE]

``--figures`` measures all that the documentation states: five series of 3,000 steps of 100,000 agents and of 600 of a
million, one contender after the other in each series, and the ratios within each series. Pair styles take fewer steps
of 100,000 agents alone.

Protocol (34) on a disturbed lattice, step 0.01, no ledger. Each contender runs in its own process, one after the
other, the order turning with every repeat; the median is given, and the best: another process on one of the cores holds
up both ranks. Beside the wall time stands the processor time of the busiest rank, and that of its work: of each message
and reduction within a step the time of the rank that took least counts for all ranks, since the others wait for the
last one by asking again and again. The largest memory is that of all ranks together.

``halves`` are two runs of the tiled engine at once, each on one thread, of half the agents: they send each other
nothing, so that one run of all over these is the ratio that the two cores, their caches and the memory allow.
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
from flocking.engine.lammps.library import communicator
from flocking.papers.olfati_saber_2003 import system

STEP = 0.01
MPIEXEC = str(Path(sys.executable).with_name("mpiexec"))
CONTENDERS = (
    ("kernels", 1), ("kernels", 2), ("tiles", 1), ("tiles", 2), ("halves", 2), ("pair styles", 1), ("pair styles", 2),
)  # fmt: skip
WAITING = {"MPIR_CVAR_ENABLE_HEAVY_YIELD": "1", "MPIR_CVAR_POLLS_BEFORE_YIELD": "20"}
"""Ranks that wait sleep instead of asking again and again: with ``--sleep``, where others need the processors."""
SERIES = 5
"""Series of ``--figures``."""
WINDOWS = {100_000: 3000, 1_000_000: 600}
"""Steps of each series of ``--figures``: several exchanges of agents, one in 100 to 450 steps, are among them."""
FEWER = 20
"""Pair styles take so many times fewer steps: each takes about as many times longer."""
RATIOS = (
    ("two ranks over one", ("kernels", 1), ("kernels", 2)),
    ("one rank over tiles on one thread", ("tiles", 1), ("kernels", 1)),
    ("what this machine allows, two halves at once over one run of all", ("tiles", 1), ("halves", 2)),
    ("tiles, two threads over one", ("tiles", 1), ("tiles", 2)),
    ("two ranks over pair styles on two ranks", ("pair styles", 2), ("kernels", 2)),
)
"""Names of ratios of speeds, and the contenders whose times a step are divided."""
SLEEP = "FLOCKING_BENCHMARK_SLEEP"
"""Environment variable that is set if ranks that wait sleep."""
FIRST = "FLOCKING_BENCHMARK_FIRST"
"""Environment variable that is set if measured steps run before all other processes, as real-time ones."""


def scenario(agents: int) -> fk.Scenario:
    start = fk.start.hexagonal(agents, spacing=system.DISTANCE, noise=0.5, speed=0.5, seed=1)
    return fk.Scenario(fk.Law(system.hard_net(), system.alpha_terms()), start, t_end=1e6, frames=1)


def go_first(first: bool) -> None:
    """Let all threads of this process run before all other processes, or as others again."""
    for thread in Path("/proc/self/task").iterdir():
        how, priority = (os.SCHED_FIFO, 1) if first else (os.SCHED_OTHER, 0)
        os.sched_setscheduler(int(thread.name), how, os.sched_param(priority))


def timed(owner: type, name: str, found: list[float]) -> None:
    """Let a method write down the processor time of each of its calls."""
    method = getattr(owner, name)

    def call(*arguments: object) -> object:
        begin = time.process_time()
        try:
            return method(*arguments)
        finally:
            found.append(time.process_time() - begin)

    setattr(owner, name, call)


def contend(engine: str, workers: int, agents: int, steps: int) -> None:
    """Run in a process of its own; the first rank prints seconds a step (wall, processor, work), GiB, lists built."""
    spent: list[float] = []
    if engine == "kernels":
        from flocking.engine.lammps.domains.copies import Copies
        from flocking.engine.lammps.ranks import Ranks

        timed(Copies, "refresh", spent)
        timed(Ranks, "reduced", spent)
    if engine in ("tiles", "halves"):
        part, threads = (agents, workers) if engine == "tiles" else (agents // workers, 1)
        session = fk.start(scenario(part), "tiles", step=STEP, ledger=False, threads=threads, keep_frames=False)
    else:
        more = {"threads": 1, "keep_frames": False} if engine == "kernels" else {}
        session = fk.start(scenario(agents), "lammps", step=STEP, ledger=0, forces=engine, **more)
    session.advance(20 * STEP)
    if os.environ.get(FIRST):
        # For the measured steps alone, so that other processes wait for seconds at most.
        go_first(True)
        session.advance(session.time + 5 * STEP)
    comm = None if engine == "tiles" else communicator()
    if engine == "halves":
        comm.Barrier()
    spent.clear()
    lists = None if engine == "pair styles" else session._particles.search
    built = lists.rebuilds if lists else 0
    begin, worked = time.perf_counter(), time.process_time()
    session.advance(session.time + steps * STEP)
    found = [time.perf_counter() - begin, time.process_time() - worked]
    if os.environ.get(FIRST):
        go_first(False)
    found.append(found[1] - sum(spent))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    least = spent
    if comm is not None:
        every = comm.gather((found, memory, spent))
        if comm.rank:
            return
        found = [max(f[k] for f, _, _ in every) for k in range(3)]
        memory = sum(m for _, m, _ in every)
        # Messages are collective: all ranks have the same number of calls.
        least = [min(each) for each in zip(*(calls for _, _, calls in every), strict=True)]
    found[2] += sum(least)
    print(json.dumps([*(x / steps for x in found), memory, lists.rebuilds - built if lists else 0]))


def measured(engine: str, workers: int, agents: int, steps: int) -> list[float]:
    words = [sys.executable, __file__, "--contender", engine, str(workers), str(agents), str(steps)]
    if engine != "tiles":
        words = [MPIEXEC, "-n", str(workers), *words]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", **(WAITING if os.environ.get(SLEEP) else {})}
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=environment)
    return [float(x) for x in json.loads(done.stdout.strip().splitlines()[-1])]


def ratios(times: dict[tuple[str, int], list[list[float]]]) -> dict[str, list[float]]:
    """Ratios of the speeds within each series, by their names; those of wall time, and of work."""
    found = {}
    for name, one, other in RATIOS:
        if one in times and other in times:
            for kind, k in (("", 0), (", work", 2)):
                pairs = zip(times[one], times[other], strict=True)
                found[name + kind] = [a[k] / b[k] for a, b in pairs]
    return found


def series(
    agents: int, steps: int, repeats: int, contenders: tuple[tuple[str, int], ...], *, fewer: int = 1
) -> dict[tuple[str, int], list[list[float]]]:
    """What each contender measured in each series, in which they take turns."""
    times: dict[tuple[str, int], list[list[float]]] = {c: [] for c in contenders}
    for repeat in range(repeats):
        turn = repeat % len(contenders)
        for engine, workers in contenders[turn:] + contenders[:turn]:
            many = steps // fewer if engine == "pair styles" else steps
            times[engine, workers].append(measured(engine, workers, agents, many))
    return times


def report(agents: int, times: dict[tuple[str, int], list[list[float]]]) -> list[dict[str, object]]:
    """Print what was measured with some agents: medians, and the least and the largest; ratios with their worst end."""
    found: list[dict[str, object]] = []
    for (engine, workers), values in times.items():
        wall, spent, work, memory = (statistics.median(v[k] for v in values) for k in range(4))
        found.append(
            {"engine": engine, "workers": workers, "agents": agents, "measured": values, "median": wall,
             "processor": spent, "work": work, "gib": memory, "load": os.getloadavg()[0],
             "processors": os.cpu_count()}
        )  # fmt: skip
        least, most = (1e3 * f(v[0] for v in values) for f in (min, max))
        print(
            f"{agents:8d} agents  {engine:11s} x{workers}  {1e3 * wall:8.3f} ms/step ({least:.3f} to {most:.3f})"
            f"  processor {1e3 * spent:8.3f}  work {1e3 * work:.3f}  {1e-6 * agents / wall:.2f} M agent-steps/s"
            f"  {memory:.2f} GiB  lists built {[int(v[4]) for v in values]}",
            flush=True,
        )
    for name, each in ratios(times).items():
        found.append({"ratio": name, "agents": agents, "series": each})
        shown = ", ".join(f"{x:.2f}" for x in each)
        print(f"{agents:8d} agents  {name}: median {statistics.median(each):.2f}, worst {min(each):.2f}  ({shown})")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--agents", type=int, nargs="+", default=[100_000, 1_000_000])
    parser.add_argument("--steps", type=int, default=25)
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--only", nargs="+", default=["kernels", "tiles", "halves", "pair styles"])
    parser.add_argument("--figures", action="store_true", help="all that the documentation states")
    parser.add_argument("--first", action="store_true", help="measured steps run before all other processes (root)")
    parser.add_argument("--sleep", action="store_true", help="ranks that wait sleep: for a machine that others use")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--contender", nargs=4)
    asked = parser.parse_args()
    if asked.sleep:
        os.environ[SLEEP] = "1"
    if asked.first:
        os.environ[FIRST] = "1"
    if asked.contender:
        engine, workers, agents, steps = asked.contender
        contend(engine, int(workers), int(agents), int(steps))
        return
    found: list[dict[str, object]] = []
    for agents in WINDOWS if asked.figures else asked.agents:
        contenders = tuple(c for c in CONTENDERS if c[0] in asked.only)
        if asked.figures:
            extra = {("pair styles", 2)} if agents <= 100_000 else set()
            kept = tuple(c for c in contenders if c[0] != "pair styles" or c in extra)
            times = series(agents, WINDOWS[agents], SERIES, kept, fewer=FEWER)
        else:
            times = series(agents, asked.steps, asked.repeats, contenders)
        found += report(agents, times)
        if asked.json:
            asked.json.write_text(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
