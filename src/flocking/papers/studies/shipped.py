"""The shipped studies by name: their sweep files and their pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from flocking.errors import InvalidInput

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from flocking.study.sweeps.sweep_file import SweepFile
    from flocking.study.sweeps.table import SweepTable


@dataclass(frozen=True)
class Study:
    """A sweep in the library.

    Parameters
    ----------
    name
        Its name, and that of its file.
    title
        Its question.
    draw
        Draws its results.
    """

    name: str
    title: str
    draw: Callable[[SweepTable], Figure]

    @property
    def text(self) -> str:
        """Its sweep file."""
        return files("flocking.papers.studies").joinpath(f"{self.name}.toml").read_text(encoding="utf-8")

    def plan(self, most_runs: int | None = None) -> SweepFile:
        """Read its sweep file.

        Parameters
        ----------
        most_runs
            Largest number of runs allowed; 100,000 by default.
        """
        from flocking.papers.sweep_scenarios import sweep_scenarios
        from flocking.study.sweeps.plan import MOST_RUNS
        from flocking.study.sweeps.sweep_file import parse_sweep

        return parse_sweep(
            self.text, sweep_scenarios(), source=f"{self.name}.toml", name=self.name, most_runs=most_runs or MOST_RUNS
        )  # fmt: skip

    def stored(self) -> SweepTable:
        """Results of `run` that are stored in the library; the record contains the versions."""
        from flocking.study.sweeps.sweep import read_sweep

        return read_sweep(Path(__file__).parent / "results" / self.name)

    def run(
        self, out: str | Path | None = None, *, workers: int | None = None, cluster: str | None = None,
        progress: bool = True,
    ) -> SweepTable:  # fmt: skip
        """Run the sweep; runs that are already stored in ``out`` are skipped.

        Parameters
        ----------
        out
            Folder of the results.
        workers, cluster, progress
            As for `flocking.study.sweeps.sweep.sweep`.
        """
        from flocking.papers.studies.running import run_file

        return run_file(self.plan(), out, workers=workers, cluster=cluster, progress=progress)


def study(name: str) -> Study:
    """A shipped study.

    Raises
    ------
    InvalidInput
        If there is none of that name.
    """
    from flocking.model.parts.values import nearest

    if name not in STUDIES:
        raise InvalidInput("studies", "name", "must be a shipped study", name, nearest(name, STUDIES))
    return STUDIES[name]


def _tanner(table: SweepTable) -> Figure:
    from flocking.show.sheet import sheet
    from flocking.show.sweep_pictures import bands, share_map

    count = table.plan.runs_per_point
    return sheet(
        [
            lambda axes: share_map(
                table, "connected", "speed", "start_radius", x_label="largest initial speed",
                y_label="radius of the start", title=f"share staying connected, of {count}", axes=axes,
            ),
            lambda axes: bands(
                table, "connected", "start_radius", by="speed", x_label="radius of the start",
                y_label="share staying connected", axes=axes,
            ),
        ],
        columns=2, ratio=0.8,
    )  # fmt: skip


def _olfati_saber(table: SweepTable) -> Figure:
    from flocking.papers.sweep_scenarios import OBSTACLE_AREA
    from flocking.show.style import figure_of
    from flocking.show.sweep_pictures import bands

    def region(length: object) -> str:
        return f"{length:g} × {OBSTACLE_AREA / length:.3g}" if isinstance(length, int | float) else str(length)

    axes = bands(
        table, "density", "tracking_gain", by="length", x_label="tracking gain $c_2$",
        y_label="density (7) after the obstacles", runs=True,
        shown=region,
    )  # fmt: skip
    axes.set_xscale("log")
    gains = [gain for gain in table.plan.grid["tracking_gain"] if isinstance(gain, int | float)]
    axes.set_xticks(gains, [f"{gain:g}" for gain in gains], minor=False)
    axes.minorticks_off()
    axes.axhline(0.97, color="0.5", lw=0.8, ls="--")
    axes.text(gains[0], 0.97, "printed: 0.97", va="bottom", fontsize=6)
    if (legend := axes.get_legend()) is not None:
        legend.set_title("start region")
    return figure_of(axes)


def _shi(table: SweepTable) -> Figure:
    from flocking.show.sheet import sheet
    from flocking.show.sweep_pictures import bands

    count = "agents that know the velocity, of 10"
    return sheet(
        [
            lambda axes: bands(table, "following_time", "informed", x_label=count, runs=True,
                               y_label="time until all follow (if they do)", axes=axes),
            lambda axes: bands(table, "following", "informed", x_label=count,
                               y_label="share that follow within 100 s", axes=axes),
        ],
        columns=2, ratio=0.75,
    )  # fmt: skip


def _zhou(table: SweepTable) -> Figure:
    from flocking.show.sheet import sheet
    from flocking.show.sweep_pictures import against

    measured = "closest linked pair, measured"
    return sheet(
        [
            lambda axes: against(table, "certified_closest", "closest_linked", by="side", y_label=measured,
                                 x_label="certified by (16)-(18)", axes=axes),
            lambda axes: against(table, "certified_by_links", "closest_linked", by="side", y_label=measured,
                                 x_label="certified by the energy supplied", axes=axes),
        ],
        columns=2, ratio=0.85,
    )  # fmt: skip


STUDIES = {
    study.name: study
    for study in (
        Study("tanner-connectivity", "the chance of staying connected against start density and speed", _tanner),
        Study(
            "olfati-saber-density", "density after the obstacles against start region and tracking gain", _olfati_saber
        ),
        Study("shi-informed", "time until all follow the leader against the number of informed agents", _shi),
        Study("zhou-bound", "certified energy bound against the measured closest pair", _zhou),
    )
}
"""The shipped studies by name."""
