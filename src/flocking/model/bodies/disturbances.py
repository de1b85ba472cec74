"""Process noise: gusts that push agents."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from flocking.arrays import Indices
from flocking.errors import InvalidInput, SuspectInput
from flocking.model.bodies.body import MotionSymbols
from flocking.model.bodies.chained_bodies import WrappedBody
from flocking.model.checks import Array, number, scalar_or_each
from flocking.model.parts import values
from flocking.model.parts.registration import register_part
from flocking.model.parts.seeds import seed_number
from flocking.model.symmetries import DRAWN
from flocking.model.world.random_numbers import Purpose, normal_axes
from flocking.model.world.times import PER_SECOND, nanoseconds

if TYPE_CHECKING:
    import sympy
    from numpy.typing import ArrayLike

    from flocking.model.bodies.body import Body

LARGEST_SIGMA = 1e140
"""Largest intensity: forces of gusts as short as a nanosecond, and what they do to velocities, have squares that are
numbers."""


@register_part("disturbed")
@dataclass(frozen=True, eq=False)
class Disturbed(WrappedBody):
    """Process noise: a random force acts on a body beside the one that it is given.

    The force of agent i is constant during each period and drawn anew for the next one, s_i/sqrt(period) times a
    standard normal number along each axis, so that its integral over many periods is that of white noise of intensity
    s_i. Bodies of order 1 get a random velocity instead. Draws are functions of the seed, the agent, the axis and the
    number of the period, counted from the start of the run: gusts within gusts of one seed have the same numbers, of
    which a `SuspectInput` warns. The noise is added to what reaches the body:
    ``Lagged(Disturbed(PointMass()), tau)`` has wind, ``Disturbed(Lagged(PointMass(), tau))`` a noisy command.

    Parameters
    ----------
    body
        The body that is pushed.
    sigma
        Intensity s, one for all agents or one for each; not negative.
    period
        How long a gust lasts, rounded to whole nanoseconds; positive.
    seed
        Seed of the draws.

    Raises
    ------
    InvalidInput
        When an intensity is negative or so large that energies of gusts are no numbers, or the period is not positive.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Disturbed(fk.PointMass(), 0.1, period=0.05).summary
    'gusts of intensity 0.1 every 0.05'
    """

    sigma: float | Array
    period: float
    seed: Annotated[int, values.SEED] = 0

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(self, body: Body, sigma: ArrayLike, period: float, seed: int = 0) -> None: ...

    def __post_init__(self) -> None:
        self.check_inner()
        object.__setattr__(self, "sigma", scalar_or_each("Disturbed", "sigma", self.sigma, least=0.0))
        if (largest := float(np.max(self.sigma))) > LARGEST_SIGMA:
            fix = "Choose other units."
            raise InvalidInput("Disturbed", "sigma", f"must be at most {LARGEST_SIGMA:g}", largest, fix)
        object.__setattr__(self, "period", number("Disturbed", "period", self.period, above=0.0))
        nanoseconds("Disturbed", "period", self.period, positive=True)
        object.__setattr__(self, "seed", seed_number("Disturbed", self.seed))
        if np.any(np.asarray(self.sigma)) and self.seed in _seeds_of_gusts(self.body):
            warnings.warn(
                f"Disturbed: seed {self.seed} is also that of gusts inside it, whose draws are the same numbers: such "
                "gusts add up along one line, s1 + s2, where independent ones add up as squares. Give another seed.",
                SuspectInput, stacklevel=3,
            )  # fmt: skip

    @property
    def own_lost(self) -> frozenset[str]:
        """Momentum, and what gusts break that are drawn for each agent and axis; none where there are none."""
        return DRAWN | {"momentum"} if np.any(np.asarray(self.sigma)) else frozenset()

    @property
    def own_parameters(self) -> dict[str, float | Array]:
        """The intensity."""
        return {"sigma": self.sigma}

    @property
    def _seconds(self) -> float:
        """The period, as whole nanoseconds."""
        return self._time(1)

    def _time(self, k: int) -> float:
        """When, after the start, gust ``k`` begins."""
        return k * int(nanoseconds("Disturbed", "period", self.period)) / PER_SECOND

    def _gust(self, elapsed: float) -> int:
        """Number of the gust at a time since the start."""
        k = int(elapsed / self._seconds)
        while self._time(k + 1) <= elapsed:
            k += 1
        while k > 0 and self._time(k) > elapsed:
            k -= 1
        return max(k, 0)

    @property
    def period_in_nanoseconds(self) -> int:
        """How long a gust lasts."""
        return int(nanoseconds("Disturbed", "period", self.period, positive=True))

    def gust(self, number: int, n: int, dimension: int) -> Array:
        """The gust of intensity 1 of a ``number``, shape (n, dimension).

        Parameters
        ----------
        n, dimension
            Numbers of agents and axes.
        """
        return self.gust_of(np.arange(n), number, dimension)

    def gust_of(self, agents: Indices, number: int, dimension: int) -> Array:
        """The gust of intensity 1 of a ``number`` that some agents meet, shape (agents, dimension).

        Parameters
        ----------
        agents
            Their numbers.
        number, dimension
            As for `gust`.
        """
        found = normal_axes(self.seed, Purpose.GUST, agents, number, dimension)
        gusts: Array = np.stack(found, axis=1) / self._seconds**0.5
        return gusts

    def own_held(self, dimension: int) -> tuple[str, ...]:
        """The gust of intensity 1 along each axis."""
        return tuple(f"gust_{k}" for k in range(dimension))

    def own_drawn(self, elapsed: float, n: int, dimension: int) -> dict[str, Array]:
        """The gusts in force.

        Parameters
        ----------
        elapsed
            Time since the start of the run.
        n, dimension
            Numbers of agents and axes.
        """
        gusts = self.gust(self._gust(elapsed), n, dimension)
        return dict(zip(self.own_held(dimension), gusts.T, strict=True))

    def drawn_until(self, elapsed: float) -> float:
        """When the next gust begins, here or in the inner body.

        Parameters
        ----------
        elapsed
            Time since the start of the run.
        """
        return min(self._time(self._gust(elapsed) + 1), super().drawn_until(elapsed))

    def passed(self, x: MotionSymbols) -> Sequence[sympy.Expr]:
        """What the body is given, and the gust."""
        return [u + x.parameter("sigma") * x.held(f"gust_{k}") for k, u in enumerate(x.u)]

    @property
    def own_summary(self) -> str:
        """Intensity and period; empty where there is no noise."""
        most = float(np.max(self.sigma))
        return f"gusts of intensity {most:g} every {self.period:g}" if most else ""


def _seeds_of_gusts(body: Body) -> set[int]:
    """Seeds of the gusts in a chain of bodies."""
    found: set[int] = set()
    if isinstance(body, Disturbed) and np.any(np.asarray(body.sigma)):
        found.add(body.seed)
    inner = getattr(body, "bodies", ()) if not isinstance(body, WrappedBody) else (body.body,)
    return found.union(*map(_seeds_of_gusts, inner))
