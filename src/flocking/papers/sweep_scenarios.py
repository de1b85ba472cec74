"""The papers' scenarios with options that a sweep file may vary."""

from __future__ import annotations

from functools import cache, partial
from typing import TypedDict, Unpack

from flocking.model.law import Scenario
from flocking.model.parts.values import TRUTH, Value, choice
from flocking.study.evidence import Evidence
from flocking.study.sweeps.parametrised_scenarios import ParametrisedScenario, integer_between, number_between

OBSTACLE_AREA = 3200.0
"""Area of the start region of Olfati-Saber's task 1; the shape is varied at constant density."""
MOST_AGENTS = 1000
"""Largest number of agents of a paper's scenario in a sweep file; limits the work of a file."""


class _FixedOptions(TypedDict, total=False):
    speed: float
    complete: bool


class _DynamicOptions(TypedDict, total=False):
    speed: float
    start_radius: float


class _ZhouOptions(TypedDict, total=False):
    side: float
    gain: float
    duration: float


class _ShiOptions(TypedDict, total=False):
    informed: int
    compact: bool


class _ObstacleOptions(TypedDict, total=False):
    tracking: str
    tracking_gain: float
    gamma_agents: bool
    agents: int
    box: tuple[tuple[float, float], tuple[float, float]]


def _tanner_fixed(seed: int, **options: Unpack[_FixedOptions]) -> Scenario:
    from flocking.papers.tanner_2003_fixed.system import scenario

    return scenario(seed=seed, **options)


def _tanner_dynamic(seed: int, **options: Unpack[_DynamicOptions]) -> Scenario:
    from flocking.papers.tanner_2003_dynamic.system import scenario

    return scenario(seed=seed, **options)


def _zhou(seed: int, *, leader: bool, **options: Unpack[_ZhouOptions]) -> Scenario:
    from flocking.papers.zhou_2015.system import scenario

    return scenario(seed=seed, leader=leader, **options)


def _shi(seed: int, *, name: str, **options: Unpack[_ShiOptions]) -> Scenario:
    from flocking.papers.shi_2009.system import scenario

    return scenario(seed=seed, name=name, **options)


def _obstacles(seed: int, *, length: float | None = None, **options: Unpack[_ObstacleOptions]) -> Scenario:
    """Task 1 of Olfati-Saber with a start region of constant area and the right edge and centre line of the paper's."""
    from flocking.papers.olfati_saber_2003.system import START_BOX, obstacle_scenario

    (x, y), (long, wide) = START_BOX
    if length is not None:
        width = OBSTACLE_AREA / length
        options["box"] = ((x + long - length, y + wide / 2 - width / 2), (length, width))
    return obstacle_scenario(seed, **options)


def _certified_zhou(e: Evidence) -> float:
    """Distance at which a single pair stores the largest energy of (16)-(18)."""
    from flocking.papers.zhou_2015.theorems import energy_limit

    return _distance_holding(e, energy_limit(e))


def _certified_by_start(e: Evidence) -> float:
    """Distance at which a single pair stores the initial energy and that of the links created since."""
    trace = e.trace
    return _distance_holding(e, float(trace["energy"][0] + trace["jumped"].max()))


def _distance_holding(e: Evidence, most: float) -> float:
    """Smallest distance of a linked pair that stores at most ``most``."""
    import numpy as np

    from flocking.study.claims.potential_minimum import nearest_distance, smallest_value

    psi = e.potential
    best, lowest = smallest_value(psi, float(np.max(np.asarray(e.law.graph.break_radius))))
    if most <= lowest:
        return float(best)
    return nearest_distance(psi, most, best)


def _energy_bound(e: Evidence) -> float:
    from flocking.papers.zhou_2015.theorems import energy_limit

    return energy_limit(e)


ZHOU_MEASURES = {
    "energy_bound": ("largest energy that (16)-(18) allow", _energy_bound),
    "certified_closest": ("distance below which (16)-(18) allow no linked pair", _certified_zhou),
    "certified_by_links": ("the same for the created links instead of all possible ones", _certified_by_start),
}


@cache
def sweep_scenarios() -> dict[str, ParametrisedScenario]:
    """Parametrised scenarios by name: those of the papers' scenarios with options."""
    from flocking.papers.shi_2009.system import AGENTS, SETTINGS

    speed = number_between(0.0, 100.0)
    zhou = {
        "side": number_between(0.5, 100.0),
        "gain": number_between(0.0, 1000.0),
        "duration": number_between(0.1, 10_000.0),
    }
    obstacles = {
        "length": number_between(10.0, 1000.0), "tracking": choice("agent", "shared"),
        "tracking_gain": number_between(0.0, 1000.0), "gamma_agents": TRUTH, "agents": integer_between(1, MOST_AGENTS),
    }  # fmt: skip
    found = {
        "tanner-2003-fixed": ParametrisedScenario(_tanner_fixed, {"speed": speed, "complete": TRUTH}),
        "tanner-2003-dynamic": ParametrisedScenario(
            _tanner_dynamic, {"speed": speed, "start_radius": number_between(0.1, 5.0)}
        ),
        "zhou-2015": ParametrisedScenario(partial(_zhou, leader=False), zhou, ZHOU_MEASURES),
        "zhou-2015-leader": ParametrisedScenario(partial(_zhou, leader=True), zhou),
        "olfati-saber-2003": ParametrisedScenario(_obstacles, obstacles),
    }
    for name, setting in SETTINGS.items():
        options: dict[str, Value] = {"compact": TRUTH}
        if "some" in (setting.velocity, setting.acceleration):
            # Where all agents are informed of what anybody is, or none, the number changes nothing.
            options["informed"] = integer_between(0, AGENTS)
        found[name] = ParametrisedScenario(partial(_shi, name=name), options)
    return found
