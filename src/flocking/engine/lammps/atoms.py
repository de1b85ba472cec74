"""The agents in a LAMMPS instance: initialization, gathering of states, and the size of the cells."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import numpy as np

from flocking.arrays import Array, Forces, Numbers, Vector
from flocking.engine.interruption import interrupted
from flocking.engine.lammps import library
from flocking.engine.lammps.deck import THICKNESS, Deck
from flocking.engine.lammps.images import Images, images_of, turns_command
from flocking.engine.lammps.ranks import Ranks
from flocking.model.state import State

BINS_EACH = 8
"""Largest number of bins of the cell grid per agent; limits the memory for a scattered group."""
FEWEST_BINS = 2**17
"""Number of bins that is always allowed; their memory is negligible."""
THINNEST = 0.05
"""Smallest number of search cells per agent, and smallest side of a box, in radii, for which cells are used."""
WIDEST_CELL, MOST_ALONG = 50.0, 1e9
"""Largest width of a cell in sides of the box, and largest number of cells along an axis, that LAMMPS accepts."""
TOO_LARGE = 0.125
"""Ratio of the needed to the present size of cells below which cells are fitted again; avoids frequent changes."""
MOST_SEARCHED = 20_000
"""Largest number of agents whose neighbours are searched pair by pair if no cells fit the box."""

SORT_EVERY = 1000
"""Steps between two sorts of the atoms of LAMMPS in memory: its own default."""


class LammpsError(Exception):
    """LAMMPS reported an error. ``alone``: on this rank only.

    Parameters
    ----------
    message
        The message.
    agents
        The agents concerned.
    """

    def __init__(self, message: str, *, alone: bool, agents: tuple[int, ...] = ()) -> None:
        super().__init__(message)
        self.alone = alone
        self.agents = agents


class Atoms:
    """A LAMMPS instance on all ranks. Its methods are collective.

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
        If LAMMPS is not installed.
    """

    def __init__(self, deck: Deck, ranks: Ranks, log: str) -> None:
        self.deck, self.ranks = deck, ranks
        self._cells = (0.0, "bin")
        self._begun = False
        self._sides = np.zeros(deck.dimension)
        self._lammps = library.instance(ranks.comm, log, first_order=deck.order == 1)
        self._images: Images | None = None

    def begin(self, step: float, state: State, steps: int = 0) -> None:
        """Initialize LAMMPS with the deck and the agents, and compute forces.

        Parameters
        ----------
        step
            Time step.
        state
            Positions, velocities and time.
        steps
            Number of steps before this state.
        """
        space = self.deck.scenario.space
        boxed = State(space.wrapped(state.q), state.p, state.t)
        with tempfile.TemporaryDirectory() if self.ranks.first else _Nowhere() as made:
            folder = Path(self.ranks.comm.bcast(made))
            if self.ranks.first:
                (folder / "data").write_text(self.deck.data_text(boxed))
                for name, text in self.deck.tables().items():
                    (folder / name).write_text(text)
            self.ranks.comm.Barrier()
            self.command(*self.deck.world(), *self.deck.agents(str(folder / "data")))
            if not space.is_open:
                self.command(turns_command(self.deck.dimension))
                self._images = Images(self._lammps, space, self.deck.dimension)
                self._images.set(images_of(space, state.q)[self.ids])
            self.command(f"reset_timestep {steps} time {state.t - self.deck.scenario.start.t!r}")
            self.command(*_placed(self.deck.law(self.ranks.size), folder))
            self.fit_cells()
            self.command(f"timestep {step!r}", "thermo 1000000000", "run 0 post no")
            self._begun = True
            self.ranks.comm.Barrier()

    def command(self, *lines: str) -> None:
        """Execute LAMMPS commands.

        Parameters
        ----------
        lines
            One command each.

        Raises
        ------
        LammpsError
            If LAMMPS reports an error.
        """
        text = "\n".join(line for line in lines if line and not line.startswith("#"))
        try:
            self._lammps.commands_string(text)
        except Exception as error:
            if interrupted(error):
                raise KeyboardInterrupt from None
            raise LammpsError(_message(error), alone=type(error).__name__ == "MPIAbortException") from None

    @property
    def count(self) -> int:
        """Number of agents on this rank."""
        return int(self._lammps.extract_global("nlocal"))

    @property
    def ids(self) -> Numbers:
        """Numbers of the agents on this rank."""
        return np.array(self._lammps.numpy.extract_atom("id")[: self.count], dtype=np.int64) - 1

    def gathered(self, *names: str) -> Array | None:
        """Vectors of all agents in the order of their numbers, on the first rank; shape (N, 3 * names).

        Parameters
        ----------
        names
            Names in LAMMPS; positions ``"x"`` are those that the motion gives, not their images in the box.
        """
        parts = [self.ids[:, None].astype(np.float64), *(self._rows(name) for name in names)]
        rows = self.ranks.gathered(np.ascontiguousarray(np.concatenate(parts, axis=1)))
        if rows is None:
            return None
        found = np.full((self.deck.scenario.start.n, 3 * len(names)), np.nan)
        found[rows[:, 0].astype(np.int64)] = rows[:, 1:]
        return found

    def _rows(self, name: str) -> Array:
        """Vectors of the agents of this rank, shape (n, 3)."""
        found = np.array(self._lammps.numpy.extract_atom(name)[: self.count]).reshape(self.count, 3)
        return found if name != "x" or self._images is None else self._images.places(found)

    def fold_images(self) -> None:
        """Keep what LAMMPS has counted of images before it has no room for more. Not collective."""
        if self._images is not None:
            self._images.fold()

    def set_forces(self, forces: Forces) -> None:
        """Set the forces of all agents, shape (N, 3)."""
        self._lammps.numpy.extract_atom("f")[: self.count] = forces[self.ids]

    def fit_cells(self) -> float:
        """Adapt the size of the cells to a scattered flock, so that their number fits into memory.

        Returns
        -------
        float
            Ratio of the size of the box to that at the last call.

        Raises
        ------
        LammpsError
            If an agent is so far away that no cells fit, and there are too many agents to search without cells.
        """
        low, high = self._lammps.extract_box()[:2]
        sides = np.array(high[: self.deck.dimension]) - np.array(low[: self.deck.dimension])
        grown = float((sides / np.maximum(self._sides, self.deck.reach)).max())
        self._sides = sides
        needed = self._needed_cells(sides)
        if needed != self._cells:
            self._cells = needed
            size, search = needed
            # Sorting of agents in memory uses a separate grid.
            self.command(
                f"neighbor {self.deck.skin!r} {search}", f"neigh_modify binsize {size!r}",
                f"atom_modify sort {0 if size else SORT_EVERY} 0.0",
            )  # fmt: skip
            if self._begun:
                self._rerun_setup()
        return grown

    def _needed_cells(self, sides: Vector) -> tuple[float, str]:
        """Size of the cells (0: default of LAMMPS) and style of the search."""
        size, search = self._cells
        usual = 0.5 * (self.deck.reach + self.deck.skin)
        fewest = float(np.prod(np.maximum(sides / usual, 1.0)))
        most = max(FEWEST_BINS, BINS_EACH * self.deck.scenario.start.n)
        needed = 0.0 if fewest <= most else usual * (fewest / most) ** (1.0 / self.deck.dimension)
        if needed > size or needed < TOO_LARGE * size:
            size = 2.0 * needed
        # Cells cannot be much thinner than their reach: agents in a row are searched pair by pair.
        wide = 2.0 if search == "nsq" else 1.0
        flat = float(sides.min()) < THINNEST * self.deck.reach * wide
        if size and not flat:
            # In the plane the box has a thickness, too, for which no cell may be too wide.
            narrowest = min(float(sides.min()), 2.0 * THICKNESS if self.deck.dimension == 2 else np.inf)
            unfit = narrowest * WIDEST_CELL < size * wide or float(sides.max()) * wide > MOST_ALONG * size
            if unfit and self.deck.scenario.start.n > MOST_SEARCHED:
                raise self._scattered()
            flat = unfit
        return size, "nsq" if flat else "bin"

    def _scattered(self) -> LammpsError:
        """The error that names the agent farthest from the centre of the flock. Collective."""
        rows = self.gathered("x")
        found = None
        if rows is not None:
            away = np.abs(rows - np.median(rows, axis=0)).max(axis=1)
            found = int(np.argmax(away)), float(away.max())
        agent, distance = self.ranks.comm.bcast(found)
        return LammpsError(
            f"agent {agent} is {distance:.3g} away from the centre of the flock, too far for the search cells with "
            f"{self.deck.scenario.start.n} agents; move it, or use engine='tiles', whose cells do not depend on the "
            "extent of the group", alone=False, agents=(agent,),
        )  # fmt: skip

    def _rerun_setup(self) -> None:
        """Run the setup that applies new cells; forces remain those of half a step before."""
        forces = self.ranks.comm.bcast(self.gathered("f"))
        self.command("run 0 post no")
        self.set_forces(forces)

    def close(self) -> None:
        """Release the memory of LAMMPS."""
        self._lammps.close()


class _Nowhere:
    """Placeholder for the temporary folder on ranks that need none."""

    def __enter__(self) -> None:
        return None

    def __exit__(self, *_: object) -> None:
        return None


def _message(error: Exception) -> str:
    """The message of LAMMPS without the location in its source and the address of its manual."""
    first = str(error).split("\nFor more information")[0]
    return re.sub(r"\s*\(\.\./.*?\)|\s*\(src/.*?\)|^ERROR( on proc \d+)?: ", "", first).strip()


def _placed(lines: list[str], folder: Path) -> list[str]:
    """Commands with the full paths of the tables."""
    return [re.sub(r" (table\d+\.txt) ", rf" {folder}/\1 ", line) for line in lines]
