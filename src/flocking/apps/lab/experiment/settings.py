"""The settings of a scenario, read from its parts, that a page shows as sliders, fields and choices."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flocking.arrays import AnyArray
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.weights import PairWeights
from flocking.model.law import Scenario
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.leaders_and_obstacles.obstacles import Obstacle
from flocking.model.parts import values
from flocking.model.parts.description import GROUPS, Nested
from flocking.model.parts.structure import Step, children, field_at, value_at
from flocking.model.parts.values import Value
from flocking.model.potentials.potential import Potential
from flocking.model.world.information import Delayed, Messages
from flocking.model.world.losses import Bernoulli

WIDE, ROOM = 4.0, 5.0
"""A slider ends at this many times its value; at 0 it ends at the second number."""

LARGEST_FACTOR = 4.0
"""Largest factor that a slider offers on an array of values; a convention."""
FACTOR_DIGITS = 12
"""Digits of a factor that is found again from values that it multiplied: rounding changes later ones."""

RADIO_PERIODS = 10.0
"""Longest delay that a slider offers, in periods of the messages; a convention."""

LEAST_DELAY = 0.1
"""Least delay that a slider offers, in delays of the scenario, and least factor of several; a convention. Without one
another engine would have to go on."""

FORGETFUL = "Delay: a change begins a new past"
"""Title of the delay: a session whose delay changes begins anew, and before it agents moved in straight lines."""

MOST_NOISE = 1.0
"""Largest standard deviation that a slider of noise offers where there is little; a convention."""


@dataclass(frozen=True)
class Setting:
    """One value that a page can change.

    Parameters
    ----------
    path
        Where it is in the scenario.
    kind
        ``"number"``, ``"count"``, ``"flag"``, ``"choice"``, ``"formula"`` or ``"factor"``: a factor multiplies values
        that differ between agents or pairs.
    value
        Its value; of a factor what the values of the opened scenario are multiplied by.
    low, high
        Ends of a slider.
    choices
        Possible values of a choice.
    """

    path: tuple[Step, ...]
    kind: str
    value: Any
    low: float = 0.0
    high: float = 1.0
    choices: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """Name on the page."""
        last, before = self.path[-1], self.path[-2]
        if isinstance(last, int):
            return f"{before} {'xyz'[last] if last < 3 else last}"
        return f"{last} (factor)" if self.kind == "factor" else str(last).replace("_", " ")


@dataclass(frozen=True)
class Section:
    """The settings of one part.

    Parameters
    ----------
    title
        Name of the part.
    settings
        Its settings.
    removal
        The event that takes the part out of the law; None where it must stay.
    """

    title: str
    settings: tuple[Setting, ...]
    removal: dict[str, object] | None = None


def sections(scenario: Scenario, base: Scenario | None = None) -> list[Section]:
    """Settings of all parts of a scenario: the law's graph and terms, leaders, obstacles, agents and accuracy.

    A dataclass of another library shows the settings in its fields. A leader of several terms is shown once.

    Parameters
    ----------
    base
        The scenario that factors multiply; the same one when absent.
    """
    seen: set[int] = set()
    law = scenario.law
    found = [_section(f"Graph: {type(law.graph).__name__}", law.graph, ("law", "graph"), seen)]
    for k, term in enumerate(law.terms):
        removal = {"kind": "drop", "number": k} if len(law.terms) > 1 else None
        found.append(_section(type(term).__name__, term, ("law", "terms", k), seen, removal))
    inner = [(path, part) for k, term in enumerate(law.terms) for path, part in _inner(term, ("law", "terms", k))]
    obstacles = [part for _, part in inner if isinstance(part, Obstacle)]
    for path, part in inner:
        if id(part) not in seen:
            number = f" {obstacles.index(part) + 1}" if isinstance(part, Obstacle) and len(obstacles) > 1 else ""
            removal = {"kind": "remove", "path": list(path)} if isinstance(part, Obstacle) else None
            found.append(_section(f"{_role(part)}{number}: {type(part).__name__}", part, path, seen, removal))
    found.append(_section("Agents", scenario.agents, ("agents",), seen))
    if isinstance(scenario.information, Messages):
        found.append(Section("Messages", tuple(_radio(scenario.information))))
    if isinstance(scenario.information, Delayed) and not scenario.information.ideal:
        found.append(Section(FORGETFUL, (_delay(scenario.information),)))
    shown = [s for s in found if s.settings or s.removal]
    return shown if base is None else [replace(s, settings=_multiplied(s.settings, scenario, base)) for s in shown]


def _multiplied(settings: tuple[Setting, ...], scenario: Scenario, base: Scenario) -> tuple[Setting, ...]:
    """Settings with the factors by which values differ from those of a scenario ``base``."""
    return tuple(
        replace(s, value=_factor(value_at(scenario, s.path), value_at(base, s.path))) if s.kind == "factor" else s
        for s in settings
    )


def _factor(now: object, before: object) -> float:
    """What values were multiplied by; 1 where they were zero, and where they are not multiples."""
    values, reference = (np.ravel(np.asarray(x, dtype=np.float64)) for x in (now, before))
    if values.shape != reference.shape or not np.any(reference):
        return 1.0
    k = int(np.abs(reference).argmax())
    return float(f"{values[k] / reference[k]:.{FACTOR_DIGITS}g}")


def _delay(information: Delayed) -> Setting:
    """How late agents know each other; a factor where pairs differ."""
    path = ("information", "tau")
    if information.of_pairs:
        return Setting(path, "factor", 1.0, LEAST_DELAY, LARGEST_FACTOR)
    tau = information.largest
    return Setting(path, "number", tau, LEAST_DELAY * tau, WIDE * tau)


def _radio(messages: Messages) -> Iterator[Setting]:
    """What may change about messages while a run goes on: when they arrive, how many, and how wrong they are.

    Without losses or noise the sliders stand at 0, from which they bring in independent losses and white noise.
    """
    longest = max(RADIO_PERIODS * float(np.max(messages.period)), 2.0 * messages.delay, 2.0 * messages.jitter)
    for name in ("delay", "jitter"):
        yield Setting(("information", name), "number", float(getattr(messages, name)), 0.0, longest)
    loss, noise = messages.loss, messages.noise
    if loss is None or isinstance(loss, Bernoulli):
        yield Setting(("information", "loss"), "number", 0.0 if loss is None else loss.probability, 0.0, 1.0)
    else:
        yield from _settings(loss, ("information", "loss"))
    position = 0.0 if noise is None else noise.position
    yield Setting(("information", "noise"), "number", position, 0.0, max(MOST_NOISE, WIDE * position))
    if noise is not None:
        velocity = max(MOST_NOISE, WIDE * noise.velocity)
        yield Setting(("information", "noise", "velocity"), "number", noise.velocity, 0.0, velocity)


def _role(part: object) -> str:
    return "Leader" if isinstance(part, Leader) else "Obstacle" if isinstance(part, Obstacle) else "Graph"


def _inner(part: object, path: tuple[Step, ...]) -> Iterator[tuple[tuple[Step, ...], object]]:
    """Leaders, obstacles and graphs inside a term, each with its path."""
    for step, child in children(part).items():
        if isinstance(child, Leader | Obstacle | Graph):
            yield (*path, step), child
        if isinstance(child, Obstacle | tuple):
            yield from _inner(child, (*path, step))


def _section(
    title: str, part: Any, path: tuple[Step, ...], seen: set[int], removal: dict[str, Any] | None = None
) -> Section:
    seen.add(id(part))
    return Section(title, tuple(_settings(part, path)), removal)


def _settings(part: object, path: tuple[Step, ...]) -> Iterator[Setting]:
    for step, value in children(part).items():
        here = (*path, step)
        field = field_at(part, step)
        if field is None:
            continue
        if isinstance(value, Potential | PairWeights):
            yield from _settings(value, here)
        else:
            yield from _controls(_shown(field.holds), value, here)


def _shown(holds: Value | Nested) -> Value:
    """The control of a plain value: that of a group's short form where the field may hold parts of the group."""
    if isinstance(holds, Value):
        return holds
    short = GROUPS[holds.group].short
    return values.hidden(values.ANY) if short is None else short.value


