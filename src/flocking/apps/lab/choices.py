"""What a page offers to open: scenarios of the papers, the user's files, and larger groups."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from flocking.apps.lab.glyphs import spacing
from flocking.apps.scenario_names import find_scenario, paper_scenarios
from flocking.errors import InvalidInput
from flocking.model import starts
from flocking.model.graphs import Hysteresis
from flocking.model.law import Law, Scenario
from flocking.model.potentials import Potential
from flocking.model.state import State
from flocking.model.terms import Consensus, Gradient

FAVOURITES = ("olfati-saber-2003", "zhou-2015")
MOST_FILES = 200


def _crowd(n: int, dimension: int) -> Callable[[int], Scenario]:
    """A crowd under a bounded spring and consensus over a graph with hysteresis."""

    def make(seed: int) -> Scenario:
        law = Law(Hysteresis(2.0, 0.2), (Gradient(Potential("k*(1.5*r**2 - r**3/3 - 2*r)", k=4.0)), Consensus(0.2)))
        side = 1.0 * n ** (1 / dimension)
        start = starts.box(n, side=side, speed=1.0, seed=seed, dimension=dimension)
        return Scenario(law, start, t_end=40.0, frames=2, name=f"crowd-{n}", tolerance=1e-6, seed=seed)

    return make


CROWDS = {
    "crowd-1000": _crowd(1000, 2), "crowd-10000": _crowd(10_000, 2), "crowd-100000": _crowd(100_000, 2),
    "crowd-1000-3d": _crowd(1000, 3),
}  # fmt: skip


def in_space(scenario: Scenario, seed: int = 0) -> Scenario:
    """A scenario of the plane put in space: its start gets a random third axis, as thick as its agents are apart.

    Raises
    ------
    InvalidInput
        When it is not one of the plane, or its law has a leader or obstacles there.
    """
    start = scenario.start
    if start.dimension != 2:
        raise InvalidInput("lab", "dimension", "must be 2 to be put in space", start.dimension)
    rng = np.random.default_rng(seed)
    heights = rng.uniform(-0.5, 0.5, (start.n, 1)) * spacing(start.q)
    lifted = State(np.hstack([start.q, heights]), np.hstack([start.p, np.zeros((start.n, 1))]), start.t)
    scenario.law.check_count(start.n, 3)
    return scenario.with_(start=lifted, name=f"{scenario.name}-3d")


def first_choice() -> str:
    """The scenario a page opens with."""
    known = paper_scenarios()
    for favourite in FAVOURITES:
        found = next((name for name in known if name.startswith(favourite)), None)
        if found is not None:
            return found
    return next(iter(known))


def library(folder: Path) -> tuple[str, ...]:
    """Names of all scenarios: the papers', crowds, and the scenario files and event logs of a folder."""
    files = sorted(p.name for pattern in ("*.toml", "*.events.json") for p in folder.glob(pattern))
    files = [name for name in files if name != "pyproject.toml"][:MOST_FILES]
    return (*paper_scenarios(), *CROWDS, *files)


def scenario_of(name: str, folder: Path, seed: int | None = None) -> Scenario:
    """The scenario with a name, or in a file.

    Raises
    ------
    InvalidInput
        When there is none, or the file has faults.
    """
    if name in CROWDS:
        return CROWDS[name](seed or 0)
    inside = folder / name
    if name.endswith(".toml"):
        from flocking.study.scenario_file import read_scenario

        path = inside if inside.exists() else Path(name)
        if seed is None:
            return read_scenario(path)
        return read_scenario(path, seed=seed)
    return find_scenario(name, seed, None)
