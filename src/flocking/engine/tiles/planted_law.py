"""A crowd that obeys another law than the declared one, whose books are still those of the declared law."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flocking.engine.kernels.layout import Layout
from flocking.engine.tiles.kernels.parameters import kernel_numbers
from flocking.engine.tiles.kernels.step_kernel import tile_kernels
from flocking.engine.tiles.kernels.tile_sums import sums_of
from flocking.model.law import Law, Scenario

if TYPE_CHECKING:
    from flocking.engine.tiles.kernels.spec import KernelSpec
    from flocking.engine.tiles.particle_arrays import Crowd


class Planted:
    """The kernel of the law that agents really obey, over the graphs of the declared one.

    Parameters
    ----------
    scenario
        The declared scenario.
    plant
        The law that is obeyed.
    spec
        What the kernel of the declared law is made for.
    """

    def __init__(self, scenario: Scenario, plant: Law, spec: KernelSpec) -> None:
        self._scenario = scenario.with_(law=plant)
        layout = Layout(plant, scenario.energy)
        self.spec = replace(spec, layout=layout, weights=layout.weight_kinds())
        self._move = tile_kernels(self.spec).move
        self._O = layout.obstacle_rows()
        self._numbers: Any = None

    def pass_switch_time(self, t: float) -> None:
        """Take the values of scheduled gains from time ``t`` on."""
        self._numbers = kernel_numbers(self._scenario, self.spec, t)

    def move(self, crowd: Crowd, begin: tuple[Any, ...], lists: list[Any]) -> None:
        """Write the successor of the crowd's state under the plant; links and books stay as they are.

        Parameters
        ----------
        begin
            The kernel's first arguments, up to the factor of exponential damping.
        lists
            The kernel's lists.
        """
        P, rows, seeds, matrices = self._numbers
        A = np.zeros((len(rows), crowd.size), crowd.dtype)
        for row, value in zip(A, rows, strict=True):
            row[:] = np.asarray(value)[crowd.ids] if np.ndim(value) else value
        tops, sums = crowd.tops.copy(), np.zeros((crowd.tiles, len(sums_of(self.spec))))
        crowd.workers.each(
            self._move, crowd.tiles, *begin, True, crowd.agents, crowd.successor, crowd.n, *lists, P, A, self._O,
            crowd.ids, seeds, matrices, crowd.M, crowd.C, tops, sums,
        )  # fmt: skip
        crowd.tops[:, 0] = tops[:, 0]
