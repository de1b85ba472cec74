"""The pages of file formats list every key of the schemas, and nothing that a reader could not use."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from flocking.model.parts.description import GROUPS
from flocking.study.scenario_files.scenario_schema import json_schema
from flocking.study.sweeps.measures import MEASURES
from flocking.study.sweeps.sweep_schema import section_schemas

EXTENSIONS = Path(__file__).parents[2] / "docs" / "_extensions"


@pytest.fixture
def pages(monkeypatch):
    monkeypatch.syspath_prepend(str(EXTENSIONS))
    import file_pages

    yield file_pages
    sys.modules.pop("file_pages", None)


def keys_of(page):
    """Keys of the rows of all tables."""
    return {line.split("`")[1] for line in page.splitlines() if line.startswith("| `")}


def test_every_key_of_a_scenario_file_is_on_its_page(pages):
    page, schema = pages.scenario_files_page(), json_schema()
    keys = set(schema["properties"])
    for part in schema["$defs"].values():
        keys |= set(part.get("properties", {}))
    # The key that tells kinds apart stands in their headings.
    assert keys - keys_of(page) <= {group.key for group in GROUPS.values()}
    # Each kind of part has a heading of its own.
    assert page.count("\n### ") == len(schema["$defs"])
    for anchor in {line.split("](#")[1].split(")")[0] for line in page.split() if "](#" in line}:
        assert f"\n## {anchor.capitalize()}\n" in page
    assert "<function" not in page
    assert " at 0x" not in page


def test_every_key_of_a_sweep_file_is_on_its_page(pages):
    page = pages.sweep_files_page()
    sections, definitions = section_schemas()
    keys = {*sections, *MEASURES}
    for part in definitions.values():
        keys |= set(part.get("properties", {}))
    assert keys <= keys_of(page)
    assert "<function" not in page
