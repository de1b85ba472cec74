"""What a killed run goes on from: all agents and where the session stood, in one file.

LAMMPS's own restart files lose agents that have left its box since it last looked for neighbours.
"""

from __future__ import annotations

import io
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from flocking.arrays import Array
from flocking.engine.archives.archive import UNREADABLE, read_archive, write_archive
from flocking.engine.archives.data_checks import And, Integer, Names, Real, Row, Table, Text
from flocking.engine.lammps.options import LammpsOptions
from flocking.errors import StorageError
from flocking.model.law import Scenario
from flocking.model.state import State


@dataclass(frozen=True, eq=False)
class Restart:
    """What another session needs to go on, on any number of ranks.

    Parameters
    ----------
    agents
        Positions, velocities and the forces of the last step, shape (N, 9): those on velocities are of half a step
        before.
    time, steps, plan
        Where the session stands.
    """

    agents: Array
    time: float
    steps: int
    plan: tuple[float, float, int, int]

    def state(self, dimension: int) -> State:
        """Positions and velocities in ``dimension`` dimensions."""
        return State(self.agents[:, :dimension], self.agents[:, 3 : 3 + dimension], self.time)


def packed(restart: Restart, options: LammpsOptions) -> bytes:
    """A restart and the options of its session as the bytes of an ``.npz`` file."""
    numbers = {"engine": "lammps", "time": restart.time, "steps": restart.steps, "plan": restart.plan}
    file = io.BytesIO()
    write_archive(file, {**numbers, "options": asdict(options)}, {"agents": restart.agents})
    return file.getvalue()


def unpacked(data: bytes, where: Path, scenario: Scenario) -> tuple[Restart, LammpsOptions]:
    """The restart and the options that were packed.

    Raises
    ------
    StorageError
        When the data are no restart of a session of this scenario.
    """
    try:
        numbers, arrays = read_archive(data)
        _form(scenario).check(numbers, "")
        Names({"agents": Table("f8", (scenario.start.n, 9))}).check(arrays, "")
        restart = Restart(arrays["agents"], numbers["time"], numbers["steps"], tuple(numbers["plan"]))
        return restart, stored_options(numbers["options"])
    except UNREADABLE as error:
        raise StorageError(f"{where}: no checkpoint this version can go on from ({str(error)[:200]}).") from None


def stored_options(data: dict[str, Any]) -> LammpsOptions:
    """The options of a run on disk; LAMMPS's own log is not written again, for whoever made the run chose its path.

    Raises
    ------
    InvalidInput, TypeError
        When they are none.
    """
    return LammpsOptions(**{**data, "keep_log": None})


def _form(scenario: Scenario) -> Names:
    slack = 1e-9 * max(1.0, abs(scenario.start.t), abs(scenario.t_end))
    time = Real(scenario.start.t - slack, scenario.t_end + slack)
    plan = And(Row([time, time, Integer(1), Integer()]), "lead forward", lambda x: bool(x[0] <= x[1] and x[3] <= x[2]))
    return Names(
        {
            "engine": Text(("lammps",)),
            "time": time,
            "steps": Integer(),
            "plan": plan,
            "options": Names({}, others=True),
        }
    )
