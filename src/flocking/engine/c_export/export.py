"""Texts of the files of an exported law."""

from __future__ import annotations

import re

from flocking.engine.c_export.exported_law import exported_law
from flocking.engine.c_export.header import header
from flocking.engine.c_export.law_source import c_source
from flocking.engine.c_export.project_files import cmake, example, readme
from flocking.errors import InvalidInput
from flocking.model.checks import truth
from flocking.model.law import Scenario

RESERVED = frozenset({"main", "readme", "cmake"})
"""Names that would hide another file of the folder, or the example's function."""


def c_files(
    scenario: Scenario, *, float32: bool = False, neighbours: int | None = None, limit: float | None = None,
    name: str = "law",
) -> dict[str, str]:  # fmt: skip
    """Texts of the exported files by name.

    Parameters
    ----------
    scenario, float32, neighbours, limit, name
        As for `flocking.export_c`.
    """
    if not isinstance(name, str) or not re.fullmatch("[a-z][a-z0-9_]{0,30}", name) or name in RESERVED:
        raise InvalidInput("export_c", "name", "must be of lower-case letters, digits and _, as 'law'", name)
    single = truth("export_c", "float32", float32)
    law = exported_law(scenario, neighbours=neighbours, limit=limit)
    source = c_source(law, name, single=single)
    sources = {f"{name}.h": header(law, name, single=single), f"{name}.c": source}
    used = {f for f in ("sqrt", "exp", "log", "sin", "cos", "pow") if f"{name}_{f}(" in source}
    return sources | {
        "main.c": example(law, name), "CMakeLists.txt": cmake(name),
        "README.md": readme(law, name, used, sources, single=single),
    }  # fmt: skip
