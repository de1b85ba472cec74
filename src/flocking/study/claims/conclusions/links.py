"""Claims about links and connectivity."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from flocking.model.graphs.connectivity import Links, components
from flocking.model.graphs.views import FieldOfView
from flocking.study.claims.claim import Measure, above
from flocking.study.claims.subjects import Subject, Witness, about
from flocking.study.evidence import Evidence, NotMeasurable, NotResolvable


def _outside_largest(links: Links, time: float) -> Witness:
    """The agents outside the largest flock."""
    flock = components(links)
    largest = int(np.bincount(flock).argmax())
    return Witness(time, tuple(int(i) for i in np.flatnonzero(flock != largest)))


def _first_split(e: Evidence) -> Witness:
    links = next((links for t, links in e.link_looks if t == e.seen_disconnected), e.link_looks[-1][1])
    return _outside_largest(links, float(e.seen_disconnected))


def _split_at_start(e: Evidence) -> Witness:
    time, links = e.link_looks[0]
    return _outside_largest(links, time)


def _first_break(e: Evidence) -> Witness:
    rows = e.link_switches[e.link_switches["kind"] == "break"]
    return Witness.pair(rows["time"][0], rows["i"][0], rows["j"][0])


def _slowest_crossing(e: Evidence) -> Witness:
    row = e.link_switches[np.abs(e.link_switches["speed"]).argmin()]
    return Witness.pair(row["time"], row["i"], row["j"])


@about(Subject.CONNECTIVITY, _first_split, lasting=True, with_errors=True)
def stays_connected(e: Evidence) -> Measure:
    """Whether the graph is connected after every switch; frames alone can refute it but not show it.

    One-way links connect both agents (weakly connected), which the note states.
    """
    if e.seen_disconnected == np.inf:
        e.first_disconnected  # noqa: B018  raises where it is not known
    if e.switches_known and e.law.graph.moves:
        if e.run.accuracy is None:
            return _connected_as_computed(e)
        certain, doubtful = e.connection
        if certain == np.inf and doubtful:
            return Measure(1.0, np.inf, e.doubt_note())
    elif e.fixed_step and e.law.graph.moves and (e.seen_disconnected > e.run.scenario.start.t or e.connected_at_start):
        return _connected_as_computed(e)
    if e.seen_disconnected == np.inf:
        return Measure(1.0, 0.0, f"connected after each of {len(e.link_switches)} switches{_either_way(e)}")
    decided = certain if e.switches_known and e.law.graph.moves else e.seen_disconnected
    return Measure(-1.0, 0.0, f"fell apart {_when_apart(e, e.seen_disconnected)}", decided=decided)


def _either_way(e: Evidence) -> str:
    """Of one-way links connected is what is so without their directions; strongly connected would be more."""
    return " by links in either direction" if e.law.graph.directed else ""


def _when_apart(e: Evidence, lost: float, ended: str = "") -> str:
    """When the graph was disconnected, and in how many flocks it ``ended``, as that is known, in words."""
    # A finished run may have gone on beyond its scenario, or have no frames.
    end = float(max([e.run.scenario.t_end, *e.run.t[-1:]] if e.run.finished else e.t))
    try:
        flocks = f"; {e.flocks_at_end} flocks at the end{ended}"
    except NotResolvable:
        flocks = ""
    return f"at t = {e.when(lost, 3)} of {e.when(end, 6)}{flocks}"


def _connected_as_computed(e: Evidence) -> Measure:
    """What the computed motion shows where its errors are not stated.

    It refutes that the graph stays connected where agents are too far apart for any error that repetitions estimate,
    and decides nothing else.
    """
    apart = e.seen_disconnected < np.inf
    certain = _decided(e.apart_for_certain, np.inf) if apart else np.inf
    if certain < np.inf:
        note = f"fell apart {_when_apart(e, certain, ', as computed')}; {e.repetitions.note}"
        return Measure(-1.0, 0.0, note, decided=certain)
    if apart:
        seen = f"falls apart {_when_apart(e, e.seen_disconnected)}"
    else:
        seen = f"is connected after each of {len(e.link_switches)} switches{_either_way(e)}"
    return Measure(-1.0 if apart else 1.0, math.nan, f"the motion as computed {seen}; {_open(e)}")


def _decided(look: Callable[[], float], otherwise: float) -> float:
    """What a ``look`` at frames within their estimated errors gives; ``otherwise`` where these are not known."""
    try:
        return look()
    except (NotMeasurable, NotResolvable):
        return otherwise


def _open(e: Evidence) -> str:
    """That it is open whether the exact motion does the same, with the reason why its errors are not known."""
    try:
        e.accuracy  # noqa: B018  raises the reason
        why = ""
    except NotResolvable as reason:
        why = str(reason)
    return f"whether the exact one does is open: {why}"


@about(Subject.LINKS, _first_break, lasting=True, with_errors=True)
def no_link_lost(e: Evidence) -> Measure:
    """Number of links that broke; frames alone can refute that there are none but not show it."""
    computed = e.law.graph.moves and e.motion_unstated and not e.in_discrete_time
    if computed and e.seen_lost and (lost := _decided(e.lost_for_certain, 0)):
        return Measure(0.5 - lost, 0.0, f"at least {lost} lost; {e.repetitions.note}")
    if e.seen_lost and not e.switches_known:
        note = f"at least {e.seen_lost} lost"
        if computed:
            return Measure(0.5 - e.seen_lost, math.nan, f"{note} by the motion as computed; {_open(e)}")
        return Measure(0.5 - e.seen_lost, 0.0, note)
    certain, most = e.numbers("break")
    if not certain and most:
        return Measure(0.5 - most, np.inf, e.doubt_note("break"))
    times = e.link_switches["time"][e.link_certain & (e.link_switches["kind"] == "break")]
    decided = float(times[0]) if len(times) else np.inf
    return Measure(0.5 - certain, 0.0, f"{e.links_lost} lost, {e.links_created} created", decided=decided)


@about(Subject.LINKS, _slowest_crossing, lasting=True)
def crossings_transversal(e: Evidence) -> Measure:
    """Smallest speed across a border at a switch: of a pair distance, or across a side of a field of view."""
    switches = e.link_switches
    if len(e.link_doubts) or e.known_until < np.inf:
        return Measure(0.0, np.inf, e.doubt_note())
    if len(switches) == 0:
        return Measure(np.inf, 0.0, "no switch")
    speeds = np.abs(switches["speed"])
    slowest = float(speeds.min())
    error = slowest - float((speeds - switches["speed_error"]).min())
    rate = "speed" if isinstance(e.law.graph, FieldOfView) else "|dr/dt|"
    note = f"slowest crossing {rate} = {slowest:.2e} of {len(switches)}"
    return above(slowest, 0.0, note, error if error > 0 else 0.0)


@about(Subject.CONNECTIVITY, _split_at_start, with_errors=True, lasting=True)
def starts_connected(e: Evidence) -> Measure:
    """Whether the graph is connected at the start."""
    holds = e.connected_at_start
    note = f"starts connected{_either_way(e)}" if holds else "starts disconnected"
    return Measure(1.0 if holds else -1.0, 0.0, note, everywhere=False)


def needs_switching(e: Evidence) -> str:
    """Why there are no switches: the graph is fixed."""
    return "" if e.law.graph.moves else "the graph is fixed"
