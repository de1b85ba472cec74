"""Cost of the exact engine: against the same integrator without guards, and against one SciPy event per pair.

    python benchmarks/exact.py [--json FILE] [--repeats 5] [--event-horizon 0.1] [--side 28]

All contenders run in this one process, one after the other, with the same compiled right-hand side, the same
tolerances and the same start: the law of Tanner II on N = 200 agents for 5 s of simulated time.
"""

from __future__ import annotations

import argparse
import json
import platform
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite
import numpy as np
import scipy
from scipy.integrate import DOP853, solve_ivp

import flocking as fk
from flocking.engine.adaptive_steps.stepper import RELATIVE
from flocking.engine.exact.session import ExactSession
from flocking.engine.kernels.law_kernels import Pairs, stages
from flocking.engine.kernels.pieces import free_pieces
from flocking.formula.native.functions import native

AGENTS, RADIUS, HORIZON, SEED = 200, 4.0, 5.0, 1
FIRST_STAGE = (np.zeros(1), np.zeros((1, 1)))
"""Nodes and weights of a Runge-Kutta method of one stage: its slope is the right-hand side."""


def tanner(side: float, t_end: float = HORIZON) -> fk.Scenario:
    psi = fk.Potential("1/r**2 + log(r**2)")
    law = fk.Law(fk.Proximity(RADIUS), [fk.Gradient(psi), fk.Consensus(1.0)])
    start = fk.start.box(AGENTS, side=side, speed=1.0, seed=SEED)
    return fk.Scenario(law, start, t_end=t_end, frames=2, energy=fk.Energy(unlinked=float(psi(RADIUS))))


def zhou() -> fk.Scenario:
    psi = fk.Potential("1/r + 1/(R - r)", R=RADIUS)
    leader = fk.Velocity([1.0, 0.5])
    law = fk.Law(
        fk.Hysteresis(radius=RADIUS, gap=0.1),
        [fk.Gradient(psi), fk.Consensus(1.0), fk.Track(leader, velocity_gain=1.0)],
    )
    start = fk.start.box(10, side=8, speed=4, seed=SEED, connected_under=law.graph)
    return fk.Scenario(law, start, t_end=30.0)


@native
def neighbour_pairs(q: Any, radius: float, senders: Any, sensed: Any) -> int:
    """Ordered pairs closer than the radius, found anew at every call: what a right-hand side without guards must do.

    Pairs (i, j) with i < j come before those of the other half, as the right-hand side takes them.
    """
    n, m = q.shape[0], q.shape[1]
    count = 0
    for i in range(n):
        for j in range(i + 1, n):
            d2 = 0.0
            for k in range(m):
                d2 += (q[j, k] - q[i, k]) ** 2
            if d2 < radius * radius:
                senders[count], sensed[count] = i, j
                count += 1
    for e in range(count):
        senders[count + e], sensed[count + e] = sensed[e], senders[e]
    return 2 * count


class Plain:
    """The engine's own right-hand side and tolerances, with the neighbours looked up inside."""

    def __init__(self, scenario: fk.Scenario) -> None:
        session = fk.start(scenario)
        assert isinstance(session, ExactSession)
        self.y, self.tolerance = session._stepper.memory.y, session._stepper.tolerance
        self.n, self.m = scenario.start.q.shape
        self.law = session._dynamics._in_force()
        most = self.n * (self.n - 1)
        self._senders, self._sensed = np.empty(most, np.int64), np.empty(most, np.int64)
        self._pieces, self._spans = free_pieces(most)

    def __call__(self, t: float, y: Any) -> Any:
        q = y[: self.n * self.m].reshape(self.n, self.m)
        count = neighbour_pairs(q, RADIUS, self._senders, self._sensed)
        offsets = np.array([0, count])
        pairs = Pairs(self._senders[:count], self._sensed[:count], offsets, self._pieces[:count], self._spans)
        slope = np.zeros((1, y.size))
        stages(self.law._replace(pairs=pairs), *FIRST_STAGE, 0, 1, -1, t, y, 0.0, slope, np.empty(y.size))
        return slope[0]

    def without_guards(self, t_end: float) -> int:
        solver = DOP853(self, 0.0, self.y, t_end, rtol=RELATIVE, atol=self.tolerance)
        steps = 0
        while solver.status == "running":
            solver.step()
            steps += 1
        return steps

    def event_per_pair(self, t_end: float) -> tuple[int, int]:
        def event(i: int, j: int) -> Callable[[float, Any], float]:
            return lambda t, y: (y[2 * i] - y[2 * j]) ** 2 + (y[2 * i + 1] - y[2 * j + 1]) ** 2 - RADIUS**2

        events = [event(i, j) for i in range(self.n) for j in range(i + 1, self.n)]
        found = solve_ivp(
            self, (0.0, t_end), self.y, method="DOP853", rtol=RELATIVE, atol=self.tolerance, events=events
        )
        return len(found.t) - 1, sum(len(t) for t in found.t_events)


