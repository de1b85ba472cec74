"""What a running simulation is to whoever drives, saves, resumes, shows or changes it, whichever engine runs it."""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

from flocking.arrays import Array
from flocking.engine.archives.archive import Arrays
from flocking.engine.protocol.team import ONE_PROCESS, Team
from flocking.engine.runs.fidelity import Fidelity
from flocking.engine.runs.provenance import provenance
from flocking.engine.runs.recorder import Recorder
from flocking.engine.runs.run import Accuracy, Closest, Run
from flocking.model.law import Law, Scenario
from flocking.model.state import State

Packed = tuple[dict[str, object], Arrays]
"""A session as plain data for JSON and arrays of numbers by name."""


@dataclass(frozen=True, eq=False)
class Stored:
    """What a run that goes on from a checkpoint has recorded before.

    Parameters
    ----------
    scenario, plant
        What was simulated, and the law that the agents really obey where it is another.
    counts
        Numbers of records, by the names in `flocking.engine.runs.recorder.GROWING`.
    read
        Gives the run with all its records; called only by engines that keep them in memory.
    """

    scenario: Scenario
    plant: Law | None
    counts: Mapping[str, int]
    read: Callable[[], Run]


class Session(ABC):
    """A running simulation: it stands at a time, and goes on from there.

    The same calls give the same bits, however `advance` is cut into pieces. Whoever drives a session uses what is
    named here and nothing else.

    Attributes
    ----------
    engine
        Name of its engine.
    plant
        The law the agents really obey, where it is not the scenario's.
    options
        The options of its engine, as it runs with them; a dataclass.
    time, steps
        Time reached, and number of steps until then.
    records
        What it has written down.
    """

    engine: ClassVar[str]
    scenario: Scenario
    plant: Law | None
    options: object
    time: float
    steps: int
    records: Recorder

    saves_when_interrupted: ClassVar[bool] = False
    """Whether Ctrl-C, which is heeded between two steps, finds it in a state that can be packed."""

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
            When ``to`` lies in the past.
        """

    @property
    @abstractmethod
    def state(self) -> State:
        """State at the session's time."""

    @abstractmethod
    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Put another law or state in force from the session's time on.

        Raises
        ------
        InvalidInput
            When law and state disagree; the session then goes on as before.
        UnsupportedLaw
            When this engine cannot run the law, or replaces nothing.
        """

    @abstractmethod
    def accelerations(self) -> Array:
        """Rates of change of the velocities now, shape (N, m); of agents of order 1 their controls."""

    @property
    @abstractmethod
    def fidelity(self) -> Fidelity:
        """What is known of how well this run is computed."""

    @abstractmethod
    def pack(self) -> Packed:
        """All that another session needs to go on bit for bit, but its scenario and its records; not copied."""

    @classmethod
    @abstractmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> Session:
        """The session that was packed.

        Parameters
        ----------
        packed
            What `pack` gave, read back from a file that anybody may have written.
        stored
            Its scenario and its records.
        changes
            Options to go on with, among those that results do not depend on.

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

    @property
    def shrunk(self) -> object | None:
        """Why the run hardly goes on, to be shown as text; None where it does."""
        return None

    @property
    def steady(self) -> bool:
        """Whether this is a moment to come back to: its steps are about as long as those before."""
        return True

    @property
    def time_is_exact(self) -> bool:
        """Whether the session's time alone leads another session to the same state."""
        return True

    @property
    def about(self) -> dict[str, object]:
        """Where the results come from, as the run's provenance says."""
        return provenance(self.engine, self.scenario) | {"steps": self.steps}

    @property
    def known(self) -> tuple[tuple[Closest, Closest], Accuracy | None]:
        """The closest linked and unlinked pair until now, and what is known of the errors."""
        return (self.records.closest_linked, self.records.closest_unlinked), None

    @property
    def closest_pairs(self) -> tuple[Closest, Closest]:
        """Closest linked and unlinked pair until now."""
        return self.known[0]

    @property
    def accuracy(self) -> Accuracy | None:
        """What is known of the errors of what was computed so far; None where nothing is."""
        return self.known[1]

    def run(self, status: str = "finished") -> Run:
        """What was computed so far and is in memory.

        Parameters
        ----------
        status
            How the run stands.
        """
        (linked, unlinked), accuracy = self.known
        return Run(
            self.scenario, status=status, provenance=self.about, closest_linked=linked, closest_unlinked=unlinked,
            accuracy=accuracy, fidelity=self.fidelity, **self.records.tables(),
        )  # fmt: skip

    def moment(self) -> Callable[[], Session]:
        """The way back to this moment: a function that opens a session which stands as this one does now."""
        packed = copy.deepcopy(self.pack())
        records, run = self.records.copy(), self.run("unfinished")
        stored = Stored(self.scenario, self.plant, records.counts, lambda: run)

        def back() -> Session:
            again = type(self).unpack(copy.deepcopy(packed), stored, {})
            again.records = records.copy()
            return again

        return back

    def close(self) -> None:  # noqa: B027  most engines hold nothing else
        """Give back what it holds beside memory; nothing unless an engine says otherwise."""
