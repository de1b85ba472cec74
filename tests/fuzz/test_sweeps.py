"""Sweep files and stored sweeps from strangers: read, or refused with every fault at its place."""

from __future__ import annotations

import copy
import json
import shutil
import tomllib
import zlib
from pathlib import Path
from typing import Any

import tomli_w
from hypothesis import strategies as st

import flocking as fk
from flocking.papers.sweep_scenarios import sweep_scenarios
from flocking.study.sweeps.sweep_file import SweepFileError, read_sweep_file
from tests.fuzz.formulas import FORMULAS
from tests.fuzz.guard import files_below, fuzz, guarded
from tests.study.scenario_files.random_files import places
from tests.study.sweeps.sweep_cases import make
from tests.study.sweeps.test_sweep_file import OF_A_PAPER, WRITTEN

BASES = [tomllib.loads(text) for text in (OF_A_PAPER, WRITTEN)]
FAMILIES = sweep_scenarios()

VALUES = st.recursive(
    st.just("soon")
    | st.booleans()
    | st.integers(-(10**30), 10**30)
    | st.floats(allow_nan=True, allow_infinity=True)
    | st.text(max_size=12)
    | st.sampled_from(["zhou-2015", "side", "__import__('os')", "x" * 3000, "sobol", "../..", "start.n", "flocks"])
    | st.sampled_from([10**6, 10**7, 2**63, 1e308, [0.0] * 9000, {"low": -1.0, "high": 1e9, "count": 10_000}])
    | FORMULAS.filter(str.isprintable),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
TEXTS = st.text(max_size=200) | st.binary(max_size=200).map(lambda raw: raw.decode("latin-1"))


@fuzz("sweep files")
def test_sweep_files(data: Any, folder: Path) -> None:
    if data.draw(st.integers(0, 5)) == 0:
        raw = data.draw(TEXTS).encode("utf-8", "surrogateescape")
    else:
        raw = tomli_w.dumps(_changed(data, data.draw(st.sampled_from(BASES)), VALUES)).encode()
    (folder / "case.toml").write_bytes(raw)
    before = files_below(folder)
    with guarded("sweep files"):
        try:
            file = read_sweep_file(folder / "case.toml", FAMILIES, most_agents=2000)
        except SweepFileError as error:
            assert error.problems
            assert "Traceback" not in str(error)
            assert "np.float64" not in str(error)
        else:
            assert 1 <= file.plan.size <= 100_000
            assert file.measures
            assert file.plan.task(file.plan.size - 1).parameters is not None
    assert files_below(folder) == before


def _changed(data: Any, base: Any, values: Any) -> Any:
    """A copy of nested tables in which one to three entries are replaced, removed or added."""
    table = json.loads(json.dumps(base))
    for _ in range(data.draw(st.integers(1, 3))):
        found = [path for path in places(table) if path]
        if not found:
            break
        *path, last = data.draw(st.sampled_from(found))
        owner = table
        for key in path:
            owner = owner[key]
        action = data.draw(st.sampled_from(["replace", "replace", "remove", "add"]))
        if action == "remove":
            del owner[last]
        elif action == "add" and isinstance(owner, dict):
            owner[data.draw(st.text(min_size=1, max_size=8))] = copy.deepcopy(data.draw(values))
        else:
            owner[last] = copy.deepcopy(data.draw(values))
    return table


JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**30), 10**30)
    | st.sampled_from([10**5, 10**7, 10**9, "../../x", "/etc/passwd", "latin", "x" * 5000])
    | st.floats()
    | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=5,
)
FILES = ("sweep.json", "rows/00000000.json")


def _sealed(content: Any) -> str:
    """A file with a checksum that fits what it now says: the work of someone who means it."""
    body = json.dumps(content)
    return json.dumps({"body": body, "seal": zlib.crc32(body.encode())})


@fuzz("stored sweeps")
def test_stored_sweeps(data: Any, folder: Path) -> None:
    original = folder / "original"
    if not original.exists():
        sample = fk.Sample("sobol", 2, {"n": (2, 4)})
        fk.sweep(
            make, grid={"speed": [0.5, 1.0]}, sample=sample, seeds=2, measures=["flocks"], out=original, workers=1,
            progress=False,
        )  # fmt: skip
    case = folder / "case"
    shutil.rmtree(case, ignore_errors=True)
    shutil.copytree(original, case)
    path = case / data.draw(st.sampled_from(FILES))
    raw = path.read_bytes()
    if data.draw(st.integers(0, 4)):
        content = json.loads(json.loads(raw)["body"])
        path.write_text(_sealed(_changed(data, content, JSON)))
    else:
        cut = data.draw(st.integers(0, len(raw)))
        path.write_bytes(raw[:cut] + data.draw(st.binary(max_size=4)) + raw[cut + data.draw(st.integers(0, 3)) :])
    before = files_below(folder)
    with guarded("stored sweeps"):
        found = fk.read_sweep(case)
        assert found.columns["run"] == sorted(found.rows)
        assert found.summary() is not None
        assert found.dataset is not None
    assert files_below(folder) == before
