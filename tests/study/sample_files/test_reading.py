"""Files of samples: every format gives the same arrays, and faults are named by file, line and column."""

from __future__ import annotations

import csv
import os
import sys
import zipfile

import numpy as np
import pytest

import flocking as fk
from flocking.study.sample_files import samples as limits
from flocking.study.sample_files.reading import read_samples

T = np.array([0.0, 0.5, 0.75, 2.0])
Q = np.random.default_rng(3).normal(size=(4, 11, 2))
P = np.random.default_rng(4).normal(size=(4, 11, 2))


def rows():
    for f in range(4):
        for i in reversed(range(11)):
            yield [float(T[f]), i, *Q[f, i].tolist(), *P[f, i].tolist()]


def write_csv(path, head, given=None):
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([head, *(rows() if given is None else given)])
    return path


def same(found):
    assert (found.t == T).all()
    assert (found.q == Q).all()
    assert (found.p == P).all()
    assert found.names == tuple(map(str, range(11)))


def test_all_formats_give_the_same_arrays(tmp_path):
    same(read_samples(write_csv(tmp_path / "a.csv", ["t", "id", "x", "y", "vx", "vy"])))
    np.savez(tmp_path / "a.npz", t=T, q=Q, p=P)
    same(read_samples(tmp_path / "a.npz"))
    np.savez(tmp_path / "b.npz", when=T, q=Q, p=P)
    same(read_samples(tmp_path / "b.npz", columns={"t": "when"}))


