"""Components over time: positions, velocities and their errors, one line per agent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array, Reals
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.show.frames import checked_axis, dimension_name, leader_track, need_velocities, no_frames
from flocking.show.motion import motion_of, thinned
from flocking.show.style import PALETTE, RED, VERMILION, axes_or_new, in_style, theme

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROUNDING = 1e-9
"""Range of values below which they count as constant, relative to the numbers that they are made of: differences are
then rounding errors. It has no unit, so that small groups in large units are drawn as others are."""

HALF = 0.5
"""Half of the height of an axis whose curves are zero throughout, which have no scale of their own."""

MOST_VECTORS = 500
"""Lines up to which a picture keeps them as vectors: files of more are large and slow to open."""

LEADER_LINES = {"solid": "-", "dashed": (0, (5, 2)), "none": None}
AGENT_LINES: dict[str, object] = {"solid": "-", "dotted": (0, (1.0, 1.2))}
ABOUT = ("leader", "mean")


@in_style
def velocities(
    run: Run, axis: int = 0, *, axes: Axes | None = None, leader: str = "dashed", agents: str = "solid"
) -> Axes:
    """Velocity component of every agent over time (Zhou, Figs. 4, 5, 11, 12).

    Parameters
    ----------
    run
        The run.
    axis
        Which component.
    axes
        Axes to draw on; a new figure by default.
    leader
        Line of the leader, where the law has one: ``"dashed"``, ``"solid"`` or ``"none"``.
    agents
        Lines of the agents: ``"solid"`` or ``"dotted"``.

    Raises
    ------
    InvalidInput
        If the run has no such axis, its agents are of order 1, or the line is unknown.
    """
    need_velocities("velocities", run)
    axis = checked_axis(run, axis)
    label = f"$p_{{{dimension_name(axis)}}}$"
    return _components(run, motion_of(run).p[:, :, axis], 1, axis, label, axes, leader, agents)


@in_style
def positions(
    run: Run, axis: int = 0, *, axes: Axes | None = None, leader: str = "dashed", agents: str = "solid"
) -> Axes:
    """Position component of every agent over time (Zhou, Figs. 6, 7, 13, 14).

    Parameters
    ----------
    run
        The run.
    axis
        Which component.
    axes
        Axes to draw on; a new figure by default.
    leader
        Line of the leader, where the law has one: ``"dashed"``, ``"solid"`` or ``"none"``.
    agents
        Lines of the agents: ``"solid"`` or ``"dotted"``.

    Raises
    ------
    InvalidInput
        If the run has no such axis or the line is unknown.
    """
    axis = checked_axis(run, axis)
    label = f"$q_{{{dimension_name(axis)}}}$"
    return _components(run, motion_of(run).q[:, :, axis], 0, axis, label, axes, leader, agents)


@in_style
def velocity_errors(run: Run, axis: int = 0, *, about: str | None = None, axes: Axes | None = None) -> Axes:
    """Velocity of every agent minus a reference over time (Shi, Figs. 4 to 12).

    Parameters
    ----------
    run
        The run.
    axis
        Which component.
    about
        ``"leader"``, or ``"mean"`` for the centre of mass; by default the leader if the law has one.
    axes
        Axes to draw on; a new figure by default.

    Raises
    ------
    InvalidInput
        If the run has no such axis, or no leader, or its agents are of order 1.
    """
    need_velocities("velocity_errors", run)
    axis = checked_axis(run, axis)
    about = about if about is not None else ("mean" if only_leader(run) is None else "leader")
    reference = _reference(run, about)[1][:, axis]
    name = dimension_name(axis)
    zero = f"v_{{0,{name}}}" if about == "leader" else rf"\bar{{p}}_{{{name}}}"
    axes = axes_or_new(axes)
    axes.axhline(0.0, color=theme().ink, lw=0.7, ls=LEADER_LINES["dashed"], gid="zero")
    motion = motion_of(run)
    values, label = motion.p[:, :, axis] - reference[:, None], f"$p_{{i,{name}}} - {zero}$"
    return agent_lines(axes, motion.t, values, label, scale=_largest(motion.p[:, :, axis], reference))


@in_style
def centre_errors(run: Run, *, quantity: str = "velocity", axes: Axes | None = None) -> Axes:
    """Centre of mass minus leader over time, one line per axis (Shi, panels c and d of Figs. 4 to 12).

    Parameters
    ----------
    run
        The run.
    quantity
        ``"velocity"`` or ``"position"``.
    axes
        Axes to draw on; a new figure by default.

    Raises
    ------
    InvalidInput
        If the run has no leader, the leader no position in closed form, the quantity is unknown, or it is the velocity
        of agents of order 1.
    """
    if quantity not in ("velocity", "position"):
        raise InvalidInput("centre_errors", "quantity", "must be 'velocity' or 'position'", quantity)
    which = int(quantity == "velocity")
    if which:
        need_velocities("centre_errors", run)
    error = _reference(run, "mean")[which] - _reference(run, "leader")[which]
    if not np.isfinite(error).all():
        raise InvalidInput("centre_errors", "quantity", "can be 'position' only if the leader's is known", quantity)
    axes = axes_or_new(axes)
    axes.axhline(0.0, color=theme().ink, lw=0.7, ls=LEADER_LINES["dashed"], gid="zero")
    t = motion_of(run).t
    for k in range(error.shape[1]):
        axes.plot(*thinned(t, error[:, k]), color=PALETTE[k % len(PALETTE)], label=f"${dimension_name(k)}$")
    # Above the axes, since curves may cover any place inside.
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=error.shape[1], borderaxespad=0.1)
    axes.set_ylabel(r"$\bar{p} - v_0$" if which else r"$\bar{q} - q_0$")
    return time_axis(axes, t)


def agent_lines(
    axes: Axes, t: Array, values: Reals, label: str, line: str = "solid", palette: Sequence[str] = PALETTE,
    *, scale: float = 0.0,
) -> Axes:  # fmt: skip
    """Draw a line per agent, ``values`` (F, N) called ``label``, as one collection with the gid ``agents``.

    Parameters
    ----------
    t
        Times, shape (F,).
    line
        ``"solid"`` or ``"dotted"``.
    palette
        Colours of the agents of a small group.
    scale
        Size of the numbers whose differences the values are: what is far smaller than these is drawn as rounding.
    """
    from matplotlib.collections import LineCollection

    n = values.shape[1]
    lines = [np.stack(thinned(t, values[:, k]), axis=1) for k in range(n)]
    # A few agents can be distinguished by hue; for a large group only the density is visible.
    few = n <= 3 * len(PALETTE)
    colors = [palette[k % len(palette)] for k in range(n)] if few else theme().agent
    axes.add_collection(
        LineCollection(
            lines, colors=colors, linewidths=1.0 if few else 0.6, linestyles=[AGENT_LINES[line]],
            alpha=1.0 if few else float(np.clip(12 / n, 0.06, 0.7)), gid="agents", rasterized=n > MOST_VECTORS,
        ),
        autolim=False,
    )  # fmt: skip
    _cover(axes, values, scale)
    axes.set_ylabel(label)
    return time_axis(axes, t)


def time_axis(axes: Axes, t: Array) -> Axes:
    """Label the horizontal axis as time and set its limits to the run.

    Raises
    ------
    InvalidInput
        When there is no time.
    """
    if not len(t):
        raise no_frames("no frames")
    low, high = float(t[0]), float(t[-1])
    axes.set_xlim(low, high if high > low else low + 1.0)
    axes.set_xlabel("$t$")
    return axes


def only_leader(run: Run) -> Leader | None:
    """First leader of the run's law, or None."""
    return next(iter(run.scenario.law.leaders), None)


