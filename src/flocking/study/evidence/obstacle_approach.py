"""How near agents come to obstacles, between the frames too."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array
from flocking.engine.runs.run import Run
from flocking.model.leaders_and_obstacles.leaders import SPEED_INTERVALS, Leader, Sink
from flocking.model.leaders_and_obstacles.obstacles import Obstacle
from flocking.model.world.safety_filters import SafetyFilter
from flocking.model.world.times import NANOSECOND
from flocking.study.curve_distances import MOST_PARTS, RESOLVED, searched_curves
from flocking.study.evidence.basis import NotMeasurable
from flocking.study.evidence.motion import MotionEvidence
from flocking.study.evidence.unseen_motion import beyond_curves
from flocking.study.message_logs.recorded_motion import RecordedMotion, cubic

LOOKS = 17
"""Places between two samples at which the path of a moving obstacle is compared with the cubic curve through them."""

LEFT_OUT = 2.0
"""Largest distance from that curve over the largest at these places: 1.03 for a smooth path, more for a sudden one."""

FASTER = 2.0
"""Bound of the speed of an obstacle over the largest at these places above which it may dash between them: at most the
square root of the dimension for a smooth path, of which each component is bounded by itself."""

ROUNDED = 4.0 * float(np.finfo(np.float64).eps)
"""Share of coordinates and distances by which rounding changes a distance: an agent on a boundary is on no side."""

RIGID = 1e-9
"""Share of the largest distance by which an obstacle that moves with its leader may seem to change by rounding."""

COMPARED = 10_000
"""States at which an obstacle is compared with itself at rest, about."""

MOST_PLACES = 10**8
"""Distances of agents at frames from obstacles that are computed at most, a bound on time: about ten seconds."""

MOST_STATES = 4 * 10**6
"""Agents in all frames that are looked at, a bound on memory: about a gigabyte."""


class _Samples(NamedTuple):
    """Samples of a motion.

    Parameters
    ----------
    t
        Times, shape (F,).
    q, p
        Positions and velocities, shape (F, N, m).
    off
        By how much agents may be away from the cubic curves between samples, shape (F - 1, N).
    """

    t: Array
    q: Array
    p: Array
    off: Array


class Nearest(NamedTuple):
    """How near agents came to obstacles.

    Parameters
    ----------
    distance
        Smallest signed distance on the curves between samples.
    error
        By how much it may be smaller, or larger; infinite where the motion between samples is not known.
    at_samples, off
        Signed distance at the sample at which the distance is smallest whatever the errors of positions, and its error.
    time, agent
        Where that was.
    """

    distance: float
    error: float
    at_samples: float
    off: float
    time: float
    agent: int


def nearest_obstacle(run: Run, obstacles: Sequence[Obstacle], errors: Array | None = None) -> Nearest:
    """How near agents came to obstacles over a run.

    Behind a safety filter, where forces are held from tick to tick, motions are the parabolas of the logged forces.
    Otherwise an agent is taken to be on the cubic curve through its positions and velocities at two samples. Samples
    are the fine ones of the exact engine, eight in each of its steps, where the run has them (``fine=True``), else the
    frames. How far it may be from the curve is estimated as in `RecordedMotion`: from how much accelerations of
    neighbouring curves differ and bend; where the ledger has another kinetic energy than the curves, it is as far as
    the largest speed takes agents. An obstacle that moves is at rest in the frame of its leader, whose path is compared
    with cubic curves too, at places between samples, and by a bound of its speed where it may dash between these.

    Parameters
    ----------
    run
        The run.
    obstacles
        The obstacles, convex; at least one.
    errors
        Errors of positions at the frames, shape (F,); none where absent.

    Returns
    -------
    Nearest
        The error is infinite of fewer than three samples that no log connects, and where an obstacle changes otherwise
        than by the motion of its leader.
    """
    samples = _held(run) or _recorded(run)
    at_samples = np.zeros(len(samples.t))
    if errors is not None:
        at_samples = _largest_around(samples.t, samples.t, run.t, errors)
        between = _largest_around(samples.t[:-1], samples.t[1:], run.t, errors)
        samples = samples._replace(off=samples.off + between[:, None])
    known = bool(np.isfinite(samples.off).all()) and len(samples.t) > 1
    if not known:
        samples = samples._replace(off=np.zeros_like(samples.off))
    found: list[Nearest] = []
    near, lowest, curves = np.inf, np.inf, _curves(samples.t, samples.q, samples.p)
    for obstacle in obstacles:
        found.append(_least(obstacle, samples, at_samples, curves, near, lowest))
        near, lowest = found[-1].distance, found[-1].distance - found[-1].error
    first = min(found, key=lambda x: x.at_samples + x.off)
    return Nearest(near, near - lowest if known else np.inf, *first[2:])


class ObstacleEvidence(MotionEvidence):
    """How near agents came to the obstacles of their law and of their safety filter."""

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The obstacles that the scenario declares."""
        control, law = self.run.scenario.control, self.law
        kept = control.obstacles if isinstance(control, SafetyFilter) else ()
        return (*(x for term in law.terms for x in term.solids(self.run.scenario.start.dimension)), *kept)

    @cached_property
    def nearest_obstacle(self) -> Nearest:
        """How near agents came to `obstacles`, with the errors of positions that the run states.

        Its error is infinite where frames do not cover the run.

        Raises
        ------
        NotMeasurable
            When there are no frames or too many of them, or no obstacles.
        NotResolvable
            When positions are unusable, or the law was replaced while the run went on.
        """
        self.need_one_motion()
        if not self.obstacles:
            raise NotMeasurable("no obstacle is declared")
        run = self.checked
        count, states = len(self.obstacles), self.q.shape[0] * self.q.shape[1]
        if states > MOST_STATES or states * count > MOST_PLACES:
            raise NotMeasurable(f"{len(self.t)} frames of {run.n} agents are too many beside {count} obstacles")
        found = nearest_obstacle(run, self.obstacles, self.frame_errors)
        samples = run if run.fine is None or not len(run.fine.t) else run.fine
        begins = samples.t[0] <= run.scenario.start.t
        ends = run.status != "finished" or samples.t[-1] >= run.scenario.t_end
        return found if begins and ends and not self.sampled else found._replace(error=np.inf)

    @property
    def frame_errors(self) -> Array:
        """Estimated errors of the positions of agents at the frames, shape (F,); 0 where none is stated."""
        sampled = self.position_error * float(np.sqrt(self.run.q.shape[2]))
        return sampled + self.stated_errors(0, len(self.t))


