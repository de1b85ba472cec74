"""The numbers of a law as arguments of its tiled kernel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array
from flocking.engine.tiles.kernels.spec import KernelSpec
from flocking.model.graphs.smooth_cones import HeadingWeights
from flocking.model.graphs.weights import HashedWeights, MatrixWeights
from flocking.model.law import Scenario

KernelNumbers = tuple[Array, list[float | Array], NDArray[np.uint64], Array]
"""Single numbers, values per agent, hash seeds and matrices of pair weights, see `kernel_numbers`."""


def kernel_numbers(scenario: Scenario, spec: KernelSpec, t: float) -> KernelNumbers:
    """Numbers of a law at time ``t``.

    Parameters
    ----------
    spec
        What fixes the kernel.

    Returns
    -------
    tuple
        Single numbers (parameters, mass and damping where they are common, and two of each pair weight: the range of
        hashed ones, the width of a matrix); values per agent, first masses and damping, each one number or shape (N,);
        hash seeds; matrices of pair weights.
    """
    n = scenario.start.n
    numbers, rows, pairs = spec.layout.numbers(scenario.agents, t)
    numbers += [0.0 if np.ndim(value) else float(value) for value in rows[:2]]
    seeds = np.zeros(max(1, len(pairs)), np.uint64)
    matrices = np.zeros((1, 1))
    if any(isinstance(w, MatrixWeights) for w in pairs):
        matrices = np.zeros((len(pairs), n * n))
    for k, weights in enumerate(pairs):
        if isinstance(weights, HashedWeights):
            numbers += [weights.low, weights.high - weights.low]
            seeds[k] = weights.seed % 2**64
        elif isinstance(weights, MatrixWeights):
            numbers += [float(n), 0.0]
            matrices[k] = weights.values.ravel()
        elif isinstance(weights, HeadingWeights):
            numbers += [0.0, 0.0]
        else:
            raise TypeError(f"tiles takes no {type(weights).__name__}")
    return np.array(numbers, dtype=np.float64), rows, seeds, matrices
