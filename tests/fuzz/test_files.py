"""Scenario files mutated at random: read, or refused with every fault at its place."""

from __future__ import annotations

import copy
import json
import tomllib
from pathlib import Path
from typing import Any

import tomli_w
from hypothesis import strategies as st

import flocking as fk
from flocking.study.scenario_files.scenario_file import ScenarioFileError, parse_scenario, read_scenario
from tests.fuzz.formulas import FORMULAS
from tests.fuzz.guard import files_below, fuzz, guarded
from tests.study.scenario_files.random_files import BASES, VALUES, places

TEXTS = st.text(max_size=60) | st.lists(
    st.sampled_from(
        ["[", "]", "{", "}", "=", '"', "a", ".", "\n", "1", "nan", "inf", "[[terms]]", "kind = ", "0x", "'''"]
    ),
    max_size=40,
).map("".join)

LARGE = st.sampled_from([10**6, 10**9, 10**18, 2**63, 1e308, -1, 0, [[0.0] * 2] * 3000, "x" * 100_000])


@fuzz("files")
def test_files(data: Any, folder: Path) -> None:
    before = files_below(folder)
    if data.draw(st.integers(0, 5)) == 0:
        raw = data.draw(TEXTS | st.binary(max_size=80)).__str__().encode("utf-8", "surrogateescape")
    else:
        table = json.loads(json.dumps(data.draw(st.sampled_from(BASES))))
        for _ in range(data.draw(st.integers(1, 3))):
            found = [p for p in places(table) if p]
            if not found:
                break
            *path, last = data.draw(st.sampled_from(found))
            owner = table
            for key in path:
                owner = owner[key]
            if data.draw(st.integers(0, 5)) == 0:
                del owner[last]
            else:
                owner[last] = copy.deepcopy(data.draw(VALUES | LARGE | FORMULAS.filter(_plain)))
        raw = tomli_w.dumps(table).encode()
        assert tomllib.loads(raw.decode()) is not None
    (folder / "case.toml").write_bytes(raw)
    with guarded("files"):
        try:
            assert isinstance(read_scenario(folder / "case.toml", most_agents=2000), fk.Scenario)
        except ScenarioFileError as error:
            assert error.problems
            assert "Traceback" not in str(error)
            assert "np.float64" not in str(error)
    assert files_below(folder) - before <= {"case.toml"}


def _plain(text: str) -> bool:
    return text.isprintable()


def test_a_file_that_asks_for_too_much_is_refused_before_it_is_made() -> None:
    base = {"t_end": 1.0, "graph": {"kind": "proximity", "radius": 1.0}, "terms": [{"kind": "consensus"}]}
    start = {"draw": "box", "side": 1.0, "seed": 0}
    for n in (10**7, 10**12, 10**30):
        with guarded("files"):
            parse_scenario(tomli_w.dumps({**base, "start": {**start, "n": n}}))
            raise AssertionError("read")
