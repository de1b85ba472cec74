"""The grammar of text formulas: arithmetic, a few functions, and ``where``.

A formula is parsed to a tree of allowed nodes before anything else reads it. Python never evaluates it, so no formula
can run code.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

from flocking.errors import FormulaError
from flocking.formula.growth import excess
from flocking.formula.syntax_trees import parsed

FUNCTIONS: dict[str, int] = {
    "sqrt": 1, "exp": 1, "log": 1, "sin": 1, "cos": 1, "tan": 1, "atan": 1,
    "sinh": 1, "cosh": 1, "tanh": 1, "abs": 1, "where": 3,
}  # fmt: skip
"""Functions a formula may call, with their number of arguments."""

CONSTANTS: dict[str, float] = {"pi": math.pi}
"""Names with a fixed value."""

RESERVED = frozenset({"math", "numpy"})
"""Names generated code needs for itself."""

LARGEST_NUMBER = 1e100
"""Numbers in formulas and exact numbers that follow from them: products of three are finite in double precision."""

LONGEST_TEXT = 10_000
"""Characters of a formula, a bound on the work of reading it."""
DEEPEST_NESTING = 60
"""Nested brackets of a formula: far below the depth at which the parser of Python gives up."""
MOST_NODES = 600
"""Operations of a formula. Of its derivatives, on which the time depends, see `flocking.formula.growth`."""
DEEPEST_CALLS = 12
"""Functions within functions: the derivative of each is a product over all those around it."""
LARGEST_EXPONENT = 64
"""Largest exponent that is a number: it bounds the exact numbers that powers of numbers come to."""
LARGEST_NESTED_EXPONENT = 256
"""Largest product of the exponents of powers of powers, for the same reason."""

MOST_REMEMBERED = 1024
"""Formulas of which it is stored whether they have pieces: a law whose numbers change is asked again and again."""

_BINARY = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}
_COMPARISON = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}

Node = tuple[object, ...]
"""A parsed formula: nested tuples ``("number", x)``, ``("name", s)``, ``(operator, left, right)``,
``("call", function, arguments...)`` and ``("compare", operator, left, right)``."""


@dataclass(frozen=True)
class Formula:
    """A formula in text form, checked against the grammar.

    Parameters
    ----------
    text
        Arithmetic on names and numbers with ``+ - * / **`` (``^`` is read as ``**``), the functions in
        `FUNCTIONS`, of which ``log`` is the natural logarithm, and ``where(condition, value_if_true, value_if_false)``.
        It means what SymPy simplifies it to: ``sqrt(x)**2`` is x and ``x/x`` is 1, for negative x and zero too.
    owner
        Who owns the formula; used in error messages.

    Raises
    ------
    FormulaError
        When the text is not in the grammar; the message states which part and why.
    """

    text: str
    owner: str = field(default="formula", compare=False)

    def __post_init__(self) -> None:
        if not isinstance(self.text, str):
            raise FormulaError(self.owner, "formula", "must be text", self.text)
        self.tree  # noqa: B018  the parse is the validation

    @cached_property
    def tree(self) -> Node:
        """The parsed formula as nested tuples."""
        return parse(self.text, self.owner)

    def with_parts(self, parts: Mapping[str, Node]) -> Formula:
        """The formula with trees in place of some of its names, all at once; nothing is parsed again.

        Parameters
        ----------
        parts
            Trees by name.

        Raises
        ------
        FormulaError
            When it becomes larger or deeper than a formula may be.
        """
        tree = _with_parts(self.tree, parts)
        text = render(tree)
        _check_tree(tree, text, self.owner)
        found = object.__new__(Formula)
        vars(found).update(text=text, owner=self.owner, tree=tree)
        return found

    @cached_property
    def names(self) -> frozenset[str]:
        """Free names of the formula: its variable and its parameters."""
        return frozenset(_names(self.tree))

    @cached_property
    def structure(self) -> str:
        """A canonical text of the parsed tree: equal formulas have equal structures."""
        return render(self.tree)


def _reject(owner: str, text: str, rule: str, fix: str = "") -> FormulaError:
    return FormulaError(owner, "formula", rule, text, fix)


def parse(text: str, owner: str = "formula") -> Node:
    """Parse ``text`` into a tree of allowed nodes.

    Raises
    ------
    FormulaError
        When the text is too long, too deep, not arithmetic, or calls something unknown.
    """
    if not text.strip():
        raise _reject(owner, text, "must not be empty")
    if len(text) > LONGEST_TEXT:
        raise _reject(owner, text, f"must have at most {LONGEST_TEXT} characters")
    if "#" in text:
        raise _reject(owner, text, "must hold no comment: what follows # would be left out", "Write it outside.")
    depth = deepest = 0
    for letter in text:
        depth += (letter in "([{") - (letter in ")]}")
        deepest = max(deepest, depth)
    if deepest > DEEPEST_NESTING:
        raise _reject(owner, text, f"must not nest deeper than {DEEPEST_NESTING} brackets")
    try:
        tree = parsed(text.replace("^", "**").strip(), "eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        reason = error.msg if isinstance(error, SyntaxError) else type(error).__name__
        raise _reject(owner, text, f"does not parse ({reason})", "Write it like 1/r + 1/(R - r).") from None
    try:
        if sum(1 for _ in ast.walk(tree)) > MOST_NODES * 3:
            raise _reject(owner, text, f"must have at most {MOST_NODES} operations")
        if _height(tree) > 2 * DEEPEST_NESTING:
            raise _reject(owner, text, "is nested too deeply")
        found = _convert(tree.body, text, owner)
    except RecursionError:
        raise _reject(owner, text, "is nested too deeply") from None
    if _calls(found) > DEEPEST_CALLS:
        raise _reject(owner, text, f"must not nest more than {DEEPEST_CALLS} functions in each other")
    if rule := excess(found):
        raise _reject(owner, text, rule)
    return found


def _calls(node: Node) -> int:
    """Largest depth of nested function calls."""
    inner = max((_calls(child) for child in node if isinstance(child, tuple)), default=0)
    return inner + (node[0] == "call")


def _height(tree: ast.AST) -> int:
    level: list[ast.AST] = [tree]
    height = 0
    while level:
        level = [child for node in level for child in ast.iter_child_nodes(node)]
        height += 1
    return height


def _with_parts(node: Node, parts: Mapping[str, Node]) -> Node:
    if node[0] == "name":
        return parts.get(str(node[1]), node)
    return tuple(_with_parts(child, parts) if isinstance(child, tuple) else child for child in node)


def _check_tree(tree: Node, text: str, owner: str) -> None:
    """Check a tree for the rules that `parse` checks for a text."""
    size, height = _extent(tree)
    if len(text) > LONGEST_TEXT:
        raise _reject(owner, text, f"must have at most {LONGEST_TEXT} characters")
    if size >= MOST_NODES * 3:
        raise _reject(owner, text, f"must have at most {MOST_NODES} operations")
    if height >= 2 * DEEPEST_NESTING:
        raise _reject(owner, text, "is nested too deeply")
    if _calls(tree) > DEEPEST_CALLS:
        raise _reject(owner, text, f"must not nest more than {DEEPEST_CALLS} functions in each other")
    if rule := excess(tree):
        raise _reject(owner, text, rule)
    for node in _walk(tree):
        if node[0] == "**" and isinstance(node[2], tuple):
            _check_exponent(node[2], text, owner)
        if node[0] in ("**", "call"):
            _check_powers(node, text, owner)
        if node[0] == "/" and isinstance(node[2], tuple) and constant_value(node[2]) == 0:
            raise _reject(owner, text, "must not divide by zero")


_OWN_SIZES = {"number": (1, 1), "name": (2, 2), "call": (3, 1)}


def _extent(node: Node) -> tuple[int, int]:
    """Number and height of the nodes that Python's own parser makes of the same formula."""
    size, height = _OWN_SIZES.get(str(node[0]), (2, 1))
    inner = [_extent(child) for child in node if isinstance(child, tuple)]
    named = [2] if node[0] == "call" else []
    return size + sum(s for s, _ in inner), height + max([h for _, h in inner] + named, default=0)


