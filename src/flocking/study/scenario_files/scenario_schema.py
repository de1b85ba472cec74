"""The scenario file as a strict pydantic schema: every fault of a file is found at once, with its place."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, Literal, NotRequired

from pydantic import (
    AfterValidator,
    ConfigDict,
    Discriminator,
    PlainValidator,
    Tag,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
)
from pydantic_core import PydanticCustomError
from typing_extensions import TypedDict

from flocking.engine.interruption import interrupted
from flocking.errors import InvalidInput
from flocking.study.scenario_files.scenario_kinds import Context, Field, Group, Kind, Nested, Short
from flocking.study.scenario_files.scenario_parts import GROUPS, SCENARIO, SECTIONS
from flocking.study.scenario_files.scenario_values import RefusedError, Value, nearest

if TYPE_CHECKING:
    pass

MOST_TERMS = 100
_NAME = "<name>"
_SHORT = "<short>"


@dataclass(frozen=True)
class Problem:
    """One fault of a scenario file.

    Parameters
    ----------
    place
        Path in the file, such as ``terms[1].gain``.
    rule
        What must hold.
    given
        What was given, as text; empty where nothing was.
    fix
        The usual way out.
    """

    place: str
    rule: str
    given: str = ""
    fix: str = ""

    def __str__(self) -> str:
        got = f"; got {self.given}" if self.given else ""
        return f"{self.place}: {self.rule}{got}" + (f". {self.fix}" if self.fix else "")


def place_of(path: Iterable[str | int]) -> str:
    """A path as text, such as ``terms[1].gain``."""
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else step
    return text or "file"


def shown(value: object) -> str:
    """A value as text of at most 60 characters."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list) and len(value) > 8:
        return f"a list of {len(value)} entries"
    try:
        text = repr(value)
    except ValueError:
        return "a number with thousands of digits"
    return text if len(text) <= 60 else text[:57] + "..."


def _refusal(refused: RefusedError, value: object) -> PydanticCustomError:
    for step in refused.at:
        value = _inside(value, step)
    facts = {"rule": refused.rule, "fix": refused.fix, "at": refused.at, "value": value}
    return PydanticCustomError("refused", "{rule}", facts)


def _inside(value: object, step: str | int) -> object:
    if isinstance(value, dict):
        return value.get(step)
    return value[step] if isinstance(value, list) and isinstance(step, int) and step < len(value) else None


def _value_type(value: Value) -> object:
    def check(given: object) -> object:
        try:
            return value.check(given)
        except RefusedError as refused:
            raise _refusal(refused, given) from None

    return Annotated[Any, PlainValidator(check), WithJsonSchema(dict(value.schema))]


def _kind_type(kind: Kind, group: Group) -> object:
    fields: dict[str, object] = {name: _field_type(f) for name, f in kind.fields.items()}
    if group.key is not None:
        literal: object = Literal[kind.word]
        fields[group.key] = (
            Annotated[literal, "kind"] if kind.word != group.default else _optional(Annotated[literal, "kind"])
        )
    table = TypedDict(kind.word, fields)  # type: ignore[misc]
    table.__pydantic_config__ = ConfigDict(extra="forbid")  # type: ignore[attr-defined]

    def build(given: dict[str, object], info: ValidationInfo) -> object:
        fields_only = {name: value for name, value in given.items() if name in kind.fields}
        context = info.context if isinstance(info.context, Context) else Context(most_agents=0)
        try:
            return kind.make(dict(fields_only), context)
        except RefusedError as refused:
            raise _refusal(refused, given) from None
        except InvalidInput as error:
            at = (error.parameter,) if error.parameter in kind.fields else ()
            facts = {"rule": error.rule, "fix": error.fix, "at": at, "value": error.value}
            if not at:
                facts["rule"] = f"{error.parameter} {error.rule}"
            raise PydanticCustomError("refused", "{rule}", facts) from None
        except Exception as error:
            if interrupted(error):
                raise KeyboardInterrupt from None
            # A file is never trusted: whatever a part makes of odd values is told in one line.
            facts = {"rule": f"cannot be used ({type(error).__name__}: {error})", "fix": "", "at": (), "value": None}
            raise PydanticCustomError("refused", "{rule}", facts) from None

    return Annotated[table, AfterValidator(build)]


def _optional(inner: object) -> object:
    return NotRequired[inner]


