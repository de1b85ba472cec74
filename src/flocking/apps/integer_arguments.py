"""Integers on the command line: 1.5 is refused and not rounded."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from inspect import signature

from flocking.errors import InvalidInput


def check_integers(command: Callable[..., object], words: Sequence[str]) -> None:
    """Check that options of a command that count something were given as integers.

    Parameters
    ----------
    command
        The function of the command.
    words
        Words of the command line.

    Raises
    ------
    InvalidInput
        When one was not.
    """
    counting = {
        "--" + name.replace("_", "-")
        for name, parameter in signature(command).parameters.items()
        if str(parameter.annotation) in ("int", "int | None")
    }
    following = [*words, ""][1:]
    for word, after in zip(words, following, strict=True):
        if word == "--":
            return
        name, equals, value = word.partition("=")
        if name in counting and not re.fullmatch(r"[+-]?\d+", value if equals else after):
            raise InvalidInput(command.__name__, name, "must be an integer", value if equals else after)
