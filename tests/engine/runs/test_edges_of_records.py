"""Records at their edges: of runs that are cut at an event, of crossings without any speed, and of the start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs.run import is_tangential

ALIGN = fk.Law(fk.Proximity(2.0), [fk.Consensus(0.1)])
PARTING = fk.State([[0.0, 0.0], [1.5, 0.0]], [[0.0, 0.0], [1.0, 0.0]])


def test_a_run_that_is_cut_at_an_event_has_that_event() -> None:
    made = fk.Scenario(ALIGN, PARTING, t_end=2.0, frames=9, control=fk.Held(0.25))
    run = fk.simulate(made, progress=False)
    assert run.log is not None
    assert len(run.switches) == 1
    for end in (*run.trace["time"][1:-1].tolist(), float(run.switches["time"][0])):
        part = run.cut(2, end)
        assert part.trace["time"].tolist() == [t for t in run.trace["time"].tolist() if t <= end]
        assert part.switches["time"].tolist() == [t for t in run.switches["time"].tolist() if t <= end]
        assert part.log is not None
        acts = run.log.ticks[:, 0]
        assert part.log.ticks[:, 0].tolist() == [t for t in acts.tolist() if t <= round(end * 1e9)]


@pytest.mark.parametrize(("speed", "relative", "flagged"), [(0.0, 0.0, True), (1e-7, 1.0, True), (1e-5, 1.0, False)])
def test_a_crossing_without_any_speed_is_tangential(speed: float, relative: float, flagged: bool) -> None:
    assert is_tangential(speed, relative) is flagged


@pytest.mark.parametrize(("late", "certain"), [(1e-9, True), (np.inf, False), (np.nan, False)])
def test_a_switch_whose_time_is_not_known_is_not_certain(late: float, certain: bool) -> None:
    run = fk.simulate(fk.Scenario(ALIGN, PARTING, t_end=2.0, frames=9), progress=False)
    rows = run.switches.copy()
    rows["time_error"] = late
    assert replace(run, switches=rows).certain.tolist() == [certain]


def test_late_knowledge_is_what_it_is_from_the_start_on() -> None:
    """The second agent comes from 1.9 and is at 2.1: the first one, which knows it 0.2 late, has it in reach."""
    start = fk.State([[0.0, 0.0], [2.1, 0.0]], [[0.0, 0.0], [1.0, 0.0]])
    run = fk.simulate(fk.Scenario(ALIGN, start, t_end=0.5, frames=6, information=fk.Delayed(0.2)), progress=False)
    assert not run.links_at(0).any()
    assert run.known_links_at(0)[0].tolist() == [[False, True], [False, False]]
