"""Agents that obey another law than the declared one, while the ledger goes on holding the declared law."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array, Reals
from flocking.engine.kernels.layout import Layout
from flocking.engine.tiles.kernels.parameters import KernelNumbers, kernel_numbers
from flocking.engine.tiles.kernels.spec import KernelSpec
from flocking.engine.tiles.kernels.step_kernel import tile_kernels
from flocking.engine.tiles.kernels.tile_sums import sums_of
from flocking.engine.tiles.threads import Workers
from flocking.model.law import Law, Scenario


@dataclass(frozen=True)
class PassArrays:
    """The arrays of one pass of a kernel over all agents.

    Parameters
    ----------
    agents, successor
        Positions and velocities before and after the pass, shape (size, 2m).
    ids
        Which agent lies where, shape (size,).
    n
        Number of agents.
    means
        Centre of mass and its velocity, shape (2m,).
    velocity
        Velocity of the frame that neighbour lists are kept in, shape (m,).
    extremes
        Largest squared speed, smallest squared distance and broken link of every tile, shape (tiles, 3).
    """

    agents: Reals
    successor: Reals
    ids: NDArray[np.int32]
    n: int
    means: Array
    velocity: Reals
    extremes: Reals


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
        layout = Layout(plant, scenario.energy, scenario.agents)
        self.spec = replace(spec, layout=layout, weights=layout.weight_kinds())
        self._move = tile_kernels(self.spec).move
        self._O = layout.obstacle_rows()
        self._numbers: KernelNumbers | None = None

    def pass_switch_time(self, t: float) -> None:
        """Take the values of scheduled gains from time ``t`` on."""
        self._numbers = kernel_numbers(self._scenario, self.spec, t)

    def move(self, workers: Workers, arrays: PassArrays, begin: tuple[object, ...], lists: list[object]) -> None:
        """Write the successor of the state under the plant; links and the ledger stay as they are.

        Parameters
        ----------
        workers
            Threads to use.
        arrays
            The state and where its successor goes.
        begin
            The kernel's first arguments, up to the factor of exponential damping.
        lists
            The kernel's lists.
        """
        assert self._numbers is not None, "pass_switch_time comes first"
        P, rows, seeds, matrices = self._numbers
        tiles = len(arrays.extremes)
        A = np.zeros((len(rows), len(arrays.ids)), arrays.agents.dtype)
        for row, value in zip(A, rows, strict=True):
            row[:] = np.asarray(value)[arrays.ids] if np.ndim(value) else value
        extremes, sums = arrays.extremes.copy(), np.zeros((tiles, len(sums_of(self.spec))))
        workers.each(
            self._move, tiles, *begin, True, arrays.agents, arrays.successor, arrays.n, *lists, P, A, self._O,
            arrays.ids, seeds, matrices, arrays.means, arrays.velocity, extremes, sums,
        )  # fmt: skip
        arrays.extremes[:, 0] = extremes[:, 0]
