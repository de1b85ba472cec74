"""The cost of a formula and of its first two derivatives, bounded from its tree before any of them is made.

The derivative of a product has a term for each factor, and each term all the other factors: a text of 600 characters
may have a second derivative of millions of operations. SymPy's time grows with these sizes, so that they are bounded,
not the text alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

Node = tuple[object, ...]
"""A parsed formula, see `flocking.formula.grammar`."""

LARGEST_SIZES = 30_000
"""Operations of a formula and its first two derivatives together: SymPy takes a few seconds for them."""
MOST_CALLS = 40
"""Different functions and powers in a formula: at a break or a minimum each is computed with hundreds of digits."""
MOST_CHOICES = 64
"""Sum over all conditions of 4 to the number of calls of where and abs within one: SymPy merges their pieces."""
DEEPEST_SIGNS = 5
"""Sums within sums where SymPy asks for the sign: its answer takes three times as long with each level."""
DEEPEST_QUOTIENTS = 8
"""Quotients whose denominators have quotients in them, for the same reason."""

GROUP = 6
"""Factors of a product to which the product rule is applied at once; longer ones are products of groups.

No formula of a paper has more, so that their derivatives are written as SymPy writes them.
"""


def excess(tree: Node) -> str | None:
    """The rule that a formula breaks by the time it would take; None where it breaks none.

    Parameters
    ----------
    tree
        The parsed formula, nested no deeper than the grammar allows.
    """
    if len(set(_calls(tree))) > MOST_CALLS:
        return f"must have at most {MOST_CALLS} different functions, powers other than by an integer among them"
    if _choices(tree)[1] > MOST_CHOICES:
        return "must have fewer calls of where and abs within the conditions of where, and within abs"
    found = depths(tree)
    if found.signs > DEEPEST_SIGNS:
        where = "log, sqrt, abs, a power or a condition"
        return f"must not nest more than {DEEPEST_SIGNS} sums in each other within {where}"
    if found.quotients > DEEPEST_QUOTIENTS:
        return f"must not nest more than {DEEPEST_QUOTIENTS} quotients in each other"
    total = sum(sizes(tree))
    if total > LARGEST_SIZES:
        return (
            f"must have at most {LARGEST_SIZES} operations together with its first two derivatives, "
            f"which would have about {total:.2g}"
        )
    return None


def _calls(node: Node) -> Iterator[Node]:
    """Functions in a formula, and its powers other than by an integer."""
    if node[0] == "call" or (node[0] == "**" and _asks(node)):
        yield node
    for child in node:
        if isinstance(child, tuple):
            yield from _calls(child)


def _choices(node: Node) -> tuple[int, int]:
    """Calls of where and abs in a node, and the sum that `MOST_CHOICES` bounds; abs has a condition, too."""
    found = [_choices(child) for child in node if isinstance(child, tuple)]
    inside, cost = sum(x for x, _ in found), sum(x for _, x in found)
    if node[0] == "compare" or node[:2] == ("call", "abs"):
        cost += 4**inside
    return inside + (node[:2] in (("call", "where"), ("call", "abs"))), cost


class Depths(NamedTuple):
    """Largest numbers of sums and of quotients in each other, and of sums where a sign is asked for."""

    sums: int
    quotients: int
    signs: int


def depths(node: Node, within: str = "") -> Depths:
    """Depths of a formula.

    Parameters
    ----------
    node
        The parsed formula.
    within
        ``"+"`` where it is an addend, which adds to no depth of sums.
    """
    kind = "+" if node[0] in ("+", "-") and not _negated(node) else ""
    found = [depths(child, kind) for child in node if isinstance(child, tuple)]
    sums = max((x.sums for x in found), default=0)
    quotients = max((x.quotients for x in found), default=0)
    signs = max((x.signs for x in found), default=0)
    if kind and within != "+":
        sums += 1
    if node[0] == "/":
        quotients = max(found[0].quotients, found[1].quotients + 1)
    elif node[0] == "**" and isinstance(node[2], tuple) and _negated(node[2]):
        quotients += 1
    if _asks(node):
        signs = max(signs, sums)
    return Depths(sums, quotients, signs)


def _asks(node: Node) -> bool:
    """Whether SymPy asks for signs of what is in a node."""
    match node:
        case ("**", _, ("number", int()) | ("-", ("number", 0), ("number", int()))):
            return False
        case ("**" | "compare", *_) | ("call", "log" | "sqrt" | "abs", _):
            return True
        case _:
            return False


class Sizes(NamedTuple):
    """Operations and operands of a formula, of its derivative and of its second one; 0 where a derivative is zero."""

    value: int
    slope: int
    curvature: int


NUMBER, NAME = Sizes(1, 0, 0), Sizes(1, 1, 0)


def sizes(node: Node) -> Sizes:
    """Bounds of the sizes of a formula and its derivatives by whichever name they are taken.

    Parameters
    ----------
    node
        The parsed formula.
    """
    return product(factors(node)) if node[0] in ("*", "/", "**") or _negated(node) else _single(node)


def product(parts: list[Sizes]) -> Sizes:
    """Sizes of a product, by the rule of `flocking.formula.derivatives`.

    Parameters
    ----------
    parts
        Sizes of its factors.
    """
    while len(parts) > GROUP:
        parts = [_product(parts[k : k + GROUP]) for k in range(0, len(parts), GROUP)]
    return _product(parts)


def _product(parts: list[Sizes]) -> Sizes:
    if len(parts) == 1:
        return parts[0]
    everything = sum(x.value for x in parts) + 1
    varying = [x for x in parts if x.slope]
    count = len(varying)
    slope = sum(x.slope + everything - x.value for x in varying)
    curvature = sum(x.curvature + everything - x.value for x in varying if x.curvature)
    # Every pair of factors, both of them differentiated, beside all the others.
    curvature += (count - 1) * sum(x.slope - x.value for x in varying) + count * (count - 1) // 2 * (everything + 1)
    return Sizes(everything, slope, max(curvature, 0))


def factors(node: Node) -> list[Sizes]:
    """Sizes of the factors of a formula: those of its products, quotients and powers of such."""
    found: list[Sizes] = []
    rest = [(node, False)]
    while rest:
        part, inverse = rest.pop()
        match part:
            case ("*" | "/" as sign, tuple() as left, tuple() as right):
                rest += [(right, inverse or sign == "/"), (left, inverse)]
            case ("-", ("number", 0), tuple() as inner):
                rest.append((inner, inverse))
                found.append(NUMBER)
            case ("**", tuple() as base, tuple() as exponent) if not sizes(exponent).slope:
                found += [_power(x) for x in factors(base)]
            case ("call", "sqrt", tuple() as base):
                found += [_power(x) for x in factors(base)]
            case _:
                size = _single(part)
                found.append(_power(size) if inverse else size)
    return found


def _power(base: Sizes) -> Sizes:
    """Sizes of a power with a number as its exponent."""
    if not base.slope:
        return Sizes(base.value + 2, 0, 0)
    slope = base.value + base.slope + 4
    return Sizes(base.value + 2, slope, 2 * base.value + 2 * base.slope + base.curvature + 10)


def _function(inner: Sizes) -> Sizes:
    """Sizes of a function: its first two derivatives have at most four operations more than itself."""
    value = inner.value + 1
    if not inner.slope:
        return Sizes(value, 0, 0)
    return Sizes(value, value + inner.slope + 4, 2 * value + 2 * inner.slope + inner.curvature + 12)


def _single(node: Node) -> Sizes:
    """Sizes of a formula that is no product."""
    match node:
        case ("number", _):
            return NUMBER
        case ("name", _):
            return NAME
        case ("call", "abs", tuple() as inner):
            inside = sizes(inner)
            return _pieces(inside.value, (inside, product([NUMBER, inside])))
        case ("call", "where", ("compare", _, tuple() as left, tuple() as right), tuple() as yes, tuple() as no):
            return _pieces(sizes(left).value + sizes(right).value, (sizes(yes), sizes(no)))
        case ("call", _, tuple() as inner):
            return _function(sizes(inner))
        case ("**", tuple() as base, tuple() as exponent):
            return _any_power(sizes(base), sizes(exponent))
        case ("+" | "-", *_):
            return _sum(node)
        case _:
            raise AssertionError(f"not a formula node: {node!r}")


def _sum(node: Node) -> Sizes:
    found = [sizes(part) for part in _addends(node)]
    return Sizes(1 + sum(x.value for x in found), sum(x.slope + 1 for x in found if x.slope),
                 sum(x.curvature + 1 for x in found if x.curvature))  # fmt: skip


def _addends(node: Node) -> Iterable[Node]:
    rest = [node]
    while rest:
        part = rest.pop()
        match part:
            case ("+" | "-", tuple() as left, tuple() as right) if not _negated(part):
                rest += [right, left]
            case _:
                yield part


def _negated(node: Node) -> bool:
    return node[:2] == ("-", ("number", 0))


def _pieces(condition: int, branches: tuple[Sizes, Sizes]) -> Sizes:
    yes, no = branches
    extra = condition + 4
    return Sizes(extra + yes.value + no.value, extra + yes.slope + no.slope, extra + yes.curvature + no.curvature)


def _any_power(base: Sizes, exponent: Sizes) -> Sizes:
    """Sizes of u**v: its slope is u**v times the slope of v log(u)."""
    value = base.value + exponent.value + 1
    if not (base.slope or exponent.slope):
        return Sizes(value, 0, 0)
    log = _function(base)
    inner = product([exponent, log])
    slope = value + inner.slope + 4
    return Sizes(value, slope, 2 * value + 2 * inner.slope + inner.curvature + 12)
