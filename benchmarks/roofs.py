"""How far the kernel is from what memory and arithmetic allow, both measured on the spot."""

from __future__ import annotations

import statistics
import time

import numpy as np

from flocking.formula.native.functions import native


def passes(law, state, threads, precision, step, repeats=15):
    """Seconds of one pass of the kernel on settled lists, without rebuilds: all repeats; and bytes of the lists."""
    import flocking as fk
    from flocking.engine.tiles.session import TilesOptions, TilesSession

    session = TilesSession(
        fk.Scenario(law, state, t_end=1.0, frames=1),
        TilesOptions(step=step, precision=precision, threads=threads, ledger=False),
    )
    particles = session._particles
    particles.require_lists(step)
    found = []
    for _ in range(repeats):
        begin = time.perf_counter()
        particles.move(0.0, keep=1.0, kick=step, drift=step)
        found.append(time.perf_counter() - begin)
    return found, float(particles.lists[0].count.sum()) * 16 * 4


@native
def add_scaled(first, last, a, b, c):
    for i in range(first, last):
        a[i] = b[i] + 3.0 * c[i]


def triad(threads, size=20_000_000):
    """Bytes per second of a = b + s c over the same threads, counting the read of a that a plain store makes."""
    from flocking.engine.fixed_step.threads import Workers

    workers = Workers(threads)
    a, b, c = np.zeros(size), np.ones(size), np.ones(size)
    workers.each(add_scaled, size, a, b, c)
    found = []
    for _ in range(9):
        begin = time.perf_counter()
        workers.each(add_scaled, size, a, b, c)
        found.append(time.perf_counter() - begin)
    return 4 * 8 * size / statistics.median(found)


def arithmetic_seconds(law, small, step, batches=200, again=50):
    """Seconds per agent of the kernel alone on a state that stays in the fastest cache, one thread, no Python between.

    The kernel runs over the same tiles again and again: only its own loads, formulas and stores are timed.
    """
    import flocking as fk
    from flocking.engine.tiles.session import TilesOptions, TilesSession

    session = TilesSession(
        fk.Scenario(law, small, t_end=1.0, frames=1),
        TilesOptions(step=step, precision="float64", threads=1, ledger=False),
    )
    particles = session._particles
    particles.require_lists(step)
    # A tile list of many visits to the same few tiles would need another kernel: many short calls, the best kept.
    found = []
    for _ in range(batches):
        begin = time.perf_counter()
        for _ in range(again):
            particles.move(0.0, keep=1.0, kick=step, drift=step)
        found.append((time.perf_counter() - begin) / again)
    return min(found)


def roofline(law, start_of, threads, n, step):
    """Share of the slower of two roofs that one pass over n agents in float64 reaches."""
    state = start_of(n)
    times, entries = passes(law, state, threads, "float64", step)
    # Positions and velocities in, the same out (with the read before the write), and the list once.
    moved = n * (32 + 2 * 32) + entries
    memory = moved / triad(threads)
    # Two sizes, so that what Python costs a call falls out of the difference.
    few, many = 128, 384
    each = (arithmetic_seconds(law, start_of(many), step) - arithmetic_seconds(law, start_of(few), step)) / (many - few)
    arithmetic = each * n / threads
    slower = max(memory, arithmetic)
    return {
        "agents": n, "seconds per pass, median": statistics.median(times), "seconds per pass, least": min(times),
        "memory roof": memory, "arithmetic roof": arithmetic, "share": slower / statistics.median(times),
        "best share": slower / min(times),
    }  # fmt: skip