def _recorded(run: Run) -> _Samples:
    """The fine samples of a run, or its frames."""
    samples = run.fine if run.fine is not None and len(run.fine.t) else run
    t, q, p = (np.asarray(x, dtype=np.float64) for x in (samples.t, samples.q, samples.p))
    if run.scenario.agents.order == 1:
        p = np.gradient(q, t, axis=0) if len(t) > 1 else np.zeros_like(q)
    if len(t) < 2:
        return _Samples(t, q, p, np.zeros((0, q.shape[1])))
    start = run.scenario.start
    motion = RecordedMotion(run, samples=samples)
    middle = (0.5 * (t[1:] + t[:-1]) - start.t)[:, None]
    # In the middle between two samples the estimate is largest.
    off = motion.at(middle, np.arange(q.shape[1])[None]).off_q
    return _Samples(t, q, p, off + beyond_curves(run)[:, None] if samples is run else off)


def _held(run: Run) -> _Samples | None:
    """States at the ticks and the frames of a run behind a safety filter; None where no log holds its forces.

    A filter is for undamped point masses: under a force that is held they are on parabolas. From every frame the motion
    is computed anew; by how much it misses the next one is its error.
    """
    control, start = run.scenario.control, run.scenario.start
    if not isinstance(control, SafetyFilter) or run.log is None or np.any(control.latencies(start.n)):
        return None
    log = run.log
    ticks: dict[float, list[int]] = {}
    for row, instant in enumerate(log.ticks[:, 0].tolist()):
        ticks.setdefault(start.t + instant * NANOSECOND, []).append(row)
    frames = {float(t): k for k, t in enumerate(run.t)}
    times = np.array(sorted({start.t, *frames, *(t for t in ticks if t < run.t[-1])}))
    masses = np.broadcast_to(np.asarray(run.scenario.agents.masses, dtype=np.float64), start.n)[:, None]
    forces = np.zeros_like(start.q)
    q, p, now, missed = start.q, start.p, float(start.t), 0.0
    places, speeds = [], []
    for t in times.tolist():
        q, p = q + p * (t - now) + 0.5 * forces / masses * (t - now) ** 2, p + forces / masses * (t - now)
        if (frame := frames.get(t)) is not None:
            missed = max(missed, float(np.linalg.norm(q - run.q[frame], axis=1).max(initial=0.0)))
            q, p = np.asarray(run.q[frame], dtype=np.float64), np.asarray(run.p[frame], dtype=np.float64)
        rows = ticks.get(t, [])
        forces[log.ticks[rows, 1]] = log.forces[rows]
        places.append(q)
        speeds.append(p)
        now = t
    return _Samples(times, np.array(places), np.array(speeds), np.full((len(times) - 1, start.n), missed))


def _largest_around(begin: Array, end: Array, frames: Array, errors: Array) -> Array:
    """Largest of the ``errors`` at frames from the last before each ``begin`` to the first after each ``end``."""
    last = len(frames) - 1
    before = np.clip(np.searchsorted(frames, begin, side="right") - 1, 0, last)
    after = np.maximum(before, np.clip(np.searchsorted(frames, end, side="left"), 0, last))
    return np.array([errors[a : b + 1].max(initial=0.0) for a, b in zip(before, after, strict=True)])


