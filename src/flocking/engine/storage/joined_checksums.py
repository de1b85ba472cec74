"""CRC-32 of data whose parts were summed apart, as zlib's ``crc32_combine`` has it."""

from __future__ import annotations

from functools import cache

POLYNOMIAL = 0xEDB88320
"""The polynomial of CRC-32, its bits in reverse order (RFC 1952, section 8)."""
BITS = 32
"""Bits of a checksum."""


def joined(first: int, second: int, length: int) -> int:
    """CRC-32 of two pieces of data one behind the other.

    Parameters
    ----------
    first, second
        CRC-32 of each.
    length
        Bytes of the second.
    """
    power = 0
    while length:
        if length & 1:
            first = _times(_zeros(power), first)
        length >>= 1
        power += 1
    return first ^ second


@cache
def _zeros(power: int) -> tuple[int, ...]:
    """What 2**power bytes of zeros make of each bit of a checksum: a matrix over the field of two elements."""
    if not power:
        one = (POLYNOMIAL, *(1 << k for k in range(BITS - 1)))
        eight = one
        for _ in range(3):
            eight = tuple(_times(eight, row) for row in eight)
        return eight
    half = _zeros(power - 1)
    return tuple(_times(half, row) for row in half)


def _times(matrix: tuple[int, ...], vector: int) -> int:
    found = 0
    for row in matrix:
        if not vector:
            break
        if vector & 1:
            found ^= row
        vector >>= 1
    return found
