"""Parts as plain data and back: what a file may say about a scenario. Nothing in the data is ever executed."""

from __future__ import annotations

import base64
import binascii
import io
import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from importlib import import_module
from typing import Any

import numpy as np

from flocking.arrays import AnyArray
from flocking.errors import InvalidInput

HOMES: dict[str, str] = {
    "Agents": "state", "Avoid": "terms.avoidance", "Ball": "leaders_and_obstacles.obstacles",
    "Bump": "potentials.bumps", "Compensate": "terms.body_terms", "Cone": "graphs.views",
    "Consensus": "terms.pair_terms", "ConvexPolygon": "leaders_and_obstacles.polygons", "Energy": "energy",
    "FieldOfView": "graphs.views", "Fixed": "graphs.distance_graphs", "Gradient": "terms.pair_terms",
    "HashedWeights": "graphs.weights", "HeadingWeights": "graphs.views", "Hysteresis": "graphs.distance_graphs",
    "Law": "law", "MatrixWeights": "graphs.weights", "Path": "leaders_and_obstacles.leaders",
    "PerAgentRadii": "graphs.smooth_graphs", "Potential": "potentials.potential",
    "Proximity": "graphs.distance_graphs", "Scenario": "law", "Schedule": "terms.schedules",
    "Sink": "leaders_and_obstacles.leaders", "Smooth": "graphs.smooth_graphs", "SmoothCone": "graphs.views",
    "State": "state", "Track": "terms.body_terms", "Velocity": "leaders_and_obstacles.leaders",
    "Wall": "leaders_and_obstacles.obstacles",
}  # fmt: skip
"""Module under `flocking.model` of every part that data may name. A new dataclass part needs its line here only."""

SHARED = frozenset(
    {
        "graphs.distance_graphs",
        "leaders_and_obstacles.leaders",
        "leaders_and_obstacles.obstacles",
        "leaders_and_obstacles.polygons",
        "graphs.smooth_graphs",
        "graphs.views",
    }
)
"""Modules whose parts keep their identity: two terms that look at one leader still do after a round trip."""

LONGEST_LIST = 1000
"""Arrays with more entries are written as base64 of NumPy's own format instead of lists."""

DEEPEST = 40

_PLAIN: dict[str, type | tuple[type, ...]] = {
    "bool": bool, "str": str, "int": int, "int | None": (int, type(None)), "float": (int, float),
}  # fmt: skip


class ForeignPart(InvalidInput):
    """A part from outside this library: it can be simulated, but a file cannot name it."""


def to_data(part: object) -> object:
    """A part as plain data: dictionaries, lists, numbers, text, ready for JSON.

    Parameters
    ----------
    part
        Any part of a scenario, or a list of parts; objects shared between them stay shared.

    Raises
    ------
    ForeignPart
        When a part comes from outside this library.
    """
    return _Writer(part).data


def from_data(data: Any) -> Any:
    """The part that `to_data` described. Every part validates itself anew as it is built.

    Raises
    ------
    InvalidInput
        When the data names an unknown part or field, or a value breaks a rule of its part.
    """
    return _Reader().read(data, "data")


def part_class(name: str, where: str = "data") -> type:
    """Class of the part called ``name``.

    Raises
    ------
    InvalidInput
        When there is no such part.
    """
    if not isinstance(name, str) or name not in HOMES:
        raise InvalidInput(where, "part", f"must be one of {', '.join(HOMES)}", name)
    found = getattr(import_module(f"flocking.model.{HOMES[name]}"), name)
    assert isinstance(found, type)
    return found


def _arguments(part: Any) -> Mapping[str, object]:
    """What a part's class must be called with to make it again."""
    name = type(part).__name__
    if name in _TAKEN_APART:
        return _TAKEN_APART[name](part)
    return {f.name: getattr(part, f.name) for f in fields(part) if f.init}


_TAKEN_APART: dict[str, Callable[[Any], dict[str, Any]]] = {
    "Bump": lambda x: {"name": x.name, "formula": x.formula.text},
    "Consensus": lambda x: {k: getattr(x, k) for k in ("gain", "weights", "weighted", "functional", "over")},
    "Path": lambda x: {
        "velocity": [f.text for f in x.formulas], "start": x.start, "start_time": x.start_time,
        "parameters": dict(x.values),
    },
    "Potential": lambda x: {"formula": x.formula.text, "parameters": dict(x.parameters)},
}  # fmt: skip
"""Parts whose constructor takes something else than their fields; ``parameters`` are keyword arguments."""


