"""A scenario run to one end after the other, each time as if that had been the end from the start."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from flocking.engine.exact.session import ExactSession
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.law import Law, Scenario

LEAD = 0.02
"""How long before an end, in parts of the scenario's own length, the session that goes on is left for it."""


def longer(scenario: Scenario, t_end: float) -> Scenario:
    """The same scenario with a later end, and frames at the same mean distance on to it.

    Parameters
    ----------
    t_end
        The end. The scenario itself comes back for its own.
    """
    if t_end == scenario.t_end:
        return scenario
    times = scenario.frame_times
    each = float(times[-1] - times[0]) / (len(times) - 1) if len(times) > 1 else scenario.t_end - scenario.start.t
    more = np.arange(scenario.t_end, t_end, each)
    more = more[(more > times[-1]) & (more < t_end - 1e-6 * each)]
    return scenario.with_(t_end=t_end, frames=(*(float(t) for t in (*times, *more)), float(t_end)))


def in_stages(
    scenario: Scenario, ends: Sequence[float], *, plant: Law | None = None, fine: bool = False
) -> Iterator[Run]:
    """Runs of a scenario to each of several ends under the exact engine, without starting anew for any.

    Each equals the run of its own scenario from the start, bit for bit.

    Parameters
    ----------
    ends
        Ascending times, the first no earlier than the scenario's end.
    plant
        The law the agents really obey; the scenario's law when absent.
    fine
        Keep several samples of every step of the first of the runs, as `flocking.engine.driver.simulate.simulate` does.

    Raises
    ------
    InvalidInput
        When the ends do not ascend, or the scenario has no length that frames could go on with.
    SimulationError
        When the run cannot go on.
    """
    first = scenario.t_end - scenario.start.t
    if not first > 0 or not len(ends) or ends[0] < scenario.t_end or any(b <= a for a, b in pairwise(ends)):
        rule = f"must be ascending times from the end of a run that takes time, {scenario.t_end:g}"
        raise InvalidInput("in_stages", "ends", rule, list(ends))
    # This session meets no end: its steps near one are those of a run that has it far ahead.
    complete = longer(scenario, ends[-1]).with_(t_end=ends[-1] + first)
    session = ExactSession(complete, plant=plant)
    session.recorder.fine = [] if fine else None
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
        session.recorder.fine = left.recorder.fine = None
