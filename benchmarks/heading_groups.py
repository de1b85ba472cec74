"""Cost of updates of many agents by the rule of Vicsek et al.: every update is run, none is extrapolated.

    python benchmarks/heading_groups.py [--agents 1000000] [--side 100] [--updates 1000] [--threads 2] [--json FILE]

The defaults are the number of agents, the side and the radius for which Sisyphe, a library for GPUs, states 26 s in
single precision: a hundred agents in a unit of area. Seconds that passed and processor seconds of every hundred updates
are printed, without the start and the compilation, and the order parameter: that of a group in which nothing moves
would not change.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from itertools import pairwise
from pathlib import Path

from flocking.papers.vicsek_1995 import HeadingGroup, system

BLOCK = 100
"""Updates between two lines of the output."""


def main() -> None:
    """Measure, print, and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", type=int, default=1_000_000)
    parser.add_argument("--side", type=float, default=100.0)
    parser.add_argument("--updates", type=int, default=1000)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--noise", type=float, default=1.0)
    parser.add_argument("--speed", type=float, default=system.SPEED)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    small = HeadingGroup(system.group(4000, 30.0, given.noise, duration=1, speed=given.speed), threads=given.threads)
    small.update()  # compiles the rule
    small.close()
    scenario = system.group(given.agents, given.side, given.noise, duration=1, speed=given.speed)
    agents = HeadingGroup(scenario, threads=given.threads)
    ends = [(time.perf_counter(), time.process_time(), agents.order)]
    try:
        while agents.updates < given.updates:
            agents.update(min(BLOCK, given.updates - agents.updates))
            ends.append((time.perf_counter(), time.process_time(), agents.order))
            (wall, busy, order), (first, began, _) = ends[-1], ends[0]
            spent = f"{wall - first:8.1f} s passed  {busy - began:8.1f} s of processor time"
            print(f"{agents.updates:6d} updates  {spent}  order {order:.4f}", flush=True)
    finally:
        agents.close()
    if given.json:
        blocks = [{"seconds": b[0] - a[0], "processor seconds": b[1] - a[1], "order": b[2]} for a, b in pairwise(ends)]
        given.json.write_text(json.dumps({"given": {**vars(given), "json": None}, "blocks of 100": blocks}, indent=1))


if __name__ == "__main__":
    main()
