"""What numbers in a text were rounded by when they were written, by the digits that they have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

MOST_DIGITS = 17
"""Digits beyond which no further ones are looked for: with so many, no two doubles are written alike."""

LONGEST_EXPONENT = 9
"""Signs of an exponent that are read: three digits reach every double, and leading zeros are rare."""


@dataclass
class WrittenDigits:
    """Digits of the numbers of a column.

    A format has a number of decimals, as ``%.3f``, or one of significant digits, as ``%.6g`` and ``%.5e``, of which
    the largest numbers are rounded most. Zeros at the end may be left out: both are those of the number with most.

    Parameters
    ----------
    decimals
        Most decimals of a number.
    significant
        Most digits of a number from its first one that is not zero.
    fraction
        Whether a number has digits behind its point; else all are whole, which counts as exact.
    """

    decimals: int = 0
    significant: int = 0
    fraction: bool = False

    @property
    def complete(self) -> bool:
        """Whether further numbers can change nothing."""
        return self.fraction and self.significant >= MOST_DIGITS

    def add(self, text: str) -> None:
        """Count the digits of a number.

        Parameters
        ----------
        text
            The number, as Python reads it.
        """
        mantissa, _, exponent = text.strip().lower().partition("e")
        before, _, behind = mantissa.lstrip("+-").partition(".")
        self.fraction = self.fraction or bool(behind)
        # A finite number with a longer exponent is zero.
        shift = int(exponent or 0) if len(exponent) <= LONGEST_EXPONENT else 0
        self.decimals = max(self.decimals, len(behind) - shift)
        self.significant = max(self.significant, len((before + behind).lstrip("0")))


def written_rounding(columns: Sequence[WrittenDigits], largest: Sequence[float]) -> float:
    """Most that writing rounded a number of some columns in one format: half a unit of its last digit.

    Columns of whole numbers count as exact.

    Parameters
    ----------
    columns
        Digits of each column.
    largest
        Largest absolute value of each column.
    """
    rounded = [(digits, size) for digits, size in zip(columns, largest, strict=True) if digits.fraction]
    decimals = max((digits.decimals for digits, _ in rounded), default=0)
    significant = max((digits.significant for digits, _ in rounded), default=0)
    found = 0.5 * 10.0**-decimals if decimals > 0 else 0.0
    for _, size in rounded:
        if size > 0.0:
            exponent = int(f"{size:.{MOST_DIGITS}e}".partition("e")[2])
            found = max(found, 0.5 * 10.0 ** (exponent + 1 - min(significant, MOST_DIGITS)))
    return found
