"""Whether a run is long enough to decide what its motion tends to.

Claims about limits are measured on a finite run, all by one criterion. A limit is reached when its bound holds
throughout the last tenth of the run, and what is within it does not rise there so that it would leave the bound within
another such run. It is missed when the bound does not hold at any time of that tenth and the excess over the bound has
settled, in one of two ways. Either it is constant, in a run in which agents went along paths about their mean of
`MOVED` of the group's size or longer: its means over the last tenth and over the tenth before differ by no more than
`CHANGE` of it, and it does not fall towards the bound: where its means fell through all five tenths of the last half,
the geometric series of these falls must end before `REMAINING` of it is gone. Or it fluctuates and does not fall: each
of the five tenths of the last half holds a whole swing, their means differ by no more than `STEADY` of it, the last is
not the least of them, neither the means nor the largest values of the tenths fall along a line by more than `CONFIRMED`
errors of its slope, nor do the largest values fall throughout as those series do. These changes are also
compared with the total change over the run (`OF_ALL`, and `STEADY` again), so that a run too short for its motion does
not count as settled. Nor does one in which, at the end, an agent acted on what it knew before the last two tenths: then
it is messages that stand still, or a delay that is as long. Where forces are held, and one that acts at the end was
computed before then, nothing shows what agents will do next: no limit counts as reached there either. A limit is not
missed, in open space, where at the end agents without a link go on straight lines that bring them into each other's
radius within ten such runs. In all other cases the verdict is ``not yet``. Where the law or the state was replaced
while the run went on, all is left open: what came before, with which the end is compared, is of another motion.

What falls by less than `ROUNDING` of itself in a tenth of the run, after it has changed much more, is taken for
constant, and a fall that is hidden by fluctuations, for none: a longer run decides otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array, Reals
from flocking.study.claims.claim import Measure
from flocking.study.evidence import Evidence
from flocking.study.evidence.links import ITS_FORCE, LEADERS

LAST = 0.1
"""Share of a run over which a limit must hold, and the share before it which it is compared with."""

CHANGE = 1e-3
"""The excess over a bound may change by this fraction of itself from one tenth of the run to the next."""

OF_ALL = 1e-2
"""And by this fraction of its total change over the run."""

ROUNDING = 1e-12
"""Relative changes this small are rounding."""

TIME_ROUNDING = 1e-9
"""Frames lie on the edges of tenths up to this share of the duration."""

REMAINING = 0.25
"""Share of the excess that may still be lost if its falls go on as a geometric series. All of it is lost by what decays
exponentially to the bound."""

STEADY = 0.1
"""The same for the five tenths of the last half, where the last of them is not the least."""

CONFIRMED = 2.353
"""Errors of the slope of a line through five means beyond which it falls: of 20 lines of a constant and independent
errors one falls so (Student's distribution with three degrees of freedom, one-sided)."""

MOVED = 1e-2
"""Length of a path about the mean, as a share of the group's size, below which a constant quantity shows nothing: the
run is short for the motion."""

UNSEEN = 1e-4
"""Share of a bound below which values may be errors of the computation, whose growth shows nothing."""

FEWEST = 3
"""Frames needed in each of the two shares."""

MOST = 8
"""Frames of a share that are evaluated where the evaluation is costly."""

MOST_WHERE_MISSED = 64
"""Frames of a share that are evaluated all the same before a limit counts as missed: fewer may miss its swings."""


@dataclass(frozen=True)
class Late:
    """Frames that decide whether a motion has settled.

    Parameters
    ----------
    tenths
        Those in each tenth of the last half of the run, the last tenth first.
    first
        Those of the first half.
    """

    tenths: tuple[NDArray[np.int64], ...]
    first: NDArray[np.int64]


FEW = "too few frames: a tenth of the last half of the run has fewer than three"


def late_frames(t: Array, *, most: int | None = None) -> Late | None:
    """Frames of the last half of a run by tenths, and of the first half.

    Parameters
    ----------
    t
        Times of the frames, shape (F,).
    most
        Largest number of frames of each, evenly chosen, the last among them; all when absent.

    Returns
    -------
    Late or None
        None when a tenth has fewer than three.
    """
    span = t[-1] - t[0]
    edges = t[-1] - LAST * span * np.arange(6) - TIME_ROUNDING * span
    borders = np.concatenate([np.searchsorted(t, edges), [0]])
    borders[0] = len(t)
    parts = [np.arange(low, high) for low, high in zip(borders[1:], borders[:-1], strict=True)]
    if len(t) < 2 or min(len(part) for part in parts[:-1]) < FEWEST:
        return None
    *tenths, first = (_thinned(part, most) for part in parts)
    return Late(tuple(tenths), first)


def _thinned(frames: NDArray[np.int64], most: int | None) -> NDArray[np.int64]:
    if most is None or len(frames) <= most:
        return frames
    return np.asarray(frames[np.linspace(0, len(frames) - 1, most).round().astype(int)])


def limit_of(
    e: Evidence, bound: float, value: Callable[[int], float], note: Callable[[float], str], *, error: float = 0.0
) -> Measure:
    """A quantity whose limit is to be below a bound, measured at the end, with the criterion for limits.

    Parameters
    ----------
    bound
        What it must be less than.
    value
        The quantity at a frame.
    note
        Its value at the end in words.
    error
        Numerical error of its value.
    """
    e.need_one_motion()
    e.need_end(float(e.t[-1]))
    frames = late_frames(e.t, most=MOST)
    if frames is None:
        return _unseen(bound, value(-1), note, error)
    known: dict[int, float] = {}

    def judged(frames: Late) -> Measure:
        known.update((k, value(k)) for part in (*frames.tenths, frames.first) for k in part.tolist() if k not in known)
        tenths = [np.array([known[k] for k in part.tolist()]) for part in frames.tenths]
        return _judged(e, bound, tenths, np.array([known[k] for k in frames.first.tolist()]), note, error)

    found = judged(frames)
    every = late_frames(e.t, most=MOST_WHERE_MISSED)
    return found if found.unsettled or found.holds or every is None else judged(every)


def limit_of_series(
    e: Evidence, t: Array, values: Reals, bound: float, note: Callable[[float], str], *, error: float = 0.0
) -> Measure:
    """The same for a quantity that is known at all times of a series.

    Parameters
    ----------
    t, values
        Times, ascending, and the quantity, shape (F,) each.
    bound, note, error
        As `limit_of` takes them.
    """
    e.need_one_motion()
    e.need_end(float(t[-1]))
    frames = late_frames(t)
    if frames is None:
        return _unseen(bound, float(values[-1]), note, error)
    return _judged(
        e,
        bound,
        [values[part] for part in frames.tenths],
        values[frames.first],
        note,
        error,
    )


def _unseen(bound: float, end: float, note: Callable[[float], str], error: float) -> Measure:
    return Measure(bound - end, error, note(end), FEW, everywhere=False)


def _judged(
    e: Evidence, bound: float, tenths: Sequence[Reals], first: Reals, note: Callable[[float], str], error: float
) -> Measure:
    end = float(tenths[0][-1])
    excess = [part - bound for part in tenths]
    return Measure(bound - end, error, note(end), _unsettled(e, excess, first - bound, bound), everywhere=False)


def _old_knowledge(e: Evidence) -> str:
    """Why what agents know is too old for a settled motion to show anything; empty where it is not."""
    oldest = e.oldest_knowledge
    if oldest is None or oldest[0] >= e.t[-1] - 2 * LAST * (e.t[-1] - e.t[0]):
        return ""
    since, agent, sender = oldest
    if agent < 0:
        return f"agents know others {e.t[-1] - since:.3g} late, longer than the last two tenths of the run"
    if sender == ITS_FORCE:
        return f"at the end no force acts that agent {agent} computed after {e.when(since)}, before the last two tenths"
    whom = "leaders" if sender == LEADERS else f"agent {sender}"
    return f"agent {agent} last acted on what it knew of {whom} at {e.when(since)}, before the last two tenths"


def held_for_long(e: Evidence) -> str:
    """Why forces at the end are held for too long for a limit to count as reached; empty where they are not."""
    return _old_knowledge(e) if e.oldest_knowledge is not None and e.oldest_knowledge[2] == ITS_FORCE else ""


def _unsettled(e: Evidence, excess: Sequence[Reals], first: Reals, bound: float) -> str:
    """Why the excess over a bound, in each tenth of the last half and in the first half, has not settled."""
    late = excess[0]
    if np.isnan(late).any():
        return ""
    if late[-1] < 0:
        if (late < 0).all():
            return "it grows, and would leave the bound again" if _leaves(excess, bound) else held_for_long(e)
        return "reached for less than the last tenth of the run"
    if (late < 0).any():
        return "reached in the last tenth of the run and left again"
    means, every = np.array([part.mean() for part in excess]), np.concatenate([*excess, first])
    if not np.isfinite(every).all():
        return ""
    now, total_change = float(means[0]), float(np.ptp(every))
    change, spread = abs(float(means[1]) - now), float(np.ptp(means))
    constant = change <= max(ROUNDING * now, min(CHANGE * now, OF_ALL * total_change))
    steady = spread <= STEADY * min(now, total_change) and now > means.min()
    if (constant or steady) and (why := _old_knowledge(e) or e.yet_to_meet):
        return why
    if constant:
        moved = e.path_about_mean
        if moved < MOVED:
            return f"agents moved about their mean by {moved:.1e} of the group's size alone"
        return "the excess over the bound falls slowly" if _tends_to_bound(means) else ""
    if steady:
        if min(_swings(part, now) for part in excess) < 1:
            return "it swings so slowly that a tenth of the run may show the top of one swing"
        highest = np.array([_highest(part) for part in excess])
        falls = _line_falls(means[::-1]) or _line_falls(highest[::-1]) or _tends_to_bound(highest)
        return "the excess over the bound fluctuates and falls slowly" if falls else ""
    return (
        f"the excess over the bound still changes in a tenth of the run, by {change / now:.1e} of itself and "
        f"{change / total_change:.1e} of its change since the start"
    )


def _swings(values: Reals, level: float) -> int:
    """Number of whole swings about a level."""
    return int(np.count_nonzero(np.diff(values > level))) // 2


def _highest(values: Reals) -> float:
    """The largest value of a function: of the parabola through the largest of its samples and those beside it."""
    k = int(values.argmax())
    if k in (0, len(values) - 1):
        return float(values[k])
    before, at, after = (float(x) for x in values[k - 1 : k + 2])
    curvature = before - 2 * at + after
    return at - (after - before) ** 2 / (8 * curvature) if curvature < 0 else at


def _leaves(excess: Sequence[Reals], bound: float) -> bool:
    """Whether what is within the bound rose at the end, and would leave it within another such run.

    It rose where its largest values in the last three twentieths of the run, or in the last three tenths, ascend; it
    goes on by the same factor.
    """
    halves = [part for tenth in excess[:2] for part in (tenth[len(tenth) // 2 :], tenth[: len(tenth) // 2])]
    for parts, share in ((halves[:3], LAST / 2), (excess[:3], LAST)):
        last, before, third = (float(part.max(initial=-bound)) + bound for part in parts)
        grows = last > max(before, UNSEEN * bound) and before > third > 0
        if grows and last * (last / third) ** (0.5 / share) >= bound:
            return True
    return False


def _tends_to_bound(means: Reals) -> bool:
    """Whether values of five tenths, the last first, fell throughout, as a series that leaves little of them."""
    falls = np.diff(means)
    if (falls <= ROUNDING * means[0]).any():
        return False
    last, before = float(falls[0]), float(falls[1])
    return last >= before or last**2 / (before - last) >= REMAINING * float(means[0])


def _line_falls(means: Reals) -> bool:
    """Whether the line through values in order of time, by least squares, falls, against the error of its slope."""
    k = np.arange(len(means)) - 0.5 * (len(means) - 1)
    slope = float(k @ means / (k @ k))
    rest = means - means.mean() - slope * k
    return slope < -CONFIRMED * float(np.sqrt(rest @ rest / (len(means) - 2) / (k @ k)))


def configuration_unsettled(e: Evidence) -> str:
    """Why the distances between linked agents have not settled; empty when they have.

    They have settled when, in the last tenth of the run, no link switched and no link's length differed from that at
    the end by more than `CHANGE` of the longest, nor by more than `OF_ALL` of the largest change of a length.
    """
    e.need_one_motion()
    e.need_end(float(e.t[-1]))
    links = e.end_links | e.end_links.T
    found = late_frames(e.t, most=MOST)
    if found is None:
        return FEW
    late = found.tenths[0]
    if any((e.frame_links[k] != e.frame_links[-1]).any() for k in late):
        return "links still switched in the last tenth of the run"
    i, j = np.nonzero(np.triu(links))
    if len(i) == 0:
        return ""
    frames = np.concatenate([found.first, *found.tenths[:0:-1], late])
    lengths = np.array([np.linalg.norm(e.displacement(e.q[k, i] - e.q[k, j]), axis=1) for k in frames])
    changes, longest = np.abs(lengths - lengths[-1]).max(axis=1), float(lengths[-1].max())
    change = float(changes[-len(late) :].max())
    if why := _old_knowledge(e):
        return why
    if change <= max(ROUNDING * longest, min(CHANGE * longest, OF_ALL * float(changes.max()))):
        return ""
    return (
        f"lengths of links still changed in the last tenth of the run, by {change:.1e} of {changes.max():.1e} since "
        "the start"
    )


def limit_of_configuration(
    e: Evidence, bound: float, value: Callable[[int], float], note: Callable[[float], str]
) -> Measure:
    """The same as `limit_of` for a function of links and distances, reached where these have settled with it in bound.

    Parameters
    ----------
    bound, value, note
        As `limit_of` takes them.
    """
    if configuration_unsettled(e) or (end := value(-1)) >= bound:
        return limit_of(e, bound, value, note)
    return Measure(bound - end, 0.0, note(end), everywhere=False)


def of_configuration(e: Evidence, measured: Measure) -> Measure:
    """A measure of the configuration at the end, as a statement about its limit.

    Parameters
    ----------
    measured
        Margin, error and note of the configuration at the end.
    """
    return replace(measured, unsettled=configuration_unsettled(e), everywhere=False)
