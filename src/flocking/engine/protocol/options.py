"""Options of an engine made from keyword arguments."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import TypeVar

from flocking.errors import InvalidInput

Options = TypeVar("Options")


class UnknownOption(InvalidInput):
    """An option that the engine does not have."""


def from_keywords(kind: type[Options], given: Mapping[str, object], engine: str) -> Options:
    """Options of the dataclass ``kind``; ``engine`` is the name of the engine.

    Raises
    ------
    InvalidInput
        When there is no such option, or a value breaks a rule.
    """
    known = {f.name for f in fields(kind)}  # type: ignore[arg-type]
    for name in sorted(set(given) - known):
        raise unknown_option(name, given[name], known, engine)
    return kind(**given)


def unknown_option(
    name: str, value: object, known: Iterable[str], engine: str, elsewhere: Mapping[str, str] | None = None
) -> UnknownOption:
    """The error for an option that ``engine`` lacks; it suggests the nearest name.

    Parameters
    ----------
    name, value
        The option as it was given.
    known
        Names that are known to the engine.
    engine
        Name of the engine.
    elsewhere
        Names of options of all engines, each with words for the engines that have it.
    """
    names, others = sorted(known), elsewhere or {}
    near = nearest(name, names)
    for other in difflib.get_close_matches(name, sorted({*names, *others}), n=1):
        if other not in names:
            near = f"Did you mean {other}, an option of {others[other]}?"
    fix = f"{near} Known: {', '.join(names)}." if names else "It has no options."
    return UnknownOption("start", name, f"is not known to engine={engine!r}", value, fix.strip())


def nearest(name: str, names: Iterable[str]) -> str:
    """A sentence that suggests the nearest of some ``names``; empty if none is near."""
    near = difflib.get_close_matches(name, sorted(names), n=1)
    return f"Did you mean {near[0]}?" if near else ""
