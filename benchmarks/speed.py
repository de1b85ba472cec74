"""Speed of the tiled engine beside its peers, all in one run on the same states and threads.

    python benchmarks/speed.py [--json out.json] [--threads 2] [--quick] [--huge] [--peers PYTHON]

The law is Olfati-Saber (34) with a=1, b=5, c1=1, d=7, r=8.4 on a hexagonal start with noise 0.5 and velocities
N(0,1), dt 0.01, 300 steps of a settling flock, list rebuilds included. Peers (LAMMPS, JAX-MD) run in the
interpreter given by --peers; one that is not installed there is said to be missing, never replaced by a number.
Rates are million agent-steps per second; the median of the repeats counts, the best is printed beside it. The
table at the end sets every measured number beside the one asked for. ``--huge`` adds ten steps of 10^8 agents.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from roofs import roofline

HERE = Path(__file__).resolve().parent
RADIUS, SPACING, STEP = 8.4, 7.0, 0.01
FORMULA = "(a + b)/2*(sqrt(1 + (r - d + c)**2) - sqrt(1 + c**2)) + (a - b)/2*(r - d)"


def start_of(n):
    import flocking as fk

    return fk.start.hexagonal(n, spacing=SPACING, noise=0.5, speed=1.0, seed=0)


def saber():
    import flocking as fk

    psi = fk.Potential(FORMULA, a=1, b=5, c=4 / np.sqrt(20), d=SPACING)
    return fk.Law(fk.Proximity(RADIUS), [fk.Gradient(psi), fk.Consensus(1.0)])


def laws():
    """Tanner II, Zhou and Shi with starts that meet their hypotheses: law, hexagonal spacing, noise, speed, step."""
    import flocking as fk

    capped = fk.Potential("1/r**2 + log(r**2)")
    zhou = fk.Potential("1/r + 1/(R - r)", R=4.0)
    shi = fk.Potential(
        "where(r < k, a*log(r**2) + b/r**2, a*(1 + log(b/a)) + cos((1 + (r**2 - k**2)/(R**2 - k**2))*pi) + 1)",
        a=0.05, b=0.05, k=1.0, R=4.0,
    )  # fmt: skip
    # Zhou: shells of the lattice at 2.6, 4.5...: none near r = 4, all links below r - gap = 3.9.
    return {
        "tanner-2003-dynamic": (
            fk.Law(fk.Proximity(2.0), [fk.Gradient(capped), fk.Consensus(1.0)]), 1.5, 0.05, 0.3, 0.005,
        ),
        "zhou-2015": (fk.Law(fk.Hysteresis(4.0, 0.1), [fk.Gradient(zhou), fk.Consensus(1.0)]), 2.6, 0.05, 0.3, 0.005),
        "shi-2009": (fk.Law(fk.Proximity(4.0), [fk.Gradient(shi), fk.Consensus(1.0)]), 3.2, 0.1, 0.3, 0.01),
    }  # fmt: skip


def tiles_run(law, state, steps, threads, precision, *, step=STEP, ledger=False, repeats=3):
    """Rate (median and best), rebuilds and bytes per agent of a run, its first lists not counted."""
    import flocking as fk
    from flocking.engine.tiles.session import TilesOptions, TilesSession

    seconds = []
    for _ in range(repeats):
        scenario = fk.Scenario(law, state, t_end=steps * step, frames=1)
        options = TilesOptions(
            step=step, precision=precision, threads=threads, ledger=ledger, keep_frames=False
        )  # fmt: skip
        session = TilesSession(scenario, options)
        session._guarded(lambda s=session: s._particles.require_lists(step))
        begin = time.perf_counter()
        session.advance(steps * step)
        seconds.append((time.perf_counter() - begin) / steps)
    n = state.n
    return {
        "M/s": n / statistics.median(seconds) / 1e6, "best": n / min(seconds) / 1e6, "steps": steps,
        "rebuilds": session.rebuilds, "bytes": session.memory_in_use / n,
    }  # fmt: skip


def told(found):
    """One run in words."""
    return (
        f"{found['M/s']:.1f} M/s (best {found['best']:.1f}), {found['rebuilds']} rebuilds in {found['steps']} steps, "
        f"{found['bytes']:.0f} bytes an agent"
    )


def scipy_run(state, steps):
    """Seconds per step of a NumPy step with a k-d tree."""
    from scipy.spatial import cKDTree

    a, b = 1.0, 5.0
    c = abs(a - b) / np.sqrt(4 * a * b)
    q, p = state.q.copy(), state.p.copy()
    begin = time.perf_counter()
    for _ in range(steps):
        i, j = cKDTree(q).query_pairs(RADIUS, output_type="ndarray").T
        d = q[j] - q[i]
        r = np.sqrt((d**2).sum(axis=1))
        z = r - SPACING + c
        force = (((a + b) / 2 * z / np.sqrt(1 + z * z) + (a - b) / 2) / r)[:, None] * d + (p[j] - p[i])
        u = np.stack(
            [np.bincount(i, force[:, k], len(q)) - np.bincount(j, force[:, k], len(q)) for k in range(2)], axis=1
        )
        p += STEP * u
        q += STEP * p
    return (time.perf_counter() - begin) / steps


def peer(python, script, payload, arrays):
    """Run a peer's script; its JSON answer, or why there is none."""
    if python is None:
        return {"missing": "no interpreter given with --peers"}
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "state.npz"
        np.savez(data, **arrays)
        environment = {**os.environ, "OMP_NUM_THREADS": str(payload["threads"])}
        done = subprocess.run(
            [python, str(HERE / script), json.dumps(payload), str(data)],
            capture_output=True, text=True, cwd=folder, env=environment, timeout=3000, check=False,
        )  # fmt: skip
        lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
        return json.loads(lines[-1]) if lines else {"missing": (done.stderr or "no answer").strip().splitlines()[-1:]}


