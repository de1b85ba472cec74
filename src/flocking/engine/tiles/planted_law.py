"""Simulation of a plant: agents follow another law than the declared one, which the ledger still uses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array, Reals
from flocking.engine.fixed_step.supported_bodies import is_point
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.kernels.layout import Layout
from flocking.engine.reference.plants import check_plant
from flocking.engine.tiles.kernels.parameters import KernelNumbers, kernel_numbers
from flocking.engine.tiles.kernels.spec import KernelSpec, check_supported
from flocking.engine.tiles.kernels.step_kernel import tile_kernels
from flocking.engine.tiles.kernels.tile_sums import sums_of
from flocking.errors import UnsupportedLaw
from flocking.model.law import Law, Scenario


def check_planted(scenario: Scenario, plant: Law) -> None:
    """Check that the agents of a scenario can follow a plant.

    Raises
    ------
    UnsupportedLaw
        When they are more than points, or a part of the plant needs another engine.
    InvalidInput
        When it is no plant of this law.
    """
    if not is_point(scenario.agents):
        raise UnsupportedLaw("The tiled engine runs plants of points alone. Use engine='exact'.")
    check_plant("TilesSession", scenario.law, plant)
    check_supported(scenario.with_(law=plant))


@dataclass(frozen=True)
class PassArrays:
    """The arrays of one pass of a kernel over all agents.

    Parameters
    ----------
    agents, successor
        Positions and velocities before and after the pass, shape (size, 2m).
    ids
        Number of the agent at each index, shape (size,).
    n
        Number of agents.
    means
        Centre of mass and its velocity, shape (2m,).
    velocity
        Velocity of the frame of the neighbour lists, shape (m,).
    extremes
        Largest squared speed, smallest squared distance and indicator of a broken link of every tile, shape (tiles, 3).
    """

    agents: Reals
    successor: Reals
    ids: NDArray[np.int32]
    n: int
    means: Array
    velocity: Reals
    extremes: Reals


class Planted:
    """The kernel of the plant, over the graphs of the declared law.

    Parameters
    ----------
    scenario
        The declared scenario.
    plant
        The law that agents follow.
    spec
        Specification of the kernel of the declared law.
    """

    def __init__(self, scenario: Scenario, plant: Law, spec: KernelSpec) -> None:
        self._scenario = scenario.with_(law=plant)
        layout = Layout(plant, scenario.energy, scenario.agents, scenario.space)
        self.spec = replace(spec, layout=layout, weights=layout.weight_kinds())
        self._move = tile_kernels(self.spec).move
        self._O = layout.obstacle_rows()
        self._numbers: KernelNumbers | None = None

    def pass_switch_time(self, t: float) -> None:
        """Use the values of scheduled gains from time ``t`` on."""
        self._numbers = kernel_numbers(self._scenario, self.spec, t)

    def move(self, workers: Workers, arrays: PassArrays, begin: tuple[object, ...], lists: list[object]) -> None:
        """Compute the next state under the plant; links and the ledger do not change.

        Parameters
        ----------
        workers
            Threads to use.
        arrays
            The state and the array for the next state.
        begin
            First arguments of the kernel, up to the factor of exponential damping.
        lists
            Arguments of the kernel for the lists.
        """
        assert self._numbers is not None, "call pass_switch_time first"
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