def _convert(node: ast.expr, text: str, owner: str) -> Node:
    match node:
        case ast.Constant(value=bool()):
            raise _reject(owner, text, "must not contain True or False")
        case ast.Constant(value=(int() | float()) as value):
            if not abs(value) <= LARGEST_NUMBER:  # NaN and integers beyond floats included
                raise _reject(owner, text, "must have finite numbers below 1e100")
            return ("number", value)
        case ast.Name(id=name):
            if name.startswith("_") or name in RESERVED:
                raise _reject(owner, text, f"must not use the name {name!r}")
            if name in FUNCTIONS:
                raise _reject(owner, text, f"uses the function {name} without arguments")
            return ("name", name)
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            return ("-", ("number", 0), _convert(inner, text, owner))
        case ast.UnaryOp(op=ast.UAdd(), operand=inner):
            return _convert(inner, text, owner)
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _BINARY:
            sign = _BINARY[type(operator)]
            pair = (sign, _convert(left, text, owner), _convert(right, text, owner))
            if sign == "**":
                _check_exponent(pair[2], text, owner)
                _check_powers(pair, text, owner)
            if sign == "/" and constant_value(pair[2]) == 0:
                raise _reject(owner, text, "must not divide by zero")
            return pair
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            return _convert_call(name, arguments, text, owner)
        case ast.Call(func=ast.Name(id=name)):
            known = ", ".join(sorted(FUNCTIONS))
            raise _reject(owner, text, f"calls {name!r}, which is not known", f"Known: {known}.")
        case _:
            raise _reject(
                owner, text, f"contains {type(node).__name__}, which formulas may not",
                "Use + - * / **, numbers, names, functions and where(...).",
            )  # fmt: skip


