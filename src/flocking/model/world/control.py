"""When agents act: continuously, or at ticks of a clock between which the force is held."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flocking.model.checks import Array, check_each, scalar_or_each
from flocking.model.parts.description import Group, add_group
from flocking.model.parts.registration import register_part
from flocking.model.symmetries import SYMMETRIES
from flocking.model.world.times import Instants, PeriodicTimes, nanoseconds, shared_times, span
from flocking.model.world.world_part import IdealPart, WorldPart

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class Control(WorldPart):
    """When agents compute their force, and how long it acts."""


add_group(Group("control", Control, default="continuous"))


@register_part("continuous")
@dataclass(frozen=True)
class Continuous(IdealPart, Control):
    """Every agent exerts the force of the law at every moment."""


CONTINUOUS = Continuous()
"""What a scenario has that names no other."""


@register_part("held")
@dataclass(frozen=True, eq=False)
class Held(Control):
    """Zero-order hold: agent i computes its force at phase_i + k period_i and holds it until the next one acts.

    Before its first tick an agent applies no force. Times are rounded to whole nanoseconds from the start.

    Parameters
    ----------
    period
        Time between two ticks, one for all agents or one for each; positive.
    phase
        Time of the first tick after the start, one for all or one for each; not negative.
    latency
        Time from a tick until its force acts, one for all or one for each; not negative.

    Raises
    ------
    InvalidInput
        When a period is not positive, or another time is negative.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Held(0.1, latency=0.02).summary
    'control held for 0.1, acting 0.02 later'
    >>> fk.Held(0.1, latency=[0.0, 0.03]).summary
    'control held for 0.1, acting 0 to 0.03 later'
    """

    period: float | Array
    phase: float | Array = 0.0
    latency: float | Array = 0.0

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(self, period: ArrayLike, phase: ArrayLike = 0.0, latency: ArrayLike = 0.0) -> None: ...

    def __post_init__(self) -> None:
        nanoseconds("Held", "period", self.period, positive=True)
        nanoseconds("Held", "phase", self.phase)
        nanoseconds("Held", "latency", self.latency)
        object.__setattr__(self, "period", scalar_or_each("Held", "period", self.period, above=0.0))
        object.__setattr__(self, "phase", scalar_or_each("Held", "phase", self.phase, least=0.0))
        object.__setattr__(self, "latency", scalar_or_each("Held", "latency", self.latency, least=0.0))

    @property
    def ideal(self) -> bool:
        """False."""
        return False

    @property
    def symmetries(self) -> frozenset[str]:
        """All; momentum and relabelling only where agents act at the same times, and their forces begin together."""
        together = shared_times(self.period, self.phase, self.latency) is not None
        return SYMMETRIES if together else SYMMETRIES - {"momentum", "relabelling"}

    @property
    def summary(self) -> str:
        """The periods, and phases and latency that are not zero in whole nanoseconds."""
        return f"control held for {span(self.period)}{self._delays_in_words}"

    @property
    def _delays_in_words(self) -> str:
        # Times that round to zero nanoseconds are zero.
        found = f", first at {span(self.phase)}" if nanoseconds("Held", "phase", self.phase).any() else ""
        late = nanoseconds("Held", "latency", self.latency).any()
        return f"{found}, acting {span(self.latency)} later" if late else found

    def check_count(self, n: int) -> None:
        """Check that periods, phases and latencies given for each agent are ``n``.

        Raises
        ------
        InvalidInput
            When they are another number.
        """
        for name, value in (("period", self.period), ("phase", self.phase), ("latency", self.latency)):
            check_each("Held", name, value, n)

    def schedule(self, n: int) -> PeriodicTimes:
        """Ticks of ``n`` agents."""
        return PeriodicTimes(
            np.broadcast_to(nanoseconds("Held", "period", self.period), n).copy(),
            np.broadcast_to(nanoseconds("Held", "phase", self.phase), n).copy(),
        )

    def latencies(self, n: int) -> Instants:
        """Times from a tick until its force acts, of ``n`` agents, in whole nanoseconds, shape (n,)."""
        return np.broadcast_to(nanoseconds("Held", "latency", self.latency), n).copy()
