"""Detection of an unstable time step from the motion, for runs without a ledger."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Reals
from flocking.engine.fixed_step.step_checks import step_too_large
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays

GROWING, LONGEST, LARGEST = 1.25, 16, 1e4
"""A step is unstable if the largest speed grows by at least this factor in each of so many consecutive steps, and by so
much in total. A force that sets in, even one that grows with the square of time, gives a smaller factor per step
after nine steps."""

WINDOW, PERIOD = 24, 256
"""Length of a window in which changes of velocity are compared, and distance of the starts of two windows, in steps."""

SAMPLE = 512
"""Number of sampled agents."""

FEWEST = 8
"""Smallest number of pairs of successive changes for a decision."""

TURNS = 4
"""A step is also unstable after this number of successive changes that each reverse the one before and are about as
large."""

ALTERNATING = -0.3
"""Correlation of successive changes of velocity below which they alternate. Alternation that does not decay means fewer
than four steps per period."""

GROWING_STEP, ALTERNATING_STEP = 0.1, 0.2
"""Recommended step relative to one that makes speeds grow, and to one whose velocities alternate."""

REVERSED, AS_LARGE = -0.5, 0.6
"""A change reverses the one before if their correlation is below the first, and is about as large if the ratio of their
mean squares is at least the second."""

STILL = 30.0
"""Agents whose displacement per step is below this number of rounding units are ignored: it is rounding noise."""


@dataclass
class Instability:
    """Statistics of the last steps.

    Parameters
    ----------
    speed
        Largest speed after the last step.
    streak, grown
        Number of consecutive steps in which it has grown, and its total growth in them.
    rebuilds, places
        Indices of the sampled agents in the arrays, valid for this number of rebuilds.
    change
        Their changes of velocity in the last step of the window.
    products
        Sum over the window of the scalar products of successive changes.
    sizes
        Sum over the window of the products of their norms.
    compared
        Number of pairs of successive changes.
    early
        Mean square of the changes in the first half of the comparisons.
    late
        Mean square of the recent changes, exponentially weighted.
    turns
        Number of most recent successive changes that each reversed the one before and were about as large.
    """

    speed: float = 0.0
    streak: int = 0
    grown: float = 1.0
    rebuilds: int = -1
    places: NDArray[np.int32] | None = None
    change: Reals | None = None
    products: float = 0.0
    sizes: float = 0.0
    compared: int = 0
    early: float = 0.0
    late: float = 0.0
    turns: int = 0

    def copy(self) -> Instability:
        """A deep copy."""
        same = Instability(**vars(self))
        for name in ("places", "change"):
            value = getattr(self, name)
            setattr(same, name, None if value is None else value.copy())
        return same

    def look(
        self, particles: ParticleArrays, steps: int, h: float, longest: float, time: float, *, alternating: bool
    ) -> None:
        """Update the statistics after a step; the state before it is still in ``particles.Y``.

        Parameters
        ----------
        steps
            Number of steps before it.
        h, longest
            Its length, and the largest step.
        alternating
            Whether alternating changes count as unstable; integrators that are stable for any damping produce them.

        Raises
        ------
        StepTooLarge
            If the step is unstable.
        """
        factor = particles.top_speed / self.speed if self.speed > 0 else 0.0
        self.speed = particles.top_speed
        self.streak, self.grown = (self.streak + 1, self.grown * factor) if factor >= GROWING else (0, 1.0)
        if self.streak >= LONGEST and self.grown >= LARGEST:
            raise step_too_large(
                longest,
                GROWING_STEP * h,
                f"the largest speed grew {self.grown:.2g} times in {self.streak} steps",
                time=time,
            )
        if not alternating:
            return
        at = steps % PERIOD
        if at == 0:
            self._forget()
        if at < WINDOW:
            self._compare(particles)
            if self._alternates(particles, h, full_window=at == WINDOW - 1):
                raise step_too_large(
                    longest, ALTERNATING_STEP * h, "velocities alternate from step to step without decaying", time=time
                )

    def _forget(self) -> None:
        self.change = None
        self.products = self.sizes = self.early = self.late = 0.0
        self.compared = self.turns = 0

    def _compare(self, particles: ParticleArrays) -> None:
        if self.rebuilds != particles.search.rebuilds or self.places is None:
            self.rebuilds, self.places = particles.search.rebuilds, self._sampled(particles)
        change = self._changes(particles)
        if self.change is not None:
            square, before = float((change**2).sum()), float((self.change**2).sum())
            product, size = float((change * self.change).sum()), float(np.sqrt(square * before))
            self.products += product
            self.sizes += size
            self.compared += 1
            if self.compared <= FEWEST // 2:
                self.early += square / (FEWEST // 2)
            self.late = 0.5 * (self.late + square)
            self.turns = self.turns + 1 if product < REVERSED * size and square >= AS_LARGE * before else 0
        self.change = change

    def _sampled(self, particles: ParticleArrays) -> NDArray[np.int32]:
        """Indices of the sampled agents."""
        return particles.place[:: max(1, particles.n // SAMPLE)]

    def _changes(self, particles: ParticleArrays) -> Reals:
        """Changes of the velocities of the sampled agents in the last step."""
        m = particles.m
        return particles.agents[self.places, m:].astype(np.float64) - particles.successor[self.places, m:]

    def _farthest(self, particles: ParticleArrays) -> float:
        """Largest coordinate of the sampled agents."""
        return float(np.abs(particles.agents[self.places, : particles.m]).max())

    def _alternates(self, particles: ParticleArrays, h: float, *, full_window: bool) -> bool:
        """Whether changes of velocity alternate: the most recent ones, or with ``full_window`` those of the window."""
        steadily = full_window and self.compared >= FEWEST and self.products < ALTERNATING * self.sizes
        if self.turns < TURNS and not (steadily and self.late >= 0.5 * self.early):
            return False
        return bool(particles.top_speed * h > STILL * float(np.finfo(particles.dtype).eps) * self._farthest(particles))
