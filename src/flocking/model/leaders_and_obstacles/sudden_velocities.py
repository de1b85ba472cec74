"""Times at which the velocity of a leader changes suddenly: jumps, kinks and pulses that a long step would not show.

The error of an adaptive step is estimated from the slopes at its stages. A velocity that is quiet at all of them and
moves between them leaves no trace there: the step, and every finer one of a tighter tolerance, would miss it.
"""

from __future__ import annotations

import numpy as np

from flocking.formula.grammar import has_pieces
from flocking.model.checks import Array
from flocking.model.leaders_and_obstacles.leaders import Leader, Path

NODES = 9
"""Places of a piece through which a polynomial of degree 8 is laid: steps of order 8 resolve what it does."""

INSIDE = 1e-9
"""Share of a piece by which its outermost places lie inside: above the rounding of the times at its ends, and so little
that a velocity which fits a polynomial changes by less than `FITS` there."""

FITS = 1e-3
"""Largest difference of that polynomial from the velocity between them, as a share of the largest speed: what it fits
so well cannot have a pulse between the stages of a step that is no longer than the piece."""

BOUNDED = 0.25
"""How much of the largest speed a proven bound on a piece may exceed the speeds at these places: bounds by interval
arithmetic are too wide on long pieces, and a pulse is higher."""

SHORT = 1 / 16
"""Pieces no longer than this share of the longest one are short: steps that resolve the rest may jump over them. Where
all pieces are alike, as of a sine, every step meets what it has to resolve."""

ROUNDED = 1e-14
"""Rounding of a computed time of a condition, as a share of the times: forty units, with room for roots."""

JUMPS = 1e-9
"""Largest change of a velocity within that rounding, as a share of it, that counts as none: without a jump it would
change by all of itself in a hundred thousandth of the time."""

MOST_KNOWN = 1000
"""Most leaders whose times are cached; a thousand are more than one process follows at a time."""

_known: dict[object, tuple[float, ...]] = {}
"""Times found so far, by leader and interval of time."""

MOST, HALVINGS = 256, 30
"""Most pieces that are divided at a time, those with the highest bounds, and how often: to 2^-30 of the time."""


def sudden_times(leader: Leader, start: float, end: float) -> tuple[float, ...]:
    """Times in (start, end] at which steps have to end, so that none jumps over what the leader's velocity does.

    They are the times at which a condition of ``where`` or the sign in an ``abs`` of its formula changes, the first one
    after it where the velocity jumps there, and the ends of pieces of time that are short because a pulse falls into
    them. Pulses are found where a bound by interval
    arithmetic exceeds the speeds at some places, however short they are; pulses of less than a quarter of the
    largest speed only where these places show them.

    Parameters
    ----------
    leader
        The leader.
    start, end
        What lies between is looked at.
    """
    # A position in closed form is one of sums of products of polynomials, exp, sin and cos, which have no pulses.
    if leader.closed_form or not (np.isfinite(start) and np.isfinite(end) and start < end):
        return ()
    key = type(leader), leader.structure, tuple(leader.parameters.items()), start, end
    if key not in _known:
        if len(_known) >= MOST_KNOWN:
            _known.clear()
        _known[key] = _found(leader, start, end)
    return _known[key]


def _found(leader: Leader, start: float, end: float) -> tuple[float, ...]:
    wide = ROUNDED * max(abs(start), abs(end), end - start)
    around = _breaks(leader, start - wide, end + wide)
    breaks = [x for x in around if start < x < end]
    edges = np.array([start, *breaks, end])
    pieces = _pieces(leader, edges[:-1], edges[1:])
    lengths = pieces[:, 1] - pieces[:, 0]
    short = pieces[lengths <= SHORT * lengths.max()] if len(pieces) else pieces
    first = {x for x in (_first_after(leader, x, wide) for x in around) if start < x <= end}
    return tuple(sorted({*first, *(float(x) for x in short.ravel() if start < x < end and x not in breaks)}))


def _first_after(leader: Leader, near: float, wide: float) -> float:
    """The first number at which a velocity that jumps ``near`` a time has jumped; that time where it does not.

    Whether the time itself is before the jump or after it depends on the condition, ``t < s`` or ``t <= s``.
    """
    low, high = near - wide, near + wide
    before, after = leader.velocity_at(low), leader.velocity_at(high)
    if not np.abs(after - before).max() > JUMPS * (np.abs(before) + np.abs(after)).max():
        return near
    while np.nextafter(low, np.inf) < high:
        middle = 0.5 * (low + high)
        now = leader.velocity_at(middle)
        jumped = np.abs(now - after).max() < np.abs(now - before).max()
        low, high = (low, middle) if jumped else (middle, high)
    return float(high)


def _breaks(leader: Leader, start: float, end: float) -> list[float]:
    """Times at which the formula of the velocity passes from one piece to the next."""
    if type(leader) is Path and not any(has_pieces(f.tree) for f in leader.formulas):
        return []
    import sympy

    from flocking.model.leaders_and_obstacles.leader_positions import jump_times

    given, t = leader.parameters, sympy.Symbol("t", real=True)
    velocity = leader.velocity(t, lambda name: sympy.Float(given[name]))
    signs = [sympy.Piecewise((x.args[0], x.args[0] > 0), (0, True)) for v in velocity for x in v.atoms(sympy.Abs)]
    return jump_times([*velocity, *signs], t, start, end)


def _pieces(leader: Leader, a: Array, b: Array) -> Array:
    """Pieces of the intervals [a, b] on each of which the velocity is resolved, rows (begin, end)."""
    places = 0.5 - 0.5 * np.cos(np.pi * np.arange(NODES) / (NODES - 1))
    between = 0.5 * (places[:-1] + places[1:])
    weights = np.linalg.solve(np.vander(places).T, np.vander(between, NODES).T).T
    found, scale = [], 0.0
    for _ in range(HALVINGS):
        # Just inside, for the ends may belong to another piece of the formula.
        inner = np.clip(np.concatenate([places, between]), INSIDE, 1.0 - INSIDE)
        times = a[:, None] + (b - a)[:, None] * inner
        v = leader.velocities_at(times.ravel()).reshape(*times.shape, -1)
        speed = np.sqrt((v**2).sum(axis=2)).max(axis=1)
        scale = max(scale, float(speed[np.isfinite(speed)].max(initial=0.0)))
        off = np.sqrt(((v[:, NODES:] - weights @ v[:, :NODES]) ** 2).sum(axis=2)).max(axis=1)
        bound = leader.speed_bounds(a, b)
        high = np.isfinite(bound) & (bound > speed + BOUNDED * scale)
        rough = high | (off > FITS * scale)
        found.append(np.stack([a, b], axis=1)[~rough])
        a, b, bound = a[rough], b[rough], bound[rough]
        if len(a) > MOST:
            kept = np.sort(np.argsort(-bound, kind="stable")[:MOST])
            a, b = a[kept], b[kept]
        if not len(a):
            break
        middle = 0.5 * (a + b)
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
    return np.concatenate(found)
