"""The emitted C itself, evaluated with numbers of another kind: its text becomes functions of Python.

Numbers of the law are intervals, or of many digits; whole numbers are those of Python. The functions whose error is
stated are given with the kind of numbers; all others are translated, statement by statement. Where intervals do not
decide a condition, a choice of two numbers gives the hull of both, and a branch is gone both ways: see `Law.outcomes`.
"""

from __future__ import annotations

import copy
import re

import numpy as np
from pycparser import c_ast, c_parser

from tests.engine.c_export.single_intervals import Unbounded

MOST_WAYS = 64
FUNCTIONS = ("sqrt", "exp", "log", "pow", "sin", "cos", "floor", "fabs", "copysign")
"""Functions that each kind of numbers has."""

PARTS = ("two_to", "nan", "nearest", "exp_of", "log_of", "product_rest", "circular")
"""What the functions of stated errors are made of: they take numbers apart, bit by bit."""

INTEGERS = {f"{sign}int{bits}_t": bits for sign in ("u", "") for bits in (8, 16, 32, 64)}
PRELUDE = "".join(f"typedef {'unsigned ' if name[0] == 'u' else ''}int {name};\n" for name in INTEGERS)


class Law:
    """An exported law, from its header and source.

    Parameters
    ----------
    files
        Texts of the exported files.
    numbers
        The kind of numbers: what has `FUNCTIONS`, and `literal`, `whole`, `hull`, `square`, `smaller` and `larger`.
    """

    def __init__(self, files, numbers, name="law"):
        self.name, self.ways = name, _Ways()
        tree = c_parser.CParser().parse(_plain(files[f"{name}.h"] + files[f"{name}.c"]))
        writer = _Translation(tree, name, numbers)
        self.values = writer.constants | vars(_Operations(self.ways, numbers))
        self.values |= {f"F_{name}_{key}": getattr(numbers, key) for key in FUNCTIONS}
        exec(compile("\n".join(writer.lines), f"<{name}.c in Python>", "exec"), self.values)

    def make(self, structure):
        """A structure of zeros."""
        return self.values[f"make_{self.name}_{structure}"]()

    def call(self, function, *arguments):
        """Result of a function."""
        return self.values[f"F_{self.name}_{function}"](*arguments)

    def outcomes(self, run):
        """Results of `run()`, one for each way through the branches that intervals do not decide.

        Raises
        ------
        Unbounded
            Where a result may be infinite, or the ways are too many.
        """
        found, open_ways = [], [[]]
        while open_ways:
            way = self.ways.begin(open_ways.pop())
            found.append(run())
            open_ways += [[*way[:k], False] for k in range(self.ways.given, len(way))]
            if len(found) + len(open_ways) > MOST_WAYS:
                raise Unbounded
        return found


class _Ways:
    """Which way is gone at each branch that is not decided."""

    def begin(self, way):
        self.given, self.way, self.at = len(way), way, 0
        return self.way

    def next(self):
        if self.at == len(self.way):
            self.way.append(True)
        self.at += 1
        return self.way[self.at - 1]


class _Operations:
    """What translated functions call."""

    def __init__(self, ways, numbers):
        def decided(condition):
            return ways.next() if condition is None else bool(condition)

        def chosen(condition, yes, no):
            if condition is not None:
                return yes() if condition else no()
            a, b = yes(), no()
            if isinstance(a, int):
                return a if ways.next() else b
            return numbers.hull(a, b)

        def real(x):
            return numbers.whole(x) if isinstance(x, int) else x

        self.decided, self.chosen, self.copied = decided, chosen, copy.copy
        self.real, self.both, self.either, self.opposite, self.quotient = real, _both, _either, _opposite, _quotient
        self.smaller, self.larger, self.square = numbers.smaller, numbers.larger, numbers.square


def _both(a, rest):
    if a is not None and not a:
        return False
    b = rest()
    return False if b is not None and not b else None if a is None or b is None else True


def _either(a, rest):
    return _opposite(_both(_opposite(a), lambda: _opposite(rest())))


def _opposite(a):
    return None if a is None else not a


