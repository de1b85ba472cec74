"""Ways to break a function: small edits of its syntax tree, one at a time, each named by its kind.

What is not content is not edited: documentation, annotations, checks of arguments, texts of messages, the looks of a
drawing, and the names under which generated code is kept.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from tests.papers.broken.content import (
    ALLOWANCES,
    ATTRIBUTES,
    CHECKERS,
    CHECKING,
    FORMULAS,
    LARGE,
    LOOKS,
    NAMED_FOR_THE_CACHE,
    ROUNDING,
    SAMPLES,
    SMALL,
    SYMBOLIC,
    SYMMETRIC,
    TEXTS,
    WORDS,
)  # fmt: skip

OPPOSITE = {
    ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip


@dataclass(frozen=True)
class Edit:
    """One way to break a function.

    Parameters
    ----------
    kind
        ``"sign"``, ``"factor"``, ``"constant"``, ``"index"``, ``"comparison"``, ``"swap"``, ``"return"``,
        ``"dropped"`` or ``"text"``.
    line, span
        Where in its file: the line, and the first and last line and column.
    what
        Source before and after.
    changes
        Attributes of nodes and their new values.
    """

    kind: str
    line: int
    span: tuple[tuple[int, int], tuple[int, int]]
    what: str
    changes: tuple[tuple[Any, str, Any], ...]

    @contextmanager
    def applied(self) -> Iterator[None]:
        before = [(node, field, getattr(node, field)) for node, field, _ in self.changes]
        for node, field, value in self.changes:
            setattr(node, field, value)
        try:
            yield
        finally:
            for node, field, value in before:
                setattr(node, field, value)


def edits_of(function: ast.FunctionDef) -> list[Edit]:
    """All edits of a function, in the order of its source."""
    checks = CHECKING.match(function.name) and _returned(function) in ("", "None")
    if function.name in NAMED_FOR_THE_CACHE or checks:
        return []
    found = list(_of_body(function))
    seen, kept = set(), []
    for edit in found:
        key = (edit.kind, edit.line, edit.what)
        if key not in seen:
            seen.add(key)
            kept.append(edit)
    return sorted(kept, key=lambda e: (e.line, e.kind, e.what))


def edits_of_defaults(function: ast.FunctionDef) -> Iterator[tuple[str, Edit]]:
    """Edits of the values that arguments have when they are not given, with the argument's name."""
    plain = [*function.args.posonlyargs, *function.args.args]
    pairs = list(zip(plain[len(plain) - len(function.args.defaults) :], function.args.defaults, strict=True))
    pairs += [(a, d) for a, d in zip(function.args.kwonlyargs, function.args.kw_defaults, strict=True) if d is not None]
    for argument, value in pairs:
        for edit in _inside(function.args, value):
            yield argument.arg, edit


def raising(function: ast.FunctionDef) -> Edit:
    """The function does nothing but raise."""
    body = ast.parse("raise RuntimeError('broken on purpose')").body
    return _edit("return", function.body[0], "raises", (function, "body", body))


def _edit(kind: str, node: ast.AST, what: str, *changes: tuple[Any, str, Any]) -> Edit:
    for _, _, value in changes:
        for new in value if isinstance(value, list) else [value]:
            if isinstance(new, ast.AST):
                for part in ast.walk(new):
                    if "lineno" in part._attributes and not hasattr(part, "lineno"):
                        ast.copy_location(part, node)
                        part.lineno = node.lineno  # type: ignore[attr-defined]
                        part.col_offset = getattr(node, "col_offset", 0)  # type: ignore[attr-defined]
                        part.end_lineno = getattr(node, "end_lineno", node.lineno)  # type: ignore[attr-defined]
                        part.end_col_offset = getattr(node, "end_col_offset", 0)  # type: ignore[attr-defined]
    place: Any = node
    span = (place.lineno, place.col_offset), (place.end_lineno, place.end_col_offset)
    return Edit(kind, place.lineno, span, what, changes)


def _text(node: ast.AST) -> str:
    text = " ".join(ast.unparse(node).split())
    return text if len(text) < 60 else text[:57] + "..."


def _returned(function: ast.FunctionDef) -> str:
    return ast.unparse(function.returns) if function.returns is not None else ""


def _early(function: ast.FunctionDef) -> Iterator[Edit]:
    kind = _returned(function)
    names = [a.arg for a in (*function.args.posonlyargs, *function.args.args) if a.arg not in ("self", "cls")]
    results = {"bool": ["True", "False"], "float": ["0.0", "1.0"]}.get(kind, names[:1] or ["None"])
    if kind == "None":
        results = ["None"]
    for result in results:
        body = ast.parse(f"def f():\n    return {result}").body[0].body  # type: ignore[attr-defined]
        yield _edit("return", function.body[0], f"return {result} at once", (function, "body", body))


