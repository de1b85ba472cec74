"""Matrices of which every element is known to within an error, and what is certain of their eigenvalues."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array

UNIT = 2.0**-53
"""Unit of rounding of double precision."""

INFLATION = 1.0 + 1e-9
"""Factor for the rounding of the bounds themselves, which are sums of nonnegative numbers."""


def rounding(terms: int) -> float:
    """Bound of the relative rounding error of a sum of products, against the sum of the absolute values.

    Parameters
    ----------
    terms
        Number of products (Higham, Accuracy and Stability of Numerical Algorithms, 3.1 and 3.5); two more are counted.
    """
    return (terms + 2) * UNIT / (1.0 - (terms + 2) * UNIT)


def unit_of_rates(square: float) -> float:
    """A power of two near the root of a number, one over a squared time: a unit of rates, and dividing by it rounds
    nothing.

    Parameters
    ----------
    square
        The number, for example the largest stiffness per mass.
    """
    return float(2.0 ** np.round(0.5 * np.log2(square)))


def norm_bound(matrix: Array) -> float:
    """A bound of the spectral norm of any matrix whose elements are not larger than those of this one.

    Parameters
    ----------
    matrix
        Elements that are not negative, shape (n, m).
    """
    # A bound that overflows is infinite and proves nothing.
    with np.errstate(over="ignore"):
        return INFLATION * float(np.sqrt(matrix.sum(axis=0).max(initial=0.0) * matrix.sum(axis=1).max(initial=0.0)))


@dataclass(frozen=True, eq=False)
class EnclosedMatrix:
    """All matrices that differ from one by no more than an error, element by element.

    Parameters
    ----------
    values
        The matrix in the middle, shape (n, m).
    error
        Largest difference of each element, not negative, of the same shape.
    """

    values: Array
    error: Array

    def __matmul__(self, other: EnclosedMatrix) -> EnclosedMatrix:
        size, others = np.abs(self.values), np.abs(other.values)
        share = rounding(self.values.shape[1])
        # |AB - ab| <= |a| eB + eA |b| + eA eB, and the rounding of the product.
        error = size @ other.error + self.error @ (others + other.error) + share * (size @ others)
        return EnclosedMatrix(self.values @ other.values, INFLATION * error)

    def __add__(self, other: EnclosedMatrix) -> EnclosedMatrix:
        total = self.values + other.values
        return EnclosedMatrix(total, INFLATION * (self.error + other.error + UNIT * np.abs(total)))

    def __neg__(self) -> EnclosedMatrix:
        return EnclosedMatrix(-self.values, self.error)

    def __sub__(self, other: EnclosedMatrix) -> EnclosedMatrix:
        return self + (-other)

    @property
    def transposed(self) -> EnclosedMatrix:
        """The transposed matrices."""
        return EnclosedMatrix(self.values.T, self.error.T)


def exact(values: Array) -> EnclosedMatrix:
    """A matrix whose elements are known exactly.

    Parameters
    ----------
    values
        The matrix.
    """
    values = np.asarray(values, dtype=np.float64)
    return EnclosedMatrix(values, np.zeros_like(values))


def multiple(x: EnclosedMatrix, factor: float) -> EnclosedMatrix:
    """Matrices times a positive number.

    Parameters
    ----------
    x
        The matrices.
    factor
        The number, exact.
    """
    found = factor * x.values
    return EnclosedMatrix(found, INFLATION * (factor * x.error + rounding(1) * np.abs(found)))


def symmetric_part(x: EnclosedMatrix) -> EnclosedMatrix:
    """The symmetric ones of some matrices, their middle made symmetric.

    Parameters
    ----------
    x
        The matrices, square.
    """
    return EnclosedMatrix(0.5 * (x.values + x.values.T), INFLATION * 0.5 * (x.error + x.error.T))


def symmetric_eigenvalues(matrix: EnclosedMatrix) -> tuple[Array, float]:
    """Eigenvalues of symmetric matrices, ascending, shape (n,), and how far each is at most from its own.

    With computed eigenvectors V and eigenvalues D, Q the orthogonal factor nearest to V, and
    e = |V^T V - I| >= |V - Q|: Q^T A Q = D + F with |F| <= |A V - V D| + (|A| + |D|) e, and by Weyl's inequality no
    eigenvalue of A is farther than |F| from its own of D.

    Parameters
    ----------
    matrix
        A matrix whose values are symmetric; of those that it stands for the symmetric ones are meant.
    """
    n = len(matrix.values)
    values, vectors = np.linalg.eigh(matrix.values)
    share = rounding(n)
    size_a, size_v, size_d = np.abs(matrix.values), np.abs(vectors), np.abs(values)
    residual = np.abs(matrix.values @ vectors - vectors * values) + share * (size_a @ size_v + size_v * size_d)
    overlap = np.abs(vectors.T @ vectors - np.eye(n)) + share * (size_v.T @ size_v + np.eye(n))
    largest = float(size_a.sum(axis=1).max(initial=0.0)) + float(size_d.max(initial=0.0))
    radius = norm_bound(residual) + largest * norm_bound(overlap) + norm_bound(matrix.error)
    return values, INFLATION * radius


def least_eigenvalue(matrix: EnclosedMatrix) -> float:
    """A number that no eigenvalue of a symmetric matrix lies below.

    Parameters
    ----------
    matrix
        As for `symmetric_eigenvalues`.
    """
    if not (np.isfinite(matrix.values).all() and np.isfinite(matrix.error).all()):
        return -np.inf
    values, radius = symmetric_eigenvalues(matrix)
    return float(np.nextafter(values[0] - radius, -np.inf))


def eigenvalues(matrix: EnclosedMatrix) -> tuple[NDArray[np.complex128], float] | None:
    """Eigenvalues of any square matrices, complex, shape (n,), and a radius.

    The discs of this radius about them hold all eigenvalues, and every union of discs that touches no other disc holds
    as many as it has centres. For computed eigenvectors V and eigenvalues D, and an approximate inverse W of V with
    |I - W V| = e < 1: V^-1 A V = D + F with |F| <= |W (A V - V D)|/(1 - e); D is normal, and the eigenvalues follow
    F continuously (Bauer and Fike 1960). None where the eigenvectors are too close to dependent for this.

    Parameters
    ----------
    matrix
        A square matrix.
    """
    n = len(matrix.values)
    if not n:
        return np.empty(0, dtype=np.complex128), 0.0
    values, vectors = np.linalg.eig(matrix.values)
    try:
        inverse = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return None
    # A complex product is the sum of two real ones for each part.
    share = 4.0 * rounding(2 * n)
    size_a, size_v, size_d, size_w = (np.abs(x) for x in (matrix.values, vectors, values, inverse))
    residual = np.abs(matrix.values @ vectors - vectors * values)
    residual = residual + share * (size_a @ size_v + size_v * size_d) + matrix.error @ size_v
    overlap = np.abs(inverse @ vectors - np.eye(n)) + share * (size_w @ size_v + np.eye(n))
    e = norm_bound(overlap)
    if not e < 1.0:
        return None
    radius = norm_bound(INFLATION * (size_w @ residual)) / (1.0 - e)
    return np.asarray(values, dtype=np.complex128), INFLATION * radius


def spectral_radius(matrix: EnclosedMatrix) -> tuple[float, float]:
    """Two numbers between which the largest modulus of an eigenvalue lies; infinite above where nothing is known.

    Parameters
    ----------
    matrix
        A square matrix.
    """
    found = eigenvalues(matrix)
    if found is None:
        return 0.0, np.inf
    values, radius = found
    largest = float(np.abs(values).max(initial=0.0)) * (1.0 + 4.0 * UNIT)
    return max(0.0, largest * (1.0 - 8.0 * UNIT) - radius), float(np.nextafter(largest + radius, np.inf))
