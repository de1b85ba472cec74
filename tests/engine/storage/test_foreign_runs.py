"""Runs from others: what they hold is never unpickled, and no array is decoded that this library would not write."""

from __future__ import annotations

import base64
import io
import itertools
import json
import pickle
import shutil
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver import session_writer as saving
from flocking.engine.storage import record
from flocking.engine.storage.record import RECORD
from flocking.engine.storage.stored_runs import read_run, stored_facts, write_run
from flocking.errors import FlockingError, StorageError
from tests.counting import count
from tests.engine.storage.stored_runs import finished, scenario
from tests.unpickling import Harm, watched


@pytest.fixture
def calls() -> Iterator[list[str]]:
    """Who unpickled anything."""
    with watched() as seen:
        yield seen


@pytest.fixture(scope="module")
def unfinished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that was interrupted amid its way, with a checkpoint."""
    folder = tmp_path_factory.mktemp("runs") / "run"
    session = fk.start(scenario())
    with saving.SessionWriter.create(folder, session, 0.0) as kept:
        session.advance(1.0)
        kept.commit_if_due()
    return folder


def test_reading_and_going_on_unpickle_nothing(unfinished: Path, tmp_path: Path, calls: list[str]) -> None:
    shutil.copytree(unfinished, tmp_path / "run")
    stored_facts(tmp_path / "run")
    assert len(read_run(tmp_path / "run").t) > 3
    assert fk.resume(tmp_path / "run", progress=False).finished
    np.savez(tmp_path / "start.npz", q=np.zeros((2, 2)))
    fk.read_start(tmp_path / "start.npz")
    assert calls == []


def sealed(folder: Path, change: Callable[[dict[str, Any], dict[str, Any]], None]) -> None:
    """Change the record of a run, given whole and as the metadata of its arrays, with a checksum that fits again."""
    root = json.loads((folder / RECORD).read_bytes())
    said = root["attributes"]["flocking"]
    said.pop("seal")
    change(root, root["consolidated_metadata"]["metadata"])
    said["seal"] = record._seal(root)
    (folder / RECORD).write_text(json.dumps(root))


def v2(shape: list[int], codec: str) -> dict[str, Any]:
    """Metadata of an array of objects in Zarr format 2."""
    return {
        "zarr_format": 2, "node_type": "array", "shape": shape, "chunks": shape, "dtype": "|O", "compressor": None,
        "fill_value": None, "order": "C", "filters": [{"id": codec, "protocol": 5}], "dimension_separator": ".",
        "attributes": {}, "dimension_names": ["time"],
    }  # fmt: skip


ARRAY_NAMES = (
    "time",
    "position",
    "velocity",
    "links",
    "checksum",
    "ledger",
    "switch_time",
    "agent",
    "axis",
    "quantity",
)
ATTACKS = ("v2", "v2 beside", "object", "codec", "transformer", "path", "huge")


def poison(folder: Path, array: str, attack: str, harm: Path) -> None:
    """Put something into a run that runs code, or leaves the folder, where somebody believes it."""
    payload = pickle.dumps(Harm(harm))

    def change(root: dict[str, Any], arrays: dict[str, Any]) -> None:
        data = arrays[array]
        if attack == "v2":
            arrays[array] = v2(data["shape"], "pickle")
        elif attack == "v2 beside":
            text = json.dumps(v2(data["shape"], "pickle"))
            (folder / array / ".zarray").write_text(text)
            (folder / array / RECORD).unlink()
            root["zarr_format"] = 2
        elif attack == "object":
            data["data_type"] = "object"
            data["codecs"] = [{"name": "numcodecs.pickle", "configuration": {}}]
        elif attack == "codec":
            data["codecs"].insert(0, {"name": "numcodecs.pickle", "configuration": {"protocol": 5}})
        elif attack == "transformer":
            data["storage_transformers"] = [{"name": "pickle"}]
        elif attack == "path":
            arrays[f"../../{harm.name}"] = arrays.pop(array)
            names = root["attributes"]["flocking"]["arrays"]
            names[names.index(array)] = f"../../{harm.name}"
        else:
            data["chunk_grid"]["configuration"]["chunk_shape"][0] = 10**12

    sealed(folder, change)
    for name in (".".join("0" for _ in range(3)), "0", "0.0", "c/0", "c/0/0", "c/0/0/0"):
        chunk = folder / array / name
        if chunk.parent.is_dir() and not chunk.is_dir():
            chunk.write_bytes(payload)


def refused_everywhere(folder: Path, harm: Path) -> None:
    """Every way to open the run refuses it and leaves no trace outside it."""
    before = sorted(p.name for p in folder.parent.iterdir())
    for way in (read_run, stored_facts, lambda x: fk.resume(x, progress=False)):
        with pytest.raises(StorageError):
            way(folder)
    assert not harm.exists()
    assert sorted(p.name for p in folder.parent.iterdir()) == before


@pytest.mark.parametrize("cases", [14, pytest.param(70, marks=pytest.mark.repeated)])
def test_poisoned_runs(unfinished: Path, tmp_path: Path, calls: list[str], cases: int) -> None:
    pairs = list(itertools.product(ARRAY_NAMES, ATTACKS))
    for array, attack in pairs[:: len(pairs) // cases]:
        folder, harm = tmp_path / "inner" / "run", tmp_path / "harm"
        shutil.copytree(unfinished, folder)
        poison(folder, array, attack, harm)
        refused_everywhere(folder, harm)
        shutil.rmtree(folder)
        count("runs on disk: poisoned with pickles, foreign codecs and paths")
    assert calls == []


@pytest.mark.parametrize("name", ["../run/checkpoint-000001.npz", "/etc/passwd", "checkpoint-1.npz", "x", ""])
def test_a_checkpoint_is_a_file_of_its_run(unfinished: Path, tmp_path: Path, name: str) -> None:
    shutil.copytree(unfinished, tmp_path / "run")
    sealed(tmp_path / "run", lambda root, _: root["attributes"]["flocking"]["checkpoint"].update(file=name))
    with pytest.raises(StorageError, match="checkpoint: file must be the name of a checkpoint"):
        fk.resume(tmp_path / "run", progress=False)


def test_pickles_in_a_checkpoint_are_refused(unfinished: Path, tmp_path: Path, calls: list[str]) -> None:
    shutil.copytree(unfinished, tmp_path / "run")
    (path,) = (tmp_path / "run").glob("checkpoint-*.npz")
    with np.load(path) as file:
        arrays: dict[str, Any] = {name: file[name] for name in file.files}
    held = np.empty(arrays["y"].shape, object)
    held[:] = Harm(tmp_path / "harm")
    out = io.BytesIO()
    np.savez(out, **{**arrays, "y": held})
    path.write_bytes(out.getvalue())
    fits = {"checksum": zlib.crc32(out.getvalue())}
    sealed(tmp_path / "run", lambda root, _: root["attributes"]["flocking"]["checkpoint"].update(fits))
    with pytest.raises(StorageError, match="must hold plain numbers, not object"):
        fk.resume(tmp_path / "run", progress=False)
    assert not (tmp_path / "harm").exists()
    assert calls == []


def test_pickles_in_a_scenario_are_refused(unfinished: Path, tmp_path: Path, calls: list[str]) -> None:
    shutil.copytree(unfinished, tmp_path / "run")
    path = tmp_path / "run" / "scenario.json"
    out = io.BytesIO()
    np.save(out, np.array([Harm(tmp_path / "harm")], dtype=object))

    held = {"npy": base64.b64encode(out.getvalue()).decode()}

    def changed(value: Any) -> Any:
        if isinstance(value, dict):
            return {k: held if k == "q" else changed(v) for k, v in value.items()}
        return [changed(x) for x in value] if isinstance(value, list) else value

    text = json.dumps(changed(json.loads(path.read_text()))).encode()
    assert text != path.read_bytes()
    path.write_bytes(text)
    sealed(
        tmp_path / "run",
        lambda root, _: root["attributes"]["flocking"]["scenario"].update(checksum=zlib.crc32(text)),
    )
    with pytest.raises(FlockingError):
        read_run(tmp_path / "run")
    assert not (tmp_path / "harm").exists()
    assert calls == []


def test_a_run_does_not_write_through_links(unfinished: Path, tmp_path: Path) -> None:
    shutil.copytree(unfinished, tmp_path / "run")
    (tmp_path / "run" / "position").rename(tmp_path / "elsewhere")
    (tmp_path / "run" / "position").symlink_to(tmp_path / "elsewhere")
    before = {p: p.stat().st_mtime_ns for p in (tmp_path / "elsewhere").rglob("*")}
    with pytest.raises(StorageError, match="a link to another place"):
        fk.resume(tmp_path / "run", progress=False)
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "elsewhere").rglob("*")} == before


@pytest.mark.parametrize(
    ("table", "value", "said"),
    [
        ("switch_agent", 10, "switch_agent must not hold values above 9"),
        ("switch_neighbour", -1, "switch_neighbour must not hold values below 0"),
        ("switch_kind", 9, "switch_kind must not hold values above 3"),
    ],
)
def test_tables_fit_the_scenario(tmp_path: Path, table: str, value: int, said: str) -> None:
    import zarr

    write_run(finished(), tmp_path / "run")
    array = zarr.open_array(str(tmp_path / "run"), path=table, mode="r+", zarr_format=3)
    array[0] = value
    fits = {table: zlib.crc32(array[:].tobytes())}
    sealed(tmp_path / "run", lambda root, _: root["attributes"]["flocking"]["checksums"].update(fits))
    with pytest.raises(StorageError, match=said):
        read_run(tmp_path / "run")
