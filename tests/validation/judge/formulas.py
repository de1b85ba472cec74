"""Text formulas as expression trees with their derivatives, and as tapes of operations that a program works off."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass

OPERATIONS = ("constant", "pi", "input", "add", "subtract", "multiply", "divide", "sqrt", "exp", "log", "power", "sin",
              "cos")  # fmt: skip
"""Operations of a tape, in the order of their numbers in judge.c."""


@dataclass(frozen=True)
class Node:
    """An operation on other nodes; ``value`` is that of a constant, the exponent of a power, or the name of an input.

    Inputs are ``r`` (a distance), ``s`` (its square) and ``t`` (the time).
    """

    operation: str
    arguments: tuple[Node, ...] = ()
    value: float | str = 0.0

    def __add__(self, other: Node) -> Node:
        if self == ZERO:
            return other
        return self if other == ZERO else Node("add", (self, other))

    def __sub__(self, other: Node) -> Node:
        return self if other == ZERO else Node("subtract", (self, other))

    def __mul__(self, other: Node) -> Node:
        if ZERO in (self, other):
            return ZERO
        if self == ONE:
            return other
        return self if other == ONE else Node("multiply", (self, other))

    def __truediv__(self, other: Node) -> Node:
        if self == ZERO:
            return ZERO
        return self if other == ONE else Node("divide", (self, other))


def constant(value: float) -> Node:
    return Node("constant", (), float(value))


ZERO, ONE, TWO = constant(0.0), constant(1.0), constant(2.0)
R, S, T = (Node("input", (), name) for name in "rst")


def raised(base: Node, exponent: float) -> Node:
    """A power: whole exponents up to 8 as products, others by their own operation."""
    if exponent == int(exponent) and abs(exponent) <= 8:
        if exponent < 0:
            return ONE / raised(base, -exponent)
        result = ONE
        for _ in range(int(exponent)):
            result = result * base
        return result
    return Node("power", (base,), float(exponent))


def parsed(text: str, values: Mapping[str, float]) -> Node:
    """The tree of a formula in ``r``, ``s``, ``t`` and the names of ``values``."""
    return _converted(ast.parse(text.strip(), mode="eval").body, values)


def _converted(tree: ast.expr, values: Mapping[str, float]) -> Node:
    match tree:
        case ast.Constant(value=value):
            return constant(float(value))
        case ast.Name(id="pi"):
            return Node("pi")
        case ast.Name(id=("r" | "s" | "t") as name):
            return Node("input", (), name)
        case ast.Name(id=name):
            return constant(values[name])
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            return ZERO - _converted(inner, values)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return raised(_converted(left, values), _number(right, values))
        case ast.BinOp(left=left, op=operation, right=right):
            a, b = _converted(left, values), _converted(right, values)
            return {ast.Add: a.__add__, ast.Sub: a.__sub__, ast.Mult: a.__mul__, ast.Div: a.__truediv__}[
                type(operation)
            ](b)
        case ast.Call(func=ast.Name(id="tanh"), args=[inner]):
            return ONE - TWO / (Node("exp", (TWO * _converted(inner, values),)) + ONE)
        case ast.Call(func=ast.Name(id=name), args=[inner]):
            return Node(name, (_converted(inner, values),))
    raise ValueError(ast.dump(tree))


def _number(tree: ast.expr, values: Mapping[str, float]) -> float:
    match tree:
        case ast.Constant(value=value):
            return float(value)
        case ast.Name(id=name):
            return float(values[name])
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            return -_number(inner, values)
    raise ValueError(ast.dump(tree))


def derivative(node: Node, name: str) -> Node:
    """Derivative with respect to an input."""
    match node.operation, node.arguments:
        case "constant" | "pi", _:
            return ZERO
        case "input", _:
            return ONE if node.value == name else ZERO
        case "add", (a, b):
            return derivative(a, name) + derivative(b, name)
        case "subtract", (a, b):
            return derivative(a, name) - derivative(b, name)
        case "multiply", (a, b):
            return derivative(a, name) * b + a * derivative(b, name)
        case "divide", (a, b):
            return derivative(a, name) / b - a * derivative(b, name) / (b * b)
        case "sqrt", (a,):
            return derivative(a, name) / (TWO * node)
        case "exp", (a,):
            return node * derivative(a, name)
        case "log", (a,):
            return derivative(a, name) / a
        case "power", (a,):
            exponent = float(node.value)
            return constant(exponent) * raised(a, exponent - 1.0) * derivative(a, name)
        case "sin", (a,):
            return Node("cos", (a,)) * derivative(a, name)
        case "cos", (a,):
            return (ZERO - Node("sin", (a,))) * derivative(a, name)
    raise ValueError(node.operation)


def force_over_distance(energy: Node) -> Node:
    """psi'(r)/r of an energy in ``r`` or in ``s`` = r^2: the force on an agent is this times the offset."""
    by_r, by_s = derivative(energy, "r"), derivative(energy, "s")
    return (by_r / R if by_r != ZERO else ZERO) + TWO * by_s


class Tape:
    """Operations in the order in which they can be worked off, without repetitions.

    Each is a row (operation, first argument, second argument, value): an input's value is the number of its name.
    """

    def __init__(self) -> None:
        self.rows: list[tuple[int, int, int, float]] = []
        self._known: dict[Node, int] = {}

    def place(self, node: Node) -> int:
        """Number of the row that holds the node; it is written when it is new."""
        if node in self._known:
            return self._known[node]
        arguments = [self.place(a) for a in node.arguments]
        if node.operation in ("sin", "cos"):
            # Each needs the other: both follow from one row after the other.
            for k, name in enumerate(("sin", "cos")):
                first = len(self.rows)
                self.rows.append((OPERATIONS.index(name), arguments[0], first + 1 - 2 * k, 0.0))
                self._known[Node(name, node.arguments)] = first
            return self._known[node]
        value = float("rst".index(str(node.value))) if node.operation == "input" else float(node.value)
        first, second = [*arguments, -1, -1][:2]
        self.rows.append((OPERATIONS.index(node.operation), first, second, value))
        self._known[node] = len(self.rows) - 1
        return self._known[node]
