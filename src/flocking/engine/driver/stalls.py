"""Runs that hardly advance: noticed between two slices of a run, and reported once."""

from __future__ import annotations

import warnings

from flocking.engine.adaptive_steps.step_lengths import TOO_MANY_STEPS
from flocking.engine.protocol.session import Session
from flocking.errors import HardlyAdvances

STALLED_STEPS = 2000
"""Steps that must have been too short on average before a run counts as stalled: forty times those that it looks at."""


class Pace:
    """How far a run came with its last steps.

    Parameters
    ----------
    session
        The session at its start.
    """

    def __init__(self, session: Session) -> None:
        scenario = session.scenario
        self._least = (scenario.t_end - scenario.start.t) / TOO_MANY_STEPS
        self._time, self._steps = session.time, session.steps

    def stalled(self, session: Session) -> str:
        """Why a session hardly advances, if its last steps were on average too short to end the run; else empty."""
        made = session.steps - self._steps
        if made < STALLED_STEPS:
            return ""
        advanced = session.time - self._time
        self._time, self._steps = session.time, session.steps
        return "" if session.shrunk is None or advanced >= made * self._least else str(session.shrunk)


class StallWarning:
    """Warns once when a run hardly advances: nobody may look at its progress.

    Parameters
    ----------
    session
        The session at its start.
    """

    def __init__(self, session: Session) -> None:
        self._pace, self._warned = Pace(session), False

    def look(self, session: Session) -> None:
        """Look at the session between two slices."""
        why = "" if self._warned else self._pace.stalled(session)
        if why:
            self._warned = True
            warnings.warn(
                f"The run hardly advances at t = {session.time:.9g}: {why}. It goes on, and may never end; Ctrl-C "
                "ends it and keeps what was computed. A common cause: agents that are limited, late or disturbed are "
                "not held back before the distance at which a potential is infinite, or the velocity of a leader "
                "changes faster and faster.",
                HardlyAdvances, stacklevel=4,
            )  # fmt: skip
