"""Scenarios that a page can open: of the papers, the user's files, and larger groups."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from flocking.apps.lab.access.confinement import Folder
from flocking.apps.lab.scene.points import spacing
from flocking.apps.scenario_names import find_scenario, paper_scenarios
from flocking.errors import InvalidInput
from flocking.model import starts
from flocking.model.graphs.distance_graphs import Hysteresis
from flocking.model.law import Law, Scenario
from flocking.model.parts.values import nearest
from flocking.model.potentials.potential import Potential
from flocking.model.state import State
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.papers.showcases.files import TITLES
from flocking.study.scenario_files.scenario_file import read_scenario

GAP, GAIN = 0.2, 0.2
"""Gap of the links of a large group, and gain of its consensus: some waves pass before velocities agree."""

STRENGTH = 4.0
"""Strength of its spring: a pair closes in within a unit of time."""

LONG = 40.0
"""Time for which it runs."""

TOLERANCE = 1e-6
"""Tolerance of its motion: what is drawn is a thousand times coarser."""

FAVOURITES = ("olfati-saber-2003", "zhou-2015")
MOST_FILES = 200
"""Scenario files that a menu offers; a longer menu is hard to read."""


def _larger_group(n: int, dimension: int) -> Callable[[int], Scenario]:
    """A large group under a bounded spring and consensus over a graph with hysteresis."""

    def make(seed: int) -> Scenario:
        law = Law(
            Hysteresis(2.0, GAP), (Gradient(Potential("k*(1.5*r**2 - r**3/3 - 2*r)", k=STRENGTH)), Consensus(GAIN))
        )
        side = 1.0 * n ** (1 / dimension)
        start = starts.box(n, side=side, speed=1.0, seed=seed, dimension=dimension)
        return Scenario(law, start, t_end=LONG, frames=2, name=f"group-{n}", tolerance=TOLERANCE, seed=seed)

    return make


LARGER_GROUPS = {
    "group-1000": _larger_group(1000, 2), "group-10000": _larger_group(10_000, 2),
    "group-100000": _larger_group(100_000, 2), "group-1000-3d": _larger_group(1000, 3),
}  # fmt: skip


def in_space(scenario: Scenario, seed: int = 0) -> Scenario:
    """A scenario of the plane put in space: its start gets random heights within the spacing of its agents.

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


def library(folder: Folder) -> tuple[str, ...]:
    """Names of all scenarios: the papers', larger groups, and the scenario files and event logs of a folder."""
    found = sorted(p.name for pattern in ("*.toml", "*.events.json") for p in folder.path.glob(pattern))
    files = [name for name in found if name != "pyproject.toml" and folder.holds(name)]
    return (*paper_scenarios(), *LARGER_GROUPS, *files[:MOST_FILES])


def is_built_in(name: str) -> bool:
    """Whether a name is that of a scenario that comes with the library."""
    return name in LARGER_GROUPS or name in paper_scenarios() or name in TITLES


def scenario_of(name: str, file: Path, seed: int | None = None) -> Scenario:
    """The scenario with a name, or else in a file.

    Parameters
    ----------
    name
        Name that the page shows.
    file
        The file with that name, read where the library has no such scenario.
    seed
        Seed of its random draws; its own, or 0, when absent.

    Raises
    ------
    InvalidInput
        When there is none, or the file has faults.
    """
    if name in LARGER_GROUPS:
        return LARGER_GROUPS[name](seed or 0)
    if is_built_in(name):
        return find_scenario(name, seed, None)
    if file.suffix != ".toml" and not file.is_file():
        known = (*paper_scenarios(), *LARGER_GROUPS, *TITLES)
        rule = "must be a name that 'flocking list' shows, or a TOML file"
        raise InvalidInput("lab", "scenario", rule, name, nearest(name, known))
    return read_scenario(file) if seed is None else read_scenario(file, seed=seed)
