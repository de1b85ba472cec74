"""Seeds and generators as SPEC 7 of Scientific Python names them: `rng` beside `seed`, by one rule."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from functools import wraps
from typing import ParamSpec, Protocol, TypeVar, overload

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import integer
from flocking.model.parts.values import LARGEST_SEED

Kind = TypeVar("Kind", bound=type)
Taken = ParamSpec("Taken")
Made = TypeVar("Made")
Given = TypeVar("Given", covariant=True)

Rng = int | np.random.SeedSequence | np.random.Generator
"""What a function that stores no seed takes as ``rng``."""

SeedNumber = int | np.random.SeedSequence
"""What becomes a seed that is stored: ``rng`` of everything else."""

HALF = np.uint64(1)
"""Bits by which a word of 64 bits is shifted so that it is at most `LARGEST_SEED`."""

REPRODUCIBLE = "Give an integer or a numpy.random.SeedSequence: the seed is written into files and records of runs."


def seed_number(owner: str, seed: object) -> int:
    """A seed that is stored, in files too, and of which draws are functions: an integer of 63 bits.

    Parameters
    ----------
    owner
        The owner, for messages.
    seed
        The seed.

    Raises
    ------
    InvalidInput
        If it is no integer, negative or above `LARGEST_SEED`.
    """
    found = integer(owner, "seed", seed, least=0)
    if found > LARGEST_SEED:
        raise InvalidInput(
            owner, "seed", f"must be at most {LARGEST_SEED}", seed, "Give rng=numpy.random.SeedSequence(...) of it."
        )
    return found


def generator_from(owner: str, seed: int | np.random.Generator | None, rng: Rng | None) -> np.random.Generator:
    """The generator of a function that stores no seed.

    Parameters
    ----------
    owner
        The owner, for messages.
    seed, rng
        One of them: an integer or a generator, which is drawn from; ``rng`` may be a sequence of seeds too.

    Raises
    ------
    InvalidInput
        If neither or both are given, or it is neither of these.
    """
    name, given = _one_of(owner, seed, rng)
    if isinstance(given, np.random.Generator) or (name == "rng" and isinstance(given, np.random.SeedSequence)):
        return np.random.default_rng(given)
    return np.random.default_rng(integer(owner, name, given, least=0))


def seed_from(owner: str, rng: object) -> int:
    """The seed of a part whose draws are functions of an integer, from its ``rng``.

    Parameters
    ----------
    owner
        The owner, for messages.
    rng
        An integer, which is the seed; or a `numpy.random.SeedSequence`: that of an integer gives this integer, any
        other one 63 bits of its state. A sequence stays as it is, so that it gives the same seed each time.

    Raises
    ------
    InvalidInput
        If it is a generator or anything else.
    """
    if isinstance(rng, np.random.SeedSequence):
        plain = isinstance(rng.entropy, int | np.integer) and not rng.spawn_key
        if plain and 0 <= int(rng.entropy) <= LARGEST_SEED:  # type: ignore[arg-type]
            return int(rng.entropy)  # type: ignore[arg-type]
        return int(rng.generate_state(1, np.uint64)[0] >> HALF)
    if isinstance(rng, np.random.Generator | np.random.BitGenerator | np.random.RandomState):
        raise InvalidInput(owner, "rng", "must not be a generator", type(rng).__name__, REPRODUCIBLE)
    if rng is None:
        raise InvalidInput(owner, "rng", "must not be None", rng, REPRODUCIBLE)
    return integer(owner, "rng", rng, least=0)


def given_seed(owner: str, seed: int | None, rng: object) -> int | None:
    """The seed of a function that takes ``seed`` or ``rng``; None if neither is given.

    Parameters
    ----------
    owner
        The owner, for messages.
    seed, rng
        None, or one of them.

    Raises
    ------
    InvalidInput
        If both are given, or ``rng`` is no integer and no `numpy.random.SeedSequence`.
    """
    if rng is None:
        return seed
    if seed is not None:
        raise _twice(owner, rng)
    return seed_from(owner, rng)


def take_rng(owner: str, order: Sequence[str], values: tuple[object, ...], named: dict[str, object]) -> None:
    """Put the seed that ``rng`` gives where the field ``seed`` is, among the arguments ``named``.

    Parameters
    ----------
    owner
        The owner, for messages.
    order
        Names of the arguments that may be given by place.
    values
        Arguments given by place.
    named
        Arguments given by name, changed in place.

    Raises
    ------
    InvalidInput
        If both are given, or ``rng`` is no integer and no `numpy.random.SeedSequence`.
    """
    if "rng" not in named:
        return
    rng = named.pop("rng")
    if "seed" in named or "seed" in order[: len(values)]:
        raise _twice(owner, rng)
    named["seed"] = seed_from(owner, rng)


def takes_rng(kind: Kind) -> Kind:
    """Decorator of a dataclass with a field ``seed``: its constructor takes ``rng`` by name instead.

    Parameters
    ----------
    kind
        The dataclass.
    """
    made: Callable[..., None] = kind.__init__  # type: ignore[misc]
    order = tuple(kind.__match_args__)  # type: ignore[attr-defined]

    @wraps(made)
    def seeded(self: object, *values: object, **named: object) -> None:
        take_rng(kind.__name__, order, values, named)
        made(self, *values, **named)

    kind.__init__ = seeded  # type: ignore[misc]
    return kind


class Seeded(Protocol[Taken, Given]):
    """A function with an argument ``seed`` that takes ``rng`` by name instead."""

    @overload
    def __call__(self, *values: Taken.args, **named: Taken.kwargs) -> Given: ...

    @overload
    def __call__(self, *values: object, rng: SeedNumber, **named: object) -> Given: ...


def seeded(function: Callable[Taken, Made]) -> Seeded[Taken, Made]:
    """Decorator of a function with an argument ``seed``, an integer: it takes ``rng`` by name instead.

    ``rng`` is an integer or a `numpy.random.SeedSequence`; both names at once and generators are refused by
    `InvalidInput`.

    Parameters
    ----------
    function
        The function.
    """
    plain = inspect.signature(function)
    order = [name for name, argument in plain.parameters.items() if argument.kind is argument.POSITIONAL_OR_KEYWORD]
    rng = inspect.Parameter("rng", inspect.Parameter.KEYWORD_ONLY, default=None, annotation="SeedNumber | None")

    @wraps(function)
    def taking(*values: Taken.args, **named: Taken.kwargs) -> Made:
        take_rng(function.__name__, order, values, named)
        return function(*values, **named)

    taking.__signature__ = plain.replace(parameters=[*plain.parameters.values(), rng])  # type: ignore[attr-defined]
    return taking  # type: ignore[return-value]


def _one_of(owner: str, seed: object, rng: object) -> tuple[str, object]:
    if rng is None:
        if seed is None:
            raise InvalidInput(owner, "seed", "must be given, or rng", seed, "Pass an integer, such as rng=0.")
        return "seed", seed
    if seed is not None:
        raise _twice(owner, rng)
    return "rng", rng


def _twice(owner: str, rng: object) -> InvalidInput:
    return InvalidInput(owner, "rng", "must not be given beside seed", rng, "They are two names of one argument.")
