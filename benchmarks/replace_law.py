"""Processor time that replacing the law of a run by one of the same structure takes, as a slider of the lab does it.

    python benchmarks/replace_law.py [--agents 300] [--repeat 60] [--json FILE]

A parabola, whose stiffness changes at every call, and damping. Between two calls the run goes on for a hundredth of a
unit of time, which is not counted. Engines take turns.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from pathlib import Path

import flocking as fk
from flocking.engine.protocol.session import Session

SPACING = 7.0
"""Distance of neighbours that the parabola prefers."""

BETWEEN = 0.01
"""Time for which the run goes on between two calls."""


def law(stiffness: float) -> fk.Law:
    """Gradient of a parabola and damping."""
    parabola = fk.Potential("k*(r - d)**2/2", k=stiffness, d=SPACING)
    return fk.Law(fk.Proximity(1.2 * SPACING), (fk.Gradient(parabola), fk.Consensus(1.0)))


def sessions(agents: int) -> dict[str, Session]:
    """A run under way on each engine."""
    start = fk.start.hexagonal(agents, spacing=SPACING, noise=0.02, speed=0.5, seed=1)
    ideal = fk.Scenario(law(1.0), start, t_end=100.0)
    held = ideal.with_(control=fk.Held(0.02))
    heard = held.with_(information=fk.Messages(0.02, delay=0.01, seed=1))
    return {
        "exact": fk.start(ideal), "tiles": fk.start(ideal, engine="tiles", threads=1),
        "sampled, held control": fk.start(held), "sampled, messages": fk.start(heard),
    }  # fmt: skip


def main() -> None:
    """Measure, print, and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", type=int, default=300)
    parser.add_argument("--repeat", type=int, default=60)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    running = sessions(given.agents)
    found: dict[str, list[float]] = {name: [] for name in running}
    for k in range(given.repeat + 1):
        for name, session in running.items():
            session.advance(session.time + BETWEEN)
            other = law(1.0 + 0.01 * (k % 7 + 1))
            begin = time.process_time()
            session.replace(law=other)
            spent = time.process_time() - begin
            if k:  # the first call compiles what was not yet needed
                found[name].append(1e3 * spent)
    for name, times in found.items():
        low, middle, high = min(times), statistics.median(times), max(times)
        print(f"{name:24s} median {middle:.2f} ms, {low:.2f} to {high:.2f}")
    if given.json:
        given.json.write_text(json.dumps({"agents": given.agents, "ms": found}, indent=1))


if __name__ == "__main__":
    main()
