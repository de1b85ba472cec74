"""Scenarios as TOML files: schema, parts, values, reading and writing."""
