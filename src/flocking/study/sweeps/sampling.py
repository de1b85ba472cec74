"""Parameters of a sweep drawn from ranges: at random, by a Latin hypercube or a Sobol sequence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, integer, listed, number, one_of
from flocking.model.parts.seeds import takes_rng

METHODS = ("random", "latin", "sobol")

KEPT = 8
"""Points that the record of a sweep keeps: another sequence of random numbers differs in each of them."""

ROUNDED = 1e-9
"""Relative difference of a point and a kept one that is rounding: that of powers differs between machines by 1e-15."""

LARGEST_INTEGER = 2**53
"""Largest integer that is drawn: points are doubles first, which hold each integer up to there."""


@takes_rng
@dataclass(frozen=True)
class Sample:
    """Points drawn from ranges of parameters.

    Parameters
    ----------
    method
        ``"random"``: independent and uniform. ``"latin"``: a Latin hypercube, one point in each of ``count`` equal
        intervals of each range. ``"sobol"``: a scrambled Sobol sequence, which fills the ranges most evenly.
    count
        How many points.
    ranges
        Lowest and highest value of each parameter by name. Two integers give integers, the ends included.
    log
        Names of parameters whose logarithm is drawn evenly.
    seed
        Seed of the draw; the same seed gives the same points. ``rng`` is another name, see
        `flocking.model.parts.seeds.seed_from`.

    Raises
    ------
    InvalidInput
        When the method is unknown, a range is empty, or the logarithm of a range does not exist.
    """

    method: str
    count: int
    ranges: Mapping[str, tuple[float, float]]
    log: Sequence[str] = ()
    seed: int = 0
    _integers: tuple[bool, ...] = field(init=False, repr=False, compare=False, default=())

    def __post_init__(self) -> None:
        one_of("Sample", "method", self.method, METHODS)
        integer("Sample", "count", self.count, least=1)
        integer("Sample", "seed", self.seed, least=0)
        if not isinstance(self.ranges, Mapping) or not self.ranges:
            raise InvalidInput("Sample", "ranges", "must name at least one parameter", self.ranges)
        listed("Sample", "log", self.log, "must be names of parameters")
        integers = []
        for name, ends in self.ranges.items():
            where = f"ranges[{name!r}]"
            if not isinstance(ends, Sequence) or isinstance(ends, str) or len(ends) != 2:
                raise InvalidInput("Sample", where, "must be a lowest and a highest value", ends)
            low, high = (number("Sample", where, end) for end in ends)
            if not low < high:
                raise InvalidInput("Sample", where, "must have its lower end first", list(ends))
            if name in self.log and low <= 0:
                raise InvalidInput("Sample", where, "must be above 0 to be drawn by its logarithm", list(ends))
            integers.append(all(isinstance(end, int | np.integer) and not isinstance(end, bool) for end in ends))
            if integers[-1] and max(abs(int(end)) for end in ends) > LARGEST_INTEGER:
                rule = f"must have integers of at most {LARGEST_INTEGER} as its ends, up to which doubles hold each"
                raise InvalidInput("Sample", where, rule, list(ends))
        unknown = [name for name in self.log if not isinstance(name, str) or name not in self.ranges]
        if unknown:
            raise InvalidInput("Sample", "log", f"must be among {', '.join(self.ranges)}", unknown[0])
        object.__setattr__(self, "_integers", tuple(integers))

    def points(self) -> dict[str, tuple[float, ...]]:
        """The values drawn, one column per parameter."""
        shares = self._shares()
        columns: dict[str, tuple[float, ...]] = {}
        for k, (name, (low, high)) in enumerate(self.ranges.items()):
            integers = self._integers[k]
            first, last = (float(low) - 0.5, float(high) + 0.5) if integers else (float(low), float(high))
            if name in self.log:
                first = max(first, float(low) / 2)
                values = _between_logarithms(first, last, shares[:, k])
            else:
                values = _between(first, last, shares[:, k])
            if integers:
                columns[name] = tuple(int(v) for v in np.clip(np.rint(values), low, high))
            else:
                columns[name] = tuple(float(v) for v in np.clip(values, low, high))
        return columns

    def _shares(self) -> Array:
        """Points of the unit cube, shape (count, parameters)."""
        rng = np.random.default_rng(self.seed)
        size = len(self.ranges)
        if self.method == "random":
            return np.asarray(rng.random((self.count, size)))
        import warnings

        from scipy.stats import qmc

        if self.method == "latin":
            return np.asarray(qmc.LatinHypercube(size, rng=rng).random(self.count))
        with warnings.catch_warnings():
            # SciPy warns that counts other than powers of two balance less well.
            warnings.simplefilter("ignore", UserWarning)
            return np.asarray(qmc.Sobol(size, rng=rng).random(self.count))

    def as_data(self) -> dict[str, object]:
        """Plain data for the record of a sweep."""
        ranges = {
            name: [end.item() if isinstance(end, np.generic) else end for end in ends]
            for name, ends in self.ranges.items()
        }
        return {
            "method": self.method, "count": int(self.count), "ranges": ranges, "log": sorted(self.log),
            "seed": int(self.seed), "first": {name: list(column[:KEPT]) for name, column in self.points().items()},
        }  # fmt: skip

    def draws(self, first: object) -> bool:
        """Whether the points begin with those that a record keeps as ``first``; rounding of logarithms does not count.

        Parameters
        ----------
        first
            Columns by name, or None in records of versions that kept none.
        """
        if first is None:
            return True
        own = self.points()
        if not isinstance(first, dict) or first.keys() != own.keys():
            return False
        for name, column in own.items():
            kept = first[name]
            if not isinstance(kept, list) or len(kept) != len(column[:KEPT]):
                return False
            for mine, other in zip(column, kept, strict=False):
                if not isinstance(other, int | float) or not math.isclose(mine, other, rel_tol=ROUNDED):
                    return False
        return True


def _between(first: float, last: float, shares: Array) -> Array:
    """Numbers by their shares of an interval, whose length may exceed the largest double."""
    length = last - first
    return first + length * shares if np.isfinite(length) else (1.0 - shares) * first + shares * last


def _between_logarithms(first: float, last: float, shares: Array) -> Array:
    """Numbers by the shares of their logarithms; the quotient of the ends may exceed the largest double."""
    with np.errstate(over="ignore"):
        quotient = float(np.float64(last) / first)
    if np.isfinite(quotient):
        return np.asarray(first * quotient**shares)
    return np.asarray(np.exp(_between(float(np.log(first)), float(np.log(last)), shares)))