def _components(
    run: Run, values: Reals, which: int, axis: int, label: str, axes: Axes | None, line: str, agents: str
) -> Axes:
    if agents not in AGENT_LINES:
        raise InvalidInput("show", "agents", f"must be one of {', '.join(AGENT_LINES)}", agents)
    if line not in LEADER_LINES:
        raise InvalidInput("show", "leader", f"must be one of {', '.join(LEADER_LINES)}", line)
    t = motion_of(run).t
    leader = only_leader(run) if line != "none" else None
    # The style of the leader's line differs from that of agents.
    palette = PALETTE if leader is None else tuple(color for color in PALETTE if color != VERMILION)
    axes = agent_lines(axes_or_new(axes), t, values, label, agents, palette)
    if leader is None:
        return axes
    track = leader_track(leader, t)[which][:, axis]
    if np.isfinite(track).all():
        axes.plot(*thinned(t, track), color=RED, lw=1.8, ls=LEADER_LINES[line], label="leader", gid="leader", zorder=4)
        _cover(axes, np.concatenate([values.ravel(), track]))
        axes.legend()
    return axes


def _cover(axes: Axes, values: Reals, scale: float = 0.0) -> None:
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    size = max(abs(low), abs(high), scale)
    # The limits must not magnify rounding errors.
    constant = high - low <= ROUNDING * size
    margin = HALF * (size or 1.0) if constant else 0.05 * (high - low)
    axes.set_ylim(low - margin, high + margin)


def _largest(*values: Reals) -> float:
    """Largest size of the finite numbers among arrays."""
    return max(float(np.abs(x[np.isfinite(x)]).max(initial=0.0)) for x in values)


def _reference(run: Run, about: str) -> tuple[Array, Array]:
    if about not in ABOUT:
        raise InvalidInput("show", "about", f"must be one of {', '.join(ABOUT)}", about)
    motion = motion_of(run)
    if about == "mean":
        masses = np.broadcast_to(np.asarray(run.scenario.agents.masses, dtype=np.float64), (run.n,))
        share = masses / masses.sum()
        return np.einsum("i,fik->fk", share, motion.q), np.einsum("i,fik->fk", share, motion.p)
    leader = only_leader(run)
    if leader is None:
        raise InvalidInput("show", "about", "can be 'leader' only if the law has one", about, "Use about='mean'.")
    return leader_track(leader, motion.t)
