"""The command that writes a law as C for a flight computer."""

from __future__ import annotations

from pathlib import Path


def export_c(
    scenario: str,
    *,
    out: Path | None = None,
    float32: bool = False,
    neighbours: int | None = None,
    limit: float | None = None,
    name: str = "law",
    seed: int | None = None,
    most_agents: int | None = None,
) -> int:
    """Write the control law of a scenario as self-contained C99, with a README and an example.

    Parameters
    ----------
    scenario
        A name that 'flocking list' shows, or a TOML file.
    out
        A new or empty folder; the scenario's name with the ending .c-law when absent.
    float32
        Numbers of single precision.
    neighbours
        Largest number of neighbours whose states are kept; all others of the group when absent.
    limit
        Largest force; longer ones are scaled back.
    name
        Begin of all names in C.
    seed
        Seed of the scenario's draws.
    most_agents
        Largest number of agents it may have.
    """
    from flocking.apps.scenario_names import find_scenario
    from flocking.engine.driver.law_export import export_c as write

    place = out or Path(f"{Path(scenario).stem}.c-law")
    found = find_scenario(scenario, seed, most_agents)
    print(write(found, place, float32=float32, neighbours=neighbours, limit=limit, name=name))
    return 0