def _convert_call(name: str, arguments: list[ast.expr], text: str, owner: str) -> Node:
    if len(arguments) != FUNCTIONS[name]:
        raise _reject(owner, text, f"calls {name} with {len(arguments)} arguments, not {FUNCTIONS[name]}")
    if name != "where":
        call: Node = ("call", name, *(_convert(a, text, owner) for a in arguments))
        _check_powers(call, text, owner)
        return call
    condition, *branches = arguments
    match condition:
        case ast.Compare(left=left, ops=[operator], comparators=[right]) if type(operator) in _COMPARISON:
            sides = (_convert(left, text, owner), _convert(right, text, owner))
            test: Node = ("compare", _COMPARISON[type(operator)], *sides)
        case _:
            raise _reject(owner, text, "needs one comparison such as r < R as the first argument of where")
    return ("call", "where", test, *(_convert(b, text, owner) for b in branches))


def _check_exponent(node: Node, text: str, owner: str) -> None:
    value = constant_value(node)
    if value is not None and abs(value) > LARGEST_EXPONENT:
        raise _reject(owner, text, f"must have exponents of at most {LARGEST_EXPONENT}")
    if value is None and any(part[0] == "**" or _power_in_disguise(part) for part in _walk(node)):
        raise _reject(owner, text, "must not have powers inside an exponent")


def _check_powers(node: Node, text: str, owner: str) -> None:
    if _total_exponent(node) > LARGEST_NESTED_EXPONENT:
        rule = f"must have powers of powers that multiply to at most {LARGEST_NESTED_EXPONENT}"
        raise _reject(owner, text, rule, "exp(n*log(x)) is such a power, too.")


def _power_in_disguise(node: Node) -> bool:
    """Whether a node is exp of an expression with a logarithm: exp(n*log(x)) is x**n."""
    return node[:2] == ("call", "exp") and any(part[:2] == ("call", "log") for part in _walk(node))


def _total_exponent(node: Node) -> float:
    """Largest product of exponents on a path: exact arithmetic takes time and memory in proportion to it."""
    inner = max((_total_exponent(child) for child in node if isinstance(child, tuple)), default=1.0)
    if _power_in_disguise(node) and isinstance(node[2], tuple):
        return inner * _multiplier(node[2])
    value = constant_value(node[2]) if node[0] == "**" and isinstance(node[2], tuple) else None
    return inner if value is None else inner * max(1.0, abs(value))


def _multiplier(node: Node) -> float:
    """Bound on the integer by which an exponent multiplies the logarithms in it."""
    match node:
        case ("number", int() as value):
            return max(1.0, abs(float(value)))
        case ("call", "log", *_):
            return 1.0
        case ("+" | "-", tuple() as left, tuple() as right):
            return max(_multiplier(left), _multiplier(right))
        case _:
            product = 1.0
            for child in node:
                if isinstance(child, tuple):
                    product *= _multiplier(child)
            return product


def constant_value(node: Node) -> float | None:
    """Value of a tree made of numbers only, or None where it has names or calls."""
    match node:
        case ("number", int() | float() as value):
            return float(value)
        case ("+" | "-" | "*" | "/" as sign, tuple() as left, tuple() as right):
            a, b = constant_value(left), constant_value(right)
            if a is None or b is None:
                return None
            if sign == "/":
                return a / b if b else math.inf
            return a + b if sign == "+" else a - b if sign == "-" else a * b
        case ("**", tuple(), tuple()):
            return math.inf
        case _:
            return None


def _walk(node: Node) -> Iterator[Node]:
    yield node
    for child in node:
        if isinstance(child, tuple):
            yield from _walk(child)


def _names(node: Node) -> Iterator[str]:
    for part in _walk(node):
        if part[0] == "name" and part[1] not in CONSTANTS:
            yield str(part[1])


@lru_cache(maxsize=MOST_REMEMBERED)
def has_pieces(tree: Node) -> bool:
    """Whether a formula of this ``tree`` may consist of pieces: by ``where`` or ``abs``, or as a root of a power."""
    return any(_is_pieced(node) for node in _walk(tree))


def _is_pieced(node: Node) -> bool:
    match node:
        case ("call", "where" | "abs", *_):
            return True
        case ("call", "sqrt", tuple() as base):
            return _is_product(base)
        case ("**", tuple() as base, tuple() as exponent):
            value = constant_value(exponent)
            return _is_product(base) and not (value is not None and value.is_integer())
        case _:
            return _power_in_disguise(node)


def _is_product(node: Node) -> bool:
    return node[0] in ("*", "/", "**") or node[:2] == ("call", "sqrt")


def render(node: Node) -> str:
    """Text of a tree in the grammar, fully bracketed."""
    match node:
        case ("number", value):
            return repr(value)
        case ("name", str() as name):
            return name
        case ("call", str() as name, *arguments):
            return f"{name}({', '.join(render(a) for a in arguments if isinstance(a, tuple))})"
        case ("compare", str() as sign, tuple() as left, tuple() as right):
            return f"{render(left)} {sign} {render(right)}"
        case (str() as sign, tuple() as left, tuple() as right):
            return f"({render(left)} {sign} {render(right)})"
        case _:
            raise AssertionError(f"not a formula node: {node!r}")
