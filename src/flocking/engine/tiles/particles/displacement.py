"""Displacements since the last rebuild of the neighbour lists, as a bound for the Verlet skin."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Reals
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.measures import squared_displacements
from flocking.engine.tiles.neighbours.neighbour_lists import WIDTH

CERTAIN = 0.999
"""Largest displacement relative to half the skin. The remaining thousandth is far above the rounding error of a sum of
some thousand displacements, each with 6e-8 in single precision."""

GROWTH = 1.0 + 1e-6
"""Factor of the largest speed in the bound of a step's displacement; covers the rounding error of a speed that is
computed in single precision from a square."""

ROUNDINGS = 4.0
"""Rounding errors in a displacement, in units of the largest coordinate: of two positions, their difference, and the
subtracted motion of the group."""


class Displacement:
    """The displacements since the last rebuild, in a frame that moves with the group.

    Parameters
    ----------
    size
        Number of places.
    m
        Number of axes.
    dtype
        Precision of the positions.
    """

    def __init__(self, size: int, m: int, dtype: type[np.float32] | type[np.float64]) -> None:
        self.velocity: Reals = np.zeros(m, dtype)
        """Velocity of the frame, shape (m,)."""
        self.reference: Reals = np.empty((size, m), dtype)
        """Positions at the last rebuild, shape (size, m)."""
        self.elapsed = 0.0
        """Time since the last rebuild."""
        self.bound = np.inf
        """Bound on the displacement of any agent."""
        self.skin = 0.0
        """Width of the skin."""
        self.rounding = 0.0
        """Error of a displacement from rounding."""

    def begin(self, skin: float, velocity: Reals, farthest: float) -> None:
        """Prepare for a rebuild.

        Parameters
        ----------
        skin
            Width of the skin.
        velocity
            Velocity of the frame from now on, shape (m,).
        farthest
            The largest coordinate.
        """
        self.skin = skin
        self.velocity[:] = velocity
        self.rounding = ROUNDINGS * float(np.finfo(self.velocity.dtype).eps) * farthest

    def add(self, time: float, speed: float) -> None:
        """Add a step.

        Parameters
        ----------
        time
            Its length.
        speed
            The largest speed in it, in the frame.
        """
        self.elapsed += time
        self.bound += abs(time) * speed * GROWTH + self.rounding

    @property
    def allowed(self) -> float:
        """Largest displacement for which the lists contain every pair within the cutoff."""
        return 0.5 * CERTAIN * self.skin

    def measured(self, agents: Reals, n: int, workers: Workers) -> float:
        """Bound on the displacement of any agent, computed from the positions.

        Parameters
        ----------
        agents
            Positions and velocities, shape (size, 2m).
        n
            Number of agents.
        workers
            Threads to use.
        """
        out = np.empty(len(self.reference) // WIDTH)
        shift = self.elapsed * self.velocity.astype(np.float64)
        workers.each(squared_displacements, len(out), agents, self.reference, shift, n, out)
        return float(np.sqrt(out.max(initial=0.0))) + self.rounding
