"""Conversion of parts to plain data and back. Data are never executed."""

from __future__ import annotations

import base64
import binascii
import io
import math
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cached_property, partial
from types import FunctionType
from typing import Any

import numpy as np

import flocking.model.library  # noqa: F401  registers the parts of the library
from flocking.arrays import AnyArray
from flocking.errors import HEADER_ERRORS, InvalidInput
from flocking.model.parts.description import Description, registered, registered_names
from flocking.model.parts.values import NAMED_NUMBERS, Value

LONGEST_LIST = 1000
"""Arrays with more entries are written as base64 of NumPy's format instead of lists."""

DEEPEST = 40
"""Largest depth of nested parts; far below the recursion limit of the interpreter."""


class ForeignPart(InvalidInput):
    """A part that is not registered: it can be simulated but not stored."""


def to_data(part: object) -> object:
    """A part as plain data: dictionaries, lists, numbers, text, ready for JSON.

    Parameters
    ----------
    part
        Any part of a scenario, or a list of parts; shared objects stay shared.

    Raises
    ------
    ForeignPart
        If a part is not from this library and not registered, see `flocking.register_part`.
    """
    return _Writer(part).data


def described_data(part: object, note: Callable[[Callable[..., object]], None]) -> object:
    """As `to_data`, with parts that are not registered by their fields: a description from which none is made again.

    Parameters
    ----------
    part
        A part of a scenario, or a list of parts.
    note
        Called with the class of every part from outside this library, registered or not, and with every function and
        class that parts hold.
    """
    return _Describer(part, note).data


def from_data(data: object) -> Any:
    """The part from the output of `to_data`. Every part is validated.

    Raises
    ------
    InvalidInput
        If the data contain an unknown part or field, or a value is invalid.
    """
    return _Reader().read(data, "data")


def _kind(name: object, where: str, source: object) -> Description:
    """The registered part called ``name``."""
    known = registered_names()
    if isinstance(name, str) and name in known:
        return known[name]
    fix = f"Import {source} first: it registers its parts." if isinstance(source, str) else ""
    raise InvalidInput(where, "part", f"must be one of {', '.join(sorted(known))}", name, fix)


class _Writer:
    """Writes parts; shared parts are written once."""

    def __init__(self, part: object) -> None:
        self._seen: dict[int, int] = {}
        self._described: dict[int, dict[str, object]] = {}
        self._alive: list[object] = []
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
        kind = registered(part)
        if kind is None:
            return self._foreign(part)
        if kind.shares_identity and id(part) in self._described:
            number = self._seen.setdefault(id(part), len(self._seen))
            self._described[id(part)]["id"] = number
            return {"same": number}
        data: dict[str, object] = {"part": kind.name}
        module = kind.builds.__module__
        if module.partition(".")[0] != __name__.partition(".")[0]:
            data["from"] = module
        self._described[id(part)] = data
        self._alive.append(part)
        for name, value in kind.values_of(part).items():
            if not kind.fields[name].is_written(value):
                continue
            holds = kind.fields[name].holds
            data[name] = self._write(holds.store(value) if isinstance(holds, Value) else value)
        return data

    def _foreign(self, part: object) -> dict[str, object]:
        raise ForeignPart(
            "to_data", type(part).__name__, "must be a part of this library or a registered one", part,
            "Decorate its class with @fk.register_part, or keep the Python file that makes the scenario.",
        )  # fmt: skip


class _Describer(_Writer):
    """Describes parts that are not registered too, and notes the classes of those from outside this library."""

    def __init__(self, part: object, note: Callable[[Callable[..., object]], None]) -> None:
        self._note = note
        self._under_way: set[int] = set()
        super().__init__(part)

    def _write(self, value: object) -> object:
        if isinstance(value, bytes):
            return value.hex()
        if isinstance(value, set | frozenset):
            return sorted(map(repr, value))
        if isinstance(value, np.ndarray) and value.dtype.kind not in "bfiu":
            return [self._write(x) for x in value.tolist()]
        return super()._write(value)

    def _part(self, part: object) -> dict[str, object]:
        if type(part).__module__.partition(".")[0] != __name__.partition(".")[0]:
            named = callable(part) and (hasattr(part, "__qualname__") or isinstance(part, partial))
            self._note(part if callable(part) and named else type(part))
        return super()._part(part)

    def _foreign(self, part: object) -> dict[str, object]:
        name: dict[str, object] = {"foreign": type(part).__qualname__}
        if id(part) in self._under_way or isinstance(part, type | FunctionType):
            return name
        self._under_way.add(id(part))
        computed = {
            key for kind in type(part).__mro__ for key, x in vars(kind).items() if isinstance(x, cached_property)
        }
        held = {key: x for key, x in getattr(part, "__dict__", {}).items() if key not in computed}
        if is_dataclass(part):
            held |= {f.name: getattr(part, f.name, None) for f in fields(part)}
        stated = getattr(part, "parameters", None)
        if isinstance(stated, Mapping):
            held["parameters"] = stated
        name["holds"] = {str(key): self._write(x) for key, x in sorted(held.items(), key=lambda item: str(item[0]))}
        self._under_way.discard(id(part))
        return name


def _array_data(values: AnyArray) -> object:
    if values.dtype.kind not in "bfiu":
        raise InvalidInput("to_data", "array", "must contain numbers", values.dtype)
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

    def _part(self, data: dict[str, object], where: str, depth: int) -> object:
        name = data.pop("part")
        kind = _kind(name, where, data.pop("from", None))
        number = data.pop("id", None)
        if number is not None and not isinstance(number, int):
            raise InvalidInput(where, "id", "must be an integer", number)
        where = f"{where}.{kind.name}"
        given = {key: self.read(value, f"{where}.{key}", depth + 1) for key, value in data.items()}
        _check_fields(kind, given, where)
        try:
            built = kind.call(**given)
        except InvalidInput:
            raise
        except (TypeError, ValueError, AttributeError) as error:
            raise InvalidInput(where, "fields", f"must make a {name} ({error})", sorted(given)) from None
        if number is not None:
            self._shared[number] = built
        return built


def _check_fields(kind: Description, given: Mapping[str, object], where: str) -> None:
    if odd := sorted(set(given) - set(kind.fields)):
        fix = f"It has {list(kind.fields)}."
        raise InvalidInput(where, odd[0], f"is not a field of {kind.name}", given[odd[0]], fix)
    for name, field in kind.fields.items():
        if name not in given:
            if field.required:
                raise InvalidInput(where, name, "must be given", None)
            continue
        value = given[name]
        if field.holds is NAMED_NUMBERS and not isinstance(value, dict):
            raise InvalidInput(where, name, "must be named numbers", value)
        wrong_type = not isinstance(value, field.plain) or (isinstance(value, bool) and bool not in field.plain)
        if field.plain and wrong_type:
            raise InvalidInput(where, name, f"must be of type {field.type_name}", value)


def _array(text: str | bytes, where: str) -> AnyArray:
    try:
        file = io.BytesIO(base64.b64decode(text, validate=True))
        values = np.load(file, allow_pickle=False)
    except (*HEADER_ERRORS, TypeError, EOFError, OSError, binascii.Error) as error:
        raise InvalidInput(where, "npy", f"must be a NumPy array in base64 ({error})", str(text)[:20]) from None
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "bfiu":
        raise InvalidInput(where, "npy", "must be an array of numbers", str(text)[:20])
    return values
