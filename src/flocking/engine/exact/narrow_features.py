"""Narrow features of pair formulas: distances that a step may not jump over.

The error estimate of a step uses the force only at the stages of the step. A bump of the force between two stages
does not change that estimate, so a pair may move only a fraction of its width per step while it is near it. The
formulas give the positions of bumps: each has an extremum of the force. On an interval where the slope of the force has
one sign there is none; interval arithmetic finds all others, however narrow.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import comb
from types import FunctionType
from typing import Any

import numpy as np

from flocking.arrays import Indices, Numbers
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.exact.crossings.guards import squared_distance
from flocking.engine.kernels.bernstein import smallest_value
from flocking.engine.kernels.obstacle_distances import ObstacleDistances
from flocking.engine.kernels.pieces import MARGIN
from flocking.formula.interval_jets import Jet, on_jets
from flocking.formula.native.functions import native_apart
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links

NARROW = 1 / 32
"""Features wider than this fraction of the range are ignored: no step of a pair misses them."""

ZONE = 16.0
"""Size of the zone around a feature, in widths: from an extremum of the force to the next inflection is one width."""

MERGED = 4.0
"""Largest ratio of the widths of overlapping zones that become one: the smaller width then bounds the steps in both."""

STRIDE = 2.0
"""Largest motion of a pair in one step within a zone, in widths."""

NEGLIGIBLE = 1e-26
"""Differences of potential that a step may ignore: the square of the finest tolerance."""

FINEST = 1e-10
"""Smallest width looked for, relative to the distance."""

AIMED = 0.9
"""Share of the allowed stride at which a step that is too long is cut: the path between two samples is taken for
straight, and its curvature must not make the next step too long again.
"""

MOST_CELLS = 4096
"""Undecided intervals at which the search ends, a bound on its time and memory; extrema that are left then are not
protected."""

MOST_KNOWN = 1000
"""Formulas whose zones are cached; a thousand laws are more than one process uses at a time."""

REFINEMENTS, PARTS = 7, 32
"""An interval with a root is divided so often into so many parts: 32^-7 = 2^-35 of it is left."""

WIDTHS = 100
"""Distances from an extremum at which the next inflection is looked for, a factor of 1.26 apart."""

SHELLS = 40
"""Halvings of the range, down to 2^-40 of it; where the range is infinite, from 2^40 to 2^-40."""

SAMPLES = 64
"""Samples of a pair along a step."""


POINTED = 1e-6
"""Force near distance 0, as a share of that at other distances, from which on it has no limit of zero there."""

NEAR, FURTHER = 1e-9, np.array([0.1, 0.3, 0.6, 0.9])
"""Distances, as shares of the reach, at which these forces are."""

_known: dict[object, Array] = {}
"""Zones of the formulas so far, by formula, numbers and borders."""


def zones_of(
    owner: str,
    function: Any,
    parameters: Sequence[Array],
    borders: Sequence[float],
    rows: tuple[object, ...] = (),
) -> Array:
    """Result of `zones`, computed once for the same formulas and numbers.

    Parameters
    ----------
    function, parameters, borders
        As for `zones`. ``function.reads`` names the parameters it reads.
    rows
        Other values it reads.
    """
    P, A, W = parameters
    scalars, per_agent, per_pair = function.reads
    numbers = (*P[list(scalars)], *A[list(per_agent), 0], *W[list(per_pair), 0, -1])
    key = (owner, function.__name__, tuple(map(float, numbers)), tuple(borders), rows)
    if key not in _known:
        if len(_known) >= MOST_KNOWN:
            _known.clear()
        _known[key] = zones(function, parameters, borders, function.acting)
    return _known[key]


def zones(
    function: FunctionType, parameters: Sequence[object], borders: Sequence[float], acting: Sequence[int] = (0, 1)
) -> Array:
    """Intervals of the distance around narrow features, with their widths: rows (from, to, width).

    Parameters
    ----------
    function
        The formulas of a pair as functions of its distance, ``side``, ``reach`` and parameters.
    parameters
        Their parameters.
    borders
        Distances at which their pieces meet, ascending; the last ends the range and may be infinite.
    acting
        Which of the formulas act on the motion.
    """
    borders = [border for border in borders if border > 0.0]
    found: list[tuple[float, float, float]] = []
    jets = on_jets(function)
    for low, high in zip([0.0, *borders[:-1]], borders, strict=True):
        side = 0.5 * (low + high) if np.isfinite(high) else 2 * low + 1.0
        for number in acting:

            def formula(r: Jet, number: int = number, side: float = side) -> Jet:
                value = jets(r, side, r, *parameters)[number]
                return value if isinstance(value, Jet) else r.constant(float(value))

            try:
                found += _piece(formula, low * (1 + MARGIN), high * (1 - MARGIN), borders[-1])
            except (TypeError, ValueError, ArithmeticError, AttributeError):
                # A user's function without interval arithmetic is evaluated at the stages alone.
                continue
    return _merged(found)


def _piece(formula: Callable[[Jet], Jet], low: float, high: float, outer: float) -> list[tuple[float, float, float]]:
    found = []
    for at, width in _extrema(formula, low, high):
        if width < NARROW * outer:
            found.append((max(at - ZONE * width, 0.0), at + ZONE * width, width))
    return found


def _merged(found: list[tuple[float, float, float]]) -> Array:
    """Overlapping zones become one with the smaller width, unless one is far wider."""
    joined: list[tuple[float, float, float]] = []
    for begin, end, width in sorted(found):
        if joined and begin <= joined[-1][1] and 1 / MERGED <= width / joined[-1][2] <= MERGED:
            joined[-1] = (joined[-1][0], max(end, joined[-1][1]), min(width, joined[-1][2]))
        else:
            joined.append((begin, end, width))
    return np.array(joined).reshape(-1, 3)


def _extrema(formula: Callable[[Jet], Jet], low: float, high: float) -> list[tuple[float, float]]:
    """Extrema of a formula between two distances, with their widths."""
    top = high if np.isfinite(high) else 2.0**SHELLS
    edges = top * 2.0 ** -np.arange(SHELLS if np.isfinite(high) else 2 * SHELLS, -1, -1.0)
    edges = np.concatenate([[max(low, edges[0])], edges[edges > max(low, edges[0])]])
    a, b = edges[:-1], edges[1:]
    found: list[tuple[float, float]] = []
    begins, ends = [np.zeros(0)], [np.zeros(0)]
    while 0 < len(a) <= MOST_CELLS:
        count, middle, half = len(a), 0.5 * (a + b), 0.5 * (b - a)
        both = formula(Jet.variable(np.concatenate([a, middle]), np.concatenate([b, middle]))).parts
        value, slope, curvature = ((low[:count], high[:count]) for low, high in both)
        at_middle = both[1][0][count:], both[1][1][count:]
        bend = half * np.maximum(np.abs(curvature[0]), np.abs(curvature[1]))
        # Infinite ends leave no number, which counts as unbounded and undecided.
        with np.errstate(over="ignore", invalid="ignore"):
            lowest, highest = np.fmax(slope[0], at_middle[0] - bend), np.fmin(slope[1], at_middle[1] + bend)
            undecided = (lowest <= 0) & (highest >= 0) & ~((value[1] - value[0]) * (b - a) <= NEGLIGIBLE)
        single = undecided & ((curvature[0] > 0) | (curvature[1] < 0))
        begins.append(a[single])
        ends.append(b[single])
        small = undecided & ~single & (b - a <= FINEST * b)
        found += [(float(x), float(w)) for x, w in zip(middle[small], (b - a)[small], strict=True)]
        rest = undecided & ~single & ~small
        a, middle, b = a[rest], middle[rest], b[rest]
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
    return found + _roots(formula, np.concatenate(begins), np.concatenate(ends))


def _roots(formula: Callable[[Jet], Jet], a: Array, b: Array) -> list[tuple[float, float]]:
    """Roots of the slope, monotone on each interval, and the distances of the next inflections."""

    def sign(r: Array, order: int) -> Array:
        low, high = formula(Jet.variable(r.ravel(), r.ravel())).parts[order]
        return np.sign(0.5 * (low + high)).reshape(r.shape)

    if not len(a):
        return []
    for _ in range(REFINEMENTS):
        grid = a[:, None] + (b - a)[:, None] * np.linspace(0.0, 1.0, PARTS + 1)
        signs = sign(grid, 1)
        changed = signs[:, 1:] * signs[:, :1] <= 0
        passes = changed.any(axis=1)
        first = np.argmax(changed, axis=1)
        rows = np.flatnonzero(passes)
        a, b = grid[rows, first[rows]], grid[rows, first[rows] + 1]
        if not len(a):
            return []
    r = 0.5 * (a + b)
    steps = np.geomspace(FINEST, 1.0, WIDTHS)
    around = r[:, None] * np.concatenate([[1.0], 1 + steps, np.maximum(1 - steps, FINEST)])
    bent = sign(around, 2)
    turned = bent[:, 1:] * bent[:, :1] < 0
    either = turned[:, :WIDTHS] | turned[:, WIDTHS:]
    widths = np.where(either.any(axis=1), r * steps[np.argmax(either, axis=1)], np.inf)
    return [(float(x), float(w)) for x, w in zip(r, widths, strict=True)]


def _value(g: Array, x: float, work: Array) -> float:
    """Bernstein polynomial at ``x``."""
    for k in range(g.shape[0]):
        work[k] = g[k]
    for k in range(g.shape[0] - 1):
        for a in range(g.shape[0] - 1 - k):
            work[a] += x * (work[a + 1] - work[a])
    return float(work[0])


@native_apart
def allowed_share(
    B: Array, far: Array, senders: Indices, sensed: Indices, offsets: Numbers, found: Array, owners: Indices
) -> float:
    """The fraction of a segment on which no pair moves further within a zone than its `STRIDE`; 1 or more: all.

    Parameters
    ----------
    B
        Bernstein coefficients of the positions, shape (8, N, m).
    far
        See `flocking.engine.adaptive_steps.segment.Motion`.
    found
        Zones, rows (from, to, width).
    owners
        Graph of each zone.
    """
    share = 1.0
    square, work = np.empty(15), np.empty(15)
    for z in range(found.shape[0]):
        begin, end, most = found[z, 0], found[z, 1], STRIDE * found[z, 2]
        for e in range(offsets[owners[z]], offsets[owners[z] + 1]):
            i, j = senders[e], sensed[e]
            excursion = far[i] + far[j]
            if excursion <= most:
                continue
            d2 = 0.0
            for k in range(B.shape[2]):
                d2 += (B[0, j, k] - B[0, i, k]) ** 2
            distance = np.sqrt(d2)
            if distance - excursion > end or distance + excursion < begin:
                continue
            squared_distance(B, i, j, square)
            _, turn = smallest_value(square, np.inf)
            before, last, passed = distance, 0.0, 0
            low = high = min(max(distance, begin), end)
            for k in range(SAMPLES + 2):
                x = (k - passed) / SAMPLES
                if passed == 0 and (turn < x or k > SAMPLES):
                    # The closest place falls between two of the others.
                    x, passed = min(turn, 1.0), 1
                r = np.sqrt(max(_value(square, x, work), 0.0))
                inside = min(max(r, begin), end)
                low, high = min(low, inside), max(high, inside)
                if high - low > most:
                    goal = high - AIMED * most if inside == low else low + AIMED * most
                    part = (goal - before) / (r - before) if r != before else 1.0
                    share = min(share, last + min(max(part, 0.0), 1.0) * (x - last))
                    break
                last, before = x, r
    return share


def allowed_by_obstacles(
    segment: Segment,
    B: Array,
    contacts: ObstacleDistances,
    active: Sequence[Links],
    found: Sequence[Array],
    base: float,
) -> float:
    """The fraction of a segment on which no agent moves further within a zone of an obstacle than its `STRIDE`.

    Parameters
    ----------
    segment
        The segment.
    B
        Bernstein coefficients of the positions, shape (8, N, m).
    contacts
        Distances from the obstacles.
    active
        Pairs (agent, obstacle) within range, shape (N, K) for each group.
    found
        Zones of each group.
    base
        The time at which the segment's own time is 0.
    """
    x = np.linspace(0.0, 1.0, SAMPLES + 1)
    share = 1.0
    for group, (pairs, rows) in enumerate(zip(active, found, strict=True)):
        if not len(rows) or not pairs.any():
            continue
        times = segment.t0 + base + x * (segment.t1 - segment.t0)
        paths = np.einsum("ka,aim->kim", _basis(x), B)
        distance = np.array([contacts.distances(group, q, float(t)) for q, t in zip(paths, times, strict=True)])
        distance = distance[:, pairs]
        for begin, end, width in rows:
            inside = np.clip(distance, begin, end)
            low, high = np.minimum.accumulate(inside), np.maximum.accumulate(inside)
            far = high - low > STRIDE * width
            for pair in np.flatnonzero(far.any(axis=0)):
                k = int(np.argmax(far[:, pair]))
                inwards = inside[k, pair] == low[k, pair]
                aim = AIMED * STRIDE * width
                goal = high[k, pair] - aim if inwards else low[k, pair] + aim
                before, after = distance[k - 1, pair], distance[k, pair]
                part = float(np.clip((goal - before) / (after - before), 0.0, 1.0)) if after != before else 1.0
                share = min(share, float(x[k - 1]) + part / SAMPLES)
    return share


def _basis(x: Array) -> Array:
    """Bernstein polynomials of degree 7 at some points, shape (points, 8)."""
    k = np.arange(8)
    return np.asarray([comb(7, int(a)) * x**a * (1 - x) ** (7 - a) for a in k]).T


def is_pointed(shape: Callable[..., Sequence[float]] | None, parameters: Sequence[object], reach: float) -> bool:
    """Whether the force of a pair has a limit other than zero at distance 0.

    Parameters
    ----------
    shape
        Formulas of the pair, see `flocking.engine.kernels.codegen`; the first is the force along the line between them.
    parameters
        Their parameters.
    reach
        Distance at which the first piece of the formulas ends; may be infinite.
    """
    if shape is None:
        return False
    size = reach if np.isfinite(reach) else 1.0
    try:
        found = [abs(float(shape(r, r, r, *parameters)[0])) for r in size * np.concatenate([[NEAR], FURTHER])]
    except (ValueError, ArithmeticError, TypeError):
        return False
    known = [x for x in found[1:] if np.isfinite(x)]
    return bool(np.isfinite(found[0]) and found[0] > POINTED * max(known, default=0.0))
