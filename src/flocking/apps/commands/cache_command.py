"""The command that shows and clears the folder of generated code."""

from __future__ import annotations

import json
from typing import Annotated

from cyclopts import Parameter

from flocking.apps.standard_streams import printable

MEGABYTE = 1e6
"""Bytes in a megabyte, as storage is sold and `ls --si` counts."""


def cache(*, clear: bool = False, as_json: Annotated[bool, Parameter(name="--json")] = False) -> int:
    """Show the folder of compiled formulas and its size, or clear it.

    Parameters
    ----------
    clear
        Remove all files; they are made again when needed.
    as_json
        Print JSON.
    """
    from flocking.formula import cache as code_cache

    found = code_cache.clear() if clear else code_cache.contents()
    if as_json:
        facts = {"folder": str(found.folder), "files": found.files, "bytes": found.size, "modules": found.formulas,
                 "limit": code_cache.MOST_BYTES, "cleared": clear}  # fmt: skip
        print(json.dumps(facts, indent=2))
        return 0
    print(printable(f"folder    {found.folder}"))
    what = f"{found.files} files, {found.size / MEGABYTE:.3g} MB, of {found.formulas} laws and formulas"
    print(f"{'cleared' if clear else 'holds':9} {what}")
    print(f"limit     {code_cache.MOST_BYTES / MEGABYTE:.3g} MB; the least recently used is removed first")
    return 0
