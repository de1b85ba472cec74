"""Digests of runs: two versions of the library that print the same lines compute the same bits on this machine.

    python benchmarks/run_digests.py > before.txt     (in one tree, then in the other)
    diff before.txt after.txt

The engines for small groups (exact, sampled, delayed, discrete) run the first tenth of every scenario of the papers
that is theirs, the tiled engine three laws with every integrator, with and without a ledger, on one thread.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

import flocking as fk
from flocking.papers import ALL_KEYS, paper

SHARE, FRAMES = 0.1, 20
SIDE, AGENTS, UNTIL, STEP = 20.0, 500, 2.0, 0.01
SPRING = fk.Potential("0.5*(r - 1)**2")
LAWS = {
    "proximity": fk.Law(fk.Proximity(1.2), [fk.Gradient(SPRING), fk.Consensus(0.5)]),
    "hysteresis": fk.Law(fk.Hysteresis(1.3, 0.1), [fk.Gradient(SPRING), fk.Consensus(0.5)]),
    "obstacle": fk.Law(
        fk.Smooth(1.2, 0.5), [fk.Gradient(SPRING), fk.Avoid([fk.Ball([3.0, 3.0], 1.0)], range=1.2, gamma_agents=False)]
    ),
}


def digest(array: NDArray[np.generic]) -> str:
    """The first ten digits of the SHA-256 of an array's bytes."""
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()[:10]


def line(name: str, run: fk.Run) -> str:
    """Digests of everything that was recorded of a run, and its closest pairs."""
    arrays = [run.t, run.q, run.p, run.links, run.switches, run.trace]
    if run.accuracy is not None:
        arrays += [run.accuracy.frames, run.accuracy.doubts]
    return f"{name} {run.fidelity.engine} {' '.join(map(digest, arrays))} {run.closest_linked} {run.closest_unlinked}"


def lines() -> Iterator[str]:
    """One line a run."""
    for key in ALL_KEYS:
        for name, make in paper(key).scenarios().items():
            scenario = make(1)
            begin = scenario.start.t
            short = scenario.with_(t_end=begin + SHARE * (scenario.t_end - begin), frames=FRAMES)
            yield line(name, fk.simulate(short, progress=False))
    start = fk.start.box(AGENTS, side=SIDE, speed=1.0, seed=3)
    for name, law in LAWS.items():
        scenario = fk.Scenario(law, start, t_end=UNTIL, frames=5)
        for scheme in ("verlet", "damped", "rk4"):
            for ledger in (True, False):
                run = fk.simulate(
                    scenario, engine="tiles", step=STEP, scheme=scheme, ledger=ledger, threads=1, progress=False
                )
                yield line(f"tiles {name} {scheme} {'with' if ledger else 'without'} ledger", run)


if __name__ == "__main__":
    for text in lines():
        print(text, flush=True)
