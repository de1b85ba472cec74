"""Claims about links and connectivity."""

from __future__ import annotations

import numpy as np

from flocking.study.claims import Measure, above
from flocking.study.evidence import Evidence, NotResolvable


def stays_connected(e: Evidence) -> Measure:
    """Whether the graph is connected at all times; every switch is looked at.

    Where switches are not recorded, frames can refute it but not show it.
    """
    if e.seen_disconnected == np.inf and e.first_disconnected == np.inf:
        return Measure(1.0, 0.0, f"connected after each of {len(e.link_switches)} switches")
    lost, end = e.seen_disconnected, e.run.scenario.t_end if e.run.finished else float(e.t[-1])
    try:
        flocks = f"; {e.flocks_at_end} flocks at the end"
    except NotResolvable:
        flocks = ""
    return Measure(-1.0, 0.0, f"fell apart at t = {lost:.3g} of {end:g}{flocks}")


def no_link_lost(e: Evidence) -> Measure:
    """Number of links that broke. Where switches are not recorded, frames can refute it but not show it."""
    if e.seen_lost and not e.switches_known:
        return Measure(0.5 - e.seen_lost, 0.0, f"at least {e.seen_lost} lost")
    return Measure(0.5 - e.links_lost, 0.0, f"{e.links_lost} lost, {e.links_created} created")


def crossings_transversal(e: Evidence) -> Measure:
    """Smallest rate of change of a pair distance at a switch."""
    switches = e.link_switches
    if len(switches) == 0:
        return Measure(np.inf, 0.0, "no switch")
    slowest = float(np.abs(switches["speed"]).min())
    return above(slowest, 0.0, f"slowest crossing |dr/dt| = {slowest:.2e} of {len(switches)}", 1e-9)


def starts_connected(e: Evidence) -> Measure:
    """Whether the graph is connected at the start."""
    holds = e.connected_at_start
    note = "starts connected" if holds else "starts disconnected"
    return Measure(1.0 if holds else -1.0, 0.0, note, everywhere=False)


def needs_switching(e: Evidence) -> str:
    """A fixed graph has no switches."""
    return "" if e.law.graph.moves else "the graph is fixed"
