"""Generated source code, stored as files in a cache folder and loaded as modules.

A module is named by a digest of its own source, so that no file, machine code or loaded module is ever used for
formulas other than those printed in it. Short notes beside it name the module of a structure: with one, a second
process finds the module of the library's own formulas without SymPy. Formulas stated by other code are always read.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Sequence
from contextvars import ContextVar, Token
from pathlib import Path
from types import ModuleType, TracebackType
from typing import TypeVar

from flocking.errors import CacheError
from flocking.formula.cache import GENERATED, cache_folder, read_text, write_text
from flocking.formula.origins import as_loaded, canonical, generation, library_states_all, runtime_digest

_modules: dict[str, ModuleType] = {}
"""Modules of this process: by the structure of the library's own formulas, or by the formulas of other code."""


class Reading:
    """A context in which formulas of parts from outside this library are read once per part, not at every use.

    A simulation that goes on under one law enters the same context for every step.
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
        """The module of these parts, made by ``make`` at the first call; ``kind`` is what it is for."""
        key = (repr(kind), *map(id, parts))
        if key not in self._found:
            # The parts are kept, so that no other object ever has their identities.
            self._found[key] = (make(), tuple(parts))
        return self._found[key][0]


Formulas = TypeVar("Formulas")

_reading: ContextVar[Reading | None] = ContextVar("reading", default=None)


def generated_module(
    kind: object,
    structure: object,
    parts: Sequence[object],
    formulas: Callable[[], Formulas],
    write: Callable[[Formulas], str],
) -> ModuleType:
    """Module of functions printed from formulas, reused when one of the same formulas was made before.

    Parameters
    ----------
    kind
        What beside the formulas determines the source; its ``repr`` counts.
    structure
        What determines the formulas if this library's own code states them all; its ``repr`` counts.
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
    if trusted and (name := _noted(note)) is not None and (known := _found(name)) is not None:
        return known
    module = _of_source(make_source())
    if trusted and as_loaded():
        write_text(note, f"{module.__name__}\n{text}\n")
    return module


def _noted(note: Path) -> str | None:
    """Name of the module of a structure; None if its note is missing or incomplete."""
    text = read_text(note)
    return None if text is None else text.partition("\n")[0]


def _name(source: str) -> str:
    return f"{GENERATED}{hashlib.sha256(source.encode()).hexdigest()[:20]}"


def _of_source(source: str) -> ModuleType:
    if called := runtime_digest(source):
        source = f"# calls functions of {called}\n{source}"
    name = _name(source)
    if name in sys.modules:
        return sys.modules[name]
    path = cache_folder() / f"{name}.py"
    if read_text(path) != source:
        write_text(path, source)
    return _loaded(name, source)


def _found(name: str) -> ModuleType | None:
    """A module by its name; None if it is not loaded and its file is missing or incomplete."""
    if name in sys.modules:
        return sys.modules[name]
    if not name.startswith(GENERATED) or not name.isidentifier():
        return None
    source = read_text(cache_folder() / f"{name}.py")
    return _loaded(name, source) if source is not None and name == _name(source) else None


def _loaded(name: str, source: str) -> ModuleType:
    """The module of a source that is in the folder; Python's own cache of compiled files is not used."""
    path = cache_folder() / f"{name}.py"
    module = ModuleType(name)
    module.__file__ = str(path)
    module.__dict__["SOURCE"] = source
    try:
        exec(compile(source, str(path), "exec"), module.__dict__)
    except Exception as error:
        raise CacheError(f"The generated module {path} is damaged ({error}). Delete it and try again.") from error
    # Known once it is complete: another thread may ask for it meanwhile, and the first one that is complete serves all.
    return sys.modules.setdefault(name, module)
