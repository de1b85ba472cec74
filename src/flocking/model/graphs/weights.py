"""Pair weights w_ij: an explicit matrix, or a hash of the pair for large groups."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from flocking.arrays import Indices, Numbers32
from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, number
from flocking.model.parts import values
from flocking.model.parts.description import Group, Short, add_group
from flocking.model.parts.registration import register_part
from flocking.model.parts.seeds import seed_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class PairWeights(ABC):
    """A weight for every ordered pair of agents."""

    symmetric: bool
    """Whether w_ij = w_ji for all pairs."""

    @abstractmethod
    def matrix(self, n: int) -> Array:
        """All weights as a matrix, shape (n, n)."""

    def check_count(self, n: int) -> None:
        """Check that there are weights for ``n`` agents; by default any number is accepted."""
        return None

    def of(self, headings: Array | None, n: int) -> Array:
        """All weights of agents with ``headings``, shape (n, n)."""
        return self.matrix(n)

    def of_pairs(self, i: Indices | Numbers32, j: Indices | Numbers32, headings: Array | None, n: int) -> Array:
        """Weights of some pairs of ``n`` agents, shape (K,).

        Parameters
        ----------
        i, j
            Numbers of the sensing and of the sensed agents, shape (K,).
        headings
            Headings of all agents, as in `Agents`.
        """
        return np.asarray(self.of(headings, n)[i, j])


@register_part()
@dataclass(frozen=True, eq=False)
class MatrixWeights(PairWeights):
    """Weights given as a matrix.

    Parameters
    ----------
    values
        Weights w_ij that agent i gives to agent j, shape (N, N); not negative.

    Raises
    ------
    InvalidInput
        If the matrix is not square, or a weight is negative or not finite.
    """

    values: Annotated[Array, values.PAIR_MATRIX]

    if TYPE_CHECKING:

        def __init__(self, values: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        values = array("Consensus", "weights", self.values, ndim=2, truth_values=True)
        if values.shape[0] != values.shape[1]:
            raise InvalidInput("Consensus", "weights", "must be a square matrix", f"shape {values.shape}")
        if (values < 0).any():
            raise InvalidInput("Consensus", "weights", "must not be negative", float(values.min()))
        object.__setattr__(self, "values", values)

    @property
    def symmetric(self) -> bool:  # type: ignore[override]
        """Whether the matrix is symmetric."""
        return bool((self.values == self.values.T).all())

    def check_count(self, n: int) -> None:
        """Check that the matrix is for ``n`` agents.

        Raises
        ------
        InvalidInput
            If it is for another number.
        """
        if len(self.values) != n:
            raise InvalidInput(
                "Consensus", "weights", f"must have shape ({n}, {n}) for {n} agents", f"shape {self.values.shape}"
            )

    def matrix(self, n: int) -> Array:
        """The matrix itself.

        Raises
        ------
        InvalidInput
            If it is for another number of agents than ``n``.
        """
        self.check_count(n)
        return self.values


def _of_rows(rows: object) -> MatrixWeights:
    return MatrixWeights(np.array(rows))


def _rows_of(weights: object) -> object:
    return weights.values if isinstance(weights, MatrixWeights) else weights


add_group(
    Group("weights", PairWeights, default="hashed", short=Short(values.ROWS, _of_rows, (MatrixWeights,), _rows_of))
)


@register_part("hashed")
@dataclass(frozen=True)
class HashedWeights(PairWeights):
    """Symmetric weights drawn from [low, high) by a hash of the pair, without storage.

    Parameters
    ----------
    low, high
        Range of the weights, 0 <= low <= high.
    seed
        Seed of the hash; the same seed gives the same weights for any number of agents.

    Raises
    ------
    InvalidInput
        If the range is empty or negative.
    """

    low: float
    high: float
    seed: Annotated[int, values.SEED]
    symmetric = True

    def __post_init__(self) -> None:
        low = number("HashedWeights", "low", self.low, least=0.0)
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", number("HashedWeights", "high", self.high, least=low))
        object.__setattr__(self, "seed", seed_number("HashedWeights", self.seed))

    def matrix(self, n: int) -> Array:
        """All weights, shape (n, n), with a zero diagonal."""
        i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
        values = self.of_pairs(i, j, None, n)
        np.fill_diagonal(values, 0.0)
        return values

    def of_pairs(self, i: Indices | Numbers32, j: Indices | Numbers32, headings: Array | None, n: int) -> Array:
        """Weights of some pairs, shape of ``i``."""
        return np.asarray(self.low + (self.high - self.low) * pair_uniform(self.seed, i, j))


GOLDEN, MIXERS = np.uint64(0x9E3779B97F4A7C15), (np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB))
"""Constants of splitmix64 (Steele, Lea and Flood 2014): 2^64 over the golden ratio, and two factors."""


def pair_uniform(seed: int, i: np.ndarray, j: np.ndarray) -> Array:
    """Numbers in [0, 1) that depend on the seed and the unordered pair alone (splitmix64)."""
    low = np.minimum(i, j).astype(np.uint64)
    high = np.maximum(i, j).astype(np.uint64)
    with np.errstate(over="ignore"):
        z = (high << np.uint64(32)) + low + np.uint64(seed % 2**64) * GOLDEN
        for _ in range(2):
            z = z + GOLDEN
            z = (z ^ (z >> np.uint64(30))) * MIXERS[0]
            z = (z ^ (z >> np.uint64(27))) * MIXERS[1]
            z = z ^ (z >> np.uint64(31))
    return np.asarray((z >> np.uint64(11)).astype(np.float64) / 2.0**53)
