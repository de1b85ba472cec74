"""Errors that end a run of the exact engine."""

from __future__ import annotations

from flocking.errors import Chattering, LinkLost, NotFinite, OutOfPrecision, SimulationError


def link_lost(time: float, agents: tuple[int, ...]) -> LinkLost:
    """The error for a link of ``agents`` that reached, at ``time``, the distance where its potential is infinite."""
    return LinkLost(
        "A link whose potential is infinite at the break radius reached it. "
        "The energy of the start is not finite or the tolerance is too coarse; lower Scenario.tolerance.",
        time=time, agents=agents,
    )  # fmt: skip


def held_back(time: float, agents: tuple[int, ...]) -> LinkLost:
    """The error for a link of ``agents`` at ``time`` that limits of their bodies keep the law from holding."""
    return LinkLost(
        "A link reaches the break radius, where its potential is infinite: limits of the bodies keep the force that "
        "would hold it from acting. Raise the limits, or start with less energy.",
        time=time, agents=agents,
    )  # fmt: skip


def unresolved(time: float, agents: tuple[int, ...], gap: float, *, at_break: bool) -> SimulationError:
    """The error for linked ``agents`` that come nearer to an infinite potential than positions resolve forces.

    Parameters
    ----------
    gap
        How far they are from there.
    at_break
        Whether that is the break radius, which ends links; otherwise it is contact.
    """
    kind, place = (LinkLost, "the break radius") if at_break else (OutOfPrecision, "contact")
    return kind(
        f"A linked pair is {gap:.2g} from {place}, where its potential is infinite: what its bodies do beside the law, "
        "as a lag or a limit, keeps the force that holds it from acting in time. So near to it positions do not "
        "resolve forces to the tolerance, and the run cannot go on. Shorten the lag, raise the limits, or start with "
        "less energy.",
        time=time, agents=agents,
    )  # fmt: skip


def sliding(time: float, agents: tuple[int, ...]) -> Chattering:
    """The error for ``agents`` that do not leave a distance, or border of a view, that they cross at ``time``."""
    return Chattering(
        "A pair crosses the same distance, or border of a field of view, to and fro and does not leave it (a Filippov "
        "sliding mode). Use Hysteresis with a gap, or a force that vanishes smoothly at the radius. Fields of view "
        "have no memory of links: hold the control, as control=fk.Held(0.01), under which agents look at ticks alone.",
        time=time, agents=agents,
    )  # fmt: skip


def together(time: float, agents: tuple[int, ...]) -> Chattering:
    """The error for ``agents`` that pass each other at ``time`` again and again at one point."""
    return Chattering(
        "Two agents stay at one point, where their force has no direction and turns round as they pass (a Filippov "
        "sliding mode). Use a potential whose slope is 0 at distance 0, such as sqrt(r**2 + a**2) in place of r.",
        time=time, agents=agents,
    )  # fmt: skip


def infinite_at_once(time: float, agents: tuple[int, ...]) -> NotFinite:
    """The error for a link of ``agents`` that appears, at ``time``, at a distance where its energy is infinite."""
    return NotFinite(
        "A link appeared where its potential is infinite. Use Hysteresis with a gap.", time=time, agents=agents
    )
