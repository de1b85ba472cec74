"""Options of an engine made from keyword arguments."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, TypeVar

from flocking.errors import InvalidInput

Options = TypeVar("Options")


def from_keywords(kind: type[Options], given: dict[str, Any], engine: str) -> Options:
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
        raise InvalidInput("start", name, f"must be an option of {engine}: {', '.join(sorted(known))}", given[name])
    return kind(**given)
