"""How the runs of an engine are made again, so that their differences show the error of the motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from flocking.engine.protocol.session import Session

MOST_WORK = 1e7
"""Largest work of a run that is repeated, in evaluations of pairs: about a minute, and its repetitions three."""


@dataclass(frozen=True)
class Repeats:
    """Repetitions of a run.

    Parameters
    ----------
    sessions
        Each opens a session from the start of the scenario; where one is more accurate than another, the most accurate
        last.
    kind
        What differs in all of them from the run, in words.
    how
        What differs in the last, in words.
    most_work
        Largest work of a run that is repeated, in evaluations of pairs.
    """

    sessions: tuple[Callable[[], Session], ...]
    kind: str
    how: str
    most_work: float = MOST_WORK
