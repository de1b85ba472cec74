"""Files of others beside runs: whether they are whole or hold a pickle, nothing in them is unpickled.

Runs and checkpoints are tried by tests/engine/storage/test_foreign_runs.py, recordings by
tests/engine/nodes/test_recordings.py.
"""

from __future__ import annotations

import io
import json
import pickle
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput, StorageError
from flocking.formula import cache, compiled
from flocking.papers.showcases.stored_summary import StoredSummary
from flocking.papers.stored_margins import KEYS, as_text, is_stored, stored_margins
from flocking.study.margins.margin_table import margins_from
from flocking.study.sample_files.reading import read_samples
from tests.study.sweeps.sweep_cases import make
from tests.unpickling import Harm, watched

T = np.arange(6) * 0.1
Q = np.random.default_rng(0).normal(size=(6, 4, 2))


@pytest.fixture
def harm(tmp_path: Path) -> Path:
    """What is there once somebody unpickled `payload`."""
    return tmp_path / "harm"


@pytest.fixture
def payload(harm: Path) -> bytes:
    """A pickle that does something when it is read."""
    return pickle.dumps(Harm(harm))


@pytest.fixture
def calls(harm: Path) -> Iterator[list[str]]:
    """Who unpickled anything."""
    with watched() as seen:
        yield seen
    assert not harm.exists()


def test_what_is_unpickled_is_noticed(tmp_path: Path, payload: bytes, harm: Path) -> None:
    held = np.empty(1, object)
    held[0] = Harm(harm)
    np.save(tmp_path / "held.npy", held)
    with pytest.raises(AssertionError, match=r"pickle\.load from numpy"), watched():
        np.load(tmp_path / "held.npy", allow_pickle=True)
    assert harm.is_dir()
    harm.rmdir()
    ways = {"loads": lambda: pickle.loads(payload), "Unpickler": lambda: pickle.Unpickler(io.BytesIO(payload)).load()}
    for entry, read in ways.items():
        with pytest.raises(AssertionError, match=rf"pickle\.{entry} from {__name__}"), watched():
            read()
        assert harm.is_dir()
        harm.rmdir()


def objects(path: Path, harm: Path, **parts: Any) -> Path:
    """An NPZ file of ``parts``, the last of which holds an object."""
    held = np.empty(np.shape([*parts.values()][-1]), object)
    held[...] = Harm(harm)
    with path.open("wb") as file:
        np.savez(file, **{**parts, [*parts][-1]: held})
    return path


def test_stored_sweeps(tmp_path: Path, payload: bytes, harm: Path) -> None:
    plan: dict[str, Any] = {"grid": {"speed": [0.5, 1.0]}, "seeds": 1, "measures": ["flocks"], "workers": 1}
    folder = tmp_path / "out"
    table = fk.sweep(make, **plan, out=folder, progress=False)
    with watched():
        assert fk.read_sweep(folder).rows == table.rows
        assert fk.sweep(make, **plan, out=folder, progress=False).rows == table.rows
    chunk, record = next((folder / "rows").iterdir()), folder / "sweep.json"
    for path in (chunk, record):
        whole = path.read_bytes()
        for data in (payload, pickle.dumps(json.loads(whole), 0)):
            path.write_bytes(data)
            with watched(), pytest.raises(StorageError):
                fk.read_sweep(folder)
            with watched(), pytest.raises(StorageError):
                fk.sweep(make, **plan, out=folder, progress=False)
        path.write_bytes(whole)
    assert not harm.exists()


def as_csv(path: Path) -> None:
    rows = [f"{t},{i},{x},{y}\n" for t, places in zip(T, Q, strict=True) for i, (x, y) in enumerate(places)]
    path.write_text("".join(["t,id,x,y\n", *rows]))


def as_npz(path: Path) -> None:
    np.savez_compressed(path, t=T, q=Q)


