"""The sections of a sweep file: reading with all faults at once, and their JSON schema."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, TypedDict, cast

from flocking.engine.driver.registry import AUTO, engine_names
from flocking.model.parts import values
from flocking.model.parts.description import Description
from flocking.model.parts.registration import described
from flocking.model.parts.values import RefusedError, Value, nearest
from flocking.study.scenario_files.problems import Problem, place_of, shown
from flocking.study.scenario_files.scenario_reader import FORMAT, Faulty, Reader
from flocking.study.scenario_files.scenario_schema import Schema, table_schema

MOST_VALUES = 10_000
"""Values of an axis, a bound on memory."""
MOST_NAMES = 50
"""Names of a table, a bound on memory."""
_NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,79}$"


def _number(value: object) -> int | float:
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    found = values.NUMBER.check(value)
    assert isinstance(found, float)
    return found


def _file_name(value: object) -> str:
    if re.fullmatch(_NAME, _text(value)) is None:
        raise RefusedError("must be letters, digits, - and _, at most 80 of them")
    return _text(value)


def _table(value: object) -> dict[str, object]:
    if not isinstance(value, dict):
        raise RefusedError("must be a table")
    return value


def _options(value: object) -> dict[str, object]:
    if len(_table(value)) > MOST_NAMES:
        raise RefusedError(f"must have at most {MOST_NAMES} entries")
    return _table(value)


def _ranges(value: object) -> dict[str, object]:
    if not 1 <= len(_table(value)) <= MOST_NAMES:
        raise RefusedError(f"must have 1 to {MOST_NAMES} entries")
    return _table(value)


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise RefusedError("must be text in quotes")
    return value


_EITHER = Value(_number, {"type": "number"})
"""A number; integers stay integers."""


@dataclass(frozen=True)
class Spaced:
    """Evenly spaced values of a grid's axis.

    Parameters
    ----------
    low, high
        First and last value.
    count
        How many.
    log
        Whether their logarithms are evenly spaced.
    """

    low: float
    high: float
    count: Annotated[int, values.integer_from(2, MOST_VALUES)]
    log: bool = False


@dataclass(frozen=True)
class Drawn:
    """A range that values are drawn from.

    Parameters
    ----------
    low, high
        Its ends; two integers give integers.
    log
        Whether the logarithm is drawn evenly.
    """

    low: Annotated[float, _EITHER]
    high: Annotated[float, _EITHER]
    log: bool = False


@dataclass(frozen=True)
class Sampling:
    """Points drawn from ranges.

    Parameters
    ----------
    method
        How.
    count
        How many.
    ranges
        Ranges by the name of the parameter.
    seed
        Seed of the draw.
    """

    method: Annotated[str, values.choice("random", "latin", "sobol")]
    count: Annotated[int, values.integer_above(1)]
    ranges: Annotated[
        Mapping[str, Drawn],
        Value(
            _ranges,
            {
                "type": "object", "additionalProperties": {"$ref": "#/$defs/Drawn"},
                "minProperties": 1, "maxProperties": MOST_NAMES,
            },
        ),
    ]  # fmt: skip
    seed: Annotated[int, values.SEED] = 0


class Sections(TypedDict, total=False):
    """The valid sections of a sweep file, by name."""

    format: int
    name: str
    scenario: str | dict[str, object]
    options: dict[str, object]
    grid: dict[str, list[object] | Spaced]
    sample: Sampling
    seeds: int | list[int]
    seed: int
    measures: list[str]
    audit: bool
    engine: str


SPACED, DRAWN, SAMPLING = described(Spaced), described(Drawn), described(Sampling)

_ALTERNATIVES: dict[str, dict[type, Value | Description]] = {
    "format": {int: FORMAT},
    "name": {str: Value(_file_name, {"type": "string", "pattern": _NAME})},
    "scenario": {str: Value(_text, {"type": "string"}), dict: Value(_table, {"type": "object"})},
    "options": {dict: Value(_options, {"type": "object", "maxProperties": MOST_NAMES})},
    "sample": {dict: SAMPLING},
    "seeds": {int: values.integer_above(1), list: values.list_of(values.SEED, "seeds", 1)},
    "seed": {int: values.SEED},
    "measures": {list: values.list_of(Value(_text, {"type": "string"}), "names of measures", 1, MOST_NAMES)},
    "audit": {bool: values.TRUTH},
}
"""Values of each section but the engine, by their TOML type."""


def _alternatives() -> dict[str, dict[type, Value | Description]]:
    """Values of each section; the engine is one of those registered now."""
    return {**_ALTERNATIVES, "engine": {str: values.choice(AUTO, *engine_names())}}


_AXIS: dict[type, Value | Description] = {list: values.list_of(values.ANY, "values", 1, MOST_VALUES), dict: SPACED}
SECTIONS = ("format", "name", "scenario", "options", "grid", "sample", "seeds", "seed", "measures", "audit", "engine")
REQUIRED = ("scenario",)

_WORDS: dict[type, str] = {
    int: "an integer", str: "text in quotes", dict: "a table", list: "a list", bool: "true or false",
}  # fmt: skip


def section_schemas() -> tuple[Schema, Schema]:
    """Schemas of the sections, and of the tables that they refer to."""
    definitions: Schema = {}
    for kind in (SPACED, DRAWN, SAMPLING):
        definitions[kind.name] = table_schema(kind.name, kind.fields, definitions)
    found: Schema = {name: _either(choices) for name, choices in _alternatives().items()}
    grid: Schema = {"type": "object", "maxProperties": MOST_NAMES, "additionalProperties": _either(_AXIS)}
    return {**found, "grid": grid}, definitions


def _either(choices: Mapping[type, Value | Description]) -> Schema:
    found: list[Schema] = [
        dict(c.schema) if isinstance(c, Value) else {"$ref": f"#/$defs/{c.name}"} for c in choices.values()
    ]
    return found[0] if len(found) == 1 else {"anyOf": found}


def read_sections(data: Mapping[str, object]) -> tuple[Sections, list[Problem]]:
    """The valid sections of a sweep file, and all faults."""
    reader = Reader(most_agents=0)
    problems = reader.problems
    found: dict[str, object] = {}
    for name in data:
        if name not in SECTIONS:
            problems.append(Problem(place_of((name,)), "is not known here", "", nearest(name, SECTIONS)))
    problems += [Problem(name, "must be given") for name in REQUIRED if name not in data]
    for name, choices in _alternatives().items():
        if name in data:
            _read(choices, data[name], (name,), found, name, reader)
    grid = data.get("grid", {})
    if not isinstance(grid, dict):
        problems.append(Problem("grid", "must be a table", shown(grid)))
    elif len(grid) > MOST_NAMES:
        problems.append(Problem("grid", f"must have at most {MOST_NAMES} parameters", str(len(grid))))
    else:
        axes: dict[str, object] = {}
        for name, entries in grid.items():
            _read(_AXIS, entries, ("grid", name), axes, name, reader)
        found["grid"] = axes
    # Every section has been checked for its type.
    return cast(Sections, found), problems


def _read(
    choices: Mapping[type, Value | Description],
    value: object,
    place: tuple[str, ...],
    found: dict[str, object],
    key: str,
    reader: Reader,
) -> None:
    expected = choices.get(type(value))
    if expected is None:
        words = " or ".join(_WORDS[kind] for kind in choices)
        reader.problems.append(Problem(place_of(place), f"must be {words}", shown(value)))
        return
    if isinstance(expected, Value):
        part = reader.value(expected, value, place)
    elif isinstance(value, dict):
        ranges = _read_ranges(value.get("ranges"), place, reader) if expected is SAMPLING else None
        part = reader.table(expected, None, value, place)
        if isinstance(part, Sampling):
            part = None if ranges is None else Sampling(part.method, part.count, ranges, part.seed)
    if part is not None and not isinstance(part, Faulty):
        found[key] = part


def _read_ranges(tables: object, place: tuple[str, ...], reader: Reader) -> dict[str, Drawn] | None:
    """The ranges of a sample; None where one has faults."""
    read = {
        name: reader.table(DRAWN, None, table, (*place, "ranges", name))
        if isinstance(table, dict)
        else reader.value(Value(_table, {}), table, (*place, "ranges", name))
        for name, table in (tables.items() if isinstance(tables, dict) else ())
    }
    ranges = {name: part for name, part in read.items() if isinstance(part, Drawn)}
    return ranges if len(ranges) == len(read) else None
