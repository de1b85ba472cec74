"""A running simulation under LAMMPS, on any number of MPI ranks: all ranks call the same methods together."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from flocking.engine.lammps import library
from flocking.engine.lammps.deck import Deck, make_deck, steps_between
from flocking.engine.lammps.ledger import Ledger, observation
from flocking.engine.lammps.ranks import Ranks
from flocking.engine.provenance import provenance
from flocking.engine.run import SWITCH_FIELDS, TRACE_FIELDS, Run
from flocking.errors import InvalidInput, NotFinite, SimulationError
from flocking.model.checks import integer, number
from flocking.model.law import Law, Scenario
from flocking.model.state import State

MOST_LINKED = 2000
"""Larger groups carry no link matrix in their frames."""
MOST_LINK_BYTES = 256 * 2**20
BINS_EACH = 8
FEWEST_BINS = 2**22
THINNEST = 0.05
"""Cells for finding neighbours: their number per agent, at least, and the flattest box in radii that has any."""


@dataclass(frozen=True)
class LammpsOptions:
    """How LAMMPS runs a scenario.

    Parameters
    ----------
    step
        Largest time step; it is shortened a little so that frames fall on steps.
    skin
        Skin of the neighbour lists; a share of the largest radius when absent.
    ledger
        Steps between two rows of the energy ledger; 0 for no ledger. Rows are computed on one rank from the whole
        state: for large groups let them be rare.
    observe
        Record order, flocks, density and closest pair at the frame times.
    keep_log
        A file for LAMMPS's own log.

    Raises
    ------
    InvalidInput
        When a value is missing or out of range.
    """

    step: float
    skin: float | None = None
    ledger: int = 1
    observe: bool = False
    keep_log: str | None = None

    def __post_init__(self) -> None:
        number("engine='lammps'", "step", self.step, above=0.0)
        integer("engine='lammps'", "ledger", self.ledger, least=0)
        if self.skin is not None:
            number("engine='lammps'", "skin", self.skin, above=0.0)


def lammps_options(given: dict[str, Any]) -> LammpsOptions:
    """Options from keyword arguments.

    Raises
    ------
    InvalidInput
        When there is no such option, or no step.
    """
    known = {f.name for f in fields(LammpsOptions)}
    for name in sorted(set(given) - known):
        raise InvalidInput(
            "start", name, f"must be an option of engine='lammps': {', '.join(sorted(known))}", given[name]
        )
    if given.get("step") is None:
        raise InvalidInput(
            "start", "step", "must be given for engine='lammps'", None,
            "Give step=0.01, or the one the tiled engine chooses: start(scenario, 'tiles').step.",
        )  # fmt: skip
    return LammpsOptions(**given)


class Records:
    """Frames, ledger and observations, on the first rank alone."""

    def __init__(self, scenario: Scenario) -> None:
        n = scenario.start.n
        self.frame_times = scenario.frame_times
        self.with_links = n <= MOST_LINKED and len(self.frame_times) * n**2 <= MOST_LINK_BYTES
        self.t: list[float] = []
        self.q: list[Any] = []
        self.p: list[Any] = []
        self.links: list[Any] = []
        self.observed: list[tuple[float, ...]] = []
        self.ledger = Ledger(scenario)
        self.count = 0

    def tables(self, n: int, m: int) -> dict[str, Any]:
        """All records as arrays, by the names of `Run`."""
        from flocking.engine.tiles.observables import OBSERVED_FIELDS

        frames = len(self.t)
        linked = self.with_links and frames
        return {
            "t": np.array(self.t),
            "q": np.array(self.q) if frames else np.zeros((0, n, m)),
            "p": np.array(self.p) if frames else np.zeros((0, n, m)),
            "links": np.array(self.links) if linked else np.zeros((frames, 0, 0), dtype=bool),
            "switches": np.zeros(0, dtype=SWITCH_FIELDS),
            "trace": np.array(self.ledger.trace, dtype=TRACE_FIELDS),
            "closest_linked": self.ledger.closest_linked,
            "closest_unlinked": self.ledger.closest_unlinked,
            "observables": np.array(self.observed, dtype=OBSERVED_FIELDS) if self.observed else None,
        }


@dataclass(frozen=True, eq=False)
class Restart:
    """What another session needs to go on, on any number of ranks.

    Parameters
    ----------
    file
        A LAMMPS restart file: positions and velocities with all their bits.
    forces
        Forces of the last step, shape (N, 3): those on velocities are of half a step before.
    time, steps, plan
        Where the session stands.
    """

    file: bytes
    forces: Any
    time: float
    steps: int
    plan: tuple[float, float, int, int]


class LammpsSession:
    """A running simulation under LAMMPS. Its time is always on a step.

    Parameters
    ----------
    scenario
        What to simulate; the same on all ranks.
    options
        Step and the rest.
    plant
        This engine keeps no ledger of another law and takes none.
    restart
        Where to go on from; absent for the start of the scenario.

    Raises
    ------
    UnsupportedLaw
        When a part of the scenario has no translation.
    EngineMissing
        When LAMMPS or MPI is not installed.
    """

    engine = "lammps"

    def __init__(
        self, scenario: Scenario, options: LammpsOptions, *, plant: Law | None = None, restart: Restart | None = None
    ) -> None:
        if plant is not None:
            raise InvalidInput("LammpsSession", "plant", "cannot be given", plant, "Use engine='exact'.")
        self.scenario, self.options, self.plant = scenario, options, None
        self.deck: Deck = make_deck(scenario, options.skin)
        self.ranks = Ranks(library.communicator())
        self.time, self.steps = scenario.start.t, 0
        self.records = Records(scenario)
        self._plan = (self.time, self.time, 1, 1)
        self._step = 0.0
        self._cells = (0.0, "bin")
        self._at_row = True
        with self.ranks.bound():
            self._lammps = library.instance(self.ranks.comm, options.keep_log or "none")
            self._begin(restart)
        if restart is None:
            self._record()

    def _begin(self, restart: Restart | None) -> None:
        """Hand LAMMPS the deck and the agents; forces are those of the present state in the end."""
        with tempfile.TemporaryDirectory() if self.ranks.first else _Nowhere() as made:
            folder = Path(self.ranks.comm.bcast(made))
            if self.ranks.first:
                if restart is None:
                    (folder / "data").write_text(self.deck.data_text())
                else:
                    (folder / "restart").write_bytes(restart.file)
                for name, text in self.deck.tables().items():
                    (folder / name).write_text(text)
            self.ranks.comm.Barrier()
            if restart is None:
                self._command(*self.deck.world(), *self.deck.agents(str(folder / "data")))
            else:
                self._command(*self.deck.settings(), f"read_restart {folder / 'restart'}", *self.deck.properties())
            self._command(*_placed(self.deck.law(self.ranks.size), folder))
            self._fit_bins()
            self._command(f"timestep {self.options.step!r}", "thermo 1000000000", "run 0 post no")
            self.ranks.comm.Barrier()
        if restart is not None:
            self.time, self.steps, self._plan = restart.time, restart.steps, restart.plan
            self._lammps.numpy.extract_atom("f")[: self._count] = restart.forces[self._ids]

    def _command(self, *lines: str) -> None:
        """Give LAMMPS commands; its complaints end the run and say so."""
        text = "\n".join(line for line in lines if line and not line.startswith("#"))
        try:
            self._lammps.commands_string(text)
        except Exception as error:
            words = str(error)
            if type(error).__name__ == "MPIAbortException":
                raise
            raise SimulationError(f"LAMMPS: {words}. The step may be too large.", time=self.time) from None

    @property
    def _count(self) -> int:
        return int(self._lammps.extract_global("nlocal"))

    @property
    def _ids(self) -> Any:
        return np.array(self._lammps.numpy.extract_atom("id")[: self._count], dtype=np.int64) - 1

    def _gathered(self, *names: str) -> Any | None:
        """Vectors of all agents in their order, one after the other, on the first rank; shape (N, 3 * names)."""
        count = self._count
        parts = [self._ids[:, None].astype(np.float64)]
        parts += [np.array(self._lammps.numpy.extract_atom(name)[:count]).reshape(count, 3) for name in names]
        rows = self.ranks.gathered(np.ascontiguousarray(np.concatenate(parts, axis=1)))
        if rows is None:
            return None
        found = np.full((self.scenario.start.n, 3 * len(names)), np.nan)
        found[rows[:, 0].astype(np.int64)] = rows[:, 1:]
        return found

    def whole_state(self) -> State | None:
        """The state on the first rank, None elsewhere.

        Raises
        ------
        NotFinite
            On all ranks, when an agent is lost or its state is not finite.
        """
        rows = self._gathered("x", "v")
        bad = None if rows is None else np.flatnonzero(~np.isfinite(rows).all(axis=1))[:10].tolist()
        bad = self.ranks.comm.bcast(bad)
        if bad:
            raise NotFinite(
                "Agents were lost or became infinite or NaN: the step is too large.", time=self.time, agents=tuple(bad)
            )
        if rows is None:
            return None
        m = self.deck.dimension
        return State(rows[:, :m], rows[:, 3 : 3 + m], self.time)

    @property
    def state(self) -> State:
        """State at the session's time, on every rank."""
        found = self.ranks.comm.bcast(self.whole_state())
        return State(found.q, found.p, found.t)

    def forces(self) -> Any:
        """Forces on all agents as LAMMPS has them, shape (N, m), on the first rank; None elsewhere."""
        rows = self._gathered("f")
        return None if rows is None else rows[:, : self.deck.dimension]

    def _fit_bins(self) -> None:
        """Larger cells for a widely scattered flock: their number must stay within memory."""
        low, high = self._lammps.extract_box()[:2]
        sides = np.array(high[: self.deck.dimension]) - np.array(low[: self.deck.dimension])
        usual = 0.5 * (self.deck.reach + self.deck.skin)
        fewest = float(np.prod(np.maximum(sides / usual, 1.0)))
        most = max(FEWEST_BINS, BINS_EACH * self.scenario.start.n)
        size = 0.0 if fewest <= most else usual * (fewest / most) ** (1.0 / self.deck.dimension)
        # Cells cannot be much flatter than they reach: agents in a row are searched pair by pair.
        search = "nsq" if float(sides.min()) < THINNEST * self.deck.reach else "bin"
        if (size, search) != self._cells:
            self._cells = (size, search)
            # Sorting agents in memory has cells of its own.
            self._command(
                f"neighbor {self.deck.skin!r} {search}", f"neigh_modify binsize {size!r}",
                f"atom_modify sort {0 if size else 1000} 0.0",
            )  # fmt: skip

    def _next_stop(self) -> float:
        times = [self.scenario.t_end] if self.time < self.scenario.t_end else []
        times += [float(t) for t in self.records.frame_times if t > self.time][:1]
        stop = min(times, default=self.time + 1000 * self.options.step)
        return stop

    def advance(self, to: float) -> None:
        """Take steps until the session's time is ``to`` or just beyond it. Where steps fall does not depend on ``to``.

        Raises
        ------
        SimulationError
            When the run cannot go on; its ``run`` holds what was computed until then.
        """
        try:
            with self.ranks.bound():
                while self.time < to - 1e-9 * self.options.step:
                    self._take_steps(to)
                    self._record()
        except SimulationError as error:
            error.run = self.run(str(error))
            raise

    def _take_steps(self, to: float) -> None:
        start, end, count, index = self._plan
        if index >= count:
            start, end = self.time, self._next_stop()
            count, index = steps_between(start, end, self.options.step), 0
        h = (end - start) / count
        rows = self.options.ledger or count
        row_end = min(count, (index // rows + 1) * rows)
        wanted = int(np.ceil((to - self.time) / h - 1e-9))
        todo = max(1, min(row_end - index, wanted))
        if h != self._step:
            self._step = h
            self._command(f"timestep {h!r}")
        # Without a setup: forces on velocities stay those of half a step before.
        self._command(f"run {todo} pre no post no")
        self.steps += todo
        index += todo
        self._plan = (start, end, count, index)
        self.time = end if index == count else start + (end - start) * index / count
        self._at_row = index == row_end

    def _record(self) -> None:
        """Add a row to the ledger, and store a frame where one is due."""
        due = self.records.count < len(self.records.frame_times) and (
            self.records.frame_times[self.records.count] <= self.time + 1e-12 * max(1.0, abs(self.time))
        )
        if not due and not (self.options.ledger and self._at_row):
            return
        self._fit_bins()
        state = self.whole_state()
        if due:
            self.records.count += 1
        if state is not None:
            self._write_down(state, due)

    def _write_down(self, state: State, due: bool) -> None:
        records, scenario = self.records, self.scenario
        if self.options.ledger:
            records.ledger.add(state)
        if not due:
            return
        if self.options.observe:
            records.observed.append(observation(scenario, state))
        records.q.append(state.q)
        records.p.append(state.p)
        if records.with_links:
            records.links.append(scenario.law.graph.initial(state.q))
        records.t.append(state.t)

    def restart(self) -> Restart | None:
        """What another session needs to go on, on the first rank; None elsewhere."""
        with self.ranks.bound(), tempfile.TemporaryDirectory() if self.ranks.first else _Nowhere() as made:
            path = Path(self.ranks.comm.bcast(made)) / "restart"
            forces = self._gathered("f")
            # Without another setup: that would hand agents over to other ranks while their forces stay behind.
            self._command(f"write_restart {path} noinit")
            self.ranks.comm.Barrier()
            data = path.read_bytes() if self.ranks.first else None
            self.ranks.comm.Barrier()
        return None if data is None else Restart(data, forces, self.time, self.steps, self._plan)

    @property
    def about(self) -> dict[str, Any]:
        """Where the results come from, as the run's provenance says."""
        found = provenance(self.engine, self.scenario) | library.versions()
        return found | {
            "steps": self.steps, "step": self.options.step, "scheme": "verlet", "ranks": self.ranks.size,
            "rank": self.ranks.rank, "switches": "not recorded",
            "ledger": f"trapezoidal, a row every {self.options.ledger} steps",
            "closest": "at the rows of the ledger",
        }  # fmt: skip

    def run(self, status: str = "finished") -> Run:
        """What was computed so far; the frames are on the first rank alone."""
        n, m = self.scenario.start.q.shape
        return Run(self.scenario, status=status, provenance=self.about, **self.records.tables(n, m))

    def close(self) -> None:
        """Give LAMMPS's memory back."""
        self._lammps.close()


class _Nowhere:
    """Stands in for a folder on ranks that make none."""

    def __enter__(self) -> None:
        return None

    def __exit__(self, *_: object) -> None:
        return None


def _placed(lines: list[str], folder: Path) -> list[str]:
    """Commands with the tables' full paths."""
    import re

    return [re.sub(r" (table\d+\.txt) ", rf" {folder}/\1 ", line) for line in lines]
