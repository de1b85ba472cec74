"""Checks that floating-point numbers resolve the positions and times of a run as finely as its tolerance requires."""

from __future__ import annotations

import numpy as np

from flocking.engine.adaptive_steps.state_tolerances import ORDINARY, natural_sizes
from flocking.engine.exact.dynamics import Dynamics
from flocking.engine.exact.origin import Origin
from flocking.errors import OutOfPrecision
from flocking.model.checks import Array
from flocking.model.law import Scenario

COARSEST = 10.0
"""Largest spacing of floating-point numbers, in tolerances."""

EPSILON = float(np.finfo(float).eps)
"""Spacing of the numbers of double precision next to 1, 2.2e-16."""

DISTANCE = 4.0
"""Bound on the rounding of a distance, in spacings of the coordinates: for two rounded coordinates in up to three
dimensions it is 2 sqrt(3) half spacings, and the rounding of the square root is added.
"""


def places_fine(largest: float, tolerance: float, finest: float) -> bool:
    """Whether coordinates up to ``largest`` are resolved finely enough; for native functions too.

    Parameters
    ----------
    tolerance
        Tolerance of the scenario, as a length: see `Precision.place`.
    finest
        See `Precision`.
    """
    far = EPSILON * largest
    return far <= COARSEST * tolerance and DISTANCE * far <= finest


def times_fine(time: float, speed: float, tolerance: float) -> bool:
    """Whether times are resolved finely enough for a ``speed``; for native functions too.

    Parameters
    ----------
    tolerance
        As for `places_fine`.
    """
    return EPSILON * abs(time) * speed <= COARSEST * tolerance


class Precision:
    """Checks every step of a session.

    Parameters
    ----------
    dynamics
        The law in force.
    origin
        The origin of the session's own time and coordinates.
    """

    def __init__(self, scenario: Scenario, dynamics: Dynamics, origin: Origin) -> None:
        self._tolerance = scenario.tolerance
        self._dynamics = dynamics
        self._origin = origin
        law = dynamics.layout.law
        self.timed = bool(law.body_terms)
        """Whether times matter."""
        finest = [np.inf]
        for graph in law.graphs:
            enter, leave = (np.asarray(r, dtype=np.float64).ravel() for r in (graph.appear_radius, graph.break_radius))
            finest += [float(x) for x in (*enter, *leave, *np.abs(leave - enter)) if 0 < x < np.inf]
        self.finest = min(finest)
        """The smallest difference of distances that decides about a link."""
        sizes = natural_sizes(scenario.start, scenario.t_end - scenario.start.t)
        self.length, self.speed = (size if 0.0 < size < ORDINARY else 1.0 for size in sizes)
        """Least length and speed that count, as for tolerances: 1, or what the motion has where that is smaller."""
        self.place = scenario.tolerance * self.length
        """Tolerance of places of a group no larger than this length."""

    def check(self, own: float, y: Array) -> None:
        """Check the state vector ``y`` at the session's own time.

        Raises
        ------
        OutOfPrecision
            When positions, links or times are finer than floating-point numbers resolve.
        """
        q, p, _ = self._dynamics.split(y)
        if not places_fine(float(np.abs(q).max(initial=0.0)), self.place, self.finest):
            self._check_places(own, q)
        time = self._origin.time_at(own)
        fastest = max(self.speed, float(np.abs(p).max(initial=0.0)))
        if self.timed and not times_fine(time, fastest, self.place):
            late = EPSILON * abs(time) * fastest
            if late > COARSEST * self._tolerance * max(self.length, _spread(q)):
                raise OutOfPrecision(
                    f"Times are resolved only to {EPSILON * abs(time):.2g}, too coarse for a tolerance "
                    f"of {self._tolerance:g}. Let the scenario, its leaders and its obstacles begin near t = 0.",
                    time=time,
                )  # fmt: skip

    def _check_places(self, own: float, q: Array) -> None:
        size = np.abs(q).max(axis=1)
        agent = int(np.argmax(size))
        if EPSILON * size[agent] > COARSEST * self._tolerance * max(self.length, _spread(q)):
            raise OutOfPrecision(
                f"Positions near {size[agent]:.3g} are resolved only to {EPSILON * size[agent]:.2g}, too coarse "
                f"for a tolerance of {self._tolerance:g}. Start near the origin, or raise Scenario.tolerance.",
                time=self._origin.time_at(own), agents=(agent,),
            )  # fmt: skip
        i, j = self._dynamics.linked_pairs()
        outer = EPSILON * np.maximum(size[i], size[j])
        if len(i) and DISTANCE * float(outer.max()) > self.finest:
            k = int(np.argmax(outer))
            raise OutOfPrecision(
                f"Positions are resolved only to {outer[k]:.2g}, too coarse for links that differ by "
                f"{self.finest:.2g} of distance. Start near the origin, or make the links coarser.",
                time=self._origin.time_at(own), agents=(int(i[k]), int(j[k])),
            )  # fmt: skip


def _spread(q: Array) -> float:
    return float(np.abs(q - q.mean(axis=0)).max(initial=0.0))
