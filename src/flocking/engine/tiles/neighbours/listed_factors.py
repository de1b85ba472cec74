"""Factors of headings beside the entries of neighbour lists, for cones whose links fade (Olfati-Saber (18)).

Headings are constant: the factor of a pair is found once, after its lists are built, and kernels read it.
"""

from __future__ import annotations

import math
from types import ModuleType

import numpy as np

from flocking.arrays import Array, Numbers32, Reals
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.neighbours.neighbour_lists import WIDTH, TileLists
from flocking.engine.tiles.simd.aligned_memory import aligned
from flocking.formula.compiled import generated_module
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.views import check_rotations
from flocking.model.potentials.bumps import Bump

KEPT = 2
"""Number of lists of one graph whose factors are kept: those of all agents, and those of what agents know."""
FEW_TURNS = 1e4
"""Largest difference of angles, in radians, from which whole turns are taken as products of two exact numbers."""
TURN = 201.0 / 32.0, 2.0 * math.pi - 201.0 / 32.0, 2.4492935982947064e-16
"""A whole turn in three parts: the first has few digits, so that its products with numbers of turns are exact, the last
is what the double precision number nearest to 2 pi lacks."""
MEASURES = {"real": 0, "wrapped": 1, "rotation": 2}
"""How the kernel compares angles, by the measure of the graph."""
MATRICES = 3
"""How it compares rotation matrices."""


class ListedFactors:
    """Factors rho(gap/phi_0) of the pairs in neighbour lists.

    Parameters
    ----------
    cone
        The graph.
    headings
        Headings of all agents, as in `Agents`.
    n
        Number of agents of the law.
    dtype
        Precision of the kernels.

    Raises
    ------
    InvalidInput
        When there are no headings of all agents, or none that can be compared so.
    """

    def __init__(
        self, cone: SmoothCone, headings: Array | None, n: int, dtype: type[np.float32] | type[np.float64]
    ) -> None:
        checked, weights = cone.checked_headings(headings, n), cone.view
        self._how = MATRICES if checked.ndim > 1 else MEASURES[cone.measure]
        if self._how == MATRICES:
            check_rotations(checked, cone.measure)
        self._size = checked.shape[1] if checked.ndim > 1 else 0
        self._table = np.ascontiguousarray(checked.reshape(n, -1), dtype=np.float64)
        self._numbers = weights.opening, weights.onset
        self._fill = _factor_kernel(weights.bump).fill
        self._dtype = dtype
        self._found: list[tuple[TileLists, Reals]] = []

    def of(self, lists: TileLists, n: int, ids: Numbers32, workers: Workers) -> Reals:
        """The factor of each entry, shape (16 rows,); those of agents with themselves are 1.

        Parameters
        ----------
        lists
            The lists; what was found for the same object before is returned again.
        n
            Number of agents that have lists.
        ids
            Number of the agent at each index, copies of agents of other processes included.
        workers
            Threads to use.
        """
        for known, factors in self._found:
            if known is lists:
                return factors
        factors = aligned((max(lists.rows.size, WIDTH),), self._dtype)
        workers.each(
            self._fill, len(lists.count), n, ids, self._table, self._how, self._size, *self._numbers, lists.rows,
            lists.first, lists.count, factors,
        )  # fmt: skip
        self._found = [(lists, factors), *self._found[: KEPT - 1]]
        return factors


def _factor_kernel(bump: Bump) -> ModuleType:
    """Module with the kernel ``fill`` of a bump function."""

    def stated() -> dict[str, object]:
        import sympy

        z, onset = sympy.Symbol("z", real=True), sympy.Symbol("onset", real=True)
        return {"factor": bump.expression(z, onset)}

    return generated_module("factors of headings", bump.structure, (bump,), stated, _source)


def _source(stated: dict[str, object]) -> str:
    from flocking.engine.kernels.source_text import indented
    from flocking.formula.printing import statements

    factor = statements(stated, arrays=False, prefix="f_")
    return (
        _HEADER
        + f"@native\ndef fill({', '.join(_ARGUMENTS)}):\n"
        + indented(["for tile in range(first_tile, last_tile):"], 1)
        + indented(["for row in range(first[tile], first[tile] + count[tile]):"], 2)
        + indented(["for lane in range(WIDTH):"], 3)
        + indented([*_PAIR, *factor, "factors[row * WIDTH + lane] = factor"], 4)
    )


_ARGUMENTS = (
    "first_tile", "last_tile", "n", "ids", "table", "how", "size", "opening", "onset", "rows", "first", "count",
    "factors",
)  # fmt: skip
_PAIR = [
    "i, j = tile * WIDTH + lane, np.int64(rows[row, lane] & NUMBER)",
    "z = 0.0",
    "if j != i and i < n:",
    "    z = gap_of(table, np.int64(ids[i]), np.int64(ids[j]), how, size) / opening",
]

_HEADER = f"""import math

import numpy as np

from flocking.formula.native.functions import native

WIDTH = {WIDTH}
NUMBER = np.uint32({2**31 - 1})


@native
def gap_of(table, a, b, how, size):
    if how == {MATRICES}:
        trace = 0.0
        for k in range(size * size):
            trace += table[b, k] * table[a, k]
        return min(max(0.5 * (size - trace), 0.0), 2.0 * (size // 2))
    gap = table[b, 0] - table[a, 0]
    if how == {MEASURES["rotation"]}:
        return 1.0 - math.cos(gap)
    if how == {MEASURES["wrapped"]} and abs(gap) > math.pi:
        if abs(gap) > {FEW_TURNS!r}:
            return abs(math.atan2(math.sin(gap), math.cos(gap)))
        turns = math.floor(gap / {2.0 * math.pi!r} + 0.5)
        gap = (gap - turns * {TURN[0]!r}) - turns * {TURN[1]!r} - turns * {TURN[2]!r}
    return abs(gap)


"""
