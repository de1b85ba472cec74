"""Generated source code, kept as real files in a cache folder and loaded as modules.

A module is named by a hash of the structure it was made from, so that a second process finds it
without SymPy, and Numba finds its machine code beside it.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType

from flocking.errors import CacheError

PRINTERS = ("codegen", "encounter_formulas", "expressions", "layout", "pieces")
"""Modules of the engine whose code decides what is printed."""


@cache
def _generation() -> str:
    """Digest of the library's own formulas and printers: edited ones never reuse old generated code."""
    package = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    printers = [package / "engine" / f"{name}.py" for name in PRINTERS]
    for path in [*sorted((package / "formula").glob("*.py")), *sorted((package / "model").glob("*.py")), *printers]:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def cache_folder() -> Path:
    """Folder of generated modules: ``$FLOCKING_CACHE``, or ``flocking`` in the user's cache folder.

    Raises
    ------
    CacheError
        When the folder cannot be created or written.
    """
    chosen = os.environ.get("FLOCKING_CACHE")
    if chosen:
        folder = Path(chosen)
    else:
        base = os.environ.get("XDG_CACHE_HOME")
        folder = (Path(base) if base else Path.home() / ".cache") / "flocking"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CacheError(
            f"The cache folder {folder} cannot be used ({error.strerror}). "
            "Set FLOCKING_CACHE to a folder you can write."
        ) from None
    return folder


def generated_module(structure: object, make_source: Callable[[], str]) -> ModuleType:
    """Module made by ``make_source``, reused when one of the same ``structure`` was made before.

    Parameters
    ----------
    structure
        Anything whose ``repr`` fixes the source completely.
    make_source
        Called only when no such module exists; returns Python source code.

    Raises
    ------
    CacheError
        When the cache folder cannot be used.
    """
    text = f"{_generation()} {structure!r}"
    key = hashlib.sha256(text.encode()).hexdigest()[:20]
    name = f"flocking_generated_{key}"
    if name in sys.modules:
        return sys.modules[name]
    path = cache_folder() / f"{name}.py"
    if not path.exists():
        _write(path, f"# {text}\n{make_source()}")
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise CacheError(f"The generated module {path} cannot be loaded. Delete it and try again.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        raise CacheError(f"The generated module {path} is damaged ({error}). Delete it and try again.") from error
    return module


def _write(path: Path, source: str) -> None:
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(source)
        os.replace(temporary, path)
    except OSError as error:
        raise CacheError(
            f"The cache folder {path.parent} cannot be written ({error.strerror}). "
            "Set FLOCKING_CACHE to a folder you can write."
        ) from None
