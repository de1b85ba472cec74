"""Quantities of the group over time: spread of velocities, connectivity, closest pair, links created and lost."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array, Indices, Links, Reals, Records
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.graphs.connectivity import components
from flocking.model.observables import closest_pair, link_length_deviation
from flocking.model.space import Space
from flocking.model.state import State
from flocking.show.frames import need_velocities
from flocking.show.motion import motion_of, thinned
from flocking.show.plane import pairs_of
from flocking.show.series import time_axis
from flocking.show.style import BLUE, COLUMN, GREEN, ORANGE, PURPLE, SKY, VERMILION, axes_or_new, in_style, theme
from flocking.study.nets.winding import winding

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.ticker import Locator

MOST_FOR_SPECTRUM = 600
"""Largest group whose algebraic connectivity is computed for a picture."""

FEW = 100
"""Largest group whose closest pair is found by comparing all pairs; a tree is faster for larger ones."""

AT_ONCE = 1_000_000
"""Number of pairs compared at once; their offsets fit into the cache of a processor."""


@in_style
def spread(run: Run, *, axes: Axes | None = None) -> Axes:
    """Spread of the velocities over time on a logarithmic scale: the largest and the mean-square deviation.

    Deviations are those from the velocity of the centre of mass.

    Parameters
    ----------
    run
        The run.
    axes
        Axes to draw on; a new figure by default.

    Raises
    ------
    InvalidInput
        For agents of order 1, which have no velocities of their own.
    """
    need_velocities("spread", run)
    motion = motion_of(run)
    masses = np.asarray(run.scenario.agents.masses, dtype=np.float64)
    means = np.einsum("i,fik->fk", masses / masses.sum(), motion.p) if np.ptp(masses) else motion.p.mean(axis=1)
    away = np.linalg.norm(motion.p - means[:, None], axis=2)
    axes = axes_or_new(axes)
    # A logarithmic axis cannot show zero.
    curves = [(away.max(axis=1), BLUE, "largest"), (np.sqrt((away**2).mean(axis=1)), ORANGE, "root mean square")]
    for values, color, label in curves:
        t, shown = thinned(motion.t, values)
        axes.plot(t, np.where(shown > 0, shown, np.nan), color=color, label=label)
    axes.set_ylabel(r"$|p_i - \bar{p}|$")
    if (away > 0).any():
        axes.set_yscale("log")
        axes.legend()
    return time_axis(axes, run.t)


@in_style
def connectivity(run: Run, *, axes: Axes | None = None) -> Axes:
    """Algebraic connectivity and number of flocks over the frames, the latter on its own axis.

    In periodic space a dashed line counts the flocks that wind around it, see `flocking.winding`.

    Parameters
    ----------
    run
        The run. One-way links count half; beyond 600 agents only the flocks are counted. Of a run that keeps no links
        those are counted that it observed.
    axes
        Axes to draw on; a new figure by default.

    Raises
    ------
    InvalidInput
        When the run kept no links and observed none.
    """
    kept = _keeps_links(run)
    seen = None if kept else _observed("connectivity", run)
    axes = axes_or_new(axes)
    matrices = [run.links_at(k) for k in range(len(run.t))] if kept else []
    flocks = (
        np.array([int(components(links).max()) + 1 for links in matrices])
        if seen is None
        else np.asarray(seen["flocks"], dtype=np.intp)
    )
    t = run.t if seen is None else np.asarray(seen["time"], dtype=np.float64)
    counts = axes.twinx() if kept and 1 < run.n <= MOST_FOR_SPECTRUM else axes
    if counts is not axes:
        values = _fiedler_values(matrices, flocks)
        axes.plot(run.t, values, color=BLUE, gid="algebraic connectivity")
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel(r"$\lambda_2$", color=BLUE)
        counts.spines["right"].set_visible(True)
    counts.step(t, flocks, where="post", color=VERMILION, lw=1.0, gid="flocks", label="flocks")
    if kept and not run.scenario.space.is_open:
        wound = [
            int(winding(links, q, run.scenario.space).any(axis=1).sum())
            for links, q in zip(matrices, run.q, strict=True)
        ]
        counts.step(run.t, wound, where="post", color=VERMILION, lw=1.0, ls="--", gid="winding", label="winding around")
        counts.legend()
    counts.set_ylim(0, int(flocks.max()) + 1)
    counts.yaxis.set_major_locator(_integer_locator())
    counts.set_ylabel("flocks", color=VERMILION)
    return time_axis(axes, t)


@in_style
def lattice(run: Run, *, axes: Axes | None = None) -> Axes:
    """Deviation of the lengths of links from their mean, relative to it, over the frames: zero in a lattice.

    In periodic space links lead to nearest images.

    Parameters
    ----------
    run
        The run. Frames without links have no point. Of a run that keeps no links those are measured that it observed.
    axes
        Axes to draw on; a new figure by default.

    Raises
    ------
    InvalidInput
        When the run kept no links and observed none.
    """
    seen = None if _keeps_links(run) else _observed("lattice", run)
    axes = axes_or_new(axes)
    if seen is not None:
        axes.plot(seen["time"], seen["defect"], color=BLUE, gid="link length deviation")
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel("deviation of link lengths")
        return time_axis(axes, seen["time"])
    values = [link_length_deviation(run.q[k], run.links_at(k), run.scenario.space) for k in range(len(run.t))]
    axes.plot(run.t, values, color=BLUE, gid="link length deviation")
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("deviation of link lengths")
    return time_axis(axes, run.t)


@in_style
def closest(run: Run, *, axes: Axes | None = None) -> Axes:
    """Distance of the closest pair over the frames, with the run's certified minima marked.

    Parameters
    ----------
    run
        The run; at least two agents.
    axes
        Axes to draw on; a new figure by default.

    Raises
    ------
    InvalidInput
        If there is only one agent.
    """
    if run.n < 2:
        raise InvalidInput("closest", "run", "must have at least two agents", run.n)
    axes = axes_or_new(axes)
    motion = motion_of(run)
    at = "at the frames" if run.fine is None else "of the solution"
    axes.plot(*thinned(motion.t, _nearest(motion.q, run.scenario.space)), color=BLUE, label=at, gid="frames")
    for found, marker, name in ((run.closest_linked, "v", "linked"), (run.closest_unlinked, "^", "not linked")):
        if np.isfinite(found.distance):
            pair = f"{found.pair[0]}–{found.pair[1]}"
            axes.plot(found.time, found.distance, marker, color=VERMILION if name == "linked" else GREEN, ms=5,
                      ls="none", clip_on=False, zorder=4, label=f"closest {name}: {found.distance:.3g} ({pair})",
                      gid=f"certified {name}")  # fmt: skip
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel(r"$\min\,|q_i - q_j|$")
    axes.legend()
    return time_axis(axes, run.t)


@in_style
def links(run: Run, *, axes: Axes | None = None) -> Axes:
    """Number of linked pairs over the frames, with marks for links created and lost between them.

    Two agents that see each other are one pair; where links are one-way, the marks count each direction, and so does
    the number of a run that keeps no links, "one-way links" then.

    Parameters
    ----------
    run
        The run. Of one that does not record when links switch the number alone is drawn, and of one that keeps no links
        that which it observed.
    axes
        Axes to draw on; a new figure by default.

    Raises
    ------
    InvalidInput
        When the run kept no links and observed none.
    """
    seen = None if _keeps_links(run) else _observed("links", run)
    one_way = run.scenario.law.graph.directed
    axes = axes_or_new(axes)
    if seen is None:
        t, counts = run.t, [len(pairs_of(run.links_at(k))) for k in range(len(run.t))]
    else:
        t, counts = seen["time"], np.rint(seen["neighbours"] * run.n / (1 if one_way else 2)).astype(int).tolist()
    axes.step(t, counts, where="post", color=theme().ink, lw=1.0, gid="count")
    top = max([1, *counts])
    axes.set_ylim(-0.12 * top, 1.08 * top)
    axes.yaxis.set_major_locator(_integer_locator())
    axes.set_ylabel("linked pairs" if seen is None or not one_way else "one-way links")
    if not run.fidelity.switches_located:
        axes.set_title("switches not recorded", fontsize="x-small", loc="right")
        return time_axis(axes, t)
    for kind, color, word, low in (("appear", GREEN, "made", 0.04), ("break", VERMILION, "lost", 0.0)):
        times = np.unique(_switch_times(run, kind, one_way), axis=0)[:, 0]
        said = f"{len(times)} {word}{', one-way' * one_way}"
        axes.vlines(times, low, low + 0.035, transform=axes.get_xaxis_transform(), colors=color, lw=0.8, label=said,
                    gid=word)  # fmt: skip
    axes.legend(loc="center right", handlelength=1.0)
    return time_axis(axes, t)


def _keeps_links(run: Run) -> bool:
    return run.links.shape[1:] == (run.n, run.n) and len(run.t) > 0


def _observed(kind: str, run: Run) -> Records:
    """What a run observed that kept no links.

    Raises
    ------
    InvalidInput
        When it observed nothing.
    """
    if run.observables is None or not len(run.observables):
        raise InvalidInput(
            kind, "run", "must keep the links of its frames, or observe them", f"a run of {run.n} agents without links",
            "Large groups keep none: simulate it with engine='tiles' and observe=True (--observe).",
        )  # fmt: skip
    return run.observables


@in_style
def energy(run: Run, *, axes: Axes | None = None) -> Axes:
    """The energy ledger over time, with its residual on a separate axis below.

    Parameters
    ----------
    run
        The run.
    axes
        Axes to draw on; a new figure by default. The residual is drawn on the figure's next axes.
    """
    axes = axes_or_new(axes, width=COLUMN, height=0.9 * COLUMN)
    trace = run.trace
    name = run.scenario.energy.name
    for field, label, color, line in (
        ("energy", f"energy ${name}$", BLUE, "-"), ("kinetic", "kinetic", SKY, "-"),
        ("dissipated", "dissipated", VERMILION, "--"), ("supplied", "supplied", GREEN, "-."),
        ("jumped", "jumps at switches", ORANGE, ":"), ("departed", "departed from the law", PURPLE, (0, (5, 1))),
    ):  # fmt: skip
        if field in ("energy", "kinetic", "dissipated") or np.any(trace[field] != 0):
            axes.plot(trace["time"], trace[field], color=color, ls=line, label=label, gid=field)
    axes.legend(ncols=2)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.25 * (high - low))
    axes.set_ylabel("energy")
    axes.tick_params(labelbottom=False)
    below = _axes_below(axes)
    below.axhline(0.0, color=theme().faint, lw=0.6)
    residual = run.residual if len(trace) else trace["energy"]
    below.plot(trace["time"], residual, color=theme().ink, lw=0.8, gid="residual")
    below.ticklabel_format(axis="y", style="sci", scilimits=(-2, 2))
    below.yaxis.get_offset_text().set_fontsize(6)
    below.set_ylabel("residual")
    times = trace["time"] if len(trace) else run.t
    time_axis(below, times)
    time_axis(axes, times)
    axes.set_xlabel("")
    return axes


def _axes_below(axes: Axes) -> Axes:
    """New axes below given ones, within the area of those."""
    place = axes.get_subplotspec()
    if place is None:
        return axes.inset_axes((0.0, -0.42, 1.0, 0.3))
    halves = place.subgridspec(2, 1, height_ratios=(3, 1))
    axes.set_subplotspec(halves[0])
    return axes.figure.add_subplot(halves[1])


def _integer_locator() -> Locator:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(6, integer=True)


def _switch_times(run: Run, kind: str, one_way: bool) -> Array:
    """Times and pairs of the switches of a kind of the law's graph, each pair or one-way link once, shape (K, 3)."""
    chosen = run.switches[(run.switches["kind"] == kind) & (run.switches["graph"] == 0)]
    first, second = chosen["i"], chosen["j"]
    if not one_way:
        first, second = np.minimum(first, second), np.maximum(first, second)
    return np.stack([chosen["time"], first, second], axis=1).astype(np.float64)