def _controls(holds: Value, value: object, here: tuple[Step, ...]) -> Iterator[Setting]:
    """Controls of a value; without a description they follow from its type."""
    unknown = holds is values.ANY
    if isinstance(value, bool):
        if holds.control == "flag" or unknown:
            yield Setting(here, "flag", value)
    elif isinstance(value, str):
        if holds.control in ("formula", "choice"):
            yield Setting(here, holds.control, value, choices=holds.words)
    elif isinstance(value, np.ndarray):
        if holds.control == "components":
            yield from _components(value, here)
        elif holds.control in ("factor", "number") or unknown:
            yield Setting(here, "factor", 1.0, 0.0, LARGEST_FACTOR)
    elif isinstance(value, int):
        if holds.control == "count":
            yield Setting(here, "count", value)
    elif isinstance(value, float) and math.isfinite(value) and (holds.control in ("number", "numbers") or unknown):
        low, high = _ends(value)
        yield Setting(here, "number", value, low, high)


def _components(value: AnyArray, here: tuple[Step, ...]) -> Iterator[Setting]:
    """Components of a velocity or a direction; places are dragged in the scene instead."""
    reach = WIDE * float(np.abs(value).max()) or ROOM
    for k, x in enumerate(value):
        yield Setting((*here, k), "number", float(x), -reach, reach)


def _ends(value: float) -> tuple[float, float]:
    if value == 0:
        return 0.0, ROOM
    return (0.0, WIDE * value) if value > 0 else (WIDE * value, -WIDE * value)
