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
WAITING = {"MPIR_CVAR_ENABLE_HEAVY_YIELD": "1", "MPIR_CVAR_POLLS_BEFORE_YIELD": "20"}
"""Ranks that wait leave the processor to others: there are more ranks than processors."""


def launch(ranks, *words, limit=TOO_LONG):
    """Run a command on some ranks, for ``limit`` seconds at most; the finished process."""
    return subprocess.run(
        [MPIEXEC, "-n", str(ranks), *words], cwd=ROOT, capture_output=True, text=True, timeout=limit,
        env={**os.environ, "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", **WAITING},
    )  # fmt: skip


def run_job(ranks, tmp_path, law, dimension, *, step=0.01, **asked):
    """Run a law on some ranks; what the first rank wrote down."""
    out = tmp_path / f"{ranks}.npz"
    done = launch(
        ranks, sys.executable, "-m", "tests.mpi.job",
        json.dumps({"law": law, "dimension": dimension, "step": step, "out": str(out), **asked}),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    with np.load(out) as file:
        return {name: file[name] for name in file.files}
