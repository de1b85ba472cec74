"""Elementary functions in C99 without a library of mathematics: own reductions of the argument, then polynomials.

Coefficients are computed here, with mpmath. All operations are those that IEEE 754 rounds correctly, in a stated order,
so that every processor that follows the standard finds the same bits.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from flocking.formula.c_source import CSource, products

LARGEST_ANGLES = (1e6, 1e3)
"""Largest angle that is reduced in double and in single precision: its multiple of pi/2 has no more bits, 20 and 10,
than products with leading parts of constants leave."""

EXPONENTS = (1025.0, -1076.0), (129.0, -152.0)
"""Binary exponents in double and in single precision above which exp overflows, and below which it is zero: the largest
number is below 2^1024 and 2^128, half the smallest 2^-1075 and 2^-150."""

ENDLESS = 2000
"""Size of an exponent beyond which the exponential overflows or is zero in either precision: the rest is not needed."""

DIGITS = 60
"""Decimal digits with which coefficients are computed: more than three times those of a double."""


@dataclass(frozen=True)
class Precision:
    """A format of numbers.

    Parameters
    ----------
    single
        Whether it is binary32; otherwise binary64.
    """

    single: bool

    @property
    def mantissa(self) -> int:
        """Stored bits of the mantissa."""
        return 23 if self.single else 52

    @property
    def bits(self) -> int:
        """Bits of a number."""
        return 32 if self.single else 64

    @property
    def bias(self) -> int:
        """Bias of the exponent."""
        return 127 if self.single else 1023

    @property
    def spare(self) -> int:
        """Trailing zero bits of leading parts of constants: their products with whole numbers are exact."""
        return 10 if self.single else 22

    @property
    def largest_angle(self) -> float:
        """Largest angle that is reduced; the sine of a larger one is NaN."""
        return LARGEST_ANGLES[self.single]


BOUNDS: Mapping[str, tuple[float, str]] = {
    "sqrt": (0.5, "units in the last place: correctly rounded"), "exp": (1.0, "units in the last place"),
    "log": (1.0, "units in the last place"), "sin": (1.0, "units of the rounding of 1"),
    "cos": (1.0, "units of the rounding of 1"), "pow": (2.0, "units in the last place"),
}  # fmt: skip
"""Largest errors of the functions; tests hold all of them against mpmath, and binary32 over all its exponents."""

LARGEST_INTEGER = 2.0**30
"""Largest exponent of a negative number: it fits into 32 bits. Nearly all powers beyond it are 0 or infinite."""

SUBNORMAL = 2
"""Further units of the last place where the value of an exponential or a power is below the normal numbers."""


def _number(value: object, precision: Precision) -> str:
    """A literal, rounded once from mpmath's number."""
    from mpmath import mpf

    exact = Fraction(int(mpf(value).man) * (-1 if mpf(value) < 0 else 1)) * Fraction(2) ** int(mpf(value).exp)
    if precision.single:
        near = np.float32(float(exact))
        # A double between two singles may round the wrong way; the neighbours are looked at.
        found = min((np.nextafter(near, np.float32(s)) for s in (-np.inf, np.inf)), key=lambda x: _off(x, exact))
        near = near if _off(near, exact) <= _off(found, exact) else found
        return CSource(single=True, prefix="").literal(float(near))
    return CSource(single=False, prefix="").literal(float(exact))


def _off(value: object, exact: Fraction) -> Fraction:
    return abs(Fraction(float(value)) - exact)  # type: ignore[arg-type]


def _parts(value: object, count: int, precision: Precision) -> list[str]:
    """A constant as a sum: leading parts with `Precision.spare` zero bits, and what is left."""
    from mpmath import floor, frexp, ldexp, mpf

    left, found = mpf(value), []
    for _ in range(count - 1):
        _, exponent = frexp(left)
        scale = precision.mantissa + 1 - precision.spare - int(exponent)
        part = ldexp(floor(ldexp(left, scale)), -scale)
        found.append(_number(part, precision))
        left -= part
    return [*found, _number(left, precision)]


def _horner(variable: str, coefficients: Iterable[str]) -> str:
    first, *rest = coefficients
    found = first
    for coefficient in rest:
        found = f"({coefficient} + ({variable} * {found}))"
    return found


