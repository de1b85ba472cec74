"""The sweep file as a strict pydantic schema: its sections, and every fault of them at once with its place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from flocking.study.scenario_files.scenario_schema import Problem, place_of, shown
from flocking.study.scenario_files.scenario_values import LARGEST_SEED, nearest

if TYPE_CHECKING:
    pass

MOST_VALUES = 10_000
MOST_NAMES = 50

_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Seed = Annotated[int, Field(ge=0, le=LARGEST_SEED, strict=True)]
_Strict = ConfigDict(extra="forbid", strict=True)


class Spaced(BaseModel):
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

    model_config = _Strict
    low: _Finite
    high: _Finite
    count: Annotated[int, Field(ge=2, le=MOST_VALUES)]
    log: bool = False


class Drawn(BaseModel):
    """A range that values are drawn from.

    Parameters
    ----------
    low, high
        Its ends; two whole numbers give whole numbers.
    log
        Whether the logarithm is drawn evenly.
    """

    model_config = _Strict
    low: int | _Finite
    high: int | _Finite
    log: bool = False


class Sampling(BaseModel):
    """Points drawn from ranges.

    Parameters
    ----------
    method
        How.
    count
        How many.
    seed
        Seed of the draw.
    ranges
        Ranges by the name of the parameter.
    """

    model_config = _Strict
    method: Literal["random", "latin", "sobol"]
    count: Annotated[int, Field(ge=1)]
    seed: _Seed = 0
    ranges: Annotated[dict[str, Drawn], Field(min_length=1, max_length=MOST_NAMES)]


_ALTERNATIVES: dict[str, dict[type, object]] = {
    "format": {int: Literal[1]},
    "name": {str: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,79}$")]},
    "scenario": {str: str, dict: dict[str, Any]},
    "options": {dict: Annotated[dict[str, Any], Field(max_length=MOST_NAMES)]},
    "sample": {dict: Sampling},
    "seeds": {
        int: Annotated[int, Field(ge=1, strict=True)],
        list: Annotated[list[_Seed], Field(min_length=1)],
    },
    "seed": {int: _Seed},
    "measures": {list: Annotated[list[Annotated[str, Field(strict=True)]], Field(min_length=1, max_length=MOST_NAMES)]},
    "audit": {bool: Annotated[bool, Field(strict=True)]},
    "engine": {str: Literal["auto", "exact", "tiles"]},
}
"""What each section may be, by the type TOML gives it."""

_AXIS: dict[type, object] = {list: Annotated[list[Any], Field(min_length=1, max_length=MOST_VALUES)], dict: Spaced}
SECTIONS = ("format", "name", "scenario", "options", "grid", "sample", "seeds", "seed", "measures", "audit", "engine")
REQUIRED = ("scenario",)

_WORDS: dict[type, str] = {
    int: "a whole number", str: "text in quotes", dict: "a table", list: "a list", bool: "true or false",
}  # fmt: skip


def section_types() -> dict[str, object]:
    """Every section with the type of what it may be, whatever TOML calls it."""
    from functools import reduce
    from operator import or_

    found = {name: reduce(or_, choices.values()) for name, choices in _ALTERNATIVES.items()}
    axes: object = dict[str, reduce(or_, _AXIS.values())]  # type: ignore[misc]
    return {**found, "grid": Annotated[axes, Field(max_length=MOST_NAMES)]}


def read_sections(data: Mapping[str, object]) -> tuple[dict[str, Any], list[Problem]]:
    """Sections of a sweep file, those without fault, and all faults."""
    problems: list[Problem] = []
    found: dict[str, object] = {}
    for name in data:
        if name not in SECTIONS:
            problems.append(Problem(place_of((name,)), "is not known here", "", nearest(name, SECTIONS)))
    problems += [Problem(name, "must be given") for name in REQUIRED if name not in data]
    for name, choices in _ALTERNATIVES.items():
        if name in data:
            _read(choices, data[name], (name,), found, name, problems)
    grid = data.get("grid", {})
    if not isinstance(grid, dict):
        problems.append(Problem("grid", "must be a table", shown(grid)))
    elif len(grid) > MOST_NAMES:
        problems.append(Problem("grid", f"must have at most {MOST_NAMES} parameters", str(len(grid))))
    else:
        axes: dict[str, object] = {}
        for name, values in grid.items():
            _read(_AXIS, values, ("grid", name), axes, name, problems)
        found["grid"] = axes
    return found, problems


def _read(
    choices: Mapping[type, Any],
    value: object,
    place: tuple[str, ...],
    found: dict[str, object],
    key: str,
    problems: list[Problem],
) -> None:
    expected = choices.get(type(value))
    if expected is None:
        words = " or ".join(_WORDS[kind] for kind in choices)
        problems.append(Problem(place_of(place), f"must be {words}", shown(value)))
        return
    try:
        found[key] = TypeAdapter(expected).validate_python(value)
    except ValidationError as error:
        problems += [_problem(dict(entry), place) for entry in error.errors(include_url=False)]


_FIELDS = {name for model in (Spaced, Drawn, Sampling) for name in model.model_fields}


def _problem(entry: Mapping[str, Any], place: tuple[str, ...]) -> Problem:
    # Pydantic names the branch of "int | float" that failed; the file has no such place.
    steps = tuple(step for step in entry["loc"] if step not in ("int", "constrained-float", "float"))
    where = place_of((*place, *steps))
    match entry["type"]:
        case "missing":
            return Problem(where, "must be given")
        case "extra_forbidden":
            return Problem(where, "is not known here", "", nearest(str(steps[-1]), _FIELDS))
        case "literal_error":
            return Problem(where, f"must be {entry['ctx']['expected']}", shown(entry["input"]))
        case "string_pattern_mismatch":
            return Problem(where, "must be letters, digits, - and _, at most 80 of them", shown(entry["input"]))
        case _:
            text = str(entry["msg"]).lower().removeprefix("input should ").replace("dictionary", "table")
            return Problem(where, f"must {text}" if text.startswith("be ") else text, shown(entry["input"]))
