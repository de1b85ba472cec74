"""What is drawn at random during a run: losses, delays and noise of messages, fixes, gusts, noise of headings."""

from __future__ import annotations

import dataclasses
from typing import TypeVar

import numpy as np

from flocking.model.law import Scenario
from flocking.model.parts.values import LARGEST_SEED

SIZES = ("noise", "loss", "jitter", "diffusion", "sigma")
"""Fields of parts of this library that state how much is random; where all are zero nothing is drawn."""

SEED_STEP = 0x1E3779B97F4A7C15
"""Difference of the seeds of parts within each other, a convention: large and odd, as no differences of seeds that
people choose are."""

Part = TypeVar("Part")


def draws_during_runs(scenario: Scenario) -> bool:
    """Whether anything about a run of a ``scenario`` is random, besides its start and its graph.

    Parameters
    ----------
    scenario
        The scenario.
    """
    return any(map(_draws, (scenario.agents, scenario.information)))


def with_seed_of_run(scenario: Scenario, seed: int) -> Scenario:
    """The ``scenario`` with another seed of all that is drawn during its runs; itself where nothing is.

    Bodies and messages have one seed then, as draws for different purposes are independent. Of parts within parts of
    the same kind, such as gusts before a lag and behind it, only the outermost has it: the others have seeds that
    follow from it, for draws for one purpose are independent by their seeds alone. Random weights of a law are no draws
    of a run: they keep theirs.

    Parameters
    ----------
    scenario
        The scenario.
    seed
        The seed.
    """
    if not draws_during_runs(scenario):
        return scenario
    agents, information = _reseeded(scenario.agents, seed), _reseeded(scenario.information, seed)
    return scenario.with_(agents=agents, information=information)


def _draws(part: object) -> bool:
    return _draws_itself(part) or any(map(_draws, _inner(part).values()))


def _draws_itself(part: object) -> bool:
    if not hasattr(part, "seed"):
        return False
    if getattr(part, "update", "") == "shuffled" or any(_is_some(getattr(part, name, None)) for name in SIZES):
        return True
    # The fields of a part of one's own may have any name.
    return not type(part).__module__.startswith("flocking.") and _is_part(part)


def _is_some(size: object) -> bool:
    ideal = getattr(size, "ideal", None)
    return not ideal if ideal is not None else size is not None and bool(np.any(np.asarray(size) != 0.0))


def _is_part(value: object) -> bool:
    return dataclasses.is_dataclass(value) and not isinstance(value, type)


def _inner(part: object) -> dict[str, object]:
    """Parts inside a part, and tuples of them, by field; nothing else."""
    found: dict[str, object] = {}
    if isinstance(part, tuple):
        return {str(k): entry for k, entry in enumerate(part) if _is_part(entry)}
    if not _is_part(part):
        return found
    for field in dataclasses.fields(part):  # type: ignore[arg-type]
        value = getattr(part, field.name)
        if field.init and (_is_part(value) or (isinstance(value, tuple) and any(map(_is_part, value)))):
            found[field.name] = value
    return found


def _reseeded(part: Part, seed: int, above: tuple[type, ...] = ()) -> Part:
    """A part with a ``seed``, inside parts that draw of the kinds ``above``."""
    if isinstance(part, tuple):
        return tuple(_reseeded(entry, seed, above) for entry in part)  # type: ignore[return-value]
    within = (*above, type(part)) if _draws_itself(part) else above
    changes = {name: _reseeded(value, seed, within) for name, value in _inner(part).items() if _draws(value)}
    if _draws_itself(part):
        changes["seed"] = (seed + SEED_STEP * above.count(type(part))) % (LARGEST_SEED + 1)
    return dataclasses.replace(part, **changes) if changes else part  # type: ignore[type-var]
