"""Check of the scenarios that this engine supports."""

from __future__ import annotations

import numpy as np

from flocking.engine.fixed_step.supported_bodies import refused_body
from flocking.engine.kernels.layout import Layout
from flocking.engine.protocol.world import left_out
from flocking.engine.tiles.kernels.spec import SPACES
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.graphs.weights import PairWeights
from flocking.model.law import Scenario
from flocking.model.terms.schedules import Schedule

MOST_AGENTS = 2**31 - 1
"""Largest number of atoms in a build of LAMMPS with 32-bit atom numbers."""


def _refusal(what: str, way_out: str) -> UnsupportedLaw:
    return UnsupportedLaw(f"LAMMPS cannot run {what}. {way_out}")


def check_supported(scenario: Scenario) -> None:
    """Check that a scenario can be translated.

    Raises
    ------
    UnsupportedLaw
        If a part of the scenario has no translation.
    InvalidInput
        If the number of agents is too large for this build of LAMMPS.
    """
    law, agents = scenario.law, scenario.agents
    n, dimension = scenario.start.q.shape
    if n > MOST_AGENTS:
        raise InvalidInput("Scenario", "start", f"must have at most {MOST_AGENTS} agents for LAMMPS", n)
    for name, part in left_out(scenario, ()).items():
        raise _refusal(f"{name}={type(part).__name__}(...): it would be left out", "Use forces='kernels'.")
    if body := refused_body(agents):
        raise _refusal(body, "Use engine='exact'.")
    if not isinstance(scenario.space, SPACES):
        raise _refusal(f"{type(scenario.space).__name__} space", "Use engine='exact'.")
    if dimension not in (2, 3):
        raise _refusal(f"{dimension} dimensions, only 2 or 3", "Use engine='exact'.")
    for graph in law.graphs:
        breaks = graph.break_radius
        if not (graph.follows_radii and isinstance(breaks, float)):
            way_out = (
                "Use engine='exact'." if graph.moves and not graph.follows_radii else "Use engine='tiles' or 'exact'."
            )
            raise _refusal(f"the graph {type(graph).__name__}: its pair styles select pairs by one distance", way_out)
        gap = breaks - float(graph.appear_radius)
        if gap > 0:
            raise _refusal(
                f"{type(graph).__name__} with a gap ({gap:g}): its pair styles have no memory of links",
                "Use engine='tiles' or 'exact', or Proximity.",
            )
    for term in law.pair_terms:
        if getattr(term, "functional", False):
            raise _refusal(f"{type(term).__name__} with a graph functional", "Use engine='exact'.")
    for leader in Layout(law, scenario.energy).leaders():
        if not leader.closed_form:
            raise _refusal(
                f"the leader {type(leader).__name__}, whose position has no closed form", "Use engine='exact'."
            )
    for owner, owned in Layout(law, scenario.energy).owners():
        for name, value in owned.items():
            if isinstance(value, PairWeights):
                raise _refusal(
                    f"the pair weights {type(value).__name__} of {name}",
                    "Use engine='tiles' or 'exact', or one constant gain.",
                )
            if isinstance(value, Schedule):
                raise _refusal(f"the Schedule of {name}", "Use engine='tiles' or 'exact', or one run per stage.")
            if (
                isinstance(value, np.ndarray)
                and owner.startswith("term")
                and scenario.law.terms[int(owner[4:])] in law.pair_terms
            ):
                raise _refusal(
                    f"one {name} per agent in a pair term: its pair forces are equal and opposite",
                    "Use engine='tiles' or 'exact'.",
                )
