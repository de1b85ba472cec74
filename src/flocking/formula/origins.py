"""Which code states formulas: the digest of the library's own code, and the formulas that other code states."""

from __future__ import annotations

import ast
import dataclasses
import hashlib
import importlib.util
import time
from collections.abc import Iterable, Mapping
from functools import cache, lru_cache
from pathlib import Path

from flocking.formula.grammar import Formula
from flocking.formula.listed_files import files_below
from flocking.formula.syntax_trees import parsed

PACKAGE = Path(__file__).resolve().parent.parent
FLOORS = ("formula", "model", "engine")
"""Folders of the modules that state formulas and print them."""

MOST_PARSED = 64
"""Most texts whose imports are stored: the modules that generated code imports are about 20."""

_OWN = tuple(f"flocking.{floor}." for floor in FLOORS)
_BEGAN = time.time()


@cache
def generation(package: Path = PACKAGE) -> str:
    """Digest of every module that states or prints formulas, SymPy's version included.

    Parameters
    ----------
    package
        Folder of the package.
    """
    digest = hashlib.sha256()
    for path in _sources(package):
        digest.update(f"{path.relative_to(package).as_posix()}\0".encode())
        digest.update(path.read_bytes())
    found = importlib.util.find_spec("sympy")
    if found is not None and found.origin is not None:
        release = Path(found.origin).parent / "release.py"
        digest.update(release.read_bytes() if release.exists() else found.origin.encode())
    return digest.hexdigest()


def _sources(package: Path) -> list[Path]:
    return [path for floor in FLOORS for path in sorted((package / floor).rglob("*.py"))]


def as_loaded() -> bool:
    """Whether the library's files are those that this process imported; else its code differs from them."""
    # Asked before every law that is made.
    sources = (
        entry.stat() for entry in files_below(*(PACKAGE / floor for floor in FLOORS)) if entry.name.endswith(".py")
    )
    return all(max(about.st_mtime, about.st_ctime) <= _BEGAN for about in sources)


def library_states_all(parts: Iterable[object]) -> bool:
    """Whether every formula of ``parts``, and of the parts they are made of, is stated by this library's code.

    Other code may change while class names stay: inherited methods, module constants, called functions, closures. Only
    the formulas themselves identify what it states.
    """
    stack = list(parts)
    seen: set[int] = set()
    while stack:
        part = stack.pop()
        kind = type(part)
        if kind in _PLAIN or id(part) in seen:
            continue
        seen.add(id(part))
        if isinstance(part, tuple | list):
            # Tuples that begin with a number or a tuple of numbers, as the links of a graph, hold nothing else.
            first = part[0] if part else None
            plain = type(first) in _PLAIN or (isinstance(first, tuple) and bool(first) and type(first[0]) in _PLAIN)
            stack += () if plain else part
        elif isinstance(part, Mapping):
            stack += part.values()
        elif kind.__module__.startswith("numpy"):
            continue
        elif kind.__module__.startswith(_OWN):
            stack += vars(part).values()
        else:
            return False
    return True


_PLAIN = frozenset({int, float, bool, str, complex, type(None), Formula})


def canonical(stated: object) -> str:
    """One text for the formulas ``stated``, in tuples, lists, dictionaries and dataclasses."""
    import sympy

    if isinstance(stated, sympy.Basic):
        return str(sympy.srepr(stated))
    if dataclasses.is_dataclass(stated) and not isinstance(stated, type):
        stated = {f.name: getattr(stated, f.name) for f in dataclasses.fields(stated)}
    if isinstance(stated, Mapping):
        return "{" + ", ".join(f"{key!r}: {canonical(value)}" for key, value in stated.items()) + "}"
    if isinstance(stated, list | tuple):
        return "[" + ", ".join(map(canonical, stated)) + "]"
    return repr(stated)


def runtime_digest(source: str) -> str:
    """Digest of the library's modules that the generated code ``source`` imports, directly or not.

    Machine code on disk contains their functions.
    """
    digest = hashlib.sha256()
    waiting, seen = [source], set()
    while waiting:
        for name in sorted(_imported(waiting.pop())):
            path = PACKAGE.parent.joinpath(*name.split(".")).with_suffix(".py")
            if name not in seen and path.is_file():
                seen.add(name)
                waiting.append(path.read_text(encoding="utf-8"))
    for name in sorted(seen):
        digest.update(PACKAGE.parent.joinpath(*name.split(".")).with_suffix(".py").read_bytes())
    return digest.hexdigest()[:12] if seen else ""


@lru_cache(maxsize=MOST_PARSED)
def _imported(source: str) -> frozenset[str]:
    """Names of the library's modules, and of what they hold, that a text imports."""
    try:
        tree = parsed(source)
    except SyntaxError:
        return frozenset()
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("flocking"):
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name.startswith("flocking")}
    return frozenset(found)
