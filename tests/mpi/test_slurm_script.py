"""The Slurm script of the page of the cluster: bash accepts it, and what it starts is what the page says."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from tests.mpi.jobs import ROOT, WAITING

PAGE = (ROOT / "docs" / "cluster.md").read_text()
SCRIPTS = re.findall(r"^```\w*\n(#!/bin/bash\n#SBATCH.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
LAUNCHERS = ("mpiexec", "srun")
RECORD = '#!/bin/bash\nprintf \'%s\\n\' "${0##*/}" "$@" > called\n'
"""A launcher that writes down its name and its words, one a line."""

ONE_RANK = 'while [ "$1" != flocking ]; do shift; done\nexec "$@"\n'
"""Then it runs the program alone."""


def asked():
    """What the script asks Slurm for, by name."""
    return dict(re.findall(r"^#SBATCH --([\w-]+)=(\S+)$", SCRIPTS[0], re.MULTILINE))


def started(folder, launcher, program=None):
    """Run the script in a folder, where launchers are those of this test; the finished process and the words."""
    environment = folder / ".venv" / "bin"
    environment.mkdir(parents=True)
    for name in LAUNCHERS:
        (environment / name).write_text(launcher)
        (environment / name).chmod(0o755)
    if program is not None:
        (environment / "flocking").symlink_to(program)
    (environment / "activate").write_text(f'PATH="{environment}:$PATH"\n')
    (folder / "job.sh").write_text(SCRIPTS[0])
    tasks = int(asked()["nodes"]) * int(asked()["ntasks-per-node"])
    done = subprocess.run(
        ["bash", "-eu", "job.sh"], cwd=folder, capture_output=True, text=True, timeout=240,
        env={**os.environ, **WAITING, "SLURM_NTASKS": str(tasks)},
    )  # fmt: skip
    called = folder / "called"
    return done, called.read_text().splitlines() if called.exists() else []


def test_there_is_one_script_that_bash_accepts(tmp_path):
    assert len(SCRIPTS) == 1
    (tmp_path / "job.sh").write_text(SCRIPTS[0])
    done = subprocess.run(["bash", "-n", str(tmp_path / "job.sh")], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""


def test_it_starts_a_rank_for_each_task_with_the_threads_that_it_asks_for(tmp_path):
    done, (launcher, *words) = started(tmp_path, RECORD)
    assert done.returncode == 0, done.stderr
    assert (launcher, words[:2]) == ("mpiexec", ["-n", "16"])
    program = words[2:]
    assert program[:2] == ["flocking", "run"]
    given = dict(zip(program[3::2], program[4::2], strict=True))
    assert given == {"--engine": "lammps", "--threads": asked()["cpus-per-task"], "--out": "out/run"}


def test_the_page_says_the_nodes_and_processors_that_the_script_asks_for():
    numbers = {"four": 4, "twelve": 12}
    found = re.search(r"with (\w+) nodes of (\d+) processors and a rank for every (\w+):", PAGE)
    nodes, processors, each = numbers[found[1]], int(found[2]), numbers[found[3]]
    assert (int(asked()["nodes"]), int(asked()["cpus-per-task"])) == (nodes, each)
    assert int(asked()["ntasks-per-node"]) * each == processors


@pytest.mark.mpi
def test_what_it_starts_runs(tmp_path):
    law = fk.Law(fk.Proximity(8.4), [fk.Gradient(fk.Potential("(r - 7)**2"))])
    start = fk.start.hexagonal(7, spacing=6.5, rng=1)
    fk.write_scenario(fk.Scenario(law, start, t_end=0.1, frames=2), tmp_path / "flock.toml")
    program = Path(sys.executable).with_name("flocking")
    done, words = started(tmp_path, RECORD + ONE_RANK, program)
    assert done.returncode == 0, done.stderr[-3000:]
    assert words[0] == "mpiexec"
    run = fk.read_run(tmp_path / "out" / "run")
    assert run.finished
    assert run.provenance["threads"] == 12
    assert np.abs(run.q[-1] - run.q[0]).max() > 0