def _quotient(a, b):
    if not isinstance(a, int):
        return a / b
    assert a >= 0 < b
    return a // b


def _plain(text):
    """Source without comments and directives, its macros written out."""
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.S)
    macros = {"UINT32_MAX": "4294967295u"}
    for kind, of in (("FLT", np.float32), ("DBL", np.float64)):
        macros |= {f"{kind}_MAX": repr(float(np.finfo(of).max)), f"{kind}_MIN": repr(float(np.finfo(of).tiny))}
    for line in re.findall(r"^#define .*$", text, flags=re.M):
        _, key, *value = line.split(None, 2)
        macros[key] = value[0] if value else ""
    text = re.sub(r"^#.*$", "", text, flags=re.M)
    text = re.sub(r"INT64_C\((\d+)\)", r"\1", text)
    for _ in range(2):
        text = re.sub(r"\b[A-Z_][A-Z0-9_]*\b", lambda m: macros.get(m[0], m[0]), text)
    return PRELUDE + text


class _Translation:
    """Lines of Python for a source."""

    def __init__(self, tree, name, numbers):
        self.real, self.own = f"{name}_real", {f"{name}_{key}" for key in (*FUNCTIONS, *PARTS)}
        self.lines, self.constants, self.literal = [], {"ZERO": numbers.literal(0.0)}, numbers.literal
        for node in tree.ext:
            match node:
                case c_ast.FuncDef(decl=c_ast.Decl(name=f)):
                    if f not in self.own:
                        self.function(node)
                case c_ast.Typedef(type=c_ast.TypeDecl(type=c_ast.Struct(decls=fields))):
                    self.structure(node.name, fields)
                case c_ast.Decl(type=c_ast.Enum(values=listed)):
                    for k, entry in enumerate(listed.enumerators):
                        self.lines.append(f"v_{entry.name} = {k if entry.value is None else self.of(entry.value)}")
                case c_ast.Decl(type=c_ast.ArrayDecl()):
                    self.declaration(node, "")
                case c_ast.Typedef() | c_ast.Decl(type=c_ast.FuncDecl()):
                    pass
                case _:
                    raise AssertionError(node)

    def structure(self, name, fields):
        self.lines += [f"class {name}:", "    pass", f"def make_{name}():", f"    made = {name}()"]
        self.lines += [f"    made.{x.name} = {self.zero(x.type)}" for x in fields] + ["    return made"]

    def zero(self, kind):
        """Source of what a declaration without a value holds."""
        match kind:
            case c_ast.ArrayDecl(type=inner, dim=count):
                return f"[{self.zero(inner)} for _ in range({self.of(count)})]"
            case c_ast.TypeDecl(type=c_ast.IdentifierType(names=[name])):
                return "ZERO" if name == self.real else "0" if name in INTEGERS else f"make_{name}()"
            case c_ast.PtrDecl():
                return "None"
        raise AssertionError(kind)

    def function(self, node):
        arguments = getattr(node.decl.type.args, "params", [])
        names = [f"v_{x.name}" for x in arguments if x.name]
        self.lines.append(f"def F_{node.decl.name}({', '.join(names)}):")
        self.block(node.body, "    ")

    def block(self, node, space):
        if isinstance(node, c_ast.Compound):
            for item in node.block_items or []:
                self.statement(item, space)
            self.lines.append(f"{space}pass")
        else:
            self.statement(node, space)

    def statement(self, node, space):
        add, of = self.lines.append, self.of
        match node:
            case c_ast.Decl():
                self.declaration(node, space)
            case c_ast.Compound():
                self.block(node, space)
            case c_ast.Assignment(op="=", lvalue=left, rvalue=right):
                value = f"copied({of(right)})" if isinstance(right, c_ast.UnaryOp) and right.op == "*" else of(right)
                add(f"{space}{of(left)} = {value}")
            case c_ast.Assignment(op=sign, lvalue=left, rvalue=right):
                joined = c_ast.BinaryOp(sign[:-1], left, right)
                add(f"{space}{of(left)} = {of(joined)}")
            case c_ast.UnaryOp(op="p++" | "p--" as sign, expr=inner):
                add(f"{space}{of(inner)} {sign[-1]}= 1")
            case c_ast.If(cond=test, iftrue=yes, iffalse=no):
                add(f"{space}if decided({of(test)}):")
                self.block(yes, space + "    ")
                if no is not None:
                    add(f"{space}else:")
                    self.block(no, space + "    ")
            case c_ast.For(init=first, cond=test, next=step, stmt=body):
                self.statement(first, space)
                add(f"{space}while decided({of(test)}):")
                self.block(body, space + "    ")
                self.statement(step, space + "    ")
            case c_ast.While(cond=test, stmt=body):
                add(f"{space}while decided({of(test)}):")
                self.block(body, space + "    ")
            case c_ast.Return(expr=value):
                add(f"{space}return {'' if value is None else of(value)}")
            case c_ast.Break():
                add(f"{space}break")
            case c_ast.FuncCall():
                add(f"{space}{of(node)}")
            case c_ast.Cast() | c_ast.EmptyStatement():
                pass
            case _:
                raise AssertionError(node)

    def declaration(self, node, space):
        value = self.zero(node.type) if node.init is None else self.of(node.init)
        self.lines.append(f"{space}v_{node.name} = {value}")

    def of(self, node):
        """Source of an expression."""
        of = self.of
        match node:
            case c_ast.Constant(type=kind, value=value):
                return self.number(kind, value)
            case c_ast.ID(name=name):
                return f"v_{name}"
            case c_ast.InitList(exprs=parts):
                return f"[{', '.join(of(x) for x in parts)}]"
            case c_ast.ArrayRef(name=array, subscript=place):
                return f"{of(array)}[{of(place)}]"
            case c_ast.StructRef(name=whole, field=field):
                return f"{of(whole)}.{field.name}"
            case c_ast.FuncCall(name=c_ast.ID(name=name), args=given):
                return f"F_{name}({', '.join(of(x) for x in getattr(given, 'exprs', []))})"
            case c_ast.Cast(to_type=kind, expr=inner):
                return self.cast(kind.type.type.names[0], of(inner))
            case c_ast.UnaryOp(op=sign, expr=inner):
                return {"-": "(-{})", "+": "{}", "!": "opposite({})", "~": "(~{})", "&": "{}", "*": "{}"}[sign].format(
                    of(inner)
                )
            case c_ast.BinaryOp(op=sign, left=left, right=right):
                return self.joined(sign, of(left), of(right))
            case c_ast.TernaryOp(cond=test, iftrue=yes, iffalse=no):
                return self.choice(test, of(yes), of(no))
        raise AssertionError(node)

    def number(self, kind, value):
        if kind not in ("float", "double"):
            return str(int(value.rstrip("uUlL"), 0))
        value = float(value.rstrip("fF"))
        key = "ZERO" if value == 0.0 else f"N_{value!r}".replace(".", "_").replace("-", "m").replace("+", "")
        self.constants.setdefault(key, self.literal(value))
        return key

    def cast(self, kind, inner):
        if kind in (self.real, "double"):
            return f"real({inner})"
        return f"({inner} & {2 ** INTEGERS[kind] - 1})" if kind[0] == "u" else inner

    def joined(self, sign, a, b):
        if sign in ("&&", "||"):
            return f"{'both' if sign == '&&' else 'either'}({a}, lambda: {b})"
        if sign == "/":
            return f"quotient({a}, {b})"
        return f"square({a})" if sign == "*" and a == b else f"({a} {sign} {b})"

    def choice(self, test, yes, no):
        """A choice of the smaller or larger of two numbers is one operation."""
        if (
            isinstance(test, c_ast.BinaryOp)
            and test.op in "<>"
            and {yes, no} == {self.of(test.left), self.of(test.right)}
        ):
            first = yes == self.of(test.left)
            return f"{'smaller' if (test.op == '<') == first else 'larger'}({yes}, {no})"
        return f"chosen({self.of(test)}, lambda: {yes}, lambda: {no})"
