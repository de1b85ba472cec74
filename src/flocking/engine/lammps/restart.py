"""Restart data of a run: all agents and the state of the session.

The restart files of LAMMPS lose agents that have left its box since the last rebuild of the neighbour lists.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TypedDict, cast

from flocking.arrays import Array
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import And, Flag, Integer, Maybe, Names, Nothing, Real, Row, Table, Text
from flocking.engine.fixed_step.step_counts import time_slack
from flocking.engine.lammps.options import PAIR_STYLES, LammpsOptions
from flocking.model.law import Scenario
from flocking.model.state import State


@dataclass(frozen=True, eq=False)
class Restart:
    """Everything a session needs to continue, on any number of ranks.

    Parameters
    ----------
    agents
        Positions, velocities and the forces of the last step, shape (N, 9); forces that depend on velocities are those
        of half a step before.
    time, steps, plan
        Time, number of steps, and planned steps of the session.
    """

    agents: Array
    time: float
    steps: int
    plan: tuple[float, float, int, int]

    def state(self, dimension: int) -> State:
        """Positions and velocities in ``dimension`` dimensions."""
        return State(self.agents[:, :dimension], self.agents[:, 3 : 3 + dimension], self.time)


def packed_restart(restart: Restart, options: LammpsOptions) -> tuple[dict[str, object], Arrays]:
    """A restart and the options of its session as numbers and arrays.

    Parameters
    ----------
    restart
        The restart.
    """
    numbers: dict[str, object] = {"time": restart.time, "steps": restart.steps, "plan": restart.plan}
    return {**numbers, "options": asdict(options)}, {"agents": restart.agents}


class RestartNumbers(TypedDict):
    """The numbers of a restart, by the names of `Restart`, and the options of its session."""

    time: float
    steps: int
    plan: tuple[float, float, int, int]
    options: object


def unpacked(numbers: Mapping[str, object], arrays: Arrays, scenario: Scenario) -> tuple[Restart, LammpsOptions]:
    """Restore a restart and the options from their packed form.

    Parameters
    ----------
    numbers, arrays
        The packed form.

    Raises
    ------
    MalformedError, InvalidInput, TypeError
        If the data are not a restart of a session of this scenario.
    """
    _form(scenario).check(numbers, "")
    checked = cast(RestartNumbers, numbers)
    Names({"agents": Table("f8", (scenario.start.n, 9))}).check(arrays, "")
    restart = Restart(arrays["agents"], checked["time"], checked["steps"], (*checked["plan"],))
    return restart, stored_options(checked["options"])


class OptionFields(TypedDict, total=False):
    """The options of a session except the log file, with the names of `LammpsOptions`."""

    step: float | None
    skin: float | None
    ledger: int | None
    observe: bool


_OPTIONS = Names(
    {},
    {"step": Maybe(Real()), "skin": Maybe(Real()), "ledger": Maybe(Integer()), "observe": Flag(),
     "keep_log": Maybe(Text()), "forces": Text(), "scheme": Nothing(), "precision": Text(), "threads": Nothing(),
     "keep_frames": Flag(), "memory_limit": Nothing(), "ledger_at": Text()},
)  # fmt: skip


def stored_options(data: object) -> LammpsOptions:
    """The options of a run of pair styles on disk, without the log file: its path is not trusted.

    Raises
    ------
    InvalidInput, MalformedError
        If they are invalid.
    """
    checked = _OPTIONS.check(data, "options")
    given = {name: x for name, x in checked.items() if name in OptionFields.__annotations__}
    return LammpsOptions(forces=PAIR_STYLES, **cast(OptionFields, given))


def _form(scenario: Scenario) -> Names:
    slack = time_slack(scenario)
    time = Real(scenario.start.t - slack, scenario.t_end + slack)
    plan = And(
        Row([time, time, Integer(1), Integer()]), "advance in time", lambda x: bool(x[0] <= x[1] and x[3] <= x[2])
    )
    return Names(
        {
            "time": time,
            "steps": Integer(),
            "plan": plan,
            "options": Names({}, others=True),
        }
    )
