"""The agents inside LAMMPS: handed over, gathered, their cells fitted."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import numpy as np

from flocking.arrays import Array, Forces, Numbers, Vector
from flocking.engine.interruption import interrupted
from flocking.engine.lammps import library
from flocking.engine.lammps.deck import Deck
from flocking.engine.lammps.ranks import Ranks
from flocking.model.state import State

BINS_EACH = 8
"""Bins of the cell grid per agent at most: a bound on memory where a group is spread out."""
FEWEST_BINS = 2**17
"""Bins that a small group may have in any case; their memory is negligible."""
THINNEST = 0.05
"""Cells for finding neighbours: their number per agent, at least, and the flattest box in radii that has any."""
WIDEST_CELL, MOST_ALONG = 50.0, 1e9
"""LAMMPS refuses cells 100 times wider than the box, and more than 2^31 of them along an axis."""
MOST_SEARCHED = 20_000
"""Agents whose neighbours are searched pair by pair at most, where no cells fit their box."""


class LammpsError(Exception):
    """LAMMPS complained. ``alone``: on this rank, of which the others know nothing.

    Parameters
    ----------
    words
        What it said.
    agents
        Whom it is about.
    """

    def __init__(self, words: str, *, alone: bool, agents: tuple[int, ...] = ()) -> None:
        super().__init__(words)
        self.alone = alone
        self.agents = agents


class Atoms:
    """A running LAMMPS on all ranks; they call its methods together.

    Parameters
    ----------
    deck
        The scenario.
    ranks
        The ranks.
    log
        LAMMPS's log file, or ``"none"``.

    Raises
    ------
    EngineMissing
        When LAMMPS is not installed.
    """

    def __init__(self, deck: Deck, ranks: Ranks, log: str) -> None:
        self.deck, self.ranks = deck, ranks
        self._cells = (0.0, "bin")
        self._begun = False
        self._sides = np.zeros(deck.dimension)
        self._lammps = library.instance(ranks.comm, log, first_order=deck.order == 1)

    def begin(self, step: float, state: State, steps: int = 0) -> None:
        """Hand LAMMPS the deck and the agents; forces are up to date.

        Parameters
        ----------
        step
            Time step.
        state
            Positions, velocities and time.
        steps
            How many steps were taken until then.
        """
        with tempfile.TemporaryDirectory() if self.ranks.first else _Nowhere() as made:
            folder = Path(self.ranks.comm.bcast(made))
            if self.ranks.first:
                (folder / "data").write_text(self.deck.data_text(state))
                for name, text in self.deck.tables().items():
                    (folder / name).write_text(text)
            self.ranks.comm.Barrier()
            self.command(*self.deck.world(), *self.deck.agents(str(folder / "data")))
            self.command(f"reset_timestep {steps} time {state.t - self.deck.scenario.start.t!r}")
            self.command(*_placed(self.deck.law(self.ranks.size), folder))
            self.fit_cells()
            self.command(f"timestep {step!r}", "thermo 1000000000", "run 0 post no")
            self._begun = True
            self.ranks.comm.Barrier()

    def command(self, *lines: str) -> None:
        """Give LAMMPS commands.

        Parameters
        ----------
        lines
            The commands, one each.

        Raises
        ------
        LammpsError
            When it complains.
        """
        text = "\n".join(line for line in lines if line and not line.startswith("#"))
        try:
            self._lammps.commands_string(text)
        except Exception as error:
            if interrupted(error):
                raise KeyboardInterrupt from None
            raise LammpsError(_words(error), alone=type(error).__name__ == "MPIAbortException") from None

    @property
    def count(self) -> int:
        """Number of agents that this rank owns."""
        return int(self._lammps.extract_global("nlocal"))

    @property
    def ids(self) -> Numbers:
        """Which agents this rank owns."""
        return np.array(self._lammps.numpy.extract_atom("id")[: self.count], dtype=np.int64) - 1

    def gathered(self, *names: str) -> Array | None:
        """Vectors of all agents in their order, one after the other, on the first rank; shape (N, 3 * names)."""
        count = self.count
        parts = [self.ids[:, None].astype(np.float64)]
        parts += [np.array(self._lammps.numpy.extract_atom(name)[:count]).reshape(count, 3) for name in names]
        rows = self.ranks.gathered(np.ascontiguousarray(np.concatenate(parts, axis=1)))
        if rows is None:
            return None
        found = np.full((self.deck.scenario.start.n, 3 * len(names)), np.nan)
        found[rows[:, 0].astype(np.int64)] = rows[:, 1:]
        return found

    def set_forces(self, forces: Forces) -> None:
        """Put forces of all agents in place, shape (N, 3)."""
        self._lammps.numpy.extract_atom("f")[: self.count] = forces[self.ids]

    def fit_cells(self) -> float:
        """Larger cells for a widely scattered flock: their number must stay within memory.

        Returns
        -------
        float
            How many times larger the box is than at the last call.

        Raises
        ------
        LammpsError
            When an agent is so far away that no cells fit, and too many agents are there to be searched without.
        """
        low, high = self._lammps.extract_box()[:2]
        sides = np.array(high[: self.deck.dimension]) - np.array(low[: self.deck.dimension])
        grown = float((sides / np.maximum(self._sides, self.deck.reach)).max())
        self._sides = sides
        needed = self._needed_cells(sides)
        if needed != self._cells:
            self._cells = needed
            size, search = needed
            # Sorting agents in memory has cells of its own.
            self.command(
                f"neighbor {self.deck.skin!r} {search}", f"neigh_modify binsize {size!r}",
                f"atom_modify sort {0 if size else 1000} 0.0",
            )  # fmt: skip
            if self._begun:
                self._set_up_anew()
        return grown

    def _needed_cells(self, sides: Vector) -> tuple[float, str]:
        """Size of the cells, 0 for LAMMPS's own choice, and how they are searched; seldom another than now."""
        size, search = self._cells
        usual = 0.5 * (self.deck.reach + self.deck.skin)
        fewest = float(np.prod(np.maximum(sides / usual, 1.0)))
        most = max(FEWEST_BINS, BINS_EACH * self.deck.scenario.start.n)
        needed = 0.0 if fewest <= most else usual * (fewest / most) ** (1.0 / self.deck.dimension)
        if needed > size or needed < 0.125 * size:
            size = 2.0 * needed
        # Cells cannot be much flatter than they reach: agents in a row are searched pair by pair.
        wide = 2.0 if search == "nsq" else 1.0
        flat = float(sides.min()) < THINNEST * self.deck.reach * wide
        if size and not flat:
            unfit = float(sides.min()) * WIDEST_CELL < size * wide or float(sides.max()) * wide > MOST_ALONG * size
            if unfit and self.deck.scenario.start.n > MOST_SEARCHED:
                raise self._scattered()
            flat = unfit
        return size, "nsq" if flat else "bin"

    def _scattered(self) -> LammpsError:
        """The error that names the agent farthest from the middle of the flock; the ranks call it together."""
        rows = self.gathered("x")
        found = None
        if rows is not None:
            away = np.abs(rows - np.median(rows, axis=0)).max(axis=1)
            found = int(np.argmax(away)), float(away.max())
        agent, distance = self.ranks.comm.bcast(found)
        return LammpsError(
            f"agent {agent} is {distance:.3g} away from the middle of the flock, too far for its search cells with "
            f"{self.deck.scenario.start.n} agents; move it, or take engine='tiles', whose cells are made only where "
            "agents are", alone=False, agents=(agent,),
        )  # fmt: skip

    def _set_up_anew(self) -> None:
        """Let LAMMPS take other cells into use, which needs a setup; forces stay those of half a step before."""
        forces = self.ranks.comm.bcast(self.gathered("f"))
        self.command("run 0 post no")
        self.set_forces(forces)

    def close(self) -> None:
        """Give LAMMPS's memory back."""
        self._lammps.close()


class _Nowhere:
    """Stands in for a folder on ranks that make none."""

    def __enter__(self) -> None:
        return None

    def __exit__(self, *_: object) -> None:
        return None


def _words(error: Exception) -> str:
    """What LAMMPS said, without where in its source it said it."""
    return re.sub(r"\s*\(\.\./.*?\)|\s*\(src/.*?\)|^ERROR( on proc \d+)?: ", "", str(error)).strip()


def _placed(lines: list[str], folder: Path) -> list[str]:
    """Commands with the tables' full paths."""
    return [re.sub(r" (table\d+\.txt) ", rf" {folder}/\1 ", line) for line in lines]