FIRST = """
import sys, time
begin = time.perf_counter()
sys.path.insert(0, {here!r})
import speed, flocking as fk
state = fk.start.hexagonal(1000, spacing=7.0, noise=0.5, speed=1.0, seed=0)
session = fk.start(fk.Scenario(speed.saber(), state, t_end=1.0, frames=1), engine="tiles", step=0.01, ledger={ledger})
session.advance(0.01)
print(time.perf_counter() - begin, "sympy" in sys.modules)
"""


def first_step():
    """Seconds of a fresh process from import to its first step, with a cold and a warm cache."""
    import shutil

    import flocking

    found = {}
    with tempfile.TemporaryDirectory() as folder:
        # A copy of the package has no compiled code beside it.
        shutil.copytree(
            Path(flocking.__file__).parent, Path(folder) / "flocking", ignore=shutil.ignore_patterns("__pycache__")
        )
        environment = {**os.environ, "FLOCKING_CACHE": folder + "/cache", "PYTHONPATH": folder}
        for name in ("cold", "warm", "warm again"):
            done = subprocess.run(
                [sys.executable, "-c", FIRST.format(here=str(HERE), ledger=True)],
                capture_output=True, text=True, env=environment, check=True,
            )  # fmt: skip
            seconds, sympy = done.stdout.split()
            found[name] = {"seconds": float(seconds), "sympy imported": sympy == "True"}
    return found


def report(title, value):
    """Print one line."""
    print(f"{title:<58} {value}", flush=True)


class Table:
    """Measured numbers beside those asked for."""

    def __init__(self):
        self.rows = []

    def add(self, name, value, asked, *, most=False, unit=""):
        """A number and what it should be at least (or at ``most``); a missing peer says why in place of a number."""
        missing = isinstance(value, str)
        reached = "missing" if missing else "yes" if (value <= asked if most else value >= asked) else "NO"
        self.rows.append(
            {"what": name, "measured": value, "asked": asked, "most": most, "reached": reached, "unit": unit}
        )

    def show(self):
        """Print all rows."""
        print(f"\n{'':<58} {'measured':>12} {'asked':>12}  reached")
        for row in self.rows:
            value = row["measured"] if isinstance(row["measured"], str) else f"{row['measured']:.3g}{row['unit']}"
            asked = f"{'<=' if row['most'] else '>='} {row['asked']:g}{row['unit']}"
            print(f"{row['what']:<58} {value:>12} {asked:>12}  {row['reached']}")


def against(table, name, mine, found, asked):
    """A row on how many times a peer's rate ours is."""
    if "M/s" in found:
        report(f"{name} (skin {found['skin']}, {found['steps']} steps)", f"{found['M/s']:.2f} M/s")
    table.add(f"over {name}", mine["M/s"] / found["M/s"] if "M/s" in found else "missing", asked)
    if "M/s" not in found:
        report(name, f"missing: {found['missing']}")


def start_rows(table, results):
    """Fresh processes with cold and warm caches."""
    results["first step"] = first_step()
    for name, value in results["first step"].items():
        report(
            f"fresh process to first step, {name} cache", f"{value['seconds']:.1f} s, SymPy {value['sympy imported']}"
        )
    table.add(
        "cold cache: fresh process to first step", results["first step"]["cold"]["seconds"], 8, most=True, unit=" s"
    )
    warm = min(results["first step"][name]["seconds"] for name in ("warm", "warm again"))
    table.add("warm cache: fresh process to first step", warm, 3, most=True, unit=" s")
    table.add("warm cache: SymPy imported", float(results["first step"]["warm again"]["sympy imported"]), 0, most=True)


