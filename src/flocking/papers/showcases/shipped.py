"""The showcases by name: their runs, summaries, and stored results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.law import Scenario
from flocking.model.parts.seeds import SeedNumber, given_seed
from flocking.papers.showcases import flock_from_noise
from flocking.papers.showcases.files import TITLES, showcase_scenario
from flocking.papers.showcases.obstacle_views import CloseView, ObstacleViews
from flocking.papers.showcases.stored_summary import StoredSummary
from flocking.study.claims.audit import Report
from flocking.study.sweeps.equal_scenarios import run_digest

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESULTS = Path(__file__).parent / "results"
PROVENANCE = (
    "engine", "flocking", "numpy", "numba", "llvmlite", "lammps", "python", "machine", "step", "steps", "scheme",
    "precision", "ranks", "rebuilds",
)  # fmt: skip
"""Stored entries of a run's provenance, where present."""

FIELD_MIDDLES = {48.0: 438.0, 112.0: 1010.0, 168.0: 1480.0, 232.0: 2040.0, 320.0: 2900.0}
"""x of the centre of the flock at the times of the pictures."""

FIELD = ObstacleViews(
    "obstacle-field",
    centres={t: (x, 0.0) for t, x in FIELD_MIDDLES.items()},
    size=(2700.0, 2350.0),
    cell=6.0,
    close=CloseView(112.0, (1180.0, -560.0), (1500.0, -280.0)),
)
"""Pictures of the field of 60 obstacles, which follow the flock."""

SIX = ObstacleViews(
    "cluster-obstacles",
    centres=dict.fromkeys((10.0, 24.0, 50.0), (215.0, 20.0)),
    size=(480.0, 330.0),
    cell=2.0,
    ratio=0.7,
)
"""Pictures of the six obstacles, at the centre of the front of a wide band."""


@dataclass(frozen=True)
class Showcase:
    """A large run for the gallery.

    Parameters
    ----------
    name
        Its name, and that of its scenario file.
    step
        Time step of the run.
    keep
        Makes the summary of a run.
    draw
        Draws a summary.
    """

    name: str
    step: float
    keep: Callable[[Run], StoredSummary]
    draw: Callable[[StoredSummary], Figure]

    @property
    def title(self) -> str:
        """Its title."""
        return TITLES[self.name]

    def scenario(
        self, *, seed: int | None = None, agents: int | None = None, until: float | None = None,
        rng: SeedNumber | None = None,
    ) -> Scenario:  # fmt: skip
        """Its scenario.

        Parameters
        ----------
        seed
            Replaces the seed of its start.
        agents
            A smaller group, see `flocking.papers.showcases.files.showcase_scenario`.
        until
            An earlier end.
        rng
            Another name of ``seed``, which takes a `numpy.random.SeedSequence` too.

        Raises
        ------
        InvalidInput
            If the group would not be smaller, or the end is not between the start and the end of the scenario.
        """
        made = showcase_scenario(self.name, given_seed("scenario", seed, rng), agents)
        if until is None:
            return made
        if not made.start.t < until <= made.t_end:
            raise InvalidInput("showcase", "until", f"must be after {made.start.t:g}, at most {made.t_end:g}", until)
        earlier = [float(t) for t in made.frame_times if t < until - 1e-9]
        return made.with_(t_end=until, frames=(*earlier, until))

    def run(
        self,
        folder: Path,
        scenario: Scenario,
        *,
        engine: str = "tiles",
        progress: bool = True,
        threads: int | None = None,
    ) -> Run:
        """Run a scenario, or continue the run in ``folder``.

        Parameters
        ----------
        folder
            Folder of the run.
        scenario
            The scenario, if there is no run yet.
        engine
            ``"tiles"`` or ``"lammps"``, the latter also under ``mpiexec``.
        progress
            Whether to show progress.
        threads
            Threads of the tiled engine.

        Raises
        ------
        InvalidInput
            If ``folder`` contains a run of another scenario or of another engine.
        """
        from flocking.engine.driver.registry import engine_named
        from flocking.engine.driver.resuming import resume
        from flocking.engine.driver.simulate import simulate
        from flocking.engine.storage.record import engine_of
        from flocking.engine.storage.stored_runs import read_scenario_of

        if folder.exists() and any(folder.iterdir()):
            (found, _), (made_by, _) = read_scenario_of(folder), engine_of(folder)
            held = f"{found.name} with {found.start.n} agents until {found.t_end:g}, by {made_by}"
            digests = {run_digest(each, most_agents=np.inf) for each in (found, scenario)}
            if found.name != scenario.name or made_by != engine or len(digests) > 1:
                raise InvalidInput("showcase", "out", "must not contain another run", held, "Choose another folder.")
            return resume(folder, progress=progress)
        known = engine_named(engine)
        options: dict[str, Any] = dict(known.large_group_options)
        if "threads" in known.option_names:
            options["threads"] = threads
        return simulate(scenario, engine=engine, save=folder, progress=progress, step=self.step, **options)

    def summary_of(self, run: Run, report: Report) -> StoredSummary:
        """The summary of a run, with its audit and its origin.

        Parameters
        ----------
        report
            Its audit.
        """
        summary = self.keep(run)
        about = {name: run.provenance[name] for name in PROVENANCE if name in run.provenance}
        closest = run.closest
        facts: dict[str, object] = {
            "name": self.name, "agents": run.n, "status": run.status, "provenance": about,
            "audit": {r.claim.key: [str(r.verdict), r.note] for r in report.results},
        }  # fmt: skip
        if np.isfinite(closest.distance) and not run.fidelity.approaches.looked:
            facts["closest"] = {"distance": closest.distance, "time": closest.time}
        if len(run.trace):
            facts["ledger_share"] = float(np.abs(run.residual).max() / max(run.turnover, 1e-300))
        return StoredSummary({**summary.facts, **facts}, summary.arrays)

    def stored(self, engine: str = "tiles") -> StoredSummary:
        """The stored summary of a run at full size.

        Raises
        ------
        InvalidInput
            If there is none of such an engine.
        """
        path = RESULTS / f"{self.name}.{engine}.npz"
        if not path.is_file():
            raise InvalidInput("showcases", "engine", "must be an engine with a stored run", engine)
        return StoredSummary.read(path)


def showcase(name: str) -> Showcase:
    """A showcase by its name.

    Raises
    ------
    InvalidInput
        If there is none of that name.
    """
    from flocking.model.parts.values import nearest

    if name not in SHOWCASES:
        raise InvalidInput("showcase", "name", "must be a showcase", name, nearest(name, SHOWCASES))
    return SHOWCASES[name]


SHOWCASES = {
    one.name: one
    for one in (
        Showcase(FIELD.name, 0.03, FIELD.keep, FIELD.draw),
        Showcase(flock_from_noise.NAME, 0.05, flock_from_noise.keep, flock_from_noise.draw),
        Showcase(SIX.name, 0.02, SIX.keep, SIX.draw),
    )
}
"""The showcases by name."""