class _Writer:
    """Describes parts, each shared one once."""

    def __init__(self, part: object) -> None:
        self._seen: dict[int, int] = {}
        self._described: dict[int, dict[str, object]] = {}
        self._keep: list[object] = []
        self.data = self._write(part)

    def _write(self, value: object) -> object:
        if value is None or isinstance(value, bool | str):
            return value
        if isinstance(value, np.bool_ | np.integer | np.floating):
            value = value.item()
        if isinstance(value, int):
            return value
        if isinstance(value, float):
            return value if math.isfinite(value) else {"float": repr(value)}
        if isinstance(value, np.ndarray):
            return _array_data(value)
        if isinstance(value, list | tuple):
            return [self._write(x) for x in value]
        if isinstance(value, Mapping):
            return {"values": {str(k): self._write(x) for k, x in value.items()}}
        return self._part(value)

    def _part(self, part: object) -> dict[str, object]:
        kind = type(part)
        home = HOMES.get(kind.__name__)
        if home is None or kind.__module__ != f"flocking.model.{home}":
            raise ForeignPart(
                "to_data", kind.__name__, "must be a part of this library to be written to a file", part,
                "A scenario with a part of your own can be simulated; keep the Python file that makes it.",
            )  # fmt: skip
        if home in SHARED and id(part) in self._described:
            number = self._seen.setdefault(id(part), len(self._seen))
            self._described[id(part)]["id"] = number
            return {"same": number}
        data: dict[str, object] = {"part": kind.__name__}
        self._described[id(part)] = data
        self._keep.append(part)
        data |= {name: self._write(value) for name, value in _arguments(part).items()}
        return data


def _array_data(values: AnyArray) -> object:
    if values.dtype.kind not in "bfiu":
        raise InvalidInput("to_data", "array", "must hold numbers", values.dtype)
    if values.dtype.kind == "f" and values.size <= LONGEST_LIST and 0 not in values.shape:
        return values.tolist()
    file = io.BytesIO()
    np.save(file, np.ascontiguousarray(values), allow_pickle=False)
    return {"npy": base64.b64encode(file.getvalue()).decode("ascii")}


class _Reader:
    """Builds parts from data."""

    def __init__(self) -> None:
        self._shared: dict[int, object] = {}

    def read(self, data: object, where: str, depth: int = 0) -> object:
        if depth > DEEPEST:
            raise InvalidInput(where, "data", f"must not be nested deeper than {DEEPEST}", "...")
        if data is None or isinstance(data, bool | str | int | float):
            return data
        if isinstance(data, list):
            return [self.read(x, f"{where}[{k}]", depth + 1) for k, x in enumerate(data)]
        if not isinstance(data, dict):
            raise InvalidInput(where, "value", "must be plain data", data)
        if "part" in data:
            return self._part(dict(data), where, depth)
        if set(data) == {"same"}:
            return self._again(data["same"], where)
        if set(data) == {"npy"}:
            return _array(data["npy"], where)
        if set(data) == {"float"} and data["float"] in ("inf", "-inf", "nan"):
            return float(data["float"])
        if set(data) == {"values"} and isinstance(data["values"], dict):
            return {k: self.read(x, f"{where}.{k}", depth + 1) for k, x in data["values"].items()}
        raise InvalidInput(where, "value", "must be a number, text, a list or a part", sorted(map(str, data)))

    def _again(self, number: object, where: str) -> object:
        if not isinstance(number, int) or number not in self._shared:
            raise InvalidInput(where, "same", "must be the id of a part described before", number)
        return self._shared[number]

    def _part(self, data: dict[str, Any], where: str, depth: int) -> Any:
        name = data.pop("part")
        kind = part_class(name, where)
        number = data.pop("id", None)
        if number is not None and not isinstance(number, int):
            raise InvalidInput(where, "id", "must be a whole number", number)
        where = f"{where}.{name}"
        given = {key: self.read(value, f"{where}.{key}", depth + 1) for key, value in data.items()}
        if name not in _TAKEN_APART:
            _check_fields(kind, given, where)
        parameters = given.pop("parameters", {}) if name in _TAKEN_APART else {}
        if not isinstance(parameters, dict) or not all(isinstance(k, str) for k in parameters):
            raise InvalidInput(where, "parameters", "must be named numbers", parameters)
        if clash := sorted(set(parameters) & set(given)):
            raise InvalidInput(where, clash[0], "must be given once", parameters)
        try:
            built = kind(**given, **parameters)
        except InvalidInput:
            raise
        except (TypeError, ValueError, AttributeError) as error:
            raise InvalidInput(where, "fields", f"must make a {name} ({error})", sorted(given)) from None
        if number is not None:
            self._shared[number] = built
        return built


def _check_fields(kind: type, given: Mapping[str, object], where: str) -> None:
    known = {f.name: f for f in fields(kind) if f.init}
    if odd := sorted(set(given) - set(known)):
        raise InvalidInput(where, odd[0], f"is no field of {kind.__name__}", given[odd[0]], f"It has {list(known)}.")
    for name, f in known.items():
        if name not in given:
            if f.default is MISSING and f.default_factory is MISSING:
                raise InvalidInput(where, name, "must be given", None)
            continue
        expected = _PLAIN.get(str(f.type))
        value = given[name]
        if expected and (not isinstance(value, expected) or (isinstance(value, bool) and expected is not bool)):
            raise InvalidInput(where, name, f"must be of type {f.type}", value)


def _array(text: str | bytes, where: str) -> AnyArray:
    try:
        file = io.BytesIO(base64.b64decode(text, validate=True))
        values = np.load(file, allow_pickle=False)
    except (TypeError, ValueError, EOFError, OSError, binascii.Error) as error:
        raise InvalidInput(where, "npy", f"must be a NumPy array in base64 ({error})", str(text)[:20]) from None
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "bfiu":
        raise InvalidInput(where, "npy", "must be an array of numbers", str(text)[:20])
    return values