def as_parquet(path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    tables = pytest.importorskip("pyarrow.parquet")
    columns = {"t": np.repeat(T, 4), "id": np.tile(np.arange(4), 6), "x": Q[:, :, 0].ravel(), "y": Q[:, :, 1].ravel()}
    tables.write_table(pyarrow.table(columns), path)


def as_gsd(path: Path) -> None:
    hoomd = pytest.importorskip("gsd.hoomd")
    with hoomd.open(str(path), "w") as file:
        for t, q in zip(T, Q, strict=True):
            frame = hoomd.Frame()
            frame.particles.N = len(q)
            frame.particles.position = np.pad(q, ((0, 0), (0, 1)))
            frame.log = {"flocking/time": np.array([t]), "flocking/dimension": np.array([2])}
            frame.log["particles/flocking/position"] = frame.log["particles/flocking/velocity"] = q
            file.append(frame)


@pytest.mark.parametrize("write", [as_csv, as_npz, as_parquet, as_gsd])
def test_files_of_samples(write: Callable[[Path], None], tmp_path: Path, payload: bytes, calls: list[str]) -> None:
    path = tmp_path / f"samples.{write.__name__.removeprefix('as_')}"
    write(path)
    assert read_samples(path).q.shape == Q.shape
    whole = path.read_bytes()
    half = len(whole) // 2
    for data in (payload, whole[:half] + payload + whole[half:], payload + whole):
        path.write_bytes(data)
        with pytest.raises((InvalidInput, StorageError)):
            read_samples(path)
    assert calls == []


@pytest.mark.parametrize("name", ["t", "q", "p"])
def test_objects_in_samples(name: str, tmp_path: Path, harm: Path, calls: list[str]) -> None:
    parts = {"t": T, "q": Q, "p": Q}
    parts[name] = parts.pop(name)
    path = objects(tmp_path / "samples.npz", harm, **parts)
    with pytest.raises((InvalidInput, StorageError)):
        read_samples(path)
    assert calls == []


def test_columns_of_types_that_python_pickles(tmp_path: Path, payload: bytes, calls: list[str]) -> None:
    """Arrow's extension types of Python hold a pickle of themselves."""
    pyarrow = pytest.importorskip("pyarrow")
    tables = pytest.importorskip("pyarrow.parquet")
    as_parquet(tmp_path / "whole.parquet")
    table = tables.read_table(tmp_path / "whole.parquet")
    marks = {b"ARROW:extension:name": b"arrow.py_extension_type", b"ARROW:extension:metadata": payload}
    marked = pyarrow.schema([field.with_metadata(marks) for field in table.schema])
    tables.write_table(table.cast(marked), tmp_path / "marked.parquet")
    assert (tmp_path / "marked.parquet").stat().st_size > (tmp_path / "whole.parquet").stat().st_size
    with suppress(InvalidInput, StorageError):
        read_samples(tmp_path / "marked.parquet")
    assert calls == []


def test_summaries_of_showcases(tmp_path: Path, payload: bytes, harm: Path, calls: list[str]) -> None:
    summary = StoredSummary({"a": 1}, {"x": np.arange(6)})
    whole = summary.write(tmp_path / "kept.npz")
    assert StoredSummary.read(whole).facts == {"a": 1}
    with np.load(whole) as file:
        parts = {name: file[name] for name in file.files}
    for name in [*parts]:
        parts[name] = parts.pop(name)
        with pytest.raises(InvalidInput):
            StoredSummary.read(objects(tmp_path / "held.npz", harm, **parts))
    whole.write_bytes(payload)
    with pytest.raises(InvalidInput):
        StoredSummary.read(whole)
    assert calls == []


def test_tables_of_margins(calls: list[str]) -> None:
    stored_margins.cache_clear()
    tables = [stored_margins(key) for key in KEYS if is_stored(key)]
    assert tables
    for table in tables:
        assert margins_from(json.loads(as_text(table))) == table
    assert calls == []


def test_files_of_the_cache(tmp_path: Path, payload: bytes, monkeypatch: pytest.MonkeyPatch, calls: list[str]) -> None:
    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path / "cache"))
    source = """from flocking.formula.native.functions import native


@native
def more(x):
    return x + 1.5
"""

    def read() -> float:
        """What the cached function gives to a process that has not loaded it."""
        compiled._modules.clear()
        for name in [n for n in sys.modules if n.startswith(cache.GENERATED)]:
            del sys.modules[name]
        return float(compiled.generated_module("cached", source, (), lambda: source, str).more(2.0))

    assert read() == read() == 3.5
    files = [path for path in (tmp_path / "cache").rglob("*") if path.is_file()]
    assert {path.suffix for path in files} >= {".py", ".o"}
    for path in files:
        whole = path.read_bytes()
        path.write_bytes(payload)
        assert read() == 3.5
        path.write_bytes(payload + whole)
        assert read() == 3.5
    assert calls == []