def _numeric(function: ast.FunctionDef) -> bool:
    return _returned(function) in ("float", "Array", "complex", "float | Array", "Any", "sympy.Expr", "Expr")


def _of_body(function: ast.FunctionDef, nested: bool = False) -> Iterator[Edit]:
    body = function.body
    if body and isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
        body = body[1:]
    if not body:
        return
    if not nested:
        yield from _early(function)
    numeric = _numeric(function)
    yield from _statements(function, "body", numeric)
    if function.name.endswith("_source"):
        yield from _printed(function)


def _printed(function: ast.FunctionDef) -> Iterator[Edit]:
    """Signs and factors in the code that a function prints."""
    other = {" - ": " + ", " + ": " - ", " / ": " * ", " * ": " / "}
    for statement in function.body[1:]:
        for node in ast.walk(statement):
            if not (isinstance(node, ast.Constant) and isinstance(node.value, str)):
                continue
            for match in re.finditer(r" [-+/*] ", node.value):
                changed = node.value[: match.start()] + other[match.group()] + node.value[match.end() :]
                kind = "sign" if match.group() in (" - ", " + ") else "factor"
                yield _edit(kind, statement, f"prints {changed.strip()!r}", (node, "value", changed))


def _is_check(statement: ast.stmt) -> bool:
    return (
        isinstance(statement, ast.If)
        and all(isinstance(s, ast.Raise) for s in statement.body)
        and not (statement.orelse)
    )


def _statements(owner: Any, field: str, numeric: bool) -> Iterator[Edit]:
    block = getattr(owner, field)
    for position, statement in enumerate(block):
        if isinstance(statement, ast.Raise | ast.Import | ast.ImportFrom | ast.Pass) or _is_check(statement):
            continue
        if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
            continue
        acts = getattr(statement, "value", None) if isinstance(statement, ast.Expr | ast.AugAssign) else None
        if acts is not None and not isinstance(acts, ast.Yield) and not _is_checker(acts):
            rest = [*block[:position], *block[position + 1 :]] or [ast.Pass()]
            yield _edit("dropped", statement, f"without {_text(statement)}", (owner, field, rest))
        if isinstance(statement, ast.AugAssign):
            flipped = _other_sign(statement.op)
            if flipped is not None:
                yield _edit("sign", statement, f"other sign in {_text(statement)}", (statement, "op", flipped))
        if isinstance(statement, ast.Return) and statement.value is not None and numeric:
            value = statement.value
            zero = isinstance(value, ast.Call) and ast.unparse(value) == "sympy.Integer(0)"
            if not zero and not isinstance(value, ast.Tuple | ast.List | ast.Constant):
                off = ast.BinOp(value, ast.Mult(), ast.Constant(SMALL))
                if not _allows(value):
                    yield _edit("factor", statement, f"{SMALL} times {_text(value)}", (statement, "value", off))
                minus = ast.UnaryOp(ast.USub(), value)
                yield _edit("sign", statement, f"minus {_text(value)}", (statement, "value", minus))
        if isinstance(statement, ast.FunctionDef):
            yield from _of_body(statement, nested=True)
            continue
        if isinstance(statement, ast.If):
            negated = ast.UnaryOp(ast.Not(), statement.test)
            yield _edit("comparison", statement, f"if not ({_text(statement.test)})", (statement, "test", negated))
        for name in ("body", "orelse", "finalbody"):
            if isinstance(getattr(statement, name, None), list) and not isinstance(statement, ast.Expr):
                yield from _statements(statement, name, numeric)
        for name, value in ast.iter_fields(statement):
            if name in ("body", "orelse", "finalbody", "annotation", "handlers", "target"):
                continue
            if name == "targets":
                value = [v for v in value if isinstance(v, ast.Subscript)]
            for part in value if isinstance(value, list) else [value]:
                if isinstance(part, ast.withitem):
                    yield from _inside(part, part.context_expr)
                elif isinstance(part, ast.expr):
                    yield from _inside(statement, part)


def _is_checker(node: Any) -> bool:
    return isinstance(node, ast.Call) and bool(CHECKERS.match(ast.unparse(node.func).split(".")[-1]))


def _other_sign(op: ast.operator) -> ast.operator | None:
    return {ast.Add: ast.Sub(), ast.Sub: ast.Add()}.get(type(op))  # type: ignore[return-value]


