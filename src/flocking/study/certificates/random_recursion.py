"""Linear recursions in which some parts are present with a probability at each step, and their second moments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array
from flocking.study.certificates.enclosed_matrices import (
    INFLATION,
    EnclosedMatrix,
    exact,
    least_eigenvalue,
    multiple,
    rounding,
    spectral_radius,
    symmetric_eigenvalues,
    symmetric_part,
)

if TYPE_CHECKING:
    from scipy.sparse import csr_array
    from scipy.sparse.linalg import LinearOperator

SMALL = 6
"""Components up to which the map of moments is written out as a matrix."""

SETTLED, SEARCHED, RESTARTS = 1e-9, 30, 30
"""Relative error at which the iteration for the largest growth of second moments ends, its vectors, and its rounds."""

SOLVED, ROUNDS, SOLUTION_ERROR = 60, 10, 1e-13
"""Steps of each round, rounds and relative residual of the solution for moments, which is proven afterwards."""

CLOSE = 1e-4
"""Relative width at which an enclosed growth is narrow enough."""

START_SHARE, LOOKS, BETWEEN = 1e-4, 6, 15
"""Share of the unit matrix with which the search for a proof begins, its rounds, and steps from one to the next."""

DENSE = 0.2
"""Share of numbers other than zero above which full matrices are multiplied faster than sparse ones."""

MIXED, WIDENED = (0.0, 1e-12, 1e-8), (1e-12, 1e-9, 1e-6)
"""Shares of the unit matrix that are tried beside the dominant moment, which may be singular; relative widenings of a
computed bound that are tried until it is proven."""


@dataclass(frozen=True)
class Stationary:
    """A second moment in the long run.

    Parameters
    ----------
    moment
        The matrix, shape (D, D).
    error
        Bound of the spectral norm of its error.
    """

    moment: Array
    error: float


@dataclass(frozen=True, eq=False)
class RandomRecursion:
    """z' = (A + C D + sum of x_g B_g R_g) z + (C E + sum of x_g B_g N_g) w over groups g, with x_g of 0 or 1.

    The x_g are independent. Every number of the matrices has a relative error of at most `error`, and those of A, of
    the B_g and of the R_g beside it an error of at most a number of `absolute` each.

    Parameters
    ----------
    steady
        A, shape (D, D).
    always_into, always_out_of, always_noise
        C, D and E: what acts in every step, shapes (D, K), (K, D) and (K, W).
    into, out_of, noise
        All B_g side by side, all R_g and all N_g one below the other, shapes (D, G k), (G k, D) and (G k, W).
    width
        The k columns of each B_g.
    present
        Probability that x_g is 1.
    error
        Relative error of every number.
    absolute
        Largest further error of the numbers of A, of the B_g and of the R_g.
    """

    steady: Array
    always_into: Array
    always_out_of: Array
    always_noise: Array
    into: Array
    out_of: Array
    noise: Array
    width: int
    present: float
    error: float
    absolute: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def size(self) -> int:
        """Number of components D."""
        return len(self.steady)

    @property
    def is_random(self) -> bool:
        """Whether anything is left to chance."""
        return 0.0 < self.present < 1.0

    def without(self, vectors: Array, pivots: tuple[int, ...]) -> RandomRecursion:
        """The recursion of what is left when the pivot components are subtracted along some vectors.

        The span of the vectors must be kept by every step, and D and all R_g must vanish on it. Where a row of A, C or
        B_g has a number, the pivot's row must have the same one or none, so that no relative error grows; there must be
        no absolute errors.

        Parameters
        ----------
        vectors
            Vectors of zeros and ones, shape (V, D); each has a one at its own pivot alone of all pivots.
        pivots
            One component for each vector.
        """
        keep = np.setdiff1d(np.arange(self.size), pivots)
        left = np.eye(self.size)
        for vector, pivot in zip(vectors, pivots, strict=True):
            left[:, pivot] -= vector
        rows = left[keep]
        return replace(
            self, steady=(rows @ self.steady)[:, keep], always_into=rows @ self.always_into, into=rows @ self.into,
            always_out_of=self.always_out_of[:, keep], out_of=self.out_of[:, keep],
        )  # fmt: skip

    @property
    def sizes(self) -> RandomRecursion:
        """The same with the absolute values of all numbers."""
        names = ("steady", "always_into", "always_out_of", "always_noise", "into", "out_of", "noise")
        return replace(self, **{name: np.abs(getattr(self, name)) for name in names})

    @property
    def mean(self) -> Array:
        """The expected matrix of a step, shape (D, D)."""
        moved = self.always_into @ self.always_out_of + self.present * (self.into @ self.out_of)
        return self.steady + moved

    def _share(self) -> float:
        """Relative error of what `moment` computes, against the sums of absolute values."""
        terms = 4 * self.size + self.into.shape[1] + self.always_into.shape[1] + self.noise.shape[1]
        return 2.0 * rounding(terms) + 8.0 * self.error

    @cached_property
    def _largest(self) -> RandomRecursion:
        """The same with the largest absolute values that the numbers may have but for their relative errors."""
        sizes, (steady, into, out_of) = self.sizes, self.absolute
        return replace(sizes, steady=sizes.steady + steady, into=sizes.into + into, out_of=sizes.out_of + out_of)

    def _enclosed(self, values: Array, of: Callable[[RandomRecursion], Array]) -> EnclosedMatrix:
        """What was computed with its error, which follows from the sizes and the largest sizes of all numbers.

        Parameters
        ----------
        values
            The computed matrix.
        of
            The same sums of products of the numbers of any such recursion.
        """
        most = of(self._largest)
        if not any(self.absolute):
            return EnclosedMatrix(values, INFLATION * self._share() * most)
        # Both sums and their difference are rounded.
        return EnclosedMatrix(values, INFLATION * (3.0 * self._share() * most + np.abs(most - of(self.sizes))))

    def enclosed_mean(self) -> EnclosedMatrix:
        """`mean` with its error."""
        return self._enclosed(self.mean, lambda x: x.mean)

    def _spread(self, inner: Array) -> Array:
        """What chance adds to a second moment: the sum of B_g M_g B_g^T p (1 - p) over all groups.

        Parameters
        ----------
        inner
            The moments M_g, shape (G, k, k).
        """
        return np.asarray(self.present * (1.0 - self.present) * self._collected(inner))

    def _collected(self, inner: Array) -> Array:
        count, size = len(inner), len(inner) * self.width
        if self._are_dense:
            blocks = self.into.reshape(self.size, count, self.width).transpose(1, 0, 2) @ inner
            return np.asarray(blocks.transpose(1, 0, 2).reshape(self.size, size) @ self.into.T)
        from scipy.sparse import bsr_array

        middle = bsr_array((inner, np.arange(count), np.arange(count + 1)), shape=(size, size))
        return np.asarray((self._sparse_into @ middle @ self._sparse_into.T).toarray())

    @cached_property
    def _are_dense(self) -> bool:
        return bool(np.count_nonzero(self.into) > DENSE * self.into.size)

    @cached_property
    def _sparse_into(self) -> csr_array:
        """All B_g: each row of a message changes a few components alone."""
        from scipy.sparse import csr_array

        return csr_array(self.into)

    @cached_property
    def _sparse_out_of(self) -> csr_array | Array:
        """All R_g."""
        from scipy.sparse import csr_array

        return self.out_of if self._are_dense else csr_array(self.out_of)

    def _inner(self, left: Array, right: Array) -> Array:
        """Products of the rows of each group, shape (G, k, k).

        Parameters
        ----------
        left, right
            Two vectors for each row, shape (G k, V).
        """
        shape = (-1, self.width, left.shape[1])
        return np.asarray(left.reshape(shape) @ right.reshape(shape).transpose(0, 2, 1))

    def moment(self, x: Array, mean: Array | None = None) -> Array:
        """The expected second moment after a step without noise, of the moment ``x`` before it.

        Parameters
        ----------
        x
            Symmetric, shape (D, D).
        mean
            `mean`, where it is at hand.
        """
        mean = self.mean if mean is None else mean
        found = mean @ x @ mean.T
        if self.is_random:
            found = found + self._spread(self._inner(self._sparse_out_of @ x, self.out_of))
        return np.asarray(0.5 * (found + found.T))

    def enclosed_moment(self, x: Array) -> EnclosedMatrix:
        """`moment` with its error.

        Parameters
        ----------
        x
            As in `moment`.
        """
        return self._enclosed(self.moment(x), lambda one: one.moment(np.abs(x)))

    def noise_moment(self) -> EnclosedMatrix:
        """Second moment that noise of unit variance adds in every step, with its error."""
        return self._enclosed(self._noise_moment(), lambda x: x._noise_moment())

    def _noise_moment(self) -> Array:
        mean = self.always_into @ self.always_noise + self.present * (self.into @ self.noise)
        found = mean @ mean.T
        if self.is_random:
            found = found + self._spread(self._inner(self.noise, self.noise))
        return 0.5 * (found + found.T)

    def growth(self) -> tuple[float, float]:
        """Two numbers between which the factor lies by which second moments grow in each step, in the long run.

        A map of symmetric matrices that keeps positive ones positive grows by at most c where it maps some positive
        definite X below c X, and by at least c where it maps it above c X (Krein and Rutman; Collatz 1942). Without
        chance it is the square of the spectral radius.
        """
        if not self.is_random:
            lo, hi = spectral_radius(self.enclosed_mean())
            return np.nextafter(lo * lo, 0.0), np.nextafter(hi * hi, np.inf)
        x, rate = self.dominant()
        best_lo, best_hi = 0.0, np.inf
        if not 0.0 < rate < np.inf:
            return best_lo, best_hi
        x = x + START_SHARE * np.eye(self.size)
        for _ in range(LOOKS):
            for share in MIXED:
                lo, hi = self.bounds(x + share * np.eye(self.size))
                best_lo, best_hi = max(best_lo, lo), min(best_hi, hi)
            if best_hi - best_lo <= CLOSE * best_hi:
                break
            # What grows less fades; all stays positive definite.
            for _ in range(BETWEEN):
                x = self.moment(x) / rate
        if not best_hi - rate <= 10.0 * CLOSE * rate:
            # X = E(X)/c + 1 with c above the growth has E(X) = c (X - 1), below c X even where E is far from symmetric.
            solved = self._solved(np.eye(self.size), rate * (1.0 + CLOSE))
            if solved is not None:
                best_hi = min(best_hi, self.bounds(solved)[1])
        return best_lo, best_hi

    def _on_moments(self, left: float, right: float) -> LinearOperator:
        """``left`` times a moment plus ``right`` times what becomes of it in a step, on flattened matrices."""
        from scipy.sparse.linalg import LinearOperator

        n, mean = self.size, self.mean

        def mapped(flat: Array) -> Array:
            x = np.asarray(flat).reshape(n, n)
            x = 0.5 * (x + x.T)
            return (left * x + right * self.moment(x, mean)).ravel()

        return LinearOperator((n * n, n * n), matvec=mapped, dtype=np.float64)

    def _solved(self, added: Array, rate: float = 1.0) -> Array | None:
        """About the X with X = E(X)/rate + added; None where it is not finite."""
        from scipy.sparse.linalg import gmres

        found, _ = gmres(
            self._on_moments(1.0, -1.0 / rate), added.ravel(), rtol=SOLUTION_ERROR, maxiter=ROUNDS, restart=SOLVED
        )
        x = np.asarray(found).reshape(self.size, self.size)
        return 0.5 * (x + x.T) if np.isfinite(x).all() else None

    def dominant(self) -> tuple[Array, float]:
        """A moment that grows at nearly the largest rate, of trace 1, and about that rate; nothing is certain of it."""
        from scipy.sparse.linalg import ArpackError, eigs

        n = self.size
        operator = self._on_moments(0.0, 1.0)
        try:
            if n <= SMALL:
                values, vectors = np.linalg.eig(operator @ np.eye(n * n))
            else:
                # A fixed vector to begin with, so that the same numbers come each time.
                values, vectors = eigs(
                    operator, k=1, which="LR", v0=np.eye(n).ravel(), tol=SETTLED, ncv=SEARCHED, maxiter=RESTARTS
                )
        except ArpackError:
            return self._iterated()
        first = int(np.argmax(np.real(values)))
        x = np.real(vectors[:, first]).reshape(n, n)
        x = 0.5 * (x + x.T)
        trace = float(np.trace(x))
        return (x / trace, float(np.real(values[first]))) if trace else self._iterated()

    def _iterated(self) -> tuple[Array, float]:
        """The same by repeated steps."""
        x, mean, rate = np.eye(self.size) / self.size, self.mean, 1.0
        for _ in range(SEARCHED * RESTARTS):
            x = self.moment(x, mean)
            rate = float(np.trace(x))
            if not 0.0 < rate < np.inf:
                return np.eye(self.size), np.nan
            x = x / rate
        return x, rate

    def bounds(self, x: Array) -> tuple[float, float]:
        """Bounds of the growth from one symmetric matrix, shape (D, D); 0 and infinity where it proves nothing.

        Parameters
        ----------
        x
            A positive definite matrix.
        """
        from scipy.linalg import solve_triangular

        if not np.isfinite(x).all():
            return 0.0, np.inf
        try:
            root = np.linalg.cholesky(x)
        except np.linalg.LinAlgError:
            return 0.0, np.inf
        # Seen through the inverse root, which is triangular and therefore regular, X is nearly the unit matrix.
        through = exact(solve_triangular(root, np.eye(self.size), lower=True))
        unit = through @ exact(x) @ through.transposed
        after = through @ self.enclosed_moment(x) @ through.transposed
        if not np.isfinite(after.values).all() or not least_eigenvalue(symmetric_part(unit)) > 0.0:
            return 0.0, np.inf
        ratios, radius = symmetric_eigenvalues(symmetric_part(after))
        lo, hi = 0.0, np.inf
        # The bound is found by floating point and proven here.
        for slack in WIDENED:
            above = (float(ratios[-1]) + radius) * (1.0 + slack)
            if np.isinf(hi) and least_eigenvalue(symmetric_part(multiple(unit, above) - after)) >= 0.0:
                hi = above
            below = (float(ratios[0]) - radius) * (1.0 - slack)
            if lo == 0.0 and below > 0.0 and least_eigenvalue(symmetric_part(after - multiple(unit, below))) >= 0.0:
                lo = below
        return lo, hi

    def largest_growth(self) -> float:
        """About the factor by which second moments grow in each step; nothing is certain of it."""
        if not self.is_random:
            return float(np.abs(np.linalg.eigvals(self.mean)).max(initial=0.0)) ** 2
        return self.dominant()[1]

    def scaled_noise(self, factors: Array) -> RandomRecursion:
        """The same with each component of the noise multiplied by a factor.

        Parameters
        ----------
        factors
            One for each component, shape (W,).
        """
        return replace(self, noise=self.noise * factors, always_noise=self.always_noise * factors)

    def stationary(self) -> Stationary | None:
        """Second moment under noise of unit variance in the long run, with a bound of its error.

        None where no bound was proven. With Y positive definite and Y - E(Y) at least m > 0, E the step of moments, the
        moment differs from X by at most |X - E(X) - noise| |Y|/m.
        """
        added = self.noise_moment()
        x, y = self._solved(added.values), self._solved(np.eye(self.size))
        if x is None or y is None:
            return None
        least = least_eigenvalue(exact(y) - self.enclosed_moment(y))
        if not (least > 0.0 and least_eigenvalue(exact(y)) > 0.0):
            return None
        rest = exact(x) - self.enclosed_moment(x) - added
        size = float(np.linalg.norm(np.abs(rest.values) + rest.error))
        return Stationary(x, INFLATION * size * float(np.linalg.norm(y)) / least)
