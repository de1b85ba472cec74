"""Choice of a stored frame, and the leader at its time."""

from __future__ import annotations

import numpy as np

from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.formula.safe_digits import time_text
from flocking.model.checks import Array, number
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.state import State

SAME_TIME = 1e-9
"""Relative difference of a requested time from the ends of a run that counts as none."""


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
        raise InvalidInput("show", "run", "must contain at least one frame", run.status)
    if time is not None and frame is not None:
        raise InvalidInput("show", "frame", "must be absent if a time is given", frame)
    if time is not None:
        time = number("show", "time", time)
        slack = SAME_TIME * max(1.0, abs(time))
        if not run.t[0] - slack <= time <= run.t[-1] + slack:
            first, last = (time_text(t, run.t[0], run.t[-1], 6) for t in (run.t[0], run.t[-1]))
            raise InvalidInput("show", "time", f"must be in the run, from {first} to {last}", time)
        return int(np.argmin(np.abs(run.t - time)))
    frame = -1 if frame is None else frame
    if not -count <= frame < count:
        raise InvalidInput("show", "frame", f"must be one of the {count} stored frames", frame)
    return frame % count


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
    return [(q, p) for q, p in placed if np.isfinite(q).all()]


def leader_track(leader: Leader, times: Array) -> tuple[Array, Array]:
    """Positions and velocities of a leader at many times, shape (F, m) each."""
    q, p, _ = leader.along(times)
    return q, p


def dimension_name(axis: int) -> str:
    """Name of an axis: x, y, z, then x_4 and so on."""
    return "xyz"[axis] if axis < 3 else f"x_{{{axis + 1}}}"


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
