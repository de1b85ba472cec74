"""Digests of scenarios, by which results on the disk are known to be those of the runs that are asked for."""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
import json
from collections.abc import Mapping

import numpy as np

from flocking.model.law import Scenario
from flocking.model.serial import ForeignPart, to_data
from flocking.study.sweeps.measures import code_of

DEEPEST = 20
"""Parts inside each other that are described: scenarios have about five, and one that contains itself ends."""


def fingerprint(scenario: Scenario) -> str:
    """What distinguishes scenarios that differ in more than the seed they name.

    Parts that are not registered are described by their fields and the code of their classes; what their code calls
    is not.

    Parameters
    ----------
    scenario
        The scenario.
    """
    return digest_of(_text(scenario.with_(seed=None)))


def digest_of(text: str) -> str:
    """A text in 64 digits."""
    return hashlib.sha256(text.encode()).hexdigest()


def has_foreign_parts(scenario: Scenario) -> bool:
    """Whether parts of a scenario are not registered, so that equal descriptions do not prove them equal."""
    try:
        to_data(scenario)
    except ForeignPart:
        return True
    return False


def _text(scenario: Scenario) -> str:
    try:
        return json.dumps(to_data(scenario), sort_keys=True)
    except ForeignPart:
        return _described(scenario, DEEPEST)


def _described(value: object, depth: int) -> str:
    """A value as text that is the same in every process."""
    if isinstance(value, np.ndarray | np.generic):
        array = np.ascontiguousarray(value)
        return f"{array.dtype} {array.shape} {digest_of(array.tobytes().hex())}"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{k!r}: {_described(v, depth - 1)}" for k, v in value.items()) + "}"
    if isinstance(value, tuple | list) and depth:
        return "[" + ", ".join(_described(v, depth - 1) for v in value) + "]"
    if inspect.isroutine(value):
        return code_of(value)
    kind = type(value)
    if dataclasses.is_dataclass(value) and depth:
        fields = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
        code = "" if kind.__module__.startswith("flocking.") else _code_of_class(kind)
        return f"{kind.__module__}.{kind.__qualname__}{code}({_described(fields, depth - 1)})"
    text = repr(value)
    return f"{kind.__module__}.{kind.__qualname__}" if " at 0x" in text else text


def _code_of_class(kind: type) -> str:
    """Code and constants that classes outside this library state."""
    found = []
    for each in kind.__mro__:
        if each.__module__.partition(".")[0] in ("flocking", "builtins", "abc"):
            continue
        for name, entry in vars(each).items():
            function = entry.fget if isinstance(entry, property) else getattr(entry, "__func__", entry)
            if inspect.isfunction(function):
                found.append(code_of(function))
            elif isinstance(entry, int | float | str | tuple) and not name.startswith("__"):
                found.append(f"{name}={entry!r}")
    return digest_of(" ".join(found))