class _Writer:
    """Source of the functions of one precision and prefix."""

    def __init__(self, prefix: str, precision: Precision) -> None:
        self.x, self.f = prefix, precision
        self.real = f"{prefix}real"

    def number(self, value: object) -> str:
        return _number(value, self.f)

    def series(self, variable: str, terms: Iterable[Fraction]) -> str:
        """A polynomial by Horner's rule, coefficients from the lowest power on."""
        from mpmath import mpf

        found = [self.number(mpf(c.numerator) / c.denominator) for c in terms]
        return _horner(variable, reversed(found))

    def word(self) -> str:
        return f"typedef union\n{{\n    {self.real} number;\n    uint{self.f.bits}_t bits;\n}} {self.x}word;\n"

    def two_to(self) -> str:
        f, x = self.f, self.x
        return (
            f"/* 2 to the power k, for normal numbers. */\n"
            f"static {self.real} {x}two_to(int32_t k)\n{{\n    {x}word w;\n"
            f"    w.bits = (uint{f.bits}_t)(uint32_t)(k + {f.bias}) << {f.mantissa};\n    return w.number;\n}}\n"
        )

    def nan(self) -> str:
        f, x = self.f, self.x
        return (
            f"static {self.real} {x}nan(void)\n{{\n    {x}word w;\n"
            f"    w.bits = (uint{f.bits}_t)0x{'7FC00000' if f.single else '7FF8000000000000'}u;\n"
            "    return w.number;\n}\n"
        )

    def sqrt(self) -> str:
        f, x, real = self.f, self.x, self.real
        u, s = f"uint{f.bits}_t", f"int{f.bits}_t"
        top, half = f.mantissa, self.number(0.5)
        magic = "0x5F3759DFu" if f.single else "0x5FE6EB50C7B537A9u"
        steps = 3 if f.single else 4
        newton = f"        y = y * ({self.number(1.5)} - ((({half} * v) * y) * y));\n" * steps
        lift = 2 * (top // 2 + 1)
        return (
            f"/* Square root, correctly rounded: an estimate, corrected by the exact remainder in whole numbers. */\n"
            f"static {real} {x}sqrt({real} a)\n{{\n    {real} found = a;\n"
            f"    if (!(a >= {self.number(0)}))\n    {{\n        found = {x}nan();\n    }}\n"
            f"    else if ((a > {self.number(0)}) && (a <= {x.upper()}LARGEST))\n    {{\n"
            f"        const {u} one = 1u;\n        int32_t lowered = 0;\n        {x}word w;\n"
            f"        {x}word estimate;\n        {real} v;\n"
            f"        {real} y;\n        int32_t e;\n        {u} m;\n        {u} root;\n        {s} rest;\n"
            f"        uint32_t k;\n        w.number = a;\n"
            f"        if (a < {x.upper()}LEAST_NORMAL)\n        {{\n"
            f"            w.number = a * {self.number(2**lift)};\n            lowered = {lift // 2};\n        }}\n"
            f"        e = (int32_t)(w.bits >> {top}) - {f.bias};\n"
            f"        m = (w.bits & ((one << {top}) - one)) | (one << {top});\n"
            "        if ((((uint32_t)e) & 1u) != 0u)\n        {\n"
            "            m <<= 1;\n            e -= 1;\n        }\n"
            f"        v = ({real})m * {self.number(0.5**top)};\n"
            f"        estimate.number = v;\n        estimate.bits = {magic} - (estimate.bits >> 1);\n"
            f"        y = estimate.number;\n{newton}"
            f"        root = ({u})((v * y) * {self.number(2**top)});\n"
            f"        rest = ({s})((m << {top}) - (root * root));\n"
            f"        for (k = 0u; k < 8u; k++)\n        {{\n"
            f"            if (rest < 0)\n            {{\n                root -= one;\n"
            f"                rest += ({s})((2u * root) + one);\n            }}\n"
            f"            else if (rest > ({s})(2u * root))\n            {{\n"
            f"                rest -= ({s})((2u * root) + one);\n                root += one;\n            }}\n"
            f"            else\n            {{\n                break;\n            }}\n        }}\n"
            f"        if (rest > ({s})root)\n        {{\n            root += one;\n        }}\n"
            f"        w.bits = (({u})(uint32_t)((e / 2) + {f.bias - 1} - lowered) << {top}) + root;\n"
            f"        found = w.number;\n    }}\n"
            f"    else\n    {{\n        /* Zero and infinity are their own roots. */\n    }}\n    return found;\n}}\n"
        )

    def nearest(self) -> str:
        x, real = self.x, self.real
        return (
            f"/* The nearest whole number of a small one. */\n"
            f"static int32_t {x}nearest({real} a)\n{{\n"
            f"    return (int32_t)((a < {self.number(0)}) ? (a - {self.number(0.5)}) : (a + {self.number(0.5)}));\n}}\n"
        )

    def floor(self) -> str:
        x, real, f = self.x, self.real, self.f
        most = self.number(2**f.mantissa)
        return (
            f"static {real} {x}floor({real} a)\n{{\n    {real} found = a;\n"
            f"    if ((a > (-{most})) && (a < {most}))\n    {{\n"
            f"        const {real} cut = ({real})(int{f.bits}_t)a;\n"
            f"        found = (cut > a) ? (cut - {self.number(1)}) : cut;\n    }}\n    return found;\n}}\n"
        )

    def fabs(self) -> str:
        return (
            f"static {self.real} {self.x}fabs({self.real} a)\n{{\n    return (a < {self.number(0)}) ? (-a) : a;\n}}\n"
        )

    def copysign(self) -> str:
        x, f = self.x, self.f
        return (
            f"static {self.real} {x}copysign({self.real} a, {self.real} b)\n{{\n    {x}word w;\n    {x}word sign;\n"
            f"    const uint{f.bits}_t top = (uint{f.bits}_t)1u << {f.bits - 1};\n    w.number = a;\n"
            f"    sign.number = b;\n    w.bits = (w.bits & (top - 1u)) | (sign.bits & top);\n    return w.number;\n}}\n"
        )

    def exp_of(self) -> str:
        from mpmath import log, mpf

        x, real, f = self.x, self.real, self.f
        high, low = _parts(log(2), 2, f)
        degree = 8 if f.single else 14
        factorial, terms = 1, []
        for k in range(2, degree + 1):
            factorial *= k
            terms.append(Fraction(1, factorial))
        largest, least = EXPONENTS[f.single]
        return (
            f"/* Exponential of a sum a + b with a small b: exp(r) 2^k with |r| <= log(2)/2 and a series. */\n"
            f"static {real} {x}exp_of({real} a, {real} b)\n{{\n    {real} found = a;\n"
            f"    const {real} scaled = a * {self.number(1 / log(mpf(2)))};\n"
            f"    if (scaled > {self.number(largest)})\n    {{\n        found = {x}two_to({f.bias});\n"
            f"        found = found * found;\n    }}\n"
            f"    else if (scaled < {self.number(least)})\n    {{\n        found = {self.number(0)};\n    }}\n"
            f"    else if (scaled == scaled)\n    {{\n"
            f"        const int32_t k = {x}nearest(scaled);\n        const int32_t half = k / 2;\n"
            f"        const {real} big = a - (({real})k * {high});\n"
            f"        const {real} small = b - (({real})k * {low});\n"
            f"        const {real} r = big + small;\n"
            f"        const {real} rest = (big - r) + small;\n"
            f"        const {real} tail = (r * r) * {self.series('r', terms)};\n"
            f"        found = {self.number(1)} + (r + (tail + (rest + (rest * r))));\n"
            f"        found = (found * {x}two_to(half)) * {x}two_to(k - half);\n    }}\n"
            f"    else\n    {{\n        /* NaN stays. */\n    }}\n    return found;\n}}\n"
        )

    def exp(self) -> str:
        x, real = self.x, self.real
        return f"static {real} {x}exp({real} a)\n{{\n    return {x}exp_of(a, {self.number(0)});\n}}\n"

    def log_of(self) -> str:
        from mpmath import log, mpf, sqrt

        x, real, f = self.x, self.real, self.f
        high, low = _parts(log(2), 2, f)
        count = 5 if f.single else 12
        # log((1 + s)/(1 - s)) = 2 s + s^3 (2/3 + 2 s^2/5 + ...)
        series = self.series("z", [Fraction(2, 2 * k + 3) for k in range(count)])
        lift = f.mantissa + 2
        split = self.number(2 ** (f.mantissa // 2 + 1) + 1)
        return (
            f"/* A product as an exact sum of two numbers (Dekker 1971). */\n"
            f"static {real} {x}product_rest({real} a, {real} b, {real} ab)\n{{\n"
            f"    const {real} ca = a * {split};\n    const {real} cb = b * {split};\n"
            f"    const {real} ha = ca - (ca - a);\n    const {real} hb = cb - (cb - b);\n"
            f"    const {real} la = a - ha;\n    const {real} lb = b - hb;\n"
            f"    return (((ha * hb) - ab) + (ha * lb) + (la * hb)) + (la * lb);\n}}\n\n"
            f"/* Logarithm of a positive normal or subnormal number as a sum of two. */\n"
            f"static {real} {x}log_of({real} a, {real} *below)\n{{\n    {x}word w;\n    int32_t k = 0;\n"
            f"    w.number = a;\n    if (a < {x.upper()}LEAST_NORMAL)\n    {{\n"
            f"        w.number = a * {self.number(2**lift)};\n        k = -{lift};\n    }}\n"
            f"    k += (int32_t)(w.bits >> {f.mantissa}) - {f.bias};\n"
            f"    w.bits = (w.bits & (((uint{f.bits}_t)1u << {f.mantissa}) - 1u)) | "
            f"((uint{f.bits}_t){f.bias}u << {f.mantissa});\n"
            f"    if (w.number > {self.number(sqrt(mpf(2)))})\n    {{\n"
            f"        w.number = w.number * {self.number(0.5)};\n        k += 1;\n    }}\n    {{\n"
            f"        const {real} x = w.number - {self.number(1)};\n"
            f"        const {real} sum = {self.number(2)} + x;\n"
            f"        const {real} sum_rest = x - (sum - {self.number(2)});\n"
            f"        const {real} s = x / sum;\n        const {real} p = s * sum;\n"
            f"        const {real} s_rest = (((x - p) - {x}product_rest(s, sum, p)) - (s * sum_rest)) / sum;\n"
            f"        const {real} z = s * s;\n"
            f"        const {real} tail = (s * z) * {series};\n"
            f"        const {real} big = ({real})k * {high};\n"
            f"        const {real} two_s = {self.number(2)} * s;\n"
            f"        const {real} first = (k == 0) ? two_s : (big + two_s);\n"
            f"        const {real} left = (k == 0) ? {self.number(0)} : (two_s - (first - big));\n"
            f"        const {real} small = left + ((({real})k * {low}) + (({self.number(2)} * s_rest) + tail));\n"
            f"        const {real} found = first + small;\n"
            f"        *below = small - (found - first);\n        return found;\n    }}\n}}\n"
        )

    def log(self) -> str:
        x, real, f = self.x, self.real, self.f
        return (
            f"static {real} {x}log({real} a)\n{{\n    {real} found = a;\n"
            f"    if (a == {self.number(0)})\n    {{\n        found = {x}two_to({f.bias});\n"
            f"        found = -(found * found);\n    }}\n"
            f"    else if (!(a > {self.number(0)}))\n    {{\n        found = {x}nan();\n    }}\n"
            f"    else if (a <= {x.upper()}LARGEST)\n    {{\n        {real} below;\n"
            f"        found = {x}log_of(a, &below);\n    }}\n"
            f"    else\n    {{\n        /* Infinity stays. */\n    }}\n    return found;\n}}\n"
        )

    def pow(self) -> str:
        x, real, zero, one = self.x, self.real, self.number(0), self.number(1)
        most = self.number(LARGEST_INTEGER)
        return (
            f"/* a to the power b; of a negative a for whole b of at most 2^30 alone, else NaN. */\n"
            f"static {real} {x}pow({real} a, {real} b)\n{{\n    {real} found = {x}nan();\n"
            f"    {real} size = a;\n    {real} sign = {one};\n"
            f"    if ((a < {zero}) && (b >= (-{most})) && (b <= {most}))\n    {{\n"
            f"        const int32_t whole = (int32_t)b;\n"
            f"        if (({real})whole == b)\n        {{\n            size = -a;\n"
            f"            sign = (((uint32_t)whole & 1u) != 0u) ? (-{one}) : {one};\n        }}\n    }}\n"
            f"    if (b == {zero})\n    {{\n        found = {one};\n    }}\n"
            f"    else if (a == {zero})\n    {{\n"
            f"        found = {x}two_to({self.f.bias});\n"
            f"        found = (b > {zero}) ? {zero} : (found * found);\n    }}\n"
            f"    else if ((size > {zero}) && (size <= {x.upper()}LARGEST))\n    {{\n        {real} below;\n"
            f"        const {real} above = {x}log_of(size, &below);\n        const {real} p = above * b;\n"
            f"        if ((p > {self.number(-ENDLESS)}) && (p < {self.number(ENDLESS)}))\n        {{\n"
            f"            found = sign * {x}exp_of(p, {x}product_rest(above, b, p) + (below * b));\n        }}\n"
            f"        else\n        {{\n            found = sign * {x}exp_of(p, {zero});\n        }}\n    }}\n"
            f"    else\n    {{\n        /* NaN. */\n    }}\n    return found;\n}}\n"
        )

    def circular(self) -> str:
        from mpmath import mpf, pi

        x, real, f = self.x, self.real, self.f
        parts = _parts(pi / 2, 3, f)
        count = 5 if f.single else 9
        factorial = 1
        sines: list[Fraction] = []
        cosines: list[Fraction] = []
        for k in range(2, 2 * count + 3):
            factorial *= k
            sign = -1 if k % 4 in (2, 3) else 1
            (cosines if k % 2 == 0 else sines).append(Fraction(sign, factorial))
        reduced = f"((a - (({real})k * {parts[0]})) - (({real})k * {parts[1]})) - (({real})k * {parts[2]})"
        # cos r = 1 - r^2/2 + ..., whose first two terms are added last.
        return (
            f"/* Sine (shift 0) or cosine (shift 1): the quarter of the circle, and a series about its middle. */\n"
            f"static {real} {x}circular({real} a, uint32_t shift)\n{{\n    {real} found = {x}nan();\n"
            f"    const {real} most = {self.number(f.largest_angle)};\n"
            f"    if ((a >= (-most)) && (a <= most))\n    {{\n"
            f"        const int32_t k = {x}nearest(a * {self.number(2 / mpf(pi))});\n"
            f"        const {real} r = {reduced};\n        const {real} z = r * r;\n"
            f"        const uint32_t quarter = ((uint32_t)k + shift) & 3u;\n"
            f"        const {real} sine = r + ((r * z) * {self.series('z', sines)});\n"
            f"        const {real} cosine = {self.number(1)} + (z * {self.series('z', cosines)});\n"
            f"        found = ((quarter & 1u) != 0u) ? cosine : sine;\n"
            f"        found = ((quarter & 2u) != 0u) ? (-found) : found;\n    }}\n    return found;\n}}\n"
        )

    def sin(self) -> str:
        return f"static {self.real} {self.x}sin({self.real} a)\n{{\n    return {self.x}circular(a, 0u);\n}}\n"

    def cos(self) -> str:
        return f"static {self.real} {self.x}cos({self.real} a)\n{{\n    return {self.x}circular(a, 1u);\n}}\n"


def elementary_functions(used: Iterable[str], prefix: str, precision: Precision) -> str:
    """Source of functions and of what they need.

    Parameters
    ----------
    used
        Names, see `flocking.formula.c_source.FUNCTIONS`; ``power3`` is the product of three factors.
    prefix
        Begin of all names.
    precision
        Of all numbers.
    """
    from mpmath import workdps

    names = frozenset(used)
    write = _Writer(prefix, precision)
    found = []
    needed = {
        "word": {"sqrt", "copysign", "exp", "log", "pow", "sin", "cos"}, "two_to": {"exp", "log", "pow"},
        "nan": {"sqrt", "log", "pow", "sin", "cos"}, "nearest": {"exp", "pow", "sin", "cos"}, "sqrt": {"sqrt"},
        "floor": {"floor"}, "fabs": {"fabs"}, "copysign": {"copysign"}, "exp_of": {"exp", "pow"}, "exp": {"exp"},
        "log_of": {"log", "pow"}, "log": {"log"}, "pow": {"pow"}, "circular": {"sin", "cos"}, "sin": {"sin"},
        "cos": {"cos"},
    }  # fmt: skip
    with workdps(DIGITS):
        found += [getattr(write, part)() for part, users in needed.items() if names & users]
    real = f"{prefix}real"
    for name in sorted(n for n in names if n.startswith("power")):
        product = products("a", int(name[5:]))
        found.append(f"static {real} {prefix}{name}({real} a)\n{{\n    return {product};\n}}\n")
    return "\n".join(found)