def _replacing(parent: Any, old: ast.AST, new: ast.AST) -> tuple[Any, str, Any]:
    for field, value in ast.iter_fields(parent):
        if value is old:
            return parent, field, new
        if isinstance(value, list) and any(x is old for x in value):
            return parent, field, [new if x is old else x for x in value]
    raise AssertionError("not a child")


def _inside(parent: Any, node: ast.expr, index: bool = False) -> Iterator[Edit]:
    """Edits of an expression and its parts."""
    if isinstance(node, ast.JoinedStr):
        return
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div) and _allows(node):
        # Of an allowance for rounding only its size is content.
        for part in ast.walk(node):
            if isinstance(part, ast.Constant) and isinstance(part.value, float) and 0 < part.value <= ROUNDING:
                yield from _constant(node, part, False)
        return
    yield from _at(parent, node, index)
    for field, value in ast.iter_fields(node):
        parts = value if isinstance(value, list) else [value]
        for part in parts:
            if isinstance(part, ast.keyword):
                if part.arg in LOOKS | SYMBOLIC | WORDS or _is_checker(node):
                    continue
                yield from _inside(part, part.value)
            elif isinstance(part, ast.comprehension):
                yield from _inside(part, part.iter)
                for test in part.ifs:
                    yield _edit("comparison", test, f"without if {_text(test)}",
                                (part, "ifs", [x for x in part.ifs if x is not test]))  # fmt: skip
                    yield from _inside(part, test)
            elif isinstance(part, ast.expr):
                if isinstance(node, ast.Call) and _is_count_of_samples(node, part):
                    continue
                inner = isinstance(node, ast.Subscript) and field == "slice"
                yield from _inside(
                    node, part, inner or (index and isinstance(node, ast.Tuple | ast.Slice | ast.UnaryOp))
                )


def _is_count_of_samples(call: ast.Call, part: ast.expr) -> bool:
    name = ast.unparse(call.func).split(".")[-1]
    return name in SAMPLES and isinstance(part, ast.Constant) and isinstance(part.value, int) and part.value >= 8


def _at(parent: Any, node: ast.expr, index: bool) -> Iterator[Edit]:
    if isinstance(node, ast.BinOp):
        flipped = _other_sign(node.op)
        if flipped is not None and _is_shape(node):
            return
        if flipped is not None and not index:
            yield _edit("sign", node, f"other sign in {_text(node)}", (node, "op", flipped))
        elif isinstance(node.op, ast.Mult | ast.Div):
            off = ast.BinOp(node, ast.Mult(), ast.Constant(SMALL))
            yield _edit("factor", node, f"{SMALL} times {_text(node)}", _replacing(parent, node, off))
            if _is_shape(node):
                return
            other: ast.operator = ast.Div() if isinstance(node.op, ast.Mult) else ast.Mult()
            yield _edit("factor", node, f"{type(other).__name__} in {_text(node)}", (node, "op", other))
        elif isinstance(node.op, ast.BitAnd | ast.BitOr):
            one: ast.operator = ast.BitOr() if isinstance(node.op, ast.BitAnd) else ast.BitAnd()
            yield _edit("comparison", node, f"{type(one).__name__} in {_text(node)}", (node, "op", one))
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not | ast.Invert) and not index:
        kind = "sign" if isinstance(node.op, ast.USub) else "comparison"
        yield _edit(kind, node, f"{_text(node.operand)} for {_text(node)}", _replacing(parent, node, node.operand))
    elif isinstance(node, ast.Constant):
        yield from _constant(parent, node, index)
    elif isinstance(node, ast.Compare):
        new = [OPPOSITE[type(op)]() for op in node.ops]
        yield _edit("comparison", node, f"not {_text(node)}", (node, "ops", new))
    elif isinstance(node, ast.BoolOp):
        op: ast.boolop = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield _edit("comparison", node, f"{type(op).__name__} in {_text(node)}", (node, "op", op))
    elif isinstance(node, ast.IfExp):
        if any(isinstance(x, ast.Constant) and isinstance(x.value, str) for x in (node.body, node.orelse)):
            return
        yield _edit("comparison", node, f"other branch of {_text(node)}", (node, "body", node.orelse),
                    (node, "orelse", node.body))  # fmt: skip
    elif isinstance(node, ast.Tuple) and index and len(node.elts) == 2:
        if ast.dump(node.elts[0]) != ast.dump(node.elts[1]):
            yield _edit("index", node, f"[{_text(node)}] turned round", (node, "elts", node.elts[::-1]))
    elif isinstance(node, ast.Tuple | ast.List) and not index:
        yield from _elements(node)
    elif isinstance(node, ast.Call):
        yield from _call(node)


