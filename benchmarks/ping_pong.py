"""Messages between two ranks of one machine: half the time of a round trip, by their size; and a reduction of two.

    mpiexec -n 2 python benchmarks/ping_pong.py [--rounds 2000] [--first]

Least and median over the rounds, with buffers that are sent as they lie in memory. With ``--first`` the rounds run
before all other processes, which wait for a second at most.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from functools import partial

import numpy as np

import mpi
from flocking.engine.lammps.library import communicator

SIZES = (8, 64_000, 256_000)
"""Bytes: one number, and what a rank sends in a step by the model of 10^8 agents on 1,024 and on 64 ranks."""


def rounds(count: int, each: Callable[[], object], *, first: bool) -> tuple[float, float]:
    """Least and median of the seconds that calls of a function take."""
    taken = []
    if first:
        mpi.go_first(True)
    for _ in range(count):
        begin = time.perf_counter()
        each()
        taken.append(time.perf_counter() - begin)
    if first:
        mpi.go_first(False)
    return min(taken), statistics.median(taken)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=2000)
    parser.add_argument("--first", action="store_true", help="rounds run before all other processes (root)")
    asked = parser.parse_args()
    comm = communicator()

    def there_and_back(buffer: np.ndarray) -> None:
        if comm.rank == 0:
            comm.Send(buffer, 1)
            comm.Recv(buffer, 1)
        else:
            comm.Recv(buffer, 0)
            comm.Send(buffer, 0)

    def show(what: str, least: float, middle: float) -> None:
        if comm.rank == 0:
            print(f"{what}: {1e6 * least:.2f} us at least, {1e6 * middle:.2f} us in the median")

    for size in SIZES:
        buffer = np.zeros(size // 8)
        least, middle = rounds(asked.rounds, partial(there_and_back, buffer), first=asked.first)
        show(f"{size} bytes, one way", 0.5 * least, 0.5 * middle)
    one, total = np.zeros(4), np.zeros(4)
    show("reduction of 4 numbers", *rounds(asked.rounds, partial(comm.Allreduce, one, total), first=asked.first))


if __name__ == "__main__":
    main()
