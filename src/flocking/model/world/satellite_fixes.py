"""What agents know by satellite fixes: themselves now, others late, with errors that drift."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, number
from flocking.model.parts import values
from flocking.model.parts.registration import register_part
from flocking.model.parts.seeds import seed_number
from flocking.model.symmetries import DRAWN, SYMMETRIES
from flocking.model.world.information import Information
from flocking.model.world.random_numbers import Purpose, normal_pairs
from flocking.model.world.times import nanoseconds

BOUNDED = 4.0
"""What period (2 damping + period stiffness) stays below where both eigenvalues of a step are below 1 in size."""


@register_part("fixes")
@dataclass(frozen=True)
class Fixes(Information):
    """Agents measure position and velocity once a period, with errors, and receive the others' fixes after a delay.

    An agent knows its own newest fix, and of each other agent within a range the fix that is ``delay`` old. Errors are
    the motion of a damped mass on a spring that is kicked at random, by steps of one period T (Vasarhelyi et al. 2018):
    v' = v - T (s x + b v) + sqrt(2 b T D) N(0, 1), x' = x + T v' along each axis, with stiffness s, damping b and
    diffusion D. Positions are off by x and velocities by v. The fix at the start has the errors of the first of these
    steps, from zero; before a delay has passed others are known as they are at the start, exactly. An agent is within
    range by the true positions at the time of the tick.

    Parameters
    ----------
    period
        Time between two fixes, that of the ticks of the agents; positive.
    delay
        Age of what is known of others, a multiple of the period; not negative.
    range
        Distance up to which others are heard; all are when absent.
    diffusion
        D, the variance that v would have without the spring, for short periods; not negative.
    damping, stiffness
        b and s; not negative. Without damping nothing kicks; without stiffness errors of positions grow as those of a
        random walk.
    seed
        Seed of the errors.

    Raises
    ------
    InvalidInput
        When a value is out of range.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Fixes(0.2, delay=1.0, range=100.0).summary
    'fixes every 0.2, of others 1 late within 100'
    """

    period: float
    delay: float = 0.0
    range: float | None = None
    diffusion: float = 0.0
    damping: float = 0.0
    stiffness: float = 0.0
    seed: Annotated[int, values.SEED] = 0

    def __post_init__(self) -> None:
        nanoseconds("Fixes", "period", self.period, positive=True)
        nanoseconds("Fixes", "delay", self.delay)
        object.__setattr__(self, "period", number("Fixes", "period", self.period, above=0.0))
        for name in ("delay", "diffusion", "damping", "stiffness"):
            object.__setattr__(self, name, number("Fixes", name, getattr(self, name), least=0.0))
        if self.range is not None:
            object.__setattr__(self, "range", number("Fixes", "range", self.range, above=0.0))
        object.__setattr__(self, "seed", seed_number("Fixes", self.seed))
        late = int(nanoseconds("Fixes", "delay", self.delay))
        if late % int(nanoseconds("Fixes", "period", self.period)):
            raise InvalidInput(
                "Fixes", "delay", f"must be a multiple of the period, {self.period:g}", self.delay,
                "What is heard is a fix that another agent took.",
            )  # fmt: skip
        # The eigenvalues of a step have the sum 2 - T b - T^2 s and the product 1 - T b.
        if self.period * (2.0 * self.damping + self.period * self.stiffness) >= BOUNDED:
            raise InvalidInput(
                "Fixes", "damping", "must leave errors bounded: period (2 damping + period stiffness) must be below 4",
                self.damping, "Take a shorter period.",
            )  # fmt: skip
        if self.diffusion and not self.damping:
            raise InvalidInput(
                "Fixes", "damping", "must be positive where diffusion is", self.damping,
                "Kicks are of the size sqrt(2 damping period diffusion): without damping there are no errors.",
            )  # fmt: skip

    @property
    def ideal(self) -> bool:
        """False."""
        return False

    @property
    def summary(self) -> str:
        """Period, delay, range and size of the errors."""
        near = "" if self.range is None else f" within {self.range:g}"
        found = [f"fixes every {self.period:g}, of others {self.delay:g} late{near}"]
        if self.diffusion:
            found.append(f"velocities of fixes off with a variance of about {self.diffusion:g}")
        return ", ".join(found)

    @property
    def symmetries(self) -> frozenset[str]:
        """All but those that late fixes of others, or errors, break."""
        late = {"momentum", "galilean"} if self.late else set()
        return SYMMETRIES - late - (DRAWN if self.diffusion else set())

    @property
    def late(self) -> int:
        """The delay in periods."""
        return int(nanoseconds("Fixes", "delay", self.delay)) // int(nanoseconds("Fixes", "period", self.period))

    def next_errors(self, errors: Array, sample: int) -> Array:
        """Errors of the next fix, from those of the last one, shape (N, 2 m): positions, then velocities.

        Parameters
        ----------
        errors
            Errors of the last fix, shape (N, 2 m).
        sample
            Number of the next one.
        """
        n, m = len(errors), errors.shape[1] // 2
        x, v = errors[:, :m], errors[:, m:]
        kick = np.stack([normal_pairs(self.seed, Purpose.FIX, np.arange(n), k, sample)[0] for k in range(m)], axis=1)
        v = v - self.period * (self.stiffness * x + self.damping * v)
        v = v + math.sqrt(2.0 * self.damping * self.period * self.diffusion) * kick
        return np.concatenate([x + self.period * v, v], axis=1)
