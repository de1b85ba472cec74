"""How far agents have moved since their neighbour lists were built: whether the Verlet skin still covers it."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Reals
from flocking.engine.tiles.measures import squared_displacements
from flocking.engine.tiles.neighbours.neighbour_lists import WIDTH
from flocking.engine.tiles.threads import Workers

CERTAIN = 0.999
"""Share of half the skin that may be used up: the rest, a thousandth, is far above the rounding of the sum of some
thousand displacements, each by 6e-8 in single precision."""

GROWTH = 1.0 + 1e-6
"""Factor of the largest speed in the bound of a step's displacement: above the rounding of a speed that was computed in
single precision from a square."""

ROUNDINGS = 4.0
"""Units of rounding of the largest coordinate in a displacement: those of the two positions, of their difference, and
of the motion of the group that is subtracted."""


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
        """Time since then."""
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
        """Up to which displacement no pair can be missing in the lists."""
        return 0.5 * CERTAIN * self.skin

    def measured(self, agents: Reals, n: int, workers: Workers) -> float:
        """Bound on the displacement of any agent, from where they are.

        Parameters
        ----------
        agents
            Positions and velocities, shape (size, 2m).
        n
            Number of agents.
        workers
            Threads to use.
        """
        out = np.empty(len(agents) // WIDTH)
        shift = self.elapsed * self.velocity.astype(np.float64)
        workers.each(squared_displacements, len(out), agents, self.reference, shift, n, out)
        return float(np.sqrt(out.max())) + self.rounding
