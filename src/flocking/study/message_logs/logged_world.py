"""What the declared world states of a run whose motion follows from its log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array
from flocking.engine.protocol.body_chains import is_integrated
from flocking.engine.runs.message_log import LEADER, LEADER_SENDER, OWN, MessageLog, keeping_logs
from flocking.engine.runs.provenance import last_time
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.seen_headings import heading_column
from flocking.model.graphs.views import VELOCITY
from flocking.model.law import Scenario
from flocking.model.world.control import Continuous, Held
from flocking.model.world.information import Messages
from flocking.model.world.safety_filters import SafetyFilter
from flocking.model.world.times import NANOSECOND
from flocking.study.message_logs.arrivals import Arrivals, Sample
from flocking.study.message_logs.continuous_motion import ContinuousMotion
from flocking.study.message_logs.forced_motion import ForcedMotion
from flocking.study.message_logs.integrated_motion import IntegratedForcedMotion
from flocking.study.message_logs.leader_arrivals import leader_arrivals
from flocking.study.message_logs.reference_law import ReferenceLaw

NEAR = 1e-9
"""Distance from a radius, relative to a size of the run and to it, within which rounding leaves open whether a link
switches, and by which stored positions may differ from those of the second computation, relative to the same and to
their size; see `Sizes`."""


def check_run(run: object, asked: str) -> None:
    """Check that what is to be computed again is a run.

    Parameters
    ----------
    run
        What was given.
    asked
        Name of the function that a user called, for messages.

    Raises
    ------
    InvalidInput
        When it is none.
    """
    if not isinstance(run, Run):
        raise InvalidInput(asked, "run", "must be a Run", run, "Read it with fk.read_run(folder).")


def check_unchanged(run: Run, asked: str) -> None:
    """Check that a run to be computed again has one world and one law.

    Parameters
    ----------
    run
        The run.
    asked
        Name of the function that a user called, for messages.

    Raises
    ------
    UnsupportedLaw
        When it was changed while it went on.
    """
    if run.fidelity.changed:
        raise UnsupportedLaw(
            f"{asked} computes again runs of one world and law; this one was changed while it went on, or processes of "
            "its agents ended, began anew, were cut off or answered late."
        )


def logged(run: Run, asked: str = "replay") -> tuple[Scenario, MessageLog]:
    """The scenario and the log of a run.

    Parameters
    ----------
    run
        The run.
    asked
        Name of the function that a user called, for messages.

    Raises
    ------
    InvalidInput
        When there is none, it or the frames hold a number that is not finite, or it names agents or graphs that there
        are not.
    UnsupportedLaw
        When a safety filter changed the forces, or the session was changed while it went on.
    """
    check_run(run, asked)
    scenario = run.scenario
    if run.log is None or not isinstance(scenario.control, Held | Continuous):
        raise InvalidInput(
            asked, "run", "must have a log of what agents used", f"one of the engine {run.fidelity.engine!r}",
            keeping_logs(run.provenance),
        )  # fmt: skip
    if isinstance(scenario.control, SafetyFilter):
        raise UnsupportedLaw(f"{asked} computes the forces of the law again, not those that a SafetyFilter changed.")
    check_unchanged(run, asked)
    stated = {"times": run.t, "positions": run.q, "velocities": run.p, **run.columns, "logged forces": run.log.forces}
    for name, numbers in stated.items():
        if not np.isfinite(numbers).all():
            wrong = np.asarray(numbers)[~np.isfinite(numbers)][0]
            raise InvalidInput(
                asked, "run", f"must have finite {name}", float(wrong), "No run that was computed has others."
            )
    _check_names(run.log, scenario, asked)
    return scenario, run.log


def _check_names(log: MessageLog, scenario: Scenario, asked: str) -> None:
    """Refuse a log that names agents or graphs that there are not."""
    graph, sender = log.uses[:, 0], log.uses[:, 1]
    led = (graph == LEADER) & (sender == LEADER_SENDER)
    for what, found, wrong in (
        ("agents", log.ticks[:, 1], log.ticks[:, 1] >= scenario.start.n),
        ("agents", sender, ~led & ((sender < 0) | (sender >= scenario.start.n))),
        ("graphs", graph, ~led & ((graph < OWN) | (graph >= len(scenario.law.graphs)))),
    ):
        if wrong.any():
            raise InvalidInput(
                asked, "run", f"must have a log of its own {what}", int(found[wrong][0]), "The log was changed."
            )


MOST_SIZES = 64
"""Frames at which sizes of a run are looked at, about."""


class Sizes(NamedTuple):
    """Sizes beside which differences of two computations of a run are small.

    They are 1 where motions are integrated, as tolerances of engines are absolute below 1, and no larger where they are
    in closed form: numbers of a run whose unit is large are compared with each other.

    Parameters
    ----------
    place, velocity, force
        Of positions, of velocities, and of forces, which are velocities of agents of order 1.
    """

    place: float = 1.0
    velocity: float = 1.0
    force: float = 1.0


def sizes_of(run: Run, motion: ForcedMotion | IntegratedForcedMotion) -> Sizes:
    """Sizes for a run whose motion was computed again: of coordinates, and of what agents go in a period.

    A held force of mass times such a length by the squared period makes agents as fast as they can be controlled: the
    rounding of positions is amplified by the stiffness of a law, up to 1e9 of that force by that length.

    Parameters
    ----------
    run
        The run, whose times alone are read.
    motion
        Its motion.
    """
    control, start = run.scenario.control, run.scenario.start
    if motion.error or not isinstance(control, Held):
        return Sizes()
    period = float(np.min(control.period))
    looked_at = run.t[:: max(1, len(run.t) // MOST_SIZES)]
    states = [(start.q, start.p), *(motion.states(float(t) - start.t) for t in looked_at)]
    length, speed = (max(float(np.abs(x[k]).max(initial=0.0)) for x in states) for k in (0, 1))
    length += speed * period
    mass = float(motion.masses.max()) if motion.order > 1 else 1.0
    found = length, length / period, mass * length / period**motion.order
    return Sizes(*(min(1.0, x) for x in found))


ROUNDINGS = 16.0
"""Units of rounding by which two computations in closed form may differ where a force changes: each is a sum of few
products there, and no force follows from what was rounded."""


def uncertainty_of(run: Run, motion: ForcedMotion | IntegratedForcedMotion) -> tuple[float, float]:
    """By how much coordinates of positions and of velocities may differ in two computations of a run.

    Where motions are in closed form it is rounding, which grows with the distance from the origin and with the number
    of changes of a force; else what errors of steps may amount to.

    Parameters
    ----------
    run
        The run, whose times alone are read.
    motion
        Its motion.
    """
    start = run.scenario.start
    seconds = [float(t) - start.t for t in run.t[:: max(1, len(run.t) // MOST_SIZES)]]
    states = [(start.q, start.p if motion.order > 1 else 0.0 * start.p), *(motion.states(s) for s in seconds)]
    length, speed = (max(float(np.abs(x[k]).max(initial=0.0)) for x in states) for k in (0, 1))
    if motion.error or not isinstance(motion, ForcedMotion):
        return motion.error * (1.0 + length) + motion.shifts[0], motion.error * (1.0 + speed) + motion.shifts[1]
    unit = ROUNDINGS * float(np.finfo(np.float64).eps) * max(len(changes) for changes in motion.begins)
    return unit * (length + speed * max([0.0, *seconds])), unit * speed


class LoggedWorld:
    """What the declared world states of a run whose forces are those of its log.

    Parameters
    ----------
    run
        The run.
    scenario
        Its scenario.
    log
        Its log.
    """

    def __init__(self, run: Run, scenario: Scenario, log: MessageLog) -> None:
        if (end := last_time(scenario, run.provenance)) > scenario.t_end:
            # Gusts and messages went on with the session.
            scenario = scenario.with_numbers(scenario.law, end)
        self.scenario, self.log = scenario, log
        self.base, self.space = scenario.start.t, scenario.space
        self.law = ReferenceLaw(scenario)
        self.motion: ForcedMotion | IntegratedForcedMotion
        if not isinstance(scenario.control, Held):
            self.motion = ContinuousMotion(run, scenario, log, self.law)
        elif is_integrated(scenario):
            self.motion = IntegratedForcedMotion(run, scenario, log)
        else:
            self.motion = ForcedMotion(scenario, log)
        self.sizes = sizes_of(run, self.motion)
        self.off_q, self.off_p = uncertainty_of(run, self.motion)
        self.near = NEAR + self.motion.error
        """As `NEAR`, where the motion of the run has errors of steps."""
        self.n, self.m = self.motion.n, self.motion.m
        self.messages = scenario.information if isinstance(scenario.information, Messages) else None
        last = int(log.ticks[-1, 0]) if len(log.ticks) else 0
        self.arrivals: Arrivals | None = None
        if isinstance(self.motion, ContinuousMotion):
            self.arrivals, self.leaders = self.motion.arrivals, self.motion.leaders
        else:
            self.leaders = leader_arrivals(scenario, last)
        if self.arrivals is None and self.messages is not None:
            self.arrivals = Arrivals(scenario, self.motion, last)
        self.graphs: list[Graph] = list(scenario.law.graphs)

    def sample(self, agent: int, k: int, instant: int) -> Sample:
        """What is used of an agent by the number ``k`` at an ``instant``, see `Arrivals.sample`."""
        if self.arrivals is not None:
            return self.arrivals.sample(agent, k, instant)
        q, p = self.motion.state(agent, instant * NANOSECOND, instant)
        return Sample(q, p, q, p, instant, open=False)

    def looks(self, graph: Graph, seconds: float, velocities: Array) -> tuple[Array, float]:
        """Along what agents look under a graph if that turns, shape (N, m), and by how much each coordinate may be off.

        Parameters
        ----------
        graph, seconds
            The graph, and the time since the start.
        velocities
            What they take their own velocities to be, shape (N, m).
        """
        column = heading_column(graph)
        if column in ("", VELOCITY):
            return velocities, self.off_p if seconds > 0.0 else 0.0
        assert not isinstance(self.motion, ForcedMotion)
        columns = self.motion.columns(seconds) or self.scenario.start.columns
        return columns[column], self.motion.error

    def received(self, sample: Sample, instant: int) -> tuple[Array, Array]:
        """Position and velocity that a receiver takes a sender to have at an ``instant``, from a ``sample`` of it."""
        if self.messages is not None and self.messages.predict:
            return sample.q + (instant - sample.instant) * NANOSECOND * sample.p, sample.p
        return sample.q, sample.p

    def force(
        self, agent: int, own: tuple[Array, Array], others: Mapping[int, list[tuple[int, Array, Array]]], instant: int,
        leaders: int | None = None,
    ) -> Array:  # fmt: skip
        """The law's force on an agent, see `ReferenceLaw.force`.

        Parameters
        ----------
        own
            Its position and velocity.
        others
            Neighbours by the number of the graph: who, position and velocity.
        instant
            Now, in nanoseconds since the start.
        leaders
            Number of the sample by which it knows leaders, where it knows them by messages.
        """
        law = None if self.leaders is None or leaders is None else self.leaders.law(leaders, instant)
        return self.law.force(agent, own, others, self.law.time(instant), law)
