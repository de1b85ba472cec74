"""Types of arrays: what an array holds, and its shape in words.

The type checker checks the number type, not the shape; the name states it for the reader. N is the number of agents, m
the number of space dimensions, T the number of frames.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers in double precision, of the shape that is stated where it is used."""

Positions = NDArray[np.float64]
"""Places of all agents, shape (N, m)."""

Velocities = NDArray[np.float64]
"""Velocities of all agents, shape (N, m)."""

Forces = NDArray[np.float64]
"""Forces on all agents, or their controls, shape (N, m)."""

Vector = NDArray[np.float64]
"""A place, a velocity or another vector of space, shape (m,)."""

PerAgent = NDArray[np.float64]
"""One number for each agent, shape (N,)."""

Times = NDArray[np.float64]
"""Ascending times, shape (T,)."""

Mask = NDArray[np.bool_]
"""Boolean mask, of the shape of the array that it selects from."""

Links = NDArray[np.bool_]
"""Link matrix: entry (i, j) is true when i has the neighbour j, shape (N, N)."""

Indices = NDArray[np.intp]
"""Indices into an array, shape (K,)."""

Numbers = NDArray[np.int64]
"""Integers, such as the numbers of agents, shape (K,)."""

Numbers32 = NDArray[np.int32]
"""Integers in 32 bits, such as the agent at each place of the tiled engine, shape (K,)."""

Records = NDArray[np.void]
"""Structured rows, shape (K,); the fields are those of a constant that is named at each use."""

Reals = NDArray[np.floating]
"""Numbers in the precision of an engine."""

AnyArray = NDArray[Any]
"""An array whose type is known only at run time, as that of a file."""
