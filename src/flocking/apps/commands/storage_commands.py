"""Commands for runs on disk: contents, export, and the first difference of two."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from flocking.apps.json_output import print_json

MEGABYTE = 1e6
"""Bytes in a megabyte, as storage is sold and `ls --si` counts."""

Json = Annotated[bool, Parameter(name="--json")]

EQUAL, DIFFERENT = 0, 1
"""Exit codes, as those of ``cmp``: equal, and different."""


def info(folder: Path, *, as_json: Json = False) -> int:
    """Show what a saved run holds, checking every chunk of it.

    Parameters
    ----------
    folder
        Folder of the run.
    as_json
        Print JSON.
    """
    from flocking.apps.commands.run_summary import facts, summary
    from flocking.apps.tables import print_facts
    from flocking.engine.driver.waits import Wait, stage
    from flocking.engine.storage.stored_runs import read_run, stored_facts

    with Wait("info"):
        stage("reading every chunk of the run")
        stored = stored_facts(folder)
        found = summary(read_run(folder)) if stored["scenario_stored"] else None
    if as_json:
        print_json({**(found or {}), "stored": stored})
        return EQUAL
    rows = facts(found) if found else [("status", stored["status"]), ("frames", str(stored["frames"]))]
    resumable = "yes, with 'flocking resume'" if stored["can_go_on"] else "no"
    rows += [
        ("commits", str(stored["commits"])),
        ("size on disk", f"{stored['bytes'] / MEGABYTE:.3g} MB"),
        ("can be resumed", "" if stored["status"] == "finished" else resumable),
        ("scenario", "not stored: it has a part from outside the library" if found is None else ""),
    ]
    print_facts(rows)
    return EQUAL


def export(
    folder: Path, *, to: str = "gsd", out: Path | None = None, step: float | None = None, seed: int | None = None
) -> int:
    """Write a saved run for other programs, or a scenario as an input deck for LAMMPS.

    Parameters
    ----------
    folder
        Folder of the run; for lammps a scenario: a name that 'flocking list' shows, or a TOML file.
    to
        gsd (OVITO, freud), xyz (extended XYZ), npz (all arrays), csv or parquet (observables of every frame); lammps.
    out
        The file; the folder's name with the format as its ending when absent. For lammps a new folder.
    step
        Time step, for lammps; chosen from the start when absent.
    seed
        Seed of the scenario's draws, for lammps.
    """
    if to.lower() == "lammps":
        return _export_deck(str(folder), out, step, seed)
    from flocking.apps.commands.run_summary import tell_unfinished
    from flocking.engine.driver.waits import Wait, stage
    from flocking.engine.storage.export_formats import export_run
    from flocking.engine.storage.stored_runs import read_run
    from flocking.errors import InvalidInput

    for name, value in (("--step", step), ("--seed", seed)):
        if value is not None:
            raise InvalidInput("export", name, "must be absent for a saved run", value, "It is for --to lammps.")
    place = out or folder.resolve().with_name(f"{folder.resolve().name}.{to.lower()}")
    with Wait("export"):
        stage("reading the run")
        run = read_run(folder)
        stage(f"writing {to.lower()}")
        made = export_run(run, place, to=to)
    tell_unfinished(run, "written")
    print(made)
    return EQUAL


def _export_deck(scenario: str, out: Path | None, step: float | None, seed: int | None) -> int:
    from flocking.apps.scenario_names import find_scenario
    from flocking.engine.driver.lammps_export import export_deck
    from flocking.engine.driver.waits import Wait, stage

    place = out or Path(f"{Path(scenario).stem}.lammps")
    with Wait("export"):
        stage("writing the deck")
        made = export_deck(find_scenario(scenario, seed, None), place, step=step)
    print(made)
    return EQUAL


def diff(one: Path, two: Path, *, tolerance: float = 0.0, as_json: Json = False) -> int:
    """Find the first difference of two saved runs, by time and agent. Exit code 0 when equal, 1 when not.

    Parameters
    ----------
    one
        Folder of a run.
    two
        Folder of the run that it is compared with.
    tolerance
        Differences of numbers up to this size do not count.
    as_json
        Print JSON.
    """
    from flocking.engine.driver.waits import Wait, stage
    from flocking.engine.runs.compare import first_difference
    from flocking.engine.storage.stored_runs import read_run
    from flocking.formula.safe_digits import given_text

    with Wait("diff"):
        stage("reading and comparing the runs")
        found = first_difference(read_run(one), read_run(two), tolerance=tolerance)
    if as_json:
        about = None if found is None else {**vars(found), "first": str(found.first), "second": str(found.second)}
        print_json({"equal": found is None, "tolerance": tolerance, "first_difference": about})
    else:
        within = f" within {given_text(tolerance)}" if tolerance else ""
        print(f"The runs are equal{within}." if found is None else found)
    return EQUAL if found is None else DIFFERENT
