"""Starting jobs on several ranks of this machine."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
MPIEXEC = str(Path(sys.executable).with_name("mpiexec"))
TOO_LONG = 240
LONGEST = 1800
"""Seconds that a job of many cases may take."""
WAITING = {"MPIR_CVAR_ENABLE_HEAVY_YIELD": "1", "MPIR_CVAR_POLLS_BEFORE_YIELD": "20"}
"""Ranks that wait leave the processor to others: there are more ranks than processors."""


def launch(ranks, *words, limit=TOO_LONG):
    """Run a command on some ranks, for ``limit`` seconds at most; the finished process."""
    return subprocess.run(
        [MPIEXEC, "-n", str(ranks), *words], cwd=ROOT, capture_output=True, text=True, timeout=limit,
        env={**os.environ, "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", **WAITING},
    )  # fmt: skip


class Cases:
    """Cases that one job after another has run: a job goes on to the next case, and a new one begins where one ended.

    Parameters
    ----------
    ranks
        Number of ranks.
    folder
        Where jobs write.
    """

    def __init__(self, ranks, folder):
        self.ranks, self.folder, self.failures = ranks, folder, {}

    def run(self, module, cases):
        """Run cases, arguments by name, by a module that calls `run_each`."""
        left = dict(cases)
        while left:
            words = json.dumps({"folder": str(self.folder), "cases": left})
            done = launch(self.ranks, sys.executable, "-m", module, words, limit=LONGEST)
            begun = [name for name in left if _place(self.folder, name, "begun").exists()]
            if done.returncode == 0:
                return self
            name = begun[-1] if begun else next(iter(left))
            self.failures[name] = done.stdout[-2000:] + done.stderr[-4000:]
            left = {other: words for other, words in left.items() if other not in {name, *begun}}
        return self

    def of(self, name):
        """What the first rank wrote down of a case."""
        file = _place(self.folder, name, "npz")
        assert name not in self.failures, f"{name!r} on {self.ranks} ranks: {self.failures[name]}"
        assert file.exists(), f"{name!r} on {self.ranks} ranks left nothing"
        with np.load(file) as found:
            return {key: found[key] for key in found.files}


def run_each(compute):
    """Run the cases that this job was started with; all ranks call this.

    Parameters
    ----------
    compute
        Called with the name and the arguments of a case; gives what the first rank writes down.
    """
    from mpi4py import MPI

    asked, first = json.loads(sys.argv[1]), MPI.COMM_WORLD.rank == 0
    for name, words in asked["cases"].items():
        if first:
            _place(asked["folder"], name, "begun").touch()
        found = compute(name, **words)
        if first:
            np.savez(_place(asked["folder"], name, "npz"), **found)


def _place(folder, name, kind):
    return Path(folder) / f"{name.replace(' ', '_')}.{kind}"
