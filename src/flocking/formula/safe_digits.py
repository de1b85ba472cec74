"""Numbers as text: those of bounds rounded to their safe side, given ones in all their digits.

A text is read as the double nearest to it: 0.3 is the text of the double nearest to 0.3, on no side of it.
"""

from __future__ import annotations

import decimal
import math
from typing import SupportsFloat

DIGITS = 9
"""Digits of a bound where nobody asks for fewer; a convention: enough to show that two bounds are not the same."""
EXACT_DIGITS = 15
"""Most digits with which a number and its text are each other's: a property of double precision."""
EVERY_DIGIT = 17
"""Digits with which every two doubles differ: a property of double precision."""
REGULAR = (1e-290, 1e300)
"""Sizes between which a double has all its digits and its text can be rounded away without an overflow."""


def rounded_down(x: SupportsFloat, digits: int = DIGITS) -> str:
    """A number with a few digits that is not above the given one: for what is guaranteed from a bound on.

    Parameters
    ----------
    x
        The number.
    digits
        Significant digits, up to 15.
    """
    return _rounded(float(x), digits, decimal.ROUND_FLOOR)


def rounded_up(x: SupportsFloat, digits: int = DIGITS) -> str:
    """A number with a few digits that is not below the given one: for what is guaranteed up to a bound.

    Parameters
    ----------
    x, digits
        As in `rounded_down`.
    """
    return _rounded(float(x), digits, decimal.ROUND_CEILING)


def bound_text(x: SupportsFloat, side: str, digits: int = DIGITS) -> str:
    """A bound with a few digits, rounded so that a statement about it stays true.

    Parameters
    ----------
    x
        The safe end of the bound.
    side
        ``"at least"`` of a lower bound; others are upper ones.
    digits
        As in `rounded_down`.
    """
    return rounded_down(x, digits) if side == "at least" else rounded_up(x, digits)


def nearest_text(x: SupportsFloat, digits: int = DIGITS) -> str:
    """A number with a few digits, rounded to the nearest: for a statement that bounds nothing.

    Parameters
    ----------
    x, digits
        As in `rounded_down`.
    """
    return f"{float(x):.{digits}g}"


def compared_texts(x: SupportsFloat, y: SupportsFloat, digits: int = 3) -> tuple[str, str]:
    """Two numbers with so many digits that their texts compare as they do: what exceeds its bound is read to exceed it.

    Parameters
    ----------
    x, y
        The numbers, each rounded to the nearest.
    digits
        Fewest significant digits.
    """
    first, second = float(x), float(y)
    for number in range(digits, EXACT_DIGITS + 3):  # seventeen digits distinguish any two doubles
        texts = nearest_text(first, number), nearest_text(second, number)
        # Two texts may be one number below the normal ones.
        if float(texts[0]) != float(texts[1]) or first == second:
            break
    return texts


def percent_text(share: float, low: float, high: float) -> str:
    """A share in whole per cent with its interval, whose ends are rounded outwards; 0 and 100 mean none and all.

    Parameters
    ----------
    share
        The share.
    low, high
        Ends of its interval.
    """
    middle = f"{100.0 * share:.0f}"
    if middle in ("0", "100") and 0.0 < share < 1.0:
        middle = compared_texts(100.0 * share, float(middle), 1)[0]
    return f"{middle} % ({math.floor(100.0 * low)} to {math.ceil(100.0 * high)})"


def given_text(x: SupportsFloat) -> str:
    """A declared number with all the digits that distinguish it from others.

    Parameters
    ----------
    x
        The number.
    """
    return repr(float(x)).removesuffix(".0")


def time_text(time: SupportsFloat, first: SupportsFloat, last: SupportsFloat, digits: int = 4) -> str:
    """A time of a run with a few digits, and with more where the run begins late: days or years after time zero.

    Parameters
    ----------
    time
        The time.
    first, last
        Start and end of the run.
    digits
        Digits of a time of a run that begins at zero. Times of other runs have as many more as make them differ.
    """
    latest, span = max(abs(float(first)), abs(float(last))), float(last) - float(first)
    later = math.ceil(math.log10(latest / span)) if 0.0 < span < latest < math.inf else 0
    return f"{float(time):.{min(digits + later, EVERY_DIGIT)}g}"


def _rounded(x: float, digits: int, side: str) -> str:
    if not math.isfinite(x) or x == 0.0:
        return nearest_text(x + 0.0)
    if float(nearest := nearest_text(x, digits)) == x:
        return nearest
    context = decimal.Context(prec=min(digits, EXACT_DIGITS), rounding=side)
    text = context.create_decimal(decimal.Decimal(x)).normalize(context)
    if REGULAR[0] < abs(x) < REGULAR[1]:
        return f"{float(text):.{context.prec}g}"
    return f"{text:e}"
