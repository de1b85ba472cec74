"""Whether the engines have become slower: ratios of processor times beside stored ones.

    python benchmarks/check.py [--store] [--rounds 15] [--file benchmarks/ratios.json]

Each row is the processor time of a piece of work of an engine over that of another piece of work, both in this process
on one thread, alternately; of each the least time of all rounds counts, so that other work on the machine matters
little. Times of different machines cannot be compared and ratios only roughly: they are stored by kind of processor,
and with none stored for this one the check says so (exit status 2). It fails (1) where a ratio is more than 15 % above
the stored one. ``--store`` stores the ratios of this machine; that is a decision, to be made with a reason, and never
part of a check.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from llvmlite import binding

import flocking as fk
from flocking.engine.tiles.options import TilesOptions
from flocking.engine.tiles.session import TilesSession

ALLOWED = 1.15
"""Ratio over the stored one above which the check fails."""

STORED = Path(__file__).resolve().parent / "ratios.json"

Work = Callable[[], object]


def numpy_work() -> None:
    """A fixed amount of arithmetic by NumPy, which no engine takes part in."""
    x = np.linspace(0.5, 1.5, 100_000)
    for _ in range(20):
        x = np.sqrt(x * x + 0.25) / (x + 0.1)


def tiles(law: fk.Law, start: fk.State, precision: str = "float32") -> TilesSession:
    """A session of the tiled engine with its first lists, on one thread."""
    options = TilesOptions(step=0.01, precision=precision, threads=1, ledger=False, keep_frames=False)
    session = TilesSession(fk.Scenario(law, start, t_end=1e6, frames=1), options)
    session.advance(0.01)
    return session


def steps(session: TilesSession, count: int) -> Work:
    """Further steps of a session, list rebuilds included."""
    return lambda: session.advance(session.time + 0.01 * count)


def neighbours(dimension: int, n: int) -> tuple[fk.Law, fk.State]:
    """Repulsion and consensus among about 33 neighbours, in the plane or in space."""
    # With a radius of 2 the density is 33 over the area or the volume within it.
    density = 33.5 / (4.0 * np.pi) if dimension == 2 else 1.0
    side = float((n / density) ** (1.0 / dimension))
    start = fk.start.box(n, side=[side] * dimension, speed=0.5, seed=0, dimension=dimension)
    return fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("-k*r**2", k=0.05)), fk.Consensus(0.1)]), start


def around_balls(n: int, *, avoided: bool) -> tuple[fk.Law, fk.State]:
    """A lattice with holes for twelve balls, and a law that avoids them or not."""
    start = fk.start.hexagonal(n, spacing=7.0, noise=0.5, speed=1.0, seed=0)
    rng = np.random.default_rng(0)
    low, high = start.q.min(axis=0), start.q.max(axis=0)
    balls = tuple(fk.Ball(x, 20.0) for x in low + (high - low) * rng.random((12, 2)))
    free = np.all([np.linalg.norm(start.q - b.centre.at(0.0)[0], axis=1) > 24.2 for b in balls], axis=0)
    psi = fk.Potential("0.1*(r - 7)**2")
    avoid = fk.Avoid(balls, fk.Velocity([1.0, 0.0]), range=4.2, attraction=psi)
    law = fk.Law(fk.Proximity(8.4), [fk.Gradient(psi), fk.Consensus(1.0), *([avoid] if avoided else [])])
    return law, fk.State(start.q[free], start.p[free])


def exact_run(n: int) -> Work:
    """A run of the exact engine with switches."""
    law = fk.Law(fk.Proximity(4.0), [fk.Gradient(fk.Potential("1/r**2 + log(r**2)")), fk.Consensus(1.0)])
    scenario = fk.Scenario(law, fk.start.box(n, side=2.0 * n**0.5, speed=1.0, seed=1), t_end=2.0, frames=2)
    return lambda: fk.simulate(scenario, engine="exact", progress=False)


def rows() -> Iterator[tuple[str, Work, Work]]:
    """Name of each ratio, what is measured, and what it is measured by."""
    plane, space = (tiles(*neighbours(m, 20_000)) for m in (2, 3))
    yield "tiles, a step in the plane over NumPy", steps(plane, 20), numpy_work
    yield "tiles, a step in space over one in the plane", steps(space, 20), steps(plane, 20)
    yield "tiles, lists in space over passes", lambda: space._particles.rebuild(0.01), lambda: passes(space, 10)
    with_, without = (tiles(*around_balls(20_000, avoided=x), "float64") for x in (True, False))
    yield "tiles, a step past 12 obstacles over one without", steps(with_, 40), steps(without, 40)
    yield "exact engine, a run of 20 agents over NumPy", exact_run(20), numpy_work
    yield "exact engine, a run of 100 agents over one of 20", exact_run(100), exact_run(20)


def passes(session: TilesSession, count: int) -> None:
    """Passes of the kernel whose results are not taken."""
    for _ in range(count):
        session._particles.move(0.0, keep=1.0, kick=0.01, drift=0.01)


def ratio(work: Work, by: Work, rounds: int) -> float:
    """Least processor time of one piece of work over that of another, taken alternately."""
    work(), by()
    least = [np.inf, np.inf]
    for _ in range(rounds):
        for k, each in enumerate((work, by)):
            begin = time.thread_time()
            each()
            least[k] = min(least[k], time.thread_time() - begin)
    return float(least[0] / least[1])


def check(measured: dict[str, float], stored: dict[str, float]) -> list[str]:
    """Print measured beside stored ratios; the names of those that are slower than allowed, or not stored."""
    slower = []
    for name, value in measured.items():
        known = stored.get(name)
        fine = known is not None and value <= ALLOWED * known
        said = "not stored" if known is None else f"{value / known:.2f} of {known:.3g}"
        print(f"{name:<52} {value:>9.3g}   {said:<18} {'' if fine else 'SLOWER' if known is not None else 'UNKNOWN'}")
        if not fine:
            slower.append(name)
    return slower


def main(arguments: list[str] | None = None, measure: Callable[[], Iterator[tuple[str, Work, Work]]] = rows) -> int:
    """The check; its exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", action="store_true", help="store the ratios of this machine in place of those known")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--file", type=Path, default=STORED)
    options = parser.parse_args(arguments)
    stored = json.loads(options.file.read_text()) if options.file.exists() else {}
    processor = binding.get_host_cpu_name()
    if not options.store and processor not in stored:
        print(f"No ratios are stored for the processor {processor}. Measure another version with --store first.")
        return 2
    measured = {name: ratio(work, by, options.rounds) for name, work, by in measure()}
    if options.store:
        stored[processor] = measured
        options.file.write_text(json.dumps(stored, indent=1, sort_keys=True) + "\n")
    slower = check(measured, stored[processor])
    if slower:
        print(f"Slower by more than {ALLOWED - 1:.0%}, or not stored: {'; '.join(slower)}")
    return 1 if slower else 0


if __name__ == "__main__":
    sys.exit(main())