def _is_shape(node: ast.BinOp) -> bool:
    """Whether zeros are added or ones are multiplied with, which gives an array its shape."""
    wanted = ("np.zeros", "np.zeros_like") if isinstance(node.op, ast.Add | ast.Sub) else ("np.ones",)
    return any(isinstance(x, ast.Call) and ast.unparse(x.func) in wanted for x in (node.left, node.right))


def _allows(node: ast.expr) -> bool:
    """Whether an expression is an allowance for rounding: a few per cent more or less mean nothing."""
    parts = list(ast.walk(node))
    small = any(isinstance(p, ast.Constant) and isinstance(p.value, float) and 0 < p.value <= ROUNDING for p in parts)
    names = [ast.unparse(p).split(".")[-1] for p in parts if isinstance(p, ast.Name | ast.Attribute)]
    return small or any(name in ALLOWANCES for name in names)


def _elements(node: ast.Tuple | ast.List) -> Iterator[Edit]:
    if len(node.elts) >= 2 and all(isinstance(e, ast.Call | ast.Starred | ast.Name) for e in node.elts):
        if not any(isinstance(e, ast.Call) for e in node.elts):
            return
        for element in node.elts:
            rest = [e for e in node.elts if e is not element]
            yield _edit("dropped", element, f"without {_text(element)}", (node, "elts", rest))


def _call(node: ast.Call) -> Iterator[Edit]:
    name = ast.unparse(node.func).split(".")[-1]
    if _is_checker(node):
        return
    plain = [a for a in node.args if not isinstance(a, ast.Starred)]
    if (
        len(plain) == len(node.args) >= 2
        and name not in SYMMETRIC | SAMPLES | ATTRIBUTES
        and ast.dump(plain[0]) != ast.dump(plain[1])
    ):
        swapped = [node.args[1], node.args[0], *node.args[2:]]
        if not all(isinstance(a, ast.Constant | ast.JoinedStr) for a in swapped[:2]):
            yield _edit("swap", node, f"arguments of {_text(node)} swapped", (node, "args", swapped))
    for keyword in node.keywords:
        if keyword.arg is not None and keyword.arg not in LOOKS | SYMBOLIC | WORDS | {"axes", "dtype"}:
            rest = [k for k in node.keywords if k is not keyword]
            yield _edit("dropped", keyword.value, f"without {keyword.arg} = {_text(keyword.value)}",
                        (node, "keywords", rest))  # fmt: skip
        if keyword.arg in TEXTS and isinstance(keyword.value, ast.Constant) and isinstance(keyword.value.value, str):
            off = ast.Constant(keyword.value.value + " of another")
            yield _edit("text", keyword.value, f"other {keyword.arg}", (keyword, "value", off))
    if name == "__setattr__" and not isinstance(node.args[-1], ast.Constant):
        off = ast.BinOp(node.args[-1], ast.Mult(), ast.Constant(SMALL))
        yield _edit("factor", node, f"{SMALL} times {_text(node.args[-1])}", (node, "args", [*node.args[:-1], off]))
    if name in FORMULAS:
        for argument in node.args[:1]:
            if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
                yield from _formula(argument)


def _formula(node: ast.Constant) -> Iterator[Edit]:
    text = str(node.value)
    for match in re.finditer(r" [+-] |\d+", text):
        sign = match.group() in (" + ", " - ")
        new = {" + ": " - ", " - ": " + "}.get(match.group()) or str(int(match.group()) + 1)
        changed = text[: match.start()] + new + text[match.end() :]
        yield _edit("sign" if sign else "constant", node, f'"{changed}"', (node, "value", changed))


def _constant(parent: Any, node: ast.Constant, index: bool) -> Iterator[Edit]:
    value = node.value
    if isinstance(value, bool):
        place = _text(parent) if isinstance(parent, ast.expr) else "a keyword"
        yield _edit("constant", node, f"{not value} for {value} in {place}", (node, "value", not value))
        return
    if not isinstance(value, int | float | complex):
        return
    place = _text(parent) if isinstance(parent, ast.expr | ast.stmt) else getattr(parent, "arg", "")
    if isinstance(value, int) and (index or getattr(parent, "arg", "") == "axis"):
        other = {0: 1, 1: 0}.get(value, value - 1)
        yield _edit("index", node, f"{other} for {value} in {place}", (node, "value", other))
        return
    if isinstance(value, complex):
        options: list[Any] = [value * SMALL, value * LARGE]
    elif 0 < abs(value) <= ROUNDING:
        options = [1e6]
    elif isinstance(value, int):
        options = [value + 1, value * 3 + 2]
    else:
        options = [value * SMALL, value * LARGE] if value else [0.05, 1.0]
    for new in options:
        yield _edit("constant", node, f"{new:.6g} for {value:.6g} in {place}", (node, "value", new))
