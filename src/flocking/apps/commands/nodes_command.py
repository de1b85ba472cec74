"""The command that runs a process for each agent."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from flocking.apps.commands.run_commands import FINE, INTERRUPTED
from flocking.apps.json_output import print_json


def nodes(
    scenario: str,
    *,
    agents: int | None = None,
    code: str = "python",
    real_time: float | None = None,
    kill: list[str] | None = None,
    restart: list[str] | None = None,
    cut: list[str] | None = None,
    record: Path | None = None,
    out: Path | None = None,
    listen: str = "",
    spawn: Annotated[bool, Parameter(negative="--no-spawn")] = True,
    patience: float = 10.0,
    seed: int | None = None,
    as_json: Annotated[bool, Parameter(name="--json")] = False,
) -> int:
    """Run a scenario with one process an agent, which receives states of the others only by messages.

    Parameters
    ----------
    scenario
        A name that 'flocking list' shows, or a TOML file; its control must be held.
    agents
        Number of agents that the scenario must have, as a check.
    code
        What agents run: python, or c, the exported law.
    real_time
        Seconds of the scenario in a second; without it the world waits for every agent.
    kill
        AGENT@TIME, as 3@1.5: the agent's process is killed.
    restart
        AGENT@TIME, as 3@2.5: the agent's process begins anew and has no samples.
    cut
        AGENT@TIME-UNTIL, as 3@1.5-2.5: the agent's radio is cut.
    record
        A new MCAP file for frames and samples, which 'flocking audit' reads.
    out
        New or empty folder for the run.
    listen
        Where the world listens, as tcp/192.168.1.5:7447; this machine alone when absent.
    spawn
        Begin the processes here; with --no-spawn the command that begins each on its host is printed.
    patience
        Seconds in which an agent must answer.
    seed
        Seed of the scenario's draws.
    as_json
        Print JSON.
    """
    from flocking.apps.scenario_names import find_scenario
    from flocking.apps.tables import print_facts
    from flocking.engine.driver.nodes import simulate_nodes
    from flocking.engine.interruption import partial_results
    from flocking.engine.nodes.kills_and_cuts import Cut, Kill, Restart, fault_of
    from flocking.errors import InvalidInput

    found = find_scenario(scenario, seed, None)
    if agents is not None and agents != found.start.n:
        raise InvalidInput(
            "nodes", "--agents", f"must be the number of agents of the scenario, {found.start.n}", agents,
            "Change the number in the scenario's file.",
        )  # fmt: skip
    kinds = ((Kill, kill), (Restart, restart), (Cut, cut))
    faults = [fault_of(kind, text) for kind, texts in kinds for text in texts or []]
    with partial_results():
        run = simulate_nodes(
            found,
            code=code,
            real_time=real_time,
            faults=faults,
            patience=patience,
            place=listen,
            spawn=spawn,
            record=record,
        )
    if out is not None:
        from flocking.engine.storage.stored_runs import write_run

        write_run(run, out)
    facts = {"scenario": run.scenario.name, "agents": found.start.n, "status": run.status, "end": float(run.t[-1])}
    facts |= {name: value for name, value in run.provenance.items() if isinstance(value, int | float | list | str)}
    if as_json:
        print_json(facts)
    else:
        print_facts([(name, str(value)) for name, value in facts.items()])
    if not run.status.startswith("interrupted"):
        return FINE
    files = ", ".join(str(path) for path in (out, record) if path is not None)
    print(
        f"flocking: {run.status}: {f'{files} hold what was until then' if files else 'nothing is stored'}.",
        file=sys.stderr,
    )
    return INTERRUPTED