def settling_rows(table, results, o, steps):
    """The settling flock beside LAMMPS, JAX-MD and a k-d tree."""
    for n in (10**5, 10**6):
        state = start_of(n)
        count = steps if n == 10**5 else min(steps, 100)
        mine = {p: tiles_run(saber(), state, count, o.threads, p) for p in ("float64", "float32")}
        for precision, found in mine.items():
            results[f"tiles {n:.0e} {precision}"] = found
            report(f"tiles, {n:.0e} agents, {precision}", told(found))
        payload = {"threads": o.threads, "steps": count, "law": "saber", "step": STEP}
        arrays = {"q": state.q, "p": state.p}
        found = results[f"lammps {n:.0e}"] = peer(o.peers, "lammps_peer.py", payload, arrays)
        against(table, f"LAMMPS, {n:.0e}, float64", mine["float64"], found, 8)
        if n == 10**5:
            found = results["jax-md"] = peer(o.peers, "jax_md_peer.py", payload, arrays)
            against(table, "JAX-MD, 1e+05, float32", mine["float32"], found, 60)
            rate = results["scipy"] = n / scipy_run(state, 5) / 1e6
            report("NumPy + cKDTree, 1e+05", f"{rate:.2f} M/s")
            table.add("over NumPy + cKDTree, 1e+05, float64", mine["float64"]["M/s"] / rate, 40)
    table.add("bytes an agent, 1e+06, float32, plane", mine["float32"]["bytes"], 200, most=True)


def law_rows(table, results, o, steps):
    """The laws of Tanner, Zhou and Shi."""
    import flocking as fk

    for name, (law, spacing, noise, speed, step) in laws().items():
        state = fk.start.hexagonal(10**6, spacing=spacing, noise=noise, speed=speed, seed=0)
        count = max(15, steps // 10)
        mine = results[name] = tiles_run(law, state, count, o.threads, "float64", step=step)
        report(f"{name}, 1e+06, float64", told(mine))
        payload = {"threads": o.threads, "steps": count, "law": name, "step": step}
        found = results[f"lammps {name}"] = peer(o.peers, "lammps_peer.py", payload, {"q": state.q, "p": state.p})
        against(table, f"LAMMPS, {name}, 1e+06", mine, found, 6)


def scaling_rows(table, results, o):
    """What an agent costs in a large crowd over what it costs in a small one."""
    large = tiles_run(saber(), start_of(int(o.largest)), 30, o.threads, "float64", repeats=2)
    small = tiles_run(saber(), start_of(10**5), 30, o.threads, "float64", repeats=5)
    results["scaling"] = {"agents": o.largest, "large": large, "small": small}
    report(f"tiles, {o.largest:.0e} agents, float64", told(large))
    table.add(f"time per agent-step, {o.largest:.0e} over 1e+05", small["M/s"] / large["M/s"], 1.5, most=True)


def huge_rows(table, results, o):
    """Ten steps of 10^8 agents in a process that may not take more than 24 GiB."""
    command = [sys.executable, str(HERE / "hundred_million.py"), "--threads", str(o.threads)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    found = results["1e8"] = json.loads(lines[-1]) if lines else {"missing": done.stderr.strip().splitlines()[-1:]}
    report("1e+08 agents, 10 steps, float32", found)
    table.add("1e+08 agents, 10 steps: peak memory", found.get("peak GiB", "missing"), 24, most=True, unit=" GiB")
    table.add("1e+08 agents: bytes an agent", found.get("bytes", "missing"), 200, most=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="a third of the steps, no run above 10^6 agents")
    parser.add_argument("--huge", action="store_true", help="ten steps of 10^8 agents: takes 16 GiB")
    parser.add_argument("--peers", default=os.environ.get("FLOCKING_PEERS"))
    parser.add_argument("--largest", type=float, default=1e7)
    parser.add_argument("--only", default="", help="some of: first settling roof laws space scaling")
    o = parser.parse_args()
    steps = 100 if o.quick else 300
    table, results = Table(), {"machine": platform.processor() or platform.machine(), "threads": o.threads}
    report("load of the machine before the run", [round(x, 2) for x in os.getloadavg()])
    results["load"] = os.getloadavg()
    wanted = o.only.split() or ["first", "settling", "roof", "laws", "space", *([] if o.quick else ["scaling"])]
    if "first" in wanted:
        start_rows(table, results)
    if "settling" in wanted:
        settling_rows(table, results, o, steps)
    if "roof" in wanted:
        results["roofline"] = roofline(saber(), start_of, o.threads, 10**6, STEP)
        report("roofs, 1e+06, float64", {k: round(v, 4) for k, v in results["roofline"].items()})
        table.add("share of the slower roof, 1e+06, float64", results["roofline"]["share"], 0.7)
    if "laws" in wanted:
        law_rows(table, results, o, steps)
    if "space" in wanted:
        results["space"] = in_space(o.threads, 10**6)
        report("3-D, density 1, radius 2, 1e+06, float32", told(results["space"]))
        report("  published: FLAME GPU 2 on an H100", "470 M/s")
    if "scaling" in wanted:
        scaling_rows(table, results, o)
    if o.huge:
        huge_rows(table, results, o)
    report("load of the machine after the run", [round(x, 2) for x in os.getloadavg()])
    table.show()
    if o.json:
        results["table"] = table.rows
        Path(o.json).write_text(json.dumps(results, indent=1, default=str))


def in_space(threads, n):
    """Consensus and repulsion among about 33 neighbours in space."""
    import flocking as fk

    side = n ** (1 / 3)
    state = fk.start.box(n, side=[side] * 3, speed=0.5, seed=0, dimension=3)
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("-k*r**2", k=0.05)), fk.Consensus(0.1)])
    return tiles_run(law, state, 20, threads, "float32")


if __name__ == "__main__":
    main()
