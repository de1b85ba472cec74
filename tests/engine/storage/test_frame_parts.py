"""Frames whose parts several processes write: the same bytes on disk as of one process that writes them whole."""

from __future__ import annotations

import zlib
from itertools import pairwise

import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs import columns
from flocking.engine.runs.columns import SPLIT_BYTES, Dimensions
from flocking.engine.runs.frame_parts import FramePart
from flocking.engine.storage.joined_checksums import joined
from flocking.engine.storage.part_writer import sees, write_parts
from flocking.engine.storage.run_writer import RunWriter
from flocking.errors import StorageError

N, FRAMES, EACH = 100, 5, 16
CUTS = (0, 32, 32, 80, N)
"""Whole chunks of each process; the second has none."""


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch):
    monkeypatch.setattr(columns, "SPLIT_BYTES", 8 * 2 * EACH)
    monkeypatch.setattr(columns, "CHUNK_BYTES", 1)


def files(folder):
    return {str(x.relative_to(folder)): x.read_bytes() for x in folder.rglob("*") if x.is_file() and "/c/" in str(x)}


def opened(folder, bodies, precision="float64"):
    start = fk.start.box(N, side=30, speed=1, seed=1)
    law = fk.Law(fk.Proximity(2.5), [fk.Gradient(fk.Potential("(r - 2)**2")), fk.Consensus(1.0)])
    made = fk.Scenario(law, start, t_end=1.0, frames=FRAMES, bodies=bodies)
    return RunWriter.create(folder, made, with_links=False, precision=precision), made


def written(tmp_path, bodies, precision):
    rng = np.random.default_rng(2)
    kind = np.dtype(precision)
    t = np.linspace(0, 1, FRAMES)
    q, p = rng.normal(size=(2, FRAMES, N, 2)).astype(kind)
    whole, made = opened(tmp_path / "whole", bodies, precision)
    width = sum(made.agents.widths(2).values())
    more = rng.normal(size=(FRAMES, N, width))
    with whole:
        for part in (slice(0, 2), slice(2, FRAMES)):
            whole.append(t[part], q[part], p[part], columns=more[part] if width else None)
        whole.commit("finished")
    shared, _ = opened(tmp_path / "shared", bodies, precision)
    with shared:
        assert shared.shared_agents == EACH
        shared.append(t[:1], q[:1], p[:1], columns=more[:1] if width else None)
        for begin, end in ((1, 3), (3, FRAMES)):
            frame = shared.make_room(t[begin:end])
            assert frame == begin
            found = [
                write_parts(
                    shared.folder,
                    [FramePart(t[k], a, q[k, a:b], p[k, a:b], more[k, a:b]) for k in range(begin, end)],
                    frame,
                )
                for a, b in pairwise(CUTS)
            ]
            shared.note_parts(t[begin:end], found)
        shared.commit("finished")
    return whole, shared, q, p


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("bodies", [fk.PointMass(), fk.Lagged(fk.PointMass(), 0.2)], ids=["points", "lagged"])
def test_the_bytes_are_those_of_one_process(tmp_path, bodies, precision):
    whole, shared, q, p = written(tmp_path, bodies, precision)
    one, other = files(whole.folder), files(shared.folder)
    assert len([name for name in one if name.startswith("position")]) == FRAMES * -(-N // EACH)
    assert one == other
    assert whole.record["checksums"] == shared.record["checksums"]
    assert whole.record["counts"] == shared.record["counts"]
    run = fk.read_run(shared.folder)
    assert np.array_equal(run.q, q)
    assert np.array_equal(run.p, p)


@pytest.mark.parametrize("array", ["position", "velocity", "column"])
def test_a_damaged_part_is_found(tmp_path, array):
    _, shared, _, _ = written(tmp_path, fk.Lagged(fk.PointMass(), 0.2), "float64")
    chunk = shared.folder / array / "c" / "3" / "2" / "0"
    (shared.folder / array / "c" / "2" / "2" / "0").replace(chunk)
    with pytest.raises(StorageError, match=r"checksum|damaged"):
        fk.read_run(shared.folder)


def test_parts_without_a_commit_are_not_in_the_run(tmp_path):
    shared, _ = opened(tmp_path / "run", fk.PointMass())
    part = FramePart(0.5, 0, *np.ones((2, N, 2)), np.zeros((N, 0)))
    with shared:
        sums = write_parts(shared.folder, [part], shared.make_room(np.array([0.5])))
        shared.note_parts(np.array([0.5]), [sums])
    assert len(fk.read_run(shared.folder).t) == 0
    with RunWriter.reopen(shared.folder) as again:
        assert again.counts["time"] == 0


def test_checksums_are_joined():
    rng = np.random.default_rng(1)
    for length in (0, 1, 2, 3, 255, 256, 70001):
        data = rng.bytes(length + 17)
        cut = 17
        assert joined(zlib.crc32(data[:cut]), zlib.crc32(data[cut:]), length) == zlib.crc32(data)


def test_small_groups_and_those_with_links_are_written_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(columns, "SPLIT_BYTES", SPLIT_BYTES)
    whole, made = opened(tmp_path / "small", fk.PointMass())
    whole.close()
    assert whole.shared_agents == 0
    monkeypatch.setattr(columns, "SPLIT_BYTES", 8 * 2 * EACH)
    linked = RunWriter.create(tmp_path / "linked", made)
    linked.close()
    assert linked.shared_agents == 0


def test_chunks_of_several_frames_are_written_by_one_process(tmp_path, monkeypatch):
    """Else the next commit would have to read what other processes wrote."""
    monkeypatch.setattr(columns, "CHUNK_BYTES", 2**20)
    whole, _ = opened(tmp_path / "run", fk.PointMass())
    whole.close()
    assert whole.shared_agents == 0


def test_a_folder_that_is_not_seen_is_told(tmp_path):
    assert not sees(tmp_path / "elsewhere", 1)


def test_chunks_of_a_million_agents(monkeypatch):
    monkeypatch.setattr(columns, "SPLIT_BYTES", SPLIT_BYTES)
    size = Dimensions(1_000_000, 2, with_links=False)
    assert size.agents_in_chunk == 262144
    assert Dimensions(1000, 3, with_links=False).agents_in_chunk == 1000
