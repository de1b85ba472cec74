"""Stored sweeps that were damaged, or come from strangers: read or refused in plain words, never trusted."""

import json
import zlib

import pytest

import flocking as fk
from flocking.errors import InvalidInput, StorageError
from tests.counting import count
from tests.study.sweeps.sweep_cases import make


def sealed(data):
    body = json.dumps(data)
    return json.dumps({"body": body, "seal": zlib.crc32(body.encode())})


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep") / "out"
    table = fk.sweep(
        make, grid={"speed": [0.5, 1.0]}, seeds=2, measures=["flocks"], out=folder, workers=1, progress=False
    )
    return folder, table


@pytest.fixture
def copy(stored, tmp_path):
    import shutil

    return shutil.copytree(stored[0], tmp_path / "copy")


def again(folder):
    return fk.sweep(
        make, grid={"speed": [0.5, 1.0]}, seeds=2, measures=["flocks"], out=folder, workers=1, progress=False
    )


def test_every_bit_that_flips_is_noticed_or_changes_nothing(stored, copy):
    _, table = stored
    path = sorted((copy / "rows").iterdir())[0]
    content = path.read_bytes()
    refused = 0
    for place in range(0, len(content), 3):
        path.write_bytes(content[:place] + bytes([content[place] ^ 4]) + content[place + 1 :])
        count("sweeps: files damaged")
        message = refusal(copy)
        if message is None:
            assert fk.read_sweep(copy).rows == table.rows
        else:
            assert "delete this file" in message
            refused += 1
    assert refused > len(content) // 6


@pytest.mark.parametrize("name", ["sweep.json", "chunk"])
def test_truncated_files_are_told_by_name(copy, name):
    path = copy / name if name != "chunk" else sorted((copy / "rows").iterdir())[0]
    path.write_bytes(path.read_bytes()[:-20])
    count("sweeps: files damaged")
    for read in (fk.read_sweep, again):
        with pytest.raises(StorageError, match="damaged") as caught:
            read(copy)
        assert str(path) in str(caught.value)


def test_a_damaged_chunk_that_was_deleted_is_made_anew(stored, copy):
    path = sorted((copy / "rows").iterdir())[0]
    path.write_bytes(b"")
    path.unlink()
    table = again(copy)
    assert table.complete
    assert (table.values("flocks") == stored[1].values("flocks")).all()


def test_what_a_kill_left_half_written_is_swept_away(copy):
    (copy / "rows" / "00000009.json.77.partial").write_text("{")
    assert again(copy).complete
    assert not list(copy.rglob("*.partial"))


def test_a_newer_format_is_refused_by_number(copy):
    record = json.loads(json.loads((copy / "sweep.json").read_text())["body"])
    (copy / "sweep.json").write_text(sealed({**record, "format": 2}))
    with pytest.raises(StorageError, match="newer version of flocking"):
        fk.read_sweep(copy)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seeds": 10**7}, "at most 100000 runs"),
        (
            {"sample": {"method": "sobol", "count": 10**9, "ranges": {"a": [0, 1]}, "log": [], "seed": 0}},
            "at most 100000",
        ),
        ({"grid": {f"x{k}": [1.0] for k in range(5000)}}, "at most 100 parameters"),
    ],
)
def test_a_record_that_asks_for_too_much_is_refused_before_anything_is_made(copy, change, message):
    record = json.loads(json.loads((copy / "sweep.json").read_text())["body"])
    plan = {**record["plan"], **change}
    (copy / "sweep.json").write_text(sealed({**record, "plan": plan}))
    count("sweeps: files damaged")
    with pytest.raises(StorageError, match=message):
        fk.read_sweep(copy)


def test_larger_sweeps_are_read_when_asked_for(tmp_path):
    fk.sweep(make, seeds=3, measures=["flocks"], out=tmp_path / "out", workers=1, progress=False)
    with pytest.raises(StorageError, match="Pass most_runs=3"):
        fk.read_sweep(tmp_path / "out", most_runs=2)
    assert fk.read_sweep(tmp_path / "out", most_runs=3).complete


def test_nothing_is_no_sweep(tmp_path):
    with pytest.raises(StorageError, match="no sweep here"):
        fk.read_sweep(tmp_path)


