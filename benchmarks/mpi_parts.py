"""Where the time of a step on ranks goes: kernels, copies, reductions, rebuilds, and the rest in Python.

    mpiexec -n 2 python benchmarks/mpi_parts.py [--agents 100000] [--steps 300] [--tries 6] [--first]

The states and the law of `benchmarks/mpi.py`. Wall time of each rank, each part without those within it; with
``--first`` measured steps run before all other processes, which wait for seconds at most.
"""

from __future__ import annotations

import argparse
import statistics
import time

import flocking as fk
import mpi
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.lammps.domains.copies import Copies
from flocking.engine.lammps.domains.particles import RankParticles
from flocking.engine.lammps.ranks import Ranks

PARTS = (
    (Workers, "each", "kernels"), (Copies, "begin", "copies sent"), (Copies, "_finish", "copies waited for"),
    (Copies, "refresh", "copies put"), (Ranks, "reduced", "reductions"), (RankParticles, "_exchanged", "exchange"),
    (RankParticles, "_take", "who copies whom"), (RankParticles, "rebuild", "rest of rebuilds"),
)  # fmt: skip
"""Methods that are timed, and what they are."""


def timed(owner: type, name: str, part: str, spent: dict[str, float], within: list[float]) -> None:
    """Let a method add the time of its calls, without that of timed calls within it, to a part."""
    method = getattr(owner, name)

    def call(*arguments: object, **named: object) -> object:
        begin = time.perf_counter()
        within.append(0.0)
        try:
            return method(*arguments, **named)
        finally:
            took = time.perf_counter() - begin
            spent[part] = spent.get(part, 0.0) + took - within.pop()
            if within:
                within[-1] += took

    setattr(owner, name, call)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--agents", type=int, default=100_000)
    parser.add_argument("--steps", type=int, default=300)
    parser.add_argument("--tries", type=int, default=6)
    parser.add_argument("--first", action="store_true", help="measured steps run before all other processes (root)")
    asked = parser.parse_args()
    spent: dict[str, float] = {}
    for owner, name, part in PARTS:
        timed(owner, name, part, spent, within=WITHIN)
    session = fk.start(
        mpi.scenario(asked.agents), "lammps", step=mpi.STEP, ledger=0, forces="kernels", threads=1, keep_frames=False
    )
    session.advance(20 * mpi.STEP)
    walls: list[float] = []
    total: dict[str, float] = {}
    for _ in range(asked.tries):
        if asked.first:
            mpi.go_first(True)
            session.advance(session.time + 3 * mpi.STEP)
        spent.clear()
        begin = time.perf_counter()
        session.advance(session.time + asked.steps * mpi.STEP)
        walls.append(time.perf_counter() - begin)
        if asked.first:
            mpi.go_first(False)
            time.sleep(1.0)
        for part, seconds in spent.items():
            total[part] = total.get(part, 0.0) + seconds
    count = asked.tries * asked.steps
    parts = {part: seconds / count for part, seconds in total.items()}
    parts["rest in Python"] = sum(walls) / count - sum(parts.values())
    median = statistics.median(walls) / asked.steps
    for rank, (mean, middle, each) in enumerate(session.ranks.comm.gather((sum(walls) / count, median, parts)) or ()):
        print(f"rank {rank}: {1e3 * mean:.3f} ms a step (median of tries {1e3 * middle:.3f})")
        for part, seconds in each.items():
            print(f"    {part:18s} {1e6 * seconds:8.1f} us")


WITHIN: list[float] = []
"""Time of timed calls within those that go on."""

if __name__ == "__main__":
    main()
