"""Signs that a fixed step is unstable, read from the motion itself where no ledger tells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Reals
from flocking.engine.fixed_step.step_checks import step_too_large
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays

GROWING, LONGEST, LARGEST = 1.25, 16, 1e4
"""Speeds that grow by such a factor in every one of so many steps, and by so much in all, grow without bound. Under a
force that sets in, even one that rises with the square of time, the factor of a step is smaller after nine steps."""

WINDOW, PERIOD = 24, 256
"""Steps for which changes of velocity are compared, and from the begin of one window to that of the next."""

SAMPLE = 512
"""Agents looked at."""

FEWEST = 8
"""Pairs of successive changes that tell something."""

TURNS = 4
"""So many successive changes that each turn the one before round, and are no smaller than it by much, tell it too."""

ALTERNATING = -0.3
"""Changes of velocity of successive steps that point against each other so much, and do not die away: a motion that
the step resolves with fewer than four points a period."""

STILL = 30.0
"""Agents that move by fewer roundings of their place a step show nothing but rounding."""


@dataclass
class Instability:
    """What is remembered of the last steps.

    Parameters
    ----------
    speed
        Largest speed after the last step.
    streak, grown
        Number of steps for which it has grown without a pause, and its growth in that time.
    rebuilds, places
        Where the agents looked at lie since so many rebuilds.
    change
        Their changes of velocity in the last step of the window.
    products
        Sum over the window of the scalar products of successive changes.
    sizes
        The same of the products of their lengths.
    compared
        Number of pairs of successive changes.
    early
        Mean square of the changes in the first half of the comparisons.
    late
        The same of late, older ones with less and less weight.
    turns
        Number of successive changes, the last ones, each of which turned the one before it round and was as large.
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
        """A copy that shares nothing."""
        same = Instability(**vars(self))
        for name in ("places", "change"):
            value = getattr(self, name)
            setattr(same, name, None if value is None else value.copy())
        return same

    def look(
        self, particles: ParticleArrays, steps: int, h: float, longest: float, time: float, *, alternating: bool
    ) -> None:
        """Look at a step just made; the state before it is still in ``particles.Y``.

        Parameters
        ----------
        steps
            Number of steps before it.
        h, longest
            Its length, and that of the longest step.
        alternating
            Whether changes that alternate are a sign; a scheme that is stable for any damping has them.

        Raises
        ------
        StepTooLarge
            When the step is unstable.
        """
        factor = particles.top_speed / self.speed if self.speed > 0 else 0.0
        self.speed = particles.top_speed
        self.streak, self.grown = (self.streak + 1, self.grown * factor) if factor >= GROWING else (0, 1.0)
        if self.streak >= LONGEST and self.grown >= LARGEST:
            raise step_too_large(
                longest, 0.1 * h, f"the largest speed grew {self.grown:.2g} times in {self.streak} steps", time=time
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
                    longest, 0.2 * h, "velocities change to and fro from step to step and do not calm down", time=time
                )

    def _forget(self) -> None:
        self.change = None
        self.products = self.sizes = self.early = self.late = 0.0
        self.compared = self.turns = 0

    def _compare(self, particles: ParticleArrays) -> None:
        if self.rebuilds != particles.rebuilds or self.places is None:
            self.rebuilds, self.places = particles.rebuilds, particles.place[:: max(1, particles.n // SAMPLE)]
        m = particles.m
        change = particles.agents[self.places, m:].astype(np.float64) - particles.successor[self.places, m:]
        if self.change is not None:
            square, before = float((change**2).sum()), float((self.change**2).sum())
            product, size = float((change * self.change).sum()), float(np.sqrt(square * before))
            self.products += product
            self.sizes += size
            self.compared += 1
            if self.compared <= FEWEST // 2:
                self.early += square / (FEWEST // 2)
            self.late = 0.5 * (self.late + square)
            self.turns = self.turns + 1 if product < -0.5 * size and square >= 0.6 * before else 0
        self.change = change

    def _alternates(self, particles: ParticleArrays, h: float, *, full_window: bool) -> bool:
        """Whether changes of velocity alternate: the last ones, or over the ``full_window`` all together."""
        steadily = full_window and self.compared >= FEWEST and self.products < ALTERNATING * self.sizes
        if self.turns < TURNS and not (steadily and self.late >= 0.5 * self.early):
            return False
        largest = float(np.abs(particles.agents[self.places, : particles.m]).max())
        return bool(particles.top_speed * h > STILL * float(np.finfo(particles.dtype).eps) * largest)
