"""Choice of a stored frame, its time in words, and the leaders and obstacles of its run."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol, cast

import numpy as np

from flocking.engine.runs.message_log import changed_times
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.formula.safe_digits import EXACT_DIGITS, given_text, nearest_text, time_text
from flocking.model.checks import Array, array, number
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.leaders_and_obstacles.obstacles import Obstacle
from flocking.model.space import OPEN
from flocking.model.state import State
from flocking.model.terms.avoidance import ObstacleTerm


class Outlined(Protocol):
    """An object with an outline, such as an obstacle."""

    def outline(self, count: int) -> Array:
        """Points of the outline, shape (count, 2)."""


SAME_TIME = 1e-9
"""Difference of a requested time from the ends of a run that counts as none, relative to the later of them."""


DIGITS = 6
"""Fewest digits of a time above a picture; a convention."""


def need_velocities(kind: str, run: Run) -> None:
    """Refuse to draw velocities of agents of order 1: a run holds zeros in their place.

    Parameters
    ----------
    kind
        What is drawn, for the message.
    run
        The run.

    Raises
    ------
    InvalidInput
        When its agents are of order 1.
    """
    if run.scenario.agents.order == 1:
        raise InvalidInput(
            kind, "run", "must be of agents with velocities", "agents of order 1",
            "They have none of their own, and no frame holds them: draw positions.",
        )  # fmt: skip


def no_frames(given: str) -> InvalidInput:
    """The error of a run that has nothing to draw.

    Parameters
    ----------
    given
        What it is instead.
    """
    return InvalidInput(
        "show", "run", "must contain at least one frame", given, "Resume it, or keep frames when it is simulated."
    )


def frame_at(run: Run, time: float | None = None, frame: int | None = None) -> int:
    """Number of the stored frame nearest to ``time``, or ``frame``, counted from the end if negative.

    Parameters
    ----------
    run
        The run.
    time, frame
        At most one of the two; the last frame by default.

    Raises
    ------
    InvalidInput
        If both are given, the run has no frame, or the frame or time lies outside the run.
    """
    count = len(run.t)
    if count == 0:
        raise no_frames(run.status)
    if time is not None and frame is not None:
        raise InvalidInput("show", "frame", "must be absent if a time is given", frame)
    if time is not None:
        time = number("show", "time", time)
        first, last = float(run.t[0]), float(run.t[-1])
        slack = SAME_TIME * max(abs(first), abs(last))
        if not first - slack <= time <= last + slack:
            span = f"from {given_text(first)} to {given_text(last)}"
            raise InvalidInput("show", "time", f"must be in the run, {span}", time)
        return int(np.argmin(np.abs(run.t - time)))
    frame = -1 if frame is None else frame
    numbered = isinstance(frame, int | np.integer) and not isinstance(frame, bool)
    if not numbered or not -count <= frame < count:
        raise InvalidInput("show", "frame", f"must be one of the {count} stored frames", frame)
    return int(frame % count)


def time_of(what: Run | State, time: float) -> str:
    """A time in as many digits as distinguish the frames of a run, at least six.

    Parameters
    ----------
    what
        The run; a state alone has one time.
    time
        The time.
    """
    if isinstance(what, Run) and len(what.t):
        return time_text(time, what.t[0], what.t[-1], DIGITS)
    return nearest_text(time, EXACT_DIGITS) if abs(time) >= 10.0**DIGITS else nearest_text(time, DIGITS)


def own_obstacles(what: Run | State) -> list[Obstacle]:
    """The obstacles in a run's law, each once.

    Parameters
    ----------
    what
        A run; a state has no obstacles.
    """
    if not isinstance(what, Run):
        return []
    terms = [t for t in what.scenario.law.body_terms if isinstance(t, ObstacleTerm)]
    return list({id(o): o for term in terms for o in term.obstacles}.values())


def changed_later(what: object, time: float) -> list[str]:
    """A note for a picture at a ``time`` of a run whose law or state was replaced later; none for others.

    Only the law after the last change is known of a run, with its obstacles and leaders.

    Parameters
    ----------
    what
        What is drawn.
    time
        The time of the picture.
    """
    if not isinstance(what, Run) or not what.fidelity.changed:
        return []
    times = changed_times(what.provenance)
    if not times:
        return ["obstacles and leaders of the last law; it was changed during the run"]
    last = max(times)
    return [f"obstacles and leaders as after a change at t = {time_of(what, last)}"] if time < last else []


def leader_at(leader: Leader, time: float) -> tuple[Array, Array]:
    """Position and velocity of a leader, shape (m,) each."""
    q, p, _ = leader.at(time)
    return q, p


def leaders_at(what: Run | State, state: State, leader: bool | Leader) -> list[tuple[Array, Array]]:
    """Positions and velocities of the leaders of a run at the time of a state, shape (m,) each.

    Parameters
    ----------
    what
        A run; a state has no leaders.
    state
        The state.
    leader
        Whether to take those of the law, or another leader in their place.
    """
    chosen: tuple[Leader, ...] = ()
    if isinstance(leader, Leader):
        chosen = (leader,)
    elif leader and isinstance(what, Run):
        chosen = what.scenario.law.leaders
    placed = [leader_at(one, state.t) for one in chosen if one.dimension == state.dimension]
    # In periodic space they are drawn in the box, as agents are.
    space = what.scenario.space if isinstance(what, Run) else OPEN
    return [(space.wrapped(q), p) for q, p in placed if np.isfinite(q).all()]


def leader_track(leader: Leader, times: Array) -> tuple[Array, Array]:
    """Positions and velocities of a leader at many times, shape (F, m) each."""
    q, p, _ = leader.along(times)
    return q, p


def dimension_name(axis: int) -> str:
    """Name of an axis: x, y, z, then x_4 and so on."""
    return "xyz"[axis] if axis < 3 else f"x_{{{axis + 1}}}"


def checked_window(owner: str, limits: object, axes: int) -> tuple[Array, Array]:
    """Lowest and highest corner of a picture, shape (m,) each.

    Parameters
    ----------
    limits
        The two corners as they were given.
    axes
        Number of axes of the picture.

    Raises
    ------
    InvalidInput
        When they are none, or the first is not below the second.
    """
    found = array(owner, "limits", limits, ndim=2)
    if found.shape != (2, axes) or not (found[0] < found[1]).all():
        rule = f"must be the lowest and the highest corner, {axes} numbers each, the first below the second"
        raise InvalidInput(owner, "limits", rule, found.tolist())
    return found[0], found[1]


def checked_outlines(owner: str, obstacles: object) -> list[Outlined]:
    """Check that what is drawn as obstacles has outlines, and return it.

    Raises
    ------
    InvalidInput
        When it is no sequence of such objects.
    """
    found = list(obstacles) if isinstance(obstacles, Iterable) else [obstacles]
    if not isinstance(obstacles, Iterable) or not all(callable(getattr(each, "outline", None)) for each in found):
        raise InvalidInput(
            owner, "obstacles", "must be a sequence of objects with a method outline(count)", obstacles,
            "Obstacles such as fk.Ball have one.",
        )  # fmt: skip
    return cast("list[Outlined]", found)


def checked_axis(run: Run, axis: int) -> int:
    """Check that a run has an ``axis``, and return it.

    Raises
    ------
    InvalidInput
        If it has not.
    """
    m = run.q.shape[2]
    if isinstance(axis, bool) or not isinstance(axis, int | np.integer) or not 0 <= axis < m:
        raise InvalidInput("show", "axis", f"must be one of 0..{m - 1}", axis)
    return int(axis)
