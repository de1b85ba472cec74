"""The exported deck, run by LAMMPS alone, gives the frames of the engine."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.apps.cli import main
from flocking.engine.driver.lammps_export import export_deck
from flocking.engine.lammps.session import LammpsOptions, LammpsSession
from flocking.errors import InvalidInput, StorageError
from tests.mpi.job import scenario
from tests.mpi.jobs import MPIEXEC
from tests.mpi.laws import PAIR_STYLES

pytestmark = pytest.mark.mpi
LMP = str(Path(sys.executable).with_name("lmp"))


def frames(path, n, dimension):
    lines = path.read_text().splitlines()
    size = n + 9
    blocks = [lines[k : k + size] for k in range(0, len(lines), size)]
    table = np.array([[[float(x) for x in row.split()] for row in block[9:]] for block in blocks])
    assert (table[:, :, 0] == np.arange(1, n + 1)).all()
    return table[:, :, 1 : 1 + dimension], table[:, :, 1 + dimension :]


@pytest.mark.parametrize(("name", "dimension"), [("olfati-saber (58)", 2), ("olfati-saber (36)", 3), ("shi (4)", 2)])
def test_lammps_alone_runs_the_deck_on_two_ranks(tmp_path, name, dimension):
    made = scenario(name, dimension, n=100, t_end=0.3, frames=4)
    deck = export_deck(made, tmp_path / "deck", step=0.01)
    library = {"LD_LIBRARY_PATH": str(Path(sys.prefix) / "lib"), "PATH": "/usr/bin:/bin", "OMP_NUM_THREADS": "1"}
    words = [MPIEXEC, "-n", "2", LMP, "-in", deck.name]
    done = subprocess.run(words, cwd=deck.parent, env=library, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    q, p = frames(deck.parent / "frames.lammpstrj", 100, dimension)
    run = fk.simulate(made, **PAIR_STYLES, step=0.01, ledger=0, progress=False)
    np.testing.assert_allclose(q, run.q, rtol=0, atol=1e-10)
    np.testing.assert_allclose(p, run.p, rtol=0, atol=1e-10)


def test_one_process_runs_the_deck_as_written(tmp_path):
    """Plain ``lmp -in``, with nothing of this library about."""
    made = scenario("olfati-saber (50)", 2, n=40, t_end=0.2, frames=3)
    deck = export_deck(made, tmp_path / "deck", step=0.01)
    done = subprocess.run([LMP, "-in", deck.name], cwd=deck.parent, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    q, _ = frames(deck.parent / "frames.lammpstrj", 40, 2)
    run = fk.simulate(made, **PAIR_STYLES, step=0.01, ledger=0, progress=False)
    np.testing.assert_allclose(q, run.q, rtol=0, atol=1e-10)


def test_a_step_is_chosen_when_none_is_given(tmp_path):
    made = scenario("olfati-saber (35)", 2, n=40)
    text = export_deck(made, tmp_path / "deck").read_text()
    step = float(text.split("timestep ")[1].split()[0])
    session = LammpsSession(made, LammpsOptions(ledger=0))
    session.close()
    assert 0.5 * session.step < step <= session.step


def test_the_deck_can_be_read_and_names_its_equations(tmp_path, capsys):
    assert (
        main(["export", "olfati-saber-2003", "--to", "lammps", "--step", "0.02", "--out", str(tmp_path / "deck")]) == 0
    )
    text = (tmp_path / "deck" / "in.flocking").read_text()
    for words in ("Olfati-Saber (34)-(36)", "Olfati-Saber (54)", "ball with radius = 10", "gain = 1.0", "timestep"):
        assert words in text
    assert "in.flocking" in capsys.readouterr().out
    assert max(len(line) for line in text.splitlines() if line.startswith("#")) < 200


def test_nothing_is_overwritten_and_frames_must_fall_on_steps(tmp_path):
    made = scenario("olfati-saber (34)", 2, n=20)
    for times in ([0.0, 0.1, 0.5], [0.1, 0.3, 0.5], [0.25], [0.0, 0.2, 0.4]):
        with pytest.raises(InvalidInput, match="frames"):
            export_deck(made.with_(frames=times), tmp_path / "deck", step=0.03)
    (tmp_path / "taken").write_text("here")
    with pytest.raises(StorageError):
        export_deck(made.with_(frames=3), tmp_path, step=0.01)
    with pytest.raises(InvalidInput, match="step"):
        export_deck(made.with_(frames=3), tmp_path / "deck", step=0.0)
