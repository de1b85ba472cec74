"""Every module and object that the glossary names is there, and every table has rows for the three columns."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "glossary.md").read_text(encoding="utf-8")
NAMED = sorted(set(re.findall(r"`((?:model|engine|study)\.[A-Za-z_.]+)`", PAGE)))


@pytest.mark.parametrize("name", NAMED)
def test_what_the_glossary_names_is_there(name):
    parts = f"flocking.{name}".split(".")
    module = ".".join(p for p in parts if not p[0].isupper())
    try:
        found = importlib.import_module(module)
    except ModuleNotFoundError:
        module, _, function = module.rpartition(".")
        found = getattr(importlib.import_module(module), function)
    for part in parts[len(module.split(".")) :]:
        found = getattr(found, part) if part[0].isupper() else found


def test_rows_have_a_symbol_a_name_and_the_literature():
    rows = [line for line in PAGE.splitlines() if line.startswith("| ") and "---" not in line]
    assert len(rows) > 40
    for row in rows:
        _, _, name, literature, _ = (x.strip() for x in re.split(r"(?<!\\)\|", row))
        assert name
        assert literature
