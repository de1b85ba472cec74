"""Generated source code, kept as real files in a cache folder and loaded as modules.

A module is named by a digest of its own source, so that no file, machine code or loaded module ever stands for other
formulas than those printed in it. Beside it lie short notes that name the module of a structure: with one, a second
process finds the module of the library's own formulas without SymPy. Formulas that other code states are read anew.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextvars import ContextVar, Token
from pathlib import Path
from types import ModuleType, TracebackType
from typing import Any

from flocking.errors import CacheError
from flocking.formula.origins import as_loaded, canonical, generation, library_states_all, runtime_digest

_modules: dict[str, ModuleType] = {}
"""Modules of this process: by the structure of the library's own formulas, or by the formulas of other code."""


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


class Reading:
    """Within it, formulas of parts from outside this library are read once for each part, not at every use.

    A simulation that goes on under one law enters the same reading for every step.
    """

    def __init__(self) -> None:
        self._found: dict[tuple[object, ...], tuple[ModuleType, Sequence[object]]] = {}
        self._tokens: list[Token[Reading | None]] = []

    def __enter__(self) -> Reading:
        self._tokens.append(_reading.set(self))
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        _reading.reset(self._tokens.pop())

    def module(self, kind: object, parts: Sequence[object], make: Callable[[], ModuleType]) -> ModuleType:
        """The module of these very parts, made by the first who asks.

        Parameters
        ----------
        kind
            What the module is for.
        make
            Makes it.
        """
        key = (repr(kind), *map(id, parts))
        if key not in self._found:
            # The parts are kept, so that no other object ever has their identities.
            self._found[key] = (make(), tuple(parts))
        return self._found[key][0]


_reading: ContextVar[Reading | None] = ContextVar("reading", default=None)


def generated_module(
    kind: object,
    structure: object,
    parts: Sequence[object],
    formulas: Callable[[], Any],
    write: Callable[[Any], str],
) -> ModuleType:
    """Module of functions printed from formulas, reused when one of the same formulas was made before.

    Parameters
    ----------
    kind
        What beside the formulas fixes the source; its ``repr`` counts.
    structure
        What fixes the formulas where this library's own code states them all; its ``repr`` counts.
    parts
        The parts that state the formulas.
    formulas
        States them: SymPy expressions in tuples, lists, dictionaries and dataclasses.
    write
        Prints them: returns Python source code.

    Raises
    ------
    CacheError
        When the cache folder cannot be used.
    """
    if not library_states_all(parts):

        def read() -> ModuleType:
            stated = formulas()
            text = f"{kind!r} {canonical(stated)}"
            if text not in _modules:
                _modules[text] = _of_source(write(stated))
            return _modules[text]

        reading = _reading.get()
        return read() if reading is None else reading.module(kind, parts, read)
    text = f"{kind!r} {structure!r}"
    if text not in _modules:
        _modules[text] = _of_structure(text, lambda: write(formulas()))
    return _modules[text]


def _of_structure(text: str, make_source: Callable[[], str]) -> ModuleType:
    key = hashlib.sha256(f"{generation()} {text}".encode()).hexdigest()[:20]
    note = cache_folder() / f"flocking_structure_{key}.txt"
    trusted = as_loaded()
    if trusted and (name := _noted(note)) is not None:
        return _loaded(name)
    module = _of_source(make_source())
    if trusted and as_loaded():
        _write(note, f"{module.__name__}\n{text}\n")
    return module


def _noted(note: Path) -> str | None:
    """Name of the module of a structure, where it is in the folder and whole."""
    try:
        name = note.read_text(encoding="utf-8").partition("\n")[0]
        source = (note.parent / f"{name}.py").read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError, ValueError):
        return None
    return name if name == _name(source) else None


def _name(source: str) -> str:
    return f"flocking_generated_{hashlib.sha256(source.encode()).hexdigest()[:20]}"


def _of_source(source: str) -> ModuleType:
    if called := runtime_digest(source):
        source = f"# calls functions of {called}\n{source}"
    name = _name(source)
    path = cache_folder() / f"{name}.py"
    if name not in sys.modules and not _holds(path, source):
        _write(path, source)
    return _loaded(name)


def _holds(path: Path, source: str) -> bool:
    try:
        return path.read_text(encoding="utf-8") == source
    except (OSError, UnicodeDecodeError):
        return False


def _loaded(name: str) -> ModuleType:
    if name in sys.modules:
        return sys.modules[name]
    path = cache_folder() / f"{name}.py"
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
