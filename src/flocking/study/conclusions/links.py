"""Claims about links and connectivity."""

from __future__ import annotations

import numpy as np

from flocking.study.claims import Measure, above
from flocking.study.evidence import Evidence


def stays_connected(e: Evidence) -> Measure:
    """Whether the graph is connected at all times; every switch is looked at.

    Where switches are not recorded, frames can refute it but not show it.
    """
    if e.first_disconnected == np.inf and not e.switches_known and e.law.graph.moves:
        where = "" if e.sampled else "; engine='exact' locates every switch"
        return Measure(1.0, np.inf, f"connected at each of {e.looks} frames, nothing is known between{where}")
    if e.first_disconnected == np.inf:
        return Measure(1.0, 0.0, f"connected after each of {len(e.link_switches)} switches")
    lost, end = e.first_disconnected, e.run.scenario.t_end if e.run.finished else float(e.run.t[-1])
    return Measure(-1.0, 0.0, f"fell apart at t = {lost:.3g} of {end:g}; {e.flocks_at_end} flocks at the end")


def no_link_lost(e: Evidence) -> Measure:
    """Number of links that broke."""
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
    return Measure(1.0 if holds else -1.0, 0.0, "starts connected" if holds else "starts disconnected")


def needs_switches(e: Evidence) -> str:
    """Samples do not show when links switch, nor a link that comes and goes between two of them."""
    return "out of reach: samples do not show the switches" if e.sampled else needs_switching(e)


def needs_switching(e: Evidence) -> str:
    """A fixed graph has no switches, and some engines record none."""
    if e.run.provenance.get("switches") == "not recorded":
        return f"out of reach: the engine {e.run.provenance['engine']} records no switches; engine='exact' locates them"
    return "" if e.law.graph.moves else "the graph is fixed"
