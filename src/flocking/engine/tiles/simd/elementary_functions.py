"""Vectorisable sin, cos, exp, log and powers without branches, accurate to a few units in the last place.

Series are truncated where their remainder is below the rounding error of the precision. Arguments are reduced with
constants split into parts, accurate up to |x| of about 1e5 radians. A power is the exponential of a product, whose
size is the number of further units by which it may be off.
"""

from __future__ import annotations

import math
from fractions import Fraction

TERMS = {"wave": (6, 11), "exponential": (8, 14), "logarithm": (5, 11)}
"""Terms of the series in single and in double precision. On the reduced range (|r| <= pi/2, |r| <= log(2)/2 and |a| <=
0.172) the first that is left out is, relative to the function, below the unit of rounding, 6e-8 and 1.1e-16."""

ARGUMENTS = (-87.0, 88.7), (-708.0, 709.7)
"""Arguments of exp in single and in double precision beyond which the result is 0 or infinite: exp(-87) and exp(-708)
are the last whole numbers whose results are normal, and 88.72 and 709.78 the largest arguments with finite ones, of
which the last tenth is given up."""

FORMATS = (127, 23), (1023, 52)
"""Bias of the exponent and stored bits of the mantissa in single and in double precision (IEEE 754)."""

LEADING = (10, 30)
"""Bits of the leading parts of pi and log(2): products with multiples of up to 14 and 23 bits are exact."""


NAMES = ("fast_sin", "fast_cos", "fast_exp", "fast_log", "fast_power")
"""Functions of which there is source."""


def _split(value: Fraction, keep: int) -> list[float]:
    """``value`` as a sum of floats, the first ones with few bits so that their small multiples are exact."""
    parts: list[float] = []
    for _ in range(2):
        scale = Fraction(2) ** (keep - math.frexp(float(value))[1])
        head = Fraction(round(value * scale)) / scale
        parts.append(float(head))
        value -= head
    return [*parts, float(value)]


_PI = Fraction(314159265358979323846264338327950288419716939937510, 10**50)
_LN2 = Fraction(69314718055994530941723212145817656807550013436026, 10**50)


def _horner(coefficients: list[float], variable: str) -> str:
    text = f"T({coefficients[-1]!r})"
    for c in reversed(coefficients[:-1]):
        text = f"({text} * {variable} + T({c!r}))"
    return text


def source(names: set[str], double: bool) -> str:
    """Source of the requested functions among `NAMES`, with the type ``T``, and of those that they call.

    Parameters
    ----------
    names
        Names of the functions.
    double
        Whether numbers have 64 bits, else 32.
    """
    makers = {
        "fast_sin": _wave, "fast_cos": _wave, "fast_exp": _exponential, "fast_log": _logarithm, "fast_power": _power,
    }  # fmt: skip
    needed = names | ({"fast_exp", "fast_log"} if "fast_power" in names else set())
    return "".join(makers[name](name, double) for name in sorted(needed))


def _wave(name: str, double: bool) -> str:
    count = TERMS["wave"][double]
    series = _horner([(-1.0) ** k / math.factorial(2 * k + 1) for k in range(count)], "s")
    pi = _split(_PI, LEADING[double])
    half = "" if name == "fast_sin" else " + T(0.5)"
    nearest = f"floor_of(x * T({1 / math.pi!r}){' + T(0.5)' if name == 'fast_sin' else ''})"
    lines = [
        f"def {name}(x):",
        f"    nearest = {nearest}",
        f"    k = nearest{half}",
        f"    r = ((x - k * T({pi[0]!r})) - k * T({pi[1]!r})) - k * T({pi[2]!r})",
        "    s = r * r",
        f"    value = r * {series}",
        "    odd = nearest - T(2.0) * floor_of(nearest * T(0.5))",
        f"    return value * ({'T(1.0) - T(2.0) * odd' if name == 'fast_sin' else 'T(2.0) * odd - T(1.0)'})",
    ]
    return "\n".join(lines) + "\n\n\n"


def _exponential(name: str, double: bool) -> str:
    count, (low, high) = TERMS["exponential"][double], ARGUMENTS[double]
    series = _horner([1.0 / math.factorial(k) for k in range(count)], "r")
    ln2 = _split(_LN2, LEADING[double])
    bias, shift = FORMATS[double]
    lines = [
        f"def {name}(x):",
        f"    y = select(x < T({low}), T({low}), x)",
        f"    y = select(y > T({high}), T({high}), y)",
        f"    k = floor_of(y * T({math.log2(math.e)!r}) + T(0.5))",
        f"    r = ((y - k * T({ln2[0]!r})) - k * T({ln2[1]!r})) - k * T({ln2[2]!r})",
        "    h = floor_of(k * T(0.5))",
        f"    one = float_of_bits((integer_of(h) + {bias}) << {shift})",
        f"    two = float_of_bits((integer_of(k - h) + {bias}) << {shift})",
        f"    value = {series} * one * two",
        f"    value = select(x < T({low}), T(0.0), value)",
        f"    value = select(x > T({high}), T(np.inf), value)",
        "    return select(x == x, value, x)",
    ]
    return "\n".join(lines) + "\n\n\n"


def _logarithm(name: str, double: bool) -> str:
    count = TERMS["logarithm"][double]
    series = _horner([2.0 / (2 * k + 1) for k in range(count)], "s")
    bias, shift = FORMATS[double]
    mask, middle = (1 << shift) - 1, bias << shift
    ln2 = _split(_LN2, LEADING[double])
    lines = [
        f"def {name}(x):",
        "    bits = float_bits(x)",
        f"    power = float_of(bits >> {shift}) - T({float(bias)})",
        f"    m = float_of_bits((bits & {mask}) | {middle})",
        f"    big = m > T({math.sqrt(2)!r})",
        "    m = select(big, m * T(0.5), m)",
        "    power = select(big, power + T(1.0), power)",
        "    a = (m - T(1.0)) / (m + T(1.0))",
        "    s = a * a",
        f"    value = power * T({ln2[0]!r}) + (a * {series} + power * T({ln2[1] + ln2[2]!r}))",
        "    special = select(x == T(0.0), T(-np.inf), T(np.nan))",
        "    value = select(x > T(0.0), value, special)",
        "    return select(x < T(np.inf), value, select(x > T(0.0), x, value))",
    ]
    return "\n".join(lines) + "\n\n\n"


def _power(name: str, double: bool) -> str:
    """A power whose exponent is known when a kernel runs, as of C: of negative bases for whole exponents alone."""
    lines = [
        f"def {name}(x, exponent):",
        "    size = select(x < T(0.0), -x, x)",
        "    value = fast_exp(exponent * fast_log(size))",
        "    whole = floor_of(exponent)",
        "    odd = whole - T(2.0) * floor_of(whole * T(0.5))",
        "    signed = select(exponent == whole, value * (T(1.0) - T(2.0) * odd), T(np.nan))",
        "    value = select(x < T(0.0), signed, value)",
        # The product of zero and an infinite logarithm has no value.
        "    return select(exponent == T(0.0), T(1.0), value)",
    ]
    return "\n".join(lines) + "\n\n\n"
