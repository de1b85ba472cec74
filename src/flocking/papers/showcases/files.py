"""The scenario files of the showcases, by name."""

from __future__ import annotations

from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.law import Scenario

if TYPE_CHECKING:
    from flocking.model.state import State

TITLES = {
    "obstacle-field": "a large group passes a field of 60 obstacles",
    "flock-from-noise": "noise becomes one flock",
    "cluster-obstacles": "a large group passes the six obstacles of (59)",
}
"""Titles of the scenarios by name, which is also that of the file."""


def showcase_text(name: str) -> str:
    """The scenario file of a showcase.

    Raises
    ------
    InvalidInput
        If there is none of that name.
    """
    if name not in TITLES:
        raise InvalidInput("showcases", "name", f"must be one of {', '.join(TITLES)}", name)
    return files("flocking.papers.showcases").joinpath(f"{name}.toml").read_text(encoding="utf-8")


def showcase_scenario(name: str, seed: int | None = None, agents: int | None = None) -> Scenario:
    """The scenario of a showcase.

    Parameters
    ----------
    name
        Its name.
    seed
        Replaces the seed of the start.
    agents
        Number of agents of a smaller group of the same density with the same front; the full group by default.

    Raises
    ------
    InvalidInput
        If there is none of that name, or the group would not be smaller.
    """
    from flocking.study.scenario_files.scenario_file import parse_scenario

    full = parse_scenario(showcase_text(name), source=f"{name}.toml", seed=seed)
    if agents is None or agents == full.start.n:
        return full
    if not 1 <= agents < full.start.n:
        raise InvalidInput("showcases", "agents", f"must be from 1 to {full.start.n}", agents)
    return full.with_(start=_smaller(full.start, agents))


def _smaller(start: State, agents: int) -> State:
    """The first ``agents`` of a start, contracted to the same density with the same front."""
    from flocking.model.state import State

    scale = float(np.sqrt(agents / start.n))
    q = scale * start.q[:agents]
    q[:, 0] += start.q[:, 0].max() - q[:, 0].max()
    return State(q, start.p[:agents], start.t)
