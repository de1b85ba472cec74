"""Records of the pairs that switch."""

from __future__ import annotations

import numpy as np

from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.exact.companion import SAFETY
from flocking.engine.exact.crossings.switch_numbers import DIFFERENCED, pair_speed
from flocking.engine.exact.crossings.switching import Crossing, LinkState
from flocking.engine.exact.crossings.view_guards import ViewGuard
from flocking.engine.exact.origin import Origin
from flocking.engine.exact.recorder import ExactRecorder
from flocking.engine.exact.solution_error import SolutionError
from flocking.engine.imperfect.view_switches import crosses_radius
from flocking.engine.runs.run import is_tangential
from flocking.model.checks import Array


def write_rows(recorder: ExactRecorder, rows: Array, links: LinkState, origin: Origin) -> None:
    """Record switches that the native loop has applied.

    Parameters
    ----------
    recorder
        Takes the records.
    rows
        The switches, see `flocking.engine.exact.blocks.arrays.SWITCHED_AT`.
    links, origin
        Their watches, and the origin of their times.
    """
    for w, i, j, own, speed, relative, late, drift, inward, *_ in rows.tolist():
        watch = links.watches[int(w)]
        if watch.kind in ("obstacle", "rim"):
            if watch.kind == "obstacle":
                group, at = watch.graph - len(links.graphs), origin.time_at(own)
                row = links.contacts.row(group, at, int(i), int(j), speed, relative)
                recorder.switches.append((*row, late, drift))
            continue
        kind = "kink" if watch.kind == "kink" else "appear" if inward else "break"
        slow = is_tangential(speed, relative)
        recorder.switches.append(
            (origin.time_at(own), int(i), int(j), kind, watch.graph, speed, slow, late, drift)
        )  # fmt: skip


def _across_border(
    pair: tuple[int, int],
    distance: float,
    watch: int,
    segment: Segment,
    links: LinkState,
    error: SolutionError,
    late: float,
) -> tuple[float, float, float] | None:
    """How fast an agent leaves a field of view across its sides, negative when it comes in, with the size of the motion
    and the error of the speed, at a time with the error ``late``; None for others, and where nothing moved before.
    """
    view = links.view_of(watch)
    if view is None or not segment.t1 > segment.t0:
        return None
    y, e = segment.coefficients[-1], error.difference.nodes[-1]
    slope, other_slope = error.slopes(segment)
    inside, rate, size = view.border_speed(pair, y, slope)
    if crosses_radius(float(links.watches[watch].leave[pair[0]]), distance, inside):
        return None
    other = view.border_speed(pair, y + e, other_slope)[1]
    known = error.over(segment)
    if known.lost or not distance > 0.0:
        return -rate, size, np.inf
    off = SAFETY * abs(other - rate) + 2.0 * known.p_floor + known.q_floor * size / distance
    off += abs(_change_of_border_speed(pair, segment, view)) * late
    return -rate, size, off if np.isfinite(off) else np.inf


def _change_of_border_speed(pair: tuple[int, int], segment: Segment, view: ViewGuard) -> float:
    """Rate of change, at the end of a step, of the speed at which an agent crosses a side of a field of view."""
    span = DIFFERENCED * (segment.t1 - segment.t0)
    before, rate = (
        view.border_speed(pair, *segment.with_slope(t))[1] for t in (segment.t1 - span, segment.t1)
    )  # fmt: skip
    return (rate - before) / span


def write_switch(
    recorder: ExactRecorder,
    crossing: Crossing,
    segment: Segment,
    q: Array,
    p: Array,
    links: LinkState,
    error: SolutionError,
    origin: Origin,
) -> tuple[int, ...]:
    """Record the switches of a crossing; returns the pair that chatters, if one does.

    Parameters
    ----------
    recorder
        Takes the records.
    crossing
        The pairs that cross at the end of ``segment``.
    q, p
        Positions and velocities there, relative to ``origin``, shape (N, m).
    links
        Links before they switch.
    """
    watch = links.watches[crossing.watch]
    near = links.near[crossing.watch]
    chattering: tuple[int, ...] = ()
    own, time = segment.t1, origin.time_at(segment.t1)
    for k, (i, j) in enumerate(crossing.pairs):
        if watch.kind in ("obstacle", "rim"):
            record = links.contacts.record(watch.graph - len(links.graphs), time, q, p, (i, j))
            errors = error.crossing(crossing, k, record[5], segment, links)
            if watch.kind == "obstacle":
                recorder.switches.append((*record, *errors))
            if links.slides(crossing, k, own, record[5]):
                chattering = (int(i),)
            continue
        d, v = links.space.displacement(q[j] - q[i]), p[j] - p[i]
        speed, size = pair_speed(d, v)
        kind = "kink" if watch.kind == "kink" else "break" if near[i, j] else "appear"
        errors = error.crossing(crossing, k, speed, segment, links)
        across = _across_border(
            (int(i), int(j)), float(np.linalg.norm(d)), crossing.watch, segment, links, error, errors[0]
        )
        if across is not None:
            speed, size, errors = across[0], across[1], (errors[0], across[2])
        slow = is_tangential(speed, size)
        recorder.switches.append((time, int(i), int(j), kind, watch.graph, speed, slow, *errors))
        if links.slides(crossing, k, own, speed):
            chattering = (int(i), int(j))
    return chattering
