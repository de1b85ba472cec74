"""The obstacle scenario of Olfati-Saber with 100,000 agents on the ranks of an MPI job: run, audit, picture.

    mpiexec -n 2 python benchmarks/cluster_run.py --out out/cluster [--agents 100000] [--step 0.02] [--until 50]

Agents start as densely as in the paper, in a wide band before the six obstacles of its (59).
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

import flocking as fk
from flocking.papers.olfati_saber_2003 import system

AREA_EACH = 160.0 * 20.0 / 100.0
"""Area per agent at the paper's start."""
WIDTH = 1600.0
"""Of the band, across the direction of travel."""
LEDGER_EVERY = 25
LEDGER = 1e-3
"""Tolerance of the audit: its ledger may miss a hundred times this share of the energy moved."""


def scenario(agents: int, until: float) -> fk.Scenario:
    length = agents * AREA_EACH / WIDTH
    made = system.obstacle_scenario(seed=0, agents=agents, box=((60.0 - length, 20.0 - WIDTH / 2), (length, WIDTH)))
    return made.with_(t_end=until, frames=26, name="olfati-saber-2003-cluster", tolerance=LEDGER)


def picture(run: fk.Run, path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(15, 3.0), sharey=True, layout="constrained")
    for axis, frame in zip(axes, (0, len(run.t) // 2, len(run.t) - 1), strict=True):
        slip = np.linalg.norm(run.p[frame] - np.array(system.DESIRED_VELOCITY), axis=1)
        shown = axis.scatter(*run.q[frame].T, c=slip, s=0.6, vmin=0.0, vmax=4.0, linewidths=0, rasterized=True)
        for ball in system.obstacles():
            axis.add_patch(plt.Circle(ball.centre.point, ball.radius, color="0.6"))
        axis.set(xlim=(-150.0, 650.0), ylim=(-180.0, 220.0), aspect="equal", xlabel="x", title=f"t = {run.t[frame]:g}")
    axes[0].set_ylabel("y")
    figure.colorbar(shown, ax=axes, label="$|p_i - p_d|$", pad=0.01)
    figure.suptitle(f"{run.n:,} agents past the obstacles of (59), on {run.provenance['ranks']} MPI ranks")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130, bbox_inches="tight")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--agents", type=int, default=100_000)
    parser.add_argument("--step", type=float, default=0.02)
    parser.add_argument("--until", type=float, default=50.0)
    asked = parser.parse_args()
    begin = time.perf_counter()
    made = scenario(asked.agents, asked.until)
    run = fk.simulate(made, engine="lammps", step=asked.step, ledger=LEDGER_EVERY, save=asked.out / "run")
    if run.provenance["rank"]:
        return
    seconds = time.perf_counter() - begin
    kept = fk.read_run(asked.out / "run")
    picture(kept, asked.out / "cluster_obstacles.png")
    found = {
        "agents": run.n, "steps": run.provenance["steps"], "ranks": run.provenance["ranks"], "seconds": seconds,
        "residual": float(np.abs(run.residual).max()), "turnover": run.turnover, "audit": fk.audit(kept).as_dict(),
    }  # fmt: skip
    (asked.out / "report.json").write_text(json.dumps(found, indent=2, default=str))
    print(json.dumps({k: v for k, v in found.items() if k != "audit"}))


if __name__ == "__main__":
    main()
