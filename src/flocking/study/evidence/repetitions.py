"""Errors of motions whose engine states none, estimated by repeating the run.

With delays, and of engines with fixed steps, it is repeated with more accurate steps.
The difference of a run from one whose error is much smaller is its error, whether the motion amplifies the errors of
steps or damps them (Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993, section II.4, on global
errors). A smaller tolerance alone does not make a run more accurate: steps that end at the delay are the same for all
tolerances. So the longest step is shortened too.

Under held control the motion between two changes is exact to rounding, and so it is in discrete time. What rounding
grows to is shown by repetitions with random errors that are larger than those of rounding, as in stochastic arithmetic
(Vignes, A stochastic arithmetic for reliable scientific computation, Mathematics and Computers in Simulation 35, 1993).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Reals
from flocking.engine.driver.registry import entry_named
from flocking.engine.protocol.repeats import LOST
from flocking.engine.protocol.session import Session
from flocking.engine.runs.run import Run
from flocking.errors import FlockingError
from flocking.study.evidence.basis import NotResolvable

SAFETY = 4.0
"""Ratio of stated errors to the differences found, as that of the exact engine's own estimate."""

SHRUNK = 0.5
"""Largest difference of the last two repetitions over that of the run from the last, where that is above the usual
bound: errors of order 1 in the step leave a third of it, those that grow by themselves all of it."""

STEP = 500
"""Work of a step besides its pairs."""


LEAST_EXTENT = 1e-9
"""Share of the way of a group, or of its speed, that counts as its extent at least: far above what rounding adds."""


@dataclass(frozen=True, eq=False)
class Repetitions:
    """A run repeated.

    Parameters
    ----------
    runs
        The repetitions; where one is more accurate than another, the most accurate last.
    share
        Largest difference of the run, or of another repetition, from the last, as a share of the largest extent of its
        positions or of its velocities.
    note
        How errors are estimated, in words.
    """

    runs: tuple[Run, ...]
    share: float
    note: str = ""

    def position_errors(self, run: Run) -> Array:
        """Estimated errors of positions of a ``run`` at its frames: four times those found till then, shape (F,)."""
        *others, best = run, *self.runs
        found = [np.linalg.norm(np.asarray(other.q - best.q, dtype=np.float64), axis=2).max(axis=1) for other in others]
        return SAFETY * np.maximum.accumulate(np.max(found, axis=0))

    def error(self, margin: float, margins: Sequence[float]) -> float:
        """Estimated error of a margin.

        Four times the largest difference from that of the last repetition, and no less than the share by
        which the motions differ: margins of few values, or at frames where two motions cross, may agree by chance.

        Parameters
        ----------
        margin
            That of the run.
        margins
            Those of the repetitions.
        """
        *others, best = margin, *margins
        # One that is no number leaves none.
        return SAFETY * float(np.max([*(abs(other - best) for other in others), self.share * abs(margin)]))


def repetitions_of(run: Run) -> Repetitions:
    """Repeat a run of an engine that states how.

    Parameters
    ----------
    run
        The run.

    Raises
    ------
    NotResolvable
        When it was made by another engine, has not finished, is too large, or differs too much from its repetitions.
    """
    entry = entry_named(run.fidelity.engine)
    try:
        repeats = None if entry is None else entry.load().repeats(run)
    except FlockingError:  # The package that has the engine is broken or gone.
        repeats = None
    if repeats is None:
        raise NotResolvable("")
    if run.fidelity.changed:
        raise NotResolvable("a run that was changed while it went on is not repeated")
    steps = repeats.steps
    if not run.finished or steps is None:
        raise NotResolvable("a run that has not finished is not repeated")
    pairs = run.n**2 if repeats.pairs is None else repeats.pairs
    if not steps * (STEP + pairs) <= repeats.most_work:
        raise NotResolvable(f"{steps} steps of {run.n} agents are too many to repeat")
    runs = tuple(_repeated(run, opened) for opened in repeats.sessions)
    shares = [_share(one, runs[-1], run) for one in (run, *runs[:-1])]
    share = max(shares)
    if not share <= (repeats.lost if shares[-1] <= SHRUNK * shares[0] else min(repeats.lost, LOST)):
        raise NotResolvable(f"repetitions {repeats.kind} differ from it by {share:.1e} of its extent")
    return Repetitions(runs, share, f"error estimated from {len(runs)} repetitions, {repeats.how}")


def _repeated(run: Run, opened: Callable[[], Session]) -> Run:
    """The run once more, by a session that is ``opened`` for it."""
    try:
        session = opened()
        session.advance(run.scenario.t_end)
        found = session.run()
        session.close()
    except FlockingError as error:
        raise NotResolvable(f"a repetition failed: {error}") from None
    if not found.finished or not np.array_equal(found.t, run.t):
        raise NotResolvable("a repetition has other frames")
    return found


def _share(one: Run, best: Run, run: Run) -> float:
    """Largest difference of two runs as a share of the extent of the positions or velocities of a ``run``.

    One agent, and agents of one velocity, have none: the way that they go and their speed count by `LEAST_EXTENT`.
    """
    way, speed = float(np.ptp(run.q, axis=(0, 1)).max(initial=0.0)), float(np.abs(run.p).max(initial=0.0))
    return max(_relative(one.q, best.q, run.q, way), _relative(one.p, best.p, run.p, speed))


def _relative(one: Reals, best: Reals, values: Reals, size: float) -> float:
    difference = float(np.abs(one - best).max(initial=0.0))
    extent = max(float(np.ptp(values, axis=1).max(initial=0.0)), LEAST_EXTENT * size)
    if difference == 0.0:
        return 0.0
    return difference / extent if extent > 0.0 else np.inf