def _nearest(q: Reals, space: Space) -> Array:
    """Distance of the closest pair in each frame, shape (F,); ``q`` has shape (F, N, m)."""
    frames, n, _ = q.shape
    if n > FEW:
        return np.array([closest_pair(State(x, np.zeros_like(x)), space)[0] for x in q])
    first, second = np.triu_indices(n, 1)
    parts = np.array_split(q, max(1, frames * len(first) // AT_ONCE))
    return np.concatenate(
        [np.linalg.norm(space.displacement(x[:, first] - x[:, second]), axis=2).min(axis=1) for x in parts]
    )


def _fiedler(links: Links) -> float:
    from scipy.linalg import eigvalsh

    weights = (links.astype(np.float64) + links.T) / 2
    laplacian = np.diag(weights.sum(axis=1)) - weights
    return float(max(eigvalsh(laplacian, subset_by_index=(1, 1), check_finite=False)[0], 0.0))


def _fiedler_values(matrices: Sequence[Links], flocks: Indices) -> list[float]:
    """Algebraic connectivity of each frame: 0 of several flocks, and of links that did not change that of the last."""
    found: list[float] = []
    for k, (links, count) in enumerate(zip(matrices, flocks, strict=True)):
        if count > 1:
            found.append(0.0)
        elif k and np.array_equal(links, matrices[k - 1]):
            found.append(found[-1])
        else:
            found.append(_fiedler(links))
    return found
