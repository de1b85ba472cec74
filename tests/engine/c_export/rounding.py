"""Bounds of the errors of an exported law in single precision, computed from the state alone by interval arithmetic.

The printed statements are evaluated in intervals of double precision. Every operation is widened by one rounding of
single precision, so that an interval holds the exact result and the one of single precision alike: its width bounds
their difference.
"""

from __future__ import annotations

import ast

import numpy as np

from flocking.engine.c_export.elementary_functions import BOUNDS
from flocking.engine.c_export.exported_law import exported_law
from flocking.engine.kernels.pieces import held
from flocking.engine.kernels.source_text import nonzero
from flocking.formula.c_source import constant
from flocking.formula.intervals import Interval
from flocking.formula.printing import statements

ROUNDING, SMALLEST = 2.0**-24, 2.0**-149


def of(value):
    """A number that single precision rounds once."""
    return rounded(Interval.of(np.array([float(value)])))


def rounded(x, units=1.0):
    """An interval widened by roundings of single precision."""

    def wide(end):
        return np.abs(end) * ROUNDING * units * (1 + 1e-9) + SMALLEST

    return Interval(x.lo - wide(x.lo), x.hi + wide(x.hi))


class Evaluation:
    """Statements in intervals."""

    def __init__(self, values):
        self.values = dict(values)

    def run(self, lines):
        for line in lines:
            (node,) = ast.parse(line).body
            self.values[node.targets[0].id] = self.expression(node.value)

    def expression(self, node):
        known = constant(node)
        if known is not None:
            return of(known)
        match node:
            case ast.Name(id=name):
                return self.values[name]
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                return -self.expression(inner)
            case ast.BinOp(left=base, op=ast.Pow(), right=exponent):
                return self.power(self.expression(base), constant(exponent), exponent)
            case ast.BinOp(left=left, op=sign, right=right):
                a, b = self.expression(left), self.expression(right)
                operation = {ast.Add: a.__add__, ast.Sub: a.__sub__, ast.Mult: a.__mul__, ast.Div: a.__truediv__}
                return rounded(operation[type(sign)](b))
            case ast.IfExp(test=test, body=yes, orelse=no):
                return self.chosen(test, yes, no)
            case ast.Call(func=ast.Attribute(attr=name), args=[inner]):
                x = self.expression(inner)
                found = getattr(x, name)()
                if name in ("sin", "cos"):
                    slack = 2 * ROUNDING * BOUNDS[name][0]
                    return Interval(found.lo - slack, found.hi + slack)
                return rounded(found, 2 * BOUNDS[name][0])
        raise AssertionError(ast.unparse(node))

    def power(self, base, exponent, node):
        if exponent is None:
            # exp(b log a), whose error is stated as that of one function.
            found = (self.expression(node) * base.log()).exp()
            return rounded(found, 2 * BOUNDS["pow"][0])
        whole, half = divmod(abs(round(2 * exponent)), 2)
        assert abs(2 * exponent) == 2 * whole + half
        found = base.power(whole) if whole else Interval.of(np.array([1.0]))
        found = rounded(found, max(whole - 1, 0))
        if half:
            root = rounded(base.sqrt())
            found = rounded(found * root) if whole else root
        return rounded(found.reciprocal()) if exponent < 0 else found

    def chosen(self, test, yes, no):
        if isinstance(test, ast.Constant):
            return self.expression(yes if test.value else no)
        verdict = self.truth(test)
        if verdict is not None:
            return self.expression(yes if verdict else no)
        a, b = self.expression(yes), self.expression(no)
        return Interval(np.minimum(a.lo, b.lo), np.maximum(a.hi, b.hi))

    def truth(self, test):
        """True, False, or None where the interval does not say."""
        match test:
            case ast.Compare(left=left, ops=[sign], comparators=[right]):
                a, b = self.expression(left), self.expression(right)
                if isinstance(sign, ast.Gt | ast.GtE):
                    a, b = b, a
                return True if a.hi[0] < b.lo[0] else False if a.lo[0] > b.hi[0] else None
        raise AssertionError(ast.unparse(test))


def enclosed_force(scenario, agent, q, p, others, linked, now):
    """Intervals that hold the exact force and that of single precision, for a state of single precision."""
    law = exported_law(scenario, neighbours=1)
    m = law.m
    assert not law.changes
    assert not any(law.scenario.space.lengths)
    total = [Interval.of(np.array([0.0])) for _ in range(m)]
    # Whole seconds and nanoseconds are rounded a few times.
    t = rounded(Interval.of(np.array([scenario.start.t + now * 1e-9])), 5)
    common = {"t": t} | {f"P{k}": of(x) for k, x in enumerate(law.P[0])}
    common |= {f"A{k}": of(row[agent]) for k, row in enumerate(law.A[0])}
    common |= {f"q{k}": Interval.of(np.array([q[k]])) for k in range(m)}
    common |= {f"p{k}": Interval.of(np.array([p[k]])) for k in range(m)}
    for number, pair in enumerate(law.formulas.pairs):
        chosen, _ = held(nonzero({"along": pair.along, "drag": pair.drag}), "r")
        lines = statements(chosen, arrays=False, prefix=f"g{number}_")
        for j in sorted(linked[number]):
            x, v = others[j]
            d = [rounded(Interval.of(np.array([float(x[k]) - float(q[k])]))) for k in range(m)]
            w = [rounded(Interval.of(np.array([float(v[k]) - float(p[k])]))) for k in range(m)]
            square = _sum([rounded(a * a) for a in d])
            r = rounded(square.sqrt())
            values = common | {"r": r, "side": r, "reach": r, "speed2": _sum([rounded(a * a) for a in w])}
            values["radial"] = rounded(_sum([rounded(a * b) for a, b in zip(d, w, strict=True)]) / r)
            values |= {f"W{k}": of(matrix[agent, j]) for k, matrix in enumerate(law.W)}
            values["functional"] = of(1.0 / (1.0 + len(linked[number])))
            found = Evaluation(values)
            found.run(lines)
            for k in range(m):
                parts = []
                if "along" in chosen:
                    parts.append(rounded(rounded(found.values["along"] / r) * d[k]))
                if "drag" in chosen:
                    parts.append(rounded(found.values["drag"] * w[k]))
                total[k] = rounded(total[k] + _sum(parts))
    chosen = nonzero({f"force{k}": f for k, f in enumerate(law.formulas.body.force)})
    found = Evaluation(common)
    found.run(statements(chosen, arrays=False, prefix="b_"))
    return [rounded(total[k] + found.values[f"force{k}"]) if f"force{k}" in chosen else total[k] for k in range(m)]


def _sum(parts):
    found, *rest = parts
    for part in rest:
        found = rounded(found + part)
    return found
