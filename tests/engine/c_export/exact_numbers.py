"""Numbers of many digits, with which an exported law is evaluated as if it were exact."""

from __future__ import annotations

import mpmath

DIGITS = mpmath.MPContext()
DIGITS.dps = 50
literal = whole = DIGITS.mpf
sqrt, exp, log, pow, sin, cos = DIGITS.sqrt, DIGITS.exp, DIGITS.log, DIGITS.power, DIGITS.sin, DIGITS.cos
floor, fabs, smaller, larger = DIGITS.floor, DIGITS.fabs, min, max


def copysign(size, sign):
    return DIGITS.fabs(size) if sign >= 0 else -DIGITS.fabs(size)


def square(x):
    """The product of a number with itself."""
    return x * x


def hull(a, b):
    """What two ways have in common; every comparison of numbers decides."""
    raise AssertionError((a, b))
