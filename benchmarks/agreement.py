"""Three engines, the same laws: how far their forces and motions agree. Writes the table shown in the docs.

    python -m benchmarks.agreement --out docs/engine_agreement.md

Forces are held against the reference on NumPy arrays, relative to the sum of the absolute pair forces on the agent.
Motions are compared after 0.2 units of time with a step of 0.005: the two engines with that step with each other, and
each with the exact engine at half the step too, which shows their order.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from tests.mpi.laws import NAMES, law, start

import flocking as fk
from flocking.engine.lammps.session import LammpsOptions, LammpsSession
from flocking.engine.tiles.session import TilesOptions, TilesSession

AGENTS, UNTIL, STEP = 64, 0.2, 0.005
HEAD = (
    "law", "space", "forces: tiles", "forces: lammps", "tiles − lammps", "tiles − exact", "lammps − exact",
    "lammps − exact, half step",
)  # fmt: skip


def row(name: str, dimension: int) -> tuple[str, ...]:
    state = start(dimension, AGENTS)
    found, agents = law(name, dimension, AGENTS)
    scenario = fk.Scenario(found, state, t_end=UNTIL, agents=agents, frames=2)
    reference = fk.evaluate(found, state, agents=agents)
    forces = reference.u - np.reshape(agents.damping, (-1, 1)) * state.p
    scale = (reference.pair_force_sum + np.linalg.norm(forces, axis=1))[:, None]
    tiles = TilesSession(scenario, TilesOptions(step=STEP, ledger=False))
    lammps = LammpsSession(scenario, LammpsOptions(step=STEP, ledger=0))
    masses = np.reshape(agents.masses, (-1, 1))
    gaps = [np.abs((tiles.forces() * masses - forces) / scale).max(), np.abs((lammps.forces() - forces) / scale).max()]
    for session in (tiles, lammps):
        session.advance(UNTIL)
    ends = [tiles.run().q[-1], lammps.run().q[-1]]
    lammps.close()
    exact = fk.simulate(scenario, engine="exact", progress=False).q[-1]
    half = fk.simulate(scenario, engine="lammps", step=STEP / 2, ledger=0, progress=False).q[-1]
    gaps += [np.abs(ends[0] - ends[1]).max(), *(np.abs(end - exact).max() for end in (*ends, half))]
    return (name, f"{dimension}-D", *(f"{gap:.1e}" for gap in gaps))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    rows = []
    for name in NAMES:
        for dimension in (2, 3):
            rows.append(row(name, dimension))
            print(*rows[-1], sep="  ", flush=True)
    text = ["# How far the engines agree", "", *__doc__.splitlines()[4:], "", "| " + " | ".join(HEAD) + " |"]
    text += ["|" + "---|" * len(HEAD), *("| " + " | ".join(cells) + " |" for cells in rows)]
    text += ["", "The (36) row goes through a table where the force is no gradient; its error bound is in the deck."]
    asked.out.write_text("\n".join(text) + "\n")


if __name__ == "__main__":
    main()
