"""JSON schema of scenario files, for editors: derived from the descriptions of the parts."""

from __future__ import annotations

from collections.abc import Mapping

import flocking.model.library  # noqa: F401  registers the parts of the library
from flocking.model.parts.description import GROUPS, Description, Field, Group, Nested
from flocking.study.scenario_files.scenario_reader import flat_fields, scenario_fields, sections

Schema = dict[str, object]


def json_schema() -> Schema:
    """JSON schema of scenario files, for editors."""
    definitions: Schema = {}
    properties = {name: _field(field, definitions) for name, field in scenario_fields().items()}
    for section, group in sections().items():
        properties[section] = {"type": "object", "additionalProperties": _group(group, definitions)}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$defs": definitions, "type": "object", "additionalProperties": False,
        "required": [name for name, field in scenario_fields().items() if field.required],
        "properties": properties, "title": "flocking scenario",
    }  # fmt: skip


def table_schema(title: str, fields: Mapping[str, Field], definitions: Schema, named: Schema | None = None) -> Schema:
    """Schema of a table with the given fields.

    Parameters
    ----------
    title
        Its title in editors.
    fields
        Its fields by name.
    definitions
        The schemas of the parts that they hold are added to it.
    named
        Properties besides these.
    """
    return {
        "type": "object", "title": title, "additionalProperties": False,
        "required": [name for name, field in fields.items() if field.required],
        "properties": {**(named or {}), **{name: _field(field, definitions) for name, field in fields.items()}},
    }  # fmt: skip


def _field(field: Field, definitions: Schema) -> Schema:
    holds = field.holds
    if not isinstance(holds, Nested):
        return dict(holds.schema)
    inner = _group(GROUPS[holds.group], definitions)
    if not holds.many:
        return inner
    limits: Schema = {} if holds.most is None else {"minItems": 1, "maxItems": holds.most}
    return {"type": "array", "items": inner, **limits}


def _group(group: Group, definitions: Schema) -> Schema:
    """What is allowed in place of a part of the group."""
    choices: list[Schema] = [_kind(group, kind, definitions) for kind in group.kinds]
    if group.names is not None:
        choices.append({"type": "string", "title": f"name of a section of [{group.names}s]"})
    if group.short is not None:
        choices.append(dict(group.short.value.schema))
    return choices[0] if len(choices) == 1 else {"anyOf": choices}


def _kind(group: Group, kind: Description, definitions: Schema) -> Schema:
    # Groups of one base class share their definitions.
    owner = next(g for g in GROUPS.values() if g.base is group.base)
    name = f"{owner.name}_{kind.word}" if owner.name != kind.word else owner.name
    if name not in definitions:
        definitions[name] = {}  # a part may hold others of its own group
        key: Schema = {} if group.key is None else {group.key: {"const": kind.word}}
        table = table_schema(str(kind.word), flat_fields(kind), definitions, key)
        if group.key is not None and kind.word != group.default:
            table["required"] = [group.key, *(n for n, f in flat_fields(kind).items() if f.required)]
        definitions[name] = table
    return {"$ref": f"#/$defs/{name}"}
