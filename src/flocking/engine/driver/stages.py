"""Runs of a scenario to several ends in one pass."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from flocking.engine.driver.registry import chosen_engine, engine_named
from flocking.engine.driver.simulate import fine_option
from flocking.engine.protocol.world import check_world
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.formula.safe_digits import given_text
from flocking.model.law import Law, Scenario


def in_stages(
    scenario: Scenario,
    ends: Sequence[float],
    *,
    engine: str = "auto",
    plant: Law | None = None,
    fine: bool = False,
) -> Iterator[Run]:
    """Runs of a scenario to each of several ends; each equals the run of its own scenario from the start.

    Parameters
    ----------
    ends
        Ascending times, the first no earlier than the scenario's end.
    engine
        Name of the engine. The exact one continues from end to end, with the same bits as separate runs.
    plant
        The law that agents follow; the scenario's law by default.
    fine
        Whether to store several samples of every step of the first run, see `flocking.engine.driver.simulate.simulate`;
        engines without such samples store the frames alone.

    Raises
    ------
    InvalidInput
        If the ends do not ascend, or the duration of the scenario is zero, so that the distance of frames is undefined.
    SimulationError
        If the run cannot continue.
    """
    first = scenario.t_end - scenario.start.t
    if not first > 0 or not len(ends) or ends[0] < scenario.t_end or any(b <= a for a, b in pairwise(ends)):
        rule = f"must be ascending times from the end of a run of positive duration, {given_text(scenario.t_end)}"
        raise InvalidInput("in_stages", "ends", rule, list(ends))
    found = engine_named(chosen_engine(scenario, engine, plant))
    check_world(found.name, scenario, found.worlds, leader_messages=found.leader_messages)
    stored = fine and "fine" in found.option_names
    return found.in_stages(scenario, ends, found.options_from(fine_option(found, stored)), plant=plant)