def _field_type(field: Field) -> object:
    if isinstance(field.holds, Value):
        inner = _value_type(field.holds)
    else:
        inner = list[group_type(field.holds.group)] if field.holds.many else group_type(field.holds.group)  # type: ignore[misc]
    return inner if field.required else _optional(inner)


@cache
def group_type(name: str) -> object:
    """The pydantic type of a part of a group: a table, a name where parts may have names, a list where allowed."""
    group = GROUPS[name]
    if group.key is None:
        return _kind_type(group.kinds[0], group)
    choices = [Annotated[_kind_type(kind, group), Tag(kind.word)] for kind in group.kinds]
    if group.names is not None:
        choices.append(
            Annotated[Any, PlainValidator(_named(group.names)), WithJsonSchema({"type": "string"}), Tag(_NAME)]
        )
    if group.short is not None:
        choices.append(Annotated[_short_type(group.short), Tag(_SHORT)])
    union: object = choices[0]
    for choice in choices[1:]:
        union = union | choice
    if len(choices) == 1:
        return choices[0]
    return Annotated[union, Discriminator(lambda value: tag_of(name, value))]


def _short_type(short: Short) -> object:
    def check(given: object) -> object:
        try:
            return short.make(short.value.check(given))
        except RefusedError as refused:
            raise _refusal(refused, given) from None
        except InvalidInput as error:
            facts = {"rule": error.rule, "fix": error.fix, "at": (), "value": error.value}
            raise PydanticCustomError("refused", "{rule}", facts) from None

    return Annotated[Any, PlainValidator(check), WithJsonSchema(dict(short.value.schema))]


def _named(group: str) -> Callable[[str, ValidationInfo], object]:
    def find(name: str, info: ValidationInfo) -> object:
        known = info.context.named[group] if isinstance(info.context, Context) else {}
        if name not in known:
            fix = nearest(name, known) if known else f"There is no section [{group}s.{name}]."
            facts = {"rule": f"must be the name of a section of [{group}s]", "fix": fix, "at": (), "value": name}
            raise PydanticCustomError("refused", "{rule}", facts)
        if known[name] is None:
            raise PydanticCustomError("known elsewhere", "is wrong in its own section")
        return known[name]

    return find


def tag_of(name: str, value: object) -> str | None:
    """Which choice of a group's union a value belongs to."""
    group = GROUPS[name]
    if isinstance(value, dict):
        word = value.get(group.key, group.default)
        return word if isinstance(word, str) else None
    if isinstance(value, str) and group.names is not None:
        return _NAME
    return _SHORT if group.short is not None else None


def faults(error: ValidationError, data: object, prefix: tuple[str | int, ...], group: str | None) -> list[Problem]:
    """The faults pydantic found in ``data``, below ``prefix`` and in a ``group``, in plain words with their places."""
    found = []
    for entry in error.errors(include_url=False):
        if entry["type"] == "known elsewhere":
            continue
        path, owner = _path(entry["loc"], data, group)
        found.append(_problem(dict(entry), prefix + path, owner))
    return found


def _path(steps: tuple[str | int, ...], data: object, group: str | None) -> tuple[tuple[str | int, ...], Kind | None]:
    """A pydantic location without the tags of unions, and the kind of table it ends in."""
    path: list[str | int] = []
    kind: Kind | None = None
    waiting = group
    many: str | None = None
    for step in steps:
        if waiting is not None:
            chosen = GROUPS[waiting]
            tag = tag_of(waiting, data) if chosen.key is not None else chosen.kinds[0].word
            kind = next((k for k in chosen.kinds if k.word == tag), None)
            single = chosen.key is None or (len(chosen.kinds) == 1 and not (chosen.names or chosen.short))
            waiting = None
            if not single:
                continue
        path.append(step)
        data = _inside(data, step)
        if many is not None and isinstance(step, int):
            waiting, many = many, None
            continue
        field = kind.fields.get(str(step)) if kind is not None else None
        if field is not None and isinstance(field.holds, Nested):
            waiting, many = (None, field.holds.group) if field.holds.many else (field.holds.group, None)
    return tuple(path), kind


