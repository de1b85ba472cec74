"""Commands that draw pictures and films of a saved run, or of a scenario after running it."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from flocking.engine.runs.run import Run

DRAWN, STOPPED = 0, 1
"""Exit codes: success, and a picture of a run that could not go on to its end."""

OTHER_FORMATS = ("jpg", "jpeg", "gif", "tif", "tiff", "bmp", "webp", "eps", "ps", "mp4", "html")
"""Endings of unsupported formats, which are refused; any other ending is part of the name."""


def plot(
    source: str | None = None,
    *,
    kind: Annotated[list[str] | None, Parameter(name=["--kind", "-k"])] = None,
    out: Path | None = None,
    time: float | None = None,
    theme: str = "light",
    seed: int | None = None,
    most_agents: int | None = None,
) -> int:
    """Draw a saved run, or a scenario after running it.

    Parameters
    ----------
    source
        Folder of a run, a name that 'flocking list' shows, or a TOML file.
    kind
        What to draw: net, density, energy, phase, spread, connectivity, lattice, closest, links, departed, velocities,
        positions, errors or series (a sheet of several); once for each picture. '--kind list' prints them.
    out
        The file, ending in .svg, .png or .pdf; SVG and PNG of that name without such an ending. Beside the run's
        folder when absent, or in the current folder for a scenario.
    time
        When, for a net; the end when absent.
    theme
        light or dark.
    seed
        Seed of the random draws of a scenario.
    most_agents
        Largest number of agents it may have.
    """
    from flocking.engine.driver.waits import Wait, stage
    from flocking.errors import InvalidInput
    from flocking.show.plot import KINDS, plot
    from flocking.show.style import FORMATS, check_writable, save

    kinds = list(dict.fromkeys(kind or ["net"]))
    if "list" in kinds:
        print("\n".join(KINDS))
        return DRAWN
    for name in kinds:
        if name not in KINDS:
            raise InvalidInput("plot", "kind", f"must be one of {', '.join(KINDS)}", name)
    if time is not None and kinds != ["net"]:
        raise InvalidInput("plot", "time", "can be given for --kind net only", time)
    format_name = out.suffix[1:].lower() if out is not None else ""
    known = format_name in FORMATS
    if format_name in OTHER_FORMATS:
        raise InvalidInput("plot", "out", "must end in .svg, .png or .pdf, or have no such ending", str(out))
    if out is not None:
        check_writable("save", out)
    run, place, code = _run_of("plot", source, seed, most_agents)
    base = place if out is None else out.with_suffix("") if known else out
    check_writable("save", base)
    for name in kinds:
        with Wait("plot"):
            stage(f"drawing {name}")
            made = plot(run, name, theme=theme) if time is None else plot(run, name, theme=theme, time=time)
            named = base.with_name(f"{base.name}-{name}") if out is None or len(kinds) > 1 else base
            files = save(made, named, (format_name,) if known else ("svg", "png"))
        for file in files:
            print(file)
    return code


def animate(
    source: str | None = None,
    *,
    out: Path | None = None,
    seconds: float | None = None,
    fps: int = 20,
    follow: bool = False,
    trails: bool = False,
    theme: str = "light",
    seed: int | None = None,
    most_agents: int | None = None,
) -> int:
    """Make a film of a saved run, or of a scenario after running it.

    Parameters
    ----------
    source
        Folder of a run, a name that 'flocking list' shows, or a TOML file.
    out
        The file, ending in .mp4 (needs ffmpeg) or .gif; without an ending mp4 where ffmpeg is installed. Beside
        the run's folder when absent, or in the current folder for a scenario.
    seconds
        Length of the film; every frame once when absent.
    fps
        Pictures per second.
    follow
        Move the picture with the group.
    trails
        Draw the paths of the agents.
    theme
        light or dark.
    seed
        Seed of the random draws of a scenario.
    most_agents
        Largest number of agents it may have.
    """
    from flocking.show.animate import SUFFIXES, animate, ffmpeg, film_path
    from flocking.show.style import check_writable

    if out is not None:
        check_writable("animate", film_path(out))
    run, place, code = _run_of("animate", source, seed, most_agents)
    # The name of a run may have a point, as run-0.5, which begins no ending.
    target = place.with_name(f"{place.name}{SUFFIXES[0] if ffmpeg() else SUFFIXES[1]}") if out is None else out
    print(animate(run, target, seconds=seconds, fps=fps, follow=follow, theme=theme, trails=trails))
    return code


def _run_of(owner: str, source: str | None, seed: int | None, most_agents: int | None) -> tuple[Run, Path, int]:
    """The run named by a user, the path of its pictures without kind and ending, and the exit code."""
    from flocking.apps.commands.run_summary import tell_unfinished
    from flocking.apps.scenario_names import find_scenario, within_most_agents
    from flocking.engine.driver.simulate import simulate
    from flocking.engine.driver.waits import Wait, stage
    from flocking.engine.storage.stored_runs import read_run
    from flocking.errors import InvalidInput, SimulationError

    if source is None:
        raise InvalidInput(owner, "source", "must be given", source, "Name a run's folder or a scenario.")
    folder = Path(source)
    if folder.is_dir():
        if seed is not None:
            raise InvalidInput(owner, "seed", "can be given for a scenario only", seed, "This run has been computed.")
        resolved = folder.resolve()
        with Wait(owner):
            stage("reading the run")
            run = read_run(folder)
        within_most_agents(run.scenario, most_agents)
        tell_unfinished(run, "drawn")
        return run, resolved.with_name(resolved.name), DRAWN
    scenario = find_scenario(source, seed, most_agents)
    code = DRAWN
    try:
        run = simulate(scenario)
    except SimulationError as error:
        if error.run is None:
            raise
        print(f"flocking: {error}; drawn up to that time.", file=sys.stderr)
        run, code = error.run, STOPPED
    words = Path(source).stem if folder.suffix == ".toml" else source
    return run, Path(re.sub(r"[^\w.-]+", "-", words).strip("-.") or "run"), code
