"""Bodies that follow a desired velocity with a time constant, a largest acceleration and noise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from flocking.arrays import Indices
from flocking.errors import InvalidInput
from flocking.model.bodies.discrete_bodies import DiscreteBody
from flocking.model.bodies.vector_lengths import scaled
from flocking.model.checks import Array, integer, number, scalar_or_each, truth
from flocking.model.parts import values
from flocking.model.parts.registration import register_part
from flocking.model.parts.seeds import seed_number
from flocking.model.world.control import Control
from flocking.model.world.random_numbers import Purpose, normal_axes

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

MOST_SUBSTEPS = 10_000
"""Largest number of steps between two ticks: the work of a tick is that of so many evaluations."""

MOST_SHARE = 2.0
"""Share of the time constant that a step is below: then 1 - h/tau is above -1, and velocities come to w."""


@register_part("velocity_unit")
@dataclass(frozen=True, eq=False)
class VelocityUnit(DiscreteBody):
    """A vehicle that is given a velocity at ticks: dp/dt = (w - p)/tau within a largest acceleration, and white noise.

    The force of the law is the desired velocity w. It is held until the next tick, and the motion is computed by
    the Euler-Maruyama method in equal steps h: the place moves on with the velocity before the step, and the velocity
    by h (w - p)/tau, no longer than h a, and by sqrt(2 D h) N(0, 1) along each axis (Vasarhelyi et al. 2018). Where an
    agent measures itself, see `flocking.model.world.satellite_fixes.Fixes`, its autopilot compares w with p and the
    error of the velocity that it measured at the tick.

    Parameters
    ----------
    time_constant
        tau; positive.
    acceleration
        a, the largest acceleration; infinite when absent.
    speed
        Largest length of w, to which longer ones are scaled back; infinite when absent.
    fixed
        Whether every w is scaled to ``speed``, shorter ones too.
    diffusion
        D of the white noise, in squared velocity by time; not negative.
    substeps
        Number of steps between two ticks; so many that a step is shorter than two time constants.
    seed
        Seed of the noise.
    masses
        Weights of the agents in means; they do not enter the motion.

    Raises
    ------
    InvalidInput
        When a value is out of range.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.VelocityUnit(1.0, acceleration=6.0, speed=8.0).summary
    'velocities followed with a time constant of 1, acceleration up to 6, desired speed up to 8'
    """

    time_constant: float | Array
    acceleration: float | None = None
    speed: float | None = None
    fixed: bool = False
    diffusion: float = 0.0
    substeps: Annotated[int, values.INTEGER] = 20
    seed: Annotated[int, values.SEED] = 0
    masses: float | Array = 1.0
    update = "forward"
    moves_itself = True

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(
            self, time_constant: ArrayLike, acceleration: float | None = None, speed: float | None = None,
            fixed: bool = False, diffusion: float = 0.0, substeps: int = 20, seed: int = 0, masses: ArrayLike = 1.0,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        owner = "VelocityUnit"
        constant = scalar_or_each(owner, "time_constant", self.time_constant, above=0.0)
        object.__setattr__(self, "time_constant", constant)
        for name in ("acceleration", "speed"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, number(owner, name, getattr(self, name), above=0.0))
        object.__setattr__(self, "fixed", truth(owner, "fixed", self.fixed))
        if self.fixed and self.speed is None:
            raise InvalidInput(owner, "speed", "must be given where desired velocities are scaled to it", self.speed)
        object.__setattr__(self, "diffusion", number(owner, "diffusion", self.diffusion, least=0.0))
        object.__setattr__(self, "substeps", integer(owner, "substeps", self.substeps, least=1))
        if self.substeps > MOST_SUBSTEPS:
            raise InvalidInput(owner, "substeps", f"must be at most {MOST_SUBSTEPS}", self.substeps)
        object.__setattr__(self, "seed", seed_number(owner, self.seed))
        self.check_fields()

    @property
    def draws(self) -> bool:
        """Whether there is noise."""
        return self.diffusion > 0.0

    @property
    def parameters(self) -> dict[str, float | Array]:
        """The time constant."""
        return {"time_constant": self.time_constant}

    @property
    def summary(self) -> str:
        """Time constant, limits and noise."""
        found = [f"velocities followed with a time constant of {float(np.max(self.time_constant)):g}"]
        if self.acceleration is not None:
            found.append(f"acceleration up to {self.acceleration:g}")
        if self.speed is not None:
            found.append(f"desired speed {'of' if self.fixed else 'up to'} {self.speed:g}")
        if self.diffusion:
            found.append(f"white noise {self.diffusion:g}")
        return ", ".join(found)

    def check_scenario(self, control: Control, q: Array, p: Array) -> None:
        """Refuse control without ticks, or with different ticks of the agents, and steps that are too long.

        Parameters
        ----------
        control, q, p
            As for `flocking.model.bodies.body.Body.check_scenario`.

        Raises
        ------
        InvalidInput
            When it is so.
        """
        DiscreteBody.check_scenario(self, control, q, p)
        period, phase = (np.asarray(getattr(control, name), dtype=np.float64) for name in ("period", "phase"))
        if np.ptp(period) or np.any(phase):
            raise InvalidInput(
                "Held", "period", "must be the same for all VelocityUnit agents, without a phase", "another control"
            )
        # A step multiplies what is left of the difference from w by 1 - h/tau.
        fewest = float(np.max(period)) / (MOST_SHARE * float(np.min(self.time_constant)))
        if not self.substeps > fewest:
            raise InvalidInput(
                "VelocityUnit", "substeps", f"must be more than {fewest:g} for this period and time constant",
                self.substeps, "In steps of two time constants or more a velocity swings ever further.",
            )  # fmt: skip

    def updated(self, p: Array, u: Array, period: Array, agents: Indices, tick: Indices) -> Array:
        """The desired velocities w, from those of the law.

        Parameters
        ----------
        p, u, period, agents, tick
            As for `DiscreteBody.updated`.
        """
        if self.speed is None:
            return u
        with np.errstate(over="ignore"):
            length = np.linalg.norm(u, axis=1)
        return scaled(u, (length > 0.0) if self.fixed else (length > self.speed), self.speed)

    def moved(
        self, q: Array, p: Array, desired: Array, error: Array, period: float, tick: int
    ) -> tuple[Array, Array]:  # fmt: skip
        """Positions and velocities of all agents one period later, shape (N, m) each.

        Parameters
        ----------
        q, p
            Positions and velocities at the tick, shape (N, m).
        desired
            Desired velocities w, shape (N, m).
        error
            Errors of the velocities that agents measured at the tick, shape (N, m).
        period
            Time until the next tick.
        tick
            How often they have ticked before.
        """
        n, m = q.shape
        h = period / self.substeps
        rate = (h / np.broadcast_to(np.asarray(self.time_constant, dtype=np.float64), n))[:, None]
        goal, size = desired - error, math.sqrt(2.0 * self.diffusion * h)
        kicks = None
        if self.diffusion:
            samples = tick * self.substeps + np.arange(self.substeps)[:, None]
            kicks = size * np.stack(normal_axes(self.seed, Purpose.KICK, np.arange(n)[None, :], samples, m), axis=-1)
        for step in range(self.substeps):
            q = q + h * p
            change = rate * (goal - p)
            if self.acceleration is not None:
                with np.errstate(over="ignore"):
                    length = np.linalg.norm(change, axis=1)
                change = scaled(change, length > h * self.acceleration, h * self.acceleration)
            p = p + change if kicks is None else p + change + kicks[step]
        return q, p
