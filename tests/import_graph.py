"""Which files of a package import which, imports inside functions and for type checks alone included; and circles."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from functools import cache
from pathlib import Path

Imports = dict[str, set[str]]


@cache
def tree_of(path: Path) -> ast.Module:
    """The syntax tree of a file, which is parsed once."""
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def nodes_of(tree: ast.Module) -> tuple[ast.AST, ...]:
    """All nodes of a tree, which is walked once."""
    return tuple(ast.walk(tree))


def imports_of(package: Path) -> Imports:
    """Dotted names of the package's modules that every module imports; the package itself is left out.

    Parameters
    ----------
    package
        Folder of the package.
    """
    root = package.name
    modules = {}
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package).with_suffix("").parts
        modules[".".join([root, *(p for p in parts if p != "__init__")])] = path
    found: Imports = {}
    for name, path in modules.items():
        if name == root:
            continue
        named: set[str] = set()
        for node in nodes_of(tree_of(path)):
            if isinstance(node, ast.ImportFrom) and node.level == 0 and (node.module or "").split(".")[0] == root:
                module = str(node.module)
                named |= {full if (full := f"{module}.{alias.name}") in modules else module for alias in node.names}
            elif isinstance(node, ast.Import):
                named |= {alias.name for alias in node.names if alias.name in modules}
        found[name] = named & set(modules) - {name, root}
    return found


def circles(imports: Mapping[str, set[str]]) -> list[list[str]]:
    """Groups of names each of which leads to every other, by Tarjan's algorithm; the names sorted."""
    order: dict[str, int] = {}
    lowest: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(name: str) -> None:
        order[name] = lowest[name] = len(order)
        stack.append(name)
        for other in sorted(imports.get(name, ())):
            if other not in order:
                visit(other)
                lowest[name] = min(lowest[name], lowest[other])
            elif other in stack:
                lowest[name] = min(lowest[name], order[other])
        if lowest[name] == order[name]:
            group = stack[stack.index(name) :]
            del stack[stack.index(name) :]
            if len(group) > 1:
                found.append(sorted(group))

    for name in sorted(imports):
        if name not in order:
            visit(name)
    return found


def among_children(imports: Mapping[str, set[str]], folder: str) -> Imports:
    """Which direct children of a folder, files and folders alike, import which others of them.

    Parameters
    ----------
    folder
        Dotted name of the folder.
    """
    begin = f"{folder}."
    found: Imports = {}
    for name, others in imports.items():
        if name.startswith(begin):
            child = name.removeprefix(begin).split(".")[0]
            inside = {o.removeprefix(begin).split(".")[0] for o in others if o.startswith(begin)}
            found.setdefault(child, set()).update(inside - {child})
    return found