def _problem(entry: Mapping[str, Any], path: tuple[str | int, ...], kind: Kind | None) -> Problem:
    context = entry.get("ctx", {})
    match entry["type"]:
        case "refused":
            at, value = context["at"], context["value"]
            if not at and value is None:
                value = entry["input"]
            given = shown(value) if value is not None and not isinstance(value, dict) else ""
            return Problem(place_of(path + at), context["rule"], given, context["fix"])
        case "missing":
            return Problem(place_of(path), "must be given")
        case "extra_forbidden":
            known = kind.fields if kind is not None else {}
            return Problem(place_of(path), "is not known here", "", nearest(str(path[-1]), known) if known else "")
        case "union_tag_invalid":
            words = [word.strip(" '") for word in context["expected_tags"].split(",")]
            words = [word for word in words if not word.startswith("<")]
            key = "draw" if "hexagonal" in words else "kind"
            fix = nearest(context["tag"], words)
            return Problem(place_of((*path, key)), "is not known", repr(context["tag"]), fix)
        case "union_tag_not_found":
            value = entry["input"]
            if isinstance(value, dict):
                key = "draw" if "draw" in value else "kind"
                rule = "must be text in quotes" if key in value else "must be given"
                return Problem(place_of((*path, key)), rule, shown(value[key]) if key in value else "")
            return Problem(place_of(path), "must be a table", shown(value))
        case "dict_type":
            return Problem(place_of(path), "must be a table", shown(entry["input"]))
        case "list_type":
            return Problem(place_of(path), "must be a list of tables", shown(entry["input"]))
        case _:
            return Problem(place_of(path), str(entry["msg"]).lower(), shown(entry["input"]))


def read_tables(data: Mapping[str, object], context: Context) -> tuple[dict[str, Any], list[Problem]]:
    """Parts of a scenario file, those without fault, and all faults."""
    problems: list[Problem] = []
    parts: dict[str, Any] = {}
    for section, group in SECTIONS.items():
        tables = data.get(section, {})
        if not isinstance(tables, dict):
            problems.append(Problem(section, "must be a table of parts with names", shown(tables)))
            continue
        for name, table in tables.items():
            context.named[group][name] = _read(_part_reader(group), table, (section, name), group, context, problems)
    for name in data:
        if name not in SCENARIO and name not in SECTIONS:
            problems.append(Problem(name, "is not known here", "", nearest(name, [*SCENARIO, *SECTIONS])))
    for name, field in SCENARIO.items():
        if name not in data:
            if field.required:
                problems.append(Problem(name, "must be given"))
            continue
        value, holds = data[name], field.holds
        if isinstance(holds, Value):
            parts[name] = _read(_value_reader(name), value, (name,), None, context, problems)
        elif holds.many:
            parts[name] = _read_list(value, name, holds.group, context, problems)
        else:
            parts[name] = _read(_part_reader(holds.group), value, (name,), holds.group, context, problems)
        if name == "graph":
            context.law_graph = parts[name]
    return parts, problems


def _read_list(value: object, name: str, group: str, context: Context, problems: list[Problem]) -> list[object] | None:
    if not isinstance(value, list) or not 1 <= len(value) <= MOST_TERMS:
        problems.append(Problem(name, f"must be a list of 1 to {MOST_TERMS} tables", shown(value)))
        return None
    return [_read(_part_reader(group), x, (name, k), group, context, problems) for k, x in enumerate(value)]


def _reader(expected: Any) -> TypeAdapter[object]:
    return TypeAdapter(expected)


@cache
def _part_reader(group: str) -> TypeAdapter[object]:
    return _reader(group_type(group))


@cache
def _value_reader(name: str) -> TypeAdapter[object]:
    holds = SCENARIO[name].holds
    assert isinstance(holds, Value)
    return _reader(_value_type(holds))


def _read(
    expected: TypeAdapter[object],
    data: object,
    prefix: tuple[str | int, ...],
    group: str | None,
    context: Context,
    problems: list[Problem],
) -> object:
    try:
        return expected.validate_python(data, context=context)
    except ValidationError as error:
        problems += faults(error, data, prefix, group)
        return None


def json_schema() -> dict[str, object]:
    """JSON schema of scenario files, for editors."""
    fields: dict[str, object] = {name: _field_type(field) for name, field in SCENARIO.items()}
    for section, group in SECTIONS.items():
        fields[section] = _optional(dict[str, group_type(group)])  # type: ignore[misc]
    table = TypedDict("Scenario", fields)  # type: ignore[misc]
    table.__pydantic_config__ = ConfigDict(extra="forbid")  # type: ignore[attr-defined]
    schema = TypeAdapter(table).json_schema()
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return {**head, **schema, "title": "flocking scenario"}
