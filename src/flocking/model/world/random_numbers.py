"""Counter-based random numbers: each draw is a function of what it is for, so no draw depends on another.

The generator is Philox4x32-10 (Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as easy as 1, 2, 3", 2011). The
key is the seed; the counter holds the index of the sample, the purpose of the draw, and the two agents that it is
about. Integers are the same bits on every machine and for any order of the draws.
"""

from __future__ import annotations

from enum import IntEnum
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array

Words = NDArray[np.integer]
"""Words of 32 bits, held in 64."""

Word = TypeVar("Word", int, Words)
"""One word, or many."""

ROUNDS = 10
"""Rounds of Philox4x32-10: the number at which its authors found all tests passed with a margin."""

MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
"""Multipliers of the rounds (Salmon et al. 2011, section 4)."""

WEYL = (0x9E3779B9, 0xBB67AE85)
"""What the key grows by each round: the golden ratio and the square root of 3, less 1, in 32 bits."""

WORD, HALF = 0xFFFFFFFF, 32
"""Mask of a word, and its bits: half of those of a product."""

WORDS_DRAWN = 4
"""Words of a counter, and of what is drawn for it."""

FEW_DRAWS = 8
"""Largest number of draws that integers of Python make in less time than arrays."""

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


def philox(counter: tuple[Word, Word, Word, Word], key: tuple[int, int]) -> tuple[Word, Word, Word, Word]:
    """Philox4x32-10 of a counter, or of many, and a key.

    Parameters
    ----------
    counter
        The four words of the counter: integers, or arrays that broadcast for several counters.
    key
        The two words of the key.

    Returns
    -------
    tuple
        Four random words for each counter.
    """
    a, b, c, d = counter
    k, m = key
    for _ in range(ROUNDS):
        first, second = MULTIPLIERS[0] * a, MULTIPLIERS[1] * c
        a, b, c, d = (second >> HALF) ^ b ^ k, second & WORD, (first >> HALF) ^ d ^ m, first & WORD
        k, m = (k + WEYL[0]) & WORD, (m + WEYL[1]) & WORD
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
    key, above = (seed & WORD, seed >> HALF), int(purpose) << PURPOSE_SHIFT
    together = np.broadcast(k, i, j)
    if together.size > FEW_DRAWS:
        return philox((k & np.uint64(WORD), (k >> np.uint64(HALF)) | np.uint64(above), i, j), key)
    drawn = [philox((x & WORD, (x >> HALF) | above, y, z), key) for x, y, z in (map(int, one) for one in together)]
    found = np.array(drawn, dtype=np.uint64).reshape(*together.shape, WORDS_DRAWN)
    return tuple(found[..., word] for word in range(WORDS_DRAWN))


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
