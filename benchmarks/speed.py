"""Speed of the tiled engine beside its peers, all in one run on the same states and threads.

    python benchmarks/speed.py [--json out.json] [--threads 2] [--quick] [--peers PYTHON]

The law is Olfati-Saber (34) with a=1, b=5, c1=1, d=7, r=8.4 on a hexagonal start with noise 0.5 and velocities
N(0,1), dt 0.01, 300 steps of a settling flock, list rebuilds included. Peers (LAMMPS, JAX-MD) run in the
interpreter given by --peers; one that is not installed there is said to be missing, never replaced by a number.
Times are medians over repeats; rates are million agent-steps per second.
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
    """Seconds per step, rebuilds, bytes per agent."""
    import flocking as fk
    from flocking.engine.tiles.session import TilesOptions, TilesSession

    seconds, session = [], None
    for _ in range(repeats):
        scenario = fk.Scenario(law, state, t_end=steps * step, frames=1)
        session = TilesSession(scenario, TilesOptions(step=step, precision=precision, threads=threads, ledger=ledger))
        warm = session.snapshot() if session.scenario.start.n <= 1000 else None
        del warm
        session._guarded(lambda s=session: s._crowd.require_lists(step))
        begin = time.perf_counter()
        session.advance(steps * step)
        seconds.append((time.perf_counter() - begin) / steps)
    return statistics.median(seconds), session.rebuilds, session.memory_in_use / state.n


def passes(law, state, threads, precision, repeats=15):
    """Seconds of one pass of the kernel on settled lists, without rebuilds: median and best."""
    import flocking as fk
    from flocking.engine.tiles.session import TilesOptions, TilesSession

    session = TilesSession(
        fk.Scenario(law, state, t_end=1.0, frames=1),
        TilesOptions(step=STEP, precision=precision, threads=threads, ledger=False),
    )
    crowd = session._crowd
    crowd.require_lists(STEP)
    found = []
    for _ in range(repeats):
        begin = time.perf_counter()
        crowd.move(0.0, keep=1.0, kick=STEP, drift=STEP)
        found.append(time.perf_counter() - begin)
    entries = float(crowd.lists[0].count.sum()) * 16 * 4
    return statistics.median(found), min(found), entries


def triad(threads, size=20_000_000):
    """Bytes per second of a = b + s c over the same threads, counting the read of a that a plain store makes."""
    import numba

    from flocking.engine.tiles.threads import Workers

    @numba.njit(nogil=True)
    def kernel(first, last, a, b, c):
        for i in range(first, last):
            a[i] = b[i] + 3.0 * c[i]

    workers = Workers(threads)
    a, b, c = np.zeros(size), np.ones(size), np.ones(size)
    workers.each(kernel, size, a, b, c)
    found = []
    for _ in range(7):
        begin = time.perf_counter()
        workers.each(kernel, size, a, b, c)
        found.append(time.perf_counter() - begin)
    return 4 * 8 * size / statistics.median(found)


def roofline(threads, n):
    """Share of the slower of two roofs that one pass over n agents in float64 reaches."""
    law = saber()
    median, _, entries = passes(law, start_of(n), threads, "float64")
    size = start_of(n).n
    # Positions and velocities in, the same out (with the read before the write), and the list once.
    moved = size * (32 + 2 * 32) + entries
    memory = moved / triad(threads)
    small = 256
    inner = []
    for _ in range(3):
        quick, _, _ = passes(law, start_of(small), 1, "float64", repeats=300)
        inner.append(quick / small)
    arithmetic = statistics.median(inner) * size / threads
    return {
        "agents": size, "seconds per pass": median, "memory roof": memory, "arithmetic roof": arithmetic,
        "share": max(memory, arithmetic) / median,
    }  # fmt: skip


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
    """Print one line of the table."""
    print(f"{title:<58} {value}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="a tenth of the steps, no run above 10^6 agents")
    parser.add_argument("--peers", default=os.environ.get("FLOCKING_PEERS"))
    parser.add_argument("--largest", type=float, default=1e7)
    o = parser.parse_args()
    steps = 30 if o.quick else 300
    results = {"machine": platform.processor() or platform.machine(), "threads": o.threads, "steps": steps}
    report("load of the machine before the run", [round(x, 2) for x in os.getloadavg()])
    results["load"] = os.getloadavg()
    results["first step"] = first_step()
    for name, value in results["first step"].items():
        report(
            f"fresh process to first step, {name} cache", f"{value['seconds']:.1f} s, SymPy {value['sympy imported']}"
        )
    rates = {}
    for n in (10**5, 10**6):
        state = start_of(n)
        for precision in ("float64", "float32"):
            repeats = 3 if n < 10**6 else 1
            seconds, rebuilds, memory = tiles_run(saber(), state, steps, o.threads, precision, repeats=repeats)
            rates[n, precision] = n / seconds / 1e6
            results[f"tiles {n:.0e} {precision}"] = {"M/s": n / seconds / 1e6, "rebuilds": rebuilds, "bytes": memory}
            text = f"{n / seconds / 1e6:.1f} M/s, {rebuilds} rebuilds, {memory:.0f} bytes an agent"
            report(f"tiles, {n:.0e} agents, {precision}", text)
        payload = {"threads": o.threads, "steps": min(steps, 100 if n > 10**5 else 300), "law": "saber", "step": STEP}
        payload |= {"precision": "float64", "radius": RADIUS}
        found = peer(o.peers, "lammps_peer.py", payload, {"q": state.q, "p": state.p})
        results[f"lammps {n:.0e}"] = found
        if "M/s" in found:
            report(f"LAMMPS, {n:.0e} (skin {found['skin']}, {found['threads']} threads)", f"{found['M/s']:.2f} M/s")
            report(f"  tiles over LAMMPS, {n:.0e}, float64", f"{rates[n, 'float64'] / found['M/s']:.1f} times")
        else:
            report(f"LAMMPS, {n:.0e}", f"missing: {found['missing']}")
        if n == 10**5:
            seconds = scipy_run(state, 5)
            results["scipy"] = n / seconds / 1e6
            report("NumPy + cKDTree, 1e5", f"{n / seconds / 1e6:.2f} M/s")
            report("  tiles over NumPy + cKDTree, float64", f"{rates[n, 'float64'] * seconds / n * 1e6:.0f} times")
            found = peer(o.peers, "jax_md_peer.py", {**payload, "steps": 20}, {"q": state.q, "p": state.p})
            results["jax-md"] = found
            if "M/s" in found:
                report("JAX-MD, 1e5, float32", f"{found['M/s']:.2f} M/s")
                report("  tiles over JAX-MD, float32", f"{rates[n, 'float32'] / found['M/s']:.0f} times")
            else:
                report("JAX-MD, 1e5", f"missing: {found['missing']}")
    results["roofline"] = roofline(o.threads, 10**6)
    report("share of the slower roof, 1e6 float64", {k: round(v, 4) for k, v in results["roofline"].items()})
    for name, (law, spacing, noise, speed, step) in laws().items():
        import flocking as fk

        state = fk.start.hexagonal(10**6, spacing=spacing, noise=noise, speed=speed, seed=0)
        seconds, rebuilds, _ = tiles_run(law, state, max(20, steps // 5), o.threads, "float64", step=step, repeats=1)
        results[name] = {"M/s": state.n / seconds / 1e6, "rebuilds": rebuilds}
        report(f"{name}, 1e6, float64", f"{state.n / seconds / 1e6:.1f} M/s, {rebuilds} rebuilds")
        payload = {"threads": o.threads, "steps": 30, "law": name, "step": step, "precision": "float64"}
        found = peer(o.peers, "lammps_peer.py", payload, {"q": state.q, "p": state.p})
        results[f"lammps {name}"] = found
        if "M/s" in found:
            report(f"  over LAMMPS ({found['M/s']:.2f} M/s)", f"{state.n / seconds / 1e6 / found['M/s']:.1f} times")
        else:
            report("  LAMMPS", f"missing: {found['missing']}")
    results["space"] = in_space(o.threads, 10**6)
    report("3-D, density 1, radius 2, 1e6, float32 (FLAME GPU 2, H100: 470 M/s published)", results["space"])
    if not o.quick:
        state = start_of(int(o.largest))
        seconds, rebuilds, memory = tiles_run(saber(), state, 30, o.threads, "float64", repeats=1)
        one, _, _ = tiles_run(saber(), start_of(10**5), 30, o.threads, "float64", repeats=3)
        results["scaling"] = {"agents": o.largest, "ratio": seconds / o.largest / (one / 1e5), "bytes": memory}
        report(f"time per agent-step at {o.largest:.0e} over 1e5 (30 steps)", f"{results['scaling']['ratio']:.2f}")
    report("load of the machine after the run", [round(x, 2) for x in os.getloadavg()])
    if o.json:
        Path(o.json).write_text(json.dumps(results, indent=1, default=str))


def in_space(threads, n):
    """Consensus and repulsion among about 33 neighbours in space."""
    import flocking as fk

    side = n ** (1 / 3)
    state = fk.start.box(n, side=[side] * 3, speed=0.5, seed=0, dimension=3)
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("-k*r**2", k=0.05)), fk.Consensus(0.1)])
    seconds, rebuilds, memory = tiles_run(law, state, 20, threads, "float32", repeats=1)
    return f"{n / seconds / 1e6:.1f} M/s, {rebuilds} rebuilds, {memory:.0f} bytes an agent"


if __name__ == "__main__":
    main()
