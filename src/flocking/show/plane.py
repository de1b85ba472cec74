"""Nets in the plane and in space: agents as dots, links as segments, velocities as arrows, paths as dotted trails."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, TypedDict, Unpack, cast

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Links, Reals
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.checks import integer, number
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.space import OPEN, Space
from flocking.model.state import State
from flocking.show.agent_colors import DotLook, LineLook, net_colors
from flocking.show.frames import (
    Outlined,
    changed_later,
    checked_outlines,
    checked_window,
    frame_at,
    leaders_at,
    need_velocities,
    own_obstacles,
    time_of,
)
from flocking.show.motion import motion_of, thinned_path
from flocking.show.style import COLUMN, GREEN, OUTLINE_POINTS, PURPLE, VERMILION, axes_or_new, in_style, quivers, theme

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.ticker import Locator
    from mpl_toolkits.mplot3d import Axes3D

LINK_BUDGET, ARROW_BUDGET, TRAIL_BUDGET = 20_000, 2_500, 400
"""Largest numbers of links, arrows and trails drawn; of more, an even selection is drawn and noted on the axes."""

DIRECTION_SHARE = 0.045
"""Length of the line that shows where a body points, relative to the span of the picture: longer than half a dot."""

DIRECTION_COLORS = (VERMILION, GREEN)
"""Colours of the lines of the first and of the second direction of a body."""

TRAIL_STEPS = 1000
"""Smallest distance of the points of a path, relative to the span of the picture."""

ARROW_SHARE = 0.14
"""Length of the longest arrow, relative to the span of the picture, or for large groups to the spacing of agents."""

REST_SHARE = 0.04
"""Fraction of the run's highest speed below which arrows become shorter."""

MANY_LINES = 500
"""Segments from which they are drawn as one path; below, drawing them one by one takes a few milliseconds."""


class NetOptions(TypedDict, total=False):
    """Options of `net` besides the run, the frame and the axes, see there."""

    links: bool
    arrows: bool
    trails: bool
    obstacles: Sequence[Outlined] | None
    leader: bool | Leader
    color: str
    title: str | bool
    limits: tuple[Sequence[float], Sequence[float]] | None
    seconds_per_arrow: float | None
    fastest: float | None
    budget: int


