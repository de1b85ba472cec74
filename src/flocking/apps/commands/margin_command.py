"""The margins command: how much imperfection each conclusion about a scenario stands."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from flocking.apps.json_output import print_json

FINE, DIFFERENT, INTERRUPTED = 0, 1, 130
"""Exit codes: success, other tables than the stored ones, and 128 + 2 after the interrupt signal, as shells have it."""


def margins(
    scenario: str | None = None,
    /,
    *,
    papers: bool = False,
    vary: str | None = None,
    levels: list[str] | None = None,
    seeds: int | None = None,
    period: float | None = None,
    t_end: float | None = None,
    width: float | None = None,
    share: float | None = None,
    most_runs: int | None = None,
    out: Path | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    as_json: Annotated[bool, Parameter(name="--json")] = False,
) -> int:
    """Find how much delay, loss, noise and so on each conclusion stands, on runs. The same command goes on.

    Parameters
    ----------
    scenario
        A name that 'flocking list' shows, or a TOML file.
    papers
        Compute the tables again that are stored for the papers, and compare them.
    vary
        Quantities, separated by commas: period, latency, delay, loss, noise, velocity-noise, limit.
    levels
        Levels of the first grid, as name=value,value; once for each quantity.
    seeds
        Number of seeds; 5 when absent.
    period
        Period of controls and messages where another quantity is varied.
    t_end
        End of the runs; that of the scenario when absent.
    width
        Width of the bracket of a margin, as a share of its larger end; 0.2 when absent.
    share
        Share of the runs that must show a conclusion at a level; all when absent.
    most_runs
        Largest number of runs; 4,000 by default.
    out
        Folder for margins.json, a picture and the runs; out/margins/NAME when absent.
    workers
        Local processes; as many as cores when absent.
    cluster
        Address of a Dask scheduler to use instead, such as tcp://10.0.0.1:8786.
    as_json
        Print JSON.
    """
    from flocking.errors import InvalidInput

    if papers:
        given = {
            "scenario": scenario, "--cluster": cluster, "--vary": vary, "--levels": levels, "--seeds": seeds,
            "--period": period, "--t-end": t_end, "--width": width, "--share": share, "--most-runs": most_runs,
            "--json": as_json or None,
        }  # fmt: skip
        for name, value in given.items():
            if value is not None:
                rule = "must be absent with --papers"
                raise InvalidInput("margins", name, rule, value, "Those tables are computed as they are stored.")
        return _of_papers(out or Path("out") / "margins" / "papers", workers)
    if scenario is None:
        raise InvalidInput("margins", "scenario", "must be given", None, "Name one, or a TOML file, or use --papers.")
    from flocking.apps.scenario_names import find_scenario
    from flocking.apps.tables import print_table
    from flocking.engine.storage.atomic_files import write_file
    from flocking.papers.margins import SEEDS, VARIED, WIDTH
    from flocking.papers.margins import margins as find_margins
    from flocking.show.margin_pictures import margins_figure
    from flocking.show.style import save
    from flocking.study.certificates.beside.margin_lines import PROVEN_QUANTITIES, common_lines
    from flocking.study.margins.search import MOST_RUNS

    find_scenario(scenario, None, None)
    drawn = _drawn(scenario)
    name = Path(scenario).stem if scenario.endswith(".toml") else scenario
    folder = out or Path("out") / "margins" / name
    found = find_margins(
        lambda seed: find_scenario(scenario, seed if drawn else None, None),
        VARIED if vary is None else tuple(word.strip() for word in vary.split(",")),
        levels=_levels(levels or []), seeds=SEEDS if seeds is None else seeds, period=period, t_end=t_end,
        width=WIDTH if width is None else width, share=1.0 if share is None else share,
        most_runs=MOST_RUNS if most_runs is None else most_runs, out=folder,
        workers=workers, cluster=cluster, progress=True,
    )  # fmt: skip
    if found.status == "interrupted":
        print(f"flocking: interrupted; {found.runs} runs are stored in {folder}; the same command continues.",
              file=sys.stderr)  # fmt: skip
        return INTERRUPTED
    data = json.dumps(found.as_dict(), indent=2, allow_nan=False, ensure_ascii=False)
    write_file(folder / "margins.json", f"{data}\n".encode(), "write the margins")
    seeds_used = range(SEEDS if seeds is None else seeds) if drawn else range(1)
    lines = {
        one.name: common_lines([find_scenario(scenario, s if drawn else None, None) for s in seeds_used], one.name)
        for one in found.varied
        if one.name in PROVEN_QUANTITIES
    }
    picture = margins_figure(found, lines)
    files = [] if picture is None else save(picture, folder / "margins")
    if as_json:
        print_json(found.as_dict())
        return FINE
    for one in found.varied:
        rows = [cells[1:] for cells in found.cells if cells[0] == one.name]
        print_table(found.head[1:], rows, title=f"{name}: {one.name}")
        print()
    for note in found.notes:
        print(note)
    for name_of, proven in lines.items():
        for line in proven:
            print(f"proven before any run, {name_of}: {line.label} {line.text()} ({line.key})")
    for file in files:
        print(file)
    return FINE


def _of_papers(folder: Path, workers: int | None) -> int:
    """Compute the stored tables again, and print for each whether it equals the stored one."""
    from flocking.engine.storage.atomic_files import write_file
    from flocking.papers.stored_margins import FILE, PLANS, as_text, computed_margins, is_stored, stored_margins

    different = 0
    for key in PLANS:
        found = computed_margins(key, out=folder / key, workers=workers, progress=True)
        if found.status == "interrupted":
            print(f"flocking: interrupted; the same command continues in {folder}.", file=sys.stderr)
            return INTERRUPTED
        write_file(folder / key / FILE, as_text(found).encode(), "write the margins")
        what = "not stored"
        if is_stored(key):
            same = found.cells == stored_margins(key).cells
            what = "as stored" if same else "not as stored"
            different += not same
        print(f"{key}: {found.runs} runs, {what}, {folder / key / FILE}")
    return FINE if not different else DIFFERENT


def _drawn(scenario: str) -> bool:
    """Whether a scenario depends on a seed: that of a paper does, and a file that draws something at random."""
    import tomllib

    from flocking.apps.scenario_names import is_file

    path = Path(scenario)
    if not is_file(scenario):
        return True
    from flocking.study.scenario_files.scenario_file import LARGEST_FILE
    from flocking.study.scenario_files.scenario_reader import drawn_tables
    from flocking.study.scenario_files.text_files import read_text_file

    return any(drawn_tables(tomllib.loads(read_text_file("margins", path, LARGEST_FILE))))


def _levels(texts: list[str]) -> dict[str, list[float]] | None:
    from flocking.errors import InvalidInput

    found: dict[str, list[float]] = {}
    for text in texts:
        name, equals, values = text.partition("=")
        try:
            numbers = [float(value) for value in values.split(",")]
        except ValueError:
            numbers = []
        if not equals or not numbers or name in found:
            raise InvalidInput(
                "margins", "levels", "must be name=value,value, once for each quantity", text,
                "Write --levels loss=0,0.1,0.2.",
            )  # fmt: skip
        found[name] = numbers
    return found or None