def test_links_to_elsewhere_are_not_followed(copy, tmp_path):
    outside = tmp_path / "outside"
    (copy / "rows").rename(outside)
    (copy / "rows").symlink_to(outside)
    with pytest.raises(StorageError, match="link to elsewhere"):
        again(copy)
    assert len(fk.read_sweep(copy)) == 0


ROW = {
    "index": 0, "status": "ok", "values": {"flocks": 1}, "verdicts": {}, "message": "", "tries": 1, "seconds": 0.1
}  # fmt: skip


@pytest.mark.parametrize(
    "change",
    [
        {"index": 4}, {"index": -1}, {"index": True}, {"index": "0"}, {"status": "fine"}, {"values": {"flocks": "x"}},
        {"values": []}, {"verdicts": {"a": 1}}, {"message": 3}, {"message": "x" * 501}, {"tries": 1.5},
        {"tries": 10**400}, {"values": {"flocks": 10**400}}, {"values": {"flocks": -(10**30)}},
        {"seconds": "1"}, {"extra": 1},
    ],
)  # fmt: skip
def test_rows_that_no_run_could_give_are_refused(copy, change):
    (copy / "rows" / "00000000.json").write_text(sealed({"rows": [{**ROW, **change}]}))
    count("sweeps: files damaged")
    with pytest.raises(StorageError, match="damaged"):
        fk.read_sweep(copy)


def refusal(folder):
    """The message of a sweep that is refused; anything but a refusal goes through."""
    try:
        found = fk.read_sweep(folder)
    except StorageError as error:
        return str(error)
    assert found.columns["run"] == sorted(found.rows)
    assert found.summary() is not None
    return None


@pytest.mark.parametrize("change", [
    lambda record: record.update(measures="latin"),
    lambda record: record.update(measures={"speed": "speed"}),
    lambda record: record.update(measures={"run": "run"}),
    lambda record: record.update(measures=dict.fromkeys(map(str, range(10**5)), "")),
    lambda record: record["plan"]["grid"].update(speed="x" * 10**6),
])  # fmt: skip
def test_records_with_other_measures_or_values_are_refused_in_a_few_words(copy, change):
    path = copy / "sweep.json"
    record = json.loads(json.loads(path.read_text())["body"])
    change(record)
    path.write_text(sealed(record))
    with pytest.raises(StorageError, match="the record of the sweep is invalid") as error:
        fk.read_sweep(copy)
    assert len(str(error.value)) < 600
    count("sweeps: records changed")


def test_a_measure_has_no_name_of_a_parameter():
    measures = {"speed": lambda run: 1.0}
    with pytest.raises(InvalidInput, match="must not have the name of a parameter of the sweep; got 'speed'"):
        fk.sweep(make, grid={"speed": [0.5]}, measures=measures, workers=1, progress=False)


def test_rows_name_the_versions_that_made_them(tmp_path, monkeypatch):
    """A sweep that goes on with another version says so, and does not pass its rows off as those of one."""
    from flocking.study.sweeps import sweep as module

    older, newer = {"flocking": "1.0", "numpy": "1", "python": "3"}, {"flocking": "2.0", "numpy": "1", "python": "3"}
    given = {"grid": {"speed": [1.0, 2.0]}, "out": tmp_path / "sweep", "workers": 1, "progress": False}
    monkeypatch.setattr(module, "versions", lambda: older)
    assert fk.sweep(make, **given).versions == (older,)
    for chunk in (tmp_path / "sweep" / "rows").glob("*.json"):
        body = json.loads(json.loads(chunk.read_text())["body"])
        chunk.write_text(sealed({**body, "rows": [row for row in body["rows"] if row["index"] == 0]}))
    monkeypatch.setattr(module, "versions", lambda: newer)
    assert fk.read_sweep(tmp_path / "sweep").versions == (older,)
    found = fk.sweep(make, **given)
    assert (found.status, found.versions) == ("finished", (older, newer))
    assert fk.read_sweep(tmp_path / "sweep").versions == (older, newer)
    assert fk.sweep(make, **given).versions == (older, newer)