@in_style
def net(
    what: Run | State,
    *,
    time: float | None = None,
    frame: int | None = None,
    axes: Axes | None = None,
    links: bool = True,
    arrows: bool = True,
    trails: bool = False,
    obstacles: Sequence[Outlined] | None = None,
    leader: bool | Leader = True,
    color: str = "plain",
    title: str | bool = True,
    limits: tuple[Sequence[float], Sequence[float]] | None = None,
    seconds_per_arrow: float | None = None,
    fastest: float | None = None,
    budget: int = LINK_BUDGET,
) -> Axes:
    """Draw a net at one time.

    Parameters
    ----------
    what
        A run, or a single state.
    time, frame
        Which stored frame of a run: the one nearest to ``time``, or its number; the last by default.
    axes
        Axes to draw on; a new figure by default. Agents in space need axes with ``projection="3d"``.
    links, arrows, trails
        Whether to draw links, velocities, and the paths up to that frame. In periodic space agents are drawn in the
        box, links in two halves, and no paths.
    obstacles
        Objects with a method ``outline(count)`` that gives points of shape (count, 2); drawn only in the plane. By
        default those of the run's law at that time, which do not extend the picture.
    leader
        True to draw the leaders of the run's law, a leader to draw that one, False for none.
    color
        ``"plain"``, ``"flock"``, ``"speed"`` or ``"heading"`` (angle of the velocity in its first two axes).
    title
        True for the time, a text, or False for none.
    limits
        Lowest and highest corner of the picture; by default they contain everything drawn.
    seconds_per_arrow
        Time whose displacement an arrow shows; by default chosen from the highest speed of the frame.
    fastest
        Speed at the end of the colours of ``color="speed"``; that of the fastest agent of the frame by default.
    budget
        Largest number of links to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes; agents have the label (gid) ``agents``, and so have ``links``, ``velocities`` and ``trails``. Where
        bodies point is drawn by short lines that have the names of the columns, such as ``heading``.

    Raises
    ------
    InvalidInput
        If the frame does not exist, the space has more than three dimensions, or axes do not fit.
    """
    budget = integer("net", "budget", budget, least=0)
    if fastest is not None:
        fastest = number("net", "fastest", fastest, least=0.0)
    if not isinstance(leader, bool | Leader):
        raise InvalidInput("net", "leader", "must be True, False or a leader", leader)
    state, past, top_speed = _choose(what, time, frame)
    m = state.dimension
    if m > 3:
        raise InvalidInput("net", "what", "must be in at most 3 dimensions", m, "Draw a projection of the state.")
    space = m == 3
    axes = axes_or_new(axes, width=COLUMN, height=COLUMN, projection="3d" if space else None)
    if space != (axes.name == "3d"):
        need = 'agents in space need projection="3d"' if space else 'agents in the plane need axes without "3d"'
        raise InvalidInput("net", "axes", "must fit the dimension of the agents", axes.name, f"{need}.")
    lives = what.scenario.space if isinstance(what, Run) else OPEN
    q, p = _lift(state.q if lives.is_open else lives.wrapped(state.q)), _lift(state.p)
    followed = [(_lift(x), _lift(v)) for x, v in leaders_at(what, state, leader)]
    top_speed = max([top_speed, *(float(np.linalg.norm(v)) for _, v in followed)])

    # A path that leaves the box would be drawn across the box.
    paths = _lift(past) if trails and len(past) > 1 and lives.is_open else None
    given = checked_outlines("net", obstacles) if obstacles is not None else []
    outlines = [] if space else [np.asarray(o.outline(OUTLINE_POINTS), dtype=np.float64) for o in given]
    found = own_obstacles(what) if obstacles is None else []
    own = [o.outline(OUTLINE_POINTS, state.t) for o in found] if m == 2 else []
    points = [
        q,
        *(x[None] for x, _ in followed),
        *outlines,
        *([] if paths is None else [paths.reshape(-1, q.shape[1])]),
    ]
    span = _span(points)
    if seconds_per_arrow is not None:
        seconds = number("net", "seconds_per_arrow", seconds_per_arrow, above=0.0)
    else:
        seconds = min(ARROW_SHARE, 1.0 / np.sqrt(state.n)) * span / top_speed if top_speed > 0 else 0.0
    if isinstance(what, Run) and color in ("speed", "heading"):
        need_velocities("net", what)
    notes = [f"{len(found)} obstacle{'s' * (len(found) > 1)} not drawn"] if found and m != 2 else []
    notes += changed_later(what, state.t) if own or followed else []
    for outline in (*outlines, *own):
        axes.fill(*outline.T, facecolor=theme().faint, edgecolor=theme().ink, alpha=0.45, lw=0.6, zorder=0.5)
    if paths is not None:
        _draw_trails(axes, paths, notes)
    elif trails and len(past) > 1:
        notes.append("no paths: space repeats")
    if links and state.links is not None:
        _draw_links(axes, q, state.links, lives, budget, notes)
    moving = arrows and seconds > 0
    if moving:
        points.append(_draw_arrows(axes, q, p, seconds, notes))
        points.extend((x + seconds * v)[None] for x, v in followed)
    net_colors(axes, q, p, state.links, color, _dot_size(state.n), fastest)
    names = what.scenario.agents.directions if isinstance(what, Run) else ()
    _draw_directions(axes, q, {name: state.columns[name] for name in names if name in state.columns}, span)
    for x, v in followed:
        _draw_leader(axes, x, v, seconds if moving else 0.0)
    _frame_axes(axes, points, limits)
    if m == 1:
        # Agents on a line have no other coordinate: that of the picture is none of theirs.
        axes.set_ylabel("")
        axes.set_yticks([])
    if title is not False:
        axes.set_title(f"$t = {time_of(what, state.t)}$" if title is True else title)
    draw_notes(axes, notes)
    return axes


def draw_notes(axes: Axes, notes: Sequence[str]) -> None:
    """Write what a picture leaves out in its lower left corner, where there is anything.

    Parameters
    ----------
    axes
        The axes.
    notes
        A line each.
    """
    if notes:
        axes.annotate("\n".join(notes), (0.02, 0.02), xycoords="axes fraction", fontsize=6, color=theme().ink,
                      va="bottom", gid="notes", zorder=9,
                      bbox={"facecolor": theme().ground, "edgecolor": "none", "alpha": 0.85, "pad": 1.5})  # fmt: skip


