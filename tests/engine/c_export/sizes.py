"""Values of printed statements, each with the sum of the absolute values of all that it adds up, to first order.

What is added within a product or a function counts by what it moves there: a sum that cancels inside a function rounds
as its addends do. The size of a result is that of its own rounding too, so that the error of a computation is a few
roundings of the size.
"""

from __future__ import annotations

import ast
import math
from dataclasses import dataclass

from flocking.formula.c_source import constant


@dataclass(frozen=True)
class Sized:
    """A value and its size."""

    value: float
    size: float

    @classmethod
    def of(cls, value):
        return cls(float(value), abs(float(value)))

    def __float__(self):
        return self.value

    def __neg__(self):
        return Sized(-self.value, self.size)

    def __add__(self, other):
        return _joined(ast.Add(), self, _as_sized(other))

    def __sub__(self, other):
        return _joined(ast.Sub(), self, _as_sized(other))

    def __mul__(self, other):
        return _joined(ast.Mult(), self, _as_sized(other))

    __rmul__ = __mul__

    def __rsub__(self, other):
        return _joined(ast.Sub(), _as_sized(other), self)

    def __truediv__(self, other):
        return _joined(ast.Div(), self, _as_sized(other))

    def __pow__(self, other):
        return _joined(ast.Pow(), self, _as_sized(other))


def _as_sized(x):
    return x if isinstance(x, Sized) else Sized.of(x)


def root(x):
    """The square root."""
    return _functions(x)["sqrt"]()


def _made(value, *moved):
    return Sized(value, abs(value) + sum(moved))


def _functions(x):
    v = x.value
    return {
        "sqrt": lambda: _made(math.sqrt(v), 0.5 * x.size / math.sqrt(v) if v else 0.0),
        "exp": lambda: _made(math.exp(v), math.exp(v) * x.size),
        "log": lambda: _made(math.log(v), x.size / v),
        "sin": lambda: _made(math.sin(v), abs(math.cos(v)) * x.size),
        "cos": lambda: _made(math.cos(v), abs(math.sin(v)) * x.size),
        "fabs": lambda: Sized(abs(v), x.size),
    }


def _joined(sign, a, b):
    match sign:
        case ast.Add():
            return Sized(a.value + b.value, a.size + b.size)
        case ast.Sub():
            return Sized(a.value - b.value, a.size + b.size)
        case ast.Mult():
            return _made(a.value * b.value, abs(a.value) * b.size, a.size * abs(b.value))
        case ast.Div():
            value = a.value / b.value
            return _made(value, a.size / abs(b.value), abs(value) * b.size / abs(b.value))
        case ast.Pow():
            value = a.value**b.value
            moved = abs(b.value * value / a.value) * a.size if a.value else 0.0
            return _made(value, moved, abs(value * math.log(a.value)) * b.size if a.value > 0.0 else 0.0)
    raise AssertionError(sign)


def sized(node, values):
    """Value and size of an expression."""
    known = constant(node)
    if known is not None:
        return Sized.of(known)
    match node:
        case ast.Name(id=name):
            return values[name]
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            x = sized(inner, values)
            return Sized(-x.value, x.size)
        case ast.BinOp(left=left, op=sign, right=right):
            return _joined(sign, sized(left, values), sized(right, values))
        case ast.IfExp(test=test, body=yes, orelse=no):
            return sized(yes if true(test, values) else no, values)
        case ast.Call(func=ast.Attribute(attr=name), args=[inner]):
            return _functions(sized(inner, values))[name]()
    raise AssertionError(ast.unparse(node))


def true(test, values):
    """Whether a condition holds."""
    match test:
        case ast.Constant(value=value):
            return value
        case ast.BoolOp(op=op, values=parts):
            return (all if isinstance(op, ast.And) else any)(true(x, values) for x in parts)
        case ast.Compare(left=left, ops=[sign], comparators=[right]):
            a, b = sized(left, values).value, sized(right, values).value
            holds = {ast.Lt: a < b, ast.LtE: a <= b, ast.Gt: a > b, ast.GtE: a >= b, ast.Eq: a == b, ast.NotEq: a != b}
            return holds[type(sign)]
    raise AssertionError(ast.unparse(test))


def run(lines, values):
    """Values of all statements, beside those that are given."""
    found = dict(values)
    for line in lines:
        (node,) = ast.parse(line).body
        found[node.targets[0].id] = sized(node.value, found)
    return found
