"""The counter-based random numbers of `flocking.model.world.random_numbers` for native functions, in lanes or singly.

Integers are the same bits as there: the same generator, constants and counters.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flocking.engine.tiles.simd.vectors import float_of
from flocking.model.world.random_numbers import MULTIPLIERS, ROUNDS, WEYL

FIRST, SECOND = MULTIPLIERS
FIRST_STEP, SECOND_STEP = WEYL
WORD = 0xFFFFFFFF


def philox_words(a: Any, b: Any, c: Any, d: Any, key: Any, key2: Any) -> tuple[Any, Any, Any, Any]:
    """Four random words of 32 bits, held in 64, for the counter (a, b, c, d).

    Parameters
    ----------
    a, b, c, d
        Words of the counter, each one number or lanes.
    key, key2
        Words of the key.
    """
    for _ in range(ROUNDS):
        high = np.uint64(FIRST) * a
        other = np.uint64(SECOND) * c
        a = (other >> np.uint64(32)) ^ b ^ key
        b = other & np.uint64(WORD)
        c = (high >> np.uint64(32)) ^ d ^ key2
        d = high & np.uint64(WORD)
        key = (key + np.uint64(FIRST_STEP)) & np.uint64(WORD)
        key2 = (key2 + np.uint64(SECOND_STEP)) & np.uint64(WORD)
    return a, b, c, d


def open_unit(high: Any, low: Any) -> Any:
    """Numbers in (0, 1) of 53 bits from two words, as `flocking.model.world.random_numbers.uniform` makes them."""
    bits = (high >> np.uint64(5)) * np.uint64(1 << 26) + (low >> np.uint64(6))
    return (float_of(bits) + 0.5) * 2.0**-53


def drawn_unit(number: Any, purpose: Any, sender: Any, receiver: Any, key: Any, key2: Any) -> Any:
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
    a, b, _, _ = philox_words(number, purpose, sender, receiver, key, key2)
    return open_unit(a, b)