def clock(work: Callable[[], Any]) -> tuple[float, Any]:
    begin = time.perf_counter()
    result = work()
    return time.perf_counter() - begin, result


def measure(repeats: int, event_horizon: float, side: float) -> dict[str, Any]:
    scenario = tanner(side)
    short = scenario.with_(t_end=event_horizon)
    plain = Plain(scenario)
    fk.simulate(short, progress=False)
    plain.without_guards(event_horizon)
    engine, bare = [], []
    for _ in range(repeats):
        seconds, run = clock(lambda: fk.simulate(scenario, progress=False))
        engine.append(seconds)
        seconds, bare_steps = clock(lambda: plain.without_guards(HORIZON))
        bare.append(seconds)
    engine_short = [clock(lambda: fk.simulate(short, progress=False))[0] for _ in range(repeats)]
    short_run = fk.simulate(short, progress=False)
    event_seconds, (event_steps, event_count) = clock(lambda: plain.event_per_pair(event_horizon))
    small = zhou()
    fk.simulate(small, progress=False)
    ten = [clock(lambda: fk.simulate(small, progress=False))[0] for _ in range(max(repeats, 5))]
    links = run.links.sum(axis=(1, 2)) / AGENTS
    median = statistics.median
    return {
        "law": "Tanner II: gradient of 1/r^2 + log r^2 and consensus, Proximity graph",
        "agents": AGENTS, "radius": RADIUS, "side": side, "agents_per_area": AGENTS / side**2,
        "neighbours_first_last": [float(links[0]), float(links[-1])], "horizon": HORIZON, "repeats": repeats,
        "engine_seconds": median(engine), "engine_range": [min(engine), max(engine)],
        "engine_steps": run.provenance["steps"], "switches": len(run.switches),
        "bare_seconds": median(bare), "bare_range": [min(bare), max(bare)], "bare_steps": bare_steps,
        "ratio_to_bare": median(a / b for a, b in zip(engine, bare, strict=True)),
        "event_horizon": event_horizon, "event_seconds": event_seconds, "event_steps": event_steps,
        "event_switches": event_count, "engine_short_seconds": median(engine_short),
        "engine_short_switches": len(short_run.switches), "ratio_to_events": event_seconds / median(engine_short),
        "zhou_milliseconds": 1e3 * median(ten),
        "machine": {
            "processor": platform.machine(), "python": platform.python_version(), "numpy": np.__version__,
            "scipy": scipy.__version__, "llvmlite": llvmlite.__version__,
        },
    }  # fmt: skip


def table(x: dict[str, Any]) -> str:
    first, last = x["neighbours_first_last"]
    lines = [
        f"{x['law']}",
        f"N = {x['agents']}, R = {x['radius']:g}, box {x['side']:g} x {x['side']:g} ({x['agents_per_area']:.3f} agents "
        f"per unit area, {first:.1f} neighbours at the start, {last:.1f} at the end), {x['horizon']:g} s, "
        f"median of {x['repeats']}",
        "",
        f"{'contender':<46}{'seconds':>9}{'steps':>8}{'switches':>10}{'engine is':>20}",
        f"{'exact engine, every switch located':<46}{x['engine_seconds']:>9.3f}"
        f"{x['engine_steps']:>8}{x['switches']:>10}",
        f"{'same DOP853, same right-hand side, no guards':<46}{x['bare_seconds']:>9.3f}{x['bare_steps']:>8}{'-':>10}"
        f"{x['ratio_to_bare']:>9.2f} x its cost",
        f"over {x['event_horizon']:g} s only:",
        f"{'exact engine':<46}{x['engine_short_seconds']:>9.3f}{'':>8}{x['engine_short_switches']:>10}",
        f"{'solve_ivp, one event function a pair':<46}{x['event_seconds']:>9.3f}{x['event_steps']:>8}"
        f"{x['event_switches']:>10}{x['ratio_to_events']:>9.0f} x faster",
        "",
        f"Zhou, 10 agents, 30 s: {x['zhou_milliseconds']:.1f} ms",
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the figures to this file as well")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--event-horizon", type=float, default=0.1, help="simulated seconds for one event a pair")
    parser.add_argument("--side", type=float, default=28.0, help="side of the box the agents start in")
    arguments = parser.parse_args()
    figures = measure(arguments.repeats, arguments.event_horizon, arguments.side)
    print(table(figures))
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    main()
