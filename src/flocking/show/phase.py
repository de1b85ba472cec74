"""Phase portrait of one pair: its distance and its rate, with the potential."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.potentials.potential import Potential
from flocking.model.terms.pair_terms import Gradient
from flocking.show.frames import need_velocities, no_frames, time_of
from flocking.show.motion import motion_of
from flocking.show.style import BLUE, ORANGE, axes_or_new, in_style, theme

if TYPE_CHECKING:
    from matplotlib.axes import Axes


SAMPLES = 600
"""Distances of the potential's curve, chosen by eye: its bends show no corners."""


@in_style
def phase(run: Run, pair: tuple[int, int] | None = None, *, axes: Axes | None = None) -> Axes:
    """Draw (r, dr/dt) of a pair, with the law's potential in the background.

    Parameters
    ----------
    run
        The run; at least two agents.
    pair
        The two agents; by default the closest linked pair.
    axes
        Axes to draw on; a new figure by default. Values of the potential are on its twin axis.

    Raises
    ------
    InvalidInput
        If there is no such pair, or agents are of order 1.
    """
    need_velocities("phase", run)
    i, j = _checked_pair(run, pair)
    motion = motion_of(run)
    if not len(motion.t):
        raise no_frames(run.status)
    # In periodic space to the nearest image.
    apart = run.scenario.space.displacement(np.asarray(motion.q[:, j] - motion.q[:, i], dtype=np.float64))
    relative = motion.p[:, j] - motion.p[:, i]
    r = np.linalg.norm(apart, axis=1)
    rate = np.divide((apart * relative).sum(axis=1), r, out=np.full_like(r, np.nan), where=r > 0)
    axes = axes_or_new(axes)
    term = next((t for t in run.scenario.law.pair_terms if isinstance(t, Gradient)), None)
    low, high = float(r.min()), float(r.max())
    margin = 0.08 * (high - low) or 0.5
    low, high = max(low - margin, 0.0), high + margin
    if term is not None:
        law = run.scenario.law
        radius = float(np.max(law.graphs[law.graph_number(term)].break_radius))
        _well(axes, term.potential, low, high, radius)
    axes.axhline(0.0, color=theme().faint, lw=0.6)
    axes.plot(r, rate, color=BLUE, lw=1.1, zorder=3, gid="path")
    axes.plot(r[:1], rate[:1], "o", color=BLUE, mfc=theme().ground, ms=5, zorder=4, label="start")
    axes.plot(r[-1:], rate[-1:], "o", color=BLUE, ms=5, zorder=4, label=f"$t = {time_of(run, motion.t[-1])}$")
    axes.set_xlim(low, high)
    axes.set_xlabel(f"$r_{{{i},{j}}}$")
    axes.set_ylabel(r"$\dot{r}$")
    axes.legend()
    return axes


def _checked_pair(run: Run, pair: tuple[int, int] | None) -> tuple[int, int]:
    if run.n < 2:
        raise InvalidInput("phase", "run", "must have at least two agents", run.n)
    if pair is None:
        found = run.closest_linked if np.isfinite(run.closest_linked.distance) else run.closest
        pair = found.pair if np.isfinite(found.distance) else (0, 1)
    given = list(pair) if isinstance(pair, Iterable) else [pair]
    numbers = all(isinstance(k, int | np.integer) and not isinstance(k, bool) for k in given)
    if not numbers or len(set(given)) != 2 or len(given) != 2 or not all(0 <= k < run.n for k in given):
        raise InvalidInput("phase", "pair", f"must be two different agents of 0..{run.n - 1}", pair)
    return int(given[0]), int(given[1])


def _well(axes: Axes, potential: Potential, low: float, high: float, radius: float) -> None:
    r = np.linspace(low, high, SAMPLES)
    inside = r < radius
    if not inside.any():
        return
    values = np.where(inside, potential(r), np.nan)
    values[~np.isfinite(values)] = np.nan
    if np.isnan(values).all():
        return
    behind = axes.twinx()
    behind.set_zorder(axes.get_zorder() - 1)
    axes.patch.set_visible(False)
    bottom, top = float(np.nanmin(values)), float(np.nanquantile(values, 0.9))
    top = top if top > bottom else bottom + 1.0
    behind.fill_between(r, bottom, np.minimum(values, bottom + 4 * (top - bottom)), color=ORANGE, alpha=0.15, lw=0)
    behind.plot(r, values, color=ORANGE, lw=0.9, gid="potential")
    behind.set_ylim(bottom, bottom + 1.3 * (top - bottom))
    behind.spines["right"].set_visible(True)
    behind.set_ylabel(r"$\psi(r)$", color=ORANGE)
    if radius < high:
        behind.axvline(radius, color=theme().faint, lw=0.8, ls=":")
