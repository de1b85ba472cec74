"""Files that hold no samples of a motion are refused by the place and the rule that they break."""

import io

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.study.sample_files.reading import read_samples
from flocking.study.sample_files.sampled_runs import motion_of

T = np.arange(12) * 0.125
Q = np.random.default_rng(0).normal(size=(12, 3, 2))


def npz(**arrays):
    file = io.BytesIO()
    np.savez(file, **({"t": T, "q": Q} | arrays))
    return file.getvalue()


def parquet(**columns):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet as tables

    named = {"t": np.repeat(T, 3), "id": np.tile(np.arange(3), 12), "x": Q[..., 0].ravel(), "y": Q[..., 1].ravel()}
    file = io.BytesIO()
    tables.write_table(pyarrow.table(named | columns), file)
    return file.getvalue()


def with_entry(k, value):
    found = T.copy()
    found[k] = value
    return found


@pytest.mark.parametrize(
    ("ending", "content", "said"),
    [
        ("npz", npz(q=Q + 0j), "array q must hold real numbers; got 'complex128'"),
        ("npz", npz(t=T[[0, 2, 1, *range(3, 12)]]), "array t, entry 2 must be later than 0.25 before it; got 0.125"),
        ("npz", npz(t=with_entry(4, 0.375)), "array t, entry 4 must be later than 0.375"),
        ("npz", npz(t=with_entry(4, np.nan)), "array t, entry .* must be a finite number; got nan"),
        ("npz", npz(t=T[:2], q=Q[:2]), "array t must hold at least three times; got 2"),
        ("npz", npz(t=T[:-1]), "arrays must agree in their numbers of times, agents and axes"),
        ("npz", npz(p=Q[:, :2]), "arrays must agree in their numbers of times, agents and axes"),
        ("csv", b"t,id,x\n0,0,1\xff\n", "file must be UTF-8 text; got 'byte 0xff'"),
        ("csv", b't,id,x\n0,"a"b,1\n', "file must be a CSV table"),
        ("parquet", b"t,id,x\n0,0,1\n", "file must be a Parquet table"),
        ("parquet", parquet(x=["1.0"] * 36), "column x must hold numbers; got 'string'"),
        ("parquet", parquet(t=[True] * 36), "column t must hold numbers; got 'bool'"),
        ("parquet", parquet(x=np.where(np.arange(36) == 7, np.inf, 0.0)), "row 8, column x must be a finite number"),
    ],
)  # fmt: skip
def test_what_is_no_motion_is_refused(ending, content, said, tmp_path):
    file = tmp_path / f"motion.{ending}"
    file.write_bytes(content)
    with pytest.raises(InvalidInput, match=said):
        read_samples(file)


def test_a_gsd_file_without_frames_is_refused(tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd")
    file = tmp_path / "motion.gsd"
    hoomd.open(str(file), "w").close()
    with pytest.raises(InvalidInput, match="file must have frames; got 0"):
        read_samples(file)


def test_a_law_of_other_axes_repeated_axes_or_with_a_radius_beside_it_is_refused(tmp_path):
    """Each of them would be held against other distances than those that were measured."""
    file = tmp_path / "motion.npz"
    file.write_bytes(npz())
    samples = read_samples(file)
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])

    def declared(m, space=None):
        start = fk.State(np.arange(3.0 * m).reshape(3, m), np.zeros((3, m)))
        return fk.Scenario(law, start, 1.0, space=space or fk.Open())

    for given, options, said in (
        (declared(3), {}, "law must be in 2 dimensions, as the samples; got 3"),
        (declared(2, fk.Periodic([9.0, 9.0])), {}, "law must be in open space"),
        (declared(2), {"radius": 1.0}, "radius must be absent where a law is given"),
        (None, {"radius": 0.0}, "radius"),
    ):
        with pytest.raises(InvalidInput, match=said):
            motion_of(samples, given, **options)
    assert motion_of(samples, declared(2)).has_law
