"""Laws and states on which the tiled engine is held against others."""

from __future__ import annotations

import numpy as np

import flocking as fk
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.model.graphs.smooth_graphs import PerAgentRadii, Smooth

STRUCTURAL = "(a + b)/2*(sqrt(1 + (r - d + c)**2) - sqrt(1 + c**2)) + (a - b)/2*(r - d)"


def structural(d=1.0):
    return fk.Potential(STRUCTURAL, a=1, b=5, c=4 / np.sqrt(20), d=d)


def shi():
    return fk.Potential(
        "where(r < k, a*log(r**2) + b/r**2, a*(1 + log(b/a)) + cos((1 + (r**2 - k**2)/(R**2 - k**2))*pi) + 1)",
        a=0.05, b=0.05, k=1.0, R=4.0,
    )  # fmt: skip


def saber(radius=1.2):
    return fk.Law(fk.Proximity(radius), [fk.Gradient(structural()), fk.Consensus(1.0)])


def zhou(radius=4.0, gap=0.3):
    psi = fk.Potential("1/r + 1/(R - r)", R=radius)
    return fk.Law(fk.Hysteresis(radius=radius, gap=gap), [fk.Gradient(psi), fk.Consensus(1.0)])


def accelerations(law, state, *, agents=None, precision="float64", **options):
    """What the tiled engine makes of a state, and what the reference says: (N, m), (N, m), sums of pair forces."""
    agents = agents or fk.Agents()
    scenario = fk.Scenario(law, state, t_end=state.t + 1, agents=agents, frames=1)
    session = TilesSession(scenario, TilesOptions(step=0.01, precision=precision, **{"ledger": False, **options}))
    expected = fk.evaluate(law, state, agents=agents)
    mass = np.broadcast_to(agents.masses, state.n)[:, None]
    damping = np.broadcast_to(agents.damping, state.n)[:, None]
    return session.accelerations(), (expected.u - damping * state.p) / mass, expected.pair_force_sum


def states(n, dimension, seed=0, side=1.0):
    """Random, clustered, lattice and degenerate states, with mean spacing about ``side``."""
    rng = np.random.default_rng(seed)
    size = side * n ** (1 / dimension)
    random = rng.random((n, dimension)) * size
    centres = rng.random((max(1, n // 40), dimension)) * 20 * size
    clustered = centres[rng.integers(0, len(centres), n)] + side * rng.normal(size=(n, dimension))
    each = int(np.ceil(n ** (1 / dimension)))
    lattice = np.stack(np.meshgrid(*[np.arange(each)] * dimension), axis=-1).reshape(-1, dimension)[:n] * 0.75 * side
    line = np.zeros((n, dimension))
    line[:, 0] = np.arange(n) * 0.4 * side
    straggler = random.copy()
    straggler[n // 2] += 1e6 * side
    found = {"random": random, "clustered": clustered, "lattice": lattice, "line": line, "straggler": straggler}
    return {name: fk.State(q, rng.normal(size=(n, dimension))) for name, q in found.items()}


__all__ = ["PerAgentRadii", "Smooth", "accelerations", "saber", "shi", "states", "structural", "zhou"]


def deviations(made, exact, step):
    """How far positions, and the last energy, dissipation, supply and jumps, are from those of an exact run."""
    run = fk.simulate(made, engine="tiles", step=step, progress=False)
    names = ("energy", "dissipated", "supplied", "jumped")
    booked = [abs(run.trace[name][-1] - exact.trace[name][-1]) for name in names]
    return np.array([np.abs(run.q - exact.q).max(), *booked])
