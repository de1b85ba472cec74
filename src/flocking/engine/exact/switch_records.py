"""Records of the pairs that switch."""

from __future__ import annotations

from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.exact.crossings.switch_numbers import pair_speed
from flocking.engine.exact.crossings.switching import Crossing, LinkState
from flocking.engine.exact.origin import Origin
from flocking.engine.exact.recorder import ExactRecorder
from flocking.engine.exact.solution_error import SolutionError
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
        slow = is_tangential(speed, size)
        kind = "kink" if watch.kind == "kink" else "break" if near[i, j] else "appear"
        errors = error.crossing(crossing, k, speed, segment, links)
        recorder.switches.append((time, int(i), int(j), kind, watch.graph, speed, slow, *errors))
        if links.slides(crossing, k, own, speed):
            chattering = (int(i), int(j))
    return chattering
