"""Arrays that begin with a line of memory: sixteen numbers of single precision, or two agents, are then read as one."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from flocking.formula.native.kinds import LINE

Element = TypeVar("Element", bound=np.generic)
"""Type of the elements of an array."""


def aligned(shape: tuple[int, ...], dtype: type[Element]) -> NDArray[Element]:
    """An array of arbitrary content that begins with a line of memory.

    Memory from the system begins 16 bytes behind one, so that each vector of a kernel lies in two lines.

    Parameters
    ----------
    shape
        Its shape.
    dtype
        Type of its elements.
    """
    size = math.prod(shape) * np.dtype(dtype).itemsize
    memory = np.empty(size + LINE, np.uint8)
    begin = -memory.ctypes.data % LINE
    found: NDArray[Element] = memory[begin : begin + size].view(dtype).reshape(shape)
    return found
