"""JSON schema of sweep files, for editors: sections, families with their options, measures and scenarios in place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NotRequired, Required

from flocking.study.sweeps.scenario_families import Family


def sweep_schema(families: Mapping[str, Family]) -> dict[str, object]:
    """JSON schema of sweep files, for editors that complete and check TOML.

    What it takes, `flocking.study.sweeps.sweep_file.parse_sweep` takes but for what sections ask of each other
    beyond the options of a family: how many runs there are, and which paths a scenario in the file has.

    Parameters
    ----------
    families
        Families of scenarios that a file may name.
    """
    from pydantic import ConfigDict, TypeAdapter
    from typing_extensions import TypedDict

    from flocking.study.scenario_files.scenario_file import scenario_schema
    from flocking.study.sweeps.measures import MEASURES
    from flocking.study.sweeps.sweep_schema import REQUIRED, SECTIONS, section_types

    fields: dict[str, object] = {
        name: Required[kind] if name in REQUIRED else NotRequired[kind] for name, kind in section_types().items()
    }
    table = TypedDict("Sweep", fields)  # type: ignore[misc]
    table.__pydantic_config__ = ConfigDict(extra="forbid")  # type: ignore[attr-defined]
    schema = TypeAdapter(table).json_schema()
    scenario = scenario_schema()
    parts = schema["properties"]
    # The parts of scenarios keep their names: both schemas share one list of definitions.
    schema["$defs"] = {**scenario.pop("$defs"), **schema["$defs"]}
    head = {"$schema": scenario.pop("$schema"), "title": "flocking sweep"}
    parts["scenario"] = {"anyOf": [{"type": "string", "enum": sorted(families)}, scenario]}
    own = {name: measure[0] for family in families.values() for name, measure in family.measures.items()}
    described = {name: text for name, (text, _) in MEASURES.items()} | own
    parts["measures"]["items"] = {"oneOf": [{"const": name, "title": text} for name, text in described.items()]}
    schema["properties"] = {name: parts[name] for name in SECTIONS}
    schema["allOf"] = [_options_of(name, family) for name, family in families.items()]
    return {**schema, **head}


def _options_of(name: str, family: Family) -> dict[str, object]:
    """What a file that names a family may fix, vary and draw."""
    options = {option: dict(value.schema) for option, value in family.options.items()}
    spaced = {"$ref": "#/$defs/Spaced"}
    axes = {
        option: {"anyOf": [{"type": "array", "items": value}, *([spaced] if value.get("type") == "number" else [])]}
        for option, value in options.items()
    }
    numbers = [option for option, value in options.items() if value.get("type") in ("number", "integer")]
    drawn = {option: {"$ref": "#/$defs/Drawn"} for option in numbers}
    only = {"additionalProperties": False}
    return {
        "if": {"properties": {"scenario": {"const": name}}},
        "then": {
            "properties": {
                "options": {"properties": options, **only},
                "grid": {"properties": axes, **only},
                "sample": {"properties": {"ranges": {"properties": drawn, **only}}},
            }
        },
    }
