"""Seeds and truth values of parts are checked where they are given: wrong ones get one sentence, and none is taken."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import is_dataclass

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.parts.description import DESCRIPTIONS
from flocking.model.parts.values import LARGEST_SEED

POINTS = fk.PointMass()
LAW = fk.Law(fk.Fixed.complete(2), [fk.Consensus()])
BALL = fk.Ball([5.0, 0.0], 1.0)

SEEDED: dict[str, Callable[[object], object]] = {
    "Heading": lambda seed: fk.Heading(1.0, noise=0.5, seed=seed),
    "Impulsive": lambda seed: fk.Impulsive(update="shuffled", seed=seed),
    "VelocityUnit": lambda seed: fk.VelocityUnit(1.0, diffusion=1.0, seed=seed),
    "Disturbed": lambda seed: fk.Disturbed(fk.Disturbed(POINTS, 0.1, 0.1, seed=7), 0.1, 0.1, seed=seed),
    "Fixes": lambda seed: fk.Fixes(0.1, damping=1.0, diffusion=1.0, seed=seed),
    "Messages": lambda seed: fk.Messages(0.1, seed=seed),
    "HashedWeights": lambda seed: fk.HashedWeights(0.0, 1.0, seed=seed),
    "Scenario": lambda seed: fk.Scenario(LAW, fk.State(np.eye(2)), 1.0, seed=seed),
}
"""Parts with a seed, by name: functions of it."""

FLAGGED: dict[tuple[str, str], Callable[[object], object]] = {
    ("Proximity", "closed"): lambda flag: fk.Proximity(1.0, closed=flag),
    ("PerAgentRadii", "closed"): lambda flag: fk.PerAgentRadii([1.0, 2.0], closed=flag),
    ("Fixed", "directed"): lambda flag: fk.Fixed(2, [(0, 1)], directed=flag),
    ("Consensus", "weighted"): lambda flag: fk.Consensus(1.0, weighted=flag),
    ("Consensus", "functional"): lambda flag: fk.Consensus(1.0, functional=flag),
    ("Track", "per_mass"): lambda flag: fk.Track([1.0, 0.0], per_mass=flag),
    ("Track", "shared"): lambda flag: fk.Track([1.0, 0.0], shared=flag),
    ("Track", "saturated"): lambda flag: fk.Track([1.0, 0.0], saturated=flag),
    ("Avoid", "gamma_agents"): lambda flag: fk.Avoid([BALL], range=1.0, leader=[1.0, 0.0], gamma_agents=flag),
    ("Avoid", "fading_damping"): lambda flag: fk.Avoid([BALL], range=1.0, fading_damping=flag, gamma_agents=False),
    ("Alignment", "relative"): lambda flag: fk.Alignment(1.0, radius=1.0, relative=flag),
    ("VelocityUnit", "fixed"): lambda flag: fk.VelocityUnit(1.0, speed=1.0, fixed=flag),
    ("Messages", "predict"): lambda flag: fk.Messages(0.1, predict=flag),
    ("Messages", "leader"): lambda flag: fk.Messages(0.1, leader=flag),
    ("Delayed", "self_delayed"): lambda flag: fk.Delayed(0.1, self_delayed=flag),
    ("Bernoulli", "paired"): lambda flag: fk.Bernoulli(0.1, paired=flag),
    ("GilbertElliott", "paired"): lambda flag: fk.GilbertElliott(0.1, 0.5, paired=flag),
    ("DistanceLoss", "paired"): lambda flag: fk.DistanceLoss(1.0, paired=flag),
}
"""Fields of parts that are true or false: functions of their value."""


def fields_of_the_library() -> list[tuple[str, str, str]]:
    """Names of registered classes of the library and of their fields, and the annotations of these."""
    parts = [each.call for each in DESCRIPTIONS if is_dataclass(each.call)]
    return [
        (part.__name__, field.name, str(field.type).removeprefix("Annotated["))
        for part in parts if part.__module__.startswith("flocking.")
        for field in part.__dataclass_fields__.values() if field.init
    ]  # fmt: skip


def test_no_seed_and_no_flag_of_the_library_is_missing_here() -> None:
    found = fields_of_the_library()
    assert {part for part, name, _ in found if name == "seed"} == set(SEEDED)
    assert {(part, name) for part, name, kind in found if kind.startswith("bool")} == set(FLAGGED)


@pytest.mark.parametrize("name", SEEDED)
@pytest.mark.parametrize("seed", ["7", 1.5, True, [1], -1, LARGEST_SEED + 1, 2**100])
def test_a_seed_that_cannot_be_stored_or_drawn_from_is_refused(name: str, seed: object) -> None:
    with pytest.raises(InvalidInput, match=rf"^{name}: seed must be (an integer|at least 0|at most {LARGEST_SEED})"):
        SEEDED[name](seed)


@pytest.mark.parametrize("name", SEEDED)
@pytest.mark.parametrize("seed", [0, np.int64(3), LARGEST_SEED])
def test_other_seeds_are_taken_as_integers(name: str, seed: int) -> None:
    found = SEEDED[name](seed).seed
    assert type(found) is int
    assert found == seed


@pytest.mark.parametrize("name", FLAGGED, ids=".".join)
def test_what_is_true_or_false_is_no_other_value(name: tuple[str, str]) -> None:
    for wrong in ("no", "false", 0, 1.0, None, []):
        with pytest.raises(InvalidInput, match=rf"{name[1]} must be True or False"):
            FLAGGED[name](wrong)
    for right in (True, False, np.True_, np.False_):
        FLAGGED[name](right)
