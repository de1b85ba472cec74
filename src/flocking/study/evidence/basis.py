"""The base of all evidence: the run, what was recorded of it, and whether its numbers are usable."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from flocking.arrays import Reals, Records
from flocking.engine.runs.fidelity import Fidelity
from flocking.engine.runs.message_log import changed_times
from flocking.engine.runs.run import Run
from flocking.formula.safe_digits import time_text
from flocking.model.checks import Array
from flocking.model.graphs.distance_graphs import pair_distances
from flocking.model.law import Law
from flocking.model.state import State
from flocking.study.trajectory import unseen_links

UNSEEN = 0.1
"""Share of a run after its last frame beyond which nothing is concluded from its end: limits are of its last tenth."""

MOST_DENSE = 4000
"""Largest group whose pairs are evaluated all at once, a bound on memory: 16 million pairs."""

LARGEST = 1e100
"""Larger positions, velocities and energies are refused: products of three of them overflow."""


class NotMeasurable(Exception):  # noqa: N818  a verdict, not a fault
    """A quantity that cannot be computed from this run; a claim that needs it is not applicable."""


class NotResolvable(Exception):  # noqa: N818  a verdict, not a fault
    """A quantity that exists but is undecided by this run; a claim that needs it is not resolved."""


def stated(value: float, what: str) -> float:
    """A number that a run states about itself.

    Parameters
    ----------
    value
        The number; NaN where it is not known.
    what
        What it is, for the message.

    Raises
    ------
    NotResolvable
        When it is not known.
    """
    if not np.isfinite(value):
        raise NotResolvable(f"the run does not state {what}")
    return value


class RunEvidence:
    """A run and how it was made.

    Claims read times, positions, velocities and the ledger here and not from the run, so that unusable numbers leave
    them unresolved.

    Parameters
    ----------
    run
        The run.
    """

    def __init__(self, run: Run) -> None:
        self.run = run

    @property
    def law(self) -> Law:
        """The declared law."""
        return self.run.scenario.law

    @property
    def fidelity(self) -> Fidelity:
        """What the run states about its accuracy."""
        return self.run.fidelity

    @property
    def sampled(self) -> bool:
        """Whether the run consists of samples, with nothing known between them."""
        return self.fidelity.sampled

    @property
    def velocity_error(self) -> float:
        """Estimated error of any component of a velocity that was computed from positions; 0 for other velocities."""
        return self._stated_error("velocity_error", self.fidelity.velocity_error)

    @property
    def position_error(self) -> float:
        """Estimated error of any coordinate of a sampled position; 0 where it is taken as exact."""
        return self._stated_error("position_error", self.fidelity.position_error)

    @property
    def distance_error(self) -> float:
        """Error of a distance of two sampled agents from those of their positions."""
        return 2.0 * self.position_error * float(np.sqrt(self.run.q.shape[2]))

    @staticmethod
    def _stated_error(name: str, error: float) -> float:
        if not 0.0 <= error <= LARGEST:
            raise NotResolvable(f"the run states no usable {name.replace('_', ' ')}")
        return error

    @property
    def motion_unstated(self) -> bool:
        """Whether nothing is known of the errors of computed positions and velocities.

        Engines of imperfect worlds and those with fixed steps bound the error of their ledger, but not by how much
        rounding and the errors of steps were amplified along the motion.
        """
        estimates = self.fidelity.ledger.kind in ("estimate", "tolerance", "forces", "share")
        return self.run.accuracy is None and not self.sampled and estimates

    @property
    def in_discrete_time(self) -> bool:
        """Whether velocities are set at ticks, and positions follow from them without any integration."""
        return self.fidelity.ledger.kind == "forces" and not self.sampled

    def when(self, time: float, digits: int = 4) -> str:
        """A time of the run in words, see `flocking.formula.safe_digits.time_text`.

        Parameters
        ----------
        time, digits
            As that function takes them.
        """
        scenario = self.run.scenario
        return time_text(time, scenario.start.t, scenario.t_end, digits)

    @property
    def replaced(self) -> str:
        """That what the run's scenario states was replaced while the run went on, in words; empty where it was not.

        No theorem is about two laws, or about agents that somebody moved, and a limit of the last motion is none of
        those before.
        """
        times = changed_times(self.run.provenance)
        if not times:
            return ""
        first, more = self.when(times[0]), f" and {len(times) - 1} times later" if len(times) > 1 else ""
        return f"the law, the state or the messages of the run were replaced at t = {first}{more}"

    def need_one_motion(self) -> None:
        """Leave open what would be concluded from motions that were replaced by others; see `replaced`."""
        if why := self.replaced:
            raise NotResolvable(f"{why}: what came before is of another motion")

    def need_end(self, last: float, share: float = UNSEEN) -> None:
        """Leave open what the end of a run would show that goes on long after what is known of its motion.

        Parameters
        ----------
        last
            Time of the last frame or observation.
        share
            The largest share of the run that may follow it.
        """
        run, begin = self.run, self.run.scenario.start.t
        if self.is_running:
            # Its next frame is on the way.
            return
        ends = [run.scenario.t_end] if run.finished else run.trace["time"][-1:].tolist()
        end = max([last, *ends])
        if end - last > share * (end - begin):
            seen, ran = (time_text(time, begin, end, 6) for time in (last, end))
            raise NotResolvable(f"frames end at t = {seen}, and the run at t = {ran}: its end is not seen")

    @property
    def is_running(self) -> bool:
        """Whether the run is a part of one that is still running."""
        return self.run.status == "running"

    @property
    def ended_early(self) -> bool:
        """Whether the run ended before its scenario: what it has not refuted might have failed later."""
        return not self.run.finished and not self.is_running

    @property
    def before_the_end(self) -> str:
        """Why the end of the scenario is not seen, where the run ended early or still goes on; empty where it is."""
        if self.ended_early:
            return "the run ended early"
        end, begin = self.run.scenario.t_end, self.run.scenario.start.t
        if not self.is_running or not len(self.t) or self.t[-1] >= end:
            return ""
        return f"the scenario goes on until t = {time_text(end, begin, end, 6)}"

    @property
    def switches_known(self) -> bool:
        """Whether every switch of a link is recorded; else links are known at the frames only."""
        return not self.law.graph.moves or self.fidelity.switches_located

    def displacement(self, difference: Array) -> Array:
        """Vectors between agents from a ``difference`` of positions, shape (..., m), in the space of the scenario."""
        return self.run.scenario.space.displacement(difference)

    def wrapped(self, q: Array) -> Array:
        """Positions ``q``, shape (N, m), put into the box where space repeats, so that images of a point are equal."""
        space = self.run.scenario.space
        return q if space.is_open else space.wrapped(q)

    def distances(self, q: Array) -> Array:
        """Distances of all pairs at positions ``q``, shape (N, N), infinite on the diagonal."""
        return pair_distances(q, self.run.scenario.space)

    @property
    def masses(self) -> Array:
        """Mass of each agent, shape (N,)."""
        return np.broadcast_to(np.asarray(self.run.scenario.agents.masses, dtype=np.float64), self.run.n)

    @property
    def fixed_step(self) -> bool:
        """Whether the engine took fixed steps, so that its ledger closes to the order of its integrator."""
        return self.fidelity.ledger.kind == "share"

    @cached_property
    def t(self) -> Array:
        """Times of the frames, ascending, shape (F,).

        Raises
        ------
        NotMeasurable
            When the run keeps no frames.
        NotResolvable
            When times are not finite or do not ascend.
        """
        t = self.run.t
        if not len(t):
            raise NotMeasurable("the run keeps no frames")
        if not np.isfinite(t).all() or (np.diff(t) <= 0).any():
            raise NotResolvable("the times of the frames do not ascend")
        return t

    @cached_property
    def q(self) -> Reals:
        """Positions at the frames, shape (F, N, m); raises as `t` does, and where they are unusable."""
        return self._usable("positions", self.run.q)

    @cached_property
    def p(self) -> Reals:
        """Velocities at the frames, shape (F, N, m); raises as `q` does, and for agents of order 1, which have none."""
        if self.run.scenario.agents.order == 1:
            raise NotResolvable("frames of agents of order 1 hold no velocities")
        return self._usable("velocities", self.run.p)

    @property
    def checked(self) -> Run:
        """The run, when its frames are usable; raises as `q` does where they are not."""
        self.q  # noqa: B018
        self._usable("velocities", self.run.p)
        return self.run

    def state(self, frame: int) -> State:
        """State at a frame, with its links."""
        links = self.checked.links
        if links.shape[1:] == (self.run.n, self.run.n) and links[frame].diagonal().any():
            raise NotResolvable(f"the links at t = {self.when(self.t[frame])} link an agent to itself")
        return self.run.state(frame)

    @property
    def why_no_ledger(self) -> str:
        """Why a run of samples under a law of continuous time has no ledger, after a colon; else empty."""
        why = unseen_links(self.law) if self.sampled else ""
        return f": {why}" if why else ""

    @cached_property
    def trace(self) -> Records:
        """The ledger, fields `flocking.engine.runs.run.TRACE_FIELDS`.

        Raises
        ------
        NotMeasurable
            When the run has none.
        NotResolvable
            When it holds unusable values.
        """
        trace = self.run.trace
        if not len(trace):
            raise NotMeasurable(f"the run has no ledger to check its motion{self.why_no_ledger}")
        for name in trace.dtype.names or ():
            if not (np.abs(trace[name]) <= LARGEST).all():
                raise NotResolvable(f"the ledger holds values of {name} that are not finite or too large")
        return trace

    def _usable(self, what: str, values: Reals) -> Reals:
        if values.shape != (len(self.t), self.run.n, self.run.q.shape[2]):
            raise NotResolvable(f"the {what} do not fit the other arrays of the run")
        wrong = np.flatnonzero(~(np.abs(values) <= LARGEST).all(axis=(1, 2)))
        if len(wrong):
            raise NotResolvable(f"{what} at t = {self.when(self.t[wrong[0]])} are not finite or too large")
        return values

    def need_few(self) -> None:
        """Refuse groups with too many pairs to evaluate."""
        if self.run.n > MOST_DENSE:
            raise NotMeasurable(f"{self.run.n} agents have too many pairs")
