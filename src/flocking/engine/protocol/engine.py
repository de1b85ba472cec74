"""The entry of an engine: its name, its options, what it supports, and how its sessions are opened."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields

from flocking.engine.protocol.options import from_keywords
from flocking.engine.protocol.repeats import Repeats
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.engine.protocol.stages import longer
from flocking.engine.protocol.team import ONE_PROCESS, Team
from flocking.engine.protocol.world import check_world
from flocking.engine.runs.run import Run
from flocking.errors import FlockingError, UnsupportedLaw
from flocking.model.bodies.body import Body
from flocking.model.law import Law, Scenario
from flocking.model.space import Open, Space
from flocking.model.world.control import Control


class Engine(ABC):
    """One way to compute a scenario.

    Attributes
    ----------
    name
        What ``engine=`` and ``--engine`` call it: lower-case letters, digits, ``-`` and ``_``.
    options
        A dataclass of its options, each with a default, which refuses values that break a rule.
    """

    name: str
    summary: str
    options: type[object]

    free_options: frozenset[str] = frozenset()
    """Options on which results do not depend: a stored run may go on with other values."""

    def free_options_of(self, options: Mapping[str, object]) -> frozenset[str]:
        """Those of `free_options` that may change for a stored run with some ``options``."""
        return self.free_options

    command_line_options: Mapping[str, object] = {}
    """Values that the command line uses for options that are not given."""

    large_group_options: Mapping[str, object] = {}
    """Values suited to groups of millions."""

    spaces: tuple[type[Space], ...] = (Open,)
    """Kinds of space that it supports."""

    def check_space(self, scenario: Scenario) -> None:
        """Refuse by name a space that this engine does not support.

        Raises
        ------
        UnsupportedLaw
            When it does not.
        """
        if not isinstance(scenario.space, self.spaces):
            name = type(scenario.space).__name__
            raise UnsupportedLaw(f"The engine {self.name!r} cannot run {name} space. Use engine='exact'.")

    discrete_bodies: bool = False
    """Whether it moves bodies in discrete time, and those alone."""

    def moves(self, bodies: Body) -> bool:
        """Whether it moves bodies in the time of these, discrete or continuous."""
        return bodies.discrete == self.discrete_bodies

    def check_bodies(self, scenario: Scenario) -> None:
        """Refuse by name bodies in a time that is not that of this engine.

        Raises
        ------
        UnsupportedLaw
            When they are.
        """
        if not self.moves(scenario.agents):
            time = "discrete" if scenario.agents.discrete else "continuous"
            raise UnsupportedLaw(
                f"engine={self.name!r} does not move {type(scenario.agents).__name__} agents, which are in {time} "
                "time. engine='auto' chooses one that does."
            )

    def repeats(self, run: Run) -> Repeats | None:
        """How a run of this engine is made again to estimate its error; None where its runs state their errors.

        Parameters
        ----------
        run
            The run.
        """
        return None

    runs_in_threads: bool = False
    """Whether several of its sessions may advance at once, each in a thread of its own."""

    worlds: tuple[type, ...] = ()
    """Kinds of information and control that it runs beside the ideal ones."""

    leader_messages: bool = False
    """Whether it runs leaders that are known by messages."""

    controls: tuple[type, ...] = (Control,)
    """Kinds of control without which it runs nothing."""

    @abstractmethod
    def check(self, scenario: Scenario, plant: Law | None = None) -> None:
        """Refuse by name what this engine cannot run.

        Parameters
        ----------
        plant
            The law the agents really obey, if it is not the scenario's.

        Raises
        ------
        UnsupportedLaw, InvalidInput
            When it cannot; the message names the part and the way out.
        """

    @abstractmethod
    def open(self, scenario: Scenario, options: object, *, plant: Law | None = None) -> Session:
        """Start a session.

        Parameters
        ----------
        options
            An instance of `options`.
        plant
            The law the agents really obey, where it is not the scenario's.

        Raises
        ------
        UnsupportedLaw, InvalidInput
            As `check` does, and where the scenario cannot be started.
        EngineMissing
            When a package that the engine needs is not installed.
        """

    @abstractmethod
    def unpack(self, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> Session:
        """Restore a packed session.

        Parameters
        ----------
        packed, stored, changes
            As for `flocking.engine.protocol.session.Session.unpack`.

        Raises
        ------
        MalformedError, ValueError, KeyError, TypeError
            As there.
        """

    def open_unrecorded(self, scenario: Scenario) -> Session:
        """Start a session that stores no frames; its steps are those of `open`.

        Raises
        ------
        UnsupportedLaw, InvalidInput
            As `open` does.
        """
        self.check_bodies(scenario)
        check_world(self.name, scenario, self.worlds, leader_messages=self.leader_messages)
        session = self.open(scenario, self.options())
        session.records.keep_no_frames()
        return session

    def team(self) -> Team:
        """The processes that run it together, before a session is opened."""
        return ONE_PROCESS

    def why_not(self, scenario: Scenario, plant: Law | None = None) -> str:
        """Why it cannot run a scenario; empty if it can. ``plant`` is as for `check`."""
        try:
            self.check_space(scenario)
            self.check_bodies(scenario)
            check_world(self.name, scenario, self.worlds, leader_messages=self.leader_messages)
            self.check(scenario, plant)
        except FlockingError as error:
            return str(error)
        return ""

    @property
    def option_names(self) -> tuple[str, ...]:
        """Names of its options."""
        return tuple(f.name for f in fields(self.options))  # type: ignore[arg-type]

    def options_from(self, given: Mapping[str, object]) -> object:
        """Its options from keyword arguments.

        Raises
        ------
        InvalidInput
            When there is no such option, or a value breaks a rule.
        """
        return from_keywords(self.options, given, self.name)

    def stored_options(self, data: Mapping[str, object]) -> object:
        """Its options as stored with a run.

        Raises
        ------
        InvalidInput, TypeError
            When they are malformed.
        """
        return self.options_from(data)

    def in_stages(
        self, scenario: Scenario, ends: Sequence[float], options: object, *, plant: Law | None = None
    ) -> Iterator[Run]:
        """Runs of a scenario to each of several ends, each as if that had been the end from the start.

        An engine whose steps do not depend on the end need not start again for each.

        Parameters
        ----------
        ends
            Ascending times, the first no earlier than the scenario's end.
        options
            An instance of `options`.

        Raises
        ------
        SimulationError
            When the run cannot go on.
        """
        for end in ends:
            session = self.open(longer(scenario, end), options, plant=plant)
            session.advance(end)
            yield session.run()
            session.close()
