"""Homes of rows as code: the functions behind a dotted name, what of them a test runs, and how to break them."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import re
import sys
import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from tests.papers.broken.content import LARGE, ROUNDING, SMALL
from tests.papers.broken.edits import Edit, edits_of, edits_of_defaults, raising

LIMITS = re.compile(r"^(PAGE|COLUMN|MOST_\w+|LAST_FIGURE)$")
"""Names of sizes of pages, and of limits beyond which a function refuses."""


@dataclass(frozen=True)
class Part:
    """A function of a home.

    Parameters
    ----------
    function
        The function itself.
    node
        Its syntax tree.
    inside
        Name of the class that holds it; empty for a plain function.
    fields
        Whether it is the ``__init__`` of a dataclass, whose tree has the fields of the class as arguments, and no body.
    """

    function: FunctionType
    node: ast.FunctionDef
    inside: str
    fields: bool = False

    @property
    def name(self) -> str:
        return f"{self.function.__module__}.{self.function.__qualname__}"

    def compiled(self) -> CodeType:
        """Code of the syntax tree as it is now."""
        bare = ast.FunctionDef(**{f: getattr(self.node, f) for f in self.node._fields if f != "decorator_list"},
                               decorator_list=[])  # fmt: skip
        ast.copy_location(bare, self.node)
        if "__class__" in self.function.__code__.co_freevars:
            # Code takes the place of a function's only with the same cells: `super()` needs one, a fault may drop it.
            bare.body = [ast.Expr(ast.Name("__class__", ast.Load())), *bare.body]
        body: list[ast.stmt] = [bare]
        if self.inside:
            body = [ast.ClassDef(self.inside, [], [], body, [], lineno=1, col_offset=0)]
        tree = ast.fix_missing_locations(ast.Module(body, []))
        flags = annotations.compiler_flag
        code = compile(tree, self.function.__code__.co_filename, "exec", flags, dont_inherit=True)
        for _ in range(2 if self.inside else 1):
            code = next(c for c in code.co_consts if isinstance(c, CodeType))
        return code


@dataclass(frozen=True)
class Mutant:
    """A home broken in one way.

    Parameters
    ----------
    kind, what
        The kind of fault, and the fault in words.
    where
        Name of the function, and the line.
    install
        Puts the fault in force, for good.
    """

    kind: str
    what: str
    where: str
    install: Callable[[], None]

    @property
    def key(self) -> tuple[str, str, str]:
        return self.kind, self.what, self.where


def found(home: str) -> tuple[Any, Any]:
    """The object of a dotted name and what holds it."""
    module, _, rest = home.rpartition(".")
    names = [rest]
    while True:
        try:
            holder: Any = importlib.import_module(module)
            break
        except ModuleNotFoundError:
            module, _, outer = module.rpartition(".")
            names.insert(0, outer)
    thing = holder
    for name in names:
        holder, thing = thing, inspect.getattr_static(thing, name)
    return thing, holder


def _plain(thing: Any) -> FunctionType | None:
    if isinstance(thing, property):
        thing = thing.fget
    if isinstance(thing, cached_property):
        thing = thing.func
    if isinstance(thing, staticmethod | classmethod):
        thing = thing.__func__
    while hasattr(thing, "__wrapped__"):
        thing = thing.__wrapped__
    return thing if isinstance(thing, FunctionType) else None


@cache
def _nodes(file: str) -> dict[tuple[str, int], tuple[ast.FunctionDef, str]]:
    with open(file, encoding="utf-8") as source:
        tree = ast.parse(source.read())
    result = {}

    def walk(block: list[ast.stmt], inside: str) -> None:
        for node in block:
            if isinstance(node, ast.ClassDef):
                walk(node.body, node.name)
            elif isinstance(node, ast.FunctionDef):
                first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
                result[node.name, first] = node, inside

    walk(tree.body, "")
    return result


def part_of(function: FunctionType) -> Part | None:
    code = function.__code__
    if code.co_filename.startswith("<"):
        return None
    known = _nodes(code.co_filename).get((code.co_name, code.co_firstlineno))
    return Part(function, *known) if known else None


def _given(value: ast.expr | None) -> ast.expr | None:
    """What a field is when it is not given, as its class writes it: ``x: float = 1.0``, ``field(default=1.0)``."""
    if isinstance(value, ast.Call):
        return next((k.value for k in value.keywords if k.arg == "default"), None)
    return value


def _fields_of(thing: Any) -> list[Part]:
    """The ``__init__`` of a dataclass: the values that its fields have when they are not given."""
    if not (isinstance(thing, type) and dataclasses.is_dataclass(thing) and "__init__" in vars(thing)):
        return []
    lines, first = inspect.getsourcelines(thing)
    holder = ast.increment_lineno(ast.parse(textwrap.dedent("".join(lines))), first - 1).body[0]
    assert isinstance(holder, ast.ClassDef)
    function = thing.__init__
    wanted = inspect.signature(function).parameters
    given = {
        n.target.id: _given(n.value)
        for n in holder.body
        if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name) and n.target.id in wanted
    }
    names = [name for name, value in given.items() if value is not None]
    values = [value for value in given.values() if value is not None]
    arguments = ast.arguments([], [ast.arg(n) for n in names], None, [], [], None, values)
    node = ast.FunctionDef("__init__", arguments, [ast.Pass(lineno=first, col_offset=0)], [], lineno=first)
    return [Part(function, node, thing.__name__, fields=True)]


def _own_functions(home: str) -> list[FunctionType]:
    thing, _ = found(home)
    things = vars(thing).values() if isinstance(thing, type) else [thing]
    return [g for f in map(_plain, things) if f is not None for g in _made_from(f, home.rpartition(".")[0])]


def _made_from(function: FunctionType, module: str) -> list[FunctionType]:
    """A function, or those of the module that another module made it from, as `claims_by_name` makes one."""
    if function.__globals__["__name__"] == module:
        return [function]
    cells = [_plain(cell.cell_contents) for cell in function.__closure__ or ()]
    return [f for f in cells if f is not None and f.__module__ == module] or [function]


def names_of(home: str) -> set[str]:
    """Names of the functions of a home, without their helpers."""
    return {p.name for p in map(part_of, _own_functions(home)) if p is not None}


def parts_of(home: str) -> list[Part]:
    """All functions of a home: itself, the methods of a class, and the private helpers these call in their module."""
    functions = _own_functions(home)
    if home.endswith((".pictures.figures", ".pictures.figure")):
        package = home.split(".pictures.")[0]
        names = [f"{package}.pictures", f"{package}.diagrams", "flocking.show.declaration"]
        for name in names:
            try:
                module = importlib.import_module(name)
            except ModuleNotFoundError:
                continue
            functions += [f for f in map(_plain, vars(module).values()) if f is not None and f.__module__ == name]
    todo = list(functions)
    while todo:
        function = todo.pop()
        for name in _names(function.__code__):
            helper = _plain(function.__globals__.get(name))
            if helper is None or helper in functions or not name.startswith("_"):
                continue
            if helper.__module__ == function.__module__:
                functions.append(helper)
                todo.append(helper)
    unique = list(dict.fromkeys(functions))
    return [*_fields_of(found(home)[0]), *(p for p in map(part_of, unique) if p is not None)]


def _names(code: CodeType) -> set[str]:
    inner = [c for c in code.co_consts if isinstance(c, CodeType)]
    return set(code.co_names).union(*map(_names, inner))


def _runs(span: Any, ran: list[Any]) -> bool:
    """Whether an instruction lies within these places, or loads a constant put together from them and more."""
    begin, end = span
    return any(
        (begin <= first and last <= end) or (constant and first <= begin and end <= last)
        for first, last, constant in ran
    )


@cache
def _edits(node: ast.FunctionDef) -> list[Edit]:
    return edits_of(node)


def mutants_of(parts: list[Part], lines: set[tuple[str, Any]]) -> list[Mutant]:
    """All mutants of a home at places that run."""
    result = []
    for part in parts:
        file = part.function.__code__.co_filename
        unset = f"{file} {part.function.__code__.co_qualname} "
        absent = {name.removeprefix(unset) for name, _ in lines if name.startswith(unset)}
        if part.fields:
            result += [_default(part, name, edit) for name, edit in edits_of_defaults(part.node) if name in absent]
            continue
        first, last = part.node.body[0].lineno, part.node.end_lineno or 0
        ran = [place for name, place in lines if name == file and place and first <= place[0][0] <= last]
        if not ran:
            continue
        for edit in [raising(part.node), *_edits(part.node)]:
            if edit.kind == "return" or _runs(edit.span, ran):
                result.append(_mutant(part, edit))
        result += [_mutant(part, edit) for name, edit in edits_of_defaults(part.node) if name in absent]
        result += _numbers(part, {place[0][0] for place in ran}, absent)
    return result


def _mutant(part: Part, edit: Edit) -> Mutant:
    def install() -> None:
        with edit.applied():
            code = part.compiled()
            defaults, keywords = part.node.args.defaults, part.node.args.kw_defaults
            names = [a.arg for a in part.node.args.kwonlyargs]
            space = part.function.__globals__
            touched = any(node in (part.node.args, *ast.walk(part.node.args)) for node, _, _ in edit.changes)
            if touched:
                part.function.__defaults__ = tuple(_value(d, space) for d in defaults) or None
                part.function.__kwdefaults__ = {
                    n: _value(d, space) for n, d in zip(names, keywords, strict=True) if d is not None
                } or None
            part.function.__code__ = code

    return Mutant(edit.kind, edit.what, f"{part.name}:{edit.line}", install)


def _default(part: Part, name: str, edit: Edit) -> Mutant:
    """A dataclass whose field has another value where none is given."""

    def install() -> None:
        function, arguments = part.function, part.node.args
        place = [a.arg for a in arguments.args].index(name)
        with edit.applied():
            value = _value(arguments.defaults[place], function.__globals__)
        if name in (function.__kwdefaults__ or {}):
            function.__kwdefaults__[name] = value
            return
        names = function.__code__.co_varnames[: function.__code__.co_argcount]
        defaults = list(function.__defaults__ or ())
        defaults[names.index(name) - len(names)] = value
        function.__defaults__ = tuple(defaults)

    return Mutant(edit.kind, f"{name}: {edit.what}", f"{part.name}:{edit.line}", install)


def _value(node: ast.expr, space: dict[str, Any]) -> Any:
    return eval(compile(ast.fix_missing_locations(ast.Expression(node)), "<default>", "eval"), space)


def _numbers(part: Part, ran: set[int], absent: set[str]) -> list[Mutant]:
    """Numbers that live outside the function under a name in capitals."""
    result, seen = [], set()
    arguments = part.node.args
    plain = [*arguments.posonlyargs, *arguments.args]
    pairs = [*zip(plain[len(plain) - len(arguments.defaults) :], arguments.defaults, strict=True),
             *zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)]  # fmt: skip
    used = [d for a, d in pairs if d is not None and a.arg in absent]
    for node in [n for d in used for n in ast.walk(d)] + [n for s in part.node.body for n in ast.walk(s)]:
        line = getattr(node, "lineno", 0)
        if line not in ran and not any(node in ast.walk(d) for d in used):
            continue
        space: Any = part.function.__globals__
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            module = space.get(node.value.id)
            if not isinstance(module, ModuleType):
                continue
            name, value = node.attr, getattr(module, node.attr, None)
        elif isinstance(node, ast.Name):
            name, value = node.id, space.get(node.id)
        else:
            continue
        if not name.isupper() or name in seen or LIMITS.match(name):
            continue
        seen.add(name)
        for new, what in _off(value):
            result.append(
                Mutant("constant", f"{name} = {what}", f"{part.name}:{line}", _renaming(part, name, value, new))
            )
    return result


def _off(value: Any) -> list[tuple[Any, str]]:
    if isinstance(value, bool) or not isinstance(value, int | float | tuple | np.ndarray):
        return []
    if isinstance(value, int):
        return [(value + 1, f"{value + 1} for {value}"), (value * 3, f"{value * 3} for {value}")]
    if isinstance(value, float) and 0 < abs(value) <= ROUNDING:
        return [(1.0, f"1 for {value:.6g}")]
    if isinstance(value, float):
        others = (value * SMALL, value * LARGE) if value else (0.05, 1.0)
        return [(other, f"{other:.6g} for {value:.6g}") for other in others]
    if isinstance(value, tuple) and not all(isinstance(x, int | float) for x in value):
        return []
    numbers = np.array(value, dtype=float)
    if numbers.size == 0:
        return []
    found = []
    for place in {0, numbers.size - 1}:
        changed = numbers.copy()
        changed.flat[place] = changed.flat[place] * SMALL + (0.05 if changed.flat[place] == 0 else 0.0)
        new: Any = tuple(changed.tolist()) if isinstance(value, tuple) else changed
        found.append((new, f"with {changed.flat[place]:.6g} at {place}"))
    return found


def _renaming(part: Part, name: str, old: Any, new: Any) -> Callable[[], None]:
    def install() -> None:
        for key, module in list(sys.modules.items()):
            if key.startswith("flocking") and vars(module).get(name) is old:
                setattr(module, name, new)
        function, arguments = part.function, part.node.args
        defaults = list(function.__defaults__ or ())
        for k, node in enumerate(arguments.defaults):
            if isinstance(node, ast.Name | ast.Attribute) and ast.unparse(node).split(".")[-1] == name:
                defaults[k] = new
        function.__defaults__ = tuple(defaults) or None
        for argument, node in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True):
            if isinstance(node, ast.Name | ast.Attribute) and ast.unparse(node).split(".")[-1] == name:
                function.__kwdefaults__ = {**(function.__kwdefaults__ or {}), argument.arg: new}

    return install
