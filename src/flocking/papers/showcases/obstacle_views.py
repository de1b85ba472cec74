"""Stored summary of a run past obstacles by any engine: densities at several times, and pictures of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import AnyArray
from flocking.engine.runs.run import Run
from flocking.model.checks import Array
from flocking.model.law import Scenario
from flocking.model.leaders_and_obstacles.obstacles import Ball
from flocking.model.terms.avoidance import Avoid
from flocking.papers.olfati_saber_2003.system import DISTANCE, RADIUS
from flocking.papers.showcases.files import showcase_scenario
from flocking.papers.showcases.stored_summary import StoredSummary, packed, unpacked
from flocking.study.density_maps import DensityMap, density_map
from flocking.study.hexatic_order import largest_share

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LATTICE = 2.0 / (np.sqrt(3.0) * DISTANCE**2)
"""Agents per unit of area in the lattice of spacing d_alpha."""
SCALE_LABEL = r"density, in lattices of spacing $d_\alpha$"
COLUMN = 3.6
"""Width of a panel."""
ONE_ROW = 1.04
"""Height of a row that stands alone, by that of others, which share what is left over: with less its titles are cut."""
LATE = 0.9
"""Fraction of the median speed below which an agent at the end counts as late: it is still passing an obstacle."""
SAMPLE = 200
"""Number of agents whose positions are stored with all digits, so that runs can be compared."""
FASTEST = 12.0
"""Upper end of the scale of speeds."""


@dataclass(frozen=True)
class CloseView:
    """A window in which single agents are drawn.

    Parameters
    ----------
    time
        The time.
    low, high
        Its corners.
    """

    time: float
    low: tuple[float, float]
    high: tuple[float, float]


@dataclass(frozen=True)
class ObstacleViews:
    """Times and windows of the pictures of a run past round obstacles.

    Parameters
    ----------
    name
        Name of the showcase.
    centres
        Centre of the picture for each time.
    size
        Width and height of the pictures.
    cell
        Side of a cell of the maps.
    ratio
        Height of a panel over its width.
    close
        Window in which single agents are drawn.
    """

    name: str
    centres: Mapping[float, tuple[float, float]] = field(default_factory=dict)
    size: tuple[float, float] = (1.0, 1.0)
    cell: float = 1.0
    ratio: float = 0.8
    close: CloseView | None = None

    def keep(self, run: Run) -> StoredSummary:
        """The summary of a run, which may have ended early."""
        balls = np.array([[*ball.centre.at(0.0)[0], ball.radius] for ball in balls_of(run.scenario)])
        near = [surface_distances(q, balls) for q in run.q]
        flocks = [largest_share(q, RADIUS) for q in run.q]
        speeds = np.linalg.norm(run.p[-1], axis=1)
        drawn = [t for t in self.centres if np.abs(run.t - t).min() < 1e-6]
        made = {t: self.view(run.q[_frame(run, t)], t) for t in drawn}
        facts: dict[str, object] = {
            "times": [float(t) for t in run.t],
            "clearance": [float(d.min()) for d in near],
            "inside": [int((d < 0).sum()) for d in near],
            "mean_speed": [float(np.linalg.norm(p, axis=1).mean()) for p in run.p],
            "late": int((speeds < LATE * np.median(speeds)).sum()),
            "flocks": [count for count, _ in flocks],
            "largest": [share for _, share in flocks],
            "views": drawn,
            "densest": [float(one.values.max() / LATTICE) for one in made.values()],
        }
        arrays: dict[str, AnyArray] = {f"density_{t:g}": packed(one.values / LATTICE) for t, one in made.items()}
        every = max(1, run.n // SAMPLE)
        arrays |= {f"sample_{t:g}": run.q[_frame(run, t), ::every] for t in drawn}
        if self.close is not None and np.abs(run.t - self.close.time).min() < 1e-6:
            at = _frame(run, self.close.time)
            arrays |= self._close(self.close, run.q[at], run.p[at])
        return StoredSummary(facts, arrays)

    def view(self, q: Array, t: float) -> DensityMap:
        """Density in the picture at one of the times."""
        low = self._corner(t)
        return density_map(q, low=low, high=low + np.array(self.size), cell=self.cell, blur=DISTANCE)

    def stored(self, summary: StoredSummary, t: float) -> DensityMap:
        """The same from the summary, relative to the density of the lattice."""
        values, low = unpacked(summary.arrays[f"density_{t:g}"]), self._corner(t)
        return DensityMap(values, low, low + self.cell * np.array(values.shape[::-1]))

    def draw(self, summary: StoredSummary) -> Figure:
        """Densities at the stored times, and single agents among obstacles at one of them."""
        panels = [self._panel(summary, t, f"$t = {t:g}$") for t in summary.facts["views"]]
        if self.close is not None and "close_place" in summary.arrays:
            close = self.close
            panels.append(lambda axes: self._draw_close(close, summary, axes))
        return self._sheet(panels, 2)

    def strip(self, summary: StoredSummary, times: Sequence[float]) -> Figure:
        """Densities of a ``summary`` at some of its times, side by side."""
        panels = [self._panel(summary, t, f"$t = {t:g}$") for t in times]
        return self._sheet(panels, len(times), letters=False, higher=ONE_ROW)

    def beside(self, summary: Mapping[str, StoredSummary]) -> Figure:
        """The same times of runs of several engines, one row each.

        Parameters
        ----------
        summary
            Summaries by the name of the engine.
        """
        times = [t for t in self.centres if all(t in one.facts["views"] for one in summary.values())]
        panels = [self._panel(one, t, f"{engine}, $t = {t:g}$") for engine, one in summary.items() for t in times]
        return self._sheet(panels, len(times), letters=False)

    def difference(self, one: StoredSummary, other: StoredSummary, t: float) -> float:
        """Fraction of the agents in view that must move to make two densities equal.

        Parameters
        ----------
        one, other
            Summaries of the two runs.
        """
        a, b = (self.stored(summary, t).values for summary in (one, other))
        return float(np.abs(a - b).sum() / (a.sum() + b.sum()))

    def parting(self, one: StoredSummary, other: StoredSummary, t: float) -> float:
        """Largest distance between the positions of an agent in two runs, over agents with stored positions.

        Parameters
        ----------
        one, other
            Summaries of the two runs.
        """
        offset = one.arrays[f"sample_{t:g}"] - other.arrays[f"sample_{t:g}"]
        return float(np.linalg.norm(offset, axis=1).max())

    def _corner(self, t: float) -> Array:
        return np.array(self.centres[t]) - np.array(self.size) / 2

    def _sheet(
        self, panels: list[Callable[[Axes], Axes]], columns: int, *, letters: bool = True, higher: float = 1.0
    ) -> Figure:
        from flocking.show.density import SPAN, scale
        from flocking.show.sheet import sheet

        made = sheet(panels, columns=columns, width=COLUMN * columns, ratio=higher * self.ratio, letters=letters)
        axes = made.axes[: len(panels)]
        scale(made, axes[0].images[0], axes, *SPAN, label=SCALE_LABEL)
        return made

    def _panel(self, summary: StoredSummary, t: float, title: str) -> Callable[[Axes], Axes]:
        from flocking.show.density import density

        balls = balls_of(showcase_scenario(self.name, agents=1))
        return lambda axes: density(
            self.stored(summary, t), axes=axes, unit=RADIUS, unit_name="r", reference=1.0, obstacles=balls, bar=False,
            title=title,
        )  # fmt: skip

    def _close(self, close: CloseView, q: Array, p: Array) -> dict[str, AnyArray]:
        share = (q - close.low) / (np.array(close.high) - close.low)
        inside = ((share >= 0) & (share < 1)).all(axis=1)
        speed = np.linalg.norm(p[inside], axis=1) / FASTEST
        return {
            "close_place": np.rint(65535 * share[inside]).astype(np.uint16),
            "close_speed": np.rint(255 * np.minimum(speed, 1.0)).astype(np.uint8),
        }

    def _draw_close(self, close: CloseView, summary: StoredSummary, axes: Axes) -> Axes:
        from flocking.show.density import GROUND, STONE, STONE_EDGE

        low, high = np.array(close.low) / RADIUS, np.array(close.high) / RADIUS
        place = low + (high - low) * summary.arrays["close_place"] / 65535.0
        axes.set_facecolor(GROUND)
        dots = axes.scatter(
            place[:, 0], place[:, 1], c=summary.arrays["close_speed"] * FASTEST / 255.0, s=3.0, lw=0, cmap="viridis",
            vmin=0.0, vmax=FASTEST, gid="agents",
        )  # fmt: skip
        for ball in balls_of(showcase_scenario(self.name, agents=1)):
            axes.fill(*(ball.outline(181).T / RADIUS), facecolor=STONE, edgecolor=STONE_EDGE, lw=0.5)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="$x/r$", ylabel="$y/r$")
        axes.set_title(f"speeds, 0 to {FASTEST:g}, $t = {close.time:g}$")
        bar = axes.figure.colorbar(dots, cax=axes.inset_axes((0.0, -0.022, 1.0, 0.022)), orientation="horizontal")
        bar.set_ticks([])
        bar.outline.set_visible(False)
        axes.tick_params(axis="x", pad=8)
        return axes


def balls_of(scenario: Scenario) -> list[Ball]:
    """The round obstacles of a scenario."""
    terms = [term for term in scenario.law.body_terms if isinstance(term, Avoid)]
    return [o for term in terms for o in term.obstacles if isinstance(o, Ball)]


def surface_distances(q: Array, balls: Array) -> Array:
    """Distance of every agent to the nearest surface, negative inside.

    Parameters
    ----------
    q
        Positions, shape (N, 2).
    balls
        Centre and radius of each ball, shape (K, 3).
    """
    nearest = np.full(len(q), np.inf)
    for x, y, radius in balls:
        np.minimum(nearest, np.hypot(q[:, 0] - x, q[:, 1] - y) - radius, out=nearest)
    return nearest


def _frame(run: Run, t: float) -> int:
    return int(np.argmin(np.abs(run.t - t)))
