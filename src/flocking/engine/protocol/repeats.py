"""How the runs of an engine are made again, so that their differences show the error of the motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from flocking.engine.protocol.session import Session
from flocking.engine.runs.run import Run

MOST_WORK = 1e7
"""Largest work of a run that is repeated, in evaluations of pairs: about a minute, and its repetitions three."""


LOST = 1e-3
"""Difference of positions or velocities, as a share of the largest extent of those of the run, beyond which margins
that agree are no sign of a small error: motions that have nothing in common any more may have similar means.
"""


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
    steps
        Number of steps of the run; None where it is not known.
    most_work
        Largest work of a run that is repeated, in evaluations of pairs.
    pairs
        Pairs that a step evaluates; those of all agents when absent.
    lost
        Difference of the motions, as a share of their extent, beyond which they have nothing in common; larger where
        errors of steps are most of it, which shrink with the step.
    """

    sessions: tuple[Callable[[], Session], ...]
    kind: str
    how: str
    steps: int | None
    most_work: float = MOST_WORK
    pairs: float | None = None
    lost: float = LOST


def counted_steps(run: Run) -> int | None:
    """Number of steps that an engine recorded of a run; None where it did not."""
    steps = run.provenance.get("steps")
    return steps if isinstance(steps, int) else None
