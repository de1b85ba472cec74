"""The interface of a running simulation, for the code that drives, saves, resumes, shows or changes it."""

from __future__ import annotations

import copy
import math
import time as clock
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

from flocking.arrays import Array
from flocking.engine.archives.archive import Arrays
from flocking.engine.protocol.team import ONE_PROCESS, Team
from flocking.engine.runs.fidelity import Fidelity
from flocking.engine.runs.provenance import provenance, went_on
from flocking.engine.runs.recorder import Recorder
from flocking.engine.runs.run import Accuracy, Closest, Run
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.world.information import Information

Packed = tuple[dict[str, object], Arrays]
"""A session as plain data for JSON and arrays of numbers by name."""


@dataclass(frozen=True, eq=False)
class Stored:
    """Records of a run that goes on from a checkpoint.

    Parameters
    ----------
    scenario, plant
        The scenario, and the law that the agents really obey if it is another.
    counts
        Numbers of records, by the names in `flocking.engine.runs.recorder.GROWING`.
    read
        Gives the run with all its records; called only by engines that keep them in memory.
    """

    scenario: Scenario
    plant: Law | None
    counts: Mapping[str, int]
    read: Callable[[], Run]


def interrupted_at(time: float) -> str:
    """Status of a run that was left before the end of its scenario.

    Parameters
    ----------
    time
        When it was left.
    """
    return f"interrupted at t = {time:.9g}"


def time_to_reach(owner: str, to: float, now: float, slack: float = 0.0) -> float:
    """The time ``to`` as a plain float: what sessions note of it is saved as JSON, which knows no other numbers.

    Parameters
    ----------
    owner
        The class of the session, for messages.
    to
        Time to reach.
    now
        The session's time.
    slack
        How far before it ``to`` may lie, such as a step.

    Raises
    ------
    InvalidInput
        When ``to`` is not a number, or lies in the past.
    """
    try:
        found = float(to)
    except (TypeError, ValueError):
        raise InvalidInput(owner, "to", "must be a number", to) from None
    if not found >= now - slack:
        raise InvalidInput(owner, "to", f"must not be before the session's time, {now:g}", to)
    return found


def end_of_slice(owner: str, seconds: float) -> float:
    """When a slice of some wall time that begins now is over, on the clock `time.monotonic`.

    Parameters
    ----------
    owner
        The class of the session, for messages.
    seconds
        Wall time of the slice; one that is not positive is over at once.

    Raises
    ------
    InvalidInput
        When ``seconds`` is not a number.
    """
    try:
        found = float(seconds)
    except (TypeError, ValueError):
        found = math.nan
    if math.isnan(found):
        raise InvalidInput(
            owner, "seconds", "must be a number of seconds of wall time", seconds, "Leave it out for no limit."
        )
    return clock.monotonic() + found


