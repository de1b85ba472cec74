"""Counter-based random numbers: each draw is a function of what it is for, so no draw depends on another.

The generator is Philox4x32-10 (Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as easy as 1, 2, 3", 2011). The
key is the seed; the counter holds the index of the sample, the purpose of the draw, and the two agents that it is
about. Integers are the same bits on every machine and for any order of the draws.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array

Words = NDArray[np.uint64]
"""Words of 32 bits, held in 64."""

ROUNDS = 10
"""Rounds of Philox4x32-10: the number at which its authors found all tests passed with a margin."""

MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
"""Multipliers of the rounds (Salmon et al. 2011, section 4)."""

WEYL = (0x9E3779B9, 0xBB67AE85)
"""What the key grows by each round: the golden ratio and the square root of 3, less 1, in 32 bits."""

WORD = np.uint64(0xFFFFFFFF)
"""Mask of a word."""

PURPOSE_SHIFT = 24
"""Place of the purpose in the second word of the counter; the bits below it continue the index of the sample."""

IN_A_PAIR = 2
"""Normal numbers that one draw gives."""


class Purpose(IntEnum):
    """What a draw is for. Numbers are never used again for another purpose: stored runs would change."""

    LOSS = 1
    CHANNEL = 2
    JITTER = 3
    NOISE = 4
    GUST = 5
    HEADING = 6
    TURN = 7
    FIX = 8
    KICK = 9


NOT_AN_AGENT = 0xFFFFFFFF
"""Sender of draws about messages of leaders, which are no agents: -1 as a word of 32 bits, larger than all numbers of
agents."""


def philox(counter: tuple[Words, Words, Words, Words], key: tuple[int, int]) -> tuple[Words, Words, Words, Words]:
    """Philox4x32-10 of counters and a key.

    Parameters
    ----------
    counter
        The four words of each counter, arrays that broadcast.
    key
        The two words of the key.

    Returns
    -------
    tuple of arrays
        Four random words for each counter.
    """
    a, b, c, d = counter
    k, m = key
    half = np.uint64(32)
    for _ in range(ROUNDS):
        first, second = np.uint64(MULTIPLIERS[0]) * a, np.uint64(MULTIPLIERS[1]) * c
        a, b, c, d = (
            (second >> half) ^ b ^ np.uint64(k), second & WORD,
            (first >> half) ^ d ^ np.uint64(m), first & WORD,
        )  # fmt: skip
        k, m = (k + WEYL[0]) & 0xFFFFFFFF, (m + WEYL[1]) & 0xFFFFFFFF
    return a, b, c, d


def words(seed: int, purpose: Purpose, sender: object, receiver: object, sample: object) -> tuple[Words, ...]:
    """Four random words for each combination of the arguments, which broadcast.

    Parameters
    ----------
    seed
        Seed of the world, 0 to 2**63 - 1.
    purpose
        What the draw is for.
    sender, receiver
        The agents it is about; ``sender`` again where it is about one agent alone.
    sample
        Index of the sample, from 0.
    """
    i, j, k = (np.asarray(x, dtype=np.int64).astype(np.uint64) for x in (sender, receiver, sample))
    second = (k >> np.uint64(32)) | np.uint64(int(purpose) << PURPOSE_SHIFT)
    i, j, k, second = np.broadcast_arrays(i, j, k, second)
    return philox((k & WORD, second, i, j), (seed & 0xFFFFFFFF, seed >> 32))


def _open_unit(high: Words, low: Words) -> Array:
    """Numbers in (0, 1) of 53 bits, from two words."""
    bits = (high >> np.uint64(5)) * np.uint64(1 << 26) + (low >> np.uint64(6))
    return np.asarray((bits.astype(np.float64) + 0.5) * 2.0**-53)


def uniform(seed: int, purpose: Purpose, sender: object, receiver: object, sample: object) -> Array:
    """Numbers drawn evenly from (0, 1), one for each combination of the arguments; see `words`.

    Parameters
    ----------
    seed, purpose, sender, receiver, sample
        As for `words`.
    """
    a, b, _, _ = words(seed, purpose, sender, receiver, sample)
    return _open_unit(a, b)


def normal_axes(seed: int, purpose: Purpose, agents: object, sample: object, dimension: int) -> list[Array]:
    """Independent standard normal numbers along each axis; axes 0 and 1 share the first draw, axis 2 has the second.

    Parameters
    ----------
    seed, purpose, sample
        As for `words`.
    agents
        The agents.
    dimension
        Number of axes.
    """
    found: list[Array] = []
    for pair in range((dimension + 1) // IN_A_PAIR):
        found += normal_pairs(seed, purpose, agents, pair, sample)
    return found[:dimension]


def normal_pairs(seed: int, purpose: Purpose, sender: object, receiver: object, sample: object) -> tuple[Array, Array]:
    """Two independent standard normal numbers for each combination of the arguments (Box and Muller 1958).

    Parameters
    ----------
    seed, purpose, sender, receiver, sample
        As for `words`.
    """
    a, b, c, d = words(seed, purpose, sender, receiver, sample)
    radius = np.sqrt(-2.0 * np.log(_open_unit(a, b)))
    angle = 2.0 * np.pi * _open_unit(c, d)
    return np.asarray(radius * np.cos(angle)), np.asarray(radius * np.sin(angle))
