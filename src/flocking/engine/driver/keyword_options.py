"""Options of an engine made from keyword arguments."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import TypeVar

from flocking.errors import InvalidInput

Options = TypeVar("Options")


def from_keywords(kind: type[Options], given: Mapping[str, object], engine: str) -> Options:
    """Options of one kind.

    Parameters
    ----------
    kind
        Dataclass of an engine's options.
    given
        The keyword arguments.
    engine
        What the message calls the engine.

    Raises
    ------
    InvalidInput
        When there is no such option.
    """
    known = {f.name for f in fields(kind)}  # type: ignore[arg-type]
    for name in sorted(set(given) - known):
        raise unknown_option(name, given[name], known, engine)
    return kind(**given)


def unknown_option(name: str, value: object, known: Iterable[str], engine: str) -> InvalidInput:
    """Why an option is refused: it is unknown, and there is one of about that name, or none.

    Parameters
    ----------
    name, value
        The option that was given.
    known
        Names that there are.
    engine
        What the message calls the engine.
    """
    names = sorted(known)
    near = difflib.get_close_matches(name, names, n=1)
    fix = f"Did you mean {near[0]}? " if near else ""
    return InvalidInput(
        "start", name, f"is not known to {engine}", value, f"{fix}Known: {', '.join(names)}." if names else fix.strip()
    )
