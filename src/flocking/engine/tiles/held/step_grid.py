"""The steps of held control: all of one length, a whole number of nanoseconds, on which ticks and samples fall."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flocking.engine.tiles.held.held_actuation import gust_periods
from flocking.errors import InvalidInput
from flocking.model.law import Scenario
from flocking.model.world.control import Held
from flocking.model.world.information import Messages
from flocking.model.world.times import NANOSECOND, PER_SECOND, Instants

FINEST = 1000
"""Most steps in the shortest period for which a step is chosen: times that have no coarser common measure were most
probably not meant to, and such a run would take as many times longer."""


@dataclass(frozen=True)
class GridTime:
    """Times of one field of the world, each of which must be a whole number of steps.

    Parameters
    ----------
    owner, name
        The part and its field.
    times
        In nanoseconds.
    """

    owner: str
    name: str
    times: Instants


def grid_times(scenario: Scenario) -> list[GridTime]:
    """The times of a scenario at which agents take samples, act, or change their force."""
    found: list[GridTime] = []
    control, information, n = scenario.control, scenario.information, scenario.start.n
    assert isinstance(control, Held)
    for owner, part in (("Held", control), ("Messages", information)):
        if isinstance(part, Held | Messages):
            schedule = part.schedule(n)
            found += [GridTime(owner, name, np.unique(getattr(schedule, name))) for name in ("period", "phase")]
    found += [GridTime("Disturbed", "period", np.array([period])) for period in gust_periods(scenario.agents)]
    return [*found, GridTime("Held", "latency", np.unique(control.latencies(n)))]


def held_step(scenario: Scenario, requested: float | None, resolves: float) -> int:
    """Length of the steps in nanoseconds.

    Parameters
    ----------
    scenario
        Its control is held.
    requested
        The requested step; None to choose one.
    resolves
        Longest step that is chosen.

    Raises
    ------
    InvalidInput
        When a time of the world is no whole number of steps, or none is suitable.
    """
    times = grid_times(scenario)
    if requested is not None:
        step = round(requested * PER_SECOND)
        if step < 1:
            raise InvalidInput("TilesOptions", "step", f"must be at least {NANOSECOND:g} under held control", requested)
        for each in times:
            wrong = each.times[each.times % step != 0]
            if wrong.size:
                nearest = max(round(int(wrong[0]) / step), 1 if each.name == "period" else 0) * step
                rule = f"must be a whole number of steps of {step * NANOSECOND:g} in engine='tiles'"
                raise InvalidInput(
                    each.owner, each.name, rule,
                    float(wrong[0] * NANOSECOND),
                    f"The nearest is {nearest * NANOSECOND:.10g}; or choose a step that divides it.",
                )  # fmt: skip
        return step
    common = int(np.gcd.reduce(np.concatenate([each.times for each in times])))
    shortest = min(int(each.times.min()) for each in times if each.name == "period")
    if common * FINEST < shortest:
        least = shortest / FINEST * NANOSECOND
        raise InvalidInput(
            "Held", "phase", f"and all times of the world must have a common measure of {least:g} or more in "
            "engine='tiles'", common * NANOSECOND,
            "Round periods and phases to whole numbers of one step, or use engine='sampled'.",
        )  # fmt: skip
    least = max(1, math.ceil(common * NANOSECOND / resolves))
    parts = next((k for k in range(least, least + FINEST) if common % k == 0), 1)
    return common // parts
