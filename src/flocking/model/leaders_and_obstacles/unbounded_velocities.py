"""Times at which the velocity of a leader is infinite or not real, found before a run."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from flocking.arrays import Array, Mask
from flocking.errors import InvalidInput
from flocking.model.leaders_and_obstacles.leaders import Leader

FIRST, PARTS, ROUNDS = 64, 8, 10
"""Intervals of the first division, parts of each that has no bound, and rounds: 64 8^10 is 7e10, so that a pole is
known to 1.5e-11 of the duration."""

MOST = 512
"""Intervals without a bound that a round divides; where there are more, the first of them."""

NEAR = 1e-3, 1e-6, 1e-9
"""Distances from a suspected time, as shares of the duration, at which the speed is compared."""

SAMPLES, PEAKS, ZOOMS = 1024, 16, 14
"""Times at which the speed is looked at where some interval has no bound, its largest peaks that are followed, and how
often the neighbourhood of one is narrowed by four: to 1e-11 of the duration. Bounds of formulas in pieces hold for
all pieces at once, so that one piece may leave all intervals without a bound."""

SPACINGS = 64
"""The least such distance in spacings of floating-point times: differences of times are known to a few per cent."""

GROWS = 1.2
"""A speed that grows by this factor at each of these distances is taken to be unbounded: a logarithm grows by 1.5, a
power by more, and what is continuous not at all."""


def unbounded_at(leader: Leader, t0: float, t1: float) -> float | None:
    """The first time found at which the velocity of a leader is infinite or not real; None where none was found.

    Interval arithmetic on the formula bounds the speed; intervals without a bound are divided until they are short, and
    there values of the velocity decide, for a bound may be missing where the velocity is finite, as that of sin(t)/t.

    Parameters
    ----------
    leader
        The leader.
    t0, t1
        The interval of time.
    """
    if not (math.isfinite(t0) and math.isfinite(t1) and t0 < t1):
        return None
    times = np.linspace(t0, t1, FIRST + 1)
    suspected = times[~np.isfinite(_speeds(leader, times))].tolist()
    if not np.isfinite(leader.speed_bounds(times[:-1], times[1:])).all():
        suspected += [*_without_bound(leader, times), *_peaks(leader, t0, t1)]
    for t in sorted(suspected):
        if _is_unbounded(leader, t, t0, t1):
            return _edge(leader, t0, t)
    return None


def check_leaders(leaders: Iterable[Leader], t0: float, t1: float) -> None:
    """Refuse leaders whose velocity is infinite or not real within a time.

    Parameters
    ----------
    leaders
        The leaders.
    t0, t1
        Start and end of the run.

    Raises
    ------
    InvalidInput
        When there is one; the message names it and the time.
    """
    for leader in leaders:
        t = unbounded_at(leader, t0, t1)
        if t is not None:
            raise InvalidInput(
                type(leader).__name__, "velocity", f"must be real and finite from t = {t0:g} to {t1:g}",
                f"{leader}, which is not at t = {t:.6g}", "End the run before, or give the leader another velocity.",
            )  # fmt: skip


def _speeds(leader: Leader, times: Array) -> Array:
    """Largest components of the velocity at some times, NaN where it is not real."""
    with np.errstate(all="ignore"):
        return np.asarray(np.abs(leader.velocities_at(times)).max(axis=1))


def _speed(leader: Leader, t: float) -> float:
    return float(_speeds(leader, np.array([t]))[0])


def _without_bound(leader: Leader, edges: Array) -> list[float]:
    """Middles of short intervals for which interval arithmetic gives no bound of the speed."""
    low, high = edges[:-1], edges[1:]
    for turn in range(ROUNDS + 1):
        lost: Mask = ~np.isfinite(leader.speed_bounds(low, high))
        low, high = low[lost][:MOST], high[lost][:MOST]
        if not low.size or turn == ROUNDS:
            break
        parts = np.linspace(low, high, PARTS + 1, axis=1)
        low, high = parts[:, :-1].ravel(), parts[:, 1:].ravel()
    return [float(t) for t in (low + high) / 2]


def _peaks(leader: Leader, t0: float, t1: float) -> list[float]:
    """Times of the largest local maxima of the speed."""
    times = np.linspace(t0, t1, SAMPLES + 1)
    speeds = _finite(leader, times)
    inner = np.concatenate([[-np.inf], speeds, [-np.inf]])
    maxima = np.flatnonzero((speeds >= inner[:-2]) & (speeds > inner[2:]))
    maxima = maxima[np.argsort(-speeds[maxima], kind="stable")][:PEAKS]
    found = []
    for place in maxima.tolist():
        low, high = float(times[max(place - 1, 0)]), float(times[min(place + 1, SAMPLES)])
        for _ in range(ZOOMS):
            near = np.linspace(low, high, PARTS + 1)
            best = int(_finite(leader, near).argmax())
            low, high = float(near[max(best - 1, 0)]), float(near[min(best + 1, PARTS)])
        found.append((low + high) / 2)
    return found


def _finite(leader: Leader, times: Array) -> Array:
    """Speeds at some times, infinite where there is none."""
    speeds = _speeds(leader, times)
    return np.where(np.isnan(speeds), np.inf, speeds)


def _is_unbounded(leader: Leader, t: float, t0: float, t1: float) -> bool:
    """Whether the speed grows without end, or is no number, on either side of a time."""
    least = SPACINGS * float(np.spacing(max(abs(t0), abs(t1))))
    for side in (-1.0, 1.0):
        places = [t + side * max(share * (t1 - t0), least) for share in NEAR]
        if not all(t0 <= place <= t1 for place in places[1:]):
            continue
        far, near, nearest = (_speed(leader, place) for place in places)
        if not (math.isfinite(near) and math.isfinite(nearest)):
            return True
        if nearest > GROWS * near and (near > GROWS * far or not t0 <= places[0] <= t1):
            return True
    return False


def _edge(leader: Leader, t0: float, t: float) -> float:
    """Where a range of times without a velocity begins that ends at ``t`` or later, else ``t``."""
    low, high = t0, t
    if not math.isfinite(_speed(leader, low)) or math.isfinite(_speed(leader, high)):
        return t
    while high - low > NEAR[-1] * (1.0 + abs(t)):
        middle = (low + high) / 2
        low, high = (middle, high) if math.isfinite(_speed(leader, middle)) else (low, middle)
    return high
