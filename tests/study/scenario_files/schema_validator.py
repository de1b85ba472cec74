"""Just enough of JSON schema to hold tables against the schemas that this library prints."""

import math
import re

KINDS = {
    "object": dict, "array": list, "string": str, "boolean": bool, "integer": int, "number": (int, float),
}  # fmt: skip
UNDERSTOOD = {
    "$ref", "type", "enum", "const", "anyOf", "oneOf", "allOf", "if", "then", "properties", "required", "items",
    "additionalProperties", "minItems", "maxItems", "minLength", "maxLength", "minProperties", "maxProperties",
    "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "pattern",
    "title", "description", "default", "$schema", "$defs", "discriminator",
}  # fmt: skip


def fits(value, schema, root=None):
    """Whether a value is as a schema asks."""
    root = schema if root is None else root
    if schema is True or schema is False:
        return schema
    assert set(schema) <= UNDERSTOOD, set(schema) - UNDERSTOOD
    if "$ref" in schema:
        name = schema["$ref"].removeprefix("#/$defs/")
        return fits(value, root["$defs"][name], root)
    kind = schema.get("type")
    if kind is not None:
        whole = kind == "integer" and isinstance(value, float) and value.is_integer()
        if not whole and (not isinstance(value, KINDS[kind]) or (isinstance(value, bool) and kind != "boolean")):
            return False
    if "enum" in schema and value not in schema["enum"]:
        return False
    if "const" in schema and (value != schema["const"] or isinstance(value, bool) != isinstance(schema["const"], bool)):
        return False
    choices = [fits(value, choice, root) for choice in schema.get("oneOf", ())]
    if choices and sum(choices) != 1:
        return False
    if "anyOf" in schema and not any(fits(value, choice, root) for choice in schema["anyOf"]):
        return False
    if not all(fits(value, part, root) for part in schema.get("allOf", ())):
        return False
    if "if" in schema and fits(value, schema["if"], root) and not fits(value, schema.get("then", True), root):
        return False
    if isinstance(value, dict):
        return _table_fits(value, schema, root)
    if isinstance(value, list):
        most = schema.get("maxItems", math.inf)
        return schema.get("minItems", 0) <= len(value) <= most and all(
            fits(entry, schema.get("items", True), root) for entry in value
        )
    if isinstance(value, str):
        longest = schema.get("maxLength", math.inf)
        return schema.get("minLength", 0) <= len(value) <= longest and bool(re.search(schema.get("pattern", ""), value))
    if isinstance(value, int | float) and not isinstance(value, bool):
        return (
            schema.get("minimum", -math.inf) <= value <= schema.get("maximum", math.inf)
            and value > schema.get("exclusiveMinimum", -math.inf) - ("exclusiveMinimum" not in schema)
            and ("exclusiveMaximum" not in schema or value < schema["exclusiveMaximum"])
        )
    return True


def _table_fits(value, schema, root):
    known = schema.get("properties", {})
    rest = schema.get("additionalProperties", True)
    return (
        set(schema.get("required", ())) <= set(value)
        and schema.get("minProperties", 0) <= len(value) <= schema.get("maxProperties", math.inf)
        and all(fits(entry, known.get(name, rest), root) for name, entry in value.items())
    )
