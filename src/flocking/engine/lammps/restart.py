"""What a killed run goes on from: all agents and where the session stood, in one file.

LAMMPS's own restart files lose agents that have left its box since it last looked for neighbours.
"""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flocking.engine.lammps.options import LammpsOptions
from flocking.errors import StorageError
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

    agents: Any
    time: float
    steps: int
    plan: tuple[float, float, int, int]

    def state(self, dimension: int) -> State:
        """Positions and velocities in ``dimension`` dimensions."""
        return State(self.agents[:, :dimension], self.agents[:, 3 : 3 + dimension], self.time)


def packed(restart: Restart, options: LammpsOptions) -> bytes:
    """A restart and the options of its session as the bytes of an ``.npz`` file."""
    numbers = {"engine": "lammps", "time": restart.time, "steps": restart.steps, "plan": restart.plan}
    text = json.dumps({**numbers, "options": asdict(options)})
    file = io.BytesIO()
    np.savez(file, numbers=np.frombuffer(text.encode(), dtype=np.uint8), agents=restart.agents)
    return file.getvalue()


def unpacked(data: bytes, where: Path) -> tuple[Restart, LammpsOptions]:
    """The restart and the options that were packed.

    Raises
    ------
    StorageError
        When the data are no restart.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            numbers = json.loads(file["numbers"].tobytes())
            plan = tuple(numbers["plan"])
            restart = Restart(file["agents"], numbers["time"], numbers["steps"], plan)
        return restart, LammpsOptions(**numbers["options"])
    except (ValueError, KeyError, TypeError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise StorageError(f"{where}: no checkpoint this version can go on from ({error}).") from None
