"""Scenarios whose runs are the same: those that differ in nothing but names and in seeds that draw nothing."""

from __future__ import annotations

import json

from flocking.errors import FlockingError
from flocking.model.drawn_during_runs import draws_during_runs
from flocking.model.law import Scenario
from flocking.model.serial import to_data
from flocking.study.sweeps.recorded_content import digest_of

DIGITS = 16
"""Hexadecimal digits of a digest: of a hundred thousand scenarios two that differ share one with a chance of 3e-10."""


MOST_AGENTS = 100_000
"""Largest group that is compared after each run of a sweep, a bound on time and memory: it takes 20 ms and 13 MB, and a
run of it seconds.
"""


def run_digest(scenario: Scenario, most_agents: float = MOST_AGENTS) -> str:
    """What distinguishes a scenario from others whose runs may differ; empty where its parts are not registered.

    Parameters
    ----------
    scenario
        The scenario. Its name and its seed, which change no run, do not count, nor do seeds of bodies and of
        information where nothing is drawn during runs.
    most_agents
        Largest group that is compared; of larger ones the digest is empty too.
    """
    if scenario.start.n > most_agents:
        return ""
    try:
        data = to_data(scenario)
    except FlockingError:
        return ""
    if not isinstance(data, dict):
        return ""
    kept = {name: value for name, value in data.items() if name not in ("name", "seed")}
    if not draws_during_runs(scenario):
        kept |= {name: _without_seeds(kept[name]) for name in ("agents", "information") if name in kept}
    return digest_of(json.dumps(kept, sort_keys=True))[:DIGITS]


def _without_seeds(data: object) -> object:
    if isinstance(data, dict):
        return {name: _without_seeds(value) for name, value in data.items() if name != "seed"}
    return [_without_seeds(value) for value in data] if isinstance(data, list) else data
