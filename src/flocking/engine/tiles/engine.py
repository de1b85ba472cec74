"""Registration of the tiled engine."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from flocking.engine.fixed_step.given_links import check_given_links
from flocking.engine.imperfect.messages.leader_news import check_leader_messages
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.repeats import Repeats, counted_steps
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.engine.runs.run import Run
from flocking.engine.tiles.held.news import check_messages
from flocking.engine.tiles.held.session import HeldTilesSession
from flocking.engine.tiles.kernels.spec import SPACES, check_supported
from flocking.engine.tiles.options import TilesOptions
from flocking.engine.tiles.planted_law import check_planted
from flocking.engine.tiles.session import TilesSession
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.law import Law, Scenario
from flocking.model.world.control import Held
from flocking.model.world.information import Messages
from flocking.model.world.times import PER_SECOND

FINER = (0.5, 0.25)
"""Steps of the repetitions of a run, as shares of its own."""

SAME_MOTION = 0.05
"""Difference of repetitions, as a share of the extent of a motion, up to which errors of steps are estimated: a ledger
may leave as much of the energy unexplained."""

PAIRS, STEP = 30, 50_000
"""Neighbours of an agent for the work of a step, as in a dense group in the plane, and that of a step besides."""

MOST_WORK = 2e8
"""Largest work of a run that is repeated, in evaluations of pairs: some seconds for its repetitions, which have six
times as many steps."""


class TilesEngine(Engine):
    """Fixed-step integration over neighbour lists, sixteen agents at a time."""

    name = "tiles"
    summary = "fixed steps, for large groups"
    options = TilesOptions
    spaces = SPACES
    worlds = (Held, Messages)
    leader_messages = True
    free_options = frozenset({"threads"})
    command_line_options = {"observe": True}  # noqa: RUF012  never changed

    def check(self, scenario: Scenario, plant: Law | None = None) -> None:
        """Check that the scenario and the plant are supported."""
        check_supported(scenario)
        check_given_links(self.name, scenario)
        check_messages(scenario)
        check_leader_messages(self.name, scenario)
        if plant is not None:
            if not scenario.control.ideal:
                raise UnsupportedLaw("The tiled engine runs no plant under held control: its work counts as departed.")
            check_planted(scenario, plant)

    def open(self, scenario: Scenario, options: object, *, plant: Law | None = None) -> TilesSession:
        """Start a session."""
        assert isinstance(options, TilesOptions)
        if scenario.control.ideal and scenario.information.ideal:
            check_given_links(self.name, scenario)
        else:
            self.check(scenario, plant)
        if isinstance(scenario.control, Held):
            return HeldTilesSession(scenario, options)
        if options.log:
            raise InvalidInput(
                "TilesOptions", "log", "must be left out under continuous control", True,
                "Agents use the present state at every moment: there is nothing to log.",
            )  # fmt: skip
        return TilesSession(scenario, options, plant=plant)

    def open_unrecorded(self, scenario: Scenario) -> Session:
        """Start a session that stores no frames; steps still end at the frame times."""
        return self.open(scenario, TilesOptions(keep_frames=False))

    def repeats(self, run: Run) -> Repeats | None:
        """With shorter steps in double precision; under held control these are whole numbers of nanoseconds too."""
        about, held = run.provenance, isinstance(run.scenario.control, Held)
        step, scheme = about.get("step"), about.get("scheme")
        if run.fidelity.ledger.kind != "share" or not isinstance(step, float):
            return None
        shares = tuple(share for share in FINER if not held or round(step * PER_SECOND) % round(1.0 / share) == 0)
        if len(shares) < len(FINER):
            return None
        known = scheme if isinstance(scheme, str) and not held else None
        opened = tuple(
            partial(self.open, run.scenario, TilesOptions(share * step, known, log=False if held else None))
            for share in shares
        )
        steps, length = counted_steps(run), run.scenario.t_end - run.scenario.start.t
        if steps is not None and np.isfinite(length / step):
            # What a stored run states of its steps may not fit their length.
            steps = max(steps, round(length / step))
        return Repeats(
            opened, "with shorter steps", f"the last with {FINER[-1]:g} of the step", steps, MOST_WORK,
            float(run.n * PAIRS + STEP), SAME_MOTION,
        )  # fmt: skip

    def unpack(self, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> Session:
        """Restore a session from its packed form."""
        if isinstance(stored.scenario.control, Held):
            return HeldTilesSession.unpack(packed, stored, changes)
        return TilesSession.unpack(packed, stored, changes)


ENGINE = TilesEngine()
"""The instance that is registered."""