class Session(ABC):
    """A running simulation at some time, from which it can be advanced.

    The same calls give the same bits, independent of how `advance` is cut into pieces. Drivers use only the attributes
    and methods of this class.

    Attributes
    ----------
    engine
        Name of its engine.
    plant
        The law the agents really obey, if it is not the scenario's.
    options
        The options of its engine, with the values in use; a dataclass.
    time, steps
        Time reached, and number of steps until then.
    records
        Its recorder.
    """

    engine: ClassVar[str]
    scenario: Scenario
    plant: Law | None
    options: object
    time: float
    steps: int
    records: Recorder

    saves_when_interrupted: ClassVar[bool] = False
    """Whether its state can be packed when Ctrl-C, which is handled between two steps, stops it."""

    @abstractmethod
    def advance(self, to: float, seconds: float = math.inf) -> None:
        """Go on until time ``to``, or for ``seconds`` of wall time. Where steps fall depends on neither.

        Between two steps it calls `flocking.engine.interruption.check`.

        Parameters
        ----------
        to
            Time to reach; an engine of fixed steps may stop just beyond it.
        seconds
            Wall time after which the session stops at the end of a step; at least one step is made.

        Raises
        ------
        SimulationError
            When the run cannot go on; its ``run`` holds what was computed until then.
        InvalidInput
            When ``to`` lies in the past, or ``seconds`` is not a number.
        """

    @property
    @abstractmethod
    def state(self) -> State:
        """State at the session's time."""

    @abstractmethod
    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Replace the law or the state from the session's time on.

        Raises
        ------
        InvalidInput
            When law and state disagree; the session is then unchanged.
        UnsupportedLaw
            When this engine cannot run the law, or supports no replacement.
        """

    def replace_information(self, information: Information) -> None:
        """Let agents get their information in another way from the session's time on; by default not possible.

        Parameters
        ----------
        information
            How they get it.

        Raises
        ------
        InvalidInput
            When it does not fit the scenario; the session is then unchanged.
        UnsupportedLaw
            When this engine, or a running session of it, cannot change to it.
        """
        raise UnsupportedLaw(
            f"engine={self.engine!r} does not replace `information` while a run goes on. Start another run from "
            "run.state(-1)."
        )

    @abstractmethod
    def accelerations(self) -> Array:
        """Rates of change of the velocities now, shape (N, m); of agents of order 1 their controls."""

    @property
    @abstractmethod
    def fidelity(self) -> Fidelity:
        """What is known of the accuracy of this run."""

    @abstractmethod
    def pack(self) -> Packed:
        """All that another session needs to go on bit for bit, without its scenario and its records; not copied."""

    @classmethod
    @abstractmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> Session:
        """Restore a packed session.

        Parameters
        ----------
        packed
            The result of `pack`, read from a file that anybody may have written.
        stored
            Its scenario and its records.
        changes
            New values of options on which results do not depend.

        Raises
        ------
        MalformedError, ValueError, KeyError, TypeError
            When they are of no session of this scenario.
        """

    def reached(self, to: float) -> bool:
        """Whether time ``to`` is reached."""
        return self.time >= to

    @property
    def team(self) -> Team:
        """The processes that run it together."""
        return ONE_PROCESS

    def share_frames(self, agents: int) -> bool:
        """Keep from now on parts of frames in the processes that are to write them, if this session does so.

        Parameters
        ----------
        agents
            Each process has the agents of whole chunks of so many, in the order of their numbers.

        Returns
        -------
        bool
            Whether it does: the same in all processes.
        """
        return False

    @property
    def shrunk(self) -> object | None:
        """Why the run hardly advances, to be shown as text; None if it does advance."""
        return None

    @property
    def steady(self) -> bool:
        """Whether this is a time worth returning to: its steps are about as long as those before."""
        return True

    @property
    def time_is_exact(self) -> bool:
        """Whether another session that reaches this time has the same state."""
        return True

    @property
    def about(self) -> dict[str, object]:
        """Provenance of the run."""
        return provenance(self.engine, self.scenario) | {"steps": self.steps}

    @property
    def known(self) -> tuple[tuple[Closest, Closest], Accuracy | None]:
        """Closest linked and unlinked pair until now, and what is known of the errors."""
        return (self.records.closest_linked, self.records.closest_unlinked), None

    @property
    def closest_pairs(self) -> tuple[Closest, Closest]:
        """Closest linked and unlinked pair until now."""
        return self.known[0]

    @property
    def accuracy(self) -> Accuracy | None:
        """What is known of the errors so far; None where nothing is."""
        return self.known[1]

    def run(self, status: str | None = None) -> Run:
        """The records that are in memory, as a run; its provenance states how far it went on after its scenario's end.

        Parameters
        ----------
        status
            Its state; by default ``"finished"`` from the end of the scenario on, and interrupted before.
        """
        (linked, unlinked), accuracy = self.known
        if status is None:
            status = "finished" if self.reached(self.scenario.t_end) else interrupted_at(self.time)
        return Run(
            self.scenario, status=status, provenance={**self.about, **went_on(self.scenario, self.time)},
            closest_linked=linked, closest_unlinked=unlinked,
            accuracy=accuracy, fidelity=self.fidelity, rank=self.team.rank, **self.records.tables(),
        )  # fmt: skip

    def moment(self) -> Callable[[], Session]:
        """A function that opens a session in the present state of this one."""
        packed = copy.deepcopy(self.pack())
        scenario, records, run = self.scenario, self.records.copy(), self.run("unfinished")
        # A session may go on beyond the end of its scenario, and stored ones may not.
        longer = scenario if self.time <= scenario.t_end else scenario.with_numbers(scenario.law, self.time)
        stored = Stored(longer, self.plant, records.counts, lambda: run)

        def back() -> Session:
            again = type(self).unpack(copy.deepcopy(packed), stored, {})
            again.scenario, again.records = scenario, records.copy()
            return again

        return back

    def close(self) -> None:  # noqa: B027  most engines hold nothing else
        """Release resources other than memory; by default there are none."""
