"""Cost of films and of the picture of connectivity, in processor seconds and in seconds that passed.

    python benchmarks/pictures.py [--agents 1000] [--frames 201] [--repeat 3] [--json FILE]

A film of a group whose axes stay, one that follows the group, and one whose agents are coloured by their speed, each as
MP4 where ffmpeg is there, else as GIF; and the connectivity of 150 agents at 201 frames. The run is made before and not
counted.
Processor seconds count this process and ffmpeg: on a machine that others share they say more than the time that passed.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import flocking as fk
from flocking.show.animate import ffmpeg

SPACING = 1.0
"""Distance of neighbours in the start, in units of the distance that the potential prefers."""


def measured(what: Callable[[], object]) -> tuple[float, float]:
    """Processor seconds of this process and its children, and the seconds that passed."""

    def used() -> float:
        both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
        return sum(each.ru_utime + each.ru_stime for each in both)

    begin, before = time.perf_counter(), used()
    what()
    return used() - before, time.perf_counter() - begin


def group(agents: int, frames: int) -> fk.Run:
    """A group at the density of a lattice, with links to about eleven neighbours."""
    law = fk.Law(fk.Proximity(1.9 * SPACING), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(1.0)])
    start = fk.start.hexagonal(agents, spacing=SPACING, noise=0.1, speed=0.5, seed=1)
    # The engine for large groups keeps no matrix of links; these belong to the film that was asked for.
    return fk.simulate(fk.Scenario(law, start, t_end=4.0, frames=frames), engine="exact", progress=False)


def main() -> None:
    """Measure, print, and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", type=int, default=1000)
    parser.add_argument("--frames", type=int, default=201)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    found: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        run = group(given.agents, given.frames)
        small = group(150, given.frames)
        ending = "mp4" if ffmpeg() else "gif"
        film = Path(folder) / f"film.{ending}"
        cases: dict[str, Callable[[], object]] = {
            f"film ({ending})": lambda: fk.animate(run, film, progress=False),
            f"film that follows the group ({ending})": lambda: fk.animate(run, film, follow=True, progress=False),
            f"film coloured by speed ({ending})": lambda: fk.animate(run, film, color="speed", progress=False),
            "connectivity of 150 agents": lambda: fk.plot(small, "connectivity", save_as=Path(folder) / "c.png"),
        }
        print(f"{given.agents} agents, {given.frames} frames, {int(run.links[0].sum()) // 2} links in the first")
        for name, case in cases.items():
            rows = [measured(case) for _ in range(given.repeat)]
            processor, passed = [round(p, 2) for p, _ in rows], [round(s, 2) for _, s in rows]
            print(f"{name:45} processor {min(processor):6.2f} to {max(processor):6.2f} s, passed {min(passed):6.2f} s")
            found.append({"what": name, "processor": processor, "passed": passed})
    if given.json:
        about = {"processors": os.cpu_count(), "load": os.getloadavg(), "agents": given.agents, "frames": given.frames}
        given.json.write_text(json.dumps({**about, "rows": found}, indent=1))


if __name__ == "__main__":
    main()
