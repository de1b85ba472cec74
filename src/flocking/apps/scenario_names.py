"""Scenarios by name: those of the papers, the large ones of the gallery, and files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from flocking.errors import InvalidInput
from flocking.model.law import Scenario


def paper_scenarios() -> dict[str, tuple[str, Callable[[int], Scenario]]]:
    """Every scenario of the papers by name: the paper's key, and the function of the seed that makes it."""
    from flocking.papers import keys, paper

    return {name: (key, make) for key in keys() for name, make in paper(key).scenarios().items()}


def is_name(name: str) -> bool:
    """Whether a name is that of a scenario of a paper or of a showcase, which comes before a file of that name."""
    from flocking.papers import paper, paper_of
    from flocking.papers.showcases.files import TITLES

    key = paper_of(name)
    return name in TITLES or (bool(key) and name in paper(key).scenarios())


def is_file(name: str) -> bool:
    """Whether a scenario named by a user is in a file, there or not: no scenario has that name."""
    return not is_name(name) and (Path(name).suffix == ".toml" or Path(name).exists())


def within_most_agents(scenario: Scenario, most_agents: int | None) -> Scenario:
    """The scenario, unless it has more agents than were allowed.

    Parameters
    ----------
    scenario
        The scenario.
    most_agents
        Largest number of agents; any number when absent.

    Raises
    ------
    InvalidInput
        When it has.
    """
    if most_agents is not None and scenario.start.n > most_agents:
        allowed = f"must be at least the {scenario.start.n} of this scenario"
        raise InvalidInput("scenario", "most-agents", allowed, most_agents, "Raise it, or leave it out.")
    return scenario


def find_scenario(name: str, seed: int | None, most_agents: int | None) -> Scenario:
    """The scenario named by a user: of a paper or a showcase, or in a TOML file.

    Parameters
    ----------
    name
        Name or path.
    seed
        Seed of its random draws; that of the file, or 0 for a paper's scenario, when absent.
    most_agents
        Largest number of agents it may have; that of files when absent.

    Raises
    ------
    InvalidInput
        When there is no such name or file, the file has faults, or there are more agents.
    """
    from flocking.papers import paper, paper_of
    from flocking.papers.showcases.files import TITLES, showcase_scenario
    from flocking.study.sample_files.reading import ENDINGS

    key = paper_of(name)
    if key and name in (made := paper(key).scenarios()):
        return within_most_agents(made[name](0 if seed is None else seed), most_agents)
    if name in TITLES:
        return within_most_agents(showcase_scenario(name, seed), most_agents)
    if Path(name).suffix in ENDINGS and Path(name).is_file():
        raise InvalidInput(
            "scenario", "file", "must be a TOML file", name, "Samples of a motion are judged by 'flocking audit'."
        )
    if is_file(name):
        from flocking.study.scenario_files.scenario_file import MOST_AGENTS, read_scenario

        return read_scenario(name, seed=seed, most_agents=MOST_AGENTS if most_agents is None else most_agents)
    from flocking.model.parts.values import nearest

    raise InvalidInput(
        "scenario",
        "name",
        "must be a name that 'flocking list' shows, or a TOML file",
        name,
        nearest(name, [*paper_scenarios(), *TITLES]),
    )
