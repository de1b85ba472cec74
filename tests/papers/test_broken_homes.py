"""The tests of rows notice when their homes are broken; ``python -m tests.papers.broken`` lists what survives."""

from __future__ import annotations

import ast
import math
import os
import signal
import textwrap
import time
from contextlib import suppress

import numpy as np
import pytest

import flocking as fk
from flocking.papers.equation_table import Row
from tests.papers.broken import running
from tests.papers.broken.__main__ import homes, outcomes, told
from tests.papers.broken.edits import edits_of
from tests.papers.broken.homes import Mutant
from tests.papers.broken.running import break_home
from tests.papers.transcriptions.rows import ROWS, identity

FUNCTION = """
def f(x: Array, k: int = 2) -> float:
    if x < 0:
        raise ValueError("negative")
    y = 0.5 * x[0, 1] + k
    return g(y, x) - 1e-9
"""


def edits() -> dict[str, list[str]]:
    function = ast.parse(textwrap.dedent(FUNCTION)).body[0]
    assert isinstance(function, ast.FunctionDef)
    found: dict[str, list[str]] = {}
    for edit in edits_of(function):
        with edit.applied():
            found.setdefault(edit.kind, []).append(ast.unparse(ast.fix_missing_locations(function)))
    assert ast.unparse(function) == ast.unparse(ast.parse(FUNCTION).body[0]), "an edit is undone"
    return found


def test_a_function_is_broken_in_every_way_its_source_allows() -> None:
    found = edits()
    assert any("0.5 * x[0, 1] - k" in source for source in found["sign"])
    assert any("0.5 / x[0, 1]" in source for source in found["factor"])
    assert any("1.5 * x[0, 1]" in source for source in found["constant"])
    assert any("x[1, 0]" in source for source in found["index"])
    assert any("g(x, y)" in source for source in found["swap"])
    assert any("return 0.0" in source for source in found["return"])


def test_checks_of_arguments_are_left_alone() -> None:
    assert all("if x < 0:" in source for kind in edits().values() for source in kind if "return 0.0" not in source
               and "return 1.0" not in source)  # fmt: skip


HOME = "flocking.study.nets.matrices.degree_matrix"


def test_a_test_that_looks_at_nothing_lets_every_fault_live() -> None:
    found = break_home(HOME, test=lambda r: r.build(1.0) is None, check=lambda: None)
    assert found.rows == ("olfati-saber-2003 (10)",)
    assert found.tried >= 4
    assert len(found.survivors) >= found.tried - 2, "only faults that raise may be noticed"


def test_a_row_that_never_runs_its_home_is_a_survivor() -> None:
    (survivor,) = break_home(HOME, most=1, test=lambda r: None).survivors
    assert survivor == "olfati-saber-2003 (10): its test does not run its home"


def test_a_row_that_passes_while_its_home_raises_is_a_survivor() -> None:
    def careless(row: Row) -> None:
        with suppress(RuntimeError):
            row.build(1.0)

    assert break_home(HOME, most=1, test=careless).survivors == (
        "olfati-saber-2003 (10): its test passes when its home raises",
    )


def test_a_fault_that_cannot_be_put_in_force_is_not_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    def install() -> None:
        raise ValueError("no such place")

    fault = Mutant("sign", "of nothing", f"{HOME}:1", install)
    monkeypatch.setattr(running, "mutants_of", lambda parts, places: [fault])
    assert "sign: of nothing [study.nets.matrices.degree_matrix:1]" in break_home(HOME).survivors


@pytest.mark.slow
def test_a_test_that_is_stopped_has_noticed_nothing_unless_it_never_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    (row,) = running.rows_at(HOME)
    sound = row.build(1.0)

    def stopped(row: Row) -> None:
        # By the signal of the limit, at once: how long a test takes is for the machine to say.
        if not np.array_equal(row.build(1.0), sound):
            signal.raise_signal(signal.SIGPROF)

    monkeypatch.setattr(running, "ENDLESS", math.inf)
    slow = break_home(HOME, most=4, test=stopped, check=lambda: None).survivors
    assert len(slow) >= 2
    assert all(words.endswith("(a test was stopped)") for words in slow)
    monkeypatch.setattr(running, "ENDLESS", 0.0)
    assert break_home(HOME, most=4, test=stopped, check=lambda: None).survivors == ()


def test_a_row_that_is_stopped_while_its_home_raises_is_a_survivor(monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(row: Row) -> None:
        try:
            row.build(1.0)
        except RuntimeError:
            signal.raise_signal(signal.SIGPROF)

    monkeypatch.setattr(running, "ENDLESS", math.inf)
    assert break_home(HOME, most=1, test=stopped).survivors == (
        "olfati-saber-2003 (10): its test was stopped when its home raises",
    )


def test_work_that_never_ends_is_stopped() -> None:
    def endless() -> None:
        while True:
            pass

    assert running.in_child(HOME, endless, 0.05) == ("time", None)


def test_the_limit_of_time_is_of_the_work_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    def forget(home: str, folder: str) -> None:
        began = time.process_time()
        while time.process_time() < began + 1.0:
            pass

    monkeypatch.setattr(running, "_forget", forget)
    assert running.in_child(HOME, lambda: 3, 0.9) == ("done", 3)


def test_runs_are_computed_anew_after_homes_were_broken() -> None:
    break_home(HOME, most=1, test=lambda r: None)
    scenario = fk.Scenario(fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)]), fk.State([[0.0], [0.5]]), t_end=0.1)
    assert fk.simulate(scenario, progress=False) is not fk.simulate(scenario, progress=False)


@pytest.mark.slow
def test_no_fault_of_any_home_goes_unnoticed() -> None:
    found = list(outcomes(homes(), processes=min(2, os.cpu_count() or 1)))
    assert {row for outcome in found for row in outcome.rows} == {identity(row) for row in ROWS}
    print(f"\n{len(found)} homes, {sum(o.tried for o in found)} faults, {sum(o.seconds for o in found):.0f} s")
    alive = [told(outcome) for outcome in found if outcome.survivors]
    assert not alive, "\n".join(alive)
