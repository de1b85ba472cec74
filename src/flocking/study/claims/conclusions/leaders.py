"""The term that follows a leader, and its gains, as conclusions about leaders read them from a run's own law."""

from __future__ import annotations

import numpy as np

from flocking.model.terms.body_terms import Track
from flocking.model.terms.schedules import Schedule
from flocking.study.evidence import Evidence, NotMeasurable


def tracking(e: Evidence) -> Track:
    """The term that follows the leader.

    Raises
    ------
    NotMeasurable
        When the law has none.
    """
    found = next((term for term in e.law.body_terms if isinstance(term, Track)), None)
    if found is None:
        raise NotMeasurable("the law has no leader to follow")
    return found


def one_gain(track: Track, name: str) -> float:
    """A gain that is the same for all agents at all times.

    Parameters
    ----------
    track
        The term.
    name
        ``"position_gain"``, ``"velocity_gain"`` or ``"acceleration_gain"``.

    Raises
    ------
    NotMeasurable
        When it differs between agents or times: closed forms are of one gain.
    """
    gain = getattr(track, name)
    if isinstance(gain, Schedule) or np.ptp(np.asarray(gain)) > 0.0:
        raise NotMeasurable(f"the closed form is of one {name} for all agents and times")
    return float(np.max(np.asarray(gain)))
