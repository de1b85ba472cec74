"""Every numeric constant of a module has a sentence under it: what it is, and why it has this value."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

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
