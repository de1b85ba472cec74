"""The counter-based random numbers of `flocking.model.world.random_numbers` for native functions, in lanes or singly.

Integers are the same bits as there: the same generator, constants and counters.
"""

from __future__ import annotations

import numpy as np

from flocking.engine.tiles.simd.vectors import float_of
from flocking.model.world.random_numbers import MULTIPLIERS, ROUNDS, WEYL

FIRST, SECOND = MULTIPLIERS[0], MULTIPLIERS[1]
FIRST_STEP, SECOND_STEP = WEYL[0], WEYL[1]
WORD = 0xFFFFFFFF
"""Mask of a word."""


def philox_words(a, b, c, d, key, key2):  # type: ignore[no-untyped-def]
    """Four random words of 32 bits, held in 64, for the counter (a, b, c, d).

    Parameters
    ----------
    a, b, c, d
        Words of the counter, each one number or lanes.
    key, key2
        Words of the key.
    """
    # Only the lower halves of what is multiplied are masked: LLVM then multiplies half words throughout and needs no
    # operation for the masks. What is in the upper halves meanwhile reaches no lower half.
    for _ in range(ROUNDS):
        high = np.uint64(FIRST) * (a & np.uint64(WORD))
        other = np.uint64(SECOND) * (c & np.uint64(WORD))
        a, b = (other >> np.uint64(32)) ^ b ^ key, other
        c, d = (high >> np.uint64(32)) ^ d ^ key2, high
        key, key2 = key + np.uint64(FIRST_STEP), key2 + np.uint64(SECOND_STEP)
    word = np.uint64(WORD)
    return a & word, b & word, c & word, d & word


def open_unit(high, low):  # type: ignore[no-untyped-def]
    """Numbers in (0, 1) of 53 bits, as `flocking.model.world.random_numbers.uniform` makes them.

    Parameters
    ----------
    high, low
        Two words of 32 bits, each one number or lanes.
    """
    bits = (high >> np.uint64(5)) * np.uint64(1 << 26) + (low >> np.uint64(6))
    return (float_of(bits) + 0.5) * 2.0**-53


def drawn_unit(number, purpose, sender, receiver, key, key2):  # type: ignore[no-untyped-def]
    """The draw of `flocking.model.world.random_numbers.uniform` for a number of a sample below 2**32.

    Parameters
    ----------
    number
        Lanes of numbers of samples.
    purpose
        The second word of the counter.
    sender, receiver
        Lanes of the two agents.
    key, key2
        Words of the seed.
    """
    a, b, _, _ = philox_words(number, purpose, sender, receiver, key, key2)  # type: ignore[no-untyped-call]
    return open_unit(a, b)  # type: ignore[no-untyped-call]
