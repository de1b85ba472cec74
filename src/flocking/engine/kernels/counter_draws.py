"""The counter-based random numbers of `flocking.model.world.random_numbers` for native functions, one at a time."""

from __future__ import annotations

import numpy as np

from flocking.model.world.random_numbers import MULTIPLIERS, PURPOSE_SHIFT, ROUNDS, WEYL

FIRST, SECOND = MULTIPLIERS[0], MULTIPLIERS[1]
FIRST_STEP, SECOND_STEP = WEYL[0], WEYL[1]
WORD = 0xFFFFFFFF
"""Mask of a word of 32 bits."""
HALF = 32
"""Bits of a word."""


def drawn(seed: int, purpose: int, sender: int, receiver: int, sample: int) -> float:
    """The draw of `flocking.model.world.random_numbers.uniform`, to the last bit.

    Parameters
    ----------
    seed, purpose, sender, receiver, sample
        As there.
    """
    a, b = np.uint64(sample & WORD), np.uint64((sample >> HALF) | (purpose << PURPOSE_SHIFT))
    c, d = np.uint64(sender), np.uint64(receiver)
    key, key2 = np.uint64(seed & WORD), np.uint64(seed >> HALF)
    for _ in range(ROUNDS):
        high = np.uint64(FIRST) * a
        other = np.uint64(SECOND) * c
        a = (other >> np.uint64(32)) ^ b ^ key
        b = other & np.uint64(WORD)
        c = (high >> np.uint64(32)) ^ d ^ key2
        d = high & np.uint64(WORD)
        key = (key + np.uint64(FIRST_STEP)) & np.uint64(WORD)
        key2 = (key2 + np.uint64(SECOND_STEP)) & np.uint64(WORD)
    bits = (a >> np.uint64(5)) * np.uint64(1 << 26) + (b >> np.uint64(6))
    return float((np.float64(bits) + 0.5) * 2.0**-53)