def pairs_of(links: Links) -> NDArray[np.intp]:
    """Pairs (i, j), i < j, that are linked in either direction, each once, shape (K, 2)."""
    i, j = links.nonzero()
    n = links.shape[0]
    keys = np.unique(np.minimum(i, j).astype(np.int64) * n + np.maximum(i, j))
    return np.stack([keys // n, keys % n], axis=1).astype(np.intp)


def _choose(what: Run | State, time: float | None, frame: int | None) -> tuple[State, Reals, float]:
    if isinstance(what, State):
        if time is not None or frame is not None:
            raise InvalidInput("net", "time", "must be absent for a single state", time if frame is None else frame)
        return what, what.q[None], float(np.linalg.norm(what.p, axis=1).max())
    if not isinstance(what, Run):
        raise InvalidInput("net", "what", "must be a Run or a State", what)
    k = frame_at(what, time, frame)
    speeds = np.sqrt(np.einsum("fnm,fnm->fn", what.p, what.p))
    # Slow agents have a visible arrow, but agents nearly at rest do not appear fast.
    return (
        what.state(k),
        motion_of(what.until(float(what.t[k]))).q,
        float(max(speeds[k].max(), REST_SHARE * speeds.max())),
    )


def _lift(x: Reals) -> Reals:
    """Two-dimensional positions: agents on a line are drawn on the horizontal axis."""
    return x if x.shape[-1] > 1 else np.concatenate([x, np.zeros_like(x)], axis=-1)


def _span(points: Sequence[Reals]) -> float:
    every = np.concatenate(points)
    width = float(np.ptp(every, axis=0).max())
    return width if width > 0 else 1.0


def _dot_size(n: int) -> float:
    return float(np.clip(26.0 * (10.0 / max(n, 10)) ** 0.6, 1.0, 26.0))


def _line_collection(axes: Axes, segments: Sequence[Reals] | Reals, **look: Unpack[LineLook]) -> None:
    if axes.name == "3d":
        from mpl_toolkits.mplot3d.art3d import Line3DCollection

        cast("Axes3D", axes).add_collection3d(Line3DCollection(segments, **look))
    elif isinstance(segments, np.ndarray) and segments.shape[1:] == (2, 2) and len(segments) >= MANY_LINES:
        axes.add_collection(_as_one_path(segments, **look), autolim=False)
    else:
        from matplotlib.collections import LineCollection

        axes.add_collection(LineCollection(list(segments), **look), autolim=False)


def _as_one_path(ends: Reals, **look: Unpack[LineLook]) -> LineCollection:
    """Segments with ends of shape (K, 2, 2) as one path with gaps: a path for each takes half the time of a film."""
    from matplotlib.collections import Collection, LineCollection
    from matplotlib.path import Path

    made = LineCollection([], **look)
    codes = np.tile(np.array([Path.MOVETO, Path.LINETO], dtype=Path.code_type), len(ends))
    Collection.set_paths(made, [Path(ends.reshape(-1, 2), codes)])
    setattr(made, "get_segments", partial(list, ends))  # noqa: B010  the type checker refuses to replace a method
    return made


def _evenly(count: int, most: int) -> NDArray[np.intp]:
    return np.asarray(np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp)))


def _draw_links(axes: Axes, q: Reals, links: Links, space: Space, budget: int, notes: list[str]) -> None:
    pairs = pairs_of(links)
    if len(pairs) == 0:
        return
    shown = pairs[_evenly(len(pairs), budget)]
    if len(shown) < len(pairs):
        notes.append(f"{len(shown):,} of {len(pairs):,} links drawn")
    width = float(np.clip(0.7 * (60.0 / max(len(shown), 60.0)) ** 0.35, 0.15, 0.7))
    _line_collection(axes, _link_lines(q, shown, space), colors=theme().faint, linewidths=width, zorder=1, gid="links")


def _link_lines(q: Reals, pairs: NDArray[np.intp], space: Space) -> Reals:
    """Ends of the lines of links, shape (K, 2, m); in periodic space one half at each agent."""
    if space.is_open:
        return q[pairs]
    i, j = pairs.T
    half = np.zeros((len(pairs), q.shape[1]))
    axes = len(space.lengths)
    half[:, :axes] = 0.5 * space.displacement(np.asarray(q[j, :axes] - q[i, :axes], dtype=np.float64))
    return np.concatenate([np.stack([q[i], q[i] + half], axis=1), np.stack([q[j], q[j] - half], axis=1)])


