"""Which target of the Makefile runs which tests: none is left out, and repetitions run in no other than theirs."""

from __future__ import annotations

import itertools
import re
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.slow_cases import LONGEST, NAMED, SAMPLED, mark_slow_cases, put_longest_first

ROOT = Path(__file__).resolve().parents[2]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["pytest"]["ini_options"]
MARKERS = [line.split(":")[0] for line in SETTINGS["markers"]]
EXTRAS = ["mpi", "cluster", "browser", "server", "emulator", "nodes", "peers", "wheel"]
"""Markers of tests that need packages of an extra, or environments of their own."""

MAKEFILE = (ROOT / "Makefile").read_text().replace("\\\n", " ")


def variable(name: str) -> str:
    """Value of a variable of the Makefile."""
    found = re.search(rf"^{name} :?\??= ?(.*)$", MAKEFILE, re.MULTILINE)
    assert found, name
    return found[1]


def recipe(target: str) -> str:
    """Commands of a target, variables of its selection put in."""
    found = re.search(rf"^{target}:.*\n((?:\t.*\n)+)", MAKEFILE, re.MULTILINE)
    assert found, target
    return found[1].replace("$(VALIDATION)", variable("VALIDATION"))


def selected(expression: str, *marks: str) -> bool:
    """Whether pytest's ``-m`` with this expression runs a test with these markers."""
    return bool(eval(expression, {"__builtins__": {}}, {name: name in marks for name in MARKERS}))


def selection(target: str) -> str:
    """What a target gives to ``-m``."""
    found = re.search(r'-m ("[^"]+"|\w+) ', recipe(target).replace("-m pytest ", ""))
    assert found, target
    return found[1].strip('"')


def robustness(tier: str) -> str:
    return selection("robustness").replace("$(TIER_$(TIER))", variable(f"TIER_{tier}"))


def test_the_longest_test_begins_first_and_all_others_keep_their_order() -> None:
    file, _, name = LONGEST.partition("::")
    assert f"def {name}(" in (ROOT / file).read_text()
    items: list[Any] = [SimpleNamespace(nodeid=name) for name in ("b", "a", LONGEST, "c")]
    put_longest_first(items)
    assert [item.nodeid for item in items] == [LONGEST, "b", "a", "c"]


class Case:
    """A collected case of a test, with the markers it has."""

    def __init__(self, nodeid: str, *marks: str) -> None:
        self.nodeid, self.marks = nodeid, set(marks)

    def get_closest_marker(self, name: str) -> bool:
        return name in self.marks

    def add_marker(self, mark: pytest.MarkDecorator) -> None:
        self.marks.add(mark.name)


def test_of_sampled_tests_every_kth_case_stays_in_the_default_tier() -> None:
    name = next(name for name, k in SAMPLED.items() if k == 3 and not any(one.startswith(name) for one in NAMED))
    items: list[Any] = [
        Case(f"{name}[slow]", "slow"),
        *(Case(f"{name}[{k}]") for k in range(7)),
        Case("tests/a.py::test_b"),
    ]
    missing = mark_slow_cases(items)
    stays = [item.nodeid for item in items if not item.marks]
    assert stays == [f"{name}[0]", f"{name}[3]", f"{name}[6]", "tests/a.py::test_b"]
    # Further tests of the file that the lists name were not collected.
    file = name.partition("::")[0]
    assert missing == {one for one in NAMED | set(SAMPLED) if one.startswith(f"{file}::")} - {name}


def test_sampled_tests_are_sorted_and_have_cases_left() -> None:
    assert list(SAMPLED) == sorted(SAMPLED)
    assert all(2 <= k <= 7 for k in SAMPLED.values())
    assert not set(SAMPLED) & NAMED


DEFAULT = re.search(r"-m '([^']+)'", SETTINGS["addopts"])[1]  # type: ignore[index]
SETS = [marks for k in range(3) for marks in itertools.combinations(["slow", "repeated", *EXTRAS], k)]


@pytest.mark.parametrize("marks", SETS, ids=lambda marks: "-".join(marks) or "none")
def test_default_and_validation_take_no_repetition_and_no_extra(marks: tuple[str, ...]) -> None:
    assert selected(DEFAULT, *marks) == (marks == ())
    assert selected(selection("validate"), *marks) == (marks == ("slow",))


@pytest.mark.parametrize("extra", EXTRAS)
def test_slow_tests_of_an_extra_are_run_by_its_target(extra: str) -> None:
    target = {"server": "test-browser"}.get(extra, f"test-{extra}")
    assert selected(selection(target), extra)
    assert selected(selection(target), extra, "slow")


@pytest.mark.parametrize("extra", ["cluster", "server", "nodes"])
def test_repetitions_that_robustness_runs_are_left_out_of_the_target_of_their_extra(extra: str) -> None:
    assert (
        f"$({'LAB' if extra == 'server' else extra.upper()}_READY)"
        in MAKEFILE.partition("\nrobustness:")[2].splitlines()[0]
    )
    assert selected(robustness("slow"), extra, "repeated")
    target = {"server": "test-browser"}.get(extra, f"test-{extra}")
    assert not selected(selection(target), extra, "repeated")
    assert selected(selection(target), extra)


@pytest.mark.parametrize("extra", [*EXTRAS, ""])
def test_robustness_runs_repetitions_in_its_slow_tier_alone(extra: str) -> None:
    marks = ["repeated", *([extra] if extra else [])]
    assert not selected(robustness("quick"), *marks)
    assert selected(robustness("slow"), *marks) == (extra not in ("mpi", "browser"))
    assert selected(robustness("slow"), "slow")
    assert selected(robustness("quick"), *marks[1:]) == (extra not in ("mpi", "browser"))
    assert selected(selection("fuzz"), "repeated")


def places() -> set[str]:
    """Files and folders that `make robustness` runs."""
    return set(re.findall(r"(?<=\s)tests/[\w/.]+", recipe("robustness")))


def covered(path: str) -> bool:
    """Whether it is among them, or needs ranks: `make test-mpi` runs all tests of these."""
    return any(path == place or path.startswith(f"{place}/") for place in {*places(), "tests/mpi"})


REPEATED = "mark." + "repeated"


def files_with_repetitions() -> set[str]:
    """Files of tests with the marker, or with a function of another file that sets it."""
    texts = {path: path.read_text() for path in (ROOT / "tests").rglob("*.py")}
    marked = {path for path, text in texts.items() if REPEATED in text}
    modules = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in marked]
    imported = re.compile("|".join(rf"from {re.escape(module)} import" for module in modules))
    found = marked | {path for path, text in texts.items() if imported.search(text)}
    return {path.relative_to(ROOT).as_posix() for path in found if path.name.startswith("test_")}


def test_robustness_has_each_file_with_repetitions() -> None:
    assert all((ROOT / place).exists() for place in places())
    found = files_with_repetitions()
    assert len(found) > 15
    assert {"tests/machines/test_signals.py", "tests/engine/nodes/test_signals.py", "tests/fuzz/test_files.py"} <= found
    assert [path for path in sorted(found) if not covered(path)] == []


def test_robustness_has_each_file_that_the_page_on_safety_counts() -> None:
    rows = [line for line in (ROOT / "docs" / "safety.md").read_text().splitlines() if line.startswith("| ")]
    counted = {path for line in rows for path in re.findall(r"tests/[\w/]+\.py", line)}
    assert len(counted) > 15
    assert [path for path in sorted(counted) if not covered(path)] == []


def test_validation_and_the_default_tests_run_side_by_side() -> None:
    for target in ("test", "validate"):
        assert "-n $(WORKERS) --dist worksteal" in recipe(target)
