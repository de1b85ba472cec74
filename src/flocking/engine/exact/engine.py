"""The entry of the exact engine, and runs to several ends."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from flocking.engine.exact.session import ExactOptions, ExactSession
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.engine.protocol.stages import longer
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.law import Law, Scenario
from flocking.model.space import Open, Periodic

MOST_AGENTS = 20_000
"""Largest group of this engine, which stores a matrix of all pairs."""

LEAD = 0.02
"""Distance from an end, as a share of the scenario's duration, at which the run to that end is split off."""


class ExactEngine(Engine):
    """Adaptive steps of order 8, each of which ends where a link switches."""

    name = "exact"
    summary = "locates every switch of a link; up to 20,000 agents"
    options = ExactOptions
    runs_in_threads = True
    spaces = (Open, Periodic)

    def check(self, scenario: Scenario, plant: Law | None = None) -> None:
        """Refuse groups whose matrix of pairs would not fit into memory."""
        if scenario.start.n > MOST_AGENTS:
            raise InvalidInput(
                "start", "engine", f"must be another one for more than {MOST_AGENTS} agents",
                f"{self.name!r} for {scenario.start.n}",
                "The exact engine stores a matrix of all pairs; 'tiles' does not, and states what it cannot run.",
            )  # fmt: skip

    def open(self, scenario: Scenario, options: object, *, plant: Law | None = None) -> ExactSession:
        """Start a session."""
        assert isinstance(options, ExactOptions)
        self.check(scenario, plant)
        return ExactSession(scenario, options, plant=plant)

    def open_unrecorded(self, scenario: Scenario) -> Session:
        """Start a session that stores no frames, which do not affect its steps."""
        return self.open(scenario.with_(frames=1), ExactOptions())

    def unpack(self, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> Session:
        """Restore a packed session."""
        return ExactSession.unpack(packed, stored, changes)

    def in_stages(
        self, scenario: Scenario, ends: Sequence[float], options: object, *, plant: Law | None = None
    ) -> Iterator[Run]:
        """Runs to each of several ends from one session; only the first stores fine samples."""
        assert isinstance(options, ExactOptions)
        first = scenario.t_end - scenario.start.t
        # This session has no end of its own: its steps near one are those of a run whose end is far away.
        complete = longer(scenario, ends[-1]).with_(t_end=ends[-1] + first)
        session = ExactSession(complete, options, plant=plant)
        left = session.snapshot()
        for end in ends:
            session.advance(max(end - LEAD * first, session.time))
            if session.snapshot(records=False).segment.t1 <= end:
                left = session.snapshot()
            part = longer(scenario, end)
            left.recorder.frame_times = part.frame_times
            last = ExactSession.resume(replace(left, scenario=part))
            last.advance(end)
            yield last.run()
            session.records.fine = left.recorder.fine = None


ENGINE = ExactEngine()
"""The entry of this engine."""