def _draw_trails(axes: Axes, paths: Reals, notes: list[str]) -> None:
    n = paths.shape[1]
    step = _span([paths.reshape(-1, paths.shape[2])]) / TRAIL_STEPS
    agents = _evenly(n, TRAIL_BUDGET)
    if len(agents) < n:
        notes.append(f"{len(agents):,} of {n:,} trails drawn")
    lines = [thinned_path(paths[:, k], step) for k in agents]
    _line_collection(axes, lines, colors=theme().agent, linewidths=0.7,
                     linestyles=[(0, (1.0, 1.6))], alpha=0.75, zorder=0.8, gid="trails")  # fmt: skip


def _draw_arrows(axes: Axes, q: Reals, p: Reals, seconds: float, notes: list[str]) -> Reals:
    agents = _evenly(len(q), ARROW_BUDGET)
    if len(agents) < len(q):
        notes.append(f"{len(agents):,} of {len(q):,} velocities drawn")
    base, shift = q[agents], seconds * p[agents]
    if axes.name == "3d":
        axes.quiver(*base.T, *shift.T, color=theme().ink, linewidth=0.7, arrow_length_ratio=0.28, gid="velocities")
    else:
        width = float(np.clip(0.0045 * (30.0 / len(agents)) ** 0.4, 0.001, 0.0045))
        axes.add_collection(quivers()(
            axes, *base.T, *shift.T, color=theme().ink, angles="xy", scale_units="xy", scale=1.0, width=width,
            headwidth=4, headlength=5, headaxislength=4.5, minlength=0.5, zorder=3, gid="velocities",
        ), autolim=False)  # fmt: skip
    return base + shift


def _draw_directions(axes: Axes, q: Reals, directions: Mapping[str, Reals], span: float) -> None:
    """Draw where bodies point: a short line from each agent along each of its ``directions``."""
    agents = _evenly(len(q), ARROW_BUDGET)
    length = DIRECTION_SHARE * span
    for (name, values), color in zip(directions.items(), DIRECTION_COLORS, strict=False):
        lines = np.stack([q[agents], q[agents] + length * values[agents]], axis=1)
        _line_collection(axes, lines, colors=color, linewidths=1.6, zorder=3.5, gid=name)


def _draw_leader(axes: Axes, x: Reals, v: Reals, seconds: float) -> None:
    look: DotLook = {
        "marker": "h",
        "s": 70.0,
        "color": PURPLE,
        "edgecolors": theme().ink,
        "linewidths": 0.6,
        "gid": "leader",
    }
    if axes.name == "3d":
        axes.scatter(*x[:, None], **look)
        if seconds > 0:
            axes.quiver(*x, *(seconds * v), color=PURPLE, linewidth=1.3, arrow_length_ratio=0.28, gid="leader velocity")
        return
    axes.scatter(*x[:, None], zorder=5, **look)
    if seconds > 0 and v.any():
        axes.quiver(*x[:, None], *(seconds * v)[:, None], color=PURPLE, angles="xy", scale_units="xy", scale=1.0,
                    width=0.008, zorder=4.5, gid="leader velocity")  # fmt: skip


def _frame_axes(axes: Axes, points: Sequence[Reals], limits: tuple[Sequence[float], Sequence[float]] | None) -> None:
    low: Reals
    high: Reals
    if limits is not None:
        low, high = checked_window("net", limits, 3 if axes.name == "3d" else 2)
    else:
        every = np.concatenate(points)
        low, high = every.min(axis=0), every.max(axis=0)
        margin = 0.06 * _span(points) if np.ptp(every, axis=0).any() else 1.0
        low, high = _even(low - margin, high + margin)
    if axes.name == "3d":
        middle, half = (low + high) / 2, float((high - low).max()) / 2
        for k, name in enumerate("xyz"):
            getattr(axes, f"set_{name}lim")(middle[k] - half, middle[k] + half)
            getattr(axes, f"set_{name}label")(f"${name}$", labelpad=-6)
            side = getattr(axes, f"{name}axis")
            side.set_pane_color((0, 0, 0, 0))
            side.set_major_locator(_few_ticks())
        axes.tick_params(pad=-2)
        cast("Axes3D", axes).set_box_aspect((1, 1, 1))
        return
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("$x$")
    axes.set_ylabel("$y$")


def _even(low: Reals, high: Reals) -> tuple[Reals, Reals]:
    """The same window made square, or at least half as high as wide for a long net."""
    size = high - low
    size = np.maximum(size, size.max() * (1.0 if size.min() > 0.55 * size.max() else 0.5))
    middle = (low + high) / 2
    return middle - size / 2, middle + size / 2


def _few_ticks() -> Locator:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(4)
