"""Ten steps of 10^8 agents on one machine: seconds a step, bytes an agent, and the most memory the process held.

    python benchmarks/hundred_million.py [--agents 1e8] [--steps 10] [--limit 24]

The law of Olfati-Saber (34) in the plane in float32, on a hexagonal patch with noise 0.5 and velocities N(0,1). The
process may not take more address space than the limit in GiB: it fails rather than exceed it.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time

import numpy as np
from speed import SPACING, STEP, saber


def patch(n, seed=0):
    """A rectangular piece of the lattice: rows of equal length, filled part by part."""
    rng = np.random.default_rng(seed)
    width = int(np.ceil(np.sqrt(n)))
    q, p = np.empty((n, 2)), np.empty((n, 2))
    for first in range(0, n, 2**22):
        k = np.arange(first, min(first + 2**22, n))
        row, column = k // width, k % width
        part = slice(first, first + len(k))
        q[part] = rng.normal(size=(len(k), 2))
        q[part] *= 0.5
        q[part, 0] += (column + 0.5 * (row % 2)) * SPACING
        q[part, 1] += row * (SPACING * np.sqrt(3) / 2)
        p[part] = rng.normal(size=(len(k), 2))
    return q, p


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", type=float, default=1e8)
    parser.add_argument("--steps", type=int, default=10)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--limit", type=float, default=24.0)
    o = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (int(o.limit * 2**30),) * 2)
    import flocking as fk
    from flocking.engine.tiles.session import TilesOptions, TilesSession

    n = int(o.agents)
    begin = time.perf_counter()
    state = fk.State(*patch(n))
    made = time.perf_counter() - begin
    scenario = fk.Scenario(saber(), state, t_end=o.steps * STEP, frames=1)
    del state
    options = TilesOptions(
        step=STEP, precision="float32", threads=o.threads, ledger=False, keep_frames=False, memory_limit=8 * 2**30
    )
    begin = time.perf_counter()
    session = TilesSession(scenario, options)
    session._guarded(lambda: session._particles.require_lists(STEP))
    ready = time.perf_counter() - begin
    begin = time.perf_counter()
    session.advance(o.steps * STEP)
    seconds = (time.perf_counter() - begin) / session.steps
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    answer = {
        "agents": n, "steps": session.steps, "seconds a step": seconds, "M/s": n / seconds / 1e6,
        "bytes": session.memory_in_use / n, "peak GiB": peak / 2**30, "rebuilds": session.rebuilds,
        "seconds to make the start": made, "seconds to the first lists": ready,
    }  # fmt: skip
    print(json.dumps(answer))


if __name__ == "__main__":
    main()
