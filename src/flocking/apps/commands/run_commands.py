"""Commands that run scenarios, and continue saved runs."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from flocking.apps.json_output import print_json

if TYPE_CHECKING:
    from flocking.engine.runs.run import Run

FINE, DIFFERENT, INTERRUPTED = 0, 1, 130
"""Exit codes: success, an outcome other than expected, and, as shells have it, 128 + 2 after the interrupt signal."""

Json = Annotated[bool, Parameter(name="--json")]


def run(
    scenario: str,
    *,
    out: Path | None = None,
    seed: int | None = None,
    engine: str = "auto",
    step: float | None = None,
    scheme: str | None = None,
    precision: str | None = None,
    threads: int | None = None,
    observe: Annotated[bool | None, Parameter(negative="--no-observe")] = None,
    keep_frames: Annotated[bool | None, Parameter(name="--frames", negative="--no-frames")] = None,
    memory: float | None = None,
    option: Annotated[list[str] | None, Parameter(name=["--option", "-o"])] = None,
    most_agents: int | None = None,
    as_json: Json = False,
) -> int:
    """Simulate a scenario.

    Parameters
    ----------
    scenario
        A name that 'flocking list' shows, or a TOML file.
    out
        New folder for the run, which is saved while it runs.
    seed
        Seed of the random draws.
    engine
        The engine: exact, tiles (large groups), sampled (held control), delayed (delays, and messages under continuous
        control), discrete (bodies in discrete time), lammps (also under mpiexec), one of another package, or auto:
        tiles for more than 2,000 agents where it can run them, else the one of the others but lammps that can.
    step
        Time step of the engines with a fixed one; they choose one when absent.
    scheme
        Integrator of tiles: verlet, damped (for strong damping) or rk4; agents of order 1: rk4 or euler.
    precision
        Precision of tiles: float64 or float32.
    threads
        Threads of tiles; all processors when absent. Results do not depend on it.
    observe
        Record order, flocks, density and closest pair at the frames; tiles does by default.
    keep_frames
        Keep positions and velocities at the frames; without them a run of any length is small.
    memory
        Largest size of the neighbour lists of tiles, in GiB; half the machine's memory when absent.
    option
        Any option of the engine, as name=value; once for each.
    most_agents
        Largest number of agents it may have; one million by default.
    as_json
        Print JSON.
    """
    from flocking.apps.scenario_names import find_scenario
    from flocking.engine.driver.registry import check_name, chosen_engine, engine_named, options_of
    from flocking.engine.driver.simulate import simulate
    from flocking.errors import InvalidInput
    from flocking.model.checks import number

    if memory is not None:
        number("run", "--memory", memory, above=0.0)
    found = find_scenario(scenario, seed, most_agents)
    chosen = engine_named(chosen_engine(found, check_name("run", engine)))
    given: dict[str, Any] = {
        "step": step, "scheme": scheme, "precision": precision, "threads": threads, "observe": observe,
        "keep_frames": keep_frames, "memory_limit": None if memory is None else memory * 2**30,
    }  # fmt: skip
    options = {name: value for name, value in given.items() if value is not None}
    named = _named_options(option or [])
    if twice := sorted(set(options) & set(named)):
        raise InvalidInput("run", twice[0], "must be given once", named[twice[0]], "Leave out the --option.")
    options = {**chosen.command_line_options, **options, **named}
    # Names of other arguments of `simulate` are refused here.
    options_of(chosen, options)
    return _print_run(lambda: simulate(found, engine=chosen.name, save=out, **options), out, as_json)


def _named_options(texts: Sequence[str]) -> dict[str, object]:
    """Options given as name=value; a value is read as TOML where it can be, else as text."""
    import tomllib

    from flocking.errors import InvalidInput

    found: dict[str, object] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name.isidentifier() or name in found:
            raise InvalidInput("run", "option", "must be name=value, such as step=0.01, once for each name", text)
        try:
            found[name] = tomllib.loads(f"value = {value}")["value"]
        except (ValueError, RecursionError, OverflowError):
            found[name] = value
    return found


def resume(folder: Path, *, threads: int | None = None, as_json: Json = False) -> int:
    """Continue a saved run that was interrupted or killed.

    Parameters
    ----------
    folder
        Folder of the run.
    threads
        Threads of tiles; as before when absent. Results do not depend on it.
    as_json
        Print JSON.
    """
    from flocking.engine.driver.resuming import resume as resume_run

    return _print_run(lambda: resume_run(folder, threads=threads), folder, as_json)


def _print_run(make: Callable[[], Run], out: Path | None, as_json: bool) -> int:
    from flocking.apps.commands.run_summary import facts, summary
    from flocking.apps.tables import print_facts
    from flocking.engine.interruption import partial_results
    from flocking.errors import SimulationError

    stopped, begin = False, time.monotonic()
    try:
        with partial_results():
            result = make()
        if result.rank:
            return FINE  # only the first rank of the job prints
    except SimulationError as error:
        if error.run is None:
            raise
        result, stopped = error.run, True
        if result.rank:
            return DIFFERENT
        print(f"flocking: {error}", file=sys.stderr)
    found = summary(result)
    if as_json:
        print_json({**found, "out": str(out) if out else None})
    else:
        took = f"{time.monotonic() - begin:.3g} s"
        print_facts([*facts(found), ("wall time", took), ("saved in", str(out) if out else "")])
    if stopped or not result.status.startswith("interrupted"):
        return DIFFERENT if stopped else FINE
    print(f"flocking: {result.status}: {_where_stored(result, out)}", file=sys.stderr)
    return INTERRUPTED


def _where_stored(result: Run, out: Path | None) -> str:
    """What is stored of an interrupted run."""
    if out is None:
        return "without --out nothing is stored."
    from flocking.engine.runs.run import FRAMES
    from flocking.engine.storage.record import read_provenance, read_record
    from flocking.formula.safe_digits import time_text

    # Several frames may lie within one step.
    count = read_record(out)["counts"]["time"]
    frames = FRAMES in result.provenance or count == len(result.t)
    complete = frames and read_provenance(out).get("steps") == result.provenance.get("steps")
    until = "" if complete else " up to its last commit"
    if not frames and 0 < count < len(result.t):
        scenario = result.scenario
        until += f", with {count} of {len(result.t)} frames, until t = "
        until += time_text(result.t[count - 1], scenario.start.t, scenario.t_end)
    return f"{out} holds it{until}; 'flocking resume {out}' continues it."
