"""Every numeric constant of a module has a sentence under it, and functions hold no numbers that need one."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import flocking

SOURCES = sorted(Path(flocking.__file__).parent.rglob("*.py"))


def is_number(node: ast.expr) -> bool:
    """Whether an expression is made of numbers, of other constants and of what NumPy says of its numbers."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    if isinstance(node, ast.BinOp):
        return is_number(node.left) and is_number(node.right)
    if isinstance(node, ast.UnaryOp):
        return is_number(node.operand)
    if isinstance(node, ast.Tuple):
        return bool(node.elts) and all(map(is_number, node.elts))
    if isinstance(node, ast.Name):
        return node.id.lstrip("_").isupper()
    text = ast.unparse(node)
    return text.startswith(("float(", "range(", "np.uint", "np.int", "np.float")) or "finfo" in text


def unexplained(text: str) -> Iterator[str]:
    """Constants of a module without a sentence under them."""
    body = ast.parse(text).body
    for node, after in zip(body, [*body[1:], None], strict=True):
        target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
        value = node.value if isinstance(node, ast.Assign | ast.AnnAssign) else None
        if value is None or not isinstance(target, ast.Name | ast.Tuple) or not is_number(value):
            continue
        said = after.value if isinstance(after, ast.Expr) else None
        if not (isinstance(said, ast.Constant) and isinstance(said.value, str) and said.value.strip().endswith(".")):
            yield ast.unparse(target)


def test_numeric_constants_are_explained() -> None:
    assert len(SOURCES) > 400
    found = {str(path): list(unexplained(path.read_text())) for path in SOURCES}
    assert {path: names for path, names in found.items() if names} == {}


def test_constants_without_a_sentence_are_found() -> None:
    text = 'A = 4096\n_B, C = -1.0, 2 * A\n"""Two numbers, for a reason."""\nD: float = float("inf")\nNAME = "word"\n'
    assert list(unexplained(text)) == ["A", "D"]
    assert list(unexplained('A = range(3)\n"""No sentence"""\n')) == ["A"]


PLAIN = frozenset({0.75, 1.5, *(k / 4 for k in range(4)), *map(float, range(17)), 20.0, 64.0, 100.0})
"""Numbers in formulas that speak for themselves: quarters, whole numbers, percents."""

DRAWN = 1e-3
"""Least measure of a picture, in inches, points or shares of its axes: in `show` smaller numbers are tolerances."""


def unnamed(text: str, least: float = np.inf) -> Iterator[str]:
    """Numbers with a point or an exponent inside functions, but for plain ones and those of at least ``least``.

    Values of parameters, of class fields and of constants are apart: they have a name.
    """
    for function in ast.walk(ast.parse(text)):
        if not isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        for statement in function.body:
            for node in numbers_of(statement):
                if abs(node.value) not in PLAIN and not abs(node.value) >= least:
                    yield f"line {node.lineno}: {node.value}"


def numbers_of(node: ast.AST, kind: type[int] | type[float] = float) -> Iterator[ast.Constant]:
    """Numbers of a kind in a statement, those of functions inside it apart."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        return
    if isinstance(node, ast.Constant) and type(node.value) is kind:
        yield node
    for child in ast.iter_child_nodes(node):
        yield from numbers_of(child, kind)


def test_numbers_in_functions_have_names() -> None:
    """Papers apart, whose numbers stand beside their equations and figures."""
    root = Path(flocking.__file__).parent
    checked = [path for path in SOURCES if path.relative_to(root).parts[0] != "papers"]
    assert len(checked) > 500
    found = {
        str(path): list(unnamed(path.read_text(), DRAWN if path.relative_to(root).parts[0] == "show" else np.inf))
        for path in checked
    }
    assert {path: numbers for path, numbers in found.items() if numbers} == {}


def test_numbers_without_a_name_are_found() -> None:
    text = "A = 1e-12\ndef f(x, y=1e-5):\n    def g():\n        return 0.9 * x\n    return g() + 2.0 * max(x, 1e-12)\n"
    assert sorted(unnamed(text)) == ["line 4: 0.9", "line 5: 1e-12"]
    assert list(unnamed(text, DRAWN)) == ["line 5: 1e-12"]


LARGEST_PLAIN = 32
"""Counts up to here are mostly numbers of axes, columns, bits or characters, which their formula shows."""

PERCENT = 100
INTEGERS = {
    "apps/lab/access/web_server.py": "status codes of HTTP and of closed WebSockets",
    "apps/lab/live/hub.py": "status codes of closed WebSockets",
    "engine/c_export/elementary_functions.py": "widths and biases of IEEE 754 formats, by the name of their property",
    "engine/tiles/simd/vectors.py": "bits of a type",
    "model/typesetting/symbols.py": "the code of a backslash",
    "show/style.py": "settings of matplotlib, by their names",
}
"""Files whose integers in functions need no name, and why."""
LAB = {"apps/lab/panels/saved_files.py": {201}, "apps/lab/scene/points.py": {2000}}
"""Numbers of the lab that still have no name."""


def unnamed_integers(text: str) -> Iterator[tuple[int, int]]:
    """Line and value of large integers inside functions and in their decorators.

    Percents, masks of all bits, permissions of files, and exponents of two are apart.
    """
    lines, every = text.splitlines(), list(ast.walk(ast.parse(text)))
    if not any(isinstance(x, ast.Constant) and type(x.value) is int and x.value > LARGEST_PLAIN for x in every):
        return
    for function in every:
        if not isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        nodes = [*function.body, *function.decorator_list]
        exponents = {
            x.right
            for node in nodes
            for x in ast.walk(node)
            if isinstance(x, ast.BinOp) and isinstance(x.op, ast.Pow) and ast.unparse(x.left) in ("2", "2.0")
        }
        exponents |= {x.operand for x in exponents if isinstance(x, ast.UnaryOp)}
        for node in nodes:
            for number in numbers_of(node, int):
                octal = lines[number.lineno - 1].encode()[number.col_offset :].startswith(b"0o")
                mask = number.value & (number.value + 1) == 0 and number.value >= 255
                plain = number.value <= LARGEST_PLAIN or number.value == PERCENT
                if not (plain or mask or octal or number in exponents):
                    yield number.lineno, number.value


def test_large_integers_in_functions_have_names() -> None:
    """Papers apart, as above."""
    root = Path(flocking.__file__).parent
    found = {
        path.relative_to(root).as_posix(): set(unnamed_integers(path.read_text()))
        for path in SOURCES
        if path.relative_to(root).parts[0] != "papers"
    }
    # An exception that is not needed any more goes.
    assert {path for path in INTEGERS if found[path]} == set(INTEGERS)
    left = {
        path: numbers
        for path, numbers in found.items()
        if path not in INTEGERS and not {value for _, value in numbers} <= LAB.get(path, set())
    }
    assert left == {}


def test_large_integers_without_a_name_are_found() -> None:
    text = "A = 4096\n@cache(4096)\ndef f(x, y=500):\n    return x[:200] & 0xFFFF, 2.0**-53, 2**64, 100, 0o700\n"
    assert sorted(unnamed_integers(text)) == [(2, 4096), (4, 200)]
