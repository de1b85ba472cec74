"""Types of the arrays that go from one module to another: what an array holds, and its shape in words.

The type checker knows the number type, not the shape; the name says it to the reader. N is the number of agents, m the
number of space dimensions, T the number of frames.
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
"""Which entries are meant, of the shape of what it chooses from."""

Links = NDArray[np.bool_]
"""Who listens to whom: entry (i, j) when i has the neighbour j, shape (N, N)."""

Indices = NDArray[np.intp]
"""Places in an array, shape (K,)."""

Numbers = NDArray[np.int64]
"""Whole numbers, such as the numbers of agents, shape (K,)."""

Numbers32 = NDArray[np.int32]
"""Whole numbers in 32 bits, such as who lies in each place of the tiled engine, shape (K,)."""

PairIndices = NDArray[np.intp]
"""Pairs (i, j) of agents by their places in an array, shape (K, 2)."""

Records = NDArray[np.void]
"""Rows with named fields, shape (K,); the fields are those of the constant that is stated where it is used."""

Reals = NDArray[np.floating]
"""Numbers in the precision that an engine computes in."""

AnyArray = NDArray[Any]
"""An array whose type of number or record is known at run time alone, as that of a file."""
