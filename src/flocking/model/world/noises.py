"""Errors of what agents measure: independent from sample to sample, or correlated in time."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.model.checks import Array, number
from flocking.model.parts.description import Group, add_group
from flocking.model.parts.registration import register_part
from flocking.model.world.random_numbers import Purpose, normal_pairs


class Noise(ABC):
    """Errors of measured positions and velocities, whose standard deviations are `position` and `velocity`."""

    position: float
    velocity: float

    @property
    def ideal(self) -> bool:
        """Whether both standard deviations are zero."""
        return self.position == 0.0 and self.velocity == 0.0

    @property
    def summary(self) -> str:
        """The standard deviations."""
        return f"noise of {self.position:g} in positions and {self.velocity:g} in velocities"

    @abstractmethod
    def memory(self, period: float) -> float:
        """Correlation of the errors of two samples that are ``period`` apart, from 0 to below 1."""

    def normals(self, seed: int, agents: NDArray[np.integer], sample: NDArray[np.int64], m: int) -> tuple[Array, Array]:
        """Independent standard normal numbers of a sample, for positions and for velocities, shape (agents, m) each.

        Parameters
        ----------
        seed
            Seed of the world.
        agents, sample
            Who measures, and the index of each one's sample.
        m
            Number of axes.
        """
        found = [normal_pairs(seed, Purpose.NOISE, agents, axis, sample) for axis in range(m)]
        first, second = zip(*found, strict=True)
        return np.stack(first, axis=1), np.stack(second, axis=1)

    def next_errors(self, before: Array | None, normals: Array, memory: Array) -> Array:
        """Errors of a sample in units of the standard deviation, from those of the sample before.

        Parameters
        ----------
        before
            Errors of the sample before; None for the first, which is drawn from the stationary law.
        normals
            Independent standard normal numbers.
        memory
            What `memory` gives, for each row.
        """
        if before is None:
            return normals
        return np.asarray(memory * before + np.sqrt(1.0 - memory**2) * normals)


add_group(Group("noise", Noise, default="white"))


@register_part("white")
@dataclass(frozen=True)
class WhiteNoise(Noise):
    """Gaussian errors that are independent from sample to sample, axis to axis and agent to agent.

    Parameters
    ----------
    position, velocity
        Standard deviation along each axis; not negative.

    Raises
    ------
    InvalidInput
        When one is negative.
    """

    position: float = 0.0
    velocity: float = 0.0

    def __post_init__(self) -> None:
        for name in ("position", "velocity"):
            object.__setattr__(self, name, number("WhiteNoise", name, getattr(self, name), least=0.0))

    def memory(self, period: float) -> float:
        """Zero."""
        return 0.0


@register_part("ornstein-uhlenbeck")
@dataclass(frozen=True)
class OrnsteinUhlenbeck(Noise):
    """Gaussian errors that fade with a time constant: their correlation at a time t apart is exp(-t/time_constant).

    The process is stationary from the first sample on (Uhlenbeck and Ornstein 1930); samples follow it exactly.

    Parameters
    ----------
    position, velocity
        Stationary standard deviation along each axis; not negative.
    time_constant
        Correlation time; positive.

    Raises
    ------
    InvalidInput
        When a standard deviation is negative or the time constant not positive.
    """

    position: float = 0.0
    velocity: float = 0.0
    time_constant: float = 1.0

    def __post_init__(self) -> None:
        for name in ("position", "velocity"):
            object.__setattr__(self, name, number("OrnsteinUhlenbeck", name, getattr(self, name), least=0.0))
        constant = number("OrnsteinUhlenbeck", "time_constant", self.time_constant, above=0.0)
        object.__setattr__(self, "time_constant", constant)

    def memory(self, period: float) -> float:
        """``exp(-period/time_constant)``."""
        return math.exp(-period / self.time_constant)
