"""Three engines, the same laws: how far their forces and motions agree. Writes the table shown in the docs.

    mpiexec -n 2 python -m benchmarks.agreement --out docs/engine_agreement.md

Forces of all engines are held against the reference on NumPy arrays, relative to the sum of the absolute pair forces on
the agent and its whole force. Motions are compared after 0.2 units of time: those of a fixed step, 0.005, with each
other, each of them with the exact engine, and LAMMPS's pair styles at half the step too: where the gap halves the
scheme is of order 1, as it is with velocity terms. The kernels of the cluster engine and LAMMPS ran on two ranks.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from tests.mpi.laws import NAMES, RADIUS, law, start

import flocking as fk
from flocking.engine.exact.session import ExactSession
from flocking.engine.lammps.domains.options import DomainOptions
from flocking.engine.lammps.domains.session import DomainSession
from flocking.engine.lammps.library import communicator
from flocking.engine.lammps.session import LammpsOptions, LammpsSession
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.errors import UnsupportedLaw

AGENTS, UNTIL, STEP = 64, 0.2, 0.005
HEAD = (
    "law", "space", "forces: exact", "forces: tiles", "forces: kernels on ranks", "tiles − kernels on ranks",
    "forces: pair styles", "tiles − pair styles", "tiles − exact", "pair styles − exact", "the same, half step",
)  # fmt: skip
REFUSED = (
    "olfati-saber (35), damping weighted", "tanner I (5)", "zhou (8)", "shi (4), random weights", "cucker-smale",
)  # fmt: skip
"""Laws with a part that pair styles of LAMMPS cannot express; the table says so."""


def refused_law(name: str, dimension: int) -> fk.Law:
    """A law of `REFUSED`."""
    consensus = fk.Consensus(1.0)
    if name.startswith("tanner"):
        links = [(i, (i + k) % AGENTS) for i in range(AGENTS) for k in (1, 2, 8)]
        return fk.Law(fk.Fixed(AGENTS, links), [fk.Gradient(fk.Potential("s*s/r**2 + log(r**2)", s=5.0)), consensus])
    if name.startswith("cucker"):
        return fk.Law(fk.Complete(), [fk.CuckerSmale(1.0 / AGENTS, 0.4)])
    if name.startswith("zhou"):
        # Singular a little beyond the radius: at it, random pairs would have forces without bound.
        psi = fk.Potential("1/r + 1/(R - r)", R=13.0)
        return fk.Law(fk.Hysteresis(radius=12.0, gap=1.0), [fk.Gradient(psi), consensus])
    if name.startswith("shi"):
        made, _ = law("shi (4)", dimension, AGENTS)
        weights = fk.Consensus(0.7, weights=fk.HashedWeights(0.0, 1.0, 1))
        return fk.Law(made.graph, [weights if isinstance(t, fk.Consensus) else t for t in made.terms])
    made, _ = law("olfati-saber (35)", dimension, AGENTS)
    return fk.Law(fk.Smooth(RADIUS, 5 / 6), [made.terms[0], fk.Consensus(1.0, weighted=True)])


def row(name: str, dimension: int) -> tuple[str, ...]:
    state = start(dimension, AGENTS)
    if name in REFUSED:
        found, agents = refused_law(name, dimension), fk.Agents()
    else:
        found, agents = law(name, dimension, AGENTS)
    scenario = fk.Scenario(found, state, t_end=UNTIL, agents=agents, frames=2)
    reference = fk.evaluate(found, state, agents=agents)
    forces = reference.u - np.reshape(agents.damping, (-1, 1)) * state.p
    scale = (reference.pair_force_sum + np.linalg.norm(forces, axis=1))[:, None]
    masses = np.reshape(agents.masses, (-1, 1))

    def gap(accelerations: np.ndarray) -> float:
        return float(np.abs((accelerations * masses - forces) / scale).max())

    tiles = TilesSession(scenario, TilesOptions(step=STEP, ledger=False))
    gaps: list[float | str] = [gap(ExactSession(scenario).accelerations()), gap(tiles.accelerations())]
    tiles.advance(UNTIL)
    end = tiles.run().q[-1]
    exact = fk.simulate(scenario, engine="exact", progress=False).q[-1]

    def off(q: np.ndarray, other: np.ndarray) -> float:
        return float(np.abs(q - other).max())

    kernels = DomainSession(scenario, DomainOptions(step=STEP, ledger=False, threads=1))
    gaps.append(gap(kernels.accelerations()))
    kernels.advance(UNTIL)
    gaps.append(off(end, kernels.state.q))
    kernels.close()
    try:
        lammps = LammpsSession(scenario, LammpsOptions(step=STEP, ledger=0, forces="pair styles"))
    except UnsupportedLaw:
        gaps += ["refused", "", off(end, exact), "", ""]
    else:
        gaps.append(gap(lammps.accelerations()))
        lammps.advance(UNTIL)
        other = lammps.state.q
        lammps.close()
        finer = LammpsSession(scenario, LammpsOptions(step=STEP / 2, ledger=0, forces="pair styles"))
        finer.advance(UNTIL)
        half = finer.state.q
        finer.close()
        gaps += [off(end, other), off(end, exact), off(other, exact), off(half, exact)]
    return (name, f"{dimension}-D", *(g if isinstance(g, str) else f"{g:.1e}" for g in gaps))


def page(rows: list[tuple[str, ...]]) -> str:
    """The page of the documentation with some rows."""
    text = ["# How far the engines agree", "", *__doc__.splitlines()[4:], "", "| " + " | ".join(HEAD) + " |"]
    text += ["|" + "---|" * len(HEAD), *("| " + " | ".join(cells) + " |" for cells in rows)]
    text += [
        "", "The (36) rows go through a table where the force is no gradient; its error bound is in the deck.",
        "What pair styles of LAMMPS cannot express is described in [](cluster.md).",
    ]  # fmt: skip
    return "\n".join(text) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    rows, first = [], communicator().rank == 0
    for name in (*NAMES, *REFUSED):
        for dimension in (2, 3):
            rows.append(row(name, dimension))
            if first:
                print(*rows[-1], sep="  ", flush=True)
    if first:
        asked.out.write_text(page(rows))


if __name__ == "__main__":
    main()
