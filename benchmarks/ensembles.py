"""Cost of many small runs: sweeps of the 10-agent, 30 s run of Zhou et al., in runs per second.

    python benchmarks/ensembles.py [--runs 1000] [--workers 1 2] [--json FILE]

Each sweep is a process of its own with cold workers: their start, the loading of the library and of its kernels count.
A first sweep of 16 runs, not counted, compiles the kernels if they are not in the cache. ``processor seconds`` count
what all processes of a sweep used: on a machine that others share they say more than the time that passed.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

DURATION = 30.0


def sweep_once(runs: int, workers: int, folder: str) -> dict[str, Any]:
    """One sweep in this process, with all it costs."""
    begin = time.perf_counter()
    import flocking as fk
    from flocking.papers import zhou_2015

    table = fk.sweep(
        lambda seed: zhou_2015.scenario(seed=seed, duration=DURATION), seeds=range(runs),
        measures=["connected", "closest", "velocity_spread", "links_created"],
        workers=workers, out=folder, progress=False,
    )  # fmt: skip
    seconds = time.perf_counter() - begin
    assert table.complete, "runs are missing"
    assert not table.failures, table.failures[0]
    assert table.values("connected").all(), "Theorem 1 (i) failed"
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return {
        "runs": runs, "workers": workers, "seconds": seconds, "runs_per_second": runs / seconds,
        "processor_seconds": sum(u.ru_utime + u.ru_stime for u in used),
        "largest_process_mb": max(u.ru_maxrss for u in used) / 1024,
    }  # fmt: skip


def measured(runs: int, workers: int) -> dict[str, Any]:
    """One sweep in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, __file__, "--once", str(runs), str(workers), str(Path(folder, "sweep"))]
        shown = subprocess.run(command, capture_output=True, text=True, check=True)
    found: dict[str, Any] = json.loads(shown.stdout)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--json", type=Path)
    parser.add_argument("--once", nargs=3, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.once:
        print(json.dumps(sweep_once(int(given.once[0]), int(given.once[1]), given.once[2])))
        return
    measured(16, 1)
    about = {"cores": os.cpu_count(), "load": os.getloadavg()[0], "python": platform.python_version()}
    rows = []
    print(f"{about['cores']} cores, load {about['load']:.1f} before")
    print("workers    runs  seconds   runs/s  processor s  ms a run  largest MB")
    for workers in given.workers:
        row = measured(given.runs, workers)
        rows.append(row)
        each = 1000 * row["processor_seconds"] / row["runs"]
        print(
            f"{workers:7d} {row['runs']:7d} {row['seconds']:8.1f} {row['runs_per_second']:8.1f} "
            f"{row['processor_seconds']:12.1f} {each:9.1f} {row['largest_process_mb']:11.0f}"
        )
    if given.json:
        given.json.write_text(json.dumps({**about, "sweeps": rows}, indent=2) + "\n")


if __name__ == "__main__":
    main()
