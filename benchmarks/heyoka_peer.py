"""The exact engine beside heyoka (Taylor integration in LLVM), which detects events of pairs and does not switch.

    python benchmarks/heyoka_peer.py [--agents 10 20] [--tolerances 1e-9 1e-12] [--json FILE]

Gradient and consensus over 40 s. heyoka computes all pairs and watches every pair for a distance. The exact engine does
the same (``all pairs``), or lets links switch at this distance (``switching``), which heyoka cannot do. Times are
processor times of a run, compilation apart, medians of runs in turn. Event times of ``all pairs`` are compared with
heyoka's; what they may differ by is the error that the tolerance allows. heyoka is no part of this library: ``pip
install heyoka``.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import flocking as fk

RADIUS, GAIN, DURATION, SEED, REPEATS = 4.0, 0.3, 40.0, 1, 5

Event = tuple[float, int, int]


def start(n: int) -> fk.State:
    """Some agents in a square, on average two links apart."""
    return fk.start.box(n, side=2.2 * n**0.5, speed=1.0, seed=SEED)


def scenario(n: int, tolerance: float, *, switching: bool) -> fk.Scenario:
    """The law in this library; without ``switching`` the distance is watched by a term that does nothing."""
    psi = fk.Potential("(r - 1)**2/2*exp(-r)")
    near = fk.Proximity(RADIUS)
    law = (
        fk.Law(fk.Hysteresis(RADIUS, 0.1), [fk.Gradient(psi), fk.Consensus(GAIN)])
        if switching
        else fk.Law(fk.Complete(), [fk.Gradient(psi), fk.Consensus(GAIN), fk.Consensus(0.0, over=near)])
    )
    energy = fk.Energy(unlinked=float(psi(RADIUS)) if switching else 0.0)
    return fk.Scenario(law, start(n), t_end=DURATION, frames=2, tolerance=tolerance, energy=energy)


def taylor(n: int, tolerance: float) -> Callable[[], list[Event]]:
    """The same motion in heyoka: a function that runs it and returns the events."""
    try:
        import heyoka as hy
    except ImportError:
        raise SystemExit("This measures beside heyoka, which is not here: pip install heyoka") from None

    agents = [hy.make_vars(*(f"{name}{i}" for name in ("x", "y", "u", "v"))) for i in range(n)]
    forces: list[tuple[list[Any], list[Any]]] = [([], []) for _ in range(n)]
    found: list[Event] = []
    events = []

    def noted(i: int, j: int) -> Callable[[Any, float, int], None]:
        return lambda _, t, __: found.append((t, i, j))

    for i in range(n):
        for j in range(i + 1, n):
            apart = [agents[j][k] - agents[i][k] for k in range(2)]
            moving = [agents[j][2 + k] - agents[i][2 + k] for k in range(2)]
            square = apart[0] * apart[0] + apart[1] * apart[1]
            r = hy.sqrt(square)
            slope = ((r - 1.0) - 0.5 * (r - 1.0) * (r - 1.0)) * hy.exp(-r) / r
            for k in range(2):
                force = slope * apart[k] + GAIN * moving[k]
                forces[i][k].append(force)
                forces[j][k].append(-force)
            events.append(hy.nt_event(square - RADIUS**2, noted(i, j)))
    equations = []
    for i, (x, y, u, v) in enumerate(agents):
        equations += [(x, u), (y, v), (u, hy.sum(forces[i][0])), (v, hy.sum(forces[i][1]))]
    first = np.hstack([start(n).q, start(n).p]).ravel()
    integrator = hy.taylor_adaptive(equations, first.tolist(), tol=tolerance, nt_events=events, compact_mode=n > 10)

    def run() -> list[Event]:
        found.clear()
        integrator.state[:], integrator.time = first, 0.0
        integrator.propagate_until(DURATION)
        return sorted(found)

    return run


def seconds(run: Callable[[], object]) -> float:
    """Processor time of a run."""
    begin = time.process_time()
    run()
    return time.process_time() - begin


def compared(n: int, tolerance: float) -> dict[str, Any]:
    """One row of the table."""
    theirs = taylor(n, tolerance)
    chosen = {name: scenario(n, tolerance, switching=name == "switching") for name in ("all pairs", "switching")}
    ours = {name: fk.simulate(x, progress=False) for name, x in chosen.items()}
    times: dict[str, list[float]] = {"heyoka": [], **{name: [] for name in chosen}}
    for _ in range(REPEATS):
        times["heyoka"].append(seconds(theirs))
        for name, x in chosen.items():
            times[name].append(seconds(lambda x=x: fk.simulate(x, progress=False)))  # type: ignore[misc]
    switches = ours["all pairs"].switches
    events = sorted((float(t), int(min(i, j)), int(max(i, j))) for t, i, j in switches[["time", "i", "j"]].tolist())
    known = theirs()
    alike = [pair[1:] for pair in events] == [pair[1:] for pair in known]
    apart = max((abs(a[0] - b[0]) for a, b in zip(events, known, strict=False)), default=0.0) if alike else float("nan")
    return {
        "agents": n, "tolerance": tolerance, "events": len(known), "same pairs": alike, "times apart": apart,
        "switches": len(ours["switching"].switches),
        **{name: statistics.median(x) for name, x in times.items()},
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--agents", type=int, nargs="+", default=[10, 20])
    parser.add_argument("--tolerances", type=float, nargs="+", default=[1e-9, 1e-12])
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    rows = [compared(n, tolerance) for n in given.agents for tolerance in given.tolerances]
    print("agents tolerance  heyoka ms  all pairs  over  switching  over  events  same pairs  times apart  switches")
    for row in rows:
        theirs = row["heyoka"]
        print(
            f"{row['agents']:6d} {row['tolerance']:9.0e} {1000 * theirs:10.2f}"
            f" {1000 * row['all pairs']:10.2f} {row['all pairs'] / theirs:5.1f}"
            f" {1000 * row['switching']:10.2f} {row['switching'] / theirs:5.1f}"
            f" {row['events']:7d} {row['same pairs']!s:>11} {row['times apart']:12.1e} {row['switches']:9d}"
        )
    if given.json:
        given.json.write_text(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
