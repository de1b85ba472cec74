"""Limits of pair formulas as the distance r goes to 0, where the two agents coincide.

There n_ij has no direction: by convention the force along it is zero, and so is the rate of change of r. Most other
formulas have their limit at r = 0; some, such as sin(r)/r, only as a limit; some have none.
"""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING

from flocking.formula.precise import evaluator, wide_context

if TYPE_CHECKING:
    import sympy

ENDLESS = "endless"
"""Symbol that stands for infinity in the branches of a limit."""

CLOSEST = 1e-150
"""Distances below it count as 0 if a formula cannot be evaluated at 0: the square of a smaller one underflows."""

AGREEMENT = 1e-6
"""Difference of two values, relative where they exceed 1, up to which an expression counts as converged."""
STILL = 1e-40
"""Difference of two values, relative where they exceed 1, that may be rounding: `flocking.formula.precise.DIGITS` less
what differences of nearly equal numbers lose."""
FIRST_PRIME = 5
"""Number of the prime, 11, that gives the first parameter its value: tenths of primes satisfy no simple relation."""

LONGEST, LONGEST_TERM, MOST_FUNCTIONS, MOST_NESTED = 1000, 140, 4, 3
"""Nodes of an expression, nodes of each of its terms, and different functions in each of them, the last where some are
within others, up to which SymPy is asked for a limit: its time grows fast with the functions that a product has."""

_PROBES = (16, 32, 64)
"""Decimal places of the distances at which an expression is evaluated to see whether it diverges."""


def limit_at_contact(expression: sympy.Expr, r: sympy.Symbol) -> sympy.Expr | None:
    """Limit of an expression as ``r`` goes to 0 from above; None where it has none that is finite.

    Parameters
    ----------
    expression
        An expression of ``r`` and other symbols, whose values are positive as a rule.

    Notes
    -----
    A branch that has no finite limit is the symbol `ENDLESS`: which branch holds at 0 depends on the parameters.
    """
    import sympy

    if not expression.has(r):
        return expression
    if isinstance(expression, sympy.Piecewise):
        endless = sympy.Symbol(ENDLESS, real=True)
        branches = [(limit_at_contact(value, r), condition) for value, condition in expression.args]
        if all(value is None for value, _ in branches):
            return None
        pieces = [(endless if value is None else value, c if c in (True, False) else c.subs(r, 0))
                  for value, c in branches]  # fmt: skip
        return sympy.Piecewise(*pieces)
    if expression.has(sympy.Piecewise):
        parts = [limit_at_contact(part, r) for part in _parts(expression)]
        return None if any(part is None for part in parts) else _finite(expression.func(*parts))
    found = _finite(expression.subs(r, 0))
    return found if found is not None else _removable(expression, r)


def _parts(expression: sympy.Expr) -> list[sympy.Expr]:
    """Parts of an expression with branches whose limits are taken one by one.

    Terms with the same branching factor are added first: 1/r and cos(r)/r times the weight of a link may have a limit
    only together.
    """
    import sympy

    if isinstance(expression, sympy.Mul):
        plain, branching = _factors(expression)
        return [plain, *sympy.Mul.make_args(branching)]
    if isinstance(expression, sympy.Add):
        groups: dict[sympy.Expr, sympy.Expr] = {}
        for term in expression.args:
            plain, branching = _factors(term)
            groups[branching] = groups.get(branching, sympy.Integer(0)) + plain
        return [plain * branching for branching, plain in groups.items()]
    return list(expression.args)


def _factors(term: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr]:
    """Product of the factors without branches, and of those with."""
    import sympy

    factors = sympy.Mul.make_args(term)
    plain = [x for x in factors if not x.has(sympy.Piecewise)]
    return sympy.Mul(*plain), sympy.Mul(*(x for x in factors if x.has(sympy.Piecewise)))


def _finite(value: sympy.Expr) -> sympy.Expr | None:
    import sympy

    infinite = value.has(sympy.zoo, sympy.oo, -sympy.oo, sympy.nan, sympy.I, sympy.AccumBounds)
    return None if infinite else value


def _removable(expression: sympy.Expr, r: sympy.Symbol) -> sympy.Expr | None:
    """The limit if setting r = 0 gives none; SymPy computes it after numerical values show that it exists.

    None for a long expression too.
    """
    import sympy

    if _is_long(expression):
        return None
    primes = (sympy.Rational(sympy.prime(k), 10) for k in count(FIRST_PRIME))
    known = dict(zip(sorted(expression.free_symbols - {r}, key=str), primes, strict=False))
    at, finite = evaluator(expression, r, known), wide_context().isfinite
    outer, inner, far = (at(wide_context().mpf(10) ** -places) for places in _PROBES)
    if not all(map(finite, (outer, inner, far))) or abs(inner - outer) > AGREEMENT * max(1.0, abs(outer)):
        return None
    if abs(far - inner) > max(abs(inner - outer), STILL * max(1.0, abs(far))):
        return None  # a logarithm beside a large number
    # SymPy would look for relations among functions that do not depend on r, at length.
    constant = {f: sympy.Dummy(real=True) for f in _constant_functions(expression, r)}
    try:
        found = _finite(sympy.limit(expression.xreplace(constant), r, 0))
    except (NotImplementedError, ValueError, TypeError, RecursionError):
        return None
    if found is None or found.has(r):
        return None
    found = found.xreplace({symbol: function for function, symbol in constant.items()})
    value = evaluator(found, r, known)(0)
    return found if finite(value) and abs(value - far) <= AGREEMENT * max(1.0, abs(far)) else None


def _constant_functions(expression: sympy.Expr, r: sympy.Symbol) -> set[sympy.Expr]:
    """Functions within an expression that do not depend on ``r``, but those within one of them."""
    import sympy

    if not expression.has(sympy.Function):
        return set()
    if isinstance(expression, sympy.Function) and not expression.has(r):
        return {expression}
    return set().union(*(_constant_functions(part, r) for part in expression.args))


def _is_long(expression: sympy.Expr) -> bool:
    import sympy

    terms = sympy.Add.make_args(expression)
    sizes = [sum(1 for _ in sympy.preorder_traversal(term)) for term in terms]
    if sum(sizes) > LONGEST or max(sizes) > LONGEST_TERM:
        return True
    for functions in (term.atoms(sympy.Function) for term in terms):
        nested = any(function.args[0].has(sympy.Function) for function in functions if function.args)
        if len(functions) > (MOST_NESTED if nested else MOST_FUNCTIONS):
            return True
    return False


def defined_at_contact(expression: sympy.Expr, r: sympy.Symbol) -> sympy.Expr:
    """The same expression, but with its limit at ``r`` = 0 where it has one that it cannot be evaluated to."""
    import sympy

    if not expression.has(r):
        return expression
    if isinstance(expression, sympy.Piecewise):
        return sympy.Piecewise(*((defined_at_contact(value, r), condition) for value, condition in expression.args))
    if expression.has(sympy.Piecewise):
        return expression.func(*(defined_at_contact(part, r) for part in _parts(expression)))
    if _finite(expression.subs(r, 0)) is not None:
        return expression
    limit = limit_at_contact(expression, r)
    if limit is None:
        return expression
    return sympy.Piecewise((limit, sympy.Lt(r, sympy.Float(CLOSEST))), (expression, True))
