"""Graphs over which formulas of a law are singular where two agents coincide."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from flocking.arrays import Array
from flocking.engine.kernels.codegen import array_kernels
from flocking.engine.kernels.layout import Layout


def singular_graphs(layout: Layout, dimension: int, P: Array) -> tuple[int, ...]:
    """Indices of the graphs over which a pair formula is infinite where two agents coincide.

    Parameters
    ----------
    layout
        The law and its slots.
    P
        Values of the single-number parameters.
    """
    module = array_kernels(layout, dimension)
    found = []
    for number in range(len(layout.law.graphs)):
        with np.errstate(all="ignore"):
            values = getattr(module, f"pair{number}")(P, _Resting())
        if not all(np.isfinite(values[name]).all() for name in ("along", "drag", "storage", "dissipation")):
            found.append(number)
    return tuple(found)


class _Resting(Mapping[str, Array]):
    """Values for a pair that coincides at rest: 0 for positions and velocities, 1 for parameters."""

    def __getitem__(self, name: str) -> Array:
        return np.ones(1) if name[0] in "AW" and name[1:].isdigit() else np.zeros(1)

    def __iter__(self) -> Iterator[str]:
        return iter(())

    def __len__(self) -> int:
        return 0