def test_parquet_gives_the_same_arrays(tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    named = dict(zip(["time", "bird", "x", "y", "vx", "vy"], zip(*rows(), strict=True), strict=True))
    parquet.write_table(pyarrow.table({k: pyarrow.array(v) for k, v in named.items()}), tmp_path / "a.parquet")
    same(read_samples(tmp_path / "a.parquet", columns={"t": "time", "id": "bird"}))
    named["x"] = (None, *named["x"][1:])
    parquet.write_table(pyarrow.table({k: pyarrow.array(v) for k, v in named.items()}), tmp_path / "b.parquet")
    with pytest.raises(fk.InvalidInput, match=r"b\.parquet: row 1, column x"):
        read_samples(tmp_path / "b.parquet", columns={"t": "time", "id": "bird"})


def test_gsd_of_our_own_and_of_others(tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd")
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    run = fk.simulate(fk.Scenario(law, fk.start.box(4, side=1.0, speed=1.0, seed=1), t_end=1.0, frames=5))
    found = read_samples(fk.export_run(run, tmp_path / "own.gsd"))
    assert (found.t == run.t).all()
    assert (found.q == run.q).all()
    assert (found.p == run.p).all()
    with hoomd.open(str(tmp_path / "other.gsd"), "w") as file:
        for k in range(4):
            frame = hoomd.Frame()
            frame.configuration.step, frame.configuration.box = 10 * k, [4.0, 4.0, 4.0, 0, 0, 0]
            # The particle leaves the box on the right and enters on the left.
            frame.particles.N, frame.particles.position = 1, [[1.0 + k - 4.0 * (k > 0), 0.0, 0.0]]
            frame.particles.image = [[int(k > 0), 0, 0]]
            file.append(frame)
    with pytest.raises(fk.InvalidInput, match="--time-step"):
        read_samples(tmp_path / "other.gsd")
    other = read_samples(tmp_path / "other.gsd", time_step=0.1)
    assert other.p is None
    np.testing.assert_allclose(other.t, [0.0, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(other.q[:, 0, 0], [1.0, 2.0, 3.0, 4.0])
    # Single precision has 24 binary digits: at 4 a unit of the last one is 4/2^23.
    assert other.rounding[0] == 2.0**-22
    assert found.rounding == (0.0, 0.0)


def test_gsd_of_boxes_whose_images_are_not_along_the_axes_is_refused(tmp_path):
    """In a tilted box the image above is shifted to the side: positions would be unwrapped to a wrong place."""
    hoomd = pytest.importorskip("gsd.hoomd")
    with hoomd.open(str(tmp_path / "tilted.gsd"), "w") as file:
        for k in range(3):
            frame = hoomd.Frame()
            frame.configuration.step, frame.configuration.box = k, [4.0, 4.0, 4.0, 0.5, 0, 0]
            frame.particles.N, frame.particles.position, frame.particles.image = 1, [[0.0, 0.0, 0.0]], [[0, k, 0]]
            file.append(frame)
    with pytest.raises(fk.InvalidInput, match="box must be a right-angled box"):
        read_samples(tmp_path / "tilted.gsd", time_step=1.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must have a header"),
        ("t;id;x\n0;a;1\n", "must be separated by commas; got 'semicolons'"),
        ("t\tid\tx\n0\ta\t1\n", "must be separated by commas; got 'tabulators'"),
        ("t,id,x\n0,1,2\n", "at least three times"),
        ("t,id,x,vx\n0,a,1,hello\n", "line 2, column vx must be a finite number; got 'hello'"),
        ("t,id,x,vx\n0,a,1,nan\n", "line 2, column vx must be a finite number"),
        ("t,id,x\n0,a,1\n0,b,1\n1,a,1\n2,a,2\n2,b,3\n", "none of b at 1"),
        ("t,id,x\n0,a,1\n1,a,1\n2,a,2\n2,a,3\n", "line 5, columns id and t"),
        ("t,id,x,x\n0,a,1,1\n", "different names"),
        ("t,id,x\n0,a,1\n0, ,2\n", "line 3, column id must name an agent; got 'nothing'"),
        ("t,id,x\n1700000000.25,a,1\n1700000000.5,a,1\n1700000000.5,a,2\n", "a at 1700000000.5 again"),
        ("t,id,x\n0,a,1,1\n", "line 2 must have 3 columns; got 4"),
        ("t,id,x,y,vx\n0,a,1,1,1\n", "column vy must be in the file"),
        ("t,id,x,z\n0,a,1,1\n", "column y must be in the file"),
        ('t,id,x\n0,"a,1\n', "CSV"),
        ("\x00\xff", "UTF-8"),
    ],
)
def test_faults_of_a_table_are_named_by_their_place(tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(fk.InvalidInput, match=message) as found:
        read_samples(path)
    assert "bad.csv" in str(found.value)


def test_columns_that_are_not_there_are_suggested(tmp_path):
    path = write_csv(tmp_path / "a.csv", ["time", "bird", "x", "y", "vx", "vy"])
    with pytest.raises(fk.InvalidInput, match="Did you mean 'time'"):
        read_samples(path, columns={"t": "tim", "id": "bird"})
    with pytest.raises(fk.InvalidInput, match="column must be one of t, id"):
        read_samples(path, columns={"time": "t"})


class _Trap:
    def __reduce__(self):
        return os.mkdir, ("unpickled",)


def test_nothing_is_unpickled(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.savez(tmp_path / "a.npz", t=T, q=np.array([_Trap()], dtype=object), p=P)
    with pytest.raises(fk.InvalidInput, match="plain arrays"):
        read_samples(tmp_path / "a.npz")
    assert not (tmp_path / "unpickled").exists()


def test_sizes_are_bounded_before_anything_is_unpacked(tmp_path, monkeypatch):
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("q.npy", bytes(10_000_000))
    assert (tmp_path / "a.npz").stat().st_size < 100_000
    monkeypatch.setattr(limits, "LARGEST_FILE", 1_000_000)
    with pytest.raises(fk.InvalidInput, match="unpacked must have at most"):
        read_samples(tmp_path / "a.npz")


@pytest.mark.parametrize(("ending", "package"), [("gsd", "gsd"), ("parquet", "pyarrow")])
def test_a_missing_package_is_one_line(tmp_path, monkeypatch, ending, package):
    path = tmp_path / f"a.{ending}"
    path.write_bytes(b"x")
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.setitem(sys.modules, f"{package}.hoomd", None)
    with pytest.raises(fk.StorageError, match="pip install") as found:
        read_samples(path)
    assert "\n" not in str(found.value)


@pytest.mark.parametrize("ending", ["gsd", "parquet", "npz"])
def test_rubbish_is_refused_in_one_message(tmp_path, ending):
    pytest.importorskip("pyarrow")
    pytest.importorskip("gsd")
    path = tmp_path / f"a.{ending}"
    path.write_bytes(b"rubbish" * 100)
    with pytest.raises(fk.InvalidInput, match=f"a.{ending}: file must be"):
        read_samples(path)


@pytest.mark.parametrize("names", [["a", ""], ["a", None], [1.0, float("nan")]])
def test_rows_of_a_parquet_table_without_a_name_are_no_agent(tmp_path, names):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    named = {"t": [0.0, 0.0, 1.0, 1.0, 2.0, 2.0], "id": names * 3, "x": [0.0, 1.0] * 3}
    parquet.write_table(pyarrow.table({k: pyarrow.array(v) for k, v in named.items()}), tmp_path / "a.parquet")
    with pytest.raises(fk.InvalidInput, match="row 2, column id must name an agent"):
        read_samples(tmp_path / "a.parquet")
