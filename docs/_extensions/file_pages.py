"""The pages of scenario files and sweep files: every section and key, with its kind and its meaning."""

from __future__ import annotations

import inspect
import json
from collections.abc import Mapping
from typing import Any

from text_tables import code, plain, table

from flocking.model.parts.description import GROUPS, Description
from flocking.model.typesetting.documentation import meanings_of, summary_of

WORDS = {"number": "number", "integer": "integer", "boolean": "true or false", "string": "text", "object": "table"}


def kind_of(schema: Mapping[str, Any], definitions: Mapping[str, Any]) -> str:
    """What a schema accepts, in words."""
    if "$ref" in schema:
        name = schema["$ref"].rsplit("/", 1)[1]
        return f"a {code(str(definitions[name].get('title', name)))} table"
    if "const" in schema:
        return code(json.dumps(schema["const"]))
    if "enum" in schema:
        return ", ".join(code(json.dumps(word)) for word in schema["enum"])
    if "anyOf" in schema:
        tables = [one["$ref"].rsplit("/", 1)[1] for one in schema["anyOf"] if "$ref" in one]
        group = tables[0].split("_")[0] if tables else ""
        if len(tables) > 1 and group in GROUPS:
            others = [kind_of(one, definitions) for one in schema["anyOf"] if "$ref" not in one]
            return " or ".join([f"a table, see [{group.capitalize()}](#{group})", *others])
        return " or ".join(dict.fromkeys(kind_of(one, definitions) for one in schema["anyOf"]))
    if schema.get("type") == "array":
        return f"list of: {kind_of(schema.get('items', {}), definitions)}"
    if "title" in schema and schema.get("type") == "string":
        return str(schema["title"])
    found = WORDS.get(str(schema.get("type")), "any value")
    bounds = [
        f"{word} {schema[key]}" for key, word in (("minimum", "at least"), ("maximum", "at most")) if key in schema
    ]
    return f"{found}, {' and '.join(bounds)}" if bounds else found


def default_of(kind: Description, attribute: str) -> str:
    """The default of a field, empty where there is none to show."""
    parameter = inspect.signature(kind.call).parameters.get(attribute)
    if parameter is None or parameter.default in (inspect.Parameter.empty, None):
        return ""
    text = repr(parameter.default)
    return code(text) if len(text) < 30 else ""


def part_section(key: str | None, kind: Description, schema: Mapping[str, Any], definitions: Mapping[str, Any]) -> str:
    """One kind of part: what it is, and a table of its keys."""
    meanings = meanings_of(kind.call)
    head = f"{code(key)} = {code(json.dumps(kind.word))}" if key and kind.word else code(kind.name)
    rows = []
    required = set(schema.get("required", ()))
    for name, value in schema.get("properties", {}).items():
        if name == key:
            continue
        field = kind.fields.get(name)
        attribute = name if field is None else field.attribute
        rows.append(
            (
                code(name),
                kind_of(value, definitions),
                "required" if name in required else default_of(kind, attribute),
                plain(meanings.get(attribute, "")),
            )
        )
    shown = table(("key", "value", "default", "meaning"), rows) if rows else "It has no other keys.\n"
    return f"### {head}\n\n{plain(summary_of(kind.call))}\n\n{shown}\n"


def scenario_files_page() -> str:
    """Every section and key of a scenario file."""
    from flocking.study.scenario_files.scenario_schema import json_schema

    schema = json_schema()
    definitions: Mapping[str, Any] = schema["$defs"]  # type: ignore[assignment]
    properties: Mapping[str, Any] = schema["properties"]  # type: ignore[assignment]
    required: Any = schema["required"]
    parts = [
        "# Scenario files\n\nA scenario is a TOML file. This page is made from the parts themselves when it is built: "
        "what it lists is what is read. `flocking run FILE` runs a file, `flocking schema` prints the schema for "
        "editors, `fk.write_scenario` writes a file; faults are listed all at once, each with its key.\n",
        "## At the top\n",
        table(
            ("key", "value", ""),
            [
                (code(name), top_kind(name, value, definitions), "required" if name in required else "")
                for name, value in properties.items()
            ],
        ),
        "Graphs and leaders that several terms share stand in sections of their own, `[graphs.NAME]` and "
        "`[leaders.NAME]`, and are named by `NAME` where they are used.\n",
    ]
    by_title = {(name.split("_")[0], str(d.get("title", ""))): d for name, d in definitions.items()}
    for name, group in GROUPS.items():
        known = [
            (kind, found)
            for kind in group.kinds
            if (found := by_title.get((name, str(kind.word))) or definitions.get(name)) is not None
        ]
        if known:
            parts.append(f"## {name.capitalize()}\n")
            parts += [part_section(group.key, kind, found, definitions) for kind, found in known]
    return "\n".join(parts)


def top_kind(name: str, schema: Mapping[str, Any], definitions: Mapping[str, Any]) -> str:
    """What stands under a key at the top: of parts their section below."""
    singular = name.removesuffix("s") if name.removesuffix("s") in GROUPS else name
    if singular in GROUPS:
        many = {"array": "one or more tables", "object": "tables by name"}.get(str(schema.get("type")), "a table")
        return f"{many}, see [{singular.capitalize()}](#{singular})"
    return kind_of(schema, definitions)


def sweep_files_page() -> str:
    """Every key of a sweep file."""
    from flocking.study.sweeps.measures import MEASURES
    from flocking.study.sweeps.sweep_schema import REQUIRED, section_schemas

    sections, definitions = section_schemas()
    rows = [
        (code(name), kind_of(value, definitions), "required" if name in REQUIRED else "")
        for name, value in sections.items()
    ]
    parts = [
        "# Sweep files\n\nA sweep is a TOML file that `flocking sweep FILE` runs. `scenario` is the name of a family "
        "of scenarios, or a whole scenario as in {doc}`scenario_files`; {doc}`../sweeps` has an example. This page is "
        "made from the reader of the files when it is built.\n",
        table(("key", "value", ""), rows),
    ]
    for name, found in definitions.items():
        needed = set(found.get("required", ()))
        rows = [
            (code(key), kind_of(value, definitions), "required" if key in needed else "")
            for key, value in found.get("properties", {}).items()
        ]
        parts += [f"## {name}\n", table(("key", "value", ""), rows)]
    measures = [(code(name), plain(meaning)) for name, (meaning, _) in MEASURES.items()]
    parts += ["## Measures\n", table(("name", "meaning"), measures)]
    return "\n".join(parts)
