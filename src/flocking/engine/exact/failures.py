"""Errors that end a run of the exact engine."""

from __future__ import annotations

from flocking.errors import Chattering, LinkLost, NotFinite


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


def sliding(time: float, agents: tuple[int, ...]) -> Chattering:
    """The error for ``agents`` that do not leave a distance that they cross at ``time``."""
    return Chattering(
        "A pair crosses the same distance to and fro and does not leave it (a Filippov sliding mode). "
        "Use Hysteresis with a gap, or a potential that vanishes smoothly at the radius.",
        time=time, agents=agents,
    )  # fmt: skip


def infinite_at_once(time: float, agents: tuple[int, ...]) -> NotFinite:
    """The error for a link of ``agents`` that appears, at ``time``, at a distance where its energy is infinite."""
    return NotFinite(
        "A link appeared where its potential is infinite. Use Hysteresis with a gap.", time=time, agents=agents
    )
