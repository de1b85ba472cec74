"""Descriptions of parts by their fields, from which files, JSON, schemas, controls and messages are derived."""
