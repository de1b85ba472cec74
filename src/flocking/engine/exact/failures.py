"""Why a run of the exact engine cannot go on, in words."""

from __future__ import annotations

from flocking.errors import Chattering, LinkLost, NotFinite


def link_lost(time: float, agents: tuple[int, ...]) -> LinkLost:
    """A link came to where its potential is infinite.

    Parameters
    ----------
    time, agents
        When, and whose.
    """
    return LinkLost(
        "A link whose potential is infinite at the break radius reached it. "
        "The energy of the start is not finite or the tolerance is too coarse; lower Scenario.tolerance.",
        time=time, agents=agents,
    )  # fmt: skip


def sliding(time: float, agents: tuple[int, ...]) -> Chattering:
    """A pair does not leave a distance that it crosses.

    Parameters
    ----------
    time, agents
        When, and who.
    """
    return Chattering(
        "A pair crosses the same distance to and fro and does not leave it (a Filippov sliding mode). "
        "Use Hysteresis with a gap, or a potential that vanishes smoothly at the radius.",
        time=time, agents=agents,
    )  # fmt: skip


def infinite_at_once(time: float, agents: tuple[int, ...]) -> NotFinite:
    """A link appeared at a distance where it has no finite energy.

    Parameters
    ----------
    time, agents
        When, and whose.
    """
    return NotFinite(
        "A link appeared where its potential is infinite. Use Hysteresis with a gap.", time=time, agents=agents
    )