def _relative(mover: Leader, samples: _Samples) -> _Samples:
    """The samples in the frame of an obstacle that moves, where it rests as it is at the first of them."""
    t = samples.t
    place, velocity, _ = mover.along(t)
    off, seen = np.zeros(len(t) - 1), np.maximum(_speeds(velocity[:-1]), _speeds(velocity[1:]))
    h = np.diff(t)[:, None]
    for x in (np.arange(LOOKS) + 1.0) / (LOOKS + 1.0):
        curve = cubic(x, h, place[:-1], place[1:], velocity[:-1], velocity[1:])
        there, fast, _ = mover.along(t[:-1] + x * h[:, 0])
        off, seen = np.maximum(off, np.linalg.norm(curve - there, axis=1)), np.maximum(seen, _speeds(fast))
    # Half the way from one such place to the next, and as much again for the curve, where it may be faster than there.
    edges = t[:-1] + np.linspace(0.0, 1.0, SPEED_INTERVALS + 1)[:, None] * h[:, 0]
    fastest = mover.speed_bounds(edges[:-1].ravel(), edges[1:].ravel()).reshape(SPEED_INTERVALS, -1).max(axis=0)
    dashes = np.isfinite(fastest) & (fastest > FASTER * seen)
    off[dashes] += h[dashes, 0] / (LOOKS + 1.0) * fastest[dashes]
    q = samples.q - place[:, None] + place[0]
    return _Samples(t, q, samples.p - velocity[:, None], samples.off + LEFT_OUT * off[:, None])


def _speeds(velocities: Array) -> Array:
    """Lengths of velocities, shape (K,)."""
    return np.asarray(np.linalg.norm(velocities, axis=1))


class _Curves(NamedTuple):
    """Bounds of the cubic curves between samples, each of which lies in the hull of four points.

    Parameters
    ----------
    from_begin, from_end
        Largest distance of such a point from the ends of its curve, shape (F - 1, N).
    size
        Bound of all coordinates.
    """

    from_begin: Array
    from_end: Array
    size: float


def _curves(t: Array, q: Array, p: Array) -> _Curves:
    h = np.diff(t)[:, None, None] / 3.0
    chord, first, last = q[1:] - q[:-1], p[:-1] * h, p[1:] * h
    lengths = [np.linalg.norm(x, axis=-1) for x in (chord, first, chord - last, last, chord - first)]
    begin, end = np.max([lengths[0], *lengths[1:3]], axis=0), np.max([lengths[0], *lengths[3:]], axis=0)
    return _Curves(begin, end, float(np.abs(q).max(initial=0.0) + begin.max(initial=0.0)))


def _least(
    obstacle: Obstacle, samples: _Samples, errors: Array, at_rest: _Curves, near: float, low: float
) -> Nearest:  # fmt: skip
    """The smallest distance of agents from one obstacle, with the ``errors`` of positions at the samples.

    Parameters
    ----------
    at_rest
        Bounds of the curves of the ``samples``.
    near, low
        Smallest distance from the obstacles before it, and that less its error: what is further away is left out.
    """
    shape = samples.q.shape
    distances = obstacle.distance_function()
    values = [np.full(shape[0] * shape[1], value) for value in obstacle.parameters.values()]

    def at(q: Array, t: Array) -> Array:
        return distances(q.reshape(-1, shape[2]), np.repeat(t, shape[1]), values).reshape(shape[:2])

    ends = at(samples.q, samples.t)
    rounding = ROUNDED * float(np.abs(samples.q).max(initial=0.0) + np.abs(ends).max(initial=0.0))
    errors = errors + rounding
    frame, agent = np.unravel_index(int((ends + errors[:, None]).argmin()), ends.shape)
    where = float(ends[frame, agent]), float(errors[frame]), float(samples.t[frame]), int(agent)
    near = min(near, float(ends.min()))
    if len(samples.t) < 2:
        return Nearest(near, 0.0, *where)
    mover = None if type(obstacle.mover) is Sink else obstacle.mover
    t, q, p, off = samples if mover is None else _relative(mover, samples)
    curves = at_rest if mover is None else _curves(t, q, p)
    some = slice(None, None, 1 + q.shape[0] * q.shape[1] // COMPARED)
    rest = obstacle.distance(q[:, some].reshape(-1, shape[2]), float(t[0])).reshape(len(t), -1)
    if not (np.abs(rest - ends[:, some]) <= RIGID * (np.abs(ends).max() + curves.size)).all():
        return Nearest(near, np.inf, *where)
    low = min(low, near, float((np.minimum(ends[1:], ends[:-1]) - off).min()))
    # The distance changes no faster than the place.
    bound = np.maximum(ends[:-1] - curves.from_begin, ends[1:] - curves.from_end)
    tolerance = RESOLVED * max(curves.size, np.finfo(np.float64).tiny)
    rows, agents = np.nonzero((bound < near) | (bound - off < low))
    hidden = np.inf
    for start in range(0, len(rows), MOST_PARTS):
        k, i = rows[start : start + MOST_PARTS], agents[start : start + MOST_PARTS]
        h = np.diff(t)[k, None] / 3.0
        points = np.stack([q[k, i], q[k, i] + h * p[k, i], q[k + 1, i] - h * p[k + 1, i], q[k + 1, i]], axis=1)
        near, low, missed = searched_curves(obstacle, t[0], points, off[k, i], near, low, tolerance)
        hidden = min(hidden, missed)
    return Nearest(near, near - min(low, hidden) + rounding, *where)
