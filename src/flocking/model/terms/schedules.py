"""Gains that change at given times, for example to change the informed agents (Shi (4))."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, ChangesInTime, array, check_each, listed, scalar_or_each
from flocking.model.parts import values as fields
from flocking.model.parts.description import Group, Short, add_group
from flocking.model.parts.registration import register_part


@dataclass(frozen=True, eq=False)
class Schedule(ChangesInTime):
    """A gain that is constant between switch times: ``values[k]`` from ``times[k - 1]`` until before ``times[k]``.

    Parameters
    ----------
    times
        Switch times, strictly ascending, shape (K,).
    values
        K + 1 values, each one number or each one per agent: the first before ``times[0]``, the next from
        ``times[0]`` on, and so on.

    Raises
    ------
    InvalidInput
        If times are out of order, the number of values is wrong, or values differ in kind.

    Examples
    --------
    >>> gain = Schedule([2.0, 5.0], [1.0, 0.0, 1.0])
    >>> gain.at(1.9), gain.at(2.0), gain.at(7.0)
    (1.0, 0.0, 1.0)
    """

    times: Annotated[Array, fields.NUMBERS]
    values: Annotated[tuple[float | Array, ...], fields.VALUES]

    if TYPE_CHECKING:  # Any sequence is accepted.

        def __init__(self, times: Sequence[float], values: Sequence[float | Sequence[float] | Array]) -> None: ...

    def __post_init__(self) -> None:
        checked = array("Schedule", "times", self.times, ndim=1)
        if (np.diff(checked) <= 0).any():
            raise InvalidInput("Schedule", "times", "must be strictly ascending", list(self.times))
        values = listed("Schedule", "values", self.values, "must be a sequence")
        if len(values) != len(checked) + 1:
            raise InvalidInput(
                "Schedule",
                "values",
                f"must be {len(checked) + 1}: one more than there are times",
                f"{len(values)} values",
            )
        found = tuple(scalar_or_each("Schedule", "values", v) for v in values)
        if len({np.shape(v) for v in found}) > 1:
            raise InvalidInput(
                "Schedule", "values", "must all be numbers, or all have one entry per agent",
                [np.shape(v) for v in found],
            )  # fmt: skip
        object.__setattr__(self, "times", checked)
        object.__setattr__(self, "values", found)

    def __array__(self, dtype: object = None, copy: bool | None = None) -> Array:
        """All values, shape (K + 1,) or (K + 1, N)."""
        return np.array(self.values, dtype=np.float64)

    @property
    def per_agent(self) -> bool:
        """Whether each value has one entry per agent."""
        return np.ndim(self.values[0]) == 1

    def at(self, t: float) -> float | Array:
        """The value at time ``t``; at a switch time the new value."""
        return self.values[int(np.searchsorted(self.times, t, side="right"))]

    def switch_times(self, start: float, end: float) -> tuple[float, ...]:
        """Switch times in (start, end)."""
        return tuple(float(s) for s in self.times if start < s < end)

    def check_count(self, owner: str, parameter: str, n: int) -> None:
        """Check that per-agent values have ``n`` entries.

        Raises
        ------
        InvalidInput
            If they have another number of entries.
        """
        check_each(owner, parameter, self.values[0], n)


add_group(
    Group(
        "gain", Schedule, default="schedule",
        short=Short(fields.NUMBER_OR_NUMBERS, lambda gain: gain, (float, int, np.ndarray)),
    )
)  # fmt: skip
register_part("schedule")(Schedule)
