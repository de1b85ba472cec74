"""JSON schema of sweep files, for editors: sections, options of scenarios, measures."""

from __future__ import annotations

from collections.abc import Mapping

from flocking.study.sweeps.parametrised_scenarios import ParametrisedScenario


def sweep_schema(scenarios: Mapping[str, ParametrisedScenario]) -> dict[str, object]:
    """JSON schema of sweep files, for editors that complete and check TOML.

    A file that it accepts is accepted by `flocking.study.sweeps.sweep_file.parse_sweep` unless it requests too many
    runs, or names a path that the scenario in the file does not have.

    Parameters
    ----------
    scenarios
        Families of scenarios that a file may name.
    """
    from flocking.study.scenario_files.scenario_schema import json_schema
    from flocking.study.sweeps.measures import MEASURES
    from flocking.study.sweeps.sweep_schema import REQUIRED, SECTIONS, section_schemas

    scenario = json_schema()
    parts, own_definitions = section_schemas()
    # The parts of scenarios keep their names: both schemas share one list of definitions.
    shared = scenario.pop("$defs")
    assert isinstance(shared, dict)
    definitions = {**shared, **own_definitions}
    head = {"$schema": scenario.pop("$schema"), "title": "flocking sweep"}
    parts["scenario"] = {"anyOf": [{"type": "string", "enum": sorted(scenarios)}, scenario]}
    own = {name: measure[0] for parametrised in scenarios.values() for name, measure in parametrised.measures.items()}
    described = {name: text for name, (text, _) in MEASURES.items()} | own
    measures = parts["measures"]
    assert isinstance(measures, dict)
    measures["items"] = {"oneOf": [{"const": name, "title": text} for name, text in described.items()]}
    return {
        "$defs": definitions, "type": "object", "additionalProperties": False, "required": list(REQUIRED),
        "properties": {name: parts[name] for name in SECTIONS},
        "allOf": [_options_of(name, parametrised) for name, parametrised in scenarios.items()], **head,
    }  # fmt: skip


def _options_of(name: str, parametrised: ParametrisedScenario) -> dict[str, object]:
    """What a file that names a family may fix, vary and draw at random."""
    options = {option: dict(value.schema) for option, value in parametrised.options.items()}
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
